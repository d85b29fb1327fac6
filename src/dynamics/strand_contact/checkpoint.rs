//! What a checkpoint holds of the guides as they touch each other.

use super::StrandContacts;
use super::contact_pairs::{ContactPairs, Known};
use crate::dynamics::checkpoint::{Checkpoint, StateMismatch};
use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

/// Where the guides are that move by themselves and what is known of their contacts, at the end of a sub-step.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct Saved {
    pushed: Vec<bool>,
    x: Vec<Vector3<f64>>,
    known: Vec<Known>,
}

impl Checkpoint for StrandContacts {
    type State = Saved;

    fn state(&self) -> Saved {
        // All fields by name: whoever adds one has to say here whether a later sub-step depends on it.
        let StrandContacts { own: _, active: _, places, members: _, pushed } = self;
        let ContactPairs {
            skin: _,
            rooted: _,
            guide: _,
            first: _,
            x: [x, _],
            pairs: _,
            found: _,
            crossing: _,
            known,
        } = places;
        Saved { pushed: pushed.clone(), x: x.clone(), known: known.clone() }
    }

    fn restore(&mut self, state: Saved) -> Result<(), StateMismatch> {
        let Saved { pushed, x, known } = state;
        StateMismatch::unless_same("pushed guides", pushed.len(), self.pushed.len())?;
        StateMismatch::unless_same("points of guides", x.len(), self.places.x[0].len())?;
        self.pushed = pushed;
        self.places.x[0] = x;
        self.places.known = known;
        Ok(())
    }
}
