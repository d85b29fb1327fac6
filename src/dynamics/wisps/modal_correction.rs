//! Modal correction for followers: a control variate on the leaders' linear modes (`docs/theory.md` eqs. 8.3
//! to 8.5).

use super::rest_shape::RestShape;
use crate::dynamics::checkpoint::StateMismatch;
use crate::dynamics::environment::Environment;
use crate::dynamics::guide::GuideModel;
use crate::scene::RootBinding;
use crate::wisp::{
    Deflection, ForceApart, HeadExcitation, Hierarchy, ModalRates, ModalResponse, ModeState, NeighbourDrag,
};
use nalgebra::Vector3;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

/// The modal responses of all guides about their rest shapes.
#[derive(Default)]
pub(super) struct ModalCorrection {
    /// One for all guides, or one for each where skins carry the roots.
    references: Vec<RestExcitation>,
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
    references: Vec<RestExcitation>,
    modes: Vec<[Vec<ModeState>; 2]>,
}

/// The excitation of guides on `root`, or on the head, at time `t`, s, by differences over steps of `h`, s.
fn excitation(env: &Environment, root: Option<&RootBinding>, t: f64, h: f64) -> HeadExcitation {
    let carriers = std::array::from_fn(|back| env.carried(root, t - back as f64 * h));
    HeadExcitation::new(&carriers, h, &(env.gravity)(t))
}

/// The roots that are excited on their own: the head is one for all.
fn roots(models: &[GuideModel]) -> Vec<Option<&RootBinding>> {
    let of_skins: Vec<_> = models.iter().map(|model| model.skin.as_ref()).collect();
    if of_skins.iter().all(Option::is_none) { vec![None] } else { of_skins }
}

impl ModalCorrection {
    /// The responses of guides that rest at time `t`, s, in shapes `rest`; `h` is the sub-step, s. Those that neither
    /// lead nor are led have none.
    pub fn new(
        models: &[GuideModel],
        hierarchy: &Hierarchy,
        rest: &[RestShape],
        env: &Environment,
        [t, h]: [f64; 2],
    ) -> Self {
        let at_rest = |root: Option<&RootBinding>| RestExcitation {
            gravity: env.carried(root, t).rotation.inverse() * (env.gravity)(t),
            excitation: excitation(env, root, t, h),
        };
        let references = roots(models).into_par_iter().map(at_rest).collect();
        ModalCorrection::at_rest(models, hierarchy, rest, references)
    }

    fn at_rest(
        models: &[GuideModel],
        hierarchy: &Hierarchy,
        rest: &[RestShape],
        references: Vec<RestExcitation>,
    ) -> Self {
        let mut alone: Vec<bool> = hierarchy.leaders.iter().map(Vec::is_empty).collect();
        hierarchy.leaders.iter().flatten().for_each(|(leader, _)| alone[*leader] = false);
        let response = |(i, (model, rest)): (usize, (&GuideModel, &RestShape))| {
            if alone[i] {
                return ModalResponse::default();
            }
            let gravity = &references[i.min(references.len() - 1)].gravity;
            ModalResponse::new(&model.rod, &rest.state.q, &rest.kinematics, &model.drag, gravity)
        };
        let uncoupled: Vec<ModalResponse> = models.par_iter().zip(rest).enumerate().map(response).collect();
        let coupled = |(i, response): (usize, &ModalResponse)| {
            let mut response = response.clone();
            let leaders = hierarchy.leaders[i].iter();
            response.set_leaders(leaders.map(|(leader, share)| (*leader, *share, &uncoupled[*leader])));
            response
        };
        let responses = uncoupled.par_iter().enumerate().map(coupled).collect();
        ModalCorrection { responses, references }
    }

    /// Advances all responses from time `t[0]` to `t[1]`, s, in steps of `h`, s. `hair` opposes what a guide
    /// moves relative to its leaders.
    pub fn advance(
        &mut self,
        models: &[GuideModel],
        hierarchy: &Hierarchy,
        hair: impl Fn(usize) -> NeighbourDrag + Sync,
        env: &Environment,
        t: [f64; 2],
        h: f64,
    ) {
        let steps = ((t[1] - t[0]) / h).round() as u32;
        let of = |(root, rest): (Option<&RootBinding>, &RestExcitation)| -> Vec<HeadExcitation> {
            let at =
                |k: u32| excitation(env, root, t[1] - f64::from(steps - k) * h, h).minus(&rest.excitation);
            (1..=steps).map(at).collect()
        };
        let ModalCorrection { references, responses } = self;
        let excitations: Vec<Vec<HeadExcitation>> =
            roots(models).into_par_iter().zip(&*references).map(of).collect();
        let level = &hierarchy.level;
        let deepest = level.iter().copied().max().unwrap_or(0);
        let mut rates = vec![ModalRates::default(); responses.len()];
        for k in 0..steps as usize {
            for l in 0..=deepest {
                let of_level = responses.par_iter_mut().enumerate().filter(|(i, _)| level[*i] == l);
                of_level.for_each(|(i, response)| {
                    let of_root = &excitations[i.min(excitations.len() - 1)];
                    response.step(&of_root[k], h, &hair(i), &rates);
                });
                let of_level = rates.iter_mut().zip(&*responses).zip(level).filter(|(_, at)| **at == l);
                of_level.for_each(|((rates, response), _)| *rates = response.rates());
            }
        }
        responses.par_iter_mut().for_each(ModalResponse::update_deflection);
    }

    /// Moves each guide apart from its leaders through a frame of `steps` steps of `h`, s, under `forces` that
    /// these do not have: none for guides that do not follow. `hair` opposes what a guide moves relative to its
    /// leaders.
    pub fn move_apart(
        &mut self,
        forces: &[Vec<ForceApart>],
        hair: impl Fn(usize) -> NeighbourDrag + Sync,
        h: f64,
        steps: usize,
    ) {
        let all = self.responses.par_iter_mut().zip(forces).enumerate();
        all.for_each(|(i, (response, forces))| match &forces[..] {
            [] => response.rejoin(),
            forces => response.move_apart(forces, &hair(i), h, steps),
        });
    }

    /// Normalised strain by which guide `i` is apart from its leaders.
    pub fn strain_apart(&self, i: usize) -> Vec<Vector3<f64>> {
        self.responses[i].strain_apart()
    }

    /// The modal response of guide `i`.
    pub fn deflection(&self, i: usize) -> &Deflection {
        self.responses[i].deflection()
    }

    /// The state for a checkpoint.
    pub fn state(&self) -> ModalCorrectionState {
        ModalCorrectionState {
            references: self.references.clone(),
            modes: self.responses.iter().map(|response| response.mode_states().map(<[_]>::to_vec)).collect(),
        }
    }

    /// Restores the responses of the same guides at the same `rest`.
    ///
    /// # Errors
    /// [`StateMismatch`] if `state` is of other guides.
    pub fn restored(
        state: ModalCorrectionState,
        models: &[GuideModel],
        hierarchy: &Hierarchy,
        rest: &[RestShape],
    ) -> Result<Self, StateMismatch> {
        StateMismatch::unless_same("modal responses", state.modes.len(), rest.len())?;
        if rest.is_empty() {
            return Ok(ModalCorrection::default());
        }
        StateMismatch::unless_same("excitations", state.references.len(), roots(models).len())?;
        let mut correction = ModalCorrection::at_rest(models, hierarchy, rest, state.references);
        for (response, modes) in correction.responses.iter_mut().zip(state.modes) {
            for (saved, own) in modes.iter().zip(response.mode_states()) {
                StateMismatch::unless_same("modes", saved.len(), own.len())?;
            }
            response.restore(modes);
        }
        Ok(correction)
    }
}
