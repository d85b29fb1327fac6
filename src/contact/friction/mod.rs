//! Signorini's condition with Coulomb's law, for the contacts of one strand ([`FrictionProblem`]) and for
//! those of many strands that touch each other ([`CoupledFrictionProblem`]).
//!
//! | symbol | meaning | unit |
//! |---|---|---|
//! | W | Delassus operator J H⁻¹ Jᵀ, symmetric positive semi-definite, 3c × 3c | any, say 1/kg |
//! | b | relative velocity without reactions, plus gap / h in the normal entry | m/s |
//! | r | reaction impulses, per contact (normal, tangent 1, tangent 2) | N s |
//! | u | relative velocity u = W r + b, in the same frames | m/s |
//! | µ | friction coefficient of a contact, static or kinetic | 1 |
//!
//! At every contact 0 ≤ u_N ⟂ r_N ≥ 0, |r_T| ≤ µ r_N, and r_T = −µ r_N u_T/|u_T| if u_T ≠ 0: `docs/theory.md`
//! eq. 5.1. With De Saxcé's change of variable ũ = u + µ |u_T| e_N this is K_µ ∋ r ⟂ ũ ∈ K_µ*, where K_µ is
//! the second-order cone |r_T| ≤ µ r_N.
//!
//! The solver is nonsmooth block Gauss-Seidel with an exact local solve (G. Daviet, F. Bertails-Descoubes &
//! L. Boissieux, "A hybrid iterative solver for robustly capturing Coulomb friction in hair dynamics", 2011),
//! with Anderson acceleration (1965) for coupled strands. What it does not solve is solved by Newton's method
//! on a smoothed law, and by continuation along the path of its solutions (H. B. Keller, 1977). The order of
//! operations depends on the contacts alone, so results have the same bits on any number of threads.

mod anderson;
mod budget;
mod continuation;
mod coupled;
mod coupled_problem;
mod dense;
mod gauss_seidel;
mod interrupt;
mod local;
mod newton;
mod problem;
mod regularised;
mod residual;
mod smoothed_law;
mod smoothed_problem;

pub use budget::SystemBudget;
pub use coupled::solve_coupled;
pub use coupled_problem::{CoupledFrictionProblem, ROW_WIDTH, StrandRows};
pub use dense::solve;
pub use gauss_seidel::{FrictionOutcome, FrictionScratch, FrictionTolerance};
pub use interrupt::Interrupt;
pub use local::solve_local;
pub use problem::FrictionProblem;

#[cfg(test)]
mod tests;
