//! A vector over time.

use nalgebra::SVector;

/// A vector of `D` components over time: keyframes interpolated smoothly. Before the first and after the last
/// key it is constant.
#[derive(Debug, Clone, PartialEq)]
pub struct Keyframes<const D: usize = 3> {
    /// Times of the keys, s, increasing; at least one.
    pub times: Vec<f64>,
    /// Values at the keys.
    pub values: Vec<SVector<f64, D>>,
}

impl<const D: usize> Keyframes<D> {
    /// A constant vector.
    pub fn constant(value: SVector<f64, D>) -> Self {
        Keyframes { times: vec![0.0], values: vec![value] }
    }

    /// The value at time `t`, s.
    ///
    /// Twice continuously differentiable. Between two keys no component leaves the interval of its values
    /// there: a wind that rises does not first blow backwards. Each piece is a quintic with zero second
    /// derivative at the keys. The slope at a key is the harmonic mean of the slopes on both sides, and zero
    /// at extrema (Fritsch & Butland 1984).
    pub fn at(&self, t: f64) -> SVector<f64, D> {
        let n = self.times.len();
        let i = self.times.partition_point(|&key| key <= t);
        if i == 0 || i == n {
            return self.values[i.min(n - 1)];
        }
        let i = i - 1;
        let h = self.times[i + 1] - self.times[i];
        let u = (t - self.times[i]) / h;
        // Quintic Hermite basis on [0, 1]: the step, and the slopes at its start and end.
        let step = u * u * u * (10.0 - u * (15.0 - 6.0 * u));
        let start = u * (1.0 - u * u * (6.0 - u * (8.0 - 3.0 * u)));
        let end = -u * u * u * (4.0 - u * (7.0 - 3.0 * u));
        let (a, b) = (self.values[i], self.values[i + 1]);
        let value = a + (b - a) * step + (self.slope(i) * start + self.slope(i + 1) * end) * h;
        // Rounding could leave the interval: a weight must not exceed 1.
        value.zip_zip_map(&a, &b, |x, a, b| x.max(a.min(b)).min(a.max(b)))
    }

    /// The value at time `t`, s, linear between the keys.
    pub fn linear_at(&self, t: f64) -> SVector<f64, D> {
        let (i, n) = (self.times.partition_point(|&key| key <= t), self.times.len());
        if i == 0 || i == n {
            return self.values[i.min(n - 1)];
        }
        let [a, b] = [self.times[i - 1], self.times[i]];
        self.values[i - 1].lerp(&self.values[i], (t - a) / (b - a))
    }

    /// True if it is zero at all times.
    pub fn is_zero(&self) -> bool {
        self.values.iter().all(|value| *value == SVector::<f64, D>::zeros())
    }

    /// True if it is zero from one time to another, s.
    pub fn is_zero_within(&self, [from, to]: [f64; 2]) -> bool {
        let keys = self.times.iter().zip(&self.values).filter(|(t, _)| (from..=to).contains(t));
        let ends = [self.at(from), self.at(to)];
        // Between keys no component leaves the interval of its values there.
        keys.map(|(_, value)| value).chain(&ends).all(|value| *value == SVector::<f64, D>::zeros())
    }

    /// Slope at key `i`, 1/s times the unit of the values.
    fn slope(&self, i: usize) -> SVector<f64, D> {
        if i == 0 || i + 1 == self.times.len() {
            return SVector::zeros();
        }
        let chord = |i: usize| (self.values[i + 1] - self.values[i]) / (self.times[i + 1] - self.times[i]);
        chord(i - 1).zip_map(&chord(i), |p, q| if p * q > 0.0 { 2.0 * p * q / (p + q) } else { 0.0 })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;
    use nalgebra::Vector3;
    use proptest::prelude::*;

    fn keyframes(values: &[(f64, f64)]) -> Keyframes {
        let (times, values) = values.iter().map(|&(t, x)| (t, Vector3::new(x, -x, 1.0))).unzip();
        Keyframes { times, values }
    }

    #[test]
    fn interpolates_its_keys_and_is_constant_beyond_them() {
        let wind = keyframes(&[(0.0, 1.0), (1.0, 4.0), (1.5, 2.0), (4.0, 2.0)]);
        for (t, value) in wind.times.iter().zip(&wind.values) {
            assert_relative_eq!(wind.at(*t), *value, epsilon = 1e-15);
            assert_relative_eq!(wind.linear_at(*t), *value, epsilon = 1e-15);
        }
        assert_relative_eq!(wind.linear_at(1.125), Vector3::new(3.5, -3.5, 1.0), epsilon = 1e-15);
        assert_eq!([wind.linear_at(-9.0), wind.linear_at(9.0)], [wind.values[0], wind.values[3]]);
        assert_eq!(wind.at(-9.0), wind.values[0]);
        assert_eq!(wind.at(9.0), wind.values[3]);
        assert_eq!(Keyframes::constant(Vector3::x()).at(3.0), Vector3::x());
    }

    #[test]
    fn is_zero_where_the_keys_around_are() {
        let wind = keyframes(&[(1.0, 0.0), (2.0, 3.0), (3.0, 0.0), (4.0, 0.0), (5.0, 1.0)]);
        let wind = Keyframes { values: wind.values.iter().map(|v| v.xy()).collect(), times: wind.times };
        let spans = [[-9.0, 1.0], [3.0, 4.0], [3.2, 3.3]];
        assert!(spans.into_iter().all(|span| wind.is_zero_within(span)) && !wind.is_zero());
        for span in [[-9.0, 1.1], [0.0, 3.5], [3.5, 4.1], [6.0, 7.0]] {
            assert!(!wind.is_zero_within(span), "{span:?}");
        }
    }

    #[test]
    fn is_twice_differentiable_at_its_keys() {
        let wind = keyframes(&[(0.0, 1.0), (1.0, 2.0), (1.5, 4.0), (4.0, 5.0)]);
        let h = 1e-4;
        for &key in &wind.times {
            let second = |t: f64| (wind.at(t + h) - wind.at(t) * 2.0 + wind.at(t - h)) / (h * h);
            let first = |t: f64| (wind.at(t + h) - wind.at(t - h)) / (2.0 * h);
            assert!((first(key + 2.0 * h) - first(key - 2.0 * h)).norm() < 1e-2);
            assert!((second(key + 2.0 * h) - second(key - 2.0 * h)).norm() < 0.5);
        }
        assert!((wind.at(1.0 + h) - wind.at(1.0 - h)).norm() > h, "it moves through the key");
    }

    proptest! {
        #[test]
        fn never_overshoots(x in proptest::collection::vec(-9.0..9.0, 2..8), gaps in proptest::collection::vec(0.01..3.0, 8), u in 0.0..1.0) {
            let mut t = 0.0;
            let keys: Vec<(f64, f64)> = x.iter().zip(gaps).map(|(&x, gap)| { t += gap; (t, x) }).collect();
            let wind = keyframes(&keys);
            for pair in keys.windows(2) {
                let (low, high) = (pair[0].1.min(pair[1].1), pair[0].1.max(pair[1].1));
                let value = wind.at(pair[0].0 + u * (pair[1].0 - pair[0].0)).x;
                prop_assert!((low..=high).contains(&value));
            }
        }
    }
}
