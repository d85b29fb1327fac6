//! Strands looked at in sections: where each strand is, and which way it runs, at common arc-length fractions.

use crate::math::spline::ArcSpline;
use crate::scene::Curves;
use nalgebra::Vector3;
use rayon::prelude::*;

/// Strands sampled at common arc-length fractions; row `i` is strand `i`, `m` sections a row.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Sections {
    /// Number of sections `m`.
    pub(super) count: usize,
    /// Points, m; `n·m`.
    pub(super) point: Vec<Vector3<f64>>,
    /// Unit tangents; `n·m`.
    pub(super) tangent: Vec<Vector3<f64>>,
    /// Arc length of each strand, m; `n`.
    pub(super) length: Vec<f64>,
}

impl Sections {
    /// Samples every strand at the fractions `arc` (0 to 1, increasing).
    pub(super) fn of(curves: &Curves, arc: &[f64]) -> Self {
        let rows: Vec<_> = (0..curves.len())
            .into_par_iter()
            .map(|c| {
                let points = curves.curve(c);
                match ArcSpline::through(points) {
                    Some(spline) => {
                        let length = spline.length();
                        (
                            arc.iter()
                                .map(|s| spline.at(s * length))
                                .map(|at| (at.x, at.tangent))
                                .collect::<Vec<_>>(),
                            length,
                        )
                    }
                    None => (vec![(points[0], Vector3::z()); arc.len()], 0.0),
                }
            })
            .collect();
        let (point, tangent) = rows.iter().flat_map(|(row, _)| row.iter().copied()).unzip();
        Sections { count: arc.len(), point, tangent, length: rows.iter().map(|r| r.1).collect() }
    }

    /// Number of strands.
    pub(super) fn len(&self) -> usize {
        self.length.len()
    }

    /// Points of strand `i`.
    pub(super) fn points(&self, i: usize) -> &[Vector3<f64>] {
        &self.point[i * self.count..(i + 1) * self.count]
    }

    /// Tangents of strand `i`.
    pub(super) fn tangents(&self, i: usize) -> &[Vector3<f64>] {
        &self.tangent[i * self.count..(i + 1) * self.count]
    }
}

/// The measure of "near roots and similar orientation along the whole length" (Bertails & Cani 2004, 4.3): a strand
/// is a point of a space in which the squared distance of two strands, m², is Σ_k w_k (|Δx_k|² + λ² |Δt_k|²) +
/// |Δx_0|², with w_k the trapezoidal weights of the sections (they sum to 1), x_k the points, t_k the unit tangents,
/// and λ = 0.1 × the mean length: a strand turned by 0.1 rad all along counts for a hundredth of its length, on top
/// of where it ends up.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Features {
    /// Numbers in a row.
    pub(super) dim: usize,
    /// Row-major, one row a strand, m.
    pub(super) rows: Vec<f64>,
}

/// Terms of a sum that are formed at once.
const LANES: usize = 4;
/// λ as a share of the mean length.
const TURN_WEIGHT: f64 = 0.1;

impl Features {
    /// Rows of `sections`, in the measure for strands of mean length `mean_length`, m.
    pub(super) fn of(sections: &Sections, arc: &[f64], mean_length: f64) -> Self {
        let m = arc.len();
        let weight = |k: usize| 0.5 * (arc[(k + 1).min(m - 1)] - arc[k.saturating_sub(1)]);
        let dim = 6 * m;
        let mut rows = Vec::with_capacity(dim * sections.len());
        for i in 0..sections.len() {
            for (k, (x, t)) in sections.points(i).iter().zip(sections.tangents(i)).enumerate() {
                let w = weight(k);
                let at = (w + if k == 0 { 1.0 } else { 0.0 }).sqrt();
                let turn = w.sqrt() * TURN_WEIGHT * mean_length;
                rows.extend((x * at).iter().chain((t * turn).iter()));
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
    in_lanes(a, b, b, |x, y, _| (x - y) * (x - y))
}

/// How far `row` lies beyond `from` along `direction`, times the length of that.
pub(super) fn along(row: &[f64], from: &[f64], direction: &[f64]) -> f64 {
    in_lanes(row, from, direction, |x, m, d| (x - m) * d)
}

/// Sum of a term over three rows of one length, in an order that lets the processor form [`LANES`] terms at once.
fn in_lanes(a: &[f64], b: &[f64], c: &[f64], term: impl Fn(f64, f64, f64) -> f64) -> f64 {
    let ([a, b, c], mut sums) = ([a, b, c].map(<[f64]>::as_chunks::<LANES>), [0.0; LANES]);
    for ((a, b), c) in a.0.iter().zip(b.0).zip(c.0) {
        for k in 0..LANES {
            sums[k] += term(a[k], b[k], c[k]);
        }
    }
    let rest = a.1.iter().zip(b.1).zip(c.1).map(|((a, b), c)| term(*a, *b, *c));
    sums.iter().sum::<f64>() + rest.sum::<f64>()
}

/// Index of the row of `to` nearest each row of `from`, the first of equals. Both in the same measure.
pub(super) fn nearest(from: &Features, to: &Features) -> Vec<u32> {
    let nearest_to = |row: &[f64]| {
        let mut best = (f64::INFINITY, 0);
        for i in 0..to.len() {
            // The root comes first in a row and tells most strands apart, so the rest is rarely summed.
            let (a, b) = (to.row(i), row);
            let root = distance_squared(&a[..3], &b[..3]);
            if root < best.0 {
                let d = root + distance_squared(&a[3..], &b[3..]);
                if d < best.0 {
                    best = (d, i as u32);
                }
            }
        }
        best.1
    };
    (0..from.len()).into_par_iter().map(|i| nearest_to(from.row(i))).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn sums_in_lanes_are_sums(rows in prop::collection::vec((-1.0..1.0, -1.0..1.0, -1.0..1.0), 0..15)) {
            let row = |of: fn(&(f64, f64, f64)) -> f64| rows.iter().map(of).collect::<Vec<f64>>();
            let [a, b, c] = [row(|r| r.0), row(|r| r.1), row(|r| r.2)];
            let plain: f64 = rows.iter().map(|(a, b, _)| (a - b) * (a - b)).sum();
            prop_assert!((distance_squared(&a, &b) - plain).abs() < 1e-13);
            let plain: f64 = rows.iter().map(|(a, b, c)| (a - b) * c).sum();
            prop_assert!((along(&a, &b, &c) - plain).abs() < 1e-13);
        }
    }
}
