//! Newton's method on the incremental potential, and the linearisations that contact builds on
//! (`docs/theory.md` §4.5).

use super::block_factor::BlockFactor;
use super::hessian::hessian;
use super::joint::RootJoint;
use super::model::Rod;
use super::potential::{Load, energy, gradient};
use super::secants::{Factor, Secants};
use super::segment::RodCore;
use super::sensitivity::Sensitivity;
use super::shape::RodShape;
use crate::math::cholesky;
use crate::math::lanes::{M3, MAX_LANES, Mask, Real, Twist};
use nalgebra::Matrix3;

/// Estimated error of the position of any point at which a solve has converged, as a fraction of the rod's
/// length (`docs/theory.md` eq. 4.4). [`FORCE_TOLERANCE`] is stricter for short steps.
pub const TOLERANCE: f64 = 1e-6;

/// Error of the acceleration of any point at which a solve has converged, in rod lengths per s². A point that
/// is off by δ after a step of h received the spurious acceleration δ/h², which accumulates over the steps
/// whatever h is.
pub const FORCE_TOLERANCE: f64 = 6e-4;

/// Iterations after which a solve is given up.
pub const MAX_ITERATIONS: u32 = 60;

/// Rotation of a segment by which one iteration may change it, rad. The Magnus series converges below π.
const MAX_TURN: f64 = 1.0;

/// The factor is kept for the next iteration after a full step that moved the rod by less than this fraction
/// of the step before.
const KEEP_CONTRACTION: f64 = 0.5;

/// Stands for the step before the first, as a fraction of the rod's length.
const FIRST_STEP: f64 = 0.3;

/// Sufficient decrease of the line search (Armijo), as a fraction of the slope.
const ARMIJO: f64 = 1e-4;

/// Maximum number of times a direction is shortened until it leads to a shape. Forces without bound, on a rod
/// that bodies leave no room for, may lead to none.
const MAX_SHORTENINGS: u32 = 200;

/// Fraction of the direction below which the line search gives up.
const MIN_FRACTION: f64 = 1e-6;

/// Unknowns of a rod from which on a solve factors the Hessian in blocks, in O(n), and not as a dense matrix: 8 nodes
/// take 1.06 of the time in blocks, 16 nodes 0.88. That of a root that turns stays dense: in blocks its joint comes
/// last, and a loose hair on two ties did not come to rest.
const LONG: usize = 30;

/// Outcome of a solve.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct NewtonOutcome {
    /// Iterations taken.
    pub iterations: u32,
    /// Whether the result meets the tolerances.
    pub converged: bool,
}

/// Solver and workspace of the implicit step, of one rod (`F` = f64) or one rod per lane. Reuse avoids
/// allocation.
#[derive(Debug, Clone)]
pub struct Solver<F = f64> {
    /// Shape at the current unknowns.
    pub shape: RodShape<F>,
    /// Derivatives of the shape at the last linearisation.
    pub sensitivity: Sensitivity<F>,
    /// −gradient of Φ at the last linearisation, then the direction of the step.
    pub direction: Vec<F>,
    /// Cholesky factor of the Hessian at the last linearisation ([`cholesky::factor`]).
    pub factor: Vec<F>,
    /// Buffer for the next factor.
    next_factor: Vec<F>,
    /// The factor of a solve of a long rod, and a buffer for the next.
    blocks: [BlockFactor<F>; 2],
    wrench: Vec<Twist<F>>,
    secants: Secants<F>,
    trial: Trial<F>,
    scratch: Vec<F>,
}

/// A trial step of the line search.
#[derive(Debug, Clone)]
struct Trial<F> {
    shape: RodShape<F>,
    q: Vec<F>,
}

/// One step to solve for.
#[derive(Clone, Copy)]
struct Problem<'a, F> {
    core: &'a RodCore<F>,
    /// Root frame at the end of the step, world axes.
    root: M3<F>,
    load: &'a Load<F>,
}

/// Tolerances of a solve.
struct Tolerance<F> {
    /// Largest motion of a point that counts as converged, m.
    motion: F,
    /// Change of Φ when a point is off by 10⁻⁹ of the length, J: Φ is not resolved further where it is near
    /// zero.
    rounding: F,
}

impl<F> Default for Solver<F> {
    fn default() -> Self {
        Solver {
            shape: RodShape::default(),
            sensitivity: Sensitivity::default(),
            direction: Vec::new(),
            factor: Vec::new(),
            next_factor: Vec::new(),
            blocks: Default::default(),
            wrench: Vec::new(),
            secants: Secants::default(),
            trial: Trial { shape: RodShape::default(), q: Vec::new() },
            scratch: Vec::new(),
        }
    }
}

impl Solver {
    /// Minimises Φ over `q`, starting from `q` or `other`, whichever has the lower Φ. `root` is the root
    /// frame at the end of the step, world axes. Afterwards [`Solver::shape`] is the shape at the result.
    pub fn minimise(
        &mut self,
        rod: &Rod,
        root: &Matrix3<f64>,
        load: &Load,
        q: &mut [f64],
        other: &[f64],
    ) -> NewtonOutcome {
        self.solve(&rod.core, M3::from(*root), load, q, other)[0]
    }

    /// Error of the position of a point, m, that stands for [`FORCE_TOLERANCE`] in a step of `rod` under `load`.
    pub fn tolerated_motion(rod: &Rod, load: &Load) -> f64 {
        rod.length() * rod.core.mass / load.inertia * FORCE_TOLERANCE
    }

    /// Sizes all buffers for solves of `rod`, under a load like `load`, so that they allocate nothing.
    pub fn reserve(&mut self, rod: &Rod, load: &Load) {
        let (points, unknowns) = (rod.points(), rod.unknowns());
        let shape = &self.trial.shape.pose;
        let square = unknowns * unknowns;
        if self.secants.room() >= unknowns
            && shape.capacity() >= points
            && self.next_factor.capacity() >= square
        {
            return;
        }
        self.secants.reserve(unknowns, MAX_ITERATIONS, 0.0);
        let q = &rod.initial_q;
        self.trial.q.clone_from(q);
        self.shape.update(rod, &rod.root.r, q);
        self.trial.shape.update(rod, &rod.root.r, q);
        energy(&rod.core, load, &self.shape, q, &mut self.scratch);
        self.blocks.iter_mut().for_each(|blocks| blocks.resize(&rod.core));
        // The factor and the buffer for the next.
        (0..2).for_each(|_| _ = self.linearise(rod, load, q));
    }

    /// Linearises Φ at `q`, whose shape is [`Solver::shape`]: sets [`Solver::sensitivity`],
    /// [`Solver::factor`] to L, and [`Solver::direction`] to L⁻¹(−gradient). Omits the geometric stiffness if
    /// the Hessian is indefinite. Returns `false` only if a number is not finite.
    pub fn linearise(&mut self, rod: &Rod, load: &Load, q: &[f64]) -> bool {
        self.negative_gradient(&rod.core, load, q);
        let sound = self.factorise(&rod.core, load, q, 1) == 1;
        cholesky::solve_lower(&self.factor, q.len(), &mut self.direction);
        sound
    }

    /// [`Solver::linearise`] at `q`, 1/m, near the unknowns where [`Solver::factor`] was found, which is kept.
    pub fn relinearise(&mut self, rod: &Rod, load: &Load, q: &[f64]) {
        self.negative_gradient(&rod.core, load, q);
        self.sensitivity.update_twists(&rod.core, &self.shape, q);
        cholesky::solve_lower(&self.factor, q.len(), &mut self.direction);
    }

    /// Moves `q` along [`Solver::direction`], shortened so that no segment turns by more than `MAX_TURN`
    /// and no point moves by more than `most`, m. Updates the shape and returns the largest displacement of a
    /// point, m; infinite if no part of the direction leads to a shape, so that the rod stays.
    pub fn advance(&mut self, rod: &Rod, root: &Matrix3<f64>, q: &mut [f64], most: f64) -> f64 {
        let mut t = self.max_fraction(&rod.core);
        for _ in 0..MAX_SHORTENINGS {
            let sound = self.evaluate_trial(&rod.core, M3::from(*root), q, t) == 1;
            let moved = self.shape.distance(&self.trial.shape);
            if moved <= most && sound {
                self.accept_trial(q);
                return moved;
            }
            t *= (0.9 * most / moved).min(0.9);
        }
        f64::INFINITY
    }

    /// [`Solver::advance`] under dead loads in addition to `load`, whose work on a shape is `work`, J, up to
    /// a constant. [`Solver::direction`] holds L⁻¹ times all forces, the dead loads included. Backtracks
    /// until Φ minus the work decreases sufficiently. Infinite as [`Solver::advance`].
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
        let phi = energy(&rod.core, load, &self.shape, q, &mut self.scratch) - work(&self.shape);
        let rounding = load.inertia * rod.core.length * rod.core.length * 1e-18 + phi.abs() * 1e-13;
        let mut t = self.max_fraction(&rod.core);
        // Largest fraction tried that moves no point too far. Forces between bodies that leave a rod no room
        // make directions so long that it alone is below `MIN_FRACTION`.
        let mut allowed = None;
        for _ in 0..MAX_SHORTENINGS {
            let sound = self.evaluate_trial(&rod.core, M3::from(*root), q, t) == 1;
            let Trial { shape, q: trial_q } = &self.trial;
            let moved = self.shape.distance(shape);
            if sound && moved <= most {
                let trial = energy(&rod.core, load, shape, trial_q, &mut self.scratch) - work(shape);
                let decreases = trial <= phi + t * slope * ARMIJO + rounding;
                if decreases || t < MIN_FRACTION * *allowed.get_or_insert(t) {
                    self.accept_trial(q);
                    return moved;
                }
            }
            t *= (0.9 * most / moved).min(0.5);
        }
        f64::INFINITY
    }
}

impl<F: Real> Solver<F> {
    /// [`Solver::minimise`] in every lane.
    #[inline(always)]
    pub(super) fn solve(
        &mut self,
        core: &RodCore<F>,
        root: M3<F>,
        load: &Load<F>,
        q: &mut [F],
        other: &[F],
    ) -> [NewtonOutcome; MAX_LANES] {
        let mut outcomes = [NewtonOutcome::default(); MAX_LANES];
        let problem = Problem { core, root, load };
        self.secants.reserve(q.len(), MAX_ITERATIONS, load.inertia.same(0.0));
        let mut phi = self.start(&problem, q, other);
        let zero = phi.same(0.0);
        let tolerance = Tolerance::new(core, load);
        let mut active = F::ALL;
        let (mut before, mut full_before) = (core.length * FIRST_STEP, 0);
        // Lanes that keep their factor.
        let mut kept = 0;
        for iteration in 1..=MAX_ITERATIONS {
            record(&mut outcomes, active, NewtonOutcome { iterations: iteration, converged: false });
            self.negative_gradient(core, load, q);
            self.secants.record(kept, &self.direction);
            let needed = active & !kept;
            let slope = if q.len() < LONG || core.joint != RootJoint::Clamped {
                active &= kept | self.factorise(core, load, q, needed);
                self.secants.solve(Factor::Dense(&self.factor), &mut self.direction)
            } else {
                active &= kept | self.factorise_blocks(core, load, q, needed);
                self.secants.solve(Factor::Blocks(&self.blocks[0]), &mut self.direction)
            };
            // The slope is zero for a rod at rest, which has converged.
            active &= slope.abs().below(slope.same(f64::MAX));
            if active != F::ALL {
                for d in &mut self.direction {
                    *d = d.or(active, zero);
                }
            }
            let t;
            (t, phi) = self.line_search(&problem, q, (phi, slope), &tolerance, kept, &mut active);
            let moved = self.shape.distance(&self.trial.shape);
            q.copy_from_slice(&self.trial.q);
            std::mem::swap(&mut self.shape, &mut self.trial.shape);
            let full = active & !t.below(t.same(1.0));
            // Error estimate if the contraction stays as it is. It may double after the first step with a
            // kept factor and improves with new factors.
            let foreseen = full
                & full_before
                & (moved * moved * 2.0).below(before * tolerance.motion)
                & moved.below(before);
            let done = full & (moved.below(tolerance.motion) | foreseen);
            record(&mut outcomes, done, NewtonOutcome { iterations: iteration, converged: true });
            active &= !done;
            if active == 0 {
                break;
            }
            kept = full & moved.below(before * KEEP_CONTRACTION);
            self.secants.set_step(&self.direction, t);
            (before, full_before) = (moved, full);
        }
        outcomes
    }

    /// Backtracking line search from `q`, where Φ and its slope along the direction are (`phi`, `slope`).
    /// Sets the trial; returns its fraction of the direction and its Φ, J. A lane that finds no decrease gets
    /// fraction 0, and leaves `active` unless it is in `kept`: a new factor may still give a descent
    /// direction.
    #[inline(always)]
    fn line_search(
        &mut self,
        &Problem { core, root, load }: &Problem<F>,
        q: &[F],
        (phi, slope): (F, F),
        tolerance: &Tolerance<F>,
        kept: Mask,
        active: &mut Mask,
    ) -> (F, F) {
        let zero = phi.same(0.0);
        let mut t = self.max_fraction(core);
        let mut pending = *active;
        loop {
            let sound = self.evaluate_trial(core, root, q, t);
            let trial_phi = energy(core, load, &self.trial.shape, &self.trial.q, &mut self.scratch);
            let bound = phi + t * slope * ARMIJO + phi.abs() * 1e-13 + tolerance.rounding;
            pending &= !(trial_phi.below(bound) & sound);
            if pending == 0 {
                return (t, trial_phi);
            }
            t = (t * 0.5).or(pending, t);
            let stuck = pending & t.below(t.same(MIN_FRACTION));
            t = zero.or(stuck, t);
            *active &= !(stuck & !kept);
            pending &= !stuck;
        }
    }

    /// Takes the start of lower Φ, sets the shape and returns Φ, J.
    #[inline(always)]
    fn start(&mut self, &Problem { core, root, load }: &Problem<F>, q: &mut [F], other: &[F]) -> F {
        let sound = self.shape.integrate(core, root, q);
        self.trial.shape.integrate(core, root, other);
        let phi = energy(core, load, &self.shape, q, &mut self.scratch);
        let other_phi = energy(core, load, &self.trial.shape, other, &mut self.scratch);
        let better = other_phi.below(phi) | !sound & F::ALL;
        for (q, o) in q.iter_mut().zip(other) {
            *q = o.or(better, *q);
        }
        if better == F::ALL {
            std::mem::swap(&mut self.shape, &mut self.trial.shape);
        } else if better != 0 {
            self.shape.integrate(core, root, q);
        }
        other_phi.or(better, phi)
    }

    /// Sets the Jacobians of the segments, and the direction to −gradient.
    #[inline(always)]
    fn negative_gradient(&mut self, core: &RodCore<F>, load: &Load<F>, q: &[F]) {
        self.sensitivity.update_jacobians(&self.shape);
        gradient(core, load, &self.shape, &self.sensitivity, q, &mut self.direction, &mut self.wrench);
        for g in &mut self.direction {
            *g = -*g;
        }
    }

    /// Replaces the factor in the lanes `needed`, for which the Jacobians are current. Returns the lanes
    /// where that succeeded.
    #[inline(always)]
    fn factorise(&mut self, core: &RodCore<F>, load: &Load<F>, q: &[F], needed: Mask) -> Mask {
        if needed == 0 {
            return 0;
        }
        self.sensitivity.update_twists(core, &self.shape, q);
        let one = load.inertia.same(1.0);
        let mut geometric = one;
        let positive = loop {
            let (shape, wrench) = (&self.shape, &self.wrench);
            hessian(core, load, shape, &self.sensitivity, wrench, q, geometric, &mut self.next_factor);
            let positive = needed & cholesky::factor(&mut self.next_factor, q.len());
            let without = needed & geometric.below(one);
            if positive | without == needed {
                break positive;
            }
            geometric = geometric.or(positive, one.same(0.0));
        };
        if needed == F::ALL || self.factor.len() != self.next_factor.len() {
            std::mem::swap(&mut self.factor, &mut self.next_factor);
        } else {
            for (old, new) in self.factor.iter_mut().zip(&self.next_factor) {
                *old = new.or(needed, *old);
            }
        }
        positive
    }

    /// [`Solver::factorise`] in blocks.
    #[inline(always)]
    fn factorise_blocks(&mut self, core: &RodCore<F>, load: &Load<F>, q: &[F], needed: Mask) -> Mask {
        if needed == 0 {
            return 0;
        }
        self.sensitivity.update_twists(core, &self.shape, q);
        let one = load.inertia.same(1.0);
        let mut geometric = one;
        let [factor, next] = &mut self.blocks;
        let positive = loop {
            let (shape, wrench) = (&self.shape, &self.wrench);
            let positive = needed & next.set(core, load, shape, &self.sensitivity, wrench, geometric);
            let without = needed & geometric.below(one);
            if positive | without == needed {
                break positive;
            }
            geometric = geometric.or(positive, one.same(0.0));
        };
        factor.resize(core);
        if needed == F::ALL {
            std::mem::swap(factor, next);
        } else {
            factor.replace(needed, next);
        }
        positive
    }

    /// Sets the trial to `q` + `t` · direction; returns the lanes whose shape is valid.
    #[inline(always)]
    fn evaluate_trial(&mut self, core: &RodCore<F>, root: M3<F>, q: &[F], t: F) -> Mask {
        self.trial.q.resize(q.len(), t);
        for ((new, q), d) in self.trial.q.iter_mut().zip(q).zip(&self.direction) {
            *new = *q + t * *d;
        }
        self.trial.shape.integrate(core, root, &self.trial.q)
    }

    /// Largest fraction of the direction, at most 1, that turns no segment and no joint by more than
    /// [`MAX_TURN`].
    #[inline(always)]
    fn max_fraction(&self, core: &RodCore<F>) -> F {
        let mut bend = core.length.same(0.0);
        for d in self.direction[3 * core.joint.blocks()..].chunks_exact(3) {
            bend = bend.max(d[0] * d[0] + d[1] * d[1] + d[2] * d[2]);
        }
        let one = bend.same(1.0);
        let mut turn = bend.sqrt() * core.longest * (1.0 / MAX_TURN);
        if core.joint != RootJoint::Clamped {
            let d = &self.direction[..3];
            turn = turn.max((d[0] * d[0] + d[1] * d[1] + d[2] * d[2]).sqrt() * (1.0 / MAX_TURN));
        }
        one / one.max(turn)
    }
}

impl Solver {
    fn accept_trial(&mut self, q: &mut [f64]) {
        q.copy_from_slice(&self.trial.q);
        std::mem::swap(&mut self.shape, &mut self.trial.shape);
    }
}

impl<F: Real> Tolerance<F> {
    /// Of `docs/theory.md` eq. 4.4.
    #[inline(always)]
    fn new(core: &RodCore<F>, load: &Load<F>) -> Self {
        let rounding = load.inertia * core.length * core.length * 1e-18;
        let force = core.mass / load.inertia * FORCE_TOLERANCE;
        let position = core.length.same(TOLERANCE);
        Tolerance { motion: core.length * force.or(force.below(position), position), rounding }
    }
}

/// Sets the outcome of the lanes in `mask`.
fn record(outcomes: &mut [NewtonOutcome; MAX_LANES], mask: Mask, outcome: NewtonOutcome) {
    for (i, o) in outcomes.iter_mut().enumerate() {
        if mask >> i & 1 == 1 {
            *o = outcome;
        }
    }
}
