//! Retraction of strands towards their guides where a body lies between them.
//!
//! Contact keeps a guide on its side of every body, continuously in time. The guide therefore tells on which
//! side of an ear its strands belong, at every moment independently. Where the straight path from the guide
//! to the corresponding vertex of the free chain passes through a body, the vertex is *retracted* along it by
//! a fraction of the path, to in front of the body. A path that leaves a rounded body through a face similar
//! to the one it enters only cuts its curve; there the projection to the nearest surface suffices.
//!
//! The fraction may jump between frames, as a path passes the rim of an ear. The fraction in use is a uniform
//! cubic B-spline in time over the frames. Its coefficients are the maxima of the fractions of a frame and
//! its neighbours: it is smooth and never less than required, and depends on [`RETRACTION_SPAN`] frames
//! before and after, without memory.

use super::obstacles::Obstacles;
use nalgebra::Vector3;

/// Number of frames before and after a frame on whose retractions the one in use depends.
pub const RETRACTION_SPAN: usize = 2;

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

/// Smooth step from 0 at the first of `ends` to 1 at the second.
fn smoothstep(ends: [f64; 2], x: f64) -> f64 {
    let u = ((x - ends[0]) / (ends[1] - ends[0])).clamp(0.0, 1.0);
    u * u * (3.0 - 2.0 * u)
}

/// The retraction in use at `u` (0..1) of the interval from a frame to the next, and its derivative per
/// frame, from the `required` ones at the frames around that frame (`docs/theory.md` eq. 7.4). The last
/// coefficient of the interval lacks one frame: the curve is smooth up to the next frame, where it may fall
/// short by a sixth of the excess of that frame over its neighbours.
pub(super) fn smoothed(required: [f64; 2 * RETRACTION_SPAN + 1], u: f64) -> (f64, f64) {
    let m = |i: usize| required[i - 1].max(required[i]).max(required[i + 1]);
    let m = [m(1), m(2), m(3), required[3].max(required[4])];
    let v = 1.0 - u;
    let value = [v * v * v, 4.0 - 3.0 * u * u * (1.0 + v), 4.0 - 3.0 * v * v * (1.0 + u), u * u * u];
    let slope = [-v * v, u * (3.0 * u - 4.0), v * (1.0 + 3.0 * u), u * u];
    let sum = |weights: [f64; 4]| weights.iter().zip(m).map(|(w, m)| w * m).sum::<f64>();
    (sum(value) / 6.0, 0.5 * sum(slope))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::contact::Bodies;
    use crate::geometry::Shape;
    use nalgebra::Isometry3;
    use proptest::prelude::*;

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

    proptest! {
        #[test]
        fn smoothed_is_at_least_the_required_and_has_the_slope_of_a_cubic(
            required in prop::array::uniform7(0.0..1.0_f64)
        ) {
            let at = |i: usize| smoothed(std::array::from_fn(|k| required[i + k]), 0.0);
            for i in 0..3 {
                prop_assert!(at(i).0 >= required[i + 2] - 1e-12);
            }
            // Simpson's rule of the slopes of a cubic is exact; the middle slope follows from the
            // coefficients.
            let m = |i: usize| required[i - 1].max(required[i]).max(required[i + 1]);
            let middle = (5.0 * (m(3) - m(2)) + (m(4) - m(1))) / 8.0;
            let rise = (at(0).1 + 4.0 * middle + at(1).1) / 6.0;
            prop_assert!((at(1).0 - at(0).0 - rise).abs() < 1e-12);
        }

        #[test]
        fn smoothed_between_frames_is_smooth_and_ends_at_no_less_than_the_required(
            required in prop::array::uniform5(0.0..1.0_f64), u in 0.001..0.999_f64
        ) {
            let (lo, hi) = (smoothed(required, u - 1e-4), smoothed(required, u + 1e-4));
            let (value, slope) = smoothed(required, u);
            prop_assert!(((hi.0 - lo.0) / 2e-4 - slope).abs() < 1e-6);
            prop_assert!((0.0..=1.0).contains(&value));
            prop_assert!(smoothed(required, 1.0).0 >= required[3] - 1e-12);
        }
    }
}
