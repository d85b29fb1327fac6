//! One implicit step of a guide (docs/theory.md §4).

use super::model::{ContactMode, GuideModel};
use super::scratch::{FreeSolve, GuideScratch};
use super::state::GuideState;
use crate::contact::friction::{Interrupt, SystemBudget};
use crate::dynamics::air_drag;
use crate::dynamics::environment::Environment;
use crate::dynamics::integrator::{DifferenceFormula, MAX_BEND};
use crate::dynamics::load::GuideLoad;
use crate::dynamics::reaction::{GuideReaction, TieReaction};
use crate::dynamics::step_record::StepRecord;
use crate::math::se3::Pose;
use crate::rod::potential::PointLoad;
use crate::scene::anim::Scheme;
use nalgebra::Vector3;

/// Times a step is halved before a solve that does not converge is replaced by rigid motion with the root, or
/// a motion that still crosses a surface is truncated. Both are recorded.
pub(in crate::dynamics) const MAX_HALVINGS: u32 = 5;

/// Most halvings of a sub-step with a crossing: a point that moves by 0.2 m in the sub-step then moves by
/// less than its clearance in a part.
pub(in crate::dynamics) const MAX_HALVINGS_AT_CROSSINGS: u32 = 9;

/// Largest motion of a point, m, in a step that starts from the extrapolated state with the last contact
/// loads: beyond it the strand soon meets other surfaces than those it touched.
const MAX_WARM_START: f64 = 0.02;

impl GuideModel {
    /// Advances `state` over `span`, its start and end time, s: one sub-step, halved where the solver needs
    /// it.
    pub fn step(
        &self,
        env: &Environment,
        state: &mut GuideState,
        span: [f64; 2],
        mode: ContactMode,
        scratch: &mut GuideScratch,
    ) -> StepRecord {
        self.step_from(None, env, state, span, mode, scratch)
    }

    /// [`GuideModel::step`] once the motion without contact is known, if it is.
    pub(in crate::dynamics) fn step_from(
        &self,
        free: Option<FreeSolve>,
        env: &Environment,
        state: &mut GuideState,
        span: [f64; 2],
        mode: ContactMode,
        scratch: &mut GuideScratch,
    ) -> StepRecord {
        state.begin_substep();
        self.release_ties(env, state, span[0], &mut scratch.inputs.polyline);
        state.pinched |= self.is_swallowed(env, state, span[1]);
        let coupled = mode == ContactMode::Coupled;
        let interrupt = if coupled { env.interrupt.clone() } else { Interrupt::default() };
        *scratch.contact.budget() = SystemBudget::new(interrupt);
        let mut record = StepRecord::default();
        let depth = if coupled { MAX_HALVINGS } else { 0 };
        self.step_part(free, env, state, span, (mode, depth), scratch, &mut record);
        if !coupled {
            state.stuck = record.truncated > record.halvings;
        }
        state.pinched &= scratch.inputs.pinched;
        state.slides &= state.pinched;
        if state.clearance.counts().1 > 0 && (env.push_out)(span[1]) >= 1.0 {
            let poses = env.body_poses(span[1]);
            state.contact_polyline(self, &mut scratch.inputs.polyline);
            state.pinched |=
                state.clearance.end_push_out(&env.bodies, span[1], &poses, &scratch.inputs.polyline);
        }
        record
    }

    /// Takes a part of a sub-step that was halved `depth` times.
    #[allow(clippy::too_many_arguments)] // A recursion over all of a step's parameters.
    fn step_part(
        &self,
        mut free: Option<FreeSolve>,
        env: &Environment,
        state: &mut GuideState,
        [t0, t1]: [f64; 2],
        (mode, depth): (ContactMode, u32),
        scratch: &mut GuideScratch,
        record: &mut StepRecord,
    ) {
        let spent = state.stuck || scratch.contact.budget().is_exhausted();
        let last = spent || depth >= MAX_HALVINGS;
        // Attempts at the whole leave as much for its halves.
        let kept = if last { 0 } else { scratch.contact.budget().keep_half() };
        let mut formula = self.difference_formula(state, t1 - t0);
        let (mut root, mut outcome, mut clear);
        loop {
            FreeSolve { root, outcome } = match free.take() {
                Some(solved) => solved,
                None => {
                    let root = self.prepare(env, state, [t0, t1], &formula, scratch);
                    let GuideScratch { solver, load, q, .. } = scratch;
                    FreeSolve { root, outcome: solver.minimise(&self.rod, &root.r, load, q, &state.q[0]) }
                }
            };
            record.iterations += outcome.iterations;
            // Nor does a formula look back over more than one step where motion turns within few.
            if outcome.converged && formula.looks_far_back() && self.is_unresolved(state, &root, scratch) {
                formula = DifferenceFormula::new(Scheme::Bdf2, t1 - t0, state.last_steps());
                continue;
            }
            let turned = self.holding_ties(state, t1).any(|(_, tie)| tie.frame.is_some());
            if turned {
                // The motion without ties unwinds what they have wound up.
                scratch.q.clone_from(&state.q[0]);
                outcome.converged = scratch.solver.shape.update(&self.rod, &root.r, &scratch.q);
            }
            if mode == ContactMode::Springs {
                clear = outcome.converged;
                scratch.contact.clear();
                if clear && self.push_out_by_springs(env, state, &root, [t0, t1], scratch) {
                    formula = DifferenceFormula::backward_euler(t1 - t0);
                }
                break;
            }
            if self.solve_from_contact(env, state, &root, [t0, t1], scratch) {
                (clear, outcome.converged) = (true, true);
            } else {
                scratch.contact.clear();
                if turned {
                    scratch.contact.reactions.contact_loads.clone_from(&state.contact_loads);
                }
                clear = outcome.converged
                    && self.resolve_contact(env, state, &root, [t0, t1], (true, last), scratch);
            }
            // A contact stops a motion within one step; a formula that looks further back would throw it
            // back.
            if !(formula.looks_back() && scratch.contact.stats.touched()) {
                break;
            }
            formula = DifferenceFormula::backward_euler(t1 - t0);
        }
        scratch.contact.budget().release(kept);
        let unsolved = outcome.converged && !clear && mode != ContactMode::Springs;
        if unsolved && self.gives_way(env, state, [t0, t1], scratch) {
            return self.step_part(None, env, state, [t0, t1], (mode, depth), scratch, record);
        }
        let coupled = mode == ContactMode::Coupled;
        let crosses = scratch.contact.stats.crossed;
        let max_halvings = if crosses { MAX_HALVINGS_AT_CROSSINGS } else { MAX_HALVINGS };
        let whole = clear || coupled || depth >= max_halvings || spent && outcome.converged;
        if !whole {
            record.halvings += 1;
            let middle = 0.5 * (t0 + t1);
            let kept = scratch.contact.budget().keep_half();
            self.step_part(None, env, state, [t0, middle], (mode, depth + 1), scratch, record);
            scratch.contact.budget().release(kept);
            self.step_part(None, env, state, [middle, t1], (mode, depth + 1), scratch, record);
            return;
        }
        record.unconverged += u32::from(!outcome.converged);
        record.truncated += u32::from(outcome.converged && !clear);
        scratch.contact.stats.enter(record);
        if outcome.converged {
            self.record_reaction(state, t1, scratch.contact.world_forces(), scratch);
            let unresolved = self.is_unresolved(state, &root, scratch);
            state.commit(&root, t1 - t0, &formula, (&scratch.q, &scratch.solver.shape));
            state.contact_loads.clear();
            if clear {
                state.contact_loads.extend_from_slice(&scratch.contact.reactions.contact_loads);
            }
            if scratch.contact.stats.touched() {
                state.restart_scheme();
            } else if unresolved {
                state.shorten_history();
            }
        } else {
            state.carry_rigidly(&self.root(env, t0), &root);
        }
    }

    /// Whether the rod moves so differently in the solved step, which ends with the root at `root`, than in the
    /// last that no formula may look back over both and further ([`MAX_BEND`]).
    fn is_unresolved(&self, state: &GuideState, root: &Pose, scratch: &GuideScratch) -> bool {
        state.second_difference(root, &scratch.solver.shape) > MAX_BEND * self.rod.length()
    }

    /// Lets a guide whose step from `t[0]` to `t[1]`, s, is unsolved give way, if bodies leave no room for a
    /// solution: first to the distances that they leave, then without friction on them. Returns whether it does.
    fn gives_way(
        &self,
        env: &Environment,
        state: &mut GuideState,
        t: [f64; 2],
        scratch: &mut GuideScratch,
    ) -> bool {
        if state.pinched {
            return !std::mem::replace(&mut state.slides, true);
        }
        state.pinched = true;
        self.prepare_contact(env, state, t, &mut scratch.inputs);
        state.pinched = scratch.inputs.pinched;
        state.pinched
    }

    /// Solves the step of a strand in contact from the extrapolated state with the last contact loads;
    /// `false` if that fails. The motion without contact would pass through what holds the strand, and away
    /// from its shape where it is bent hard against it.
    fn solve_from_contact(
        &self,
        env: &Environment,
        state: &mut GuideState,
        root: &Pose,
        t: [f64; 2],
        scratch: &mut GuideScratch,
    ) -> bool {
        if state.contact_loads.is_empty() {
            return false;
        }
        scratch.free_q.clone_from(&scratch.q);
        state.extrapolate(t[1] - t[0], &mut scratch.q);
        if !scratch.solver.shape.update(&self.rod, &root.r, &scratch.q) {
            scratch.q.clone_from(&state.q[0]);
            scratch.solver.shape.update(&self.rod, &root.r, &scratch.q);
        }
        let far =
            |(k, x): (usize, &Vector3<f64>)| (scratch.solver.shape.x(k) + root.p - x).norm() > MAX_WARM_START;
        scratch.contact.clear();
        scratch.contact.reactions.contact_loads.clone_from(&state.contact_loads);
        if !state.x.iter().enumerate().any(far)
            && self.resolve_contact(env, state, root, t, (false, false), scratch)
        {
            return true;
        }
        scratch.q.clone_from(&scratch.free_q);
        scratch.solver.shape.update(&self.rod, &root.r, &scratch.q);
        false
    }

    /// Records, if asked to, what the clamp and the ties exert at the end `t`, s, of the prepared step, whose
    /// shape the solver holds: what balances all loads, inertia included (`docs/theory.md` eq. 4.7). `forces`
    /// are those of bodies, ties and other guides: segment, fraction of it, force, N, world.
    pub(in crate::dynamics) fn record_reaction(
        &self,
        state: &mut GuideState,
        t: f64,
        forces: impl Iterator<Item = (usize, f64, Vector3<f64>)>,
        scratch: &GuideScratch,
    ) {
        if !self.records_reaction {
            return;
        }
        let GuideScratch { solver, load, contact, .. } = scratch;
        let [force, moment] = load.resultant(&solver.shape);
        let mut reaction =
            GuideReaction { force: -force, moment: -moment, ..GuideReaction::none(self.ties.len()) };
        for (k, s, force) in forces {
            reaction.force -= force;
            reaction.moment -= solver.shape.curve_point(&self.rod, k, s).cross(&force);
        }
        let held = contact.ties.world_forces().zip(contact.ties.world_moments(&solver.shape));
        for ((tie, _), ((_, _, force), moment)) in self.holding_ties(state, t).zip(held) {
            reaction.moment -= moment;
            reaction.ties[tie] = TieReaction { force, moment };
        }
        if self.rod.is_free() {
            // What is left is what the solve is off by.
            (reaction.force, reaction.moment) = (Vector3::zeros(), Vector3::zeros());
        }
        state.transient.reaction = Some(reaction);
    }

    /// What the clamp and the ties exert on the guide at the end of the last step, if that is recorded; zero if
    /// it is not stepped, or its step had no solution.
    pub fn reaction(&self, state: &GuideState) -> Option<GuideReaction> {
        let known = || state.transient.reaction.clone();
        self.records_reaction.then(|| known().unwrap_or_else(|| GuideReaction::none(self.ties.len())))
    }

    /// The difference formula of the next step, of `h`, s.
    pub(in crate::dynamics) fn difference_formula(&self, state: &GuideState, h: f64) -> DifferenceFormula {
        DifferenceFormula::new(self.scheme, h, state.last_steps())
    }

    /// Fills the load of a step and the unknowns to start its solve from; returns the root's pose at its end.
    pub(in crate::dynamics) fn prepare(
        &self,
        env: &Environment,
        state: &GuideState,
        [t0, t1]: [f64; 2],
        formula: &DifferenceFormula,
        scratch: &mut GuideScratch,
    ) -> Pose {
        let root = self.root(env, t1);
        let GuideScratch { load, q_star, .. } = scratch;
        let points = (0..state.x.len()).map(|k| {
            let (inertial, previous, tangent) = state.formula_values(k, formula, &root.p);
            let air = air_drag::velocity(env.wind, &state.x[k], t1);
            PointLoad { inertial, previous, air, tangent, drag: self.drag[k] }
        });
        q_star.clear();
        q_star.extend(state.q_star(formula));
        load.set(&self.rod, formula.eta, &(env.gravity)(t1), q_star, points);
        state.extrapolate(t1 - t0, &mut scratch.q);
        let pulled = self.pull_to_goal(env, state, [t0, t1], formula, &root, scratch);
        let GuideScratch { load, goal, .. } = scratch;
        for (k, spring) in self.goal.iter().enumerate() {
            // What follows an animated goal does not follow the groom's pose.
            let stiffness =
                if pulled { spring.stiffness * (1.0 - goal.weights[k]) } else { spring.stiffness };
            load.add_spring(k, &(root.r * spring.anchor), stiffness);
        }
        state.transient.hair_force.iter().enumerate().for_each(|(k, f)| load.add_force(k, f));
        self.add_loads(state, t1, formula, &root, scratch);
        root
    }

    /// Adds the forces and moments on the guide to the load of a step that ends at time `t`, s, with the root at
    /// `root`. Where they turn with the rod, it is as the last states let expect it at the end; with backward Euler,
    /// which takes steps over which nothing can be expected, as at the start, carried by the root.
    fn add_loads(
        &self,
        state: &GuideState,
        t: f64,
        formula: &DifferenceFormula,
        root: &Pose,
        scratch: &mut GuideScratch,
    ) {
        let GuideScratch { solver, load, q, .. } = scratch;
        if self.loads.iter().any(GuideLoad::needs_frames)
            && !(formula.looks_back() && solver.shape.update(&self.rod, &root.r, q))
        {
            solver.shape.update(&self.rod, &root.r, &state.q[0]);
        }
        self.loads.iter().for_each(|of| of.add(t, &solver.shape, load));
    }

    /// Returns to the start of the sub-step from `t[0]` to `t[1]`, s, that was just taken whole, and reopens
    /// it as one step of backward Euler; `scratch` then holds the end that the step had. Returns the root's
    /// pose there.
    pub(in crate::dynamics) fn reopen(
        &self,
        env: &Environment,
        state: &mut GuideState,
        t: [f64; 2],
        scratch: &mut GuideScratch,
    ) -> Pose {
        state.swap_with_previous();
        let formula = DifferenceFormula::backward_euler(t[1] - t[0]);
        let root = self.prepare(env, state, t, &formula, scratch);
        scratch.q.clone_from(state.previous_q());
        scratch.solver.shape.update(&self.rod, &root.r, &scratch.q);
        scratch.contact.clear();
        self.prepare_contact(env, state, t, &mut scratch.inputs);
        root
    }

    /// Ends a reopened sub-step of `h`, s.
    pub(in crate::dynamics) fn close(
        &self,
        state: &mut GuideState,
        root: &Pose,
        h: f64,
        scratch: &GuideScratch,
    ) {
        let formula = DifferenceFormula::backward_euler(h);
        state.commit(root, h, &formula, (&scratch.q, &scratch.solver.shape));
        // Loads of bodies alone are no start among other guides.
        state.contact_loads.clear();
        state.restart_scheme();
    }
}
