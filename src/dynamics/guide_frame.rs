//! A guide as it is written: its unknowns and their rates at a frame, or between frames.

use super::guide::{GuideModel, GuideState};
use super::reaction::GuideReaction;
use crate::rod::{PlaceVelocity, RateFit, Rod, RodShape};
use nalgebra::{Isometry3, Point3, Vector3};
use serde::{Deserialize, Serialize};

/// A guide at a frame, as the simulation leaves it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct GuideFrame {
    /// Deviation of the strain at its nodes, 1/m (the rod's unknowns).
    pub q: Vec<f64>,
    /// `q` half a frame before, 1/m.
    pub midway: Vec<f64>,
    /// Level of the wisp that it moves with, 0 for a coarse one.
    pub level: u32,
    /// What holds it, if that is recorded; zero for a guide that is not stepped, and where its step has no
    /// solution.
    pub reaction: Option<GuideReaction>,
}

/// A guide at a moment, with its motion.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct MovingGuide {
    /// Deviation of the strain at its nodes, 1/m (the rod's unknowns).
    pub q: Vec<f64>,
    /// Rate of `q`, 1/(m·s).
    pub rate: Vec<f64>,
    /// Level of the wisp that it moves with, 0 for a coarse one.
    pub level: u32,
    /// What holds it, if that is recorded; zero for a guide that is not stepped, and where its step has no
    /// solution.
    pub reaction: Option<GuideReaction>,
}

/// The guides between two frames.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct SolverStep {
    /// When, s.
    pub time: f64,
    /// The guides, in the groom's order; rates are those of the step that led there.
    pub guides: Vec<MovingGuide>,
    /// Whether the solver brought each guide there. Another moves evenly over a longer step, in the frame of the
    /// head for contact with guides and in that of a body for contact with it; where it is written is about there.
    pub arrived: Vec<bool>,
}

impl SolverStep {
    /// Of guides that all move by themselves.
    pub(super) fn new(time: f64, models: &[GuideModel], states: &[GuideState]) -> Self {
        let guides = models.iter().zip(states).map(|(model, g)| moving(model, g)).collect();
        SolverStep { time, guides, arrived: vec![true; models.len()] }
    }

    /// Lets guide `g` arrive.
    pub(super) fn arrive(&mut self, g: usize, model: &GuideModel, state: &GuideState) {
        (self.guides[g], self.arrived[g]) = (moving(model, state), true);
    }
}

/// A guide that moves by itself, at the end of a step.
fn moving(model: &GuideModel, g: &GuideState) -> MovingGuide {
    MovingGuide { q: g.q[0].clone(), rate: g.rate().to_vec(), level: 0, reaction: model.reaction(g) }
}

/// The motion of what carries a root, the head or a skin, around a frame.
pub struct CarrierAround<'a> {
    /// Its poses a frame and half a frame before, at the frame, and half a frame and a frame after it.
    pub poses: [Isometry3<f64>; 5],
    /// Velocity at the frame, m per frame, of its point at a place, m, rest space; world axes.
    pub velocity: &'a (dyn Fn(&Vector3<f64>) -> Vector3<f64> + Sync),
}

/// Weights of the values a frame and half a frame before a moment, at it, and half a frame and a frame after
/// it, in differences there, per frame.
#[derive(Debug, Clone, Copy)]
struct Differences {
    /// What makes the central difference over a frame one of higher order.
    correction: [f64; 5],
    /// The mean rate from the first value to the last.
    mean: [f64; 5],
}

/// The central difference over a frame: the mean rate around the moment.
const OVER_A_FRAME: [f64; 5] = [0.0, -1.0, 0.0, 1.0, 0.0];

/// Of fourth order (`docs/theory.md` eq. 7.6).
const CENTRAL: Differences = Differences {
    correction: [1.0 / 6.0, -1.0 / 3.0, 0.0, 1.0 / 3.0, -1.0 / 6.0],
    mean: [-0.5, 0.0, 0.0, 0.0, 0.5],
};

/// Without the first value: the derivative of the cubic through the others.
const AT_START: Differences = Differences {
    correction: [0.0, 1.0 / 3.0, -1.0, 1.0, -1.0 / 3.0],
    mean: [0.0, -2.0 / 3.0, 0.0, 0.0, 2.0 / 3.0],
};

/// Largest correction relative to the central difference that it corrects. Across a jump of the velocity it
/// would tell of motion before the jump.
const LARGEST_CORRECTION: f64 = 0.2;

/// The share of a correction that is used, by its size and that of what it corrects.
fn share_of_correction(correction: f64, corrected: f64) -> f64 {
    (LARGEST_CORRECTION * corrected / correction.max(f64::MIN_POSITIVE)).min(1.0)
}

/// Turn of a rod within half a frame, rad, up to which the rates of its unknowns are those of its points.
const RESOLVED_TURN: f64 = 0.3;

/// Largest speed of a point relative to its mean speed over the two frames around. Steeper cubics between
/// frames go beyond them and back [Fritsch and Carlson 1980].
const STEEPEST: f64 = 3.0;

/// Displacement of a root per frame, m, by which the head's velocity may differ from its displacements before
/// rates are fitted: where the head stops or starts between frames, hair does not.
const UNSTEADY: f64 = 1e-3;

/// What limits take from the motion of a point, m per frame, from which the rates of its rod count as
/// limited.
const NOTABLE: f64 = 1e-3;

/// Distance of points beside a rod that tell how it twists, m: that of the strands that follow it.
const BESIDE: f64 = 0.01;

/// Most points of an element whose motion rates are fitted to. The strain is linear there, and more of them hardly tell
/// more.
const FITTED_POINTS: usize = 3;

/// Buffers of [`MovingGuide::new`].
#[derive(Debug, Default)]
pub struct RateScratch {
    shape: RodShape,
    /// The fitted points, each followed by the one beside it, at the five times of the differences, m, relative to the
    /// root.
    places: [Vec<Vector3<f64>>; 5],
    fit: RateFit,
}

impl MovingGuide {
    /// The guide of `rod` at a frame, by its states at the frame before, at it and at the next, `interval`,
    /// s, apart. `before` is `None` at the first frame. Also whether its rates are limited: they are not
    /// those of the positions of its points by differences.
    pub fn new(
        rod: &Rod,
        before: Option<&GuideFrame>,
        [now, after]: [&GuideFrame; 2],
        head: &CarrierAround,
        interval: f64,
        scratch: &mut RateScratch,
    ) -> (Self, bool) {
        let differences = if before.is_some() { CENTRAL } else { AT_START };
        let unwound = |q: &Vec<f64>| {
            let mut q = q.clone();
            rod.unwind_towards(&now.q, &mut q, &mut []);
            q
        };
        let q = [&before.unwrap_or(now).q, &now.midway, &now.q, &after.midway, &after.q].map(unwound);
        // Per frame, as are all differences here.
        let [mut rate, correction] = [OVER_A_FRAME, differences.correction].map(|weights| -> Vec<f64> {
            let of = |i: usize| q.iter().zip(weights).map(|(q, weight)| q[i] * weight).sum();
            (0..now.q.len()).map(of).collect()
        });
        let size = |of: &[f64]| of.iter().map(|x| x * x).sum::<f64>().sqrt();
        let share = share_of_correction(size(&correction), size(&rate));
        rate.iter_mut().zip(&correction).for_each(|(rate, correction)| *rate += share * correction);
        let unsteady = velocity_in_head(&[rod.root.p; 5], head, &differences).0.norm() > UNSTEADY;
        let fits = unsteady || turn(rod, &rate) > 2.0 * RESOLVED_TURN;
        let limited = fits && !fit(&mut rate, rod, &q, head, &differences, scratch);
        rate.iter_mut().for_each(|rate| *rate /= interval);
        let reaction = now.reaction.clone();
        (MovingGuide { q: now.q.clone(), rate, level: now.level, reaction }, limited)
    }

    /// The guide of `rod` between two frames, `interval`, s, apart, at the share `u` of the way: cubic in time, with
    /// the rates of both ends; of the first one's level, its reactions linear.
    pub fn between(rod: &Rod, a: &Self, b: &Self, u: f64, interval: f64) -> Self {
        let (mut q, mut rate) = (b.q.clone(), b.rate.clone());
        rod.unwind_towards(&a.q, &mut q, &mut rate);
        // Of the cubic Hermite basis: the step, and the slopes at its start and end; then their derivatives.
        let (step, start, end) = (u * u * (3.0 - 2.0 * u), u * (1.0 - u) * (1.0 - u), u * u * (u - 1.0));
        let (d_step, d_start, d_end) =
            (6.0 * u * (1.0 - u), (1.0 - u) * (1.0 - 3.0 * u), u * (3.0 * u - 2.0));
        let at = |i: usize, step: f64, start: f64, end: f64| {
            (q[i] - a.q[i]) * step + (a.rate[i] * start + rate[i] * end) * interval
        };
        MovingGuide {
            q: (0..a.q.len()).map(|i| a.q[i] + at(i, step, start, end)).collect(),
            rate: (0..a.q.len()).map(|i| at(i, d_step, d_start, d_end) / interval).collect(),
            level: a.level,
            reaction: a.reaction.as_ref().zip(b.reaction.as_ref()).map(|(a, b)| a.lerp(b, u)),
        }
    }
}

/// A bound on how far a rod turns at these rates of its unknowns, rad per unit of time: by its strains, or with a
/// root that is free.
fn turn(rod: &Rod, rate: &[f64]) -> f64 {
    let square = |node: &[f64]| node.iter().map(|r| r * r).sum::<f64>();
    let (joint, strains) = rate.split_at(if rod.is_free() { 6 } else { 0 });
    let of_strains = strains.chunks(3).map(square).fold(0.0, f64::max).sqrt() * rod.length();
    joint.chunks(3).take(1).map(square).fold(0.0, f64::max).sqrt().max(of_strains)
}

/// Points of `rod` whose motion tells the rates of its unknowns, from root to tip, with their weights: those of an
/// element share its points equally.
fn fitted_points(rod: &Rod) -> impl Iterator<Item = (usize, f64)> + '_ {
    let root = rod.is_free().then_some((0, 1.0));
    root.into_iter().chain((1..rod.nodes.len()).flat_map(|node| {
        let [from, to] = [rod.node_point(node - 1), rod.node_point(node)];
        let most = FITTED_POINTS.min(to - from);
        (1..=most).map(move |i| (from + (to - from) * i / most, (to - from) as f64 / most as f64))
    }))
}

/// Changes the rates of the unknowns of `rod`, per frame, to those that in the least squares move points of it,
/// and points beside them, as the differences of their positions tell. Within half a frame a rod may turn by
/// radians while its points go there and back: the difference of the unknowns is then no velocity of theirs.
/// False if the speed of a point is limited, or if there is no fit and the rates stay as they are.
fn fit(
    rate: &mut [f64],
    rod: &Rod,
    q: &[Vec<f64>; 5],
    head: &CarrierAround,
    differences: &Differences,
    scratch: &mut RateScratch,
) -> bool {
    let RateScratch { shape, places, fit } = scratch;
    // The frame last: its shape is used below.
    for i in [0, 1, 3, 4, 2] {
        shape.update(rod, &rod.root.r, &q[i]);
        places[i].clear();
        places[i].extend(fitted_points(rod).flat_map(|(k, _)| {
            let x = shape.x(k);
            [x, x + shape.normal(k) * BESIDE]
        }));
    }
    let mut limited = 0.0_f64;
    fit.clear();
    for (fitted, (point, weight)) in fitted_points(rod).enumerate() {
        for place in [2 * fitted, 2 * fitted + 1] {
            let places = places.each_ref().map(|places| places[place]);
            let in_world = places.map(|x| rod.root.p + x);
            let (velocity, beyond) = velocity_in_head(&in_world, head, differences);
            limited = limited.max(beyond);
            fit.add(PlaceVelocity { point, x: places[2], velocity, weight });
        }
    }
    fit.correct(rod, shape, &q[2], rate) && limited <= NOTABLE
}

/// Velocity relative to the head, m per frame, in rest space, of a point with these places, m, in rest space
/// at the times of the differences. Its speed in the world is at most [`STEEPEST`] times its mean speed, or
/// that of the head there. Also by how much the speed is more without that limit, m per frame.
fn velocity_in_head(
    places: &[Vector3<f64>; 5],
    head: &CarrierAround,
    differences: &Differences,
) -> (Vector3<f64>, f64) {
    let in_world: [Point3<f64>; 5] = std::array::from_fn(|i| head.poses[i] * Point3::from(places[i]));
    let from_now = in_world.map(|place| place - in_world[2]);
    let [over_a_frame, correction, mean] =
        [OVER_A_FRAME, differences.correction, differences.mean].map(|weights| {
            let weighted = from_now.iter().zip(weights);
            weighted.fold(Vector3::zeros(), |sum: Vector3<f64>, (place, weight)| sum + place * weight)
        });
    let velocity = over_a_frame + correction * share_of_correction(correction.norm(), over_a_frame.norm());
    let of_head = (head.velocity)(&places[2]);
    let limit = of_head.norm().max(STEEPEST * mean.norm());
    let speed = velocity.norm();
    let share = (limit / speed.max(f64::MIN_POSITIVE)).min(1.0);
    (head.poses[2].rotation.inverse() * (velocity * share - of_head), speed * (1.0 - share))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rod::RootJoint;
    use nalgebra::UnitQuaternion;

    const INTERVAL: f64 = 1.0 / 24.0;

    /// A rod whose unknowns at a time, in frames, are `q`, at frame 0; or at the first frame.
    fn moving(rod: &Rod, q: impl Fn(f64) -> Vec<f64>, first: bool) -> (MovingGuide, bool) {
        let state = |t: f64| GuideFrame { q: q(t), midway: q(t - 0.5), level: 0, reaction: None };
        let before = state(-1.0);
        let head = CarrierAround { poses: [Isometry3::identity(); 5], velocity: &|_| Vector3::zeros() };
        MovingGuide::new(
            rod,
            (!first).then_some(&before),
            [&state(0.0), &state(1.0)],
            &head,
            INTERVAL,
            &mut RateScratch::default(),
        )
    }

    /// Positions of the points of a rod, and their velocities at rates of its unknowns.
    fn points(rod: &Rod, q: &[f64], rate: &[f64]) -> Vec<[Vector3<f64>; 2]> {
        let mut shape = RodShape::default();
        assert!(shape.update(rod, &rod.root.r, q));
        shape.velocities(rod, q, rate).enumerate().skip(1).map(|(k, (v, _))| [shape.x(k), v]).collect()
    }

    /// `q` with a strain about an axis added that turns the tip by `turn`, rad.
    fn turned(rod: &Rod, q: &[f64], axis: usize, turn: f64) -> Vec<f64> {
        let strain = turn / rod.length();
        q.iter().enumerate().map(|(i, q)| q + if i % 3 == axis { strain } else { 0.0 }).collect()
    }

    #[test]
    fn rates_are_exact_where_frames_resolve_the_motion() {
        let (rod, q) = Rod::bent_sample();
        // The last two turn the rod by more than is resolved.
        let cases = [
            (2.5, 0.2, false, 1e-3),
            (5.0, 0.2, false, 1e-2),
            (2.5, 0.2, true, 0.02),
            (2.5, 1.2, false, 5e-3),
            (5.0, 0.6, false, 0.03),
        ];
        for (hz, turn, first, error) in cases {
            let omega = std::f64::consts::TAU * hz * INTERVAL;
            let (found, limited) =
                moving(&rod, |t| turned(&rod, &q, 0, turn * (omega * t + 0.3).sin()), first);
            let wanted = turn * omega * 0.3_f64.cos() / (rod.length() * INTERVAL);
            let worst = found.rate.iter().step_by(3).map(|r| (r / wanted - 1.0).abs()).fold(0.0, f64::max);
            assert!(worst < error && !limited, "{hz} Hz, {turn}, {first}: {worst}, {limited}");
        }
    }

    #[test]
    fn no_point_is_faster_than_it_moves_where_a_rod_whips_or_twists_between_frames() {
        let (rod, q) = Rod::bent_sample();
        let speed = |v: &[Vector3<f64>]| v.iter().map(|v| v.norm()).fold(0.0, f64::max);
        // About an axis across the rod and along it, there and back up to once a frame, and around.
        for (axis, hz, turn) in
            [(0, 9.0, 2.0), (0, 12.0, 2.0), (2, 12.0, 3.0), (0, 22.0, 1.0), (2, 1.0, 12.0)]
        {
            let omega = std::f64::consts::TAU * hz * INTERVAL;
            let at = |t: f64| turned(&rod, &q, axis, turn * (omega * t).sin());
            let (found, limited) = moving(&rod, at, false);
            // At 12 Hz a point is where it is a frame before and after.
            assert!(limited || hz != 12.0, "{axis} {turn}");
            let x = [-1.0, 1.0].map(|t| points(&rod, &at(t), &found.rate));
            let mean: Vec<_> =
                x[0].iter().zip(&x[1]).map(|(a, b)| (b[0] - a[0]) / (2.0 * INTERVAL)).collect();
            let written: Vec<_> = points(&rod, &found.q, &found.rate).iter().map(|p| p[1]).collect();
            let [written, mean] = [&written, &mean].map(|v| speed(v));
            assert!(written < 1.2 * 3.0 * mean + 0.05, "{axis} {hz} {turn}: {written} {mean}");
        }
    }

    #[test]
    fn a_loose_rod_that_spins_has_its_velocity_at_every_turn() {
        let (mut rod, _) = Rod::bent_sample();
        rod.join_root(RootJoint::Free);
        let (spin, speed) = (Vector3::new(9.0, -20.0, 15.0), Vector3::new(1.0, 2.0, -0.5));
        // In the axes of the root, from which the turn is counted.
        let q = |frame: f64| {
            let mut q = vec![0.0; rod.unknowns()];
            let turn = UnitQuaternion::from_scaled_axis(rod.root.r.transpose() * spin * (frame * INTERVAL));
            q[..3].copy_from_slice(turn.scaled_axis().as_slice());
            q[3..6].copy_from_slice((rod.root.r.transpose() * speed * (frame * INTERVAL)).as_slice());
            q
        };
        let mut shape = RodShape::default();
        for frame in 0..12 {
            let at = |u: f64| moving(&rod, |t| q(f64::from(frame) + u + t), false).0;
            let between = MovingGuide::between(&rod, &at(0.0), &at(1.0), 0.5, INTERVAL);
            for (found, u) in [(at(0.0), 0.0), (between, 0.5)] {
                assert!(shape.update(&rod, &rod.root.r, &found.q));
                let root = speed * ((f64::from(frame) + u) * INTERVAL);
                assert!((shape.x(0) - root).norm() < 1e-3, "{frame} {u}: {} {root}", shape.x(0));
                for (k, (v, _)) in shape.velocities(&rod, &found.q, &found.rate).enumerate() {
                    let wanted = speed + spin.cross(&(shape.x(k) - root));
                    assert!((v - wanted).norm() < 0.1 * wanted.norm(), "{frame} {u} {k}: {v} {wanted}");
                }
            }
        }
    }

    /// Velocity per frame of a point at these places half a frame apart, on a head at rest.
    fn velocity(places: [f64; 5], differences: &Differences) -> f64 {
        let head = CarrierAround { poses: [Isometry3::identity(); 5], velocity: &|_| Vector3::zeros() };
        velocity_in_head(&places.map(|x| Vector3::x() * x), &head, differences).0.x
    }

    #[test]
    fn a_point_that_goes_there_and_back_within_a_frame_is_no_faster_than_three_times_its_mean_speed() {
        // By 2 around the frame, by 0.2 over two frames.
        assert!((velocity([-0.1, -1.0, 0.0, 1.0, 0.1], &CENTRAL) - 0.3).abs() < 1e-12);
        assert!((velocity([0.0, 0.0, 0.0, 1.0, 0.1], &AT_START) - 0.2).abs() < 1e-12);
    }

    #[test]
    fn a_point_is_as_fast_as_it_swings() {
        // 5 Hz: the central difference alone is off by 7 %.
        let omega = std::f64::consts::TAU * 5.0 * INTERVAL;
        let places = [-1.0, -0.5, 0.0, 0.5, 1.0].map(|t| (omega * t).sin());
        let found = velocity(places, &CENTRAL);
        assert!((found / omega - 1.0).abs() < 0.01, "{found} {omega}");
        // Exact for cubics where the place a frame before is not known.
        let places = [f64::NAN, -0.5, 0.0, 0.5, 1.0].map(|t: f64| 0.3 * t + 0.1 * t * t + 0.1 * t.powi(3));
        let found = velocity([0.0, places[1], places[2], places[3], places[4]], &AT_START);
        assert!((found - 0.3).abs() < 1e-12, "{found}");
    }

    #[test]
    fn the_tip_moves_as_it_does_where_the_velocity_of_the_head_jumps() {
        let (rod, q) = Rod::bent_sample();
        let still = GuideFrame { q: q.clone(), midway: q.clone(), level: 0, reaction: None };
        let tip = |rate: &[f64]| points(&rod, &q, rate)[rod.points() - 2];
        let across = tip(&vec![0.0; q.len()])[0].cross(&Vector3::x()).normalize();
        // The head starts to move by 17 cm per frame at the frame, or half a frame later, and carries the
        // hair.
        for (places, mean) in [([0.0, 0.0, 0.0, 0.085, 0.17], 0.085), ([0.0, 0.0, 0.0, 0.0, 0.085], 0.0)] {
            let poses = places.map(|x| Isometry3::from(across * x));
            for speed in [0.0, 0.085, 0.17] {
                let velocity = move |_: &Vector3<f64>| across * speed;
                let head = CarrierAround { poses, velocity: &velocity };
                let (found, _) = MovingGuide::new(
                    &rod,
                    Some(&still),
                    [&still, &still],
                    &head,
                    INTERVAL,
                    &mut RateScratch::default(),
                );
                let written = tip(&found.rate)[1].dot(&across) * INTERVAL + speed;
                assert!((written - mean).abs() < 0.03, "{speed} {mean}: {written}");
            }
        }
    }

    #[test]
    fn a_cubic_in_time_is_met_between_frames_with_its_rate() {
        let cubic = |t: f64| (2.0 - 3.0 * t + 5.0 * t * t - 4.0 * t * t * t, -3.0 + 10.0 * t - 12.0 * t * t);
        let state =
            |t: f64| MovingGuide { q: vec![cubic(t).0], rate: vec![cubic(t).1], level: 0, reaction: None };
        let from = 0.3;
        for u in [0.0, 0.25, 0.5, 0.999, 1.0] {
            let (rod, _) = Rod::bent_sample();
            let found = MovingGuide::between(&rod, &state(from), &state(from + INTERVAL), u, INTERVAL);
            let wanted = cubic(from + u * INTERVAL);
            assert!((found.q[0] - wanted.0).abs() < 1e-13 && (found.rate[0] - wanted.1).abs() < 1e-11, "{u}");
        }
    }
}
