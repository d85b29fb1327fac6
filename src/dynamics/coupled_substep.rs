//! Sub-steps of guides that touch each other: taken by all at once, and in parts where one of them would go astray (`docs/theory.md` §5.2).

use super::batch::Batches;
use super::checkpoint::{Checkpoint, StateMismatch};
use super::environment::Environment;
use super::guide::{Guide, MAX_HALVINGS};
use super::step_record::StepRecord;
use super::strand_contact::StrandContacts;

/// How often a sub-step is halved in which something would cross something nevertheless: what moves by 0.2 m in it then moves by less than its clearance in a
/// part.
const MAX_HALVINGS_AT_CROSSINGS: u32 = 9;

/// The guides of a simulation in one sub-step.
pub(super) struct CoupledSubstep<'a> {
    pub guides: &'a mut [Guide],
    pub strand_contacts: &'a mut StrandContacts,
    pub batches: &'a Batches,
    pub env: &'a Environment<'a>,
    /// Is told of every time, s, to which all guides were brought.
    pub note: &'a mut dyn FnMut(f64, &[Guide]),
}

impl CoupledSubstep<'_> {
    /// Takes the sub-step over `span`, its start and end, s; `records` has an entry for each guide. What follows others is left as it is.
    pub fn advance(&mut self, span: [f64; 2], records: &mut [StepRecord]) {
        let mut astray = vec![0; self.guides.len()];
        self.take(span, 0, records, &mut astray);
        for &g in self.strand_contacts.movers() {
            self.guides[g].pinched = astray[g] > records[g].halvings;
        }
    }

    /// Takes a part of a sub-step that was halved `depth` times already; in halves if that may keep a guide from going astray. Counts in `astray` the
    /// parts in which each guide does nevertheless.
    fn take(&mut self, span: [f64; 2], depth: u32, records: &mut [StepRecord], astray: &mut [u32]) {
        let movers = || self.strand_contacts.movers().iter();
        let before = (movers().map(|&g| self.guides[g].state()).collect(), self.strand_contacts.state());
        let q: Vec<_> = movers().map(|&g| self.guides[g].q.clone()).collect();
        self.batches.advance(self.guides, self.env, span, records);
        self.strand_contacts.resolve(self.guides, self.env, span, records);
        let of =
            |is: fn(&StepRecord) -> bool| self.guides.iter().zip(&*records).any(|(g, r)| !g.pinched && is(r));
        let (astray_now, crosses) = (of(StepRecord::is_astray), of(StepRecord::crosses));
        let most = if crosses { MAX_HALVINGS_AT_CROSSINGS } else { MAX_HALVINGS };
        if !astray_now || depth >= most {
            for (count, record) in astray.iter_mut().zip(records) {
                *count += u32::from(record.is_astray());
            }
            (self.note)(span[1], self.guides);
            return;
        }
        let back = self.go_back(before);
        debug_assert!(back.is_ok(), "a state is of the simulation that it was taken of");
        let middle = 0.5 * (span[0] + span[1]);
        let mut second = vec![StepRecord::default(); records.len()];
        records.fill(StepRecord::default());
        self.take([span[0], middle], depth + 1, records, astray);
        self.take([middle, span[1]], depth + 1, &mut second, astray);
        for &g in self.strand_contacts.movers() {
            records[g] = records[g].then(&second[g]);
        }
        // To the next sub-step this was one.
        for (&g, [now, one, _]) in self.strand_contacts.movers().iter().zip(q) {
            self.guides[g].q[1] = now;
            self.guides[g].q[2] = one;
        }
    }

    fn go_back(
        &mut self,
        (guides, strand_contacts): (Vec<<Guide as Checkpoint>::State>, <StrandContacts as Checkpoint>::State),
    ) -> Result<(), StateMismatch> {
        for (&g, state) in self.strand_contacts.movers().iter().zip(guides) {
            self.guides[g].restore(state)?;
        }
        self.strand_contacts.restore(strand_contacts)
    }
}
