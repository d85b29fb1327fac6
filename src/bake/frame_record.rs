//! What a frame of the bake did: the figures of the manifest and the report.

use crate::dynamics::simulation::{Simulation, SubstepRecord};
use crate::strands::HeadMotion;
use serde::{Deserialize, Serialize};

/// Figures of one frame. The same for any number of threads; timings are kept apart.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct FrameRecord {
    /// Frame number.
    pub frame: i32,
    /// Sub-steps of all guides that led to this frame.
    pub solves: u64,
    /// Newton steps per guide and sub-step, mean.
    pub newton_mean: f64,
    /// Newton steps of the worst guide and sub-step.
    pub newton_max: u32,
    /// Steps that were cut in half for the solver's sake.
    pub halvings: u32,
    /// Ids of guides with a step that they took in parts by themselves, at moments that are not written: between its ends they went otherwise than straight.
    pub divided: Vec<i32>,
    /// Ids of guides with a solve that did not converge; they were carried along rigidly instead.
    pub unconverged: Vec<i32>,
    /// Strain nodes with unknowns at the end of the frame, of guides that move by themselves.
    pub active_nodes: u32,
    /// Guides that came away from their wisps.
    pub splits: u32,
    /// Guides that joined theirs.
    pub merges: u32,
    /// Places where a guide is at a body, found at the last sub-step of the frame.
    pub contacts_found: u32,
    /// Those of them that push.
    pub contacts_active: u32,
    /// Rounds of contact, most of any guide and sub-step.
    pub contact_rounds: u32,
    /// Relative residual of the reactions, largest; of those of a solve that did not settle, where it ended.
    pub contact_residual: f64,
    /// Solves that were taken after all rounds though the guide had not come to rest on the bodies.
    pub unsettled: u32,
    /// Deepest point inside a body that is not exempt, m; 0 where there is none.
    pub penetration_m: f64,
    /// Solves whose motion was cut short at a surface, or taken whole since every part of it crosses one.
    pub shortened: u32,
    /// Places where two guides are near each other or met, found in the last sub-step of the frame.
    pub strand_contacts_found: u32,
    /// Those of them that push.
    pub strand_contacts_active: u32,
    /// Rounds of contact between guides, most of any sub-step.
    pub strand_rounds: u32,
    /// Relative residual of the reactions between guides, largest.
    pub strand_residual: f64,
    /// Motions of guides that were taken after all rounds though they had not come to rest on each other.
    pub strands_unsettled: u32,
    /// Motions of guides that passed through a body, and segments of guides that passed through each other.
    pub crossings: u32,
    /// Motions of guides cut short for another guide's sake: taken as if it were not there, in part, or not at all.
    pub strands_shortened: u32,
    /// Farthest that a tie is from where it has to be, m.
    pub tie_slack_m: f64,
    /// Speed of the guides' points relative to the head, mean, m/s.
    pub speed_mean_m_s: f64,
    /// The same, 95th percentile.
    pub speed_p95_m_s: f64,
    /// The same, largest.
    pub speed_max_m_s: f64,
    /// Largest relative change of the arc length of a segment of a guide since the start.
    pub length_drift: f64,
    /// Points of guides that contact leaves alone, one for each body that they are in.
    pub exempt_segments: u32,
}

/// Relative residual of the reactions above which a frame does not hold to the law of contact: a thousandth of the forces.
pub const RESIDUAL: f64 = 1e-3;

impl FrameRecord {
    /// Which guarantees the frame breaks, in words; none as a rule.
    pub fn broken(&self) -> Vec<String> {
        let counted = |n: u32, what: &str| (n > 0).then(|| format!("{n} {what}"));
        let residual = self.contact_residual.max(self.strand_residual);
        let residual = (residual > RESIDUAL)
            .then(|| format!("a contact residual of {residual:.1e}, more than {RESIDUAL:.0e}"));
        let broken = [
            counted(self.crossings, "crossings of a surface"),
            counted(self.shortened, "motions cut short at a surface"),
            counted(self.strands_shortened, "motions cut short for another guide's sake"),
            counted(self.unconverged.len() as u32, "guides with a solve that did not converge"),
            residual,
        ];
        broken.into_iter().flatten().collect()
    }

    /// Adds what one sub-step did; `ids` are the guides' ids.
    pub fn add(&mut self, step: &SubstepRecord, ids: &[i32]) {
        self.active_nodes = step.active_nodes;
        self.splits += step.changes.splits;
        self.merges += step.changes.merges;
        (self.contacts_found, self.contacts_active) = (0, 0);
        (self.strand_contacts_found, self.strand_contacts_active) = (0, 0);
        let stepped = step.guides.iter().enumerate().filter(|(i, _)| step.active[*i]);
        for (_, r) in stepped.clone() {
            self.contacts_found += r.found;
            self.contacts_active += r.active;
            self.strand_contacts_found += r.strands.found;
            self.strand_contacts_active += r.strands.active;
        }
        let stepped = stepped.map(|(i, r)| (i, r, !step.coupled));
        for (i, r, by_itself) in stepped.chain(step.catch_up.iter().map(|(i, r)| (*i, r, true))) {
            self.solves += 1;
            // A running mean.
            self.newton_mean += (f64::from(r.iterations) - self.newton_mean) / self.solves as f64;
            self.newton_max = self.newton_max.max(r.iterations);
            self.halvings += r.halvings;
            self.contact_rounds = self.contact_rounds.max(r.rounds);
            self.contact_residual = self.contact_residual.max(r.residual);
            self.unsettled += r.unsettled;
            self.strands_unsettled += r.strands.unsettled;
            self.penetration_m = self.penetration_m.max(r.penetration);
            self.shortened += r.truncated;
            self.strand_rounds = self.strand_rounds.max(r.strands.rounds);
            self.strand_residual = self.strand_residual.max(r.strands.residual);
            self.crossings += r.crossed + r.strands.crossings;
            self.strands_shortened += r.strands.uncoupled + r.strands.truncated;
            self.tie_slack_m = self.tie_slack_m.max(r.tie_slack);
            if r.halvings > 0 && by_itself && !self.divided.contains(&ids[i]) {
                self.divided.push(ids[i]);
            }
            if r.unconverged > 0 && !self.unconverged.contains(&ids[i]) {
                self.unconverged.push(ids[i]);
            }
        }
    }

    /// Fills the figures of the state at the end of the frame, of guides that move by themselves.
    pub fn close(&mut self, simulation: &Simulation, head: &HeadMotion) {
        let mut speeds: Vec<f64> = Vec::new();
        for i in simulation.active() {
            let g = &simulation.state.guides[i];
            for (x, v) in g.x.iter().zip(&g.v).skip(1) {
                let carried = head.velocity + head.spin.cross(&(x - head.translation));
                speeds.push((v - carried).norm());
            }
            self.length_drift = self.length_drift.max(simulation.length_drift(i));
            self.exempt_segments += g.clearance.counts().0 as u32;
        }
        speeds.sort_by(f64::total_cmp);
        if let Some(&max) = speeds.last() {
            self.speed_max_m_s = max;
            self.speed_mean_m_s = speeds.iter().sum::<f64>() / speeds.len() as f64;
            self.speed_p95_m_s = speeds[(speeds.len() - 1) * 95 / 100];
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_broken_guarantee_is_named() {
        let good =
            FrameRecord { contact_residual: 0.5 * RESIDUAL, contacts_active: 7, ..FrameRecord::default() };
        assert!(good.broken().is_empty());
        let bad = [
            FrameRecord { crossings: 1, ..good.clone() },
            FrameRecord { shortened: 2, ..good.clone() },
            FrameRecord { unconverged: vec![4], ..good.clone() },
            FrameRecord { contact_residual: 2.0 * RESIDUAL, ..good.clone() },
            FrameRecord { strands_shortened: 1, ..good.clone() },
            FrameRecord { strand_residual: 2.0 * RESIDUAL, ..good.clone() },
        ];
        for record in bad {
            assert_eq!(record.broken().len(), 1, "{record:?}");
        }
    }
}
