//! A metric on strands and operations on its feature vectors.

use super::sections::Sections;
use crate::math::point_tree::PointTree;
use nalgebra::Vector3;
use rayon::prelude::*;

/// Strands as points of a Euclidean space, for "near roots and similar orientation along the whole length"
/// (Bertails & Cani 2004, section 4.3). The squared distance of two strands, m², is
///
///   Σ_k w_k (|Δx_k|² + λ² |Δt_k|²) + |Δx_0|²
///
/// with the points x_k and unit tangents t_k of the sections, their trapezoidal weights w_k (which sum to 1),
/// and λ = 0.1 × the mean length.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Features {
    /// Length of a row.
    pub(super) dim: usize,
    /// One row per strand, m; row-major.
    pub(super) rows: Vec<f64>,
}

/// Partial sums of a sum.
const LANES: usize = 4;
/// λ relative to the mean length.
const TANGENT_WEIGHT: f64 = 0.1;

impl Features {
    /// The features of strands of mean length `mean_length`, m, sampled at the fractions `arc`.
    pub(super) fn of(sections: &Sections, arc: &[f64], mean_length: f64) -> Self {
        let m = arc.len();
        let weight = |k: usize| 0.5 * (arc[(k + 1).min(m - 1)] - arc[k.saturating_sub(1)]);
        let dim = 6 * m;
        let mut rows = Vec::with_capacity(dim * sections.len());
        for i in 0..sections.len() {
            for (k, (x, t)) in sections.points(i).iter().zip(sections.tangents(i)).enumerate() {
                let w = weight(k);
                let point_scale = (w + if k == 0 { 1.0 } else { 0.0 }).sqrt();
                let tangent_scale = w.sqrt() * TANGENT_WEIGHT * mean_length;
                rows.extend((x * point_scale).iter().chain((t * tangent_scale).iter()));
            }
        }
        Features { dim, rows }
    }

    /// Row of strand `i`.
    pub(super) fn row(&self, i: usize) -> &[f64] {
        &self.rows[i * self.dim..(i + 1) * self.dim]
    }

    /// Number of strands.
    pub(super) fn len(&self) -> usize {
        self.rows.len() / self.dim
    }
}

/// Squared distance of two rows.
pub(super) fn distance_squared(a: &[f64], b: &[f64]) -> f64 {
    sum_in_lanes(a, b, b, |x, y, _| (x - y) * (x - y))
}

/// Inner product of `row − origin` with `direction`.
pub(super) fn project(row: &[f64], origin: &[f64], direction: &[f64]) -> f64 {
    sum_in_lanes(row, origin, direction, |x, o, d| (x - o) * d)
}

/// Sums a term over three rows of equal length in [`LANES`] partial sums, an order that vectorises and does
/// not depend on the processor.
fn sum_in_lanes(a: &[f64], b: &[f64], c: &[f64], term: impl Fn(f64, f64, f64) -> f64) -> f64 {
    let ([a, b, c], mut sums) = ([a, b, c].map(<[f64]>::as_chunks::<LANES>), [0.0; LANES]);
    for ((a, b), c) in a.0.iter().zip(b.0).zip(c.0) {
        for k in 0..LANES {
            sums[k] += term(a[k], b[k], c[k]);
        }
    }
    let remainder = a.1.iter().zip(b.1).zip(c.1).map(|((a, b), c)| term(*a, *b, *c));
    sums.iter().sum::<f64>() + remainder.sum::<f64>()
}

/// Rows to find the nearest of.
pub(super) struct Neighbours<'a> {
    features: &'a Features,
    /// The root points of the rows: the distance of these alone rules out most rows.
    roots: PointTree,
}

impl<'a> Neighbours<'a> {
    /// Those of `features`.
    pub(super) fn new(features: &'a Features) -> Self {
        let roots = (0..features.len()).map(|i| root(features.row(i))).collect();
        Neighbours { features, roots: PointTree::new(roots) }
    }

    /// Of the rows that are `wanted`, the `count` nearest to `row`, of equally near ones the first.
    pub(super) fn nearest(&self, row: &[f64], count: usize, wanted: impl Fn(usize) -> bool) -> Vec<usize> {
        let distance = |i: usize, _| {
            let a = self.features.row(i);
            wanted(i).then(|| distance_squared(&a[..3], &row[..3]) + distance_squared(&a[3..], &row[3..]))
        };
        self.roots.least(&root(row), count, distance).into_iter().map(|(_, i)| i).collect()
    }
}

/// The root point of a row, scaled.
fn root(row: &[f64]) -> Vector3<f64> {
    Vector3::new(row[0], row[1], row[2])
}

/// Index of the row of `to` nearest to each row of `from`; of equally near ones the first.
pub(super) fn nearest(from: &Features, to: &Features) -> Vec<u32> {
    let neighbours = Neighbours::new(to);
    let nearest = |i: usize| neighbours.nearest(from.row(i), 1, |_| true).first().map_or(0, |i| *i as u32);
    (0..from.len()).into_par_iter().map(nearest).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn sums_in_lanes_equal_plain_sums(rows in prop::collection::vec((-1.0..1.0, -1.0..1.0, -1.0..1.0), 0..15)) {
            let row = |of: fn(&(f64, f64, f64)) -> f64| rows.iter().map(of).collect::<Vec<f64>>();
            let [a, b, c] = [row(|r| r.0), row(|r| r.1), row(|r| r.2)];
            let plain: f64 = rows.iter().map(|(a, b, _)| (a - b) * (a - b)).sum();
            prop_assert!((distance_squared(&a, &b) - plain).abs() < 1e-13);
            let plain: f64 = rows.iter().map(|(a, b, c)| (a - b) * c).sum();
            prop_assert!((project(&a, &b, &c) - plain).abs() < 1e-13);
        }
    }
}
