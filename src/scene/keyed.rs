//! A vector over time.

use nalgebra::Vector3;

/// A vector over time: constant, or keys interpolated smoothly; held before the first key and after the last.
#[derive(Debug, Clone, PartialEq)]
pub struct Keyed {
    /// Times of the keys, s, increasing; one key is a constant.
    pub times: Vec<f64>,
    /// Values at the keys.
    pub values: Vec<Vector3<f64>>,
}

impl Keyed {
    /// A vector that does not change.
    pub fn constant(value: Vector3<f64>) -> Self {
        Keyed { times: vec![0.0], values: vec![value] }
    }

    /// The value at time `t`, s: twice continuously differentiable, and between two keys no component leaves
    /// the interval of its values there, so that a wind that rises does not first blow backwards. Quintic
    /// pieces with zero second derivative at the keys; their slopes there are harmonic means of the
    /// slopes on both sides, zero at extrema (Fritsch & Butland 1984).
    pub fn at(&self, t: f64) -> Vector3<f64> {
        let n = self.times.len();
        let i = self.times.partition_point(|&key| key <= t);
        if i == 0 || i == n {
            return self.values[i.min(n - 1)];
        }
        let i = i - 1;
        let h = self.times[i + 1] - self.times[i];
        let u = (t - self.times[i]) / h;
        // Of the quintic Hermite basis on [0, 1]: the step, and the slopes at its start and end.
        let step = u * u * u * (10.0 - u * (15.0 - 6.0 * u));
        let start = u * (1.0 - u * u * (6.0 - u * (8.0 - 3.0 * u)));
        let end = -u * u * u * (4.0 - u * (7.0 - 3.0 * u));
        let (a, b) = (self.values[i], self.values[i + 1]);
        a + (b - a) * step + (self.slope(i) * start + self.slope(i + 1) * end) * h
    }

    /// Slope at key `i`, 1/s.
    fn slope(&self, i: usize) -> Vector3<f64> {
        if i == 0 || i + 1 == self.times.len() {
            return Vector3::zeros();
        }
        let chord = |i: usize| (self.values[i + 1] - self.values[i]) / (self.times[i + 1] - self.times[i]);
        chord(i - 1).zip_map(&chord(i), |p, q| if p * q > 0.0 { 2.0 * p * q / (p + q) } else { 0.0 })
    }
}
