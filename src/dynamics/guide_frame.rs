//! A guide as it is written: its unknowns and their rates at a frame, or between frames.

use super::guide::GuideState;
use super::integrator::backward_difference;
use serde::{Deserialize, Serialize};

/// The guides between two frames.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct SolverStep {
    /// When, s.
    pub time: f64,
    /// The guides, in the groom's order; rates are those of the step that led there.
    pub guides: Vec<GuideFrame>,
}

/// A guide at a frame.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct GuideFrame {
    /// Deviation of the strain at its nodes, 1/m (the rod's unknowns).
    pub q: Vec<f64>,
    /// Rate of `q`, 1/(m·s).
    pub rate: Vec<f64>,
    /// Level of the wisp that it moves with, 0 for a coarse one.
    pub level: u32,
}

impl SolverStep {
    /// Of guides that all move by themselves.
    pub(super) fn new(time: f64, states: &[GuideState]) -> Self {
        let frame = |g: &GuideState| GuideFrame { q: g.q[0].clone(), rate: g.rate().to_vec(), level: 0 };
        SolverStep { time, guides: states.iter().map(frame).collect() }
    }
}

impl GuideFrame {
    /// A guide by its unknowns `q` now, and one and two sub-steps of `h`, s, ago, 1/m; the rate is of second
    /// order.
    pub fn new(q: [&[f64]; 3], h: f64, level: u32) -> Self {
        let rate = (0..q[0].len()).map(|i| backward_difference(q.map(|q| q[i]), h)).collect();
        GuideFrame { q: q[0].to_vec(), rate, level }
    }

    /// The guide between two frames, `interval`, s, apart, at the share `u` of the way: cubic in time, with
    /// the rates of both ends; of the first one's level.
    pub fn between(a: &Self, b: &Self, u: f64, interval: f64) -> Self {
        // Of the cubic Hermite basis: the step, and the slopes at its start and end; then their derivatives.
        let (step, start, end) = (u * u * (3.0 - 2.0 * u), u * (1.0 - u) * (1.0 - u), u * u * (u - 1.0));
        let (d_step, d_start, d_end) =
            (6.0 * u * (1.0 - u), (1.0 - u) * (1.0 - 3.0 * u), u * (3.0 * u - 2.0));
        let at = |i: usize, step: f64, start: f64, end: f64| {
            (b.q[i] - a.q[i]) * step + (a.rate[i] * start + b.rate[i] * end) * interval
        };
        GuideFrame {
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
        let state = |t: f64| GuideFrame { q: vec![cubic(t).0], rate: vec![cubic(t).1], level: 0 };
        let (from, interval) = (0.3, 1.0 / 24.0);
        for u in [0.0, 0.25, 0.5, 0.999, 1.0] {
            let found = GuideFrame::between(&state(from), &state(from + interval), u, interval);
            let wanted = cubic(from + u * interval);
            assert!((found.q[0] - wanted.0).abs() < 1e-13 && (found.rate[0] - wanted.1).abs() < 1e-11, "{u}");
        }
    }
}
