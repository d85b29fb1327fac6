//! Newton's method on the smoothed law, for problems that sweeps do not solve: those with more contacts than
//! the strand has unknowns, as where it is taut around a body, or wedged between others.
//!
//! The smoothing parameter τ decreases from step to step. Where the path of solutions turns back as τ
//! decreases, the iteration fails; then the path is followed along its length ([`continuation`]).

use super::budget::SystemBudget;
use super::continuation;
use super::gauss_seidel::FrictionTolerance;
use super::problem::FrictionProblem;
use super::regularised::COMPLIANCE;
use super::smoothed_problem::SmoothedProblem;
use nalgebra::DVector;

/// Maximum number of steps.
const STEPS: u32 = 60;

/// τ at the start over the residual of the impulses that it starts from: what is nearly solved needs little smoothing.
/// A rod that lies on a floor takes half as many systems as from [`MOST_SMOOTHED`], with 100 times the residual three
/// quarters.
const START: f64 = 10.0;

/// Largest τ at the start.
const MOST_SMOOTHED: f64 = 1.0;

/// Factors on τ after a good step and after a fair one.
const GOOD: f64 = 0.3;
const FAIR: f64 = 0.7;

/// Improves the impulses `r` of `problem` and returns its residual, which never increases. Takes
/// the systems that it solves from `budget`.
///
/// What is solved, to the residual of `tolerance`, is the problem with [`COMPLIANCE`], so that the residual of
/// `problem` itself does not fall below about that value. Without compliance, impulses that balance each
/// other and move next to nothing would be of any magnitude, for contacts wedge a strand at its root.
pub(super) fn improve(
    problem: &FrictionProblem,
    tolerance: FrictionTolerance,
    r: &mut [f64],
    budget: &mut SystemBudget,
) -> f64 {
    let mut compliant = r.to_vec();
    if let Some(smoothed) = SmoothedProblem::new(problem, r) {
        let residual = descend(&smoothed, problem, tolerance.residual, &mut compliant, budget);
        if tolerance.continuation && residual > tolerance.residual.max(COMPLIANCE) {
            continuation::follow(&smoothed, problem, tolerance.residual, &mut compliant, budget);
        }
    }
    let [before, after] = [&*r, &compliant].map(|r| problem.residual(r));
    if after < before {
        r.copy_from_slice(&compliant);
    }
    after.min(before)
}

/// Newton's method from `r`, which receives the best impulses found. Returns their residual with compliance.
pub(super) fn descend(
    smoothed: &SmoothedProblem,
    problem: &FrictionProblem,
    tolerance: f64,
    r: &mut [f64],
    budget: &mut SystemBudget,
) -> f64 {
    let mut best = problem.compliant_residual(r, COMPLIANCE);
    let mut x = smoothed.scaled(r);
    let mut trial_r = r.to_vec();
    let n = x.len();
    // τ is constant within a step.
    let mut border = DVector::zeros(n + 1);
    border[n] = 1.0;
    let mut tau = MOST_SMOOTHED.min(START * best);
    for _ in 0..STEPS {
        if best <= tolerance || !budget.take() {
            break;
        }
        let point = smoothed.evaluate(&x, tau);
        let Some(step) = smoothed.solve_bordered(&point, point.f.push(0.0), &border) else { break };
        let step = step.remove_row(n);
        let (fraction, after) = smoothed.line_search(&x, &step, &point);
        if !after.is_finite() {
            break;
        }
        x -= step * fraction;
        if fraction > 0.5 || after < 0.25 * point.f.norm_squared() {
            tau *= GOOD;
        } else if fraction > 0.1 {
            tau *= FAIR;
        }
        smoothed.unscale(x.as_slice(), &mut trial_r);
        let residual = problem.compliant_residual(&trial_r, COMPLIANCE);
        if residual < best {
            best = residual;
            r.copy_from_slice(&trial_r);
        }
    }
    best
}
