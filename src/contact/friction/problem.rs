//! The frictional contact problem with an explicit Delassus operator.

use super::residual::Residual;
use crate::geometry::Friction;
use crate::math::cholesky::dot;
use nalgebra::{Matrix3, Vector3};

/// A frictional contact problem of c contacts; symbols as in the [module](super).
#[derive(Debug, Clone, Copy)]
pub struct FrictionProblem<'a> {
    /// W, 3c × 3c, row-major.
    pub w: &'a [f64],
    /// b, 3c.
    pub b: &'a [f64],
    /// Coefficients of each contact, c.
    pub friction: &'a [Friction],
}

impl FrictionProblem<'_> {
    /// Number of contacts c.
    pub fn len(&self) -> usize {
        self.friction.len()
    }

    /// Whether there are no contacts.
    pub fn is_empty(&self) -> bool {
        self.friction.is_empty()
    }

    /// Free velocity b of contact `i`.
    pub(super) fn free(&self, i: usize) -> Vector3<f64> {
        at(self.b, i)
    }

    /// Diagonal block W_ii.
    pub(super) fn block(&self, i: usize) -> Matrix3<f64> {
        let stride = 3 * self.len();
        Matrix3::from_fn(|row, column| self.w[(3 * i + row) * stride + 3 * i + column])
    }

    /// Relative velocity u of contact `i` under impulses `r` (3c).
    pub fn velocity(&self, r: &[f64], i: usize) -> Vector3<f64> {
        let stride = 3 * self.len();
        Vector3::from_fn(|row, _| {
            let k = 3 * i + row;
            self.b[k] + dot(&self.w[k * stride..(k + 1) * stride], r)
        })
    }

    /// Relative residual of De Saxcé's natural map under impulses `r` (3c): √Σ|r/ρ − P_K(r/ρ − ũ)|² over
    /// max(√Σ|r/ρ|², √Σ|b|²), with ρ = 3/tr W_ii. It measures velocities, with the same weight for stiff and
    /// soft contacts. Zero exactly at solutions.
    pub fn residual(&self, r: &[f64]) -> f64 {
        self.compliant_residual(r, 0.0)
    }

    /// The residual with an additional `compliance` of every contact, as a fraction of its own mobility tr
    /// W_ii / 3.
    pub(super) fn compliant_residual(&self, r: &[f64], compliance: f64) -> f64 {
        let mut residual = Residual::default();
        for i in 0..self.len() {
            let (trace, b, own) = (self.block(i).trace(), self.free(i), at(r, i));
            let u = self.velocity(r, i) + own * (compliance / 3.0 * trace);
            residual.add(trace * (1.0 + compliance), u, &own, &b, self.friction[i]);
        }
        residual.relative()
    }
}

/// The three components of contact `i`.
pub(super) fn at(r: &[f64], i: usize) -> Vector3<f64> {
    Vector3::from_column_slice(&r[3 * i..3 * i + 3])
}
