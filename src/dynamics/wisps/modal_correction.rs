//! By how much guides that follow swing otherwise than those that lead them, as far as these differ from each other as they swing (`docs/theory.md` eqs. 8.3 to
//! 8.5).

use super::{Environment, Means, Rest};
use crate::dynamics::checkpoint::StateMismatch;
use crate::dynamics::guide::GuideModel;
use crate::wisp::{Deflection, HeadExcitation, ModalResponse, ModeState};
use nalgebra::Vector3;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

/// Time for which it counts whether leaders differed as they swing, s: longer is steadier, and later to learn that hair met a body.
const WINDOW: f64 = 0.5;

/// How much the swing of a guide that is its own counts against what its leaders' swings told: more trusts these less where they are more alike than it is to
/// them. At 0 some long hair, whose leaders meet bodies, is thrown about (points at over 100 m/s² where they have 20).
const DOUBT: f64 = 3.0;

/// Guides as they swing from where they rest.
#[derive(Default)]
pub(super) struct ModalCorrection {
    still: Still,
    swings: Vec<ModalResponse>,
}

/// What shook the guides when they rested.
#[derive(Debug, Clone, Default, Serialize, Deserialize)]
struct Still {
    shake: HeadExcitation,
    /// What pulled them, m/s², rest space.
    pull: Vector3<f64>,
}

/// Whether those that lead a guide differ from each other as their swings do: sums over them and over time, without unit.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub(super) struct Agreement {
    /// Of what they do times what their swings do, both otherwise than their mean.
    told: f64,
    /// Of the squares of the latter, and of what the guide itself swings otherwise.
    asked: f64,
}

impl Agreement {
    /// ν, from 0 to 1: the share of what it swings otherwise that a guide is given.
    pub fn share(&self) -> f64 {
        if self.told > 0.0 { (self.told / self.asked).min(1.0) } else { 0.0 }
    }

    /// Learns after a frame of that duration, s, from leaders of these shares, how they are turned and how they swing, their means, and how the guide itself
    /// swings.
    pub fn learn<'a>(
        &mut self,
        frame: f64,
        leaders: impl Iterator<Item = (f64, &'a Deflection, &'a Deflection)>,
        own: &Deflection,
        means: &Means,
    ) {
        let kept = (-frame / WINDOW).exp();
        (self.told, self.asked) = (kept * self.told, kept * self.asked);
        let apart = |of: &Deflection, mean: &Deflection| {
            let numbers = of.displacement().iter().zip(mean.displacement());
            numbers.map(|(of, mean)| of - mean).collect::<Vec<f64>>()
        };
        self.asked += DOUBT * apart(own, &means.modal).iter().map(|x| x * x).sum::<f64>();
        for (share, turned, swung) in leaders {
            for (told, asked) in apart(turned, &means.deflection).iter().zip(&apart(swung, &means.modal)) {
                self.told += share * told * asked;
                self.asked += share * asked * asked;
            }
        }
    }
}

/// What shakes the guides at time `t`, s, of steps of `h`, s.
fn shake(env: &Environment, t: f64, h: f64) -> HeadExcitation {
    let heads = std::array::from_fn(|back| (env.head)(t - back as f64 * h));
    HeadExcitation::new(&heads, h, &(env.gravity)(t))
}

impl ModalCorrection {
    /// Of `guides` at `rest` at time `t`, s, of steps of `h`, s.
    pub fn new(models: &[GuideModel], rest: &[Rest], env: &Environment, t: f64, h: f64) -> Self {
        let pull = (env.head)(t).rotation.inverse() * (env.gravity)(t);
        ModalCorrection::at_rest(models, rest, Still { shake: shake(env, t, h), pull })
    }

    fn at_rest(models: &[GuideModel], rest: &[Rest], still: Still) -> Self {
        let swing = |(model, rest): (&GuideModel, &Rest)| {
            ModalResponse::new(&model.rod, &rest.settled.q, &rest.reach, &model.drag, &still.pull)
        };
        ModalCorrection { swings: models.par_iter().zip(rest).map(swing).collect(), still }
    }

    /// ModalCorrection all guides through the frame from time `t[0]` to `t[1]`, s, in steps of `h`, s.
    pub fn advance(&mut self, env: &Environment, t: [f64; 2], h: f64) {
        let steps = ((t[1] - t[0]) / h).round() as u32;
        let at = |k: u32| shake(env, t[1] - f64::from(steps - k) * h, h).minus(&self.still.shake);
        let shakes: Vec<HeadExcitation> = (1..=steps).map(at).collect();
        self.swings.par_iter_mut().for_each(|swing| swing.advance(&shakes, h));
    }

    /// The modal response of guide `j`.
    pub fn deflection(&self, j: usize) -> &Deflection {
        self.swings[j].deflection()
    }
}

/// What a checkpoint holds of swings.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub(super) struct Saved {
    still: Still,
    swung: Vec<Vec<ModeState>>,
}

impl ModalCorrection {
    /// What changes.
    pub fn state(&self) -> Saved {
        Saved {
            still: self.still.clone(),
            swung: self.swings.iter().map(|swing| swing.mode_states().to_vec()).collect(),
        }
    }

    /// Those of that state, of the same `guides` at the same `rest`.
    pub fn restored(state: Saved, models: &[GuideModel], rest: &[Rest]) -> Result<Self, StateMismatch> {
        StateMismatch::unless_same("swings", state.swung.len(), rest.len())?;
        if rest.is_empty() {
            return Ok(ModalCorrection::default());
        }
        let mut swings = ModalCorrection::at_rest(models, rest, state.still);
        for (swing, swung) in swings.swings.iter_mut().zip(state.swung) {
            StateMismatch::unless_same("modes", swung.len(), swing.mode_states().len())?;
            swing.restore(swung);
        }
        Ok(swings)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::wisp::LinearKinematics;

    /// ν after a while in which two leaders are turned `turned` and swing `swung` to either side of their mean, and the guide itself swings `own` beside it.
    fn share(turned: f64, swung: f64, own: f64) -> f64 {
        // Two nodes with equal strain about x at three moments, of a straight guide along y.
        let kinematics = LinearKinematics::new(&[0.0, 1.0, 2.0].map(|y| Vector3::y() * y), &[0.0, 1.0, 2.0]);
        let bent = |mean: f64, by: f64| {
            let mut deflection = Deflection::default();
            deflection.set(std::iter::repeat_n(Vector3::x() * (mean + by), 6), &kinematics);
            deflection
        };
        let leaders = [1.0, -1.0].map(|side| (0.5, bent(3.0, side * turned), bent(2.0, side * swung)));
        let means = Means { deflection: bent(3.0, 0.0), modal: bent(2.0, 0.0) };
        let mut agreement = Agreement::default();
        for _ in 0..48 {
            let leaders = leaders.iter().map(|(share, turned, swung)| (*share, turned, swung));
            agreement.learn(1.0 / 24.0, leaders, &bent(2.0, own), &means);
        }
        agreement.share()
    }

    #[test]
    fn swings_count_as_far_as_leaders_bear_them_out() {
        assert!((share(0.1, 0.1, 0.0) - 1.0).abs() < 1e-12);
        assert!((share(0.04, 0.1, 0.0) - 0.4).abs() < 1e-12);
        // What goes the other way, or nowhere, tells nothing.
        assert_eq!([share(-0.1, 0.1, 0.0), share(0.0, 0.1, 0.0), share(0.1, 0.0, 0.1)], [0.0; 3]);
        // No more than all, and less to what is further from them than they are from each other.
        assert_eq!(share(0.5, 0.1, 0.0), 1.0);
        assert!((share(0.1, 0.1, 0.1) - 1.0 / (1.0 + DOUBT)).abs() < 1e-12);
    }
}
