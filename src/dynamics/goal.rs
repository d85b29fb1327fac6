//! Animated goals of guides: poses of the rod over time (`docs/theory.md` §4.1).

use crate::math::sample_times::SampleTimes;
use crate::math::se3::Pose;
use crate::math::spline::ArcSpline;
use crate::rod::{Fit, Rod};
use crate::scene::anim::{Goal, GoalCurves, GoalPull, GoalSpace};
use nalgebra::{Matrix3, Vector3};
use std::sync::Arc;

/// Samples before the first and after the last in which its pose is repeated: the motion starts from rest,
/// and comes to rest, between two of them.
const HELD: usize = 3;

/// The animated goal of a guide.
#[derive(Debug, Clone)]
pub struct AnimatedGoal {
    /// How firmly it pulls.
    pub pull: Arc<GoalPull>,
    /// Factor on the weight: that of the material and of the guide.
    share: f64,
    /// The time after which it pulls, s.
    since: f64,
    /// Times of `q`.
    times: SampleTimes,
    /// The rod's unknowns in the pose of each sample, 1/m.
    q: Vec<Vec<f64>>,
    /// Stiffness of each unknown at weight ½, N·m³.
    pub(super) hold: Vec<f64>,
    curve: GoalCurve,
}

/// The curve that a guide follows.
#[derive(Debug, Clone)]
struct GoalCurve {
    curves: Arc<GoalCurves>,
    index: usize,
    space: GoalSpace,
}

impl AnimatedGoal {
    /// The goal of `rod`, which curve `curve` of `goal` leads; `share` is the factor on its weight, and
    /// `root` the world pose of the rod's root at a time in s. `None` if it never pulls.
    pub fn new(rod: &Rod, goal: &Goal, curve: usize, share: f64, root: impl Fn(f64) -> Pose) -> Option<Self> {
        let since = goal.pull.since().filter(|_| share > 0.0)?;
        let curve = GoalCurve { curves: goal.curves.clone(), index: curve, space: goal.space };
        let times = curve.curves.times;
        let (mut fit, mut pose) = (Fit::default(), rod.initial_q.clone());
        // Samples long before it pulls need no pose.
        let first =
            ((since - times.start) * times.rate).clamp(HELD as f64, times.count as f64 - 1.0 + HELD as f64);
        let first = first as usize - HELD;
        let mut q = Vec::with_capacity(times.count + 2 * HELD);
        for sample in first..times.count {
            let t = times.time(sample);
            let points = curve.at(rod, curve.points(sample), &curve.frame(rod, &root(t)));
            if sample == first {
                fit.find(rod, &points, &mut pose);
            } else {
                fit.follow(rod, &points, &mut pose);
            }
            let again = if sample == first { first + HELD + 1 } else { 1 };
            q.extend(std::iter::repeat_n(pose.clone(), again));
        }
        q.extend(std::iter::repeat_n(pose, HELD));
        let times = SampleTimes { start: times.start - HELD as f64 / times.rate, count: q.len(), ..times };
        Some(AnimatedGoal {
            pull: goal.pull.clone(),
            share,
            since,
            times,
            q,
            hold: rod.hold_stiffness(),
            curve,
        })
    }

    /// Sets `q` to the rod's unknowns in the goal pose at time `t`, s.
    pub fn unknowns(&self, t: f64, q: &mut Vec<f64>) {
        q.clear();
        q.resize(self.hold.len(), 0.0);
        for (sample, weight) in self.times.weights(t).iter() {
            q.iter_mut().zip(&self.q[sample]).for_each(|(q, x)| *q += x * weight);
        }
    }

    /// Weight at time `t`, s, as a function of the share of the length.
    pub fn weight(&self, t: f64) -> impl Fn(f64) -> f64 + '_ {
        let weight = self.pull.at(t);
        move |u| self.share * weight(u)
    }

    /// True if it has pulled at any time before `t`, s.
    pub fn has_pulled(&self, t: f64) -> bool {
        t > self.since
    }

    /// Where the curve itself has the points of the rod at time `t`, s, relative to the root; m, world axes.
    /// `root` is the world pose of the root at a time in s. Beyond its samples the curve is carried by the
    /// root.
    pub fn points(&self, rod: &Rod, root: impl Fn(f64) -> Pose, t: f64) -> Vec<Vector3<f64>> {
        let GoalCurve { curves, index, .. } = &self.curve;
        let sampled = curves.times.clamp(t);
        let points = curves.points_at(*index, sampled);
        let (then, now) = (self.curve.frame(rod, &root(sampled)), root(t).r);
        self.curve.at(rod, &points, &then).iter().map(|x| now * x).collect()
    }
}

impl GoalCurve {
    fn points(&self, sample: usize) -> &[Vector3<f64>] {
        self.curves.points(self.index, sample)
    }

    /// The frame of the root in the space of the curve; `root` is its world pose.
    fn frame(&self, rod: &Rod, root: &Pose) -> Matrix3<f64> {
        match self.space {
            GoalSpace::World => root.r,
            GoalSpace::Rest => rod.root.r,
        }
    }

    /// The places at the arc lengths of the rod's points on the curve through `points`, moved to the root and
    /// seen in the frame `root` there, m. The last tangent continues the curve.
    fn at(&self, rod: &Rod, points: &[Vector3<f64>], root: &Matrix3<f64>) -> Vec<Vector3<f64>> {
        // A curve that vanishes at some time is refused when it is read.
        let Some(spline) = ArcSpline::through(points) else { return vec![Vector3::zeros(); rod.points()] };
        let place = |s: &f64| {
            let at = spline.at(*s);
            root.transpose() * (at.x + at.tangent * (s - spline.length()).max(0.0) - points[0])
        };
        rod.arc.iter().map(place).collect()
    }
}
