//! Motion of the vertices of a deforming mesh, C² in time: `docs/theory.md` eq. 5.2.

use crate::math::coast;
use crate::math::sample_times::SampleTimes;
use nalgebra::{Isometry3, Vector3};

/// Evenly sampled positions of the vertices of a mesh, and a C² motion through them.
///
/// Between samples it moves as [`SampleTimes`] says. Beyond its ends the mesh comes to rest, see [`coast`]
/// and [`Deformation::carried_beyond_ends`].
#[derive(Debug, Clone, PartialEq)]
pub struct Deformation {
    /// Time of the first sample, s.
    pub start: f64,
    /// Samples per second.
    pub rate: f64,
    /// Vertices of each sample, m, rest space of the body; at least one sample, all of the same length.
    pub samples: Vec<Vec<Vector3<f64>>>,
}

/// Motion of a carrier, m and rad, that counts as none.
const STILL: f64 = 1e-9;

impl Deformation {
    /// Vertices at time `t`, s; m, rest space of the body.
    pub fn vertices(&self, t: f64) -> Vec<Vector3<f64>> {
        let vertex = self.at(t);
        (0..self.samples[0].len() as u32).map(vertex).collect()
    }

    /// The position of each vertex at time `t`, s, by its index; m, rest space of the body.
    pub fn at(&self, t: f64) -> impl Fn(u32) -> Vector3<f64> {
        let weights = self.times().weights(t);
        move |v| weights.iter().map(|(sample, w)| self.samples[sample][v as usize] * w).sum()
    }

    /// The deformation with more samples at both ends, where what moves with a carrier goes on to do so while
    /// the carrier comes to rest. `carrier` is its pose in the rest space of the body at a time in s.
    ///
    /// The motion of a vertex alone does not tell a turn from a straight line: a head that turns at the end
    /// would swell, as each vertex goes on along its tangent.
    pub fn carried_beyond_ends(self, carrier: impl Fn(f64) -> Isometry3<f64>) -> Deformation {
        let last = self.samples.len() - 1;
        if last == 0 {
            return self;
        }
        let step = 1.0 / self.rate;
        // The last three are at rest, so that the samples end so.
        let count = (coast::VELOCITY_TIME * self.rate).ceil() as usize + 2;
        let time = |sample: usize| self.start + sample as f64 * step;
        let before = self.carried([0, 1], time(0), -step, count, &carrier);
        let after = self.carried([last, last - 1], time(last), step, count, &carrier);
        let start = self.start - before.len() as f64 * step;
        let samples = before.into_iter().rev().chain(self.samples).chain(after).collect();
        Deformation { start, rate: self.rate, samples }
    }

    /// `count` samples at intervals of `step`, s, beyond the sample `end`, at time `t`, s; `next` is its
    /// neighbour. None if the carrier is at rest there.
    ///
    /// A vertex that has moved by w since its neighbour, and by h relative to the carrier, follows the
    /// carrier by the share w⁴ / (w⁴ + h⁴).
    fn carried(
        &self,
        [end, next]: [usize; 2],
        t: f64,
        step: f64,
        count: usize,
        carrier: impl Fn(f64) -> Isometry3<f64>,
    ) -> Vec<Vec<Vector3<f64>>> {
        let back = carrier(t).inverse();
        let motion = |k: usize| carrier(t + k as f64 * step) * back;
        let moved = motion(count);
        if moved.translation.vector.norm() < STILL && moved.rotation.angle() < STILL {
            return Vec::new();
        }
        let inward = carrier(t - step) * back;
        let (from, to) = (&self.samples[end], &self.samples[next]);
        let share = |(x, y): (&Vector3<f64>, &Vector3<f64>)| {
            let [w, h] =
                [*x, inward.transform_point(&(*x).into()).coords].map(|x| (y - x).norm_squared().powi(2));
            if w > 0.0 { w / (w + h) } else { 0.0 }
        };
        let shares: Vec<f64> = from.iter().zip(to).map(share).collect();
        let sample = |k: usize| {
            let (motion, coasting) = (motion(k), self.vertices(t + k as f64 * step));
            let vertex = |((x, share), coasting): ((&Vector3<f64>, &f64), &Vector3<f64>)| {
                coasting.lerp(&motion.transform_point(&(*x).into()).coords, *share)
            };
            from.iter().zip(&shares).zip(&coasting).map(vertex).collect()
        };
        (1..=count).map(sample).collect()
    }

    /// The times of the samples.
    fn times(&self) -> SampleTimes {
        SampleTimes { start: self.start, rate: self.rate, count: self.samples.len() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sampled(n: usize, rate: f64, at: impl Fn(f64) -> f64) -> Deformation {
        let sample = |i: usize| vec![Vector3::new(at(i as f64 / rate), 0.0, 1.0), Vector3::y()];
        Deformation { start: 2.0, rate, samples: (0..n).map(sample).collect() }
    }

    fn x(deformation: &Deformation, t: f64) -> f64 {
        deformation.vertices(2.0 + t)[0].x
    }

    #[test]
    fn samples_and_constant_acceleration_are_reproduced() {
        let throw = |t: f64| 0.3 + 2.0 * t - 4.9 * t * t;
        let thrown = sampled(9, 24.0, throw);
        for k in 0..=80 {
            let t = f64::from(k) / 240.0;
            assert!((x(&thrown, t) - throw(t)).abs() < 1e-14, "{t}");
            assert!((thrown.vertices(2.0 + t)[1] - Vector3::y()).norm() < 1e-15);
        }
        let wave = sampled(20, 24.0, |t| (9.0 * t).sin());
        assert!(
            (0..20)
                .all(|i| (x(&wave, f64::from(i) / 24.0) - (9.0 * f64::from(i) / 24.0).sin()).abs() < 1e-14)
        );
    }

    #[test]
    fn motion_is_c2_at_samples_and_ends() {
        let wave = sampled(7, 24.0, |t| (30.0 * t).sin() + 0.2 * (90.0 * t).cos());
        let h = 1e-5;
        let first = |t: f64| (x(&wave, t + h) - x(&wave, t - h)) / (2.0 * h);
        let second = |t: f64| (x(&wave, t + h) - 2.0 * x(&wave, t) + x(&wave, t - h)) / (h * h);
        for i in 0..7 {
            let t = f64::from(i) / 24.0;
            // The third derivative is of the order of the second over a sample.
            assert!((first(t + 2.0 * h) - first(t - 2.0 * h)).abs() < 0.1, "{i}");
            assert!((second(t + 2.0 * h) - second(t - 2.0 * h)).abs() < 20.0, "{i}");
        }
        let largest = (0..60).map(|k| second(f64::from(k) / 240.0 + 1e-3).abs()).fold(0.0, f64::max);
        assert!(largest > 400.0, "the motion must accelerate: {largest}");
    }

    #[test]
    fn a_turning_head_keeps_its_shape_beyond_the_ends() {
        let carrier = |t: f64| {
            // Comes to rest within the time of coasting, at 7.3 rad/s within the samples.
            let [way, _] = coast::displacement((-t).max(t - 1.0).max(0.0));
            let t = t.clamp(0.0, 1.0) + if t < 0.0 { -way } else { way };
            Isometry3::new(Vector3::new(2.0, 0.3 * t, 0.0), Vector3::y() * (7.3 * t))
        };
        let head = [Vector3::x() * 0.1, Vector3::new(0.0, 0.1, 0.1)];
        let on_head = |t: f64| head.map(|x| carrier(t).transform_point(&x.into()).coords);
        let floor = Vector3::new(0.4, -1.0, 0.0);
        let samples: Vec<_> =
            (0..=24).map(|i| [on_head(f64::from(i) / 24.0).to_vec(), vec![floor]].concat()).collect();
        let deformation = Deformation { start: 0.0, rate: 24.0, samples };
        let radius = |d: &Deformation, t: f64| {
            let axis = carrier(t).translation.vector;
            (d.vertices(t)[0] - axis).norm()
        };
        assert!(radius(&deformation, -0.5) > 0.2, "the tangents must lead away");
        let carried = deformation.carried_beyond_ends(carrier);
        for k in -30..=54 {
            let t = f64::from(k) / 24.0;
            let found = carried.vertices(t);
            for (found, expected) in found.iter().zip(on_head(t)) {
                assert!((found - expected).norm() < 1e-4, "{t}: {found} {expected}");
            }
            // Rounding of the weights, which are up to 30.
            assert!((found[2] - floor).norm() < 1e-12);
        }
        // A carrier at rest adds nothing.
        let still = sampled(5, 24.0, |t| 1.5 * t);
        assert_eq!(still.clone().carried_beyond_ends(|_| Isometry3::identity()), still);
    }

    #[test]
    fn motion_comes_to_rest_beyond_the_ends() {
        let walk = sampled(5, 24.0, |t| 1.5 * t);
        let last = 4.0 / 24.0;
        assert!((x(&walk, last + 0.02) - x(&walk, last) - 0.03).abs() < 1e-4);
        assert!(
            (x(&walk, 3.0) - x(&walk, last) - 1.5 * 0.25).abs() < 1e-12 && x(&walk, 3.0) == x(&walk, 4.0)
        );
        assert!((x(&walk, -3.0) + x(&walk, 3.0) - x(&walk, last)).abs() < 1e-14);
        let two = sampled(2, 24.0, |t| t);
        assert!((x(&two, 0.25 / 24.0) - 0.25 / 24.0).abs() < 1e-15 && x(&two, 1.0) > 0.1);
        assert_eq!(x(&sampled(1, 24.0, |_| 7.0), 5.0), 7.0);
    }
}
