//! Retraction of strands towards their guides where a body lies between them.
//!
//! Contact keeps a guide on its side of every body, continuously in time. The guide therefore tells on which
//! side of an ear its strands belong, at every moment independently. Where the straight path from the guide
//! to the corresponding vertex of the free chain passes through a body, the vertex is *retracted* along it by
//! a fraction of the path, to in front of the body. A path that leaves a rounded body through a face similar
//! to the one it enters only cuts its curve; there the projection to the nearest surface suffices.

use super::obstacles::Obstacles;
use crate::math::smoothstep;
use nalgebra::Vector3;

/// Cosine of the angle between the faces through which a path enters and leaves: no retraction at the first,
/// full retraction at the second.
const FACE_COSINES: [f64; 2] = [0.7, 0.2];

/// Depth of the end of a path inside a body, m: the projection to the nearest surface is trusted up to the
/// first and not from the second.
const TRUSTED_DEPTHS: [f64; 2] = [0.005, 0.015];

/// Distance in front of the body at which a retracted vertex ends, m.
const STANDOFF: f64 = 1e-3;

impl Obstacles<'_> {
    /// Fraction (0..=1) of the path from `guide` to `free`, m, world, by which the vertex at `free` has to be
    /// retracted. All bodies are at least `clear`, m, from `guide`.
    pub(super) fn retraction(&self, (guide, clear): (&Vector3<f64>, f64), free: &Vector3<f64>) -> f64 {
        let bodies = self.poses.iter().enumerate();
        bodies
            .map(|(b, pose)| {
                let [from, to] = [guide, free].map(|x| pose.inverse_transform_point(&(*x).into()).coords);
                self.retraction_by(b, (&from, clear), &to)
            })
            .fold(0.0, f64::max)
    }

    /// The same for one body, in its rest space.
    fn retraction_by(&self, body: usize, (guide, clear): (&Vector3<f64>, f64), free: &Vector3<f64>) -> f64 {
        let least_distance = |x| self.bodies.distance_bounds(body, x)[0];
        // Two clear balls that cover the path contain no surface.
        if clear.max(least_distance(guide)).max(0.0) + least_distance(free).max(0.0) > (free - guide).norm() {
            return 0.0;
        }
        let hit = |a, b| self.bodies.first_intersection(body, self.time, a, b);
        let Some((fraction, entry)) = hit(guide, free) else { return 0.0 };
        let path = free - guide;
        // The guide is outside: a face that looks along the path is the back of an open sheet.
        let entry = if entry.dot(&path) > 0.0 { -entry } else { entry };
        let Some((_, exit)) = hit(free, guide) else { return 0.0 };
        let weight = if exit.dot(&path) < 0.0 {
            // The path ends inside, or behind an open sheet.
            match self.bodies.closest(body, self.time, free, TRUSTED_DEPTHS[1]) {
                Some(s) => smoothstep(FACE_COSINES, entry.dot(&s.normal))
                    .max(smoothstep(TRUSTED_DEPTHS, s.distance.abs())),
                None => 1.0,
            }
        } else {
            smoothstep(FACE_COSINES, entry.dot(&exit))
        };
        weight * (1.0 - fraction + STANDOFF / path.norm().max(STANDOFF)).min(1.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::contact::Bodies;
    use crate::geometry::Shape;
    use nalgebra::Isometry3;

    /// Retraction by a ball about the origin.
    fn by_ball(radius: f64, guide: [f64; 3], free: [f64; 3]) -> f64 {
        let bodies = Bodies::from_shapes(&[Shape::Sphere { centre: Vector3::zeros(), radius }]);
        let poses = [Isometry3::identity()];
        Obstacles { bodies: &bodies, time: 0.0, poses: &poses }.retraction((&guide.into(), 0.0), &free.into())
    }

    #[test]
    fn retraction_leads_from_beyond_a_body_to_in_front_of_it() {
        // A path of 2 cm through the centre of a ball of 4 mm.
        let fraction = by_ball(0.004, [0.01, 0.0, 0.0], [-0.01, 0.0, 0.0]);
        assert!((fraction - (1.0 - (0.006 - STANDOFF) / 0.02)).abs() < 1e-9, "{fraction}");
        // Also if it ends inside on the far side, or too deep.
        assert!(by_ball(0.004, [0.01, 0.0, 0.0], [-0.003, 0.0, 0.0]) > 0.5);
        assert!(by_ball(0.09, [0.1, 0.0, 0.0], [0.07, 0.0, 0.0]) > 0.6);
        // None past the ball, along a round head, or to just below its surface.
        assert_eq!(by_ball(0.004, [0.01, 0.0, 0.0], [0.0, 0.01, 0.0]), 0.0);
        assert_eq!(by_ball(0.09, [0.0905, 0.0, 0.0], [0.0885, 0.02, 0.0]), 0.0);
        assert_eq!(by_ball(0.09, [0.0905, 0.0, 0.0], [0.088, 0.02, 0.0]), 0.0);
    }
}
