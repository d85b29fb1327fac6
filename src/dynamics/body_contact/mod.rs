//! Contact of one guide with bodies within one step: detect, solve for reactions, move, repeat
//! (`docs/theory.md` §5).
//!
//! The motion of the bodies is prescribed, so every guide is a problem of its own.

mod detection;
mod impacts;
mod midpoints;
mod problem;
mod reactions;
mod scratch;
mod stats;
mod ties;
mod tolerances;
mod truncate;

use crate::contact::{ContactCache, FrictionTolerance};
use crate::math::cholesky::solve_upper;
use crate::rod::newton::Solver;
pub(super) use problem::{BodyContact, rows_at};
pub(super) use scratch::BodyContactScratch;
pub(super) use tolerances::{GAP_TOLERANCE, MAX_MOVE};
use tolerances::{REACTION_TOLERANCE, SPRING_COMPLIANCE, SPRING_TOLERANCE};

/// Rounds of detection, solve and motion in one step: if it can be halved, and if it can not.
const MAX_ROUNDS: [u32; 2] = [30, 60];

/// Rounds after which contacts stay in the problem, new ones are only added, and the motion must decrease the
/// potential. Contacts that turn, appear or vanish every round may never converge.
const FREEZE_ROUNDS: u32 = 5;

/// Displacement of a point between rounds that counts as converged, m. A rod that ties alone hold steadily is solved as
/// accurately as a free one ([`Solver::tolerated_motion`]).
const MOVE_TOLERANCE: f64 = 5e-6;

/// Share of the rod's length down to which a motion is told from rounding.
const ROUNDED_MOTION: f64 = 1e-12;

/// Ratio of successive displacements above which the next round's limit is halved; below it the limit
/// doubles.
const CONTRACTION: f64 = 0.7;

/// Share of its displacement limit above which a round counts as limited, and so as not converged. A round
/// whose full motion exceeds the limit by up to two fifths may end just below the limit; it would then move
/// on by twice [`MOVE_TOLERANCE`].
const LIMITED_SHARE: f64 = 0.7;

/// Rounds after which a limited motion is followed by an unlimited one, so that a small trust region does not
/// hold a deep point inside a body.
const UNLIMITED_ROUNDS: u32 = 20;

/// Largest residual of the reactions at convergence: after a first converged round, and after a second.
const MAX_RESIDUALS: [f64; 2] = [3e-6, 1e-4];

/// Residual of the reactions above which a step is halved.
const HALVED_RESIDUAL: f64 = 1e-3;

/// Convergence of the rounds of one step.
struct Convergence {
    /// Largest displacement of the last round and of the one before, m.
    moved: f64,
    earlier: f64,
    /// Limit of the displacement of the last round, m.
    limit: f64,
    /// True if the last round converged.
    converged: bool,
}

impl Convergence {
    fn new() -> Self {
        Self { moved: f64::INFINITY, earlier: f64::INFINITY, limit: MAX_MOVE, converged: false }
    }

    /// True if the last round moved less than the tolerance, m, without being limited.
    fn at_rest(&self, tolerance: f64) -> bool {
        self.moved <= tolerance && (self.converged || self.moved <= LIMITED_SHARE * self.limit)
    }

    /// Sets the displacement limit of the frozen round `round`.
    fn update_limit(&mut self, round: u32) {
        let contracts = self.moved < CONTRACTION * self.earlier;
        self.limit = if round >= UNLIMITED_ROUNDS && self.limit < MAX_MOVE {
            MAX_MOVE
        } else if contracts {
            (2.0 * self.limit).min(MAX_MOVE)
        } else {
            // The solution lies between the ends of an oscillation.
            0.5 * self.moved.min(self.limit)
        };
    }
}

impl BodyContact<'_> {
    /// Moves `q`, whose shape the solver holds, out of all bodies. `free` says that `q` solves the step
    /// without contacts, `last` that the step can no longer be halved. Returns `false` if the motion crosses
    /// a surface or comes too near to one, or if it does not converge and the step can be halved.
    pub fn resolve(
        &self,
        free: bool,
        last: bool,
        q: &mut [f64],
        solver: &mut Solver,
        contact_cache: &mut ContactCache,
        scratch: &mut BodyContactScratch,
    ) -> bool {
        let mut state = Convergence::new();
        let rounds = MAX_ROUNDS[usize::from(last)];
        let steady = !self.ties.is_empty() && self.ties.iter().all(|tie| tie.steady);
        let of_ties = Solver::tolerated_motion(self.rod, self.load);
        let of_ties = of_ties.clamp(ROUNDED_MOTION * self.rod.length(), MOVE_TOLERANCE);
        for round in 0..=rounds {
            scratch.detection.frozen = round >= FREEZE_ROUNDS;
            let clear = self.find(solver, contact_cache, scratch);
            let tied = steady && scratch.detection.contacts.is_empty();
            let at_rest = state.at_rest(if tied { of_ties } else { MOVE_TOLERANCE });
            let settled = at_rest || (free && round == 0 && self.ties.is_empty());
            let kept = scratch.detection.worst >= -GAP_TOLERANCE;
            // At rest a contact is as deep as the law has it.
            let lawful = kept || at_rest && scratch.detection.unaccounted >= -GAP_TOLERANCE;
            let bearable = scratch.detection.shortfall <= 0.0;
            // A strand wedged between two surfaces converges without keeping its distance from both.
            let enough = kept || at_rest && bearable;
            let accurate = scratch.stats.residual <= MAX_RESIDUALS[usize::from(state.converged)];
            state.converged = at_rest;
            if round == rounds || (clear && settled && accurate && enough) {
                self.record(scratch);
                let acceptable = (free || settled) && bearable;
                let taken = clear && acceptable && (settled && lawful || self.gains_no_speed(scratch));
                if taken && !settled {
                    scratch.stats.unsettled = true;
                    // The last residual belongs to the start of the round.
                    scratch.stats.residual = self.residual(q, solver, scratch);
                }
                let accurate = scratch.stats.residual <= HALVED_RESIDUAL;
                let accepted = taken && (settled && accurate || last);
                scratch.stats.steady_ties = accepted && steady;
                return accepted;
            }
            scratch.stats.rounds = round + 1;
            if !self.solve_round(free, q, solver, scratch) {
                return false;
            }
            let before = state.moved;
            state.moved = if scratch.detection.frozen {
                state.update_limit(round);
                self.descend(state.limit, solver, q, scratch)
            } else {
                solve_upper(&solver.factor, q.len(), &mut solver.direction);
                solver.advance(self.rod, &self.root.r, q, MAX_MOVE)
            };
            state.earlier = before;
            // From a good start the rounds contract. Without contraction they may lead to another shape.
            if !free && (state.moved >= before.max(MOVE_TOLERANCE) || state.moved >= MAX_MOVE) {
                return false;
            }
        }
        false
    }

    /// Linearises at `q` and solves for the reactions; returns whether the direction is finite.
    fn solve_round(
        &self,
        free: bool,
        q: &[f64],
        solver: &mut Solver,
        scratch: &mut BodyContactScratch,
    ) -> bool {
        let reactions = &mut scratch.reactions;
        // Early reactions on the way from a free motion do not belong to the current shape.
        let turned = self.ties.iter().any(|tie| tie.frame.is_some());
        let early = free && !turned && !scratch.detection.frozen;
        let loads = if early { &[][..] } else { &reactions.contact_loads };
        if !solver.linearise_loaded(self.rod, self.load, loads, q, &mut reactions.load_buffers) {
            return false;
        }
        self.update_rows(solver, scratch);
        self.assemble(scratch);
        // Early contacts still change too much to be worth the path of solutions.
        let tolerance = FrictionTolerance { continuation: !early, ..REACTION_TOLERANCE };
        self.solve_reactions(tolerance, solver, scratch);
        solver.direction.iter().all(|d| d.is_finite())
    }

    /// Pushes `q`, whose shape the solver holds, out of all bodies by springs with friction, in one step of
    /// Newton's method; returns whether any spring acts. The springs are implicit in time: a contact of
    /// compliance c = [`SPRING_COMPLIANCE`] has the displacement u = W r + b under the force r = −u/c, so it
    /// is a rigid contact with c added to W.
    pub fn push_away(
        &self,
        q: &mut [f64],
        solver: &mut Solver,
        contact_cache: &mut ContactCache,
        scratch: &mut BodyContactScratch,
    ) -> bool {
        if !self.find_at_end(solver, contact_cache, scratch) && self.ties.is_empty() {
            return false;
        }
        if !solver.linearise(self.rod, self.load, q) {
            return false;
        }
        scratch.stats.rounds = 1;
        self.update_rows(solver, scratch);
        self.assemble(scratch);
        let problem = &mut scratch.problem;
        let (stride, normals) = (3 * problem.friction.len(), 3 * scratch.detection.contacts.len());
        (0..normals).step_by(3).for_each(|i| problem.delassus[i * stride + i] += SPRING_COMPLIANCE);
        self.solve_reactions(SPRING_TOLERANCE, solver, scratch);
        scratch.reactions.contact_loads.clear();
        if !solver.direction.iter().all(|d| d.is_finite()) {
            return false;
        }
        solve_upper(&solver.factor, q.len(), &mut solver.direction);
        solver.advance(self.rod, &self.root.r, q, MAX_MOVE);
        self.update_polyline(solver, scratch);
        self.record(scratch);
        true
    }
}

#[cfg(test)]
mod tests;
