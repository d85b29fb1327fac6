//! Mathematics shared by all modules: rigid motions, SIMD lanes, splines, basis curves and frames of curves,
//! dense factorisation, random numbers, a tree of points. Depends on no other module.

pub mod basis_curve;
pub mod cholesky;
pub mod coast;
pub mod frame;
pub mod lanes;
pub mod point_tree;
pub mod polyline;
pub mod random;
pub mod sample_times;
pub mod se3;
pub mod spline;

use std::ops::AddAssign;

/// Nearest-rank percentile of at least one value; `share` in 0..=1.
pub fn percentile(mut values: Vec<f64>, share: f64) -> f64 {
    values.sort_unstable_by(f64::total_cmp);
    let rank = (share * values.len() as f64).ceil() as usize;
    values[rank.clamp(1, values.len()) - 1]
}

/// Merges neighbouring entries with equal keys; their values are added in order.
pub fn merge_equal_keys<K: PartialEq, V: AddAssign + Copy>(entries: &mut Vec<(K, V)>) {
    entries.dedup_by(|next, kept| {
        let same = next.0 == kept.0;
        if same {
            kept.1 += next.1;
        }
        same
    });
}

/// Smooth step from 0 at the first of `ends` to 1 at the second.
pub fn smoothstep(ends: [f64; 2], x: f64) -> f64 {
    let u = ((x - ends[0]) / (ends[1] - ends[0])).clamp(0.0, 1.0);
    u * u * (3.0 - 2.0 * u)
}

#[cfg(test)]
mod tests {
    use super::{merge_equal_keys, percentile};

    #[test]
    fn values_of_equal_keys_are_added() {
        let mut entries = vec![('a', 1), ('a', 2), ('b', 4), ('a', 8)];
        merge_equal_keys(&mut entries);
        assert_eq!(entries, [('a', 3), ('b', 4), ('a', 8)]);
    }

    #[test]
    fn percentiles_are_the_values_of_nearest_rank() {
        let values = vec![5.0, 1.0, 4.0, 2.0, 3.0];
        assert_eq!(
            [0.0, 0.2, 0.5, 0.95, 1.0].map(|share| percentile(values.clone(), share)),
            [1., 1., 3., 5., 5.]
        );
    }
}
