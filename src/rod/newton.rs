//! Newton's method on the incremental potential, and the linearisation that contact builds on.

use super::potential::{Load, energy, gradient_hessian};
use super::{Rod, Sensitivity, Shape};
use crate::math::cholesky;
use nalgebra::Matrix3;

/// A solve has converged when a full Newton step moves no point by more than this fraction of the rod's length.
/// Convergence being quadratic, the point then stands far closer to the minimum than that.
pub const TOLERANCE: f64 = 1e-6;

/// Newton steps before a solve is given up; violent shaking takes about 10.
pub const MAX_ITERATIONS: u32 = 60;

/// Most that one Newton step may turn a sub-step of the rod, rad: the Magnus series converges below π.
const MAX_TURN: f64 = 1.0;

/// How a solve went.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Outcome {
    /// Newton steps taken.
    pub iterations: u32,
    /// Whether the last one was within [`TOLERANCE`].
    pub converged: bool,
}

/// Workspace of the implicit step of one rod at a time; reuse keeps the steps free of allocation.
#[derive(Debug, Clone, Default)]
pub struct Solver {
    /// Shape at the current unknowns.
    pub shape: Shape,
    /// Sensitivity at the last linearisation.
    pub sensitivity: Sensitivity,
    /// −gradient of Φ at the last linearisation, then the Newton direction.
    pub direction: Vec<f64>,
    /// Cholesky factor of the Hessian at the last linearisation ([`cholesky::factor`]).
    pub factor: Vec<f64>,
    trial: Shape,
    trial_q: Vec<f64>,
    scratch: Vec<f64>,
}

impl Solver {
    /// Φ at `q`, J.
    pub fn energy(&mut self, rod: &Rod, root: &Matrix3<f64>, load: &Load, q: &[f64]) -> f64 {
        self.scratch.resize(q.len(), 0.0);
        self.trial.update(rod, root, q);
        energy(rod, load, &self.trial, q, &mut self.scratch)
    }

    /// Minimises Φ from `q` (the start) in place. `root` is the root frame at the end of the step, world axes.
    /// Afterwards [`Solver::shape`] is the shape at the result.
    pub fn minimise(&mut self, rod: &Rod, root: &Matrix3<f64>, load: &Load, q: &mut [f64]) -> Outcome {
        let n = q.len();
        self.scratch.resize(n, 0.0);
        self.trial_q.resize(n, 0.0);
        self.shape.update(rod, root, q);
        let mut phi = energy(rod, load, &self.shape, q, &mut self.scratch);
        // The rounding of Φ, below which a decrease cannot be seen: its own, and that of the positions in its inertia, which counts
        // where Φ is nearly nought (a thousand-millionth of the length moves Φ by this much).
        let rounding = 1e-18 * rod.line_density * rod.length().powi(3) / (load.h * load.h);
        for iterations in 1..=MAX_ITERATIONS {
            if !self.linearise(rod, load, q) {
                return Outcome { iterations, converged: false };
            }
            let slope = -cholesky::dot(&self.direction, &self.direction);
            cholesky::solve_upper(&self.factor, n, &mut self.direction);
            let mut t = self.longest(rod);
            loop {
                for ((new, q), d) in self.trial_q.iter_mut().zip(&*q).zip(&self.direction) {
                    *new = q + t * d;
                }
                self.trial.update(rod, root, &self.trial_q);
                let trial_phi = energy(rod, load, &self.trial, &self.trial_q, &mut self.scratch);
                if trial_phi <= phi + 1e-4 * t * slope + 1e-13 * phi.abs() + rounding {
                    phi = trial_phi;
                    break;
                }
                t *= 0.5;
                if t < 1e-6 {
                    return Outcome { iterations, converged: false };
                }
            }
            let moved = self.moved();
            q.copy_from_slice(&self.trial_q);
            std::mem::swap(&mut self.shape, &mut self.trial);
            if t == 1.0 && moved <= TOLERANCE * rod.length() {
                return Outcome { iterations, converged: true };
            }
        }
        Outcome { iterations: MAX_ITERATIONS, converged: false }
    }

    /// Linearises Φ at `q`, whose shape is [`Solver::shape`]: fills [`Solver::sensitivity`], [`Solver::factor`], and
    /// [`Solver::direction`] with L⁻¹(−gradient). Where the Hessian is indefinite the geometric stiffness is left
    /// out. `false` only if a number is not finite.
    pub fn linearise(&mut self, rod: &Rod, load: &Load, q: &[f64]) -> bool {
        let n = q.len();
        self.sensitivity.update(rod, &self.shape, q);
        self.direction.resize(n, 0.0);
        self.factor.resize(n * n, 0.0);
        for geometric in [true, false] {
            gradient_hessian(
                rod,
                load,
                &self.shape,
                &self.sensitivity,
                q,
                geometric,
                &mut self.direction,
                &mut self.factor,
            );
            if cholesky::factor(&mut self.factor, n) {
                for g in &mut self.direction {
                    *g = -*g;
                }
                cholesky::solve_lower(&self.factor, n, &mut self.direction);
                return true;
            }
        }
        false
    }

    /// Moves `q` along the current direction, no further than the Magnus series allows and no point by more than about `most`,
    /// m; updates the shape and returns the largest displacement, m.
    pub fn advance(&mut self, rod: &Rod, root: &Matrix3<f64>, q: &mut [f64], most: f64) -> f64 {
        let mut t = self.longest(rod);
        loop {
            for ((new, q), d) in self.trial_q.iter_mut().zip(&*q).zip(&self.direction) {
                *new = q + t * d;
            }
            self.trial.update(rod, root, &self.trial_q);
            let moved = self.moved();
            if moved <= most {
                q.copy_from_slice(&self.trial_q);
                std::mem::swap(&mut self.shape, &mut self.trial);
                return moved;
            }
            t *= 0.9 * most / moved;
        }
    }

    /// Share of the direction, at most 1, that turns no sub-step by more than [`MAX_TURN`].
    fn longest(&self, rod: &Rod) -> f64 {
        let bend = self.direction.chunks_exact(3).map(|d| d[0] * d[0] + d[1] * d[1] + d[2] * d[2]);
        let turn = bend.fold(0.0, f64::max).sqrt() * rod.longest_step();
        (MAX_TURN / turn).min(1.0)
    }

    fn moved(&self) -> f64 {
        let d = self.shape.pose.iter().zip(&self.trial.pose).map(|(a, b)| (a.p - b.p).norm_squared());
        d.fold(0.0, f64::max).sqrt()
    }
}
