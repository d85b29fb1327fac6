//! Reactions of contacts and ties: warm start, solve, and the motion they cause.

use super::problem::BodyContact;
use super::scratch::{BodyContactScratch, ContactRows};
use super::tolerances::{SAME_NORMAL, SLIDING_TOLERANCE};
use crate::contact::{FrictionProblem, FrictionTolerance, friction};
use crate::dynamics::tie::Tie;
use crate::rod::RodShape;
use crate::rod::contact_load::ContactLoad;
use crate::rod::newton::Solver;
use nalgebra::Vector3;

fn friction_problem(problem: &ContactRows) -> FrictionProblem<'_> {
    FrictionProblem { w: &problem.delassus, b: &problem.free_displacement, laws: &problem.laws }
}

impl BodyContact<'_> {
    /// Starts the reactions of the current contacts and ties from the last contact loads, then computes the
    /// Delassus matrix.
    pub(super) fn assemble(&self, scratch: &mut BodyContactScratch) {
        self.warm_start(scratch);
        self.assemble_delassus(scratch);
    }

    fn warm_start(&self, scratch: &mut BodyContactScratch) {
        let reactions = &mut scratch.reactions;
        reactions.forces.clear();
        for (i, frame) in scratch.problem.frames.iter().enumerate() {
            let contact = scratch.detection.contacts.get(i);
            let normal = contact.map_or_else(Vector3::zeros, |c| c.normal);
            let same = |p: &&ContactLoad| {
                p.segment == frame.segment && (p.normal == normal || p.normal.dot(&normal) > SAME_NORMAL)
            };
            let far = |p: &ContactLoad| (p.u - frame.u).abs();
            let loads = reactions.contact_loads.iter().filter(same);
            let warm = loads.min_by(|a, b| far(a).total_cmp(&far(b)));
            let start = warm.map_or([0.0; 3], |p| frame.axes.map(|d| d.dot(&p.force) / d.norm_squared()));
            reactions.forces.extend(start);
        }
    }

    /// Relative residual of the last reactions for the contacts at `q`; the solver holds the shape at `q`.
    pub(super) fn residual(&self, q: &[f64], solver: &mut Solver, scratch: &mut BodyContactScratch) -> f64 {
        if !solver.linearise(self.rod, self.load, q) {
            return f64::INFINITY;
        }
        self.update_rows(solver, scratch);
        self.assemble(scratch);
        friction_problem(&scratch.problem).residual(&scratch.reactions.forces)
    }

    /// Solves for the reactions and adds L⁻¹ times them to the solver's direction.
    pub(super) fn solve_reactions(
        &self,
        tolerance: FrictionTolerance,
        solver: &mut Solver,
        scratch: &mut BodyContactScratch,
    ) {
        let n = self.rod.unknowns();
        let (problem, reactions) = (&scratch.problem, &mut scratch.reactions);
        let outcome = friction::solve(
            &friction_problem(problem),
            tolerance,
            &mut reactions.forces,
            &mut reactions.friction,
        );
        scratch.stats.residual = outcome.residual;
        for (row, r) in problem.rows.chunks_exact(n).zip(&reactions.forces) {
            if *r != 0.0 {
                for (d, a) in solver.direction.iter_mut().zip(row) {
                    *d += a * r;
                }
            }
        }
        self.update_contact_loads(scratch);
    }

    fn update_contact_loads(&self, scratch: &mut BodyContactScratch) {
        let (reactions, contacts) = (&mut scratch.reactions, &scratch.detection.contacts);
        reactions.contact_loads.clear();
        let forces = reactions.forces.chunks_exact(3);
        for (i, (frame, r)) in scratch.problem.frames.iter().zip(forces).enumerate() {
            let [n, t1, t2] = frame.axes;
            let force = n * r[0] + t1 * r[1] + t2 * r[2];
            let (normal, sticks) = match contacts.get(i) {
                Some(contact) => {
                    let most = self.friction_at(contact).mu_k * r[0];
                    (contact.normal, (r[1].hypot(r[2]) / most - 1.0).abs() > SLIDING_TOLERANCE)
                }
                None => (Vector3::zeros(), true),
            };
            if i >= contacts.len() || r[0] > 0.0 {
                let (segment, u) = (frame.segment, frame.u);
                reactions.contact_loads.push(ContactLoad { segment, u, force, normal, sticks });
            }
        }
    }

    /// Moves `q` under the last reactions, held constant, as far as the potential decreases and no point
    /// moves by more than about `most`, m. Returns the largest displacement, m.
    pub(super) fn descend(
        &self,
        most: f64,
        solver: &mut Solver,
        q: &mut [f64],
        scratch: &BodyContactScratch,
    ) -> f64 {
        let external_work = |shape: &RodShape| {
            let mut sum = 0.0;
            for (k, s, force) in scratch.world_forces() {
                sum += force.dot(&shape.curve_point(self.rod, k, s));
            }
            sum
        };
        solver.advance_loaded(self.rod, &self.root.r, self.load, q, external_work, most)
    }

    /// Records the statistics of the contacts and ties at the current end of the step.
    pub fn record(&self, scratch: &mut BodyContactScratch) {
        let detection = &scratch.detection;
        let forces = &scratch.reactions.forces;
        let contacts = (forces.len() / 3).saturating_sub(self.ties.len());
        let slack = |(tie, target): &(Tie, Vector3<f64>)| (tie.place(&detection.x1) - target).norm();
        let slack = self.ties.iter().map(slack).fold(0.0, f64::max);
        let line = self.line(&detection.x1);
        scratch.stats.measure(&line, &detection.found, &forces[..3 * contacts], slack);
    }
}
