//! The configuration half-way through a frame.

/// Weight of the value after `k` of `n` equal steps in the one half-way: a step's own end, or the cubic
/// through the four values around the middle. A single step has the mean of its ends.
pub(super) fn weight(k: i64, n: i64) -> f64 {
    match (n, (2 * k - n).abs()) {
        (1, _) => 0.5,
        (_, 0) => 1.0,
        (_, 1) => 9.0 / 16.0,
        (_, 3) if n % 2 == 1 => -1.0 / 16.0,
        _ => 0.0,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_value_half_way_is_exact_for_cubics_and_for_lines_with_one_step() {
        let cubic = |x: f64| 2.0 - 3.0 * x + 5.0 * x * x - 4.0 * x * x * x;
        for n in 1..=9_i64 {
            let of = |y: &dyn Fn(f64) -> f64| -> f64 {
                (0..=n).map(|k| weight(k, n) * y(k as f64 / n as f64)).sum()
            };
            assert!((of(&|x| 1.0 + x) - 1.5).abs() < 1e-12, "{n}");
            assert!(n == 1 || (of(&cubic) - cubic(0.5)).abs() < 1e-12, "{n}");
        }
    }
}
