//! Mathematics shared by all modules: rigid motions, SIMD lanes, splines and frames of curves, dense
//! factorisation, random numbers. Depends on no other module.

pub mod cholesky;
pub mod coast;
pub mod frame;
pub mod lanes;
pub mod polyline;
pub mod random;
pub mod se3;
pub mod spline;

/// Nearest-rank percentile of at least one value; `share` in 0..=1.
pub fn percentile(mut values: Vec<f64>, share: f64) -> f64 {
    values.sort_unstable_by(f64::total_cmp);
    let rank = (share * values.len() as f64).ceil() as usize;
    values[rank.clamp(1, values.len()) - 1]
}

#[cfg(test)]
mod tests {
    use super::percentile;

    #[test]
    fn percentiles_are_the_values_of_nearest_rank() {
        let values = vec![5.0, 1.0, 4.0, 2.0, 3.0];
        assert_eq!(
            [0.0, 0.2, 0.5, 0.95, 1.0].map(|share| percentile(values.clone(), share)),
            [1., 1., 3., 5., 5.]
        );
    }
}
