//! A guide as it is written: its unknowns and their rates at a frame, or between frames.

use super::guide::GuideState;
use super::integrator::backward_difference;
use crate::rod::{Rod, RodShape, Sensitivity};
use nalgebra::{Matrix3, Vector3};
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

/// Turn of a rod within a sub-step, rad, up to which the rates of its unknowns are those of its points.
const RESOLVED_TURN: f64 = 0.3;

impl GuideFrame {
    /// The guide of `rod` by its unknowns `q` now, and one and two sub-steps of `h`, s, ago, 1/m; the rate is
    /// of second order, and of first order after an impact.
    pub fn new(rod: &Rod, q: [&[f64]; 3], h: f64, level: u32) -> Self {
        let mut rate = limited_rate(q, h);
        let share = share_of_motion(rod, q, &rate, h);
        rate.iter_mut().for_each(|rate| *rate *= share);
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

/// Rate of unknowns `q` now, and one and two sub-steps of `h`, s, ago, 1/(m·s): the last difference and a
/// correction of second order, no larger than half of that difference. An impact changes the rate by more
/// from one sub-step to the next than it is; extrapolated across it, hair that has landed would still fly.
fn limited_rate(q: [&[f64]; 3], h: f64) -> Vec<f64> {
    let of_all =
        |of: &dyn Fn([f64; 3]) -> f64| -> Vec<f64> { (0..q[0].len()).map(|i| of(q.map(|q| q[i]))).collect() };
    let last = of_all(&|[now, one, _]| now - one);
    let change = of_all(&|[now, one, two]| (now - one) - (one - two));
    let [last_size, change_size] = [&last, &change].map(|v| v.iter().map(|x| x * x).sum::<f64>().sqrt());
    if change_size <= last_size {
        return of_all(&|q| backward_difference(q, h));
    }
    let share = last_size / change_size;
    last.iter().zip(&change).map(|(last, change)| (last + 0.5 * share * change) / h).collect()
}

/// The share of `rate` with which the points of `rod` move as they did, in the least squares; 1 where the rod
/// turns little in a sub-step of `h`, s. When a curl snaps, twist turns the rod by radians while its points
/// hardly move: the derivative at the end of the sub-step is then no velocity of theirs.
fn share_of_motion(rod: &Rod, q: [&[f64]; 3], rate: &[f64], h: f64) -> f64 {
    let length = rod.arc.last().copied().unwrap_or_default();
    let fastest =
        rate.chunks(3).map(|node| node.iter().map(|r| r * r).sum::<f64>()).fold(0.0, f64::max).sqrt();
    if fastest * length * h <= RESOLVED_TURN {
        return 1.0;
    }
    let (mut shapes, mut sensitivity) = ([(); 3].map(|()| RodShape::default()), Sensitivity::default());
    for (shape, q) in shapes.iter_mut().zip(q) {
        shape.update(rod, &Matrix3::identity(), q);
    }
    sensitivity.update(rod, &shapes[0], q[0]);
    let [mut along, mut square] = [0.0; 2];
    for k in 0..rod.points() {
        let x = shapes.each_ref().map(|shape| shape.x(k));
        let moved = Vector3::from_fn(|axis, _| backward_difference(x.map(|x| x[axis]), h));
        let derivative = sensitivity.velocity(k, &x[0], rate).0;
        along += derivative.dot(&moved);
        square += derivative.norm_squared();
    }
    (along / square.max(f64::MIN_POSITIVE)).clamp(0.0, 1.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Largest speed of the points of a rod at these rates, and by their displacement over the last sub-step,
    /// m/s.
    fn speeds(rod: &Rod, q: [&[f64]; 3], h: f64) -> [f64; 2] {
        let frame = GuideFrame::new(rod, q, h, 0);
        let [mut now, mut before] = [(); 2].map(|()| RodShape::default());
        let mut sensitivity = Sensitivity::default();
        assert!(
            now.update(rod, &Matrix3::identity(), q[0]) && before.update(rod, &Matrix3::identity(), q[1])
        );
        sensitivity.update(rod, &now, q[0]);
        let points = || 0..rod.points();
        let derivative = points().map(|k| sensitivity.velocity(k, &now.x(k), &frame.rate).0.norm());
        let moved = points().map(|k| (now.x(k) - before.x(k)).norm() / h);
        [derivative.fold(0.0, f64::max), moved.fold(0.0, f64::max)]
    }

    #[test]
    fn points_are_not_faster_than_they_move_where_a_rod_turns_around_within_a_sub_step() {
        let (rod, q) = Rod::bent_sample();
        let (h, length) = (1.0 / 192.0, rod.arc[rod.points() - 1]);
        // Twist by a share of a turn, evenly along the rod, in each of two sub-steps.
        let twisted = |turns: f64| -> Vec<f64> {
            let twist = std::f64::consts::TAU * turns / length;
            q.iter().enumerate().map(|(i, q)| q + if i % 3 == 2 { twist } else { 0.0 }).collect()
        };
        let steps = |turns: f64| [twisted(2.0 * turns), twisted(turns), q.clone()];
        let speeds = |turns: f64| {
            let [a, b, c] = steps(turns);
            speeds(&rod, [&a, &b, &c], h)
        };
        let [derivative, moved] = speeds(0.01);
        assert!((derivative / moved - 1.0).abs() < 0.1, "{derivative} {moved}");
        for turns in [0.5, 1.0] {
            let [derivative, moved] = speeds(turns);
            assert!(derivative < 1.5 * moved, "{turns}: {derivative} {moved}");
        }
    }

    #[test]
    fn the_rate_is_of_second_order_and_does_not_look_back_across_an_impact() {
        let rate = |x: [f64; 3]| limited_rate(x.each_ref().map(std::slice::from_ref), 0.1)[0];
        // x = t² at t = 1, 0.9 and 0.8.
        assert!((rate([1.0, 0.81, 0.64]) - 2.0).abs() < 1e-12);
        // Falls by 1 in a sub-step, and then lies, or slides on.
        assert_eq!(rate([0.0, 0.0, 1.0]), 0.0);
        assert!((rate([-0.1, 0.0, 1.0]) + 0.5).abs() < 1e-12);
    }

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
