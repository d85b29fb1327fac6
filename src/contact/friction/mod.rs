//! Signorini's condition with Coulomb's cone, for the contacts of one strand, and ([`CoupledFrictionProblem`]) of many that touch each other.
//!
//! | symbol | meaning | unit |
//! |---|---|---|
//! | W | Delassus matrix J H⁻¹ Jᵀ, symmetric positive semi-definite, 3c × 3c | any, say 1/kg |
//! | b | relative velocity without contact forces, plus gap / h in the normal entry | m/s |
//! | r | impulses, per contact (normal, tangent 1, tangent 2) | N s |
//! | u | relative velocity u = W r + b, in the same frame | m/s |
//! | µ | friction coefficient of a contact, of what slides or of what sticks | 1 |
//!
//! Wanted: at every contact 0 ≤ u_N ⟂ r_N ≥ 0, |r_T| ≤ µ r_N, and where u_T ≠ 0, r_T = −µ r_N u_T/|u_T|. With De Saxcé's
//! change of variable ũ = u + µ |u_T| e_N this is K_µ ∋ r ⟂ ũ ∈ K_µ*, K_µ the second-order cone |r_T| ≤ µ r_N.
//!
//! Nonsmooth block Gauss-Seidel with an exact local solve: G. Daviet, F. Bertails-Descoubes & L. Boissieux, "A hybrid
//! iterative solver for robustly capturing Coulomb friction in hair dynamics", 2011, accelerated (D. G. Anderson, 1965); what these
//! do not solve, by Newton's method on a smoothed problem, and along the path of its solutions (H. B. Keller, 1977). The order follows from the contacts alone, so results are the same bits on any thread.

mod anderson;
mod coupled;
mod local;
mod mobility;
mod newton;
mod path;
mod rounded;
mod smoothed;
mod sweep;

use crate::geometry::Friction;
pub use coupled::{CoupledFrictionProblem, StrandRows, solve_coupled};
pub use local::solve_local;
use nalgebra::{Matrix3, Vector3};
pub use sweep::FrictionScratch;
use sweep::{System, sweep};

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

    fn free(&self, i: usize) -> Vector3<f64> {
        at(self.b, i)
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

    /// Residual of De Saxcé's natural map, relative: √Σ|r/ρ − P_K(r/ρ − ũ)|² over max(√Σ|r/ρ|², √Σ|b|²), with ρ = 3/tr W_ii
    /// the contact's own scale of impulse over velocity. So it weighs velocities, those of stiff contacts no more than those of soft ones.
    /// Zero exactly at solutions.
    pub fn residual(&self, r: &[f64]) -> f64 {
        self.residual_giving(r, 0.0)
    }

    /// The same where every contact gives way by `compliance` beside, as a share of its own mobility.
    fn residual_giving(&self, r: &[f64], compliance: f64) -> f64 {
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
fn at(r: &[f64], i: usize) -> Vector3<f64> {
    Vector3::from_column_slice(&r[3 * i..3 * i + 3])
}

/// Squares whose ratio is that of the relative residual.
#[derive(Default)]
struct Residual {
    error: f64,
    impulse: f64,
    free: f64,
}

impl Residual {
    fn add(&mut self, trace: f64, u: Vector3<f64>, r: &Vector3<f64>, b: &Vector3<f64>, law: Law) {
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

    fn relative(&self) -> f64 {
        let scale = self.impulse.max(self.free);
        if scale > 0.0 { (self.error / scale).sqrt() } else { 0.0 }
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

/// Solves `problem` for the impulses `r` (3c), starting from what they hold (zero, or the last step's): by sweeps, and where these do not do, by
/// Newton's method.
pub fn solve(
    problem: &FrictionProblem,
    tolerance: FrictionTolerance,
    r: &mut [f64],
    scratch: &mut FrictionScratch,
) -> FrictionOutcome {
    let outcome = sweep(&mut Dense { problem, r }, tolerance, false, scratch);
    if outcome.residual <= tolerance.residual {
        return outcome;
    }
    FrictionOutcome { residual: newton::improve(problem, tolerance.residual, r), ..outcome }
}

struct Dense<'a> {
    problem: &'a FrictionProblem<'a>,
    r: &'a mut [f64],
}

impl System for Dense<'_> {
    fn contacts(&self) -> usize {
        self.problem.len()
    }

    fn block(&self, i: usize) -> Matrix3<f64> {
        self.problem.block(i)
    }

    fn free(&self, i: usize) -> Vector3<f64> {
        self.problem.free(i)
    }

    fn law(&self, i: usize) -> Law {
        self.problem.laws[i]
    }

    fn impulse(&self, i: usize) -> Vector3<f64> {
        at(self.r, i)
    }

    fn look(&mut self, u: &mut Vec<Vector3<f64>>) {
        u.clear();
        u.extend((0..self.contacts()).map(|i| self.velocity(i)));
    }

    fn velocity(&self, i: usize) -> Vector3<f64> {
        self.problem.velocity(self.r, i)
    }

    fn set(&mut self, i: usize, impulse: Vector3<f64>) {
        self.r[3 * i..3 * i + 3].copy_from_slice(impulse.as_slice());
    }
}

#[cfg(test)]
mod tests;
