//! Checkpoint of the contacts between guides.

use super::contact_pair::ContactHistory;
use super::contact_pairs::ContactPairs;
use super::strand_contacts::StrandContacts;
use crate::dynamics::checkpoint::{Checkpoint, StateMismatch};
use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

/// Curves of the active guides and the history of their contacts, at the end of a sub-step.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct StrandContactsState {
    pub(super) pushed: Vec<bool>,
    x: Vec<Vector3<f64>>,
    pub(super) history: Vec<ContactHistory>,
}

impl Checkpoint for StrandContacts {
    type State = StrandContactsState;

    fn state(&self) -> StrandContactsState {
        // All fields by name: a new field must be either saved or listed as derived.
        let StrandContacts { own_bundles: _, active: _, pairs, guides: _, pushed, given: _, touched: _ } =
            self;
        let ContactPairs {
            bundles: _,
            root_share: _,
            roots: _,
            half_turns: _,
            drawn: _,
            guide: _,
            first: _,
            x: [x, _],
            candidates: _,
            contacts: _,
            crossing: _,
            impacts: _,
            history,
            duration: _,
        } = pairs;
        StrandContactsState { pushed: pushed.clone(), x: x.clone(), history: history.clone() }
    }

    fn restore(&mut self, state: StrandContactsState) -> Result<(), StateMismatch> {
        let StrandContactsState { pushed, x, history } = state;
        StateMismatch::unless_same("pushed guides", pushed.len(), self.pushed.len())?;
        StateMismatch::unless_same("points of guides", x.len(), self.pairs.x[0].len())?;
        self.pushed = pushed;
        self.pairs.x[0] = x;
        self.pairs.history = history;
        Ok(())
    }
}
