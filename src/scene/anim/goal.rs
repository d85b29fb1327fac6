//! Animated curves that guides are pulled to.

use super::file::GoalSpace;
use crate::math::sample_times::SampleTimes;
use crate::math::smoothstep;
use crate::scene::keyframes::Keyframes;
use nalgebra::{SVector, Vector3};
use std::sync::Arc;

/// Share of a strand's length over which its weight falls beyond the part that is held hard, at most; less
/// where that part is shorter.
const TRANSITION: f64 = 0.15;

/// A goal: curves with the guides that they lead.
#[derive(Debug, Clone)]
pub struct Goal {
    /// Unique name.
    pub name: String,
    /// Names of the groups whose guides are pulled; `None` for all.
    pub groups: Option<Vec<String>>,
    /// Id of the guide of each curve; `None` for the guides of the groups in the groom's order.
    pub ids: Option<Vec<i32>>,
    /// The space of the curves.
    pub space: GoalSpace,
    /// The curves.
    pub curves: Arc<GoalCurves>,
    /// How firmly guides are pulled.
    pub pull: Arc<GoalPull>,
    /// The guide of each curve, by its index in the groom; empty until the goal is matched with one.
    pub guides: Vec<usize>,
}

/// Animated curves.
#[derive(Debug, Clone, PartialEq)]
pub struct GoalCurves {
    /// Times of the samples.
    pub times: SampleTimes,
    /// Start of each curve in a sample, then the number of points.
    pub offsets: Vec<usize>,
    /// Points of each sample, m, curve after curve, root first.
    pub samples: Vec<Vec<Vector3<f64>>>,
}

impl GoalCurves {
    /// Number of curves.
    pub fn len(&self) -> usize {
        self.offsets.len() - 1
    }

    /// True if there is no curve.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The points of curve `c` in a sample, m.
    pub fn points(&self, c: usize, sample: usize) -> &[Vector3<f64>] {
        &self.samples[sample][self.offsets[c]..self.offsets[c + 1]]
    }

    /// The points of curve `c` at time `t`, s, held before the first and after the last sample; m.
    pub fn points_at(&self, c: usize, t: f64) -> Vec<Vector3<f64>> {
        let weights = self.times.weights(self.times.clamp(t));
        let point = |k| weights.iter().map(|(sample, w)| self.samples[sample][k] * w).sum();
        (self.offsets[c]..self.offsets[c + 1]).map(point).collect()
    }
}

/// How firmly guides are pulled to a goal, over time and along the strand.
#[derive(Debug, Clone, PartialEq)]
pub struct GoalPull {
    /// Weight over time, 0 to 1.
    pub weight: Keyframes<1>,
    /// Weight along the strand, 0 to 1; the times of its keys are shares of the length.
    pub along: Keyframes<1>,
    /// Share of the length, over time, from the root to which the weight along the strand is 1.
    pub hard_to: Keyframes<1>,
    /// Angular frequency of the springs on the points of a strand of weight ½, rad/s.
    pub omega: f64,
    /// Damping relative to the goal, as a share of critical damping.
    pub damping: f64,
}

impl GoalPull {
    /// Weight at time `t`, s, as a function of the share of the length.
    pub fn at(&self, t: f64) -> impl Fn(f64) -> f64 + '_ {
        let (weight, hard) = (self.weight.at(t).x, self.hard_to.at(t).x);
        let end = hard + TRANSITION.min(hard);
        move |u| {
            let held = if u <= hard && hard > 0.0 {
                1.0
            } else if u < end {
                1.0 - smoothstep([hard, end], u)
            } else {
                0.0
            };
            weight * held.max(self.along.at(u).x)
        }
    }

    /// The time after which it first pulls, s; `None` if it never does.
    pub fn since(&self) -> Option<f64> {
        let pulls = |value: &SVector<f64, 1>| value.x > 0.0;
        let along = self.along.values.iter().any(pulls).then_some(f64::NEG_INFINITY);
        let first = |keys: &Keyframes<1>| {
            let first = keys.values.iter().position(pulls)?;
            Some(if first == 0 { f64::NEG_INFINITY } else { keys.times[first - 1] })
        };
        let hard = first(&self.hard_to);
        let along = along.or(hard)?.min(hard.unwrap_or(f64::INFINITY));
        Some(first(&self.weight)?.max(along))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn keys(times: &[f64], values: &[f64]) -> Keyframes<1> {
        Keyframes { times: times.to_vec(), values: values.iter().map(|x| SVector::from([*x])).collect() }
    }

    fn constant(x: f64) -> Keyframes<1> {
        Keyframes::constant(SVector::from([x]))
    }

    #[test]
    fn weights_are_products_and_the_hard_part_ends_smoothly() {
        let pull = GoalPull {
            weight: keys(&[1.0, 2.0], &[0.0, 1.0]),
            along: keys(&[0.0, 1.0], &[0.2, 0.1]),
            hard_to: constant(0.4),
            omega: 1.0,
            damping: 1.0,
        };
        assert_eq!([0.0, 0.3, 0.9].map(pull.at(0.5)), [0.0; 3]);
        let full = pull.at(3.0);
        assert_eq!([0.0, 0.4].map(&full), [1.0; 2]);
        assert!(full(0.45) < 1.0 && full(0.45) > full(0.5) && (full(1.0) - 0.1).abs() < 1e-15);
        assert!((pull.at(1.5)(0.2) - 0.5).abs() < 1e-12);
        // Where nothing is hard, there is no transition.
        let soft = GoalPull { hard_to: constant(0.0), ..pull.clone() };
        assert!((soft.at(3.0)(0.0) - 0.2).abs() < 1e-15);
        assert_eq!(GoalPull { hard_to: constant(1.0), ..pull.clone() }.at(3.0)(1.0), 1.0);
    }

    #[test]
    fn no_weight_leaves_its_range_by_rounding() {
        let rising = keys(&[0.0, 1.0], &[0.0, 1.0]);
        let falling = keys(&[0.0, 1.0], &[1.0, 0.0]);
        let along = |along: &Keyframes<1>| GoalPull {
            weight: rising.clone(),
            along: along.clone(),
            hard_to: constant(0.0),
            omega: 1.0,
            damping: 1.0,
        };
        // Next to a key, the polynomial between the keys is beyond it by some roundings.
        let mut u = 1.0_f64;
        for _ in 0..100 {
            u = u.next_down();
            for pull in [along(&rising), along(&falling)] {
                assert!((0.0..=1.0).contains(&pull.at(u)(u)), "{u}: {}", pull.at(u)(u));
            }
        }
    }

    #[test]
    fn a_goal_pulls_from_the_key_before_the_first_weight_on() {
        let pull = |weight: Keyframes<1>, along: f64, hard_to| GoalPull {
            weight,
            along: constant(along),
            hard_to,
            omega: 1.0,
            damping: 1.0,
        };
        let late = || keys(&[1.0, 2.0, 3.0], &[0.0, 0.0, 1.0]);
        assert_eq!(pull(late(), 1.0, constant(0.0)).since(), Some(2.0));
        assert_eq!(pull(constant(0.5), 0.0, late()).since(), Some(2.0));
        assert_eq!(pull(constant(0.5), 0.1, late()).since(), Some(f64::NEG_INFINITY));
        assert_eq!(pull(constant(0.0), 1.0, constant(1.0)).since(), None);
        assert_eq!(pull(constant(1.0), 0.0, constant(0.0)).since(), None);
    }

    #[test]
    fn curves_are_held_beyond_their_samples() {
        let sample = |x: f64| vec![Vector3::zeros(), Vector3::x() * x];
        let curves = GoalCurves {
            times: SampleTimes { start: 1.0, rate: 24.0, count: 3 },
            offsets: vec![0, 2],
            samples: vec![sample(1.0), sample(2.0), sample(3.0)],
        };
        let tip = |t: f64| curves.points_at(0, t)[1].x;
        for (t, x) in [(0.0, 1.0), (1.0, 1.0), (1.0 + 1.0 / 48.0, 1.5), (9.0, 3.0)] {
            assert!((tip(t) - x).abs() < 1e-12, "{t}: {}", tip(t));
        }
    }
}
