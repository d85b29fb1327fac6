//! Continuation along the path of solutions of the smoothed law.
//!
//! For large τ the smoothed law of all contacts is close to that of a convex problem with a unique solution.
//! As τ decreases, the solutions form a path to one without smoothing, since they stay bounded unless some
//! impulses move nothing. With friction the path may turn back in τ, where Newton's method for decreasing τ
//! finds no solution. So it is followed along its own length, in x and ln τ (H. B. Keller, "Numerical
//! solution of bifurcation and nonlinear eigenvalue problems", 1977: pseudo-arclength continuation).

use super::budget::SystemBudget;
use super::problem::FrictionProblem;
use super::regularised::COMPLIANCE;
use super::smoothed_problem::{Evaluation, SmoothedProblem};
use nalgebra::DVector;

/// τ at the start of the path.
const ENTRY: f64 = 3.0;

/// Maximum number of Newton systems on a path; about 150 are usual.
const SYSTEMS: u32 = 400;

/// Maximum number of corrections of a step. Up to [`EASY`] the step length grows, from [`HARD`] on it
/// shrinks.
const CORRECTIONS: u32 = 5;
const EASY: u32 = 2;
const HARD: u32 = 4;

/// First and smallest step length.
const LENGTH: f64 = 0.5;
const SHORTEST: f64 = 1e-6;

/// Root mean square of the laws, over τ, below which a point is on the path; and the floor that rounding
/// sets.
const ON_PATH: f64 = 1e-6;
const ROUNDING: f64 = 1e-11;

/// Improves `r` if the path leads to a solution with a smaller residual, and stops at a residual of
/// `tolerance`. Takes the systems that it solves from `budget`.
pub(super) fn follow(
    smoothed: &SmoothedProblem,
    problem: &FrictionProblem,
    tolerance: f64,
    r: &mut [f64],
    budget: &mut SystemBudget,
) {
    let Some(mut path) = Path::enter(smoothed, budget) else { return };
    let mut best = problem.compliant_residual(r, COMPLIANCE);
    let mut trial = r.to_vec();
    while best > tolerance && path.step() {
        smoothed.unscale(&path.at.as_slice()[..smoothed.len()], &mut trial);
        let residual = problem.compliant_residual(&trial, COMPLIANCE);
        if residual < best {
            best = residual;
            r.copy_from_slice(&trial);
        }
    }
}

/// A point of the path, and how to continue.
pub(super) struct Path<'a> {
    smoothed: &'a SmoothedProblem,
    /// x and ln τ.
    pub at: DVector<f64>,
    /// Unit tangent.
    pub tangent: DVector<f64>,
    /// Length of the next step.
    length: f64,
    /// Systems that the sub-step may still solve, and number that the path may.
    budget: &'a mut SystemBudget,
    left: u32,
}

impl<'a> Path<'a> {
    /// The point of the path at τ = [`ENTRY`], by Newton's method.
    pub fn enter(smoothed: &'a SmoothedProblem, budget: &'a mut SystemBudget) -> Option<Self> {
        let n = smoothed.len();
        let mut at = DVector::zeros(n + 1);
        at[n] = ENTRY.ln();
        let mut tangent = DVector::zeros(n + 1);
        tangent[n] = -1.0;
        let mut path = Path { smoothed, at, tangent, length: LENGTH, budget, left: SYSTEMS };
        loop {
            let point = path.evaluate(&path.at.clone())?;
            if path.is_on(&point.f, path.at[n]) {
                return Some(path);
            }
            // The border keeps τ constant.
            let step = smoothed.solve_bordered(&point, point.f.push(0.0), &path.tangent)?.remove_row(n);
            let x = path.at.rows(0, n).into_owned();
            let (fraction, _) = smoothed.line_search(&x, &step, &point);
            path.at.rows_mut(0, n).copy_from(&(x - step * fraction));
        }
    }

    /// Advances along the path; returns whether that was possible.
    pub fn step(&mut self) -> bool {
        while self.length > SHORTEST {
            let predicted = &self.at + &self.tangent * self.length;
            let Some((corrections, next, tangent)) = self.correct(predicted) else {
                self.length *= 0.4;
                continue;
            };
            if corrections <= EASY {
                self.length *= 2.0;
            } else if corrections >= HARD {
                self.length *= 0.7;
            }
            (self.at, self.tangent) = (next, tangent);
            return true;
        }
        false
    }

    /// Corrects a `predicted` point perpendicular to the tangent. Returns the number of corrections, the
    /// point of the path, and the tangent there.
    fn correct(&mut self, predicted: DVector<f64>) -> Option<(u32, DVector<f64>, DVector<f64>)> {
        let n = self.smoothed.len();
        let mut at = predicted;
        for corrections in 0..=CORRECTIONS {
            let point = self.evaluate(&at)?;
            let is_on = self.is_on(&point.f, at[n]);
            let right = if is_on { DVector::zeros(n).push(1.0) } else { point.f.push(0.0) };
            let change = self.smoothed.solve_bordered(&point, right, &self.tangent)?;
            if is_on {
                return Some((corrections, at, change.normalize()));
            }
            at -= change;
        }
        None
    }

    /// The laws at x and ln τ, for one more system; `None` if these are out of range, or no system is left.
    fn evaluate(&mut self, at: &DVector<f64>) -> Option<Evaluation> {
        let n = self.smoothed.len();
        let tau = at[n].exp();
        if self.left == 0 || !(tau.is_normal() && at.iter().all(|x| x.is_finite())) || !self.budget.take() {
            return None;
        }
        self.left -= 1;
        Some(self.smoothed.evaluate(&at.rows(0, n).into_owned(), tau))
    }

    fn is_on(&self, f: &DVector<f64>, ln_tau: f64) -> bool {
        f.norm() <= (ON_PATH * ln_tau.exp().min(1.0)).max(ROUNDING) * (f.len() as f64).sqrt()
    }
}
