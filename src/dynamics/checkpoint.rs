//! What is kept of a bake between processes: the state of the guides at a frame, and that of the whole simulation.

use serde::Serialize;
use serde::de::DeserializeOwned;

/// A part of the simulation that a checkpoint holds.
///
/// Construction from the scene gives what does not change; `State` is all else that a later bit depends on. A simulation
/// that is constructed anew and given its state goes on as the one that the state was taken of, bit for bit.
pub trait Checkpoint {
    /// The state, as it is written.
    type State: Serialize + DeserializeOwned;

    /// The state now.
    fn state(&self) -> Self::State;

    /// Goes back to a state of the same scene.
    ///
    /// # Errors
    /// [`StateMismatch`] where it is of another; then the part is in no defined state.
    fn restore(&mut self, state: Self::State) -> Result<(), StateMismatch>;
}

/// Why a state cannot be taken over.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("it holds {found} {what} where the scene has {expected}")]
pub struct StateMismatch {
    /// Of what there are too many or too few.
    pub what: &'static str,
    /// How many the state holds.
    pub found: usize,
    /// How many the scene has.
    pub expected: usize,
}

impl StateMismatch {
    /// Nothing if the numbers are the same.
    ///
    /// # Errors
    /// [`StateMismatch`] if not.
    pub fn unless_same(what: &'static str, found: usize, expected: usize) -> Result<(), StateMismatch> {
        if found == expected { Ok(()) } else { Err(StateMismatch { what, found, expected }) }
    }
}

impl<P: Checkpoint> Checkpoint for Vec<P> {
    type State = Vec<P::State>;

    fn state(&self) -> Self::State {
        self.iter().map(P::state).collect()
    }

    fn restore(&mut self, state: Self::State) -> Result<(), StateMismatch> {
        StateMismatch::unless_same("parts", state.len(), self.len())?;
        self.iter_mut().zip(state).try_for_each(|(part, state)| part.restore(state))
    }
}

/// A part that there may be or not.
impl<P: Checkpoint> Checkpoint for Option<P> {
    type State = Option<P::State>;

    fn state(&self) -> Self::State {
        self.as_ref().map(P::state)
    }

    fn restore(&mut self, state: Self::State) -> Result<(), StateMismatch> {
        match (self, state) {
            (Some(part), Some(state)) => part.restore(state),
            (None, None) => Ok(()),
            (part, state) => Err(StateMismatch {
                what: "parts",
                found: state.iter().count(),
                expected: part.iter().count(),
            }),
        }
    }
}
