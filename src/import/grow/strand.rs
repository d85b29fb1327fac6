//! Grows a strand from a root along the flow of a surface.

use super::surface::{Foot, Place, Surface};
use crate::math::frame::any_frame;
use crate::math::random;
use nalgebra::{Rotation3, Unit, Vector3};
use std::f64::consts::{FRAC_PI_2, TAU};

/// Height above the skin to which fur is brought out beyond its root, m: the default thickness of a collider.
pub(super) const CLEARANCE: f64 = 5e-4;

/// The same as a share of the length of a strand, where that is less: short fur would be kinked to reach more.
const CLEARANCE_SHARE: f64 = 0.05;

/// Share of a strand within which it rises to that height.
const RISE: f64 = 0.3;

/// How much of the turn into the direction that the surface asks for is done over the length of a strand, as
/// an exponent of its rest.
const TURN: f64 = 4.0;

/// Which of the eight random numbers of a strand tells how short it is, and how much a clump draws it; those
/// before tell its azimuth, lift, phase and frizz.
pub(super) const LENGTH: u64 = 7;
pub(super) const CLUMP: u64 = 6;

/// Largest deviations at random: of the azimuth, rad, and of the lift, as a share of it.
const STRAY: [f64; 2] = [0.15, 0.25];

/// What strands are grown by.
pub(super) struct Growth<'a> {
    pub(super) surface: &'a Surface,
    /// The directions at the vertices; see [`super::flow::directions`].
    pub(super) flow: Vec<Vector3<f64>>,
    /// Angle between surface and strand at the root and at the tip, rad.
    pub(super) lift: [f64; 2],
    /// Vertices of a strand.
    pub(super) vertices: usize,
    /// Radius of curls, as a share of the length, and turns.
    pub(super) curl: [f64; 2],
    pub(super) frizz: f64,
    pub(super) seed: u64,
}

impl Growth<'_> {
    /// The direction of growth at a place, where a strand is `lift`, rad, away from the surface, and is turned
    /// by `azimuth`, rad.
    fn direction(&self, place: &Place, normal: &Vector3<f64>, lift: f64, azimuth: f64) -> Vector3<f64> {
        let along = self.surface.mean(&self.flow, place);
        let along = along - normal * along.dot(normal);
        // Where there is no flow, as at the nose, fur stands upright.
        let lean = along.norm().min(1.0);
        let lift = FRAC_PI_2 + (lift - FRAC_PI_2) * lean;
        let along = along.try_normalize(1e-9).unwrap_or_default();
        let along = Rotation3::from_axis_angle(&Unit::new_unchecked(*normal), azimuth) * along;
        (along * lift.cos() + normal * lift.sin()).normalize()
    }

    /// The vertices, m, of the strand with this `number` and `length`, m, that grows at `root`. It may enter
    /// the surface where that is hollow.
    pub(super) fn strand(&self, number: u64, root: &Place, length: f64) -> Vec<Vector3<f64>> {
        let random = |k: u64| 2.0 * random::unit(self.seed, 8 * number + k) - 1.0;
        let azimuth = STRAY[0] * random(0);
        let lift = |u: f64| (self.lift[0] + (self.lift[1] - self.lift[0]) * u) * (1.0 + STRAY[1] * random(1));
        let segments = (self.vertices - 1) as f64;
        let turn = 1.0 - (-TURN / segments).exp();
        let mut x = self.surface.point(root);
        let mut along = self.direction(root, &self.surface.normal(root), lift(0.0), azimuth);
        let mut points = vec![x];
        for v in 1..self.vertices {
            x += along * (length / segments);
            points.push(x);
            if let Some(Foot { place, .. }) = self.surface.foot(&x) {
                let normal = self.surface.normal(&place);
                let wanted = self.direction(&place, &normal, lift(v as f64 / segments), azimuth);
                along = (along + (wanted - along) * turn).try_normalize(1e-6).unwrap_or(along);
            }
        }
        points
    }

    /// A random number in [0, 1) of a strand: `of` is [`LENGTH`] or [`CLUMP`].
    pub(super) fn random(&self, number: u64, of: u64) -> f64 {
        random::unit(self.seed, 8 * number + of)
    }

    /// Winds a strand of `length`, m, around its course: a helix that opens from the root.
    pub(super) fn curl(&self, number: u64, length: f64, points: &mut [Vector3<f64>]) {
        let [radius, turns] = self.curl;
        let last = points.len() - 1;
        let Some(course) = (points[last] - points[0]).try_normalize(1e-12).filter(|_| radius > 0.0) else {
            return;
        };
        let (frame, phase) = (any_frame(&course), TAU * random::unit(self.seed, 8 * number + 2));
        for (v, x) in points.iter_mut().enumerate() {
            let u = v as f64 / last as f64;
            let (sin, cos) = (phase + TAU * turns * u).sin_cos();
            *x += frame * Vector3::new(cos, sin, 0.0) * (radius * length * u);
        }
    }

    /// Bends a strand of `length`, m, aside at random.
    pub(super) fn frizz(&self, number: u64, length: f64, points: &mut [Vector3<f64>]) {
        let aside =
            Vector3::from_fn(|axis, _| 2.0 * random::unit(self.seed, 8 * number + 3 + axis as u64) - 1.0);
        let last = points.len() - 1;
        for (v, x) in points.iter_mut().enumerate() {
            *x += aside * (self.frizz * length * (v as f64 / last as f64).powi(2));
        }
    }

    /// Brings the vertices of a strand of `length`, m, out of the surface, to a height that grows from the root.
    pub(super) fn lift_out(&self, length: f64, points: &mut [Vector3<f64>]) {
        let (last, clearance) = (points.len() - 1, CLEARANCE.min(CLEARANCE_SHARE * length));
        for (v, x) in points.iter_mut().enumerate().skip(1) {
            let least = clearance * (v as f64 / last as f64 / RISE).min(1.0);
            if let Some(foot) = self.surface.foot(x).filter(|foot| foot.height < least) {
                *x += foot.out * (least - foot.height);
            }
        }
    }
}
