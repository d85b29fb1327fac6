//! Rigid motion over time, smooth to any sub-frame.
//!
//! Samples of a joint (position and quaternion, seven numbers) are filtered ([`smooth`]) and joined by a C2
//! cubic spline; the quaternion is normalised when read. Working on the components of quaternions of
//! aligned sign rather than on logarithms keeps the result independent of the frames chosen: to change them is
//! to multiply from left or right, which is linear in the components, and filter and spline are linear. It
//! also has no singularity at half a turn. The error of the chord is of fourth order, as the spline's.

mod pops;
mod smooth;

use crate::math::coast;
use crate::math::spline::CubicSpline;
use nalgebra::{Isometry3, Quaternion, SVector, Translation3, UnitQuaternion, Vector3, Vector4};

pub use pops::find_pops;

/// Position, then quaternion (w, x, y, z).
type Coordinates = SVector<f64, 7>;

/// Rest space to world over time.
#[derive(Debug, Clone, PartialEq)]
pub struct Track {
    joint: CubicSpline<7>,
    /// Rest space to joint.
    rest_inverse: Isometry3<f64>,
}

/// Evenly sampled poses of a joint in the world.
#[derive(Debug, Clone, PartialEq)]
pub struct Samples {
    /// Time of the first, s.
    pub start: f64,
    /// Samples a second.
    pub rate: f64,
    /// The poses, joint to world, metres, Y up.
    pub poses: Vec<Isometry3<f64>>,
    /// Samples that are missing or not to be trusted, increasing; they are bridged from their neighbours.
    /// At least three must remain.
    pub bridged: Vec<usize>,
}

impl Track {
    /// A track that does not move.
    pub fn fixed(pose: Isometry3<f64>) -> Self {
        let joint = CubicSpline::through(vec![0.0], vec![coordinates(&pose)]);
        Track { joint, rest_inverse: Isometry3::identity() }
    }

    /// The track through `samples`, low-pass filtered at `smoothing_hz` (Whittaker's filter; not if
    /// that is 0 or not below the Nyquist frequency of the samples). `rest`: pose of the joint in the rest space.
    pub fn through(samples: &Samples, smoothing_hz: f64, rest: &Isometry3<f64>) -> Self {
        let mut points: Vec<Coordinates> = samples.poses.iter().map(coordinates).collect();
        let mut weights = vec![1.0; points.len()];
        for &i in &samples.bridged {
            weights[i] = 0.0;
        }
        align_signs(&mut points, &weights);
        let relative = smoothing_hz / samples.rate;
        if relative > 0.0 && relative < 0.5 {
            points = smooth::whittaker(&points, &weights, smooth::stiffness(relative));
        } else if !samples.bridged.is_empty() {
            // Filtered so lightly that the trusted samples would not move; they are kept to the bit.
            let filled = smooth::whittaker(&points, &weights, 1e-6);
            for &i in &samples.bridged {
                points[i] = filled[i];
            }
        }
        let times = (0..points.len()).map(|i| samples.start + i as f64 / samples.rate).collect();
        Track { joint: CubicSpline::through(times, points), rest_inverse: rest.inverse() }
    }

    /// Times of the first and last sample, s; `None` if the track does not move.
    pub fn span(&self) -> Option<(f64, f64)> {
        match self.joint.knots() {
            [first, .., last] => Some((*first, *last)),
            _ => None,
        }
    }

    /// World pose of rest space at time `t`, s. Beyond its ends the track comes to rest smoothly, its
    /// velocity dying away in half a second.
    pub fn pose(&self, t: f64) -> Isometry3<f64> {
        let [x, _] = self.joint_at(t);
        pose(&x) * self.rest_inverse
    }

    /// Velocity of rest space in the world at time `t`: angular, rad/s, and that of the point that is the origin
    /// of rest space, m/s. A point at x in the world moves with `linear + angular × (x − pose(t).translation)`.
    pub fn twist(&self, t: f64) -> (Vector3<f64>, Vector3<f64>) {
        let [x, v] = self.joint_at(t);
        let (q, dq) = (quaternion(&x), quaternion(&v));
        // ω = 2 q̇ q⁻¹; the part of q̇ along q, which normalisation takes out, falls on the real part.
        let angular = (dq * q.conjugate()).imag() * (2.0 / q.norm_squared());
        let arm = (pose(&x) * self.rest_inverse).translation.vector - x.fixed_rows::<3>(0);
        (angular, v.fixed_rows::<3>(0) + angular.cross(&arm))
    }

    /// Coordinates of the joint at `t` and their derivative.
    fn joint_at(&self, t: f64) -> [Coordinates; 2] {
        let Some((first, last)) = self.span() else {
            let [x, v, _] = self.joint.at(t);
            return [x, v];
        };
        let [x, v, a] = self.joint.at(t);
        if t < first {
            let [x, v] = come_to_rest(&x, &-v, &a, first - t);
            [x, -v]
        } else if t > last {
            come_to_rest(&x, &v, &a, t - last)
        } else {
            [x, v]
        }
    }
}

/// Position and velocity a time `s`, s, beyond an end with position, velocity and acceleration (x, v, a); see [`coast`].
fn come_to_rest(x: &Coordinates, v: &Coordinates, a: &Coordinates, s: f64) -> [Coordinates; 2] {
    let ([speed_v, speed_a], [way_v, way_a]) = (coast::velocity(s), coast::displacement(s));
    [x + v * way_v + a * way_a, v * speed_v + a * speed_a]
}

fn coordinates(pose: &Isometry3<f64>) -> Coordinates {
    let (p, q) = (pose.translation.vector, pose.rotation.as_ref());
    SVector::from([p.x, p.y, p.z, q.w, q.i, q.j, q.k])
}

fn quaternion(x: &Coordinates) -> Quaternion<f64> {
    Quaternion::new(x[3], x[4], x[5], x[6])
}

fn pose(x: &Coordinates) -> Isometry3<f64> {
    let translation = Translation3::new(x[0], x[1], x[2]);
    Isometry3::from_parts(translation, UnitQuaternion::from_quaternion(quaternion(x)))
}

/// Of the two quaternions of each rotation takes the one nearer to that before it; q and −q are the same rotation.
fn align_signs(points: &mut [Coordinates], weights: &[f64]) {
    let mut last: Option<Vector4<f64>> = None;
    for (point, &weight) in points.iter_mut().zip(weights) {
        let mut q = point.fixed_rows::<4>(3).into_owned();
        if last.is_some_and(|last| last.dot(&q) < 0.0) {
            q.neg_mut();
            point.fixed_rows_mut::<4>(3).copy_from(&q);
        }
        if weight > 0.0 {
            last = Some(q);
        }
    }
}

#[cfg(test)]
mod tests;
