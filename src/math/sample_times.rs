//! Smooth motion through evenly spaced samples: `docs/theory.md` eq. 5.2.

use super::coast;

/// Times of evenly spaced samples, and a C² motion through them.
///
/// Between samples i and i + 1 a quantity is (1 − w) P_i + w P_(i+1), where P_i is the parabola through
/// samples i − 1, i and i + 1, w = u² (3 − 2u), and u is the fraction of the interval. Overhauser's spline
/// (1968), which has w = u, is C¹. Constant acceleration is reproduced exactly. The motion is local (four
/// samples), so that a part of a shot moves as the whole does. Beyond its ends it comes to rest, see
/// [`coast`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SampleTimes {
    /// Time of the first sample, s.
    pub start: f64,
    /// Samples per second.
    pub rate: f64,
    /// Number of samples, at least one.
    pub count: usize,
}

/// Samples with their weights: two parabolas through three samples each at most.
#[derive(Debug, Clone, Copy)]
pub struct SampleWeights {
    weights: [(usize, f64); 6],
    len: usize,
}

impl SampleWeights {
    fn new(weights: impl IntoIterator<Item = (usize, f64)>) -> Self {
        let mut new = SampleWeights { weights: [(0, 0.0); 6], len: 0 };
        for (place, weight) in new.weights.iter_mut().zip(weights) {
            *place = weight;
            new.len += 1;
        }
        new
    }

    /// Samples, by their indices, and their weights.
    pub fn iter(&self) -> impl Iterator<Item = (usize, f64)> {
        self.weights[..self.len].iter().copied()
    }
}

impl SampleTimes {
    /// Time of a sample, s.
    pub fn time(&self, sample: usize) -> f64 {
        self.start + sample as f64 / self.rate
    }

    /// The time nearest to `t`, s, from the first to the last sample.
    pub fn clamp(&self, t: f64) -> f64 {
        t.clamp(self.start, self.time(self.count - 1))
    }

    /// Samples, and their weights, at time `t`, s.
    pub fn weights(&self, t: f64) -> SampleWeights {
        let last = self.count - 1;
        let x = (t - self.start) * self.rate;
        if last == 0 {
            return SampleWeights::new([(0, 1.0)]);
        }
        if x < 0.0 {
            return self.weights_beyond(-x, |back| back);
        }
        if x > last as f64 {
            return self.weights_beyond(x - last as f64, |back| last - back);
        }
        let i = (x as usize).min(last - 1);
        let u = x - i as f64;
        if last == 1 {
            return SampleWeights::new([(0, 1.0 - u), (1, u)]);
        }
        let parabola = |s: f64| [0.5 * s * (s - 1.0), 1.0 - s * s, 0.5 * s * (s + 1.0)];
        let early = (i > 0).then(|| (i, parabola(u)));
        let late = (i + 1 < last).then(|| (i + 1, parabola(u - 1.0)));
        let w = match (early, late) {
            (Some(_), Some(_)) => u * u * (3.0 - 2.0 * u),
            (None, _) => 1.0,
            (_, None) => 0.0,
        };
        let weighted = |part: Option<(usize, [f64; 3])>, w: f64| {
            part.into_iter().flat_map(move |(i, p)| (0..3).map(move |k| (i + k - 1, w * p[k])))
        };
        SampleWeights::new(weighted(early, 1.0 - w).chain(weighted(late, w)))
    }

    /// Weights at `beyond`, samples, past an end. `sample` maps a distance from that end, samples, to an
    /// index.
    fn weights_beyond(&self, beyond: f64, sample: impl Fn(usize) -> usize) -> SampleWeights {
        // One-sided differences: outward velocity, 1/s, and acceleration, 1/s².
        let (v, a) = match self.count {
            2 => ([1.0, -1.0, 0.0], [0.0; 3]),
            _ => ([1.5, -2.0, 0.5], [1.0, -2.0, 1.0]),
        };
        let [by_v, by_a] = coast::displacement(beyond / self.rate);
        let weight =
            |k: usize| f64::from(k == 0) + v[k] * self.rate * by_v + a[k] * self.rate * self.rate * by_a;
        SampleWeights::new((0..self.count.min(3)).map(|k| (sample(k), weight(k))))
    }
}
