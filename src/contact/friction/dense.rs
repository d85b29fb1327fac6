//! Solver for one strand: sweeps, then Newton's method.

use super::gauss_seidel::{FrictionOutcome, FrictionScratch, FrictionTolerance, System, solve_by_sweeps};
use super::newton;
use super::problem::{FrictionProblem, at};
use crate::geometry::Friction;
use nalgebra::{Matrix3, Vector3};

/// Solves `problem` for the impulses `r` (3c), starting from their values (zero, or those of the last step):
/// by sweeps, and by Newton's method if these do not converge.
pub fn solve(
    problem: &FrictionProblem,
    tolerance: FrictionTolerance,
    r: &mut [f64],
    scratch: &mut FrictionScratch,
) -> FrictionOutcome {
    let outcome = solve_by_sweeps(&mut Dense { problem, r }, tolerance, false, scratch);
    if outcome.residual <= tolerance.residual {
        return outcome;
    }
    let residual = newton::improve(problem, tolerance, r, &mut scratch.budget);
    FrictionOutcome { residual, ..outcome }
}

/// A problem with an explicit W, and its impulses.
pub(super) struct Dense<'a> {
    pub problem: &'a FrictionProblem<'a>,
    pub r: &'a mut [f64],
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

    fn friction(&self, i: usize) -> Friction {
        self.problem.friction[i]
    }

    fn impulse(&self, i: usize) -> Vector3<f64> {
        at(self.r, i)
    }

    fn velocities(&mut self, u: &mut Vec<Vector3<f64>>) {
        u.clear();
        u.extend((0..self.contacts()).map(|i| self.velocity(i)));
    }

    fn velocity(&self, i: usize) -> Vector3<f64> {
        self.problem.velocity(self.r, i)
    }

    fn set_impulse(&mut self, i: usize, impulse: Vector3<f64>) {
        self.r[3 * i..3 * i + 3].copy_from_slice(impulse.as_slice());
    }
}
