//! How far a strand retreats towards its guide where a body lies between them.
//!
//! Contact keeps a guide on its side of every body, and what it does is continuous; so the guide tells on which side of an ear its
//! strands belong, at every moment alone. Where the straight way from the guide to the free chain's vertex beside it goes through a
//! body, the vertex *retreats* along it, to before the body: by a share of the way. On its way around something round it
//! comes out facing as it went in, and needs no retreat: a turn to the surface near by does.
//!
//! The share may jump from one frame to the next, as a strand comes to see its guide past the rim of an ear. So what is used at a
//! moment is a uniform cubic B-spline in time, over the frames, whose coefficients are the largest of a frame's share and its
//! neighbours': smooth, and never less than asked for. It needs the shares of [`RETRACTION_SPAN`] frames before and after, and no memory.

use super::keep_out::Obstacles;
use nalgebra::Vector3;

/// Frames before and after one whose shares have a say in it.
pub const RETRACTION_SPAN: usize = 2;

/// Cosines of the angle between the faces where a way enters a body and where it leaves: from here on the strand is not beyond it,
/// and up to there it is.
const AROUND: [f64; 2] = [0.7, 0.2];

/// Depths inside a body, m, from which on a turn to the nearest surface is not trusted, and at which not at all.
const DEEP: [f64; 2] = [0.005, 0.015];

/// Distance from the body at which the retreat ends, m.
const BEFORE: f64 = 1e-3;

impl Obstacles<'_> {
    /// Share of the way from `guide` to `free`, m, world, by which a strand's vertex there has to retreat (0..=1).
    /// All bodies are `room`, m, from `guide` at least.
    pub(super) fn retreat(&self, (guide, room): (&Vector3<f64>, f64), free: &Vector3<f64>) -> f64 {
        let bodies = self.poses.iter().enumerate();
        bodies
            .map(|(b, pose)| {
                let [from, to] = [guide, free].map(|x| pose.inverse_transform_point(&(*x).into()).coords);
                self.retreat_from(b, (&from, room), &to)
            })
            .fold(0.0, f64::max)
    }

    fn retreat_from(&self, body: usize, (guide, room): (&Vector3<f64>, f64), free: &Vector3<f64>) -> f64 {
        let near = |x| self.bodies.distance_bounds(body, x)[0];
        // No surface is in two balls that cover the way.
        if room.max(near(guide)).max(0.0) + near(free).max(0.0) > (free - guide).norm() {
            return 0.0;
        }
        let hit = |a, b| self.bodies.first_hit(body, self.time, a, b);
        let Some((share, entry)) = hit(guide, free) else { return 0.0 };
        let way = free - guide;
        // The guide is outside: a face that looks away is the back of an open sheet.
        let entry = if entry.dot(&way) > 0.0 { -entry } else { entry };
        let Some((_, exit)) = hit(free, guide) else { return 0.0 };
        let beyond = if exit.dot(&way) < 0.0 {
            // Inside, or behind an open sheet.
            match self.bodies.closest(body, self.time, free, DEEP[1]) {
                Some(s) => ramp(AROUND, entry.dot(&s.normal)).max(ramp(DEEP, s.distance.abs())),
                None => 1.0,
            }
        } else {
            ramp(AROUND, entry.dot(&exit))
        };
        beyond * (1.0 - share + BEFORE / way.norm().max(BEFORE)).min(1.0)
    }
}

/// 0 at the first of `ends`, 1 at the second, smooth in between.
fn ramp(ends: [f64; 2], x: f64) -> f64 {
    let u = ((x - ends[0]) / (ends[1] - ends[0])).clamp(0.0, 1.0);
    u * u * (3.0 - 2.0 * u)
}

/// The share at `u` (0..1) of the way from a frame to the next, and its change from frame to frame, of those asked for in the frames around
/// it. Between frames the last coefficient does without the frame after these: until the next frame all is smooth, and there, where
/// other samples take over, it may be missed by a sixth of what that frame asks for more than its neighbours.
pub(super) fn smoothed(asked: [f64; 2 * RETRACTION_SPAN + 1], u: f64) -> (f64, f64) {
    let m = |i: usize| asked[i - 1].max(asked[i]).max(asked[i + 1]);
    let m = [m(1), m(2), m(3), asked[3].max(asked[4])];
    let v = 1.0 - u;
    let share = [v * v * v, 4.0 - 3.0 * u * u * (1.0 + v), 4.0 - 3.0 * v * v * (1.0 + u), u * u * u];
    let change = [-v * v, u * (3.0 * u - 4.0), v * (1.0 + 3.0 * u), u * u];
    let sum = |weights: [f64; 4]| weights.iter().zip(m).map(|(w, m)| w * m).sum::<f64>();
    (sum(share) / 6.0, 0.5 * sum(change))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::contact::Bodies;
    use crate::geometry::Shape;
    use nalgebra::Isometry3;
    use proptest::prelude::*;

    /// A retreat past a ball of 4 mm or of 9 cm about the origin.
    fn past(radius: f64, guide: [f64; 3], free: [f64; 3]) -> f64 {
        let bodies = Bodies::from_shapes(&[Shape::Sphere { centre: Vector3::zeros(), radius }]);
        let poses = [Isometry3::identity()];
        Obstacles { bodies: &bodies, time: 0.0, poses: &poses }.retreat((&guide.into(), 0.0), &free.into())
    }

    #[test]
    fn retreats_from_what_is_beyond_a_body_to_before_it() {
        // Through the middle: 1 cm off, 4 mm of them and 1 mm before it.
        let share = past(0.004, [0.01, 0.0, 0.0], [-0.01, 0.0, 0.0]);
        assert!((share - (1.0 - (0.006 - BEFORE) / 0.02)).abs() < 1e-9, "{share}");
        // As well from inside, on the far side, and where nothing is trusted.
        assert!(past(0.004, [0.01, 0.0, 0.0], [-0.003, 0.0, 0.0]) > 0.5);
        assert!(past(0.09, [0.1, 0.0, 0.0], [0.07, 0.0, 0.0]) > 0.6);
        // Not past it, nor from beside it on a round head, nor from just under its surface.
        assert_eq!(past(0.004, [0.01, 0.0, 0.0], [0.0, 0.01, 0.0]), 0.0);
        assert_eq!(past(0.09, [0.0905, 0.0, 0.0], [0.0885, 0.02, 0.0]), 0.0);
        assert_eq!(past(0.09, [0.0905, 0.0, 0.0], [0.088, 0.02, 0.0]), 0.0);
    }

    proptest! {
        #[test]
        fn what_is_used_is_never_less_than_asked_for_and_has_its_slope(asked in prop::array::uniform7(0.0..1.0_f64)) {
            let at = |i: usize| smoothed(std::array::from_fn(|k| asked[i + k]), 0.0);
            for i in 0..3 {
                prop_assert!(at(i).0 >= asked[i + 2] - 1e-12);
            }
            // A cubic between frames: Simpson's rule of its slopes, the middle one from its coefficients, is exact.
            let m = |i: usize| asked[i - 1].max(asked[i]).max(asked[i + 1]);
            let middle = (5.0 * (m(3) - m(2)) + (m(4) - m(1))) / 8.0;
            let rise = (at(0).1 + 4.0 * middle + at(1).1) / 6.0;
            prop_assert!((at(1).0 - at(0).0 - rise).abs() < 1e-12);
        }

        #[test]
        fn between_frames_it_is_smooth_and_ends_with_no_less_than_asked_for(
            asked in prop::array::uniform5(0.0..1.0_f64), u in 0.001..0.999_f64
        ) {
            let (lo, hi) = (smoothed(asked, u - 1e-4), smoothed(asked, u + 1e-4));
            let (share, change) = smoothed(asked, u);
            prop_assert!(((hi.0 - lo.0) / 2e-4 - change).abs() < 1e-6);
            prop_assert!((0.0..=1.0).contains(&share));
            prop_assert!(smoothed(asked, 1.0).0 >= asked[3] - 1e-12);
        }
    }
}
