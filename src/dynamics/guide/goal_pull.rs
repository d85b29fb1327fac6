//! The pull of an animated goal within one step (`docs/theory.md` §4.1).

use super::goal_scratch::GoalScratch;
use super::model::GuideModel;
use super::scratch::GuideScratch;
use super::state::GuideState;
use crate::dynamics::environment::Environment;
use crate::dynamics::goal::AnimatedGoal;
use crate::dynamics::integrator::DifferenceFormula;
use crate::math::se3::Pose;
use crate::rod::potential::StrainSpring;
use std::ops::{Add, Mul, Sub};

/// Largest stiffness of a strain spring over that at weight ½. The strain is then the goal's to a hundred
/// millionth of what its weight does to the strand.
const STIFFEST_STRAIN: f64 = 1e8;

/// Largest stiffness of a spring on a point over that at weight ½: strains hold a strand where its weight is
/// 1 from the root on; points, where it is not.
const STIFFEST_POINT: f64 = 1e4;

/// What the springs of one step have in common.
struct SpringStep<'a> {
    goal: &'a AnimatedGoal,
    formula: &'a DifferenceFormula,
    /// Length of the step, s.
    h: f64,
    /// Length of the step before, s.
    before: f64,
}

/// A spring that pulls a quantity.
struct GoalSpringStep<T> {
    /// Stiffness over that at weight ½.
    stiffness: f64,
    /// Where it pulls to, relative to the goal at the end of the step.
    target: T,
    /// Share of the way to there that a free body is pulled within the step.
    firm: f64,
}

/// A quantity of the guide over a step.
struct Motion<T> {
    /// At the start of the step.
    now: T,
    /// One step before.
    back: T,
    /// y* of the difference formula.
    star: T,
}

impl SpringStep<'_> {
    /// The spring of weight `weight` that pulls a quantity, at most `most` times as stiff as at weight ½.
    /// `goal` is the goal at the start of the step and of the steps before, newest first.
    fn spring<T>(
        &self,
        weight: f64,
        most: f64,
        guide: &Motion<T>,
        goal: [T; DifferenceFormula::PAST],
    ) -> GoalSpringStep<T>
    where
        T: Copy + Add<Output = T> + Sub<Output = T> + Mul<f64, Output = T>,
    {
        let SpringStep { goal: AnimatedGoal { pull, .. }, formula, h, before } = *self;
        if weight == 0.0 {
            return GoalSpringStep { stiffness: 0.0, target: guide.star * 0.0, firm: 0.0 };
        }
        let stiffness = (weight / (1.0 - weight)).min(most);
        let omega = pull.omega * stiffness.sqrt();
        // A deviation is not taken away at once, but dies away as a critically damped spring of weight ½ lets
        // it: as (a + b t) exp(−ω t) through its values now and one step before.
        let [a, back] = [guide.now - goal[0], guide.back - goal[1]];
        let b = (a - back * (-pull.omega * before).exp()) * (1.0 / before);
        let dying = (a + b * h) * (-pull.omega * h).exp();
        let firm = (omega * h).powi(2);
        let firm = firm / (1.0 + firm);
        // Damping of the motion relative to the goal.
        let damped = 2.0 * pull.damping / (omega * formula.eta);
        let star = guide.star - formula.y_star(goal);
        let target = (dying * firm + star * damped) * (1.0 / (1.0 + damped));
        GoalSpringStep { stiffness: stiffness * (1.0 + damped), target, firm }
    }
}

impl GuideModel {
    /// The rod's unknowns at the start, at time `t`, s: the groom's pose, or the goal's by its weight.
    pub(super) fn start_unknowns(&self, t: f64) -> Vec<f64> {
        let mut q = self.rod.initial_q.clone();
        if let Some(goal) = &self.animated_goal {
            let (mut pose, weight) = (Vec::new(), goal.weight(t));
            goal.unknowns(t, &mut pose);
            for (i, s) in self.rod.nodes[..q.len() / 3].iter().enumerate() {
                let weight = weight(s / self.rod.length());
                (3 * i..3 * i + 3).for_each(|a| q[a] += (pose[a] - q[a]) * weight);
            }
        }
        q
    }

    /// True if the guide has a load, or an animated goal has pulled it at any time before `t`, s.
    pub(in crate::dynamics) fn was_pulled(&self, t: f64) -> bool {
        !self.loads.is_empty() || self.animated_goal.as_ref().is_some_and(|goal| goal.has_pulled(t))
    }

    /// Adds the pull of the animated goal to the load of the step from `t0` to `t1`, s, that ends with the
    /// root at `root`, and moves the unknowns that its solve starts from. Returns whether there is any; the
    /// weights of the points are then in `scratch`.
    pub(super) fn pull_to_goal(
        &self,
        env: &Environment,
        state: &GuideState,
        [t0, t1]: [f64; 2],
        formula: &DifferenceFormula,
        root: &Pose,
        scratch: &mut GuideScratch,
    ) -> bool {
        let Some(goal) = self.animated_goal.as_ref().filter(|goal| goal.has_pulled(t1)) else { return false };
        let (rod, weight) = (&self.rod, goal.weight(t1));
        let GoalScratch { poses, guide, shape, weights } = &mut scratch.goal;
        weights.clear();
        weights.extend(rod.arc.iter().map(|s| weight(s / rod.length())));
        if weights.iter().all(|w| *w == 0.0) {
            return false;
        }
        let step = SpringStep { goal, formula, h: t1 - t0, before: state.solve_step() };
        // A formula that looks back over more than one step is one of equal steps.
        let back = step.before;
        let times = [t1, t0, t0 - back, t0 - 2.0 * back, t0 - 3.0 * back];
        for (pose, t) in poses.iter_mut().zip(times) {
            goal.unknowns(t, &mut pose.q);
        }
        guide.q.clear();
        guide.q.extend(state.q[0].iter().zip(state.rate()).map(|(q, rate)| q - rate * step.before));
        for (pose, t) in poses.iter_mut().zip(times).chain([(&mut *guide, times[2])]) {
            let root_then = self.root(env, t);
            shape.update(rod, &root_then.r, &pose.q);
            pose.x.clear();
            pose.x.extend((0..rod.points()).map(|k| shape.x(k) + (root_then.p - root.p)));
        }
        let [end, past @ ..] = &*poses;
        for (k, of_point) in weights.iter().enumerate().skip(1) {
            let motion = Motion {
                now: state.x[k] - root.p,
                back: guide.x[k],
                star: state.formula_values(k, formula, &root.p).1,
            };
            let GoalSpringStep { stiffness, target, .. } =
                step.spring(*of_point, STIFFEST_POINT, &motion, past.each_ref().map(|pose| pose.x[k]));
            let own = rod.mass[k] * goal.pull.omega.powi(2);
            scratch.load.add_spring(k, &(end.x[k] + target), own * stiffness);
        }
        let GuideScratch { q, q_star, load, .. } = scratch;
        let unknowns = q.iter_mut().zip(state.q[0].iter().zip(&guide.q).zip(&*q_star));
        let springs = unknowns.enumerate().map(|(a, (q, ((now, back_q), star)))| {
            let weight = weight(rod.nodes[a / 3] / rod.length());
            let motion = Motion { now: *now, back: *back_q, star: *star };
            let GoalSpringStep { stiffness, target, firm } =
                step.spring(weight, STIFFEST_STRAIN, &motion, past.each_ref().map(|pose| pose.q[a]));
            let target = end.q[a] + target;
            // The solve starts near its end.
            *q += (target - *q) * firm;
            StrainSpring { stiffness: goal.hold[a] * stiffness, target }
        });
        load.hold(springs);
        true
    }
}
