//! A sub-step with contact between guides: taken by all active guides at once. Guides that fail take it again
//! in halves, with those that they touch (`docs/theory.md` §5.2).

use super::batch::Batches;
use super::checkpoint::Checkpoint;
use super::environment::Environment;
use super::guide::{
    ContactMode, GuideModel, GuideScratch, GuideState, MAX_HALVINGS, MAX_HALVINGS_AT_CROSSINGS,
};
use super::guide_frame::SolverStep;
use super::step_record::StepRecord;
use super::strand_contact::StrandContacts;
use rayon::prelude::*;

/// The guides of a simulation in one sub-step.
pub(super) struct CoupledSubstep<'a> {
    pub models: &'a [GuideModel],
    pub states: &'a mut [GuideState],
    pub strand_contacts: &'a mut StrandContacts,
    pub batches: &'a Batches,
    pub env: &'a Environment<'a>,
    /// The configurations that guides reach, in ascending order of time, if they are kept.
    pub path: Option<&'a mut Vec<SolverStep>>,
}

/// A sub-step was abandoned, and nothing of it is left.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Interrupted;

/// Guides and their contacts with each other at some time.
struct Snapshot {
    /// The guides, ascending, with their states.
    guides: Vec<(usize, GuideState)>,
    strand_contacts: <StrandContacts as Checkpoint>::State,
    /// Length of the path.
    path: usize,
}

impl CoupledSubstep<'_> {
    /// Takes the sub-step over `span`, its start and end, s; `records` has an entry for each guide. Followers
    /// are not changed.
    ///
    /// # Errors
    /// [`Interrupted`] if the environment asked to abandon it; the guides are then at its start again, and their
    /// records say nothing.
    pub fn step(&mut self, span: [f64; 2], records: &mut [StepRecord]) -> Result<(), Interrupted> {
        let mut failures = vec![0; self.states.len()];
        let start = self.snapshot();
        self.take_part(&start, (span, 0), records, &mut failures);
        // What ended early is of no use, wherever it was.
        if self.env.interrupt.was_seen() {
            self.restore(&start, |_| true);
            return Err(Interrupted);
        }
        for &g in self.strand_contacts.active() {
            self.states[g].stuck = failures[g] > records[g].halvings;
        }
        Ok(())
    }

    /// Takes a part of a sub-step that was halved `depth` times, for all guides whose motion is not given and which are
    /// as in `start`; divides it for some of them if that may avoid a failure. Counts in `failures` the accepted parts
    /// in which each guide fails. Returns the guides with a given motion that others pushed or crossed: if there are
    /// any, all of them must take the part together. Ends early once the sub-step is to be abandoned.
    fn take_part(
        &mut self,
        start: &Snapshot,
        (span, depth): ([f64; 2], u32),
        records: &mut [StepRecord],
        failures: &mut [u32],
    ) -> Vec<usize> {
        self.step_guides(span, records);
        let step = (span, depth < MAX_HALVINGS);
        self.strand_contacts.resolve(self.models, self.states, self.env, step, records);
        if self.env.interrupt.was_seen() {
            return Vec::new();
        }
        let divides = |record: &StepRecord| match depth {
            0..MAX_HALVINGS => record.failed(),
            MAX_HALVINGS..MAX_HALVINGS_AT_CROSSINGS => record.crosses(),
            _ => false,
        };
        let failing: Vec<usize> =
            self.strand_contacts.free().filter(|&g| !self.states[g].stuck && divides(&records[g])).collect();
        if !failing.is_empty() {
            return self.divide(span, depth, start, failing, records, failures);
        }
        let touched = self.strand_contacts.touched_given(|_| true);
        if !touched.is_empty() {
            return touched;
        }
        for g in self.strand_contacts.free() {
            failures[g] += u32::from(records[g].failed());
        }
        self.observe(span[1]);
        touched
    }

    /// Takes a part again in two halves, for the guides `failing`, those that they touch or nearly touch, and those
    /// that they come to touch on the way; all others move as they have done. Returns and ends as
    /// [`CoupledSubstep::take_part`].
    fn divide(
        &mut self,
        span: [f64; 2],
        depth: u32,
        start: &Snapshot,
        failing: Vec<usize>,
        records: &mut [StepRecord],
        failures: &mut [u32],
    ) -> Vec<usize> {
        let mut links = self.strand_contacts.links();
        let motion = self.strand_contacts.motion(self.states, span);
        let end = self.strand_contacts.state();
        let mut group = links.group(failing);
        // What the group touches it may not touch in parts.
        let touched = self.strand_contacts.touched_given(|g| group.binary_search(&g).is_err());
        if !touched.is_empty() {
            return touched;
        }
        loop {
            let others = || start.guides.iter().map(|(g, _)| *g).filter(|g| group.binary_search(g).is_err());
            others().for_each(|g| self.strand_contacts.give(g, &motion));
            self.restore(start, |g| group.binary_search(&g).is_ok());
            let middle = 0.5 * (span[0] + span[1]);
            let mut counts = failures.to_vec();
            let mut touched = Vec::new();
            let halves = [[span[0], middle], [middle, span[1]]].map(|span| {
                let mut records = vec![StepRecord::default(); records.len()];
                if touched.is_empty() {
                    let start = self.snapshot();
                    touched = self.take_part(&start, (span, depth + 1), &mut records, &mut counts);
                }
                records
            });
            others().for_each(|g| self.strand_contacts.free_again(g));
            if !touched.is_empty() {
                let is_here = |g: &usize| start.guides.binary_search_by_key(g, |(g, _)| *g).is_ok();
                if !touched.iter().all(is_here) {
                    return touched;
                }
                group.extend(links.group(touched));
                group.sort_unstable();
                group.dedup();
                continue;
            }
            self.strand_contacts.keep_contacts_of_others(end, &group);
            // What failed as often before is not a reason to divide, and keeps its whole part.
            others().for_each(|g| counts[g] += u32::from(records[g].failed()));
            failures.copy_from_slice(&counts);
            for &g in &group {
                records[g] = halves[0][g].then(&halves[1][g]);
            }
            // The history of the next sub-step is that of one whole sub-step.
            for (g, state) in start.guides.iter().filter(|(g, _)| group.binary_search(g).is_ok()) {
                self.states[*g].q[1].clone_from(&state.q[0]);
                self.states[*g].q[2].clone_from(&state.q[1]);
            }
            self.observe(span[1]);
            return touched;
        }
    }

    /// Steps the guides whose motion is not given, in contact with bodies alone.
    fn step_guides(&mut self, span: [f64; 2], records: &mut [StepRecord]) {
        let (models, env, mode) = (self.models, self.env, ContactMode::Coupled);
        if self.strand_contacts.all_are_free() {
            self.batches.step(models, env, self.states, span, mode, records);
            return;
        }
        let mut is_free = vec![false; models.len()];
        self.strand_contacts.free().for_each(|g| is_free[g] = true);
        let all = self.states.par_iter_mut().zip(models).zip(records).zip(is_free);
        let goes_on = |is_free: bool| is_free && !env.interrupt.is_asked_for();
        all.filter(|(_, is_free)| goes_on(*is_free)).for_each_init(
            GuideScratch::default,
            |scratch, (((state, model), record), _)| {
                *record = model.step(env, state, span, mode, scratch);
            },
        );
    }

    /// Adds the configuration at time `t`, s, that the guides whose motion is not given have reached.
    fn observe(&mut self, t: f64) {
        let Some(path) = &mut self.path else { return };
        if path.last().is_none_or(|last| last.time < t) {
            let mut step = SolverStep::new(t, self.models, self.states);
            for (g, q) in self.strand_contacts.given_unknowns(t) {
                (step.guides[g].q, step.arrived[g]) = (q, false);
            }
            path.push(step);
        } else if let Some(step) = path.last_mut() {
            for g in self.strand_contacts.free() {
                step.arrive(g, &self.models[g], &self.states[g]);
            }
        }
    }

    /// The guides whose motion is not given, before a part.
    fn snapshot(&self) -> Snapshot {
        let guides = self.strand_contacts.free().map(|g| (g, self.states[g].state())).collect();
        let path = self.path.as_ref().map_or(0, |path| path.len());
        Snapshot { guides, strand_contacts: self.strand_contacts.state(), path }
    }

    /// Restores the guides of `start` for which `chosen` holds, all contacts between guides, and the path.
    fn restore(&mut self, start: &Snapshot, chosen: impl Fn(usize) -> bool) {
        if let Some(path) = &mut self.path {
            path.truncate(start.path);
        }
        let restored = self.strand_contacts.restore(start.strand_contacts.clone());
        let chosen = start.guides.iter().filter(|(g, _)| chosen(*g));
        let restored = chosen.fold(restored, |restored, (g, state)| {
            restored.and_then(|()| self.states[*g].restore(state.clone()))
        });
        debug_assert!(restored.is_ok(), "a state fits the simulation that it was taken from");
    }
}
