//! Reactions of contacts: warm start, solve, and the motion that they and the ties cause.

use super::problem::BodyContact;
use super::scratch::{BodyContactScratch, ContactRows};
use super::tolerances::{SAME_NORMAL, SLIDING_TOLERANCE};
use crate::contact::{FrictionProblem, FrictionTolerance, friction};
use crate::rod::RodShape;
use crate::rod::contact_load::ContactLoad;
use crate::rod::newton::Solver;

fn friction_problem(problem: &ContactRows) -> FrictionProblem<'_> {
    FrictionProblem { w: &problem.delassus, b: &problem.free_displacement, friction: &problem.friction }
}

impl BodyContact<'_> {
    /// Starts the reactions of the current contacts from the last contact loads, then computes the
    /// Delassus matrix.
    pub(super) fn assemble(&self, scratch: &mut BodyContactScratch) {
        self.warm_start(scratch);
        self.assemble_delassus(scratch);
    }

    fn warm_start(&self, scratch: &mut BodyContactScratch) {
        let reactions = &mut scratch.reactions;
        reactions.forces.clear();
        for (frame, contact) in scratch.problem.frames.iter().zip(&scratch.detection.contacts) {
            let normal = contact.normal;
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
        scratch.balance_ties(self.ties, self.rod, solver, std::iter::empty());
        self.update_contact_loads(scratch);
    }

    fn update_contact_loads(&self, scratch: &mut BodyContactScratch) {
        let (reactions, contacts) = (&mut scratch.reactions, &scratch.detection.contacts);
        reactions.contact_loads.clear();
        let forces = reactions.forces.chunks_exact(3);
        for ((frame, contact), r) in scratch.problem.frames.iter().zip(contacts).zip(forces) {
            if r[0] > 0.0 {
                let most = self.friction_at(contact).mu_k * r[0];
                reactions.contact_loads.push(ContactLoad {
                    segment: frame.segment,
                    u: frame.u,
                    force: frame.world(r),
                    normal: contact.normal,
                    sticks: (r[1].hypot(r[2]) / most - 1.0).abs() > SLIDING_TOLERANCE,
                    slides_along: None,
                    moment: None,
                });
            }
        }
        reactions.contact_loads.extend_from_slice(&scratch.ties.loads);
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
            sum + scratch.ties.work_of_moments(shape)
        };
        solver.advance_loaded(self.rod, &self.root.r, self.load, q, external_work, most)
    }

    /// Records the statistics of the contacts and ties at the current end of the step.
    pub fn record(&self, scratch: &mut BodyContactScratch) {
        let detection = &scratch.detection;
        let forces = &scratch.reactions.forces;
        let slacks = self.ties.iter().map(|tie| tie.slack(&detection.x1));
        let slack = slacks.fold(0.0, f64::max);
        let line = self.line(&detection.x1);
        scratch.stats.measure(&line, &detection.found, forces, slack);
    }
}
