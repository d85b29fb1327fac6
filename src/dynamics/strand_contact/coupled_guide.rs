//! A guide in the coupled solve.

use super::contact_pair::ContactPair;
use super::contact_pairs::{ContactPairs, MARGIN};
use crate::dynamics::body_contact::{MAX_MOVE, rows_at};
use crate::dynamics::environment::Environment;
use crate::dynamics::guide::{ContactSolve, GuideModel, GuideScratch, GuideState};
use crate::dynamics::step_record::StepRecord;
use crate::math::se3::Pose;
use crate::rod::RodShape;
use nalgebra::{Matrix3, UnitQuaternion, Vector3};

/// Residual of the reactions above which another round is needed.
pub(super) const RESIDUAL_TOLERANCE: f64 = 1e-6;

/// Displacement of a point in a round below which the guide has converged, m: the next round would move it by
/// about the square of this over the radius of a bend, some hundredths of a micrometre. What is left of the slip
/// of a sticking contact is there again in the next sub-step, and adds up.
const CONVERGED_DISPLACEMENT: f64 = 1e-5;

/// Displacement of a point in a round up to which the guide keeps the factor of its Hessian for the next, m: this
/// costs no rounds. Ten times as much hardly saves more.
const KEPT_FACTOR_DISPLACEMENT: f64 = 3e-5;

/// Displacement of a point in a round that counts as none, m: further rounds would not resolve a violated
/// contact.
const STALLED_DISPLACEMENT: f64 = 5e-6;

/// Displacement of a point in the last round, m, above which a guide that has not come to rest is a reason to halve the
/// sub-step for all that is connected with it. Of 2,000 guides in a heap, two to six a sub-step went to and fro by 0.01 to
/// 1 mm with all distances kept, and as much in the halves. What moves by more may be thrown about.
const UNSOLVED_DISPLACEMENT: f64 = 1e-3;

/// Rounds after which a guide that a round moved by more than [`HOPELESS_DISPLACEMENT`], m, is taken not to
/// converge. In one combed head 22 sub-steps came to rest after more rounds, and none moved by more than 2 mm then; of
/// 22 that did not come to rest a quarter to a half did.
const HOPELESS_ROUNDS: u32 = 8;

/// See [`HOPELESS_ROUNDS`].
const HOPELESS_DISPLACEMENT: f64 = 3e-3;

/// Least share of its motion that a truncated guide takes.
const MIN_MOTION_SHARE: f64 = 0.25;

/// How a guide ends a sub-step.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum EndState {
    /// At the end of the coupled solve.
    Coupled,
    /// At the end of its uncoupled step.
    Uncoupled,
    /// At rest relative to the head.
    AtRestOnHead,
}

/// A guide in the coupled solve.
#[derive(Debug)]
pub(super) struct CoupledGuide {
    /// True if it has taken an uncoupled step that converged; only then it can be coupled.
    pub converged: bool,
    /// True if it takes part in the coupled solve.
    pub is_coupled: bool,
    /// True if it takes part in no further round, for it is to take the sub-step in parts.
    pub given_up: bool,
    /// True if it needs another round.
    pub needs_round: bool,
    /// True if its motion crosses no body, and its end keeps the distance from bodies.
    clears_bodies: bool,
    /// Shortfall of distance from bodies that is accepted, m: that of its uncoupled step.
    accepted_shortfall: f64,
    pub end_state: EndState,
    /// Share of its motion that it takes.
    motion_share: f64,
    /// Rounds in which it took part.
    pub rounds: u32,
    /// Residual of the reactions of the last round.
    pub residual: f64,
    /// True if the reactions of the last round were solved for on the way only.
    pub provisional: bool,
    /// Largest displacement of its points in the last round, m.
    pub displacement: f64,
    /// Most that its points have moved since its candidates were found, m.
    moved: f64,
    /// Unknowns at the end of its uncoupled step, 1/m.
    uncoupled_q: Vec<f64>,
    /// Root at the end of the sub-step, world.
    pub root: Pose,
    /// Its system and its contacts with bodies.
    pub scratch: GuideScratch,
    /// Its sides of contacts with other guides, ascending: (contact, side).
    pub sides: Vec<(usize, usize)>,
    /// L⁻¹Jᵀ of `sides`: three rows each.
    pub rows: Vec<f64>,
    /// The curve at its end, m, world.
    pub curve: Vec<Vector3<f64>>,
    /// Contact forces on its rod: segment, fraction of it, force, N, world.
    forces: Vec<(usize, f64, Vector3<f64>)>,
}

impl CoupledGuide {
    /// A guide that is not coupled.
    pub fn new() -> Self {
        CoupledGuide {
            converged: true,
            is_coupled: false,
            given_up: false,
            needs_round: false,
            clears_bodies: true,
            accepted_shortfall: 0.0,
            end_state: EndState::Coupled,
            motion_share: 1.0,
            rounds: 0,
            residual: 0.0,
            provisional: false,
            displacement: 0.0,
            moved: 0.0,
            uncoupled_q: Vec::new(),
            root: Pose { r: Matrix3::identity(), p: Vector3::zeros() },
            scratch: GuideScratch::default(),
            sides: Vec::new(),
            rows: Vec::new(),
            curve: Vec::new(),
            forces: Vec::new(),
        }
    }

    /// Begins a sub-step; whether its uncoupled step `converged`.
    pub fn begin(&mut self, converged: bool) {
        self.converged = converged;
        self.is_coupled = false;
        self.given_up = false;
        self.needs_round = false;
        (self.rounds, self.residual, self.displacement) = (0, 0.0, f64::INFINITY);
        self.moved = 0.0;
        self.end_state = EndState::Coupled;
        self.motion_share = 1.0;
    }

    /// Couples the guide in the sub-step from `t[0]` to `t[1]`, s, which it has just taken uncoupled.
    pub fn couple(&mut self, model: &GuideModel, state: &mut GuideState, env: &Environment, t: [f64; 2]) {
        self.root = model.reopen(env, state, t, &mut self.scratch);
        self.uncoupled_q.clone_from(&self.scratch.q);
        self.update_curve(model);
        self.forces.clear();
        self.is_coupled = true;
        self.needs_round = true;
        self.accepted_shortfall = 0.0;
        self.find_body_contacts(model, state, env);
        if !self.clears_bodies {
            // Falling back to the uncoupled step would gain nothing.
            self.accepted_shortfall = self.scratch.contact.detection.shortfall;
        }
    }

    /// Finds the contacts with bodies at its current end.
    pub fn find_body_contacts(&mut self, model: &GuideModel, state: &mut GuideState, env: &Environment) {
        let (contact, ContactSolve { solver, contact_cache, scratch, .. }) =
            model.body_contact(env, state, &self.root, &mut self.scratch);
        let clear = contact.find(solver, contact_cache, scratch);
        self.scratch.contact.detection.frozen = true;
        self.clears_bodies = clear && self.scratch.contact.detection.shortfall <= self.accepted_shortfall;
    }

    /// True if its coupled motion crosses a body or ends too close to one.
    pub fn violates_bodies(&self) -> bool {
        self.is_coupled && !self.clears_bodies
    }

    /// Linearises its system at its current end, with the rows of all contacts; `to_world` rotates the axes
    /// of contacts between guides. A guide whose system cannot be factored, because it is not finite, ends
    /// uncoupled.
    pub fn linearise(
        &mut self,
        model: &GuideModel,
        state: &mut GuideState,
        env: &Environment,
        pairs: &ContactPairs,
        to_world: &UnitQuaternion<f64>,
    ) {
        let GuideScratch { solver, load, q, contact, .. } = &mut self.scratch;
        let buffers = &mut contact.reactions.load_buffers;
        if self.rounds > 0 && self.displacement < KEPT_FACTOR_DISPLACEMENT {
            solver.relinearise(&model.rod, load, q);
        } else if !solver.linearise_stiffened(&model.rod, load, &self.forces, q, buffers) {
            self.end_uncoupled(model);
        }
        let n = model.rod.unknowns();
        self.rows.clear();
        self.rows.resize(3 * n * self.sides.len(), 0.0);
        for (&(i, side), rows) in self.sides.iter().zip(self.rows.chunks_exact_mut(3 * n)) {
            let pair = &pairs.contacts[i];
            let axes = pair.axes(to_world).map(|d| if side == 0 { d } else { -d });
            let (k, s) = pairs.position_on_rod(&pair.contact, side);
            let solver = &mut self.scratch.solver;
            let carriers = solver.shape.blend_points(&model.rod, k, s);
            rows_at(solver, k, carriers, &axes, rows);
            let cohesion = pair.cohesion * pairs.hair_share(&pair.contact, side);
            solver.direction.iter_mut().zip(&rows[..n]).for_each(|(d, row)| *d -= cohesion * row);
        }
        let (contact, ContactSolve { solver, scratch, .. }) =
            model.body_contact(env, state, &self.root, &mut self.scratch);
        contact.update_rows(solver, scratch);
        scratch.ties.constrain(n, &mut self.rows);
    }

    /// Moves by the solver's direction, L⁻¹ times all forces, and finds the contacts with bodies there.
    pub fn advance(
        &mut self,
        model: &GuideModel,
        state: &mut GuideState,
        env: &Environment,
        pairs: &ContactPairs,
        to_world: &UnitQuaternion<f64>,
    ) {
        if self.end_state != EndState::Coupled {
            self.needs_round = false;
            return;
        }
        self.collect_forces(model, pairs, to_world);
        let GuideScratch { solver, load, q, contact, .. } = &mut self.scratch;
        let forces = &self.forces;
        let work = |shape: &RodShape| {
            let of_forces = forces.iter().map(|(k, s, f)| f.dot(&shape.curve_point(&model.rod, *k, *s)));
            of_forces.sum::<f64>() + contact.ties.work_of_moments(shape)
        };
        self.displacement = solver.advance_loaded(&model.rod, &self.root.r, load, q, work, MAX_MOVE);
        self.moved += self.displacement;
        self.update_curve(model);
        self.find_body_contacts(model, state, env);
        self.needs_round = self.displacement > CONVERGED_DISPLACEMENT
            || self.provisional && self.residual > RESIDUAL_TOLERANCE;
        self.request_round_if(!self.clears_bodies);
    }

    /// True if it is not expected to come to rest: further rounds would throw it about, or find no motion of it.
    pub fn is_hopeless(&self) -> bool {
        self.needs_round && self.rounds >= HOPELESS_ROUNDS && self.displacement > HOPELESS_DISPLACEMENT
    }

    /// True if it has moved so far that its candidates must be found again, which are then taken to be known.
    pub fn has_left_its_candidates(&mut self) -> bool {
        let far = self.moved > MARGIN;
        self.moved = if far { 0.0 } else { self.moved };
        far
    }

    /// Requests another round if a contact is violated, unless the guide has stalled.
    pub fn request_round_if(&mut self, violated: bool) {
        self.needs_round |= violated && self.displacement > STALLED_DISPLACEMENT;
    }

    fn collect_forces(&mut self, model: &GuideModel, pairs: &ContactPairs, to_world: &UnitQuaternion<f64>) {
        self.forces.clear();
        let on_rod = |of: fn(&ContactPair) -> Vector3<f64>| {
            self.sides.iter().map(move |&(i, side)| {
                let pair = &pairs.contacts[i];
                let share = pairs.hair_share(&pair.contact, side);
                let (k, s) = pairs.position_on_rod(&pair.contact, side);
                (k, s, to_world * of(pair) * if side == 0 { share } else { -share })
            })
        };
        // Cohesion is among the forces that the ties bear without contacts.
        self.scratch.balance_ties(&model.rod, on_rod(|pair| pair.reaction));
        self.forces.extend(self.scratch.contact.world_forces());
        self.forces.extend(on_rod(ContactPair::force));
    }

    /// Updates the curve from the solver's shape.
    fn update_curve(&mut self, model: &GuideModel) {
        let GuideScratch { solver, q, .. } = &self.scratch;
        self.curve.clear();
        self.curve.extend(solver.shape.refined_curve(&model.rod, q).map(|x| x + self.root.p));
    }

    /// Updates shape and curve from the unknowns.
    fn update_end(&mut self, model: &GuideModel) {
        self.scratch.solver.shape.update(&model.rod, &self.root.r, &self.scratch.q);
        self.update_curve(model);
    }

    /// Falls back to the end of the uncoupled step.
    pub fn end_uncoupled(&mut self, model: &GuideModel) {
        self.end_state = EndState::Uncoupled;
        if self.is_coupled {
            self.scratch.q.clone_from(&self.uncoupled_q);
            self.update_end(model);
        }
    }

    /// Halves its motion relative to the head. It ends at rest on the head if the share becomes too small,
    /// the shorter motion crosses a body, or no coupled motion is known; uncoupled if a body prevents that
    /// too.
    pub fn truncate_motion(
        &mut self,
        model: &GuideModel,
        state: &mut GuideState,
        env: &Environment,
        t: [f64; 2],
    ) {
        self.motion_share *= 0.5;
        if self.is_coupled && self.motion_share >= MIN_MOTION_SHARE {
            for (q, start) in self.scratch.q.iter_mut().zip(&state.q[0]) {
                *q = start + 0.5 * (*q - start);
            }
            self.update_end(model);
            self.find_body_contacts(model, state, env);
            if self.clears_bodies {
                return;
            }
        }
        self.motion_share = 0.0;
        self.end_state = EndState::AtRestOnHead;
        if !model.may_rest_on_head(env, state, t, &mut self.scratch) {
            self.end_uncoupled(model);
        }
    }

    /// Ends its coupled sub-step from `t[0]` to `t[1]`, s.
    pub fn close(&self, model: &GuideModel, state: &mut GuideState, t: [f64; 2]) {
        // That of an uncoupled end is known.
        if self.end_state == EndState::Coupled {
            model.record_reaction(state, t[1], self.forces.iter().copied(), &self.scratch);
        }
        model.close(state, &self.root, t[1] - t[0], &self.scratch);
    }

    /// True if its motion cannot be truncated further.
    pub fn is_fully_truncated(&self) -> bool {
        self.motion_share == 0.0
    }

    /// Records how it ends the sub-step in `record`, which holds the record of its uncoupled step; whether it
    /// `loses_contact` with another guide.
    pub fn record(
        &mut self,
        model: &GuideModel,
        state: &mut GuideState,
        env: &Environment,
        loses_contact: bool,
        record: &mut StepRecord,
    ) {
        // The record of an uncoupled end is complete; the body contacts in the scratch are of the rejected
        // motion.
        if self.end_state != EndState::Uncoupled && (self.is_coupled || self.is_fully_truncated()) {
            let (contact, ContactSolve { scratch, .. }) =
                model.body_contact(env, state, &self.root, &mut self.scratch);
            contact.record(scratch);
            scratch.stats.enter(record);
        }
        record.strands.rounds = self.rounds;
        record.strands.residual = self.residual;
        let fails = self.needs_round || self.violates_bodies();
        let unsettled = self.is_coupled && fails && self.end_state == EndState::Coupled;
        record.strands.unsettled = u32::from(unsettled);
        let moves = self.displacement > UNSOLVED_DISPLACEMENT;
        let unsolved = moves || loses_contact || self.violates_bodies();
        record.strands.unsolved = u32::from(unsettled && unsolved);
        record.strands.uncoupled = u32::from(self.end_state == EndState::Uncoupled);
        record.strands.truncated = u32::from(self.motion_share < 1.0);
    }
}
