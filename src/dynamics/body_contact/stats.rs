//! Contact statistics of one step.

use crate::contact::{Contact, MovingPolyline};
use crate::dynamics::step_record::StepRecord;

/// Statistics of the contact problem at the end of a step.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(in crate::dynamics) struct ContactStats {
    found: u32,
    active: u32,
    pub(super) rounds: u32,
    pub(super) residual: f64,
    penetration: f64,
    slack: f64,
    pub(super) unsettled: bool,
    /// Whether ties hold places that are at their goals throughout the step ([`ActiveTie::steady`]).
    ///
    /// [`ActiveTie::steady`]: crate::dynamics::tie::ActiveTie::steady
    pub(super) steady_ties: bool,
    pub(in crate::dynamics) crossed: bool,
}

impl ContactStats {
    /// True if contacts changed the step, or ties that made its motion less smooth.
    pub(in crate::dynamics) fn touched(&self) -> bool {
        self.rounds > 0 && !(self.steady_ties && self.active == 0)
    }

    /// Sets the counts, the penetration and the largest distance `slack` of a tied place from its goal, m, from
    /// the contacts `found` on `line` and their `reactions`, three components each.
    pub(super) fn measure(
        &mut self,
        line: &MovingPolyline,
        found: &[Contact],
        reactions: &[f64],
        slack: f64,
    ) {
        self.found = found.len() as u32;
        self.active = reactions.chunks_exact(3).filter(|r| r[0] > 0.0).count() as u32;
        self.slack = slack;
        self.penetration = 0.0;
        for c in found {
            let keep = line.clearance_at(c);
            // Points that are being pushed out of a body do not count.
            if keep >= 0.0 {
                self.penetration = self.penetration.max(-(line.gap(c) + keep));
            }
        }
    }

    /// Adds these statistics to the record of the step.
    pub(in crate::dynamics) fn enter(&self, record: &mut StepRecord) {
        record.found = self.found;
        record.active = self.active;
        record.rounds = record.rounds.max(self.rounds);
        record.residual = record.residual.max(self.residual);
        record.penetration = record.penetration.max(self.penetration);
        record.unsettled += u32::from(self.unsettled);
        record.crossed += u32::from(self.crossed);
        record.tie_slack = self.slack;
    }
}
