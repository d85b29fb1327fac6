//! The bodies that strands stay out of, at one moment.

use super::clearances::{Clearances, DistanceBounds, SEARCH_RADIUS};
use crate::contact::Bodies;
use nalgebra::{Isometry3, Vector3};

/// The bodies at one moment.
#[derive(Debug, Clone, Copy)]
pub struct Obstacles<'a> {
    /// The bodies, prepared for `time`.
    pub bodies: &'a Bodies,
    /// The moment, s.
    pub time: f64,
    /// Rest space to world, one pose per body.
    pub poses: &'a [Isometry3<f64>],
}

impl Obstacles<'_> {
    /// Largest violation at `x` (m, world) of the distance to `keep` from each body, m, with the outward
    /// normal of that body; 0 if there is none. `x` lies `moved`, m, from the place that `bounds` are for;
    /// they are updated to `x`.
    pub(super) fn violation(
        &self,
        keep: impl Fn(usize) -> f64,
        x: &Vector3<f64>,
        moved: f64,
        bounds: &mut DistanceBounds,
    ) -> (f64, Vector3<f64>) {
        let mut worst = (0.0, Vector3::zeros());
        for (b, bound) in bounds.iter_mut().enumerate() {
            let keep = keep(b);
            *bound -= moved;
            if keep == f64::NEG_INFINITY || *bound > keep {
                continue;
            }
            let pose = &self.poses[b];
            let local = pose.inverse_transform_point(&(*x).into()).coords;
            let [least, most] = self.bodies.distance_bounds(b, &local);
            if least > keep {
                *bound = least;
                continue;
            }
            let closest = |radius| self.bodies.closest(b, self.time, &local, radius);
            let radius = most.min(moved + SEARCH_RADIUS);
            // Farther from the surface than that, only a full search tells whether it is outside.
            let Some(surface) = closest(radius).or_else(|| closest(f64::INFINITY)) else { continue };
            *bound = surface.distance;
            if keep - surface.distance > worst.0 {
                worst = (keep - surface.distance, pose.rotation * surface.normal);
            }
        }
        worst
    }

    /// Depth of the deepest of the vertices at `points`, m, world, that the groom places outside the bodies,
    /// m; 0 if none is inside. Vertices of which `is_clear` holds need no search.
    pub(super) fn depth(
        &self,
        clearances: &Clearances,
        points: impl Iterator<Item = Vector3<f64>>,
        is_clear: impl Fn(usize, &Vector3<f64>) -> bool,
        bounds: &mut DistanceBounds,
    ) -> f64 {
        bounds.reset(self.poses.len());
        let (mut last, mut deepest) = (None, 0.0_f64);
        for (vertex, x) in points.enumerate() {
            let moved = last.replace(x).map_or(0.0, |last: Vector3<f64>| (x - last).norm());
            if is_clear(vertex, &x) {
                bounds.move_by(moved);
            } else {
                let surface = |body| clearances.surface(body, vertex);
                deepest = deepest.max(self.violation(surface, &x, moved, bounds).0);
            }
        }
        deepest
    }

    /// `x` (m, world) moved out of one body after the other until `vertex` violates its clearance by at most
    /// `allowed`, m.
    pub(super) fn push_out(
        &self,
        clearances: &Clearances,
        vertex: usize,
        x: &Vector3<f64>,
        allowed: f64,
    ) -> Vector3<f64> {
        self.poses.iter().enumerate().fold(*x, |x, (b, pose)| {
            let keep = clearances.get(b, vertex) - allowed;
            let local = pose.inverse_transform_point(&x.into()).coords;
            match self.bodies.closest(b, self.time, &local, SEARCH_RADIUS) {
                Some(s) if s.distance < keep => x + pose.rotation * s.normal * (keep - s.distance),
                _ => x,
            }
        })
    }

    /// Distance of `x` (m, world) from the closest body, m, at most `radius`; negative inside a body.
    pub(super) fn distance(&self, x: &Vector3<f64>, radius: f64) -> f64 {
        let distance = |(b, pose): (usize, &Isometry3<f64>)| {
            let local = pose.inverse_transform_point(&(*x).into()).coords;
            let closest = |radius| self.bodies.closest(b, self.time, &local, radius);
            // Deep inside a body no surface is near either. Deforming bodies have no bounds: contact keeps
            // guides out of them.
            let [least, _] = self.bodies.distance_bounds(b, &local);
            let may_be_deep = least.is_finite() && least <= -radius;
            let deep = || if may_be_deep { closest(f64::INFINITY) } else { None };
            closest(radius).or_else(deep).map_or(radius, |s| s.distance.min(radius))
        };
        self.poses.iter().enumerate().map(distance).fold(radius, f64::min)
    }
}
