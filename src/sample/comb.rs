//! Hair that grows on the scalp, is combed, falls around the head and is cut.

use super::head;
use super::scalp::{Chance, Root};
use super::style::{Comb, Cut};
use super::tail::{TAIL_BEND, TIE, braid};
use crate::math::frame::rotation_minimising;
use crate::math::smoothstep;
use crate::math::spline::ArcSpline;
use nalgebra::{Rotation3, Vector3};
use std::f64::consts::TAU;

type V = Vector3<f64>;

/// Growth steps of the longest hair, and the range of their length, m.
const STEPS: f64 = 45.0;
const STEP: (f64, f64) = (0.001, 0.006);
/// Where hair turns around the crown, m.
const WHORL: V = V::new(0.014, 0.232, -0.052);
/// Distance from the whorl within which hair turns around it, m.
const WHORL_RADIUS: f64 = 0.030;
/// Roots within this distance of the middle go into the middle strand of a braid, m.
const MIDDLE: f64 = 0.03;
/// How far inside the hairline hair has its full length where it is shorter at the line, rad.
const FADE: f64 = 0.7;
/// Height of the lowest roots over that of the centre of the head, as a share of their distance from it.
const LOWEST: f64 = -0.9;
/// Heights between which hair of the top passes into hair of the sides, m.
const SIDES: (f64, f64) = (0.20, 0.14);
/// Standard deviation of the heights at which strands are cut, m, where they may lose all of their length.
const HEM_SPREAD: f64 = 0.06;
/// Height of the fringe and its standard deviation, m: just above the brows.
const FRINGE: (f64, f64) = (0.150, 0.004);
/// Roots of the fringe lie in front of the first of these depths and within the second from the middle, m.
const FRINGE_ROOTS: (f64, f64) = (0.020, 0.053);
/// Standard deviation of the places at which hair is parted, on the scalp, m.
const PARTING_SPREAD: f64 = 0.003;
/// Most steps that lift a point out of the body.
const LIFTS: usize = 6;
/// How steeply hanging hair leans to the axis of the neck, per m from it.
const TOGETHER: f64 = 3.5;
/// Least height of hair above skin, m.
const LEAST_HEIGHT: f64 = 0.0012;
/// Height of the undermost layer of hair above skin, m.
const UNDERMOST: f64 = 0.004;
/// Height above its layer within which the comb leads a hair, m; higher, it falls.
const REACH: f64 = 0.02;
/// Height above its layer within which a hair slides along it, m.
const NEAR: f64 = 0.01;
/// Length along which a hair rises to its layer, m.
const RISE: f64 = 0.03;

/// What is the same along a hair.
struct Hair<'a> {
    cut: &'a Cut,
    root: Root,
    /// Side of the parting, −1 or 1.
    side: f64,
    /// Whether it hangs over the forehead.
    fringe: bool,
    /// Stray part of its direction.
    stray: V,
    /// Place in a ponytail: offset from its middle over its radius.
    place: V,
}

/// The course of a hair from its root, without curls.
pub(super) fn course(cut: &Cut, root: &Root, stray: f64) -> Vec<V> {
    let hair = Hair::new(cut, *root, stray);
    let (_, up) = head::height(root.x);
    let side = smoothstep([SIDES.0, SIDES.1], root.x.y);
    let length = cut.length[0] + (cut.length[1] - cut.length[0]) * side;
    let length = length * (1.0 - cut.fade * smoothstep([FADE, 0.0], root.inside));
    let length = length * (1.0 - cut.uneven * root.random(Chance::Shorter) * root.random(Chance::Uneven));
    // Hair that grows higher lies on top: from 0 at the nape to 1 at the crown.
    let rank = (root.direction.y - LOWEST) / (1.0 - LOWEST);
    let layer = UNDERMOST + cut.curl[0] + cut.body * rank * (0.6 + 0.4 * root.random(Chance::Layer));
    let hem = cut.hem + cut.layers * rank + HEM_SPREAD * cut.uneven * root.normal(Chance::Hem);

    let step = (length / STEPS).clamp(STEP.0, STEP.1);
    let mut x = root.x;
    let mut along = (up * 1.2 + hair.direction(x, up, 1.0) * 0.6 + hair.stray * 2.0).normalize();
    let mut out = vec![x];
    for i in 1..=(length / step).round() as usize {
        let grown = i as f64 * step;
        x += along * step;
        let (height, normal) = head::height(x);
        let lift = (least_height(grown) - height).max(0.0);
        x += normal * lift;
        out.push(x);
        if cut.comb == Comb::Braided && x.z < TIE.0.z {
            let strand = if root.x.x.abs() < MIDDLE { 0.0 } else { root.x.x.signum() };
            let shorter = cut.uneven * root.random(Chance::Shorter);
            braid(&mut out, strand, &hair.place, shorter, step);
            break;
        }
        let hem = if hair.fringe { FRINGE.0 + FRINGE.1 * root.normal(Chance::Hem) } else { hem };
        if x.y < hem && i >= 3 && hair.may_be_cut(x) {
            break;
        }
        let over_layer = height + lift - LEAST_HEIGHT.max(layer * smoothstep([0.0, RISE], grown));
        let led = smoothstep([REACH, 0.0], over_layer);
        let stray = Rotation3::new(up * (TAU * grown / cut.wander)) * hair.stray;
        let mut direction = hair.direction(x, normal, led) + stray * (0.3 + 0.7 * led);
        if over_layer < NEAR {
            // Slide along the surface and rise to the layer.
            direction -= normal * direction.dot(&normal).min(0.0);
            direction += normal * (-3.0 * over_layer / NEAR).clamp(-0.4, 1.2);
        }
        let towards = direction.try_normalize(1e-9).unwrap_or(along);
        along = (along + (towards - along) * (step / cut.bend).min(1.0)).normalize();
    }
    out
}

/// Least height of a point of a hair, `grown` m from its root, above skin, m.
fn least_height(grown: f64) -> f64 {
    LEAST_HEIGHT * (grown / 0.01).min(1.0)
}

/// Moves a point of a hair, `grown` m from its root, to its least height.
fn lift(mut x: V, grown: f64) -> V {
    // Deep within, distances are of first order only.
    for _ in 0..LIFTS {
        let (height, normal) = head::height(x);
        if height >= least_height(grown) {
            break;
        }
        x += normal * (least_height(grown) - height);
    }
    x
}

impl<'a> Hair<'a> {
    fn new(cut: &'a Cut, root: Root, stray: f64) -> Self {
        let from_parting = match cut.comb {
            Comb::Parted(start) | Comb::Fringe(start) => root.x.x - parting(start, root.x.z),
            _ => root.x.x,
        };
        // Some hairs lie across the parting.
        let side = if from_parting + PARTING_SPREAD * root.normal(Chance::Side) < 0.0 { -1.0 } else { 1.0 };
        let fringe = matches!(cut.comb, Comb::Fringe(_))
            && root.x.z > FRINGE_ROOTS.0 + PARTING_SPREAD * root.normal(Chance::FringeDepth)
            && root.x.x.abs() < FRINGE_ROOTS.1 + PARTING_SPREAD * root.normal(Chance::FringeWidth);
        let stray = V::from_fn(|k, _| root.normal(Chance::Stray(k as u8))) * stray;
        let radius = root.random(Chance::TailRadius).sqrt();
        let (sin, cos) = (TAU * root.random(Chance::TailTurn)).sin_cos();
        Hair { cut, root, side, fringe, stray, place: V::new(cos, sin, 0.0) * radius }
    }

    /// Which way a hair grows at `x`: the share `led` of it is led by the comb along the skin, the normal of
    /// which is `up`, and the rest falls.
    fn direction(&self, x: V, up: V, led: f64) -> V {
        // Hair hangs together: below the head it comes towards the neck.
        let inwards = smoothstep([0.10, 0.0], x.y) * TOGETHER;
        let down = V::new(-inwards * x.x, -1.0, -inwards * (x.z - head::PIVOT.z));
        // On the top of the head combs lead the hair, below weight does.
        let top = smoothstep([0.150, 0.215], x.y);
        match self.cut.comb {
            Comb::Out => {
                let (_, skin) = head::height(self.root.x);
                skin + (x - head::CENTRE).normalize() * 0.8
            }
            Comb::Whorl => whorl(x, up) * led + down * (1.0 - 0.8 * top * led),
            Comb::Gathered | Comb::Braided => self.gathered(x),
            Comb::Fringe(_) if self.fringe => V::new(6.0 * x.x, 0.0, 1.0) * (top * led) + down,
            Comb::Parted(_) | Comb::Fringe(_) => {
                let front = smoothstep([WHORL.z - 0.01, WHORL.z + 0.04], self.root.x.z);
                let aside = V::x() * self.side - V::z() * 0.35;
                let combed = aside * front + whorl(x, up) * (1.0 - front);
                let aside_share = if matches!(self.cut.comb, Comb::Fringe(_)) { 0.2 } else { 1.0 };
                let forehead = smoothstep([0.01, 0.06], x.z) * smoothstep([0.085, 0.05], x.x.abs());
                let off_the_face = V::new(1.2 * self.side, 0.0, -0.9) * (forehead * aside_share);
                (combed * top + off_the_face) * led + down * (1.0 - 0.6 * top * led)
            }
        }
    }

    /// To the tie, and from there back and down.
    fn gathered(&self, x: V) -> V {
        let (tie, radius) = TIE;
        let place = V::new(self.place.x, self.place.y, 0.0) * (radius * 0.9);
        let to = tie + place - x;
        if to.z < -0.004 {
            // Straight to its place in the bundle.
            return to.normalize();
        }
        // The tail swings out, and widens a little.
        let beyond = (tie.z - x.z).max(0.0) + (tie.y - x.y).max(0.0);
        let back = (-beyond / TAIL_BEND).exp();
        V::new(self.place.x * 0.10, 0.35 * self.place.y.max(0.0), -1.0) * back
            + V::new(self.place.x * 0.05, -1.0, -0.05 * self.place.y) * (1.0 - back)
    }

    /// Whether the hem may cut the hair at `x`: not before it has passed the tie.
    fn may_be_cut(&self, x: V) -> bool {
        !matches!(self.cut.comb, Comb::Gathered | Comb::Braided) || x.z < TIE.0.z
    }
}

/// Where the parting lies at a depth `z`, m to the left of the middle: it wanders from `start`, at the
/// forehead, to the whorl.
fn parting(start: f64, z: f64) -> f64 {
    let back = smoothstep([0.07, WHORL.z], z);
    start + (WHORL.x - start) * back + 0.003 * (z / 0.011).sin() + 0.0015 * (z / 0.0043 + 1.0).sin()
}

/// Away from the whorl along the scalp, and around it near by.
fn whorl(x: V, up: V) -> V {
    let from = x - WHORL;
    let away = from - up * from.dot(&up);
    let turn = (-away.norm() / WHORL_RADIUS).exp();
    let away = away.try_normalize(1e-6).unwrap_or(V::z());
    away * (1.0 - 0.6 * turn) + up.cross(&away) * (1.4 * turn)
}

/// Winds a course into a helix of about the radius `radius`, m, with `vertices` points. Hairs with
/// the same first root wind together, but for what is the hair's own. Curls open from the root.
pub(super) fn curl(course: &[V], cut: &Cut, [with, own]: [&Root; 2], radius: f64, vertices: usize) -> Vec<V> {
    let Some(spline) = ArcSpline::through(course) else { return course.to_vec() };
    let s: Vec<f64> = (0..vertices).map(|v| spline.length() * v as f64 / (vertices - 1) as f64).collect();
    let phase = TAU * with.random(Chance::Phase) + 0.5 * own.normal(Chance::OwnPhase);
    let radius = radius * (0.75 + 0.5 * own.random(Chance::OwnRadius));
    let pitch =
        cut.curl[1] * (0.85 + 0.3 * with.random(Chance::Pitch)) * (1.0 + 0.02 * own.normal(Chance::OwnPitch));
    let open = (1.5 * cut.curl[1]).min(0.05);
    let wind = |(frame, &s): (&nalgebra::UnitQuaternion<f64>, &f64)| {
        let (sin, cos) = (phase + TAU * s / pitch).sin_cos();
        lift(spline.at(s).x + frame * V::new(cos, sin, 0.0) * (radius * smoothstep([0.0, open], s)), s)
    };
    rotation_minimising(&spline, &s, None).iter().zip(&s).map(wind).collect()
}
