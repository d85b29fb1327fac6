//! A sub-step with contact between guides: taken by all active guides at once. Guides that fail take it again
//! in halves, with those that they touch (`docs/theory.md` §5.2).

use super::batch::Batches;
use super::checkpoint::Checkpoint;
use super::environment::Environment;
use super::guide::{ContactMode, GuideModel, GuideScratch, GuideState, MAX_HALVINGS};
use super::step_record::StepRecord;
use super::strand_contact::StrandContacts;
use rayon::prelude::*;

/// Most halvings of a sub-step with a crossing: a point that moves by 0.2 m in the sub-step then moves by
/// less than its clearance in a part.
const MAX_HALVINGS_AT_CROSSINGS: u32 = 9;

/// The guides of a simulation in one sub-step.
pub(super) struct CoupledSubstep<'a> {
    pub models: &'a [GuideModel],
    pub states: &'a mut [GuideState],
    pub strand_contacts: &'a mut StrandContacts,
    pub batches: &'a Batches,
    pub env: &'a Environment<'a>,
    /// Called with the times, s, that all guides have reached, each in its own parts of the sub-step.
    pub observe: &'a mut dyn FnMut(f64, &[GuideState]),
}

/// Guides and their contacts with each other at some time.
struct Snapshot {
    /// The guides, ascending, with their states.
    guides: Vec<(usize, GuideState)>,
    strand_contacts: <StrandContacts as Checkpoint>::State,
}

impl CoupledSubstep<'_> {
    /// Takes the sub-step over `span`, its start and end, s; `records` has an entry for each guide. Followers
    /// are not changed.
    pub fn step(&mut self, span: [f64; 2], records: &mut [StepRecord]) {
        let mut failures = vec![0; self.states.len()];
        self.take_part(span, 0, records, &mut failures);
        for &g in self.strand_contacts.active() {
            self.states[g].stuck = failures[g] > records[g].halvings;
        }
    }

    /// Takes a part of a sub-step that was halved `depth` times, for all guides whose motion is not given; divides
    /// it for some of them if that may avoid a failure. Counts in `failures` the accepted parts in which each
    /// guide fails. Returns the guides with a given motion that others pushed or crossed: they must take the
    /// part together.
    fn take_part(
        &mut self,
        span: [f64; 2],
        depth: u32,
        records: &mut [StepRecord],
        failures: &mut [u32],
    ) -> Vec<usize> {
        let start = self.snapshot();
        self.step_guides(span, records);
        self.strand_contacts.resolve(self.models, self.states, self.env, span, records);
        let touched = self.strand_contacts.touched_given();
        let fails = |&g: &usize| !self.states[g].stuck && records[g].failed();
        let failing: Vec<usize> = self.strand_contacts.free().filter(fails).collect();
        let crosses = failing.iter().any(|&g| records[g].crosses());
        let max_halvings = if crosses { MAX_HALVINGS_AT_CROSSINGS } else { MAX_HALVINGS };
        if failing.is_empty() || depth >= max_halvings || !touched.is_empty() {
            for (count, record) in failures.iter_mut().zip(records) {
                *count += u32::from(record.failed());
            }
            if self.strand_contacts.all_are_free() {
                (self.observe)(span[1], self.states);
            }
            return touched;
        }
        self.divide(span, depth, &start, failing, records, failures)
    }

    /// Takes a part again in two halves, for the guides `failing`, those that they touch, and those that they come
    /// to touch on the way; all others move as they have done. Returns as [`CoupledSubstep::take_part`].
    fn divide(
        &mut self,
        span: [f64; 2],
        depth: u32,
        start: &Snapshot,
        failing: Vec<usize>,
        records: &mut [StepRecord],
        failures: &mut [u32],
    ) -> Vec<usize> {
        let links = self.strand_contacts.links();
        let motion = self.strand_contacts.motion(span);
        let end = self.strand_contacts.state();
        let mut group = links.connected(failing);
        loop {
            let others = || start.guides.iter().map(|(g, _)| *g).filter(|g| group.binary_search(g).is_err());
            others().for_each(|g| self.strand_contacts.give(g, &motion));
            self.restore(start, &group);
            let middle = 0.5 * (span[0] + span[1]);
            let mut counts = failures.to_vec();
            let mut touched = Vec::new();
            let halves = [[span[0], middle], [middle, span[1]]].map(|span| {
                let mut records = vec![StepRecord::default(); records.len()];
                touched.extend(self.take_part(span, depth + 1, &mut records, &mut counts));
                records
            });
            others().for_each(|g| self.strand_contacts.free_again(g));
            let is_here = |g: &usize| start.guides.binary_search_by_key(g, |(g, _)| *g).is_ok();
            let (joining, outside): (Vec<usize>, Vec<usize>) = touched.into_iter().partition(is_here);
            if outside.is_empty() && !joining.is_empty() {
                group = links.connected(group.into_iter().chain(joining));
                continue;
            }
            let is_whole = group.len() == start.guides.len();
            self.strand_contacts.keep_contacts_of_others(end, &group);
            failures.copy_from_slice(&counts);
            for &g in &group {
                records[g] = halves[0][g].then(&halves[1][g]);
            }
            // The history of the next sub-step is that of one whole sub-step.
            for (g, state) in start.guides.iter().filter(|(g, _)| group.binary_search(g).is_ok()) {
                self.states[*g].q[1].clone_from(&state.q[0]);
                self.states[*g].q[2].clone_from(&state.q[1]);
            }
            if !is_whole && self.strand_contacts.all_are_free() {
                (self.observe)(span[1], self.states);
            }
            return outside;
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
        all.filter(|(_, is_free)| *is_free).for_each_init(
            GuideScratch::default,
            |scratch, (((state, model), record), _)| {
                *record = model.step(env, state, span, mode, scratch);
            },
        );
    }

    /// The guides whose motion is not given, before a part.
    fn snapshot(&self) -> Snapshot {
        let guides = self.strand_contacts.free().map(|g| (g, self.states[g].state())).collect();
        Snapshot { guides, strand_contacts: self.strand_contacts.state() }
    }

    /// Restores the guides of `group`, and all contacts between guides.
    fn restore(&mut self, start: &Snapshot, group: &[usize]) {
        let restored = self.strand_contacts.restore(start.strand_contacts.clone());
        let of_group = start.guides.iter().filter(|(g, _)| group.binary_search(g).is_ok());
        let restored = of_group.fold(restored, |restored, (g, state)| {
            restored.and_then(|()| self.states[*g].restore(state.clone()))
        });
        debug_assert!(restored.is_ok(), "a state fits the simulation that it was taken from");
    }
}
