//! The frictional contact problem of many strands, with W in factored form.

use super::problem::at;
use crate::geometry::Friction;
use crate::math::cholesky::dot;
use nalgebra::{Matrix3, Vector3};

/// One strand's part in a contact.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct StrandRows {
    /// Index of the strand's first unknown in w; it identifies the strand.
    pub first_unknown: usize,
    /// Number of unknowns of the strand.
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

    /// w = Y r.
    pub(super) fn apply(&self, r: &[f64], w: &mut [f64]) {
        w.fill(0.0);
        for (strands, r) in self.strands.iter().zip(r.chunks_exact(3)).filter(|(_, r)| **r != [0.0; 3]) {
            for strand in strands.iter().flatten() {
                let (first, n) = (strand.first_unknown, strand.unknowns);
                for (d, r) in r.iter().enumerate() {
                    w[first..first + n].iter_mut().zip(self.row(strand, d)).for_each(|(w, y)| *w += y * r);
                }
            }
        }
    }

    /// u of contact `i` for w = Y r.
    pub(super) fn velocity(&self, w: &[f64], i: usize) -> Vector3<f64> {
        let mut u = at(self.b, i);
        for strand in self.strands[i].iter().flatten() {
            let (first, n) = (strand.first_unknown, strand.unknowns);
            u += Vector3::from_fn(|d, _| dot(self.row(strand, d), &w[first..first + n]));
        }
        u
    }
}
