//! The state of a guide in the wisp tree beside its motion.

use super::control_variate::ControlVariate;
use serde::{Deserialize, Serialize};

/// Time in which the deviation of a new follower from its leaders fades, and for which a guide must be calm
/// before it merges, s.
pub(super) const FADE_TIME: f64 = 0.25;

/// Whether a guide follows, and how it deviates from its leaders.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub(super) struct Follower {
    /// True if it follows its leaders.
    pub follows: bool,
    /// Start of following, s; for an active guide, the start of its calm period.
    pub since: f64,
    /// Deviation of its strains from its leaders' prediction when it merged, 1/m.
    pub offset: Vec<f64>,
    /// Rate of `offset` when it merged, 1/(m·s).
    pub offset_rate: Vec<f64>,
    /// How its leaders disagreed at `since`, with what was left out of its own modes
    /// ([`LeaderMotion::disagreement`](super::leader_motion::LeaderMotion)); empty if it has followed since all were at
    /// rest.
    pub disagreement: Vec<f64>,
    /// Strains that kept it out of the bodies at the end of the last frame, 1/m; empty if none.
    pub correction: Vec<f64>,
    /// Mean displacement by `correction`, as a share of its length; infinite if it is still inside a body.
    #[serde(skip)]
    pub relative_displacement: f64,
    /// How well its leaders' modal responses predict their motion.
    pub variate: ControlVariate,
}

impl Follower {
    /// Adds the faded deviation at time `t`, s, to unknowns `q`, 1/m. The rate is continuous.
    pub fn add_deviation(&self, t: f64, q: &mut [f64]) {
        let since = t - self.since;
        let u = (since / FADE_TIME).clamp(0.0, 1.0);
        let left = since * (1.0 - u * u * u * (10.0 - 15.0 * u + 6.0 * u * u));
        let deviation = self.offset.iter().zip(&self.offset_rate);
        q.iter_mut().zip(deviation).for_each(|(q, (offset, rate))| *q += offset + left * rate);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn deviation_of_a_new_follower_fades_with_continuous_rate() {
        let (offset, offset_rate) = (vec![0.1], vec![2.0]);
        let follower = Follower { follows: true, since: 1.0, offset, offset_rate, ..Follower::default() };
        let deviation = |t: f64| {
            let mut q = [0.0];
            follower.add_deviation(t, &mut q);
            q[0]
        };
        let rate = |t: f64| (deviation(t + 1e-6) - deviation(t)) / 1e-6;
        assert_eq!(deviation(1.0), 0.1);
        assert!((rate(1.0) - 2.0).abs() < 1e-4, "{}", rate(1.0));
        assert_eq!((deviation(1.0 + FADE_TIME), rate(1.0 + FADE_TIME)), (0.1, 0.0));
        let most =
            (0..=1000).map(|k| (rate(1.0 + FADE_TIME * f64::from(k) / 1000.0)).abs()).fold(0.0, f64::max);
        assert!(most < 2.01, "{most}");
    }
}
