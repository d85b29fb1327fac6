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
mod problem;
mod rounded;
mod smoothed;
mod sweep;

pub use coupled::{CoupledFrictionProblem, StrandRows, solve_coupled};
pub use local::solve_local;
use nalgebra::{Matrix3, Vector3};
use problem::at;
pub use problem::{FrictionOutcome, FrictionProblem, FrictionTolerance, Law};
pub use sweep::FrictionScratch;
use sweep::{System, sweep};

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
