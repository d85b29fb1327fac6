//! Newton's method for contacts of which sweeps make nothing: more of them than the strand has unknowns, as where it is pulled taut round a body, or
//! wedged between others.
//!
//! The law, rounded off by τ ([`Smoothed`]), is solved while τ falls from step to step. Where the solution turns back as τ falls, that gets caught; then it
//! is followed along its path ([`path`]).

use super::mobility::COMPLIANCE;
use super::path;
use super::problem::FrictionProblem;
use super::smoothed::Smoothed;
use nalgebra::DVector;

/// Steps at most.
const STEPS: u32 = 60;

/// What is left of τ after a step that did well, and after one that did passably.
const WELL: f64 = 0.3;
const PASSABLY: f64 = 0.7;

/// Improves the impulses `r` of `problem` and returns its residual, which is some [`COMPLIANCE`] at best; never more than at the start.
///
/// What is solved, to a residual of `wanted`, is a problem whose contacts give way: without that, impulses that balance each other and move next to nothing
/// would be of any size, for contacts wedge a strand at its root.
pub(super) fn improve(problem: &FrictionProblem, wanted: f64, r: &mut [f64]) -> f64 {
    let mut soft = r.to_vec();
    if let Some(smoothed) = Smoothed::new(problem, r) {
        let left = descend(&smoothed, problem, wanted, &mut soft);
        if left > wanted.max(COMPLIANCE) {
            path::follow(&smoothed, problem, wanted, &mut soft);
        }
    }
    let [before, after] = [&*r, &soft].map(|r| problem.residual(r));
    if after < before {
        r.copy_from_slice(&soft);
    }
    after.min(before)
}

/// Newton's method from `r`, which holds the best that was met at the end. Returns its residual where contacts give way.
pub(super) fn descend(smoothed: &Smoothed, problem: &FrictionProblem, wanted: f64, r: &mut [f64]) -> f64 {
    let mut best = problem.residual_giving(r, COMPLIANCE);
    let mut x = smoothed.scaled(r);
    let mut trial_r = r.to_vec();
    let n = x.len();
    // What is rounded off stays as it is within a step.
    let mut border = DVector::zeros(n + 1);
    border[n] = 1.0;
    let mut tau = 1.0;
    for _ in 0..STEPS {
        if best <= wanted {
            break;
        }
        let point = smoothed.at(&x, tau);
        let Some(step) = smoothed.change(&point, point.f.push(0.0), &border) else { break };
        let step = step.remove_row(n);
        let (share, after) = smoothed.search(&x, &step, &point);
        if !after.is_finite() {
            break;
        }
        x -= step * share;
        if share > 0.5 || after < 0.25 * point.f.norm_squared() {
            tau *= WELL;
        } else if share > 0.1 {
            tau *= PASSABLY;
        }
        smoothed.unscale(x.as_slice(), &mut trial_r);
        let residual = problem.residual_giving(&trial_r, COMPLIANCE);
        if residual < best {
            best = residual;
            r.copy_from_slice(&trial_r);
        }
    }
    best
}
