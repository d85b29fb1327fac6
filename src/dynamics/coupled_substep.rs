//! A sub-step with contact between guides: taken by all active guides at once, and halved for all if one of
//! them fails (`docs/theory.md` §5.2).

use super::batch::Batches;
use super::checkpoint::{Checkpoint, StateMismatch};
use super::environment::Environment;
use super::guide::{ContactMode, GuideModel, GuideState, MAX_HALVINGS, MAX_HALVINGS_AT_CROSSINGS};
use super::step_record::StepRecord;
use super::strand_contact::StrandContacts;

/// The guides of a simulation in one sub-step.
pub(super) struct CoupledSubstep<'a> {
    pub models: &'a [GuideModel],
    pub states: &'a mut [GuideState],
    pub strand_contacts: &'a mut StrandContacts,
    pub batches: &'a Batches,
    pub env: &'a Environment<'a>,
    /// Called with every time, s, that all guides have reached.
    pub observe: &'a mut dyn FnMut(f64, &[GuideState]),
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

    /// Takes a part of a sub-step that was halved `depth` times; halves it further if that may avoid a
    /// failure. Counts in `failures` the accepted parts in which each guide fails.
    fn take_part(&mut self, span: [f64; 2], depth: u32, records: &mut [StepRecord], failures: &mut [u32]) {
        let active = || self.strand_contacts.active().iter();
        let before = (active().map(|&g| self.states[g].state()).collect(), self.strand_contacts.state());
        let q: Vec<_> = active().map(|&g| self.states[g].q.clone()).collect();
        self.batches.step(self.models, self.env, self.states, span, ContactMode::Coupled, records);
        self.strand_contacts.resolve(self.models, self.states, self.env, span, records);
        let any = |is: fn(&StepRecord) -> bool| {
            self.states.iter().zip(&*records).any(|(state, record)| !state.stuck && is(record))
        };
        let (failed, crosses) = (any(StepRecord::failed), any(StepRecord::crosses));
        let max_halvings = if crosses { MAX_HALVINGS_AT_CROSSINGS } else { MAX_HALVINGS };
        if !failed || depth >= max_halvings {
            for (count, record) in failures.iter_mut().zip(records) {
                *count += u32::from(record.failed());
            }
            (self.observe)(span[1], self.states);
            return;
        }
        let restored = self.restore(before);
        debug_assert!(restored.is_ok(), "a state fits the simulation that it was taken from");
        let middle = 0.5 * (span[0] + span[1]);
        let mut second = vec![StepRecord::default(); records.len()];
        records.fill(StepRecord::default());
        self.take_part([span[0], middle], depth + 1, records, failures);
        self.take_part([middle, span[1]], depth + 1, &mut second, failures);
        for &g in self.strand_contacts.active() {
            records[g] = records[g].then(&second[g]);
        }
        // The history of the next sub-step is that of one whole sub-step.
        for (&g, [start, previous, _]) in self.strand_contacts.active().iter().zip(q) {
            self.states[g].q[1] = start;
            self.states[g].q[2] = previous;
        }
    }

    /// Restores the states before a part.
    fn restore(
        &mut self,
        (states, strand_contacts): (Vec<GuideState>, <StrandContacts as Checkpoint>::State),
    ) -> Result<(), StateMismatch> {
        for (&g, state) in self.strand_contacts.active().iter().zip(states) {
            self.states[g].restore(state)?;
        }
        self.strand_contacts.restore(strand_contacts)
    }
}
