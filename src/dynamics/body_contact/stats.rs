//! What the record of a step tells of its contact with bodies.

use super::{BodyContact, BodyContactScratch};
use crate::contact::MovingPolyline;
use crate::dynamics::step_record::StepRecord;
use crate::dynamics::tie::Tie;
use nalgebra::Vector3;

/// What a step ended with, in contact.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(in crate::dynamics) struct ContactStats {
    found: u32,
    active: u32,
    pub(super) rounds: u32,
    pub(super) residual: f64,
    penetration: f64,
    slack: f64,
    pub(super) unsettled: bool,
    pub(in crate::dynamics) crossed: bool,
}

impl ContactStats {
    /// Whether the bodies had a say in the step.
    pub(in crate::dynamics) fn touched(&self) -> bool {
        self.rounds > 0
    }

    /// Enters these figures in the record of the step.
    pub(in crate::dynamics) fn enter(&self, record: &mut StepRecord) {
        record.found = self.found;
        record.active = self.active;
        record.rounds = record.rounds.max(self.rounds);
        record.residual = record.residual.max(self.residual);
        record.penetration = record.penetration.max(self.penetration);
        record.unsettled += u32::from(self.unsettled);
        record.crossed += u32::from(self.crossed);
        record.tie_slack = record.tie_slack.max(self.slack);
    }
}

impl BodyContact<'_> {
    /// Notes what the step ended with.
    pub fn note(&self, work: &mut BodyContactScratch) {
        work.stats.found = work.found.len() as u32;
        let of_contacts = (work.reaction.len() / 3).saturating_sub(self.ties.len());
        let reactions = work.reaction.chunks_exact(3).take(of_contacts);
        work.stats.active = reactions.filter(|r| r[0] > 0.0).count() as u32;
        work.stats.penetration = 0.0;
        let slack = |(tie, target): &(Tie, Vector3<f64>)| (tie.place(&work.x1) - target).norm();
        work.stats.slack = self.ties.iter().map(slack).fold(0.0, f64::max);
        let line = MovingPolyline { x0: self.x0, x1: &work.x1, clearance: self.clearance };
        for c in &work.found {
            let keep = line.clearance_at(c);
            // Points on their way out of a body are not at fault.
            if keep >= 0.0 {
                work.stats.penetration = work.stats.penetration.max(-(line.gap(c) + keep));
            }
        }
    }
}
