//! What one sub-step did to one guide.

/// What one step of a guide did.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct StepRecord {
    /// Newton steps taken, over all solves.
    pub iterations: u32,
    /// Times the step was cut in half.
    pub halvings: u32,
    /// Solves that did not converge: the rod was carried along rigidly instead.
    pub unconverged: u32,
    /// Contacts found, in the last solve.
    pub found: u32,
    /// Contacts that push, in the last solve.
    pub active: u32,
    /// Rounds of contact, at most.
    pub rounds: u32,
    /// Relative residual of the reactions, largest.
    pub residual: f64,
    /// Deepest point inside a body, m; 0 where there is none.
    pub penetration: f64,
    /// Solves whose motion was cut short at a surface, or taken whole since no part of it may be.
    pub shortened: u32,
    /// Of those, the ones that crossed it nevertheless.
    pub crossed: u32,
    /// Solves that were taken though the guide had not come to rest on the bodies.
    pub unsettled: u32,
    /// Farthest that a tie is from where it has to be, m.
    pub slack: f64,
    /// Contact with other guides.
    pub strands: StrandRecord,
}

/// What one step of a guide did in contact with other guides.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct StrandRecord {
    /// Places where it is near a guide further down the order, or met one.
    pub found: u32,
    /// Those of them that push.
    pub active: u32,
    /// Rounds of solving and looking.
    pub rounds: u32,
    /// Relative residual of the reactions that it was solved with.
    pub residual: f64,
    /// 1 where it was taken together with others though they had not come to rest.
    pub unsettled: u32,
    /// 1 where its motion together with the others came to no good, and it went where it would have gone alone.
    pub alone: u32,
    /// 1 where it went a part of its way only, or did not move on the head, for it would have crossed another guide.
    pub held: u32,
    /// Places where the motion of a segment crosses that of a guide further down the order.
    pub crossings: u32,
}

impl StepRecord {
    /// Whether something passed through something.
    pub(super) fn crosses(&self) -> bool {
        self.crossed + self.strands.crossings > 0
    }

    /// Whether it did not go as contact and its own equation ask.
    pub(super) fn is_astray(&self) -> bool {
        let among_others = self.strands.unsettled + self.strands.alone + self.strands.held;
        self.crosses() || self.shortened + self.unconverged + self.unsettled + among_others > 0
    }

    /// Of a step in two halves, of which this was the first.
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
