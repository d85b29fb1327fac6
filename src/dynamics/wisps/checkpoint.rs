//! Checkpoint of the wisp tree.

use super::adaptive_tree::AdaptiveTree;
use super::follower::Follower;
use super::leader_motion::LeaderMotion;
use super::modal_correction::{ModalCorrection, ModalCorrectionState};
use super::rest_shape::RestState;
use crate::dynamics::checkpoint::StateMismatch;
use crate::dynamics::guide::{GuideModel, GuideState};
use serde::{Deserialize, Serialize};

/// Checkpoint of [`AdaptiveTree`].
#[derive(Debug, Clone, Serialize, Deserialize)]
pub(in crate::dynamics) struct WispsState {
    rest: Vec<RestState>,
    followers: Vec<Follower>,
    modal: ModalCorrectionState,
}

impl AdaptiveTree {
    /// The state for a checkpoint.
    pub fn state(&self) -> WispsState {
        WispsState {
            rest: self.motion.rest.iter().map(|rest| rest.state.clone()).collect(),
            followers: self.followers.clone(),
            modal: self.motion.modal.state(),
        }
    }

    /// Restores a state of the same guides.
    ///
    /// # Errors
    /// [`StateMismatch`] if `state` is of other guides.
    pub fn restore(
        &mut self,
        state: WispsState,
        models: &[GuideModel],
        states: &[GuideState],
    ) -> Result<(), StateMismatch> {
        StateMismatch::unless_same("followers", state.followers.len(), models.len())?;
        self.followers = state.followers;
        self.motion.rest.clear();
        if !state.rest.is_empty() {
            StateMismatch::unless_same("guides at rest", state.rest.len(), models.len())?;
            for ((rest, model), guide) in state.rest.iter().zip(models).zip(states) {
                StateMismatch::unless_same("unknowns at rest", rest.q.len(), model.rod.unknowns())?;
                StateMismatch::unless_same(
                    "required distances",
                    rest.required_distances.len(),
                    guide.required_distances().len(),
                )?;
            }
            self.set_rest(models, state.rest);
        }
        let LeaderMotion { hierarchy, rest, .. } = &self.motion;
        self.motion.modal = ModalCorrection::restored(state.modal, models, hierarchy, rest)?;
        Ok(())
    }
}
