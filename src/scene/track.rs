//! Rigid motion over time, smooth between samples.
//!
//! The samples of a joint, position and quaternion (seven numbers), are low-pass filtered ([`smooth`]) and
//! interpolated by a C2 cubic spline; the quaternion is normalised on evaluation. Filter and spline act on
//! quaternion components of aligned sign, not on logarithms: a change of frames multiplies the quaternions
//! from the left or the right, which is linear in the components as filter and spline are, so the result does
//! not depend on the choice of frames. Nor is there a singularity at half a turn. Normalisation adds an error
//! of fourth order, as that of the spline.

mod pops;
mod smooth;

use crate::math::coast;
use crate::math::spline::CubicSpline;
use nalgebra::{Isometry3, Quaternion, SVector, Translation3, UnitQuaternion, Vector3, Vector4};

pub use pops::{Pop, find_pops};

/// Largest distance of a joint from the origin, m: beyond, hairs are one point in single precision, and a wrong
/// unit or a damaged file is the likely reason.
pub const MAX_DISTANCE: f64 = 1e6;

/// Position and quaternion (w, x, y, z).
type Coordinates = SVector<f64, 7>;

/// The pose of rest space in the world, over time.
#[derive(Debug, Clone, PartialEq)]
pub struct Track {
    /// Joint to world.
    joint: CubicSpline<7>,
    /// Rest space to joint.
    rest_inverse: Isometry3<f64>,
}

/// Evenly sampled poses of a joint in the world.
#[derive(Debug, Clone, PartialEq)]
pub struct PoseSamples {
    /// Time of the first sample, s.
    pub start: f64,
    /// Samples per second.
    pub rate: f64,
    /// The poses, joint to world, metres, Y up.
    pub poses: Vec<Isometry3<f64>>,
    /// Increasing indices of missing or invalid samples, which are interpolated; at an end the track comes to
    /// rest instead. At least three samples must be valid.
    pub bridged: Vec<usize>,
}

impl Track {
    /// A track that does not move.
    pub fn fixed(pose: Isometry3<f64>) -> Self {
        let joint = CubicSpline::through(vec![0.0], vec![coordinates(&pose)]);
        Track { joint, rest_inverse: Isometry3::identity() }
    }

    /// The track through `samples`, low-pass filtered with the cutoff `smoothing_hz`, Hz; not filtered if the
    /// cutoff is 0 or not below the Nyquist frequency of the samples. `rest`: pose of the joint in rest
    /// space.
    pub fn through(samples: &PoseSamples, smoothing_hz: f64, rest: &Isometry3<f64>) -> Self {
        let mut weights = vec![1.0; samples.poses.len()];
        for &i in &samples.bridged {
            weights[i] = 0.0;
        }
        // Nothing is known beyond the first and the last valid sample.
        let first = weights.iter().position(|&w| w > 0.0).unwrap_or(0);
        let end = weights.iter().rposition(|&w| w > 0.0).map_or(weights.len(), |last| last + 1);
        let weights = &weights[first..end];
        let bridged: Vec<usize> =
            samples.bridged.iter().filter(|i| (first..end).contains(i)).map(|i| i - first).collect();
        let mut points: Vec<Coordinates> = samples.poses[first..end].iter().map(coordinates).collect();
        align_signs(&mut points, weights);
        let relative = smoothing_hz / samples.rate;
        if relative > 0.0 && relative < 0.5 {
            points = smooth::whittaker(&points, weights, smooth::penalty(relative));
        } else if !bridged.is_empty() {
            // Interpolate by a filter too weak to move the valid samples, which keep their exact values.
            let filled = smooth::whittaker(&points, weights, 1e-6);
            for &i in &bridged {
                points[i] = filled[i];
            }
        }
        let times = (first..end).map(|i| samples.start + i as f64 / samples.rate).collect();
        Track { joint: CubicSpline::through(times, points), rest_inverse: rest.inverse() }
    }

    /// Times of the first and last sample, s; `None` if the track does not move.
    pub fn span(&self) -> Option<(f64, f64)> {
        match self.joint.knots() {
            [first, .., last] => Some((*first, *last)),
            _ => None,
        }
    }

    /// World pose of rest space at time `t`, s. Beyond its ends the track comes to rest smoothly within half
    /// a second.
    pub fn pose(&self, t: f64) -> Isometry3<f64> {
        let [x, _] = self.joint_at(t);
        pose(&x) * self.rest_inverse
    }

    /// Velocity of rest space in the world at time `t`, s: angular, rad/s, and linear at the origin of rest
    /// space, m/s. A point at x in the world moves with `linear + angular × (x − pose(t).translation)`.
    pub fn twist(&self, t: f64) -> (Vector3<f64>, Vector3<f64>) {
        let [x, v] = self.joint_at(t);
        let (q, dq) = (quaternion(&x), quaternion(&v));
        // ω = 2 q̇ q⁻¹. The component of q̇ along q, which normalisation removes, only affects the real part.
        let angular = (dq * q.conjugate()).imag() * (2.0 / q.norm_squared());
        let arm = (pose(&x) * self.rest_inverse).translation.vector - x.fixed_rows::<3>(0);
        (angular, v.fixed_rows::<3>(0) + angular.cross(&arm))
    }

    /// Coordinates of the joint at time `t`, s, and their derivative.
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

/// Position and velocity a time `s`, s, beyond an end with position, velocity and acceleration (x, v, a); see
/// [`coast`].
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

/// Replaces each quaternion q by −q, the same rotation, if that is nearer to the previous one. Ignores
/// samples of weight 0.
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
