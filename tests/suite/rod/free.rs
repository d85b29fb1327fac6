//! Loose hairs: rods whose roots nothing holds, or ties alone, against the mechanics of free bodies.

use super::planar::PlanarRod;
use hairbake::contact::Bodies;
use hairbake::dynamics::environment::Environment;
use hairbake::dynamics::guide::{ContactMode, GuideModel, GuideScratch, GuideState};
use hairbake::dynamics::tie::Tie;
use hairbake::geometry::Shape;
use hairbake::rod::{Rod, RodShape, RodSource, RootJoint, SegmentSize};
use hairbake::scene::anim::Scheme;
use nalgebra::{Isometry3, Vector3};

const LENGTH: f64 = 0.1;
const BENDING: f64 = 7.8e-9;
const DENSITY: f64 = 6.6e-6;
const GRAVITY: f64 = 9.81;

/// A loose hair through `points` with 33 evenly spaced strain nodes, in vacuum.
fn loose(points: &[Vector3<f64>]) -> GuideModel {
    let arc: Vec<f64> = (0..33).map(|i| f64::from(i) / 32.0).collect();
    let mut rod = Rod::new(&RodSource {
        line_density: DENSITY,
        segment_size: SegmentSize { max_length: 0.005, ..SegmentSize::FINE },
        ..RodSource::hair(points, &arc)
    })
    .unwrap();
    rod.join_root(RootJoint::Free);
    let drag = vec![0.0; rod.points()];
    GuideModel { records_reaction: true, ..GuideModel::new(rod, drag, 0.3) }
}

fn straight(direction: Vector3<f64>) -> GuideModel {
    loose(&[Vector3::zeros(), direction * LENGTH])
}

/// A curl of one turn and a half.
fn curl() -> GuideModel {
    let point = |i: i32| {
        let a = 0.25 * f64::from(i);
        Vector3::new(0.01 * a.cos(), -0.004 * a, 0.01 * a.sin())
    };
    loose(&(0..40).map(point).collect::<Vec<_>>())
}

/// An environment with this gravity, m/s², and these bodies.
fn under(gravity: Vector3<f64>, bodies: Bodies) -> Environment<'static> {
    Environment { gravity: Box::new(move |_| gravity), ..Environment::at_rest(bodies) }
}

/// Takes `steps` steps of `h`, s, all of which must have a solution; calls `each` after every one.
fn take(
    model: &GuideModel,
    env: &Environment,
    state: &mut GuideState,
    (h, steps): (f64, u32),
    mut each: impl FnMut(&GuideState),
) {
    let mut scratch = GuideScratch::default();
    for i in 0..steps {
        let span = [f64::from(i) * h, f64::from(i + 1) * h];
        let record = model.step(env, state, span, ContactMode::Bodies, &mut scratch);
        assert_eq!((record.unconverged, record.truncated), (0, 0), "step {i}");
        each(state);
    }
}

/// The mean of `of` over the mass of a rod.
fn mean(rod: &Rod, of: &[Vector3<f64>]) -> Vector3<f64> {
    let mass: f64 = rod.mass.iter().sum();
    of.iter().zip(&rod.mass).map(|(v, m)| v * *m).sum::<Vector3<f64>>() / mass
}

#[test]
fn a_rod_falls_freely_without_strain() {
    for (model, name) in [(straight(Vector3::x()), "straight"), (curl(), "curl")] {
        let env = under(Vector3::y() * -GRAVITY, Bodies::default());
        let (h, steps) = (1.0 / 192.0, 96);
        let mut state = GuideState::new(&model, &[], &env, 0.0, h);
        let start = mean(&model.rod, &state.x);
        take(&model, &env, &mut state, (h, steps), |_| {});
        let t = h * f64::from(steps);
        let off = mean(&model.rod, &state.x) - start + Vector3::y() * (0.5 * GRAVITY * t * t);
        let strain = state.q[0][6..].iter().fold(0.0_f64, |most, q| most.max(q.abs())) * LENGTH;
        println!("{name}: {} of g h², strain {strain}", off.norm() / (GRAVITY * h * h));
        // The first step, of backward Euler, falls by g h².
        assert!(off.norm() < GRAVITY * h * h, "{name}: {off}");
        assert!(strain < 1e-8, "{name}: {strain}");
        let held = model.reaction(&state).unwrap();
        assert_eq!((held.force, held.moment), (Vector3::zeros(), Vector3::zeros()));
    }
}

/// Largest change of the linear momentum of a tumbling curl, over the mass, m/s, and its angular momentum after half a
/// second of steps of `h`, s, as a share of that at the start.
fn tumbled(h: f64) -> (f64, Vector3<f64>) {
    let model = curl();
    let env = under(Vector3::zeros(), Bodies::default());
    let mut state = GuideState::new(&model, &[], &env, 0.0, h);
    let (centre, spin) = (mean(&model.rod, &state.x), Vector3::new(3.0, 5.0, -4.0));
    let velocities = state.x.iter().map(|x| Vector3::new(0.1, 0.2, -0.3) + spin.cross(&(x - centre)));
    state.v = velocities.collect();
    let momenta = |state: &GuideState| {
        let (centre, velocity) = (mean(&model.rod, &state.x), mean(&model.rod, &state.v));
        let turning = state.x.iter().zip(&state.v).map(|(x, v)| (x - centre).cross(&(v - velocity)));
        [velocity, mean(&model.rod, &turning.collect::<Vec<_>>())]
    };
    let ([linear, angular], mut most) = (momenta(&state), 0.0_f64);
    take(&model, &env, &mut state, (h, (0.5 / h) as u32), |state| {
        most = most.max((momenta(state)[0] - linear).norm());
    });
    (most, (momenta(&state)[1] - angular) / angular.norm())
}

#[test]
fn a_tumbling_rod_keeps_its_momenta() {
    let runs = [200.0, 400.0, 800.0].map(|rate: f64| tumbled(1.0 / rate));
    let [coarse, middle, fine] = runs.map(|(_, angular)| angular);
    let order = ((coarse - middle).norm() / (middle - fine).norm()).log2();
    println!("{runs:?} {order}");
    assert!(runs.iter().all(|(linear, _)| *linear < 1e-6), "{runs:?}");
    // Of second order in the step, but for the friction of the joint: 1e-3 a second of a straight rod, more of one that is
    // wound up.
    assert!(order > 1.7 && (middle - fine).norm() < 3e-4 && fine.norm() < 0.015, "{runs:?} {order}");
}

#[test]
fn a_rod_without_ends_that_are_held_vibrates_as_a_free_beam() {
    let beta: f64 = 4.730_040_744_9;
    let omega = beta * beta * (BENDING / (DENSITY * LENGTH.powi(4))).sqrt();
    let ratio = (beta.cosh() - beta.cos()) / (beta.sinh() - beta.sin());
    let mode = |s: f64| {
        let b = beta * s / LENGTH;
        b.cosh() + b.cos() - ratio * (b.sinh() + b.sin())
    };
    let model = straight(Vector3::x());
    let env = under(Vector3::zeros(), Bodies::default());
    let h = 2e-4;
    let mut state = GuideState::new(&model, &[], &env, 0.0, h);
    let rod = &model.rod;
    for (v, s) in state.v.iter_mut().zip(&rod.arc) {
        *v = Vector3::y() * (1e-3 * LENGTH * omega * mode(*s));
    }
    let (mut before, mut crossings, mut time) = (0.0, Vec::new(), 0.0);
    take(&model, &env, &mut state, (h, 4000), |state| {
        let share = |k: usize| rod.mass[k] * mode(rod.arc[k]) * state.x[k].y;
        let now: f64 = (0..rod.points()).map(share).sum();
        if before < 0.0 && now >= 0.0 {
            crossings.push(time + h * before / (before - now));
        }
        (before, time) = (now, time + h);
    });
    let periods = crossings.len() - 1;
    let period = (crossings[periods] - crossings[0]) / periods as f64;
    let off = std::f64::consts::TAU / (period * omega) - 1.0;
    println!("{periods} periods, off by {off}");
    assert!(periods > 7 && off.abs() < 1e-3, "{periods} {off}");
}

/// How far a hair along `direction` that has landed on a plane slides down it within the rest of a quarter of a second
/// and all in all, m, where the tangent of its angle is `slope`.
fn slid(direction: Vector3<f64>, slope: f64) -> [f64; 2] {
    let model = straight(direction);
    let angle = slope.atan();
    let plane = Shape::Plane { point: -Vector3::y() * 5e-4, normal: Vector3::y() };
    let gravity = Vector3::new(angle.sin(), -angle.cos(), 0.0) * GRAVITY;
    let env = under(gravity, Bodies::from_shapes(&[plane]));
    let h = 1.0 / 384.0;
    let mut state = GuideState::new(&model, &[5e-4], &env, 0.0, h);
    let mut places = vec![mean(&model.rod, &state.x).x];
    take(&model, &env, &mut state, (h, 96), |state| {
        places.push(mean(&model.rod, &state.x).x);
        let lowest = state.x.iter().map(|x| x.y).fold(f64::INFINITY, f64::min);
        assert!(lowest > -5e-4, "{lowest}");
    });
    [24, 0].map(|from| places[96] - places[from])
}

#[test]
fn a_loose_hair_holds_below_the_angle_of_friction_and_slides_above_it() {
    let mu: f64 = 0.3;
    for direction in [Vector3::x(), Vector3::z()] {
        let [held, _] = slid(direction, 0.9 * mu);
        let (angle, [_, sliding]) = ((1.2 * mu).atan(), slid(direction, 1.2 * mu));
        let wanted = 0.5 * GRAVITY * (angle.sin() - mu * angle.cos()) * 0.0625;
        println!("{held} {sliding} {wanted}");
        assert!(held.abs() < 1e-5, "{held}");
        assert!((sliding / wanted - 1.0).abs() < 0.03, "{sliding} {wanted}");
    }
}

#[test]
fn a_loose_hair_falls_off_a_ball_and_enters_it_with_neither_end() {
    let mut model = straight(Vector3::x());
    model.drag.fill(2e-4);
    let (radius, centre) = (0.03, Vector3::new(0.015, -0.05, 0.004));
    let ball = Shape::Sphere { centre, radius };
    let env = under(Vector3::y() * -GRAVITY, Bodies::from_shapes(&[ball]));
    let h = 1.0 / 192.0;
    let mut state = GuideState::new(&model, &[5e-4], &env, 0.0, h);
    let (mut least, mut touched) = (f64::INFINITY, false);
    take(&model, &env, &mut state, (h, 384), |state| {
        let mut line = Vec::new();
        state.contact_polyline(&model, &mut line);
        let distance = line.iter().map(|x| (x - centre).norm() - radius).fold(f64::INFINITY, f64::min);
        (least, touched) = (least.min(distance), touched || distance < 6e-4);
    });
    let highest = state.x.iter().map(|x| x.y).fold(f64::NEG_INFINITY, f64::max);
    println!("{least} {highest}");
    assert!(touched && least > 2e-4 && highest < centre.y - radius, "{least} {highest}");
}

/// A tie of the place of `rod` at the fraction `at` of its points at `goal`, m.
fn tie(rod: &Rod, at: f64, goal: Vector3<f64>) -> Tie {
    let half = (at * (2 * rod.points() - 2) as f64) as usize;
    match half {
        0 => Tie::new(rod, 0, 0.0, goal),
        half => Tie::new(rod, half - 1, 1.0, goal),
    }
}

/// `model` once its ties hold it at rest.
fn hung(model: GuideModel) -> (GuideModel, GuideState) {
    let model = GuideModel { scheme: Scheme::BackwardEuler, ..model };
    let env = Environment::at_rest(Bodies::default());
    let mut state = GuideState::new(&model, &[], &env, 0.0, 0.02);
    take(&model, &env, &mut state, (0.02, 1500), |_| {});
    (model, state)
}

#[test]
fn a_hair_on_two_ties_hangs_as_a_catenary_with_bending() {
    let goal = Vector3::new(0.07, -0.02, 0.0);
    let mut model = straight(Vector3::x());
    model.ties = vec![tie(&model.rod, 0.0, Vector3::zeros()), tie(&model.rod, 1.0, goal)];
    let (model, state) = hung(model);
    let weight = DENSITY * GRAVITY;
    let reference = PlanarRod { length: LENGTH, bending: BENDING, natural: 0.0, weight };
    let (angle, force) = reference.hung(goal.xy());
    let mut shape = RodShape::default();
    assert!(shape.update(&model.rod, &model.rod.root.r, &state.q[0]));
    let (t, held) = (shape.tangent(0), model.reaction(&state).unwrap());
    let off = [t.y.atan2(t.x) - angle, (held.ties[1].force.xy() - force).norm() / (weight * LENGTH)];
    let sum = held.ties[0].force + held.ties[1].force - Vector3::y() * (weight * LENGTH);
    println!("{off:?} {}", sum.norm() / (weight * LENGTH));
    assert!(off.iter().all(|off| off.abs() < 1e-4), "{off:?}");
    assert!(sum.norm() < 1e-6 * weight * LENGTH, "{sum}");
    assert!(state.x[0].norm() < 1e-9, "{}", state.x[0]);
}

#[test]
fn ties_between_the_ends_of_a_hair_bear_its_weight_and_its_moment() {
    let mut model = straight(Vector3::x());
    let goals = [Vector3::new(0.03, 0.01, 0.0), Vector3::new(0.065, 0.0, 0.01)];
    model.ties = vec![tie(&model.rod, 0.25, goals[0]), tie(&model.rod, 0.75, goals[1])];
    let (model, state) = hung(model);
    let weight = DENSITY * GRAVITY * LENGTH;
    let held = model.reaction(&state).unwrap();
    let sum = held.ties[0].force + held.ties[1].force - Vector3::y() * weight;
    let of_ties = goals[0].cross(&held.ties[0].force) + goals[1].cross(&held.ties[1].force);
    let moment = of_ties - mean(&model.rod, &state.x).cross(&(Vector3::y() * weight));
    println!("{} {}", sum.norm() / weight, moment.norm() / (weight * LENGTH));
    assert!(sum.norm() < 1e-6 * weight, "{sum}");
    assert!(moment.norm() < 1e-6 * weight * LENGTH, "{moment}");
    // Both ends hang.
    assert!(state.x[0].y < goals[0].y && state.x[state.x.len() - 1].y < goals[1].y);
}

#[test]
fn a_hair_on_one_tie_swings_to_below_it() {
    let mut model = straight(Vector3::x());
    model.drag.fill(2e-4);
    model.ties = vec![tie(&model.rod, 0.5, Vector3::new(0.05, 0.0, 0.0))];
    let (model, state) = hung(model);
    let held = model.reaction(&state).unwrap();
    let weight = DENSITY * GRAVITY * LENGTH;
    let off = (held.ties[0].force - Vector3::y() * weight).norm() / weight;
    println!("{off} {}", mean(&model.rod, &state.x));
    assert!(off < 1e-6, "{off}");
}

#[test]
fn what_carries_the_roots_of_others_moves_no_loose_hair() {
    let model = curl();
    let run = |speed: f64| {
        let env = Environment {
            head: Box::new(move |t| Isometry3::translation(speed * t, 0.0, 0.0)),
            ..under(Vector3::y() * -GRAVITY, Bodies::default())
        };
        let mut state = GuideState::new(&model, &[], &env, 0.0, 0.005);
        take(&model, &env, &mut state, (0.005, 20), |_| {});
        state.x
    };
    assert_eq!(run(0.0), run(3.0));
}
