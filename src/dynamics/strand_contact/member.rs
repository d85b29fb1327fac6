//! A guide that is solved together with others.

use super::contact_pairs::ContactPairs;
use super::island::SOUND;
use crate::dynamics::body_contact::{MAX_MOVE, rows_at};
use crate::dynamics::environment::Environment;
use crate::dynamics::guide::{ContactSolve, GuideModel, GuideScratch, GuideState};
use crate::dynamics::step_record::StepRecord;
use crate::math::se3::Pose;
use crate::rod::RodShape;
use nalgebra::{Matrix3, UnitQuaternion, Vector3};

/// Motion of a point in a round after which it has settled, m: the next round would move it by about the square of this over the
/// radius of a bend, some micrometres.
const SETTLED: f64 = 3e-4;

/// Motion of a point between rounds that is as good as none, m: who is not well then will not be.
const MOVE_TOLERANCE: f64 = 5e-6;

/// Least share of its way that a guide goes whose way is cut short.
const LEAST_SHARE: f64 = 0.25;

/// How a guide ends a sub-step.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Resort {
    /// Where the reactions take it.
    CoupledSubstep,
    /// Where it goes if nothing but bodies is there.
    Alone,
    /// Where the head carries it.
    Still,
}

/// A guide as a part of a sub-step that is solved for many together.
#[derive(Debug)]
pub(super) struct Member {
    /// Whether it has solved the sub-step alone. Only what has can be solved with others.
    pub whole: bool,
    /// Whether it takes part.
    pub open: bool,
    /// Whether it needs another round.
    pub stirred: bool,
    /// Whether its motion crosses no body, and its end is no nearer to one than it may be.
    is_well: bool,
    /// By how much the end of its own step is nearer, m.
    lacking: f64,
    /// How it ends.
    pub resort: Resort,
    /// Share of its way that it goes.
    share: f64,
    /// Rounds that it took part in, and the residual of the last.
    pub rounds: u32,
    pub residual: f64,
    /// Motion of its points in the last round, at most, m.
    pub moved: f64,
    /// Unknowns at the end of its own step.
    alone: Vec<f64>,
    /// Root at the end of the step, world.
    pub root: Pose,
    /// Its system and its contacts with bodies.
    pub scratch: GuideScratch,
    /// Its part in the places: (place, which of the two sides), ascending.
    pub parts: Vec<(usize, usize)>,
    /// L⁻¹Jᵀ of `parts`: three rows each.
    pub rows: Vec<f64>,
    /// The curve of its end, world.
    pub curve: Vec<Vector3<f64>>,
    /// What pushes its rod: sub-step, fraction of it, force, N, world.
    forces: Vec<(usize, f64, Vector3<f64>)>,
}

impl Member {
    pub fn new() -> Self {
        Member {
            whole: true,
            open: false,
            stirred: false,
            is_well: true,
            lacking: 0.0,
            resort: Resort::CoupledSubstep,
            share: 1.0,
            rounds: 0,
            residual: 0.0,
            moved: 0.0,
            alone: Vec::new(),
            root: Pose { r: Matrix3::identity(), p: Vector3::zeros() },
            scratch: GuideScratch::default(),
            parts: Vec::new(),
            rows: Vec::new(),
            curve: Vec::new(),
            forces: Vec::new(),
        }
    }

    /// Begins a sub-step, of which `record` tells how the guide has taken it alone.
    pub fn begin(&mut self, record: &StepRecord) {
        self.whole = record.unconverged == 0;
        self.open = false;
        self.stirred = false;
        (self.rounds, self.residual, self.moved) = (0, 0.0, f64::INFINITY);
        self.resort = Resort::CoupledSubstep;
        self.share = 1.0;
    }

    /// Takes part in the sub-step from `t[0]` to `t[1]`, s, that the guide has just taken alone.
    pub fn open(&mut self, model: &GuideModel, state: &mut GuideState, env: &Environment, t: [f64; 2]) {
        self.root = model.reopen(env, state, t, &mut self.scratch);
        self.alone.clone_from(&self.scratch.q);
        self.trace(model);
        self.open = true;
        self.stirred = true;
        self.lacking = 0.0;
        self.meet_bodies(model, state, env);
        if !self.is_well {
            // Nothing is gained by going back there.
            self.lacking = self.scratch.contact.detection.shortfall;
        }
    }

    /// Finds the contacts with bodies at the end as it is now.
    pub fn meet_bodies(&mut self, model: &GuideModel, state: &mut GuideState, env: &Environment) {
        let (contact, ContactSolve { solver, memory, scratch, .. }) =
            model.body_contact(env, state, &self.root, &mut self.scratch);
        let clear = contact.find(solver, memory, scratch);
        self.scratch.contact.detection.frozen = true;
        self.is_well = clear && self.scratch.contact.detection.shortfall <= self.lacking;
    }

    /// Whether it ends where no step of it alone may.
    pub fn is_lost(&self) -> bool {
        self.open && !self.is_well
    }

    /// The system at the end as it is now, with the rows of all contacts; normals are turned by `to_world`. One that cannot be
    /// factored, for it holds numbers that are not finite, goes alone.
    pub fn linearise(
        &mut self,
        model: &GuideModel,
        state: &mut GuideState,
        env: &Environment,
        places: &ContactPairs,
        to_world: &UnitQuaternion<f64>,
    ) {
        if !self.scratch.solver.linearise(&model.rod, &self.scratch.load, &self.scratch.q) {
            self.go_alone(model);
        }
        let n = model.rod.unknowns();
        self.rows.clear();
        self.rows.resize(3 * n * self.parts.len(), 0.0);
        for (&(i, side), rows) in self.parts.iter().zip(self.rows.chunks_exact_mut(3 * n)) {
            let place = &places.found[i];
            let axes = place.axes(to_world).map(|d| if side == 0 { d } else { -d });
            let (k, s) = places.on_rod(&place.contact, side);
            let solver = &mut self.scratch.solver;
            let carriers = solver.shape.blend_points(&model.rod, k, s);
            rows_at(solver, k, carriers, &axes, rows);
            let cling = place.cling * places.per_hair(&place.contact, side);
            solver.direction.iter_mut().zip(&rows[..n]).for_each(|(d, row)| *d -= cling * row);
        }
        let (contact, ContactSolve { solver, scratch, .. }) =
            model.body_contact(env, state, &self.root, &mut self.scratch);
        contact.update_rows(solver, scratch);
    }

    /// Moves as the reactions ask, of which the solver's direction holds L⁻¹ times all forces, and looks at the bodies.
    pub fn advance(
        &mut self,
        model: &GuideModel,
        state: &mut GuideState,
        env: &Environment,
        places: &ContactPairs,
        to_world: &UnitQuaternion<f64>,
    ) {
        if self.resort != Resort::CoupledSubstep {
            self.stirred = false;
            return;
        }
        self.gather_forces(places, to_world);
        let GuideScratch { solver, load, q, .. } = &mut self.scratch;
        let forces = &self.forces;
        let work = |shape: &RodShape| {
            forces.iter().map(|(k, s, f)| f.dot(&shape.curve_point(&model.rod, *k, *s))).sum::<f64>()
        };
        self.moved = solver.advance_loaded(&model.rod, &self.root.r, load, q, work, MAX_MOVE);
        self.trace(model);
        self.meet_bodies(model, state, env);
        self.stirred = self.moved > SETTLED || self.rounds == 1 && self.residual > SOUND;
        self.stir(!self.is_well);
    }

    /// Asks for another round if something is not well, unless the last one was of no use.
    pub fn stir(&mut self, unwell: bool) {
        self.stirred |= unwell && self.moved > MOVE_TOLERANCE;
    }

    fn gather_forces(&mut self, places: &ContactPairs, to_world: &UnitQuaternion<f64>) {
        self.forces.clear();
        self.forces.extend(self.scratch.contact.world_forces());
        for &(i, side) in &self.parts {
            let place = &places.found[i];
            let share = places.per_hair(&place.contact, side);
            let force = to_world * place.force() * if side == 0 { share } else { -share };
            let (k, s) = places.on_rod(&place.contact, side);
            self.forces.push((k, s, force));
        }
    }

    /// Takes over the curve of the end as it is now.
    fn trace(&mut self, model: &GuideModel) {
        let GuideScratch { solver, q, .. } = &self.scratch;
        self.curve.clear();
        self.curve.extend(solver.shape.refined_curve(&model.rod, q).map(|x| x + self.root.p));
    }

    /// Makes the unknowns as they are now its end.
    fn end_there(&mut self, model: &GuideModel) {
        self.scratch.solver.shape.update(&model.rod, &self.root.r, &self.scratch.q);
        self.trace(model);
    }

    /// Ends the sub-step as if no other guide were there.
    pub fn go_alone(&mut self, model: &GuideModel) {
        self.resort = Resort::Alone;
        if self.open {
            self.scratch.q.clone_from(&self.alone);
            self.end_there(model);
        }
    }

    /// Goes half of the way on the head that it went so far; none where that would be too little, takes it through a body, or is not known.
    pub fn cut_short(&mut self, model: &GuideModel, state: &mut GuideState, env: &Environment, t: [f64; 2]) {
        self.share *= 0.5;
        if self.open && self.share >= LEAST_SHARE {
            for (q, start) in self.scratch.q.iter_mut().zip(&state.q[0]) {
                *q = start + 0.5 * (*q - start);
            }
            self.end_there(model);
            self.meet_bodies(model, state, env);
            if self.is_well {
                return;
            }
        }
        self.share = 0.0;
        self.resort = Resort::Still;
        if !model.may_rest_on_head(env, state, t, &mut self.scratch) {
            self.go_alone(model);
        }
    }

    /// Whether it does not move on the head any more, or would, but for a body.
    pub fn has_yielded(&self) -> bool {
        self.share == 0.0
    }

    /// Enters in `record`, which tells how the guide took the sub-step alone, how it ends it.
    pub fn note(
        &mut self,
        model: &GuideModel,
        state: &mut GuideState,
        env: &Environment,
        record: &mut StepRecord,
    ) {
        // What goes alone does as its record tells already; what its contacts hold is of the way that was given up.
        if self.resort != Resort::Alone && (self.open || self.has_yielded()) {
            let (contact, ContactSolve { scratch, .. }) =
                model.body_contact(env, state, &self.root, &mut self.scratch);
            contact.record(scratch);
            scratch.stats.enter(record);
        }
        record.strands.rounds = self.rounds;
        record.strands.residual = self.residual;
        let unsettled = self.open && self.stirred && self.resort == Resort::CoupledSubstep;
        record.strands.unsettled = u32::from(unsettled);
        record.strands.uncoupled = u32::from(self.resort == Resort::Alone);
        record.strands.truncated = u32::from(self.share < 1.0);
    }
}
