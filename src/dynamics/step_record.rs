//! What one sub-step did to one guide, and to the hair as a volume.

/// Counts and extremes of one sub-step of one guide.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct StepRecord {
    /// Newton steps over all solves.
    pub iterations: u32,
    /// Times the sub-step was halved.
    pub halvings: u32,
    /// Solves that did not converge; the rod was carried rigidly with its root instead.
    pub unconverged: u32,
    /// Contacts with bodies found in the last solve.
    pub found: u32,
    /// Contacts with a non-zero reaction in the last solve.
    pub active: u32,
    /// Contact rounds, largest of all solves.
    pub rounds: u32,
    /// Relative residual of the contact reactions, largest of all solves.
    pub residual: f64,
    /// Deepest point inside a body, m; 0 if none.
    pub penetration: f64,
    /// Solves whose motion was truncated at a surface, or taken whole because no part of it is admissible.
    pub truncated: u32,
    /// Truncated solves whose motion still crosses a surface.
    pub crossed: u32,
    /// Solves accepted before the guide came to rest on the bodies.
    pub unsettled: u32,
    /// Largest distance of a tied place from its goal at the end, m.
    pub tie_slack: f64,
    /// Contact with other guides.
    pub strands: StrandRecord,
}

/// Counts and extremes of the contact of one guide with other guides in one sub-step.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct StrandRecord {
    /// Contact pairs with guides of higher index.
    pub found: u32,
    /// Pairs of them with a non-zero reaction.
    pub active: u32,
    /// Rounds of solving and detection.
    pub rounds: u32,
    /// Relative residual of the reactions of the last round.
    pub residual: f64,
    /// 1 if the coupled solve was accepted before it converged.
    pub unsettled: u32,
    /// 1 if moreover it still moved by much, loses a contact or violates a body; others are next to rest.
    pub unsolved: u32,
    /// 1 if the coupled solve was rejected and the guide kept its uncoupled motion.
    pub uncoupled: u32,
    /// 1 if the motion was truncated, or the guide held at rest on the head, to avoid crossing another guide.
    pub truncated: u32,
    /// Segments whose motion crosses a segment of a guide of higher index.
    pub crossings: u32,
    /// Largest share of the distance of its contacts with guides of higher index that is missing at the end: 1 where
    /// they touch.
    pub missing: f64,
    /// Work of its contacts with guides of higher index on both guides, J; a bundle's is that of all its
    /// hairs.
    pub work: f64,
}

/// The hair as a fibre assembly at the start of one sub-step; zero without such contact.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct HairRecord {
    /// Share of the hair, by volume, whose pressure is less than the law's because of the length of the
    /// sub-step.
    pub softened: f64,
    /// Volume fraction, over the 95th percentile by volume in the groom's pose: 95th percentile.
    pub crowding_p95: f64,
    /// The same: largest.
    pub crowding_max: f64,
    /// Root mean square of the velocity against the mean of the hair around, over that in head space; 0 where
    /// the latter is below 5 cm/s.
    pub slip: f64,
    /// Work of hair on hair over the sub-step, J.
    pub work: f64,
}

impl StepRecord {
    /// True if the motion crossed a body or another guide.
    pub(super) fn crosses(&self) -> bool {
        self.crossed + self.strands.crossings > 0
    }

    /// True if a solve failed, was replaced by a fallback, did not settle on bodies, or is left unsolved between guides.
    /// One that merely did not settle between guides is none of these.
    pub(super) fn failed(&self) -> bool {
        let strands = self.strands.unsolved + self.strands.uncoupled + self.strands.truncated;
        self.crosses() || self.truncated + self.unconverged + self.unsettled + strands > 0
    }

    /// Combines the records of the two halves of a halved sub-step.
    pub(super) fn then(&self, second: &StepRecord) -> StepRecord {
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
            truncated: self.truncated + second.truncated,
            crossed: self.crossed + second.crossed,
            unsettled: self.unsettled + second.unsettled,
            tie_slack: second.tie_slack,
            strands: StrandRecord {
                found: b.found,
                active: b.active,
                rounds: a.rounds.max(b.rounds),
                residual: a.residual.max(b.residual),
                unsettled: a.unsettled + b.unsettled,
                unsolved: a.unsolved + b.unsolved,
                uncoupled: a.uncoupled + b.uncoupled,
                truncated: a.truncated + b.truncated,
                crossings: a.crossings + b.crossings,
                missing: a.missing.max(b.missing),
                work: a.work + b.work,
            },
        }
    }
}
