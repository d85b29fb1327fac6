//! Modal correction for followers: a control variate on the leaders' linear modes (`docs/theory.md` eqs. 8.3
//! to 8.5).

use super::rest_shape::RestShape;
use crate::dynamics::checkpoint::StateMismatch;
use crate::dynamics::environment::Environment;
use crate::dynamics::guide::GuideModel;
use crate::wisp::{Deflection, HeadExcitation, ModalResponse, ModeState};
use nalgebra::Vector3;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

/// The modal responses of all guides about their rest shapes.
#[derive(Default)]
pub(super) struct ModalCorrection {
    reference: RestExcitation,
    responses: Vec<ModalResponse>,
}

/// The excitation under which the guides came to rest.
#[derive(Debug, Clone, Default, Serialize, Deserialize)]
struct RestExcitation {
    excitation: HeadExcitation,
    /// Gravity and force fields, m/s², rest space.
    gravity: Vector3<f64>,
}

/// Checkpoint of a [`ModalCorrection`].
#[derive(Debug, Clone, Serialize, Deserialize)]
pub(super) struct ModalCorrectionState {
    reference: RestExcitation,
    modes: Vec<Vec<ModeState>>,
}

/// The excitation of the guides at time `t`, s, by differences over steps of `h`, s.
fn excitation(env: &Environment, t: f64, h: f64) -> HeadExcitation {
    let heads = std::array::from_fn(|back| (env.head)(t - back as f64 * h));
    HeadExcitation::new(&heads, h, &(env.gravity)(t))
}

impl ModalCorrection {
    /// The responses of guides that rest at time `t`, s, in shapes `rest`; `h` is the sub-step, s.
    pub fn new(models: &[GuideModel], rest: &[RestShape], env: &Environment, t: f64, h: f64) -> Self {
        let gravity = (env.head)(t).rotation.inverse() * (env.gravity)(t);
        ModalCorrection::at_rest(models, rest, RestExcitation { excitation: excitation(env, t, h), gravity })
    }

    fn at_rest(models: &[GuideModel], rest: &[RestShape], reference: RestExcitation) -> Self {
        let response = |(model, rest): (&GuideModel, &RestShape)| {
            ModalResponse::new(&model.rod, &rest.state.q, &rest.kinematics, &model.drag, &reference.gravity)
        };
        ModalCorrection { responses: models.par_iter().zip(rest).map(response).collect(), reference }
    }

    /// Advances all responses from time `t[0]` to `t[1]`, s, in steps of `h`, s.
    pub fn advance(&mut self, env: &Environment, t: [f64; 2], h: f64) {
        let steps = ((t[1] - t[0]) / h).round() as u32;
        let at =
            |k: u32| excitation(env, t[1] - f64::from(steps - k) * h, h).minus(&self.reference.excitation);
        let excitations: Vec<HeadExcitation> = (1..=steps).map(at).collect();
        self.responses.par_iter_mut().for_each(|response| response.advance(&excitations, h));
    }

    /// The modal response of guide `i`.
    pub fn deflection(&self, i: usize) -> &Deflection {
        self.responses[i].deflection()
    }

    /// The state for a checkpoint.
    pub fn state(&self) -> ModalCorrectionState {
        ModalCorrectionState {
            reference: self.reference.clone(),
            modes: self.responses.iter().map(|response| response.mode_states().to_vec()).collect(),
        }
    }

    /// Restores the responses of the same guides at the same `rest`.
    ///
    /// # Errors
    /// [`StateMismatch`] if `state` is of other guides.
    pub fn restored(
        state: ModalCorrectionState,
        models: &[GuideModel],
        rest: &[RestShape],
    ) -> Result<Self, StateMismatch> {
        StateMismatch::unless_same("modal responses", state.modes.len(), rest.len())?;
        if rest.is_empty() {
            return Ok(ModalCorrection::default());
        }
        let mut correction = ModalCorrection::at_rest(models, rest, state.reference);
        for (response, modes) in correction.responses.iter_mut().zip(state.modes) {
            StateMismatch::unless_same("modes", modes.len(), response.mode_states().len())?;
            response.restore(modes);
        }
        Ok(correction)
    }
}
