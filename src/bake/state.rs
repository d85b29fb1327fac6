//! What is kept of a bake between processes: the state of the guides at a frame, and that of the whole simulation.

use super::guide::Guide;
use super::record::FrameRecord;
use super::wisps::slope;
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};

/// A part of the simulation that a checkpoint holds.
///
/// Construction from the scene gives what does not change; `State` is all else that a later bit depends on. A simulation
/// that is constructed anew and given its state goes on as the one that the state was taken of, bit for bit.
pub trait Part {
    /// The state, as it is written.
    type State: Serialize + DeserializeOwned;

    /// The state now.
    fn state(&self) -> Self::State;

    /// Goes back to a state of the same scene.
    ///
    /// # Errors
    /// [`Unfit`] where it is of another; then the part is in no defined state.
    fn restore(&mut self, state: Self::State) -> Result<(), Unfit>;
}

/// Why a state cannot be taken over.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("it holds {found} {what} where the scene has {expected}")]
pub struct Unfit {
    /// Of what there are too many or too few.
    pub what: &'static str,
    /// How many the state holds.
    pub found: usize,
    /// How many the scene has.
    pub expected: usize,
}

impl Unfit {
    /// Nothing if the numbers are the same.
    ///
    /// # Errors
    /// [`Unfit`] if not.
    pub fn unless_same(what: &'static str, found: usize, expected: usize) -> Result<(), Unfit> {
        if found == expected { Ok(()) } else { Err(Unfit { what, found, expected }) }
    }
}

impl<P: Part> Part for Vec<P> {
    type State = Vec<P::State>;

    fn state(&self) -> Self::State {
        self.iter().map(P::state).collect()
    }

    fn restore(&mut self, state: Self::State) -> Result<(), Unfit> {
        Unfit::unless_same("parts", state.len(), self.len())?;
        self.iter_mut().zip(state).try_for_each(|(part, state)| part.restore(state))
    }
}

/// A part that there may be or not.
impl<P: Part> Part for Option<P> {
    type State = Option<P::State>;

    fn state(&self) -> Self::State {
        self.as_ref().map(P::state)
    }

    fn restore(&mut self, state: Self::State) -> Result<(), Unfit> {
        match (self, state) {
            (Some(part), Some(state)) => part.restore(state),
            (None, None) => Ok(()),
            (part, state) => {
                Err(Unfit { what: "parts", found: state.iter().count(), expected: part.iter().count() })
            }
        }
    }
}

/// The guides at a frame: all that interpolation needs of the simulation, and its figures.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct FrameState {
    /// What the frame's sub-steps did.
    pub record: FrameRecord,
    /// The instruction set that it was simulated with.
    pub machine: String,
    /// The guides, in the groom's order.
    pub guides: Vec<GuideState>,
    /// Where the solver brought them on the way from the frame before, where that is written.
    pub steps: Vec<Step>,
}

/// The guides between two frames.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Step {
    /// When, s.
    pub time: f64,
    /// The guides, in the groom's order; rates are those of the step that led there.
    pub guides: Vec<GuideState>,
}

/// A guide at a frame.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct GuideState {
    /// Deviation of the strain at its nodes, 1/m (the rod's unknowns).
    pub q: Vec<f64>,
    /// Rate of `q`, 1/(m·s).
    pub rate: Vec<f64>,
    /// Level of the wisp that it moves with, 0 for a coarse one.
    pub level: u32,
}

impl Step {
    /// Of guides that all move by themselves.
    pub(super) fn new(time: f64, guides: &[Guide]) -> Self {
        let state = |g: &Guide| GuideState { q: g.q[0].clone(), rate: g.rate().to_vec(), level: 0 };
        Step { time, guides: guides.iter().map(state).collect() }
    }
}

impl GuideState {
    /// A guide by its unknowns `q` now, and one and two sub-steps of `h`, s, ago, 1/m; the rate is of second order.
    pub fn new(q: [&[f64]; 3], h: f64, level: u32) -> Self {
        let rate = (0..q[0].len()).map(|i| slope(q.map(|q| q[i]), h)).collect();
        GuideState { q: q[0].to_vec(), rate, level }
    }

    /// The guide between two frames, `interval`, s, apart, at the share `u` of the way: cubic in time, with the rates of both ends; of the first one's level.
    pub fn between(a: &Self, b: &Self, u: f64, interval: f64) -> Self {
        // Of the cubic Hermite basis: the step, and the slopes at its start and end; then their derivatives.
        let (step, start, end) = (u * u * (3.0 - 2.0 * u), u * (1.0 - u) * (1.0 - u), u * u * (u - 1.0));
        let (d_step, d_start, d_end) =
            (6.0 * u * (1.0 - u), (1.0 - u) * (1.0 - 3.0 * u), u * (3.0 * u - 2.0));
        let at = |i: usize, step: f64, start: f64, end: f64| {
            (b.q[i] - a.q[i]) * step + (a.rate[i] * start + b.rate[i] * end) * interval
        };
        GuideState {
            q: (0..a.q.len()).map(|i| a.q[i] + at(i, step, start, end)).collect(),
            rate: (0..a.q.len()).map(|i| at(i, d_step, d_start, d_end) / interval).collect(),
            level: a.level,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cubic_in_time_is_met_between_frames_with_its_rate() {
        let cubic = |t: f64| (2.0 - 3.0 * t + 5.0 * t * t - 4.0 * t * t * t, -3.0 + 10.0 * t - 12.0 * t * t);
        let state = |t: f64| GuideState { q: vec![cubic(t).0], rate: vec![cubic(t).1], level: 0 };
        let (from, interval) = (0.3, 1.0 / 24.0);
        for u in [0.0, 0.25, 0.5, 0.999, 1.0] {
            let found = GuideState::between(&state(from), &state(from + interval), u, interval);
            let wanted = cubic(from + u * interval);
            assert!((found.q[0] - wanted.0).abs() < 1e-13 && (found.rate[0] - wanted.1).abs() < 1e-11, "{u}");
        }
    }
}
