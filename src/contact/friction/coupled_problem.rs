//! The frictional contact problem of many strands, with W in factored form.

use super::problem::at;
use crate::geometry::Friction;
use crate::math::cholesky::dot;
use nalgebra::{Matrix3, Vector3};

/// Products that are summed side by side, in a fixed order: a multiple of what registers hold. Strands are solved
/// fastest whose rows have a multiple of it.
pub const ROW_WIDTH: usize = 8;

/// One strand's part in a contact.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct StrandRows {
    /// Index of the strand's first unknown in w; it identifies the strand.
    pub first_unknown: usize,
    /// Number of unknowns of the strand, with those of zeros that may fill its rows.
    pub unknowns: usize,
    /// Start of the strand's three rows of Yᵀ (normal, tangents) in [`CoupledFrictionProblem::rows`].
    pub offset: usize,
}

/// A frictional contact problem of c contacts between strands, or of strands with bodies.
///
/// With H = LLᵀ for every strand and Y = L⁻¹Jᵀ, W = YᵀY: its blocks are zero for contacts that share no
/// strand.
#[derive(Debug, Clone, Copy)]
pub struct CoupledFrictionProblem<'a> {
    /// The strands of each contact, c; one if the other side is a body, one twice if a strand meets itself.
    pub strands: &'a [[Option<StrandRows>; 2]],
    /// Rows of Yᵀ = JL⁻ᵀ, one after another.
    pub rows: &'a [f64],
    /// b, 3c: gap and slip without reactions.
    pub b: &'a [f64],
    /// Coefficients of each contact, c.
    pub friction: &'a [Friction],
}

impl CoupledFrictionProblem<'_> {
    fn row(&self, strand: &StrandRows, d: usize) -> &[f64] {
        let n = strand.unknowns;
        &self.rows[strand.offset + d * n..][..n]
    }

    /// Block W_ij.
    pub(super) fn block(&self, i: usize, j: usize) -> Matrix3<f64> {
        let mut block = Matrix3::zeros();
        for a in self.strands[i].iter().flatten() {
            for b in self.strands[j].iter().flatten().filter(|b| b.first_unknown == a.first_unknown) {
                block += Matrix3::from_fn(|row, column| dot(self.row(a, row), self.row(b, column)));
            }
        }
        block
    }

    /// The three rows of a strand in a contact.
    #[inline(always)]
    fn rows_of(&self, strand: &StrandRows) -> [&[f64]; 3] {
        let n = strand.unknowns;
        let (normal, tangents) = self.rows[strand.offset..][..3 * n].split_at(n);
        let (first, second) = tangents.split_at(n);
        [normal, first, second]
    }

    /// w = Y r.
    pub(super) fn apply(&self, r: &[f64], w: &mut [f64]) {
        w.fill(0.0);
        for (i, r) in r.chunks_exact(3).enumerate().filter(|(_, r)| **r != [0.0; 3]) {
            self.push(w, i, &Vector3::from_column_slice(r));
        }
    }

    /// Adds to `w` what the impulse `r` of contact `i` adds to Y r.
    #[inline(always)]
    pub(super) fn push(&self, w: &mut [f64], i: usize, r: &Vector3<f64>) {
        for strand in self.strands[i].iter().flatten() {
            let w = &mut w[strand.first_unknown..][..strand.unknowns];
            let [normal, first, second] = self.rows_of(strand);
            for (((w, n), a), b) in w.iter_mut().zip(normal).zip(first).zip(second) {
                *w += n * r.x + a * r.y + b * r.z;
            }
        }
    }

    /// u of contact `i` for w = Y r.
    #[inline(always)]
    pub(super) fn velocity(&self, w: &[f64], i: usize) -> Vector3<f64> {
        let mut u = at(self.b, i);
        for strand in self.strands[i].iter().flatten() {
            let w = &w[strand.first_unknown..][..strand.unknowns];
            let (wide, rest) = w.as_chunks::<ROW_WIDTH>();
            let rows = self.rows_of(strand).map(<[f64]>::as_chunks::<ROW_WIDTH>);
            let mut sums = [[0.0; ROW_WIDTH]; 3];
            for (k, w) in wide.iter().enumerate() {
                for (sum, (row, _)) in sums.iter_mut().zip(&rows) {
                    for l in 0..ROW_WIDTH {
                        sum[l] += row[k][l] * w[l];
                    }
                }
            }
            for (axis, (sum, (_, row))) in sums.into_iter().zip(&rows).enumerate() {
                let [a, b, c, d, e, f, g, h] = sum;
                let of_rest = row.iter().zip(rest).map(|(y, w)| y * w).sum::<f64>();
                u[axis] += ((a + e) + (b + f)) + ((c + g) + (d + h)) + of_rest;
            }
        }
        u
    }
}
