//! Signorini's condition with Coulomb's cone, for the contacts of one strand, and ([`Coupled`]) of many that touch each other.
//!
//! | symbol | meaning | unit |
//! |---|---|---|
//! | W | Delassus matrix J H⁻¹ Jᵀ, symmetric positive semi-definite, 3c × 3c | any, say 1/kg |
//! | b | relative velocity without contact forces, plus gap / h in the normal entry | m/s |
//! | r | impulses, per contact (normal, tangent 1, tangent 2) | N s |
//! | u | relative velocity u = W r + b, in the same frame | m/s |
//! | µ | friction coefficient of a contact | 1 |
//!
//! Wanted: at every contact 0 ≤ u_N ⟂ r_N ≥ 0, |r_T| ≤ µ r_N, and where u_T ≠ 0, r_T = −µ r_N u_T/|u_T|. With De Saxcé's
//! change of variable ũ = u + µ |u_T| e_N this is K_µ ∋ r ⟂ ũ ∈ K_µ*, K_µ the second-order cone |r_T| ≤ µ r_N.
//!
//! Nonsmooth block Gauss-Seidel with an exact local solve: G. Daviet, F. Bertails-Descoubes & L. Boissieux, "A hybrid
//! iterative solver for robustly capturing Coulomb friction in hair dynamics", 2011. The order is that of the contacts and
//! nothing is allocated, so results are the same bits on any thread.

mod coupled;
mod local;

pub use coupled::{Coupled, Side, solve_coupled};
pub use local::solve_local;
use nalgebra::{Matrix3, Vector3};

/// One frictional contact problem of c contacts.
#[derive(Debug, Clone, Copy)]
pub struct Problem<'a> {
    /// W, 3c × 3c, row after row.
    pub w: &'a [f64],
    /// b, 3c.
    pub b: &'a [f64],
    /// µ, c, none negative.
    pub mu: &'a [f64],
}

/// When to stop.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Tolerance {
    /// Relative residual (see [`Problem::residual`]) at which the solve has converged. Lower costs sweeps.
    pub residual: f64,
    /// Sweeps at most. Friction couples contacts; a strand with tens of them may need hundreds.
    pub sweeps: usize,
}

impl Default for Tolerance {
    /// 1e-8 and 1000 sweeps: far below what a step's linearisation is worth, reached in tens of sweeps as a rule.
    fn default() -> Self {
        Tolerance { residual: 1e-8, sweeps: 1000 }
    }
}

/// How a solve ended.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Outcome {
    /// Sweeps done.
    pub sweeps: usize,
    /// Relative residual reached.
    pub residual: f64,
}

impl Problem<'_> {
    /// Number of contacts c.
    pub fn len(&self) -> usize {
        self.mu.len()
    }

    /// Whether there is no contact.
    pub fn is_empty(&self) -> bool {
        self.mu.is_empty()
    }

    /// Diagonal block of contact `i`.
    fn block(&self, i: usize) -> Matrix3<f64> {
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

    /// Residual of De Saxcé's natural map, relative: √Σ|r − P_K(r − ρ ũ)|² over max(√Σ|r|², √Σ|ρ b|²), with ρ = 3/tr W_ii
    /// the contact's own scale of impulse over velocity. Zero exactly at solutions.
    pub fn residual(&self, r: &[f64]) -> f64 {
        let (mut error, mut impulse, mut free) = (0.0, 0.0, 0.0);
        for i in 0..self.len() {
            let trace = self.block(i).trace();
            if trace <= 0.0 {
                continue;
            }
            let (rho, mu) = (3.0 / trace, self.mu[i]);
            let mut u = self.velocity(r, i);
            u.x += mu * u.yz().norm();
            let ri = Vector3::from_column_slice(&r[3 * i..3 * i + 3]);
            error += (ri - project_on_cone(ri - u * rho, mu)).norm_squared();
            impulse += ri.norm_squared();
            free += (Vector3::from_column_slice(&self.b[3 * i..3 * i + 3]) * rho).norm_squared();
        }
        let scale = f64::max(impulse, free);
        if scale > 0.0 { (error / scale).sqrt() } else { 0.0 }
    }
}

/// Nearest point of the cone |y| ≤ µ x to `v` = (x, y).
fn project_on_cone(v: Vector3<f64>, mu: f64) -> Vector3<f64> {
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

/// Solves `problem` for the impulses `r` (3c), starting from what they hold (zero, or the last step's).
pub fn solve(problem: &Problem, tolerance: Tolerance, r: &mut [f64]) -> Outcome {
    let mut residual = problem.residual(r);
    let mut sweeps = 0;
    while residual > tolerance.residual && sweeps < tolerance.sweeps {
        for i in 0..problem.len() {
            let w = problem.block(i);
            let old = Vector3::from_column_slice(&r[3 * i..3 * i + 3]);
            let q = problem.velocity(r, i) - w * old;
            r[3 * i..3 * i + 3].copy_from_slice(solve_local(&w, &q, problem.mu[i]).as_slice());
        }
        sweeps += 1;
        residual = problem.residual(r);
    }
    Outcome { sweeps, residual }
}

#[cfg(test)]
mod tests;
