//! Newton's method on the incremental potential, and the linearisation that contact builds on.

use super::model::Beam;
use super::potential::{Load, energy, gradient_hessian};
use super::{Rod, Sensitivity, Shape};
use crate::math::cholesky;
use crate::math::lanes::{M3, MAX_LANES, Mask, Real};
use nalgebra::Matrix3;

/// A solve has converged when no point is further from where it belongs than this fraction of the rod's length, by the estimate
/// of `docs/theory.md` §4.5. Over a second of violent shaking such errors add up to some 10⁻⁵ of the length.
pub const TOLERANCE: f64 = 1e-7;

/// Newton steps before a solve is given up; violent shaking takes about 10.
pub const MAX_ITERATIONS: u32 = 60;

/// Most that one Newton step may turn a sub-step of the rod, rad: the Magnus series converges below π.
const MAX_TURN: f64 = 1.0;

/// How a solve went.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Outcome {
    /// Newton steps taken.
    pub iterations: u32,
    /// Whether the result is within [`TOLERANCE`].
    pub converged: bool,
}

/// Workspace of the implicit step of one rod at a time, or of several in lanes; reuse keeps the steps free of allocation.
#[derive(Debug, Clone)]
pub struct Solver<F = f64> {
    /// Shape at the current unknowns.
    pub shape: Shape<F>,
    /// Sensitivity at the last linearisation.
    pub sensitivity: Sensitivity<F>,
    /// −gradient of Φ at the last linearisation, then the Newton direction.
    pub direction: Vec<F>,
    /// Cholesky factor of the Hessian at the last linearisation ([`cholesky::factor`]).
    pub factor: Vec<F>,
    trial: Shape<F>,
    trial_q: Vec<F>,
    scratch: Vec<F>,
}

impl<F> Default for Solver<F> {
    fn default() -> Self {
        Solver {
            shape: Shape::default(),
            sensitivity: Sensitivity::default(),
            direction: Vec::new(),
            factor: Vec::new(),
            trial: Shape::default(),
            trial_q: Vec::new(),
            scratch: Vec::new(),
        }
    }
}

impl Solver {
    /// Minimises Φ in place, from the better of the starts `q` and `other`. `root` is the root frame at the end of the step, world
    /// axes. Afterwards [`Solver::shape`] is the shape at the result.
    pub fn minimise(
        &mut self,
        rod: &Rod,
        root: &Matrix3<f64>,
        load: &Load,
        q: &mut [f64],
        other: &[f64],
    ) -> Outcome {
        self.solve(&rod.beam, M3::from(*root), load, q, other)[0]
    }

    /// Linearises Φ at `q`, whose shape is [`Solver::shape`]: fills [`Solver::sensitivity`], [`Solver::factor`], and
    /// [`Solver::direction`] with L⁻¹(−gradient). Where the Hessian is indefinite the geometric stiffness is left
    /// out. `false` only if a number is not finite.
    pub fn linearise(&mut self, rod: &Rod, load: &Load, q: &[f64]) -> bool {
        self.factorise(&rod.beam, load, q, 1) == 1
    }

    /// Moves `q` along the current direction, no further than the Magnus series allows and no point by more than about `most`,
    /// m; updates the shape and returns the largest displacement, m.
    pub fn advance(&mut self, rod: &Rod, root: &Matrix3<f64>, q: &mut [f64], most: f64) -> f64 {
        let mut t = self.longest(&rod.beam);
        loop {
            let sound = self.attempt(&rod.beam, M3::from(*root), q, t) == 1;
            let moved = self.shape.distance(&self.trial);
            if moved <= most && sound {
                q.copy_from_slice(&self.trial_q);
                std::mem::swap(&mut self.shape, &mut self.trial);
                return moved;
            }
            t *= (0.9 * most / moved).min(0.9);
        }
    }
}

impl<F: Real> Solver<F> {
    /// [`Solver::minimise`] in every lane.
    #[inline(always)]
    pub(super) fn solve(
        &mut self,
        beam: &Beam<F>,
        root: M3<F>,
        load: &Load<F>,
        q: &mut [F],
        other: &[F],
    ) -> [Outcome; MAX_LANES] {
        let mut outcomes = [Outcome::default(); MAX_LANES];
        let mut phi = self.start(beam, root, load, q, other);
        let zero = phi.same(0.0);
        // The rounding of Φ, below which a decrease cannot be seen: its own, and that of the positions in its inertia, which counts
        // where Φ is nearly nought (a thousand-millionth of the length moves Φ by this much).
        let rounding = load.inertia * beam.length * beam.length * 1e-18;
        let tolerance = beam.length * TOLERANCE;
        let mut active = F::ALL;
        let (mut before, mut full_before) = (zero, 0);
        for iteration in 1..=MAX_ITERATIONS {
            note(&mut outcomes, active, Outcome { iterations: iteration, converged: false });
            active &= self.factorise(beam, load, q, active);
            let mut slope = zero;
            for d in &self.direction {
                slope -= *d * *d;
            }
            active &= slope.abs().below(slope.same(f64::MAX));
            cholesky::solve_upper(&self.factor, q.len(), &mut self.direction);
            for d in &mut self.direction {
                *d = d.or(active, zero);
            }
            let mut t = self.longest(beam);
            let mut trial_phi;
            let mut pending = active;
            loop {
                let sound = self.attempt(beam, root, q, t);
                trial_phi = energy(beam, load, &self.trial, &self.trial_q, &mut self.scratch);
                let bound = phi + t * slope * 1e-4 + phi.abs() * 1e-13 + rounding;
                pending &= !(trial_phi.below(bound) & sound);
                if pending == 0 {
                    break;
                }
                t = (t * 0.5).or(pending, t);
                let stuck = pending & t.below(t.same(1e-6));
                t = zero.or(stuck, t);
                active &= !stuck;
                pending &= active;
            }
            let moved = self.shape.distance(&self.trial);
            q.copy_from_slice(&self.trial_q);
            std::mem::swap(&mut self.shape, &mut self.trial);
            phi = trial_phi;
            let full = active & !t.below(t.same(1.0));
            // Were the contraction to stay at moved/before, as little as this would be left; near the minimum it improves.
            let foreseen =
                full & full_before & (moved * moved).below(before * tolerance) & moved.below(before);
            let done = full & (moved.below(tolerance) | foreseen);
            note(&mut outcomes, done, Outcome { iterations: iteration, converged: true });
            active &= !done;
            if active == 0 {
                break;
            }
            (before, full_before) = (moved, full);
        }
        outcomes
    }

    /// Takes the start of lower Φ, fills the shape and returns Φ, J.
    #[inline(always)]
    fn start(&mut self, beam: &Beam<F>, root: M3<F>, load: &Load<F>, q: &mut [F], other: &[F]) -> F {
        let sound = self.shape.bend(beam, root, q);
        self.trial.bend(beam, root, other);
        let phi = energy(beam, load, &self.shape, q, &mut self.scratch);
        let other_phi = energy(beam, load, &self.trial, other, &mut self.scratch);
        let better = other_phi.below(phi) | !sound & F::ALL;
        for (q, o) in q.iter_mut().zip(other) {
            *q = o.or(better, *q);
        }
        if better == F::ALL {
            std::mem::swap(&mut self.shape, &mut self.trial);
        } else if better != 0 {
            self.shape.bend(beam, root, q);
        }
        other_phi.or(better, phi)
    }

    /// [`Solver::linearise`], as far as the lanes of `needed` ask for; returns those lanes where it succeeded.
    #[inline(always)]
    fn factorise(&mut self, beam: &Beam<F>, load: &Load<F>, q: &[F], needed: Mask) -> Mask {
        let n = q.len();
        self.sensitivity.linearise(beam, &self.shape, q);
        let one = load.inertia.same(1.0);
        let mut geometric = one;
        loop {
            gradient_hessian(
                beam,
                load,
                &self.shape,
                &self.sensitivity,
                q,
                geometric,
                &mut self.direction,
                &mut self.factor,
            );
            let positive = needed & cholesky::factor(&mut self.factor, n);
            let without = needed & geometric.below(one);
            if positive | without == needed {
                for g in &mut self.direction {
                    *g = -*g;
                }
                cholesky::solve_lower(&self.factor, n, &mut self.direction);
                return positive;
            }
            geometric = geometric.or(positive, one.same(0.0));
        }
    }

    /// Fills the trial: unknowns `t` along the direction from `q`, and their shape; returns the lanes where it is sound.
    #[inline(always)]
    fn attempt(&mut self, beam: &Beam<F>, root: M3<F>, q: &[F], t: F) -> Mask {
        self.trial_q.resize(q.len(), t);
        for ((new, q), d) in self.trial_q.iter_mut().zip(q).zip(&self.direction) {
            *new = *q + t * *d;
        }
        self.trial.bend(beam, root, &self.trial_q)
    }

    /// Share of the direction, at most 1, that turns no sub-step by more than [`MAX_TURN`].
    #[inline(always)]
    fn longest(&self, beam: &Beam<F>) -> F {
        let mut bend = beam.length.same(0.0);
        for d in self.direction.chunks_exact(3) {
            bend = bend.max(d[0] * d[0] + d[1] * d[1] + d[2] * d[2]);
        }
        let one = bend.same(1.0);
        let turn = bend.sqrt() * beam.longest * (1.0 / MAX_TURN);
        one / one.max(turn)
    }
}

/// Sets the outcome of the lanes of `mask`.
fn note(outcomes: &mut [Outcome; MAX_LANES], mask: Mask, outcome: Outcome) {
    for (i, o) in outcomes.iter_mut().enumerate() {
        if mask >> i & 1 == 1 {
            *o = outcome;
        }
    }
}
