//! Checkpoints of the simulation: saving and restoring state between processes.

use serde::Serialize;
use serde::de::DeserializeOwned;

/// A part of the simulation that a checkpoint stores.
///
/// Constants come from construction; `State` holds everything else that later results depend on. A newly
/// constructed simulation continues from a restored state bit for bit.
pub trait Checkpoint {
    /// The serialised state.
    type State: Serialize + DeserializeOwned;

    /// Returns the current state.
    fn state(&self) -> Self::State;

    /// Restores a state of the same scene.
    ///
    /// # Errors
    /// [`StateMismatch`] if the state belongs to another scene; the part is then in an undefined state.
    fn restore(&mut self, state: Self::State) -> Result<(), StateMismatch>;
}

/// The state does not fit the scene.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("it holds {found} {what} where the scene has {expected}")]
pub struct StateMismatch {
    /// The items counted.
    pub what: &'static str,
    /// Number in the state.
    pub found: usize,
    /// Number in the scene.
    pub expected: usize,
}

impl StateMismatch {
    /// Checks that the two numbers are equal.
    ///
    /// # Errors
    /// [`StateMismatch`] if they differ.
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

/// An optional part.
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
