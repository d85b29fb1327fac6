//! Newton's method on the incremental potential, and the linearisation that contact builds on.

use super::model::Beam;
use super::potential::{Load, energy, gradient, hessian};
use super::{Rod, RodShape, Sensitivity};
use crate::math::cholesky;
use crate::math::lanes::{M3, MAX_LANES, Mask, Real, Twist};
use nalgebra::Matrix3;

/// A solve has converged when no point is further from where it belongs than this fraction of the rod's length, by the estimate
/// of `docs/theory.md` §4.5, and in short steps no further than [`BALANCE`] allows.
pub const TOLERANCE: f64 = 1e-6;

/// Acceleration, in lengths per s², to which the forces on a rod are balanced at least: a point that is off by δ at the end of a step of
/// h has been pushed by δ/h² too much, which step after step adds up whatever h is.
pub const BALANCE: f64 = 6e-4;

/// Newton steps before a solve is given up.
pub const MAX_ITERATIONS: u32 = 60;

/// Most that one Newton step may turn a sub-step of the rod, rad: the Magnus series converges below π.
const MAX_TURN: f64 = 1.0;

/// A factor serves for the next step too where a full step moved the rod by less than this share of what the one before did.
const KEEP: f64 = 0.5;

/// What the first step is measured by instead, as a fraction of the rod's length.
const FIRST: f64 = 0.3;

/// How a solve went.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct NewtonOutcome {
    /// Newton steps taken.
    pub iterations: u32,
    /// Whether the result is within [`TOLERANCE`].
    pub converged: bool,
}

/// A step and by how much it changed the gradient: corrects the inverse Hessian (BFGS).
#[derive(Debug, Clone)]
struct Secant<F> {
    step: Vec<F>,
    change: Vec<F>,
    /// 1/(step · change); 0 in lanes where it does not count.
    inverse: F,
    share: F,
}

/// Workspace of the implicit step of one rod at a time, or of several in lanes; reuse keeps the steps free of allocation.
#[derive(Debug, Clone)]
pub struct Solver<F = f64> {
    /// RodShape at the current unknowns.
    pub shape: RodShape<F>,
    /// Sensitivity at the last linearisation.
    pub sensitivity: Sensitivity<F>,
    /// −gradient of Φ at the last linearisation, then the Newton direction.
    pub direction: Vec<F>,
    /// Cholesky factor of the Hessian at the last linearisation ([`cholesky::factor`]).
    pub factor: Vec<F>,
    /// The factor in the making.
    fresh: Vec<F>,
    wrench: Vec<Twist<F>>,
    /// −gradient of Φ before the step at hand, and the last step.
    downhill: Vec<F>,
    step: Vec<F>,
    /// What steps since the last factor have shown of the Hessian; the first `learnt` are in use.
    secants: Vec<Secant<F>>,
    learnt: usize,
    trial: RodShape<F>,
    trial_q: Vec<F>,
    scratch: Vec<F>,
}

impl<F> Default for Solver<F> {
    fn default() -> Self {
        Solver {
            shape: RodShape::default(),
            sensitivity: Sensitivity::default(),
            direction: Vec::new(),
            factor: Vec::new(),
            fresh: Vec::new(),
            wrench: Vec::new(),
            downhill: Vec::new(),
            step: Vec::new(),
            secants: Vec::new(),
            learnt: 0,
            trial: RodShape::default(),
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
    ) -> NewtonOutcome {
        self.solve(&rod.beam, M3::from(*root), load, q, other)[0]
    }

    /// Linearises Φ at `q`, whose shape is [`Solver::shape`]: fills [`Solver::sensitivity`], [`Solver::factor`], and
    /// [`Solver::direction`] with L⁻¹(−gradient). Where the Hessian is indefinite the geometric stiffness is left
    /// out. `false` only if a number is not finite.
    pub fn linearise(&mut self, rod: &Rod, load: &Load, q: &[f64]) -> bool {
        self.slope_down(&rod.beam, load, q);
        let sound = self.factorise(&rod.beam, load, q, 1) == 1;
        cholesky::solve_lower(&self.factor, q.len(), &mut self.direction);
        sound
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

    /// Moves `q` along H⁻¹ times the forces under dead loads besides `load`, whose work on a shape is `work`, J, up to a constant.
    /// [`Solver::direction`] holds L⁻¹ times all forces, the dead loads' included. No point moves by more than about `most`, m, and the
    /// step is cut until the potential decreases as Newton's method asks. Updates the shape and returns the largest displacement, m.
    pub fn advance_loaded(
        &mut self,
        rod: &Rod,
        root: &Matrix3<f64>,
        load: &Load,
        q: &mut [f64],
        work: impl Fn(&RodShape) -> f64,
        most: f64,
    ) -> f64 {
        let slope = -self.direction.iter().map(|d| d * d).sum::<f64>();
        cholesky::solve_upper(&self.factor, q.len(), &mut self.direction);
        let phi = energy(&rod.beam, load, &self.shape, q, &mut self.scratch) - work(&self.shape);
        let rounding = load.inertia * rod.beam.length * rod.beam.length * 1e-18 + phi.abs() * 1e-13;
        let mut t = self.longest(&rod.beam);
        loop {
            let sound = self.attempt(&rod.beam, M3::from(*root), q, t) == 1;
            let moved = self.shape.distance(&self.trial);
            let trial =
                energy(&rod.beam, load, &self.trial, &self.trial_q, &mut self.scratch) - work(&self.trial);
            if sound && moved <= most && trial <= phi + t * slope * 1e-4 + rounding || t < 1e-6 {
                q.copy_from_slice(&self.trial_q);
                std::mem::swap(&mut self.shape, &mut self.trial);
                return moved;
            }
            t *= (0.9 * most / moved).min(0.5);
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
    ) -> [NewtonOutcome; MAX_LANES] {
        let mut outcomes = [NewtonOutcome::default(); MAX_LANES];
        let mut phi = self.start(beam, root, load, q, other);
        let zero = phi.same(0.0);
        // The rounding of Φ, below which a decrease cannot be seen: its own, and that of the positions in its inertia, which counts
        // where Φ is nearly nought (a thousand-millionth of the length moves Φ by this much).
        let rounding = load.inertia * beam.length * beam.length * 1e-18;
        let balance = beam.mass / load.inertia * BALANCE;
        let largest = zero.same(TOLERANCE);
        let tolerance = beam.length * balance.or(balance.below(largest), largest);
        let mut active = F::ALL;
        let (mut before, mut full_before) = (beam.length * FIRST, 0);
        // Lanes whose factor serves once more.
        let mut kept = 0;
        for iteration in 1..=MAX_ITERATIONS {
            note(&mut outcomes, active, NewtonOutcome { iterations: iteration, converged: false });
            self.slope_down(beam, load, q);
            self.learn(kept);
            active &= kept | self.factorise(beam, load, q, active & !kept);
            let slope = self.descend();
            // A slope of nought is that of a rod at rest, which has arrived.
            active &= slope.abs().below(slope.same(f64::MAX));
            if active != F::ALL {
                for d in &mut self.direction {
                    *d = d.or(active, zero);
                }
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
                // A fresh factor may find the way.
                active &= !(stuck & !kept);
                pending &= !stuck;
            }
            let moved = self.shape.distance(&self.trial);
            q.copy_from_slice(&self.trial_q);
            std::mem::swap(&mut self.shape, &mut self.trial);
            phi = trial_phi;
            let full = active & !t.below(t.same(1.0));
            // Were the contraction to stay as it is, as little as this would be left; after the first step with a factor it may
            // double, with fresh factors it improves.
            let foreseen =
                full & full_before & (moved * moved * 2.0).below(before * tolerance) & moved.below(before);
            let done = full & (moved.below(tolerance) | foreseen);
            note(&mut outcomes, done, NewtonOutcome { iterations: iteration, converged: true });
            active &= !done;
            if active == 0 {
                break;
            }
            kept = full & moved.below(before * KEEP);
            self.step.resize(q.len(), zero);
            for (step, d) in self.step.iter_mut().zip(&self.direction) {
                *step = *d * t;
            }
            (before, full_before) = (moved, full);
        }
        outcomes
    }

    /// Enters what the last step has shown of the Hessian, in the lanes of `kept`, where the gradient before it and the step are at
    /// hand; the others forget what they had learnt.
    #[inline(always)]
    fn learn(&mut self, kept: Mask) {
        let zero = self.direction[0].same(0.0);
        if kept == 0 {
            self.learnt = 0;
            self.downhill.clone_from(&self.direction);
            return;
        }
        for secant in &mut self.secants[..self.learnt] {
            secant.inverse = secant.inverse.or(kept, zero);
        }
        if self.learnt == self.secants.len() {
            self.secants.push(Secant { step: Vec::new(), change: Vec::new(), inverse: zero, share: zero });
        }
        let secant = &mut self.secants[self.learnt];
        self.learnt += 1;
        secant.step.clone_from(&self.step);
        secant.change.clone_from(&self.downhill);
        let mut curvature = zero;
        for i in 0..secant.step.len() {
            secant.change[i] -= self.direction[i];
            curvature += secant.change[i] * secant.step[i];
        }
        let convex = kept & zero.below(curvature);
        secant.inverse = (zero.same(1.0) / curvature).or(convex, zero);
        self.downhill.clone_from(&self.direction);
    }

    /// Turns −gradient into the direction of the next step and returns the slope of Φ along it, J.
    #[inline(always)]
    fn descend(&mut self) -> F {
        let n = self.direction.len();
        let zero = self.direction[0].same(0.0);
        for secant in self.secants[..self.learnt].iter_mut().rev() {
            let mut along = zero;
            for i in 0..n {
                along += secant.step[i] * self.direction[i];
            }
            secant.share = along * secant.inverse;
            for i in 0..n {
                self.direction[i] -= secant.change[i] * secant.share;
            }
        }
        cholesky::solve(&self.factor, n, &mut self.direction);
        for secant in &self.secants[..self.learnt] {
            let mut along = zero;
            for i in 0..n {
                along += secant.change[i] * self.direction[i];
            }
            let share = secant.share - along * secant.inverse;
            for i in 0..n {
                self.direction[i] += secant.step[i] * share;
            }
        }
        let mut slope = zero;
        for i in 0..n {
            slope -= self.downhill[i] * self.direction[i];
        }
        slope
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

    /// Fills the levers, and the direction with −gradient.
    #[inline(always)]
    fn slope_down(&mut self, beam: &Beam<F>, load: &Load<F>, q: &[F]) {
        self.sensitivity.levers(&self.shape);
        gradient(beam, load, &self.shape, &self.sensitivity, q, &mut self.direction, &mut self.wrench);
        for g in &mut self.direction {
            *g = -*g;
        }
    }

    /// Renews the factor in the lanes of `needed`, the levers being there; returns those lanes where it succeeded.
    #[inline(always)]
    fn factorise(&mut self, beam: &Beam<F>, load: &Load<F>, q: &[F], needed: Mask) -> Mask {
        if needed == 0 {
            return 0;
        }
        self.sensitivity.twists(beam, q);
        let one = load.inertia.same(1.0);
        let mut geometric = one;
        let positive = loop {
            hessian(beam, load, &self.shape, &self.sensitivity, &self.wrench, geometric, &mut self.fresh);
            let positive = needed & cholesky::factor(&mut self.fresh, q.len());
            let without = needed & geometric.below(one);
            if positive | without == needed {
                break positive;
            }
            geometric = geometric.or(positive, one.same(0.0));
        };
        if needed == F::ALL || self.factor.len() != self.fresh.len() {
            std::mem::swap(&mut self.factor, &mut self.fresh);
        } else {
            for (old, new) in self.factor.iter_mut().zip(&self.fresh) {
                *old = new.or(needed, *old);
            }
        }
        positive
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
fn note(outcomes: &mut [NewtonOutcome; MAX_LANES], mask: Mask, outcome: NewtonOutcome) {
    for (i, o) in outcomes.iter_mut().enumerate() {
        if mask >> i & 1 == 1 {
            *o = outcome;
        }
    }
}
