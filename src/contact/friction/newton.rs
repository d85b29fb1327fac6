//! Newton's method for contacts of which sweeps make nothing: more of them than the strand has unknowns, as where it is pulled taut round a body, or
//! wedged between others.
//!
//! The law, rounded off by τ ([`Smoothed`]), is solved while τ falls from step to step. Where the solution turns back as τ falls, that gets caught; then it
//! is followed along its path ([`path`]).

use super::Problem;
use super::path;
use super::smoothed::Smoothed;
use nalgebra::{DMatrix, DVector};

/// Steps at most.
const STEPS: u32 = 60;

/// What is left of τ after a step that did well, and after one that did passably.
const WELL: f64 = 0.3;
const PASSABLY: f64 = 0.7;

/// What is added to the diagonal, whose own size is 1: forces that balance each other and move nothing stay as they are.
const RIDGE: f64 = 1e-9;

/// How far a contact gives way, as a share of its own mobility.
pub(super) const COMPLIANCE: f64 = 1e-6;

/// Improves the impulses `r` of `problem` and returns its residual, which is some [`COMPLIANCE`] at best; never more than at the start.
///
/// What is solved, to a residual of `wanted`, is a problem whose contacts give way: without that, impulses that balance each other and move next to nothing
/// would be of any size, for contacts wedge a strand at its root.
pub(super) fn improve(problem: &Problem, wanted: f64, r: &mut [f64]) -> f64 {
    let mut w = problem.w.to_vec();
    for i in 0..problem.len() {
        let compliance = COMPLIANCE / 3.0 * problem.block(i).trace();
        (3 * i..3 * i + 3).for_each(|k| w[k * (3 * problem.len() + 1)] += compliance);
    }
    let mut soft = r.to_vec();
    let yielding = Problem { w: &w, ..*problem };
    if let Some(smoothed) = Smoothed::new(&yielding, r) {
        let left = descend(&smoothed, &yielding, wanted, &mut soft);
        if left > wanted.max(COMPLIANCE) {
            path::follow(&smoothed, &yielding, wanted, &mut soft);
        }
    }
    let [before, after] = [&*r, &soft].map(|r| problem.residual(r));
    if after < before {
        r.copy_from_slice(&soft);
    }
    after.min(before)
}

/// Newton's method from `r`, which holds the best that was met at the end. Returns its residual.
pub(super) fn descend(smoothed: &Smoothed, problem: &Problem, wanted: f64, r: &mut [f64]) -> f64 {
    let mut best = problem.residual(r);
    let mut x = smoothed.scaled(r);
    let mut trial_r = r.to_vec();
    let n = x.len();
    let mut derivative = DMatrix::zeros(n, n + 1);
    let (mut f, mut trial) = (DVector::zeros(n), DVector::zeros(n));
    let mut tau = 1.0;
    for _ in 0..STEPS {
        if best <= wanted {
            break;
        }
        smoothed.evaluate(&x, tau, &mut f, Some(&mut derivative));
        let mut jacobian = derivative.columns(0, n).into_owned();
        (0..n).for_each(|i| jacobian[(i, i)] += RIDGE);
        let Some(step) = jacobian.lu().solve(&f) else { break };
        let (share, after) = smoothed.search(&x, &step, tau, &f, &mut trial);
        if !after.is_finite() {
            break;
        }
        x -= step * share;
        if share > 0.5 || after < 0.25 * f.norm_squared() {
            tau *= WELL;
        } else if share > 0.1 {
            tau *= PASSABLY;
        }
        smoothed.unscale(x.as_slice(), &mut trial_r);
        let residual = problem.residual(&trial_r);
        if residual < best {
            best = residual;
            r.copy_from_slice(&trial_r);
        }
    }
    best
}
