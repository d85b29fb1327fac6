//! Small mathematics shared by the solver: rigid motions, numbers in lanes, frames and splines of curves, dense kernels, random
//! numbers. Imports nothing of ours.

pub mod cholesky;
pub mod coast;
pub mod frame;
pub mod lanes;
pub mod polyline;
pub mod random;
pub mod se3;
pub mod spline;

/// Nearest-rank percentile (`share` 0 to 1) of values, of which there is one at least.
pub fn percentile(mut values: Vec<f64>, share: f64) -> f64 {
    values.sort_unstable_by(f64::total_cmp);
    let rank = (share * values.len() as f64).ceil() as usize;
    values[rank.clamp(1, values.len()) - 1]
}

#[cfg(test)]
mod tests {
    use super::percentile;

    #[test]
    fn percentiles_are_values_at_their_rank() {
        let values = vec![5.0, 1.0, 4.0, 2.0, 3.0];
        assert_eq!(
            [0.0, 0.2, 0.5, 0.95, 1.0].map(|share| percentile(values.clone(), share)),
            [1., 1., 3., 5., 5.]
        );
    }
}
