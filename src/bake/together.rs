//! Sub-steps of guides that touch each other: taken by all at once, and in parts where one of them would go astray (`docs/theory.md` §5.2).

use super::company::Companies;
use super::guide::{Guide, MAX_HALVINGS, StepRecord, StrandRecord, Surroundings};
use super::state::{Part, Unfit};
use super::tangle::Tangle;

/// How often a sub-step is halved in which something would cross something nevertheless: what moves by 0.2 m in it then moves by less than its clearance in a
/// part.
const MAX_HALVINGS_AT_CROSSINGS: u32 = 9;

/// The guides of a simulation in one sub-step.
pub(super) struct Together<'a> {
    pub guides: &'a mut [Guide],
    pub tangle: &'a mut Tangle,
    pub companies: &'a Companies,
    pub around: &'a Surroundings<'a>,
    /// Is told of every time, s, to which all guides were brought.
    pub note: &'a mut dyn FnMut(f64, &[Guide]),
}

impl Together<'_> {
    /// Takes the sub-step over `span`, its start and end, s; `records` has an entry for each guide. What follows others is left as it is.
    pub fn advance(&mut self, span: [f64; 2], records: &mut [StepRecord]) {
        let mut astray = vec![0; self.guides.len()];
        self.take(span, 0, records, &mut astray);
        for &g in self.tangle.movers() {
            self.guides[g].pinched = astray[g] > records[g].halvings;
        }
    }

    /// Takes a part of a sub-step that was halved `depth` times already; in halves if that may keep a guide from going astray. Counts in `astray` the
    /// parts in which each guide does nevertheless.
    fn take(&mut self, span: [f64; 2], depth: u32, records: &mut [StepRecord], astray: &mut [u32]) {
        let movers = || self.tangle.movers().iter();
        let before = (movers().map(|&g| self.guides[g].state()).collect(), self.tangle.state());
        let q: Vec<_> = movers().map(|&g| self.guides[g].q.clone()).collect();
        self.companies.advance(self.guides, self.around, span, records);
        self.tangle.resolve(self.guides, self.around, span, records);
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
        for &g in self.tangle.movers() {
            records[g] = records[g].then(&second[g]);
        }
        // To the next sub-step this was one.
        for (&g, [now, one, _]) in self.tangle.movers().iter().zip(q) {
            self.guides[g].q[1] = now;
            self.guides[g].q[2] = one;
        }
    }

    fn go_back(
        &mut self,
        (guides, tangle): (Vec<<Guide as Part>::State>, <Tangle as Part>::State),
    ) -> Result<(), Unfit> {
        for (&g, state) in self.tangle.movers().iter().zip(guides) {
            self.guides[g].restore(state)?;
        }
        self.tangle.restore(tangle)
    }
}

impl StepRecord {
    /// Whether something passed through something.
    fn crosses(&self) -> bool {
        self.crossed + self.strands.crossings > 0
    }

    /// Whether it did not go as contact and its own equation ask.
    fn is_astray(&self) -> bool {
        let among_others = self.strands.unsettled + self.strands.alone + self.strands.held;
        self.crosses() || self.shortened + self.unconverged + self.unsettled + among_others > 0
    }

    /// Of a step in two halves, of which this was the first.
    fn then(&self, second: &StepRecord) -> StepRecord {
        let (a, b) = (&self.strands, &second.strands);
        StepRecord {
            iterations: self.iterations + second.iterations,
            halvings: self.halvings + second.halvings + 1,
            unconverged: self.unconverged + second.unconverged,
            found: second.found,
            active: second.active,
            rounds: self.rounds.max(second.rounds),
            residual: self.residual.max(second.residual),
            penetration: self.penetration.max(second.penetration),
            shortened: self.shortened + second.shortened,
            crossed: self.crossed + second.crossed,
            unsettled: self.unsettled + second.unsettled,
            slack: self.slack.max(second.slack),
            strands: StrandRecord {
                found: b.found,
                active: b.active,
                rounds: a.rounds.max(b.rounds),
                residual: a.residual.max(b.residual),
                unsettled: a.unsettled + b.unsettled,
                alone: a.alone + b.alone,
                held: a.held + b.held,
                crossings: a.crossings + b.crossings,
            },
        }
    }
}
