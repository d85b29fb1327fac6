//! The frictional contact problem of one strand, its law, and the residual of a solution.

use crate::geometry::Friction;
use nalgebra::{Matrix3, Vector3};

/// One frictional contact problem of c contacts.
#[derive(Debug, Clone, Copy)]
pub struct FrictionProblem<'a> {
    /// W, 3c × 3c, row after row.
    pub w: &'a [f64],
    /// b, 3c.
    pub b: &'a [f64],
    /// What holds at each contact, c.
    pub laws: &'a [Law],
}

/// What holds at a contact.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Law {
    /// Signorini's condition with Coulomb's cone: that of the coefficient for what sticks where it sticks, else that for what slides.
    Coulomb(Friction),
    /// Bilateral constraint: u = 0 for any impulse.
    Bilateral,
}

/// When to stop.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FrictionTolerance {
    /// Relative residual (see [`FrictionProblem::residual`]) at which the solve has converged. Lower costs sweeps.
    pub residual: f64,
    /// Sweeps at most. Friction couples contacts; a strand with tens of them may need hundreds.
    pub sweeps: usize,
}

impl Default for FrictionTolerance {
    /// 1e-8 and 1000 sweeps: far below what a step's linearisation is worth, reached in tens of sweeps as a rule.
    fn default() -> Self {
        FrictionTolerance { residual: 1e-8, sweeps: 1000 }
    }
}

/// How a solve ended.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FrictionOutcome {
    /// Sweeps done.
    pub sweeps: usize,
    /// Relative residual reached.
    pub residual: f64,
}

impl FrictionProblem<'_> {
    /// Number of contacts c.
    pub fn len(&self) -> usize {
        self.laws.len()
    }

    /// Whether there is no contact.
    pub fn is_empty(&self) -> bool {
        self.laws.is_empty()
    }

    pub(super) fn free(&self, i: usize) -> Vector3<f64> {
        at(self.b, i)
    }

    /// Diagonal block of contact `i`.
    pub(super) fn block(&self, i: usize) -> Matrix3<f64> {
        let stride = 3 * self.len();
        Matrix3::from_fn(|row, column| self.w[(3 * i + row) * stride + 3 * i + column])
    }

    /// Relative velocity u of contact `i` under impulses `r`.
    pub fn velocity(&self, r: &[f64], i: usize) -> Vector3<f64> {
        let stride = 3 * self.len();
        Vector3::from_fn(|row, _| {
            let k = 3 * i + row;
            let line = &self.w[k * stride..(k + 1) * stride];
            self.b[k] + line.iter().zip(r).map(|(w, r)| w * r).sum::<f64>()
        })
    }

    /// Residual of De Saxcé's natural map, relative: √Σ|r/ρ − P_K(r/ρ − ũ)|² over max(√Σ|r/ρ|², √Σ|b|²), with ρ = 3/tr W_ii
    /// the contact's own scale of impulse over velocity. So it weighs velocities, those of stiff contacts no more than those of soft ones.
    /// Zero exactly at solutions.
    pub fn residual(&self, r: &[f64]) -> f64 {
        self.residual_giving(r, 0.0)
    }

    /// The same where every contact gives way by `compliance` beside, as a share of its own mobility.
    pub(super) fn residual_giving(&self, r: &[f64], compliance: f64) -> f64 {
        let mut residual = Residual::default();
        for i in 0..self.len() {
            let (trace, b, own) = (self.block(i).trace(), self.free(i), at(r, i));
            let u = self.velocity(r, i) + own * (compliance / 3.0 * trace);
            residual.add(trace * (1.0 + compliance), u, &own, &b, self.laws[i]);
        }
        residual.relative()
    }
}

/// The three components of contact `i`.
pub(super) fn at(r: &[f64], i: usize) -> Vector3<f64> {
    Vector3::from_column_slice(&r[3 * i..3 * i + 3])
}

/// Squares whose ratio is that of the relative residual.
#[derive(Default)]
pub(super) struct Residual {
    pub(super) error: f64,
    pub(super) impulse: f64,
    pub(super) free: f64,
}

impl Residual {
    pub(super) fn add(&mut self, trace: f64, u: Vector3<f64>, r: &Vector3<f64>, b: &Vector3<f64>, law: Law) {
        if trace <= 0.0 {
            return;
        }
        let rho = 3.0 / trace;
        let r = r / rho;
        self.error += match law {
            Law::Coulomb(friction) => {
                // What is beyond the cone of what slides must stick.
                let sliding = r.yz().norm() <= friction.mu_k * r.x * (1.0 + 1e-12);
                let mu = if sliding { friction.mu_k } else { friction.mu_s };
                let changed = Vector3::new(u.x + mu * u.yz().norm(), u.y, u.z);
                (r - project_on_cone(r - changed, mu)).norm_squared()
            }
            Law::Bilateral => u.norm_squared(),
        };
        self.impulse += r.norm_squared();
        self.free += b.norm_squared();
    }

    pub(super) fn relative(&self) -> f64 {
        let scale = self.impulse.max(self.free);
        if scale > 0.0 { (self.error / scale).sqrt() } else { 0.0 }
    }
}

/// Nearest point of the cone |y| ≤ µ x to `v` = (x, y).
pub(super) fn project_on_cone(v: Vector3<f64>, mu: f64) -> Vector3<f64> {
    let tangent = v.yz().norm();
    if tangent <= mu * v.x {
        return v;
    }
    if mu * tangent <= -v.x {
        return Vector3::zeros();
    }
    let x = (v.x + mu * tangent) / (1.0 + mu * mu);
    let scale = mu * x / tangent;
    Vector3::new(x, v.y * scale, v.z * scale)
}
