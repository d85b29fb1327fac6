//! Motion of the vertices of a deforming mesh, smooth to any sub-frame: `docs/theory.md` eq. 5.2.

use crate::math::coast;
use nalgebra::Vector3;

/// Evenly sampled shapes of a mesh, and the motion through them.
///
/// Between samples i and i + 1 a vertex is at (1 − w) P_i + w P_(i+1), P_i the parabola through samples i − 1, i and i + 1, and
/// w = u² (3 − 2u), u the share of the way. Overhauser's spline (1968) blends by u itself and is C1; this is C2.
/// Motion of constant acceleration is met exactly, and four samples alone decide, so that a part of a shot moves as the whole does.
/// Beyond its ends the mesh comes to rest as a [`Track`](crate::scene::anim::Track) does.
#[derive(Debug, Clone, PartialEq)]
pub struct Deformation {
    /// Time of the first sample, s.
    pub start: f64,
    /// Samples a second.
    pub rate: f64,
    /// Vertices of each sample, m, rest space of the body that carries the mesh; at least one sample, all of the same length.
    pub samples: Vec<Vec<Vector3<f64>>>,
}

impl Deformation {
    /// The vertices at time `t`, s.
    pub fn vertices(&self, t: f64) -> Vec<Vector3<f64>> {
        let weights = self.weights(t);
        let at = |v: usize| -> Vector3<f64> {
            weights.iter().map(|&(sample, w)| self.samples[sample][v] * w).sum()
        };
        (0..self.samples[0].len()).map(at).collect()
    }

    /// Samples that decide at time `t`, and how much.
    fn weights(&self, t: f64) -> Vec<(usize, f64)> {
        let last = self.samples.len() - 1;
        let x = (t - self.start) * self.rate;
        if last == 0 {
            return vec![(0, 1.0)];
        }
        if x < 0.0 {
            return self.at_rest(-x, |back| back);
        }
        if x > last as f64 {
            return self.at_rest(x - last as f64, |back| last - back);
        }
        let i = (x as usize).min(last - 1);
        let u = x - i as f64;
        if last == 1 {
            return vec![(0, 1.0 - u), (1, u)];
        }
        let parabola = |s: f64| [0.5 * s * (s - 1.0), 1.0 - s * s, 0.5 * s * (s + 1.0)];
        let early = (i > 0).then(|| (i, parabola(u)));
        let late = (i + 1 < last).then(|| (i + 1, parabola(u - 1.0)));
        let w = match (early, late) {
            (Some(_), Some(_)) => u * u * (3.0 - 2.0 * u),
            (None, _) => 1.0,
            (_, None) => 0.0,
        };
        let share = |part: Option<(usize, [f64; 3])>, w: f64| {
            part.into_iter().flat_map(move |(i, p)| (0..3).map(move |k| (i + k - 1, w * p[k])))
        };
        share(early, 1.0 - w).chain(share(late, w)).collect()
    }

    /// Weights `beyond` an end, samples; `sample` names the one so many from the end.
    fn at_rest(&self, beyond: f64, sample: impl Fn(usize) -> usize) -> Vec<(usize, f64)> {
        // One-sided differences: velocity outward, 1/s, and acceleration, 1/s².
        let (v, a) = match self.samples.len() {
            2 => ([1.0, -1.0, 0.0], [0.0; 3]),
            _ => ([1.5, -2.0, 0.5], [1.0, -2.0, 1.0]),
        };
        let [way_v, way_a] = coast::displacement(beyond / self.rate);
        let weight =
            |k: usize| f64::from(k == 0) + v[k] * self.rate * way_v + a[k] * self.rate * self.rate * way_a;
        (0..self.samples.len().min(3)).map(|k| (sample(k), weight(k))).collect()
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
    fn samples_and_constant_acceleration_are_met() {
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
    fn it_is_twice_differentiable_at_its_samples_and_ends() {
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
        assert!(largest > 400.0, "it does bend: {largest}");
    }

    #[test]
    fn beyond_its_ends_it_comes_to_rest() {
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
