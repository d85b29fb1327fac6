//! By how much guides that follow swing otherwise than those that lead them, as far as these differ from each other as they swing (`docs/theory.md` eq. 8.4).

use super::{Rest, Surroundings, vectors};
use crate::bake::guide::Guide;
use crate::bake::state::Unfit;
use crate::wisp::{Shake, Swing, Swung};
use nalgebra::Vector3;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

/// Time for which it counts whether leaders differed as they swing, s: longer is steadier, and later to learn that hair met a body.
const WINDOW: f64 = 0.5;

/// How much the swing of a guide that is its own counts against what its leaders' swings told: more trusts these less where they are more alike than it is to
/// them. At 0 some long hair is swung through heads.
const DOUBT: f64 = 3.0;

/// Guides as they swing from where they rest.
#[derive(Default)]
pub(super) struct Swings {
    still: Still,
    swings: Vec<Swing>,
    agreements: Vec<Agreement>,
}

/// What shook the guides when they rested.
#[derive(Debug, Clone, Default, Serialize, Deserialize)]
struct Still {
    shake: Shake,
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
    fn share(&self) -> f64 {
        if self.told > 0.0 { (self.told / self.asked).min(1.0) } else { 0.0 }
    }
}

/// What shakes the guides at time `t`, s, of steps of `h`, s.
fn shake(around: &Surroundings, t: f64, h: f64) -> Shake {
    let heads = std::array::from_fn(|back| (around.head)(t - back as f64 * h));
    Shake::new(&heads, h, &(around.gravity)(t))
}

impl Swings {
    /// Of `guides` at `rest` at time `t`, s, of steps of `h`, s.
    pub fn new(guides: &[Guide], rest: &[Rest], around: &Surroundings, t: f64, h: f64) -> Self {
        let pull = (around.head)(t).rotation.inverse() * (around.gravity)(t);
        Swings::at_rest(guides, rest, Still { shake: shake(around, t, h), pull })
    }

    fn at_rest(guides: &[Guide], rest: &[Rest], still: Still) -> Self {
        let swing = |(guide, rest): (&Guide, &Rest)| {
            Swing::new(&guide.rod, &rest.settled.q, &guide.drag, &still.pull)
        };
        let swings = guides.par_iter().zip(rest).map(swing).collect();
        Swings { swings, agreements: vec![Agreement::default(); guides.len()], still }
    }

    /// Swings all guides through the frame from time `t[0]` to `t[1]`, s, in steps of `h`, s.
    pub fn advance(&mut self, around: &Surroundings, t: [f64; 2], h: f64) {
        let steps = ((t[1] - t[0]) / h).round() as u32;
        let at = |k: u32| shake(around, t[1] - f64::from(steps - k) * h, h).since(&self.still.shake);
        let shakes: Vec<Shake> = (1..=steps).map(at).collect();
        self.swings.par_iter_mut().for_each(|swing| swing.advance(&shakes, h));
        let kept = (-(t[1] - t[0]) / WINDOW).exp();
        for agreement in &mut self.agreements {
            (agreement.told, agreement.asked) = (agreement.told * kept, agreement.asked * kept);
        }
    }

    /// Learns how much the swings of those that lead guide `i`, by their shares, tell of it, which is `rest` at rest; they are turned as `turned` says.
    pub fn learn<'a>(
        &self,
        i: usize,
        leaders: &[(usize, f64)],
        rest: &Rest,
        turned: impl Fn(usize) -> &'a [f64],
    ) -> Agreement {
        let swung = |j: usize| self.turning(j, 0);
        let (mut mean, mut mean_swung) = (vec![0.0; swung(i).len()], vec![0.0; swung(i).len()]);
        add_mean(&mut mean, leaders, 1.0, &turned);
        add_mean(&mut mean_swung, leaders, 1.0, swung);
        let ways = |turned: &'_ [f64], mean: &[f64]| -> Vec<Vector3<f64>> {
            let apart = vectors(turned).zip(vectors(mean)).map(|(turned, mean)| turned - mean);
            rest.reach.ways(apart).map(|(way, _)| way).collect()
        };
        let dot =
            |a: &[Vector3<f64>], b: &[Vector3<f64>]| a.iter().zip(b).map(|(a, b)| a.dot(b)).sum::<f64>();
        let own = ways(swung(i), &mean_swung);
        let mut agreement = self.agreements[i];
        agreement.asked += DOUBT * dot(&own, &own);
        for &(j, share) in leaders {
            let [told, asked] = [ways(turned(j), &mean), ways(swung(j), &mean_swung)];
            agreement.told += share.abs() * dot(&told, &asked);
            agreement.asked += share.abs() * dot(&asked, &asked);
        }
        agreement
    }

    /// Notes what was learnt.
    pub fn note(&mut self, learnt: Vec<(usize, Agreement)>) {
        learnt.into_iter().for_each(|(i, agreement)| self.agreements[i] = agreement);
    }

    /// ν of guide `i`.
    pub fn share(&self, i: usize) -> f64 {
        self.agreements[i].share()
    }

    /// How guide `j` has swung `back` steps ago, as [`Turning`](super::Turning).
    pub fn turning(&self, j: usize, back: usize) -> &[f64] {
        &self.swings[j].turning[back]
    }
}

/// What a checkpoint holds of swings.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub(super) struct Saved {
    still: Still,
    swung: Vec<Vec<Swung>>,
    agreements: Vec<Agreement>,
}

impl Swings {
    /// What changes.
    pub fn state(&self) -> Saved {
        Saved {
            still: self.still.clone(),
            swung: self.swings.iter().map(|swing| swing.swung().to_vec()).collect(),
            agreements: self.agreements.clone(),
        }
    }

    /// Those of that state, of the same `guides` at the same `rest`.
    pub fn restored(state: Saved, guides: &[Guide], rest: &[Rest]) -> Result<Self, Unfit> {
        Unfit::unless_same("swings", state.swung.len(), rest.len())?;
        Unfit::unless_same("agreements", state.agreements.len(), rest.len())?;
        if rest.is_empty() {
            return Ok(Swings::default());
        }
        let mut swings = Swings::at_rest(guides, rest, state.still);
        swings.agreements = state.agreements;
        for (swing, swung) in swings.swings.iter_mut().zip(state.swung) {
            Unfit::unless_same("modes", swung.len(), swing.swung().len())?;
            swing.go_on(swung);
        }
        Ok(swings)
    }
}

/// Adds to `sum` the mean of what leaders are `turned`, by their shares, `times` so much.
pub(super) fn add_mean<'a>(
    sum: &mut [f64],
    leaders: &[(usize, f64)],
    times: f64,
    turned: impl Fn(usize) -> &'a [f64],
) {
    for &(leader, share) in leaders {
        sum.iter_mut().zip(turned(leader)).for_each(|(sum, turned)| *sum += times * share * turned);
    }
}
