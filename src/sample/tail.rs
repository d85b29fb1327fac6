//! Hair that is tied at the back of the head: where, and a braid of three strands from there.

use crate::math::smoothstep;
use nalgebra::Vector3;
use std::f64::consts::TAU;

type V = Vector3<f64>;

/// Where a ponytail is tied, m, and its radius there.
pub(super) const TIE: (V, f64) = (V::new(0.0, 0.176, -0.112), 0.011);
/// Length over which a ponytail bends down, m.
pub(super) const TAIL_BEND: f64 = 0.045;
/// Length from the tie to where the braid is bound, and of the tuft beyond, m.
const LENGTH: (f64, f64) = (0.30, 0.06);
/// Length in which a strand passes across both others and back, m.
const PITCH: f64 = 0.085;
/// How far a strand goes to the sides, and to the front and the back, m.
const WEAVE: (f64, f64) = (0.0115, 0.0055);
/// Length over which strands part behind the tie, and come together where they are bound, m.
const PART: f64 = 0.03;
/// Radii of a strand and of the bound end, m, and how fast the tuft widens.
const RADIUS: (f64, f64) = (0.0075, 0.005);
const WIDENS: f64 = 0.2;
/// Length over which a hair finds its place in the braid, m.
const JOIN: f64 = 0.01;

/// Lets a course that has come to the tie run on in a braid, in steps of about `step`, m. `strand` is −1, 0 or
/// 1; `place` is that in the section of the strand, in the unit disc. The tuft is shorter by the share `shorter`.
pub(super) fn braid(course: &mut Vec<V>, strand: f64, place: &V, shorter: f64, step: f64) {
    let Some(&from) = course.last() else { return };
    let length = LENGTH.0 + LENGTH.1 * (1.0 - shorter);
    let steps = (length / step).ceil();
    let (mut centre, mut entry) = (TIE.0, None);
    for i in 0..=steps as usize {
        let s = length * i as f64 / steps;
        // As a ponytail, it leads back and bends down.
        let back = (-s / TAIL_BEND).exp();
        let along = V::new(0.0, back - 1.0, -back).normalize();
        centre += along * if i > 0 { length / steps } else { 0.0 };
        let woven = smoothstep([0.0, PART], s) * smoothstep([LENGTH.0, LENGTH.0 - PART], s);
        let theta = TAU * (s / PITCH + strand / 3.0);
        let bundle = if s < PART { 0.9 * TIE.1 } else { RADIUS.1 + WIDENS * (s - LENGTH.0).max(0.0) };
        let radius = bundle + (RADIUS.0 - bundle) * woven;
        let aside = woven * WEAVE.0 * theta.sin() + radius * place.x;
        let over = woven * WEAVE.1 * (2.0 * theta).sin() + radius * place.y;
        let x = centre + V::x() * aside + V::x().cross(&along) * over;
        let entry = *entry.get_or_insert(from - x);
        if i > 0 {
            course.push(x + entry * (-s / JOIN).exp());
        }
    }
}
