//! Forces and moments on a rod against theory: the elastica, the full circle, twist, and its own weight.

use super::planar::PlanarRod;
use hairbake::contact::Bodies;
use hairbake::dynamics::environment::Environment;
use hairbake::dynamics::guide::{ContactMode, GuideModel, GuideScratch, GuideState};
use hairbake::dynamics::load::GuideLoad;
use hairbake::rod::{Rod, RodShape, RodSource, SegmentSize};
use hairbake::scene::anim::{GuideSelection, Keyframes, Load, LoadAxes, LoadPlace, Scheme};
use nalgebra::{Matrix3, Vector2, Vector3};
use std::f64::consts::TAU;

const LENGTH: f64 = 0.1;
const BENDING: f64 = 7.8e-9;
const TORSION: f64 = 3.6e-9;
/// Weight per length, N/m.
const WEIGHT: f64 = 6.6e-6 * 9.81;
const TIP: LoadPlace = LoadPlace::Share(1.0);

/// A straight horizontal guide with `nodes` evenly spaced strain nodes and these loads, which reach their value
/// after 2000 s.
fn guide(nodes: usize, loads: &[(LoadPlace, LoadAxes, Vector3<f64>, Vector3<f64>)]) -> GuideModel {
    let arc: Vec<f64> = (0..nodes).map(|i| i as f64 / (nodes - 1) as f64).collect();
    let rod = Rod::new(&RodSource {
        stiffness: [BENDING, BENDING, TORSION],
        segment_size: SegmentSize { max_length: 0.002, ..SegmentSize::FINE },
        tip_strain: loads.iter().any(|load| load.3 != Vector3::zeros()),
        ..RodSource::hair(&[Vector3::zeros(), Vector3::x() * LENGTH], &arc)
    });
    let rod = rod.unwrap();
    let ramp = |v: &Vector3<f64>| Keyframes { times: vec![0.0, 2000.0], values: vec![Vector3::zeros(), *v] };
    let load = |(place, axes, force, moment): &(LoadPlace, LoadAxes, Vector3<f64>, Vector3<f64>)| Load {
        name: "load".into(),
        guides: GuideSelection::default(),
        place: *place,
        force: ramp(force),
        moment: ramp(moment),
        axes: *axes,
    };
    let loads = loads.iter().map(|l| GuideLoad::new(&rod, &load(l)).unwrap()).collect();
    let drag = vec![0.0; rod.points()];
    GuideModel {
        scheme: Scheme::BackwardEuler,
        records_reaction: true,
        loads,
        ..GuideModel::new(rod, drag, 0.3)
    }
}

/// The guide at rest, under `gravity`, m/s², downwards: steps of 100 s are quasi-static.
fn at_rest(model: &GuideModel, gravity: f64) -> (GuideState, RodShape) {
    let env = Environment {
        gravity: Box::new(move |_| Vector3::y() * -gravity),
        ..Environment::at_rest(Bodies::default())
    };
    let (h, mut scratch) = (100.0, GuideScratch::default());
    let mut state = GuideState::new(model, &[], &env, 0.0, h);
    for i in 0..60 {
        let span = [f64::from(i) * h, f64::from(i + 1) * h];
        let record = model.step(&env, &mut state, span, ContactMode::Bodies, &mut scratch);
        assert_eq!((record.unconverged, record.halvings), (0, 0), "step {i}");
    }
    let mut shape = RodShape::default();
    assert!(shape.update(&model.rod, &model.rod.root.r, &state.q[0]));
    (state, shape)
}

fn tip(shape: &RodShape) -> Vector3<f64> {
    shape.x(shape.points() - 1)
}

#[test]
fn an_end_load_bends_the_rod_into_the_elastica() {
    let force = Vector3::y() * (-5.0 * BENDING / (LENGTH * LENGTH));
    let reference = PlanarRod { length: LENGTH, bending: BENDING, natural: 0.0, weight: 0.0 };
    let (moment, end) = reference.loaded(force.xy(), 0.0);
    let solve = |nodes: usize| {
        let model = guide(nodes, &[(TIP, LoadAxes::World, force, Vector3::zeros())]);
        let (state, shape) = at_rest(&model, 0.0);
        let held = model.reaction(&state).unwrap();
        assert!((held.force + force).norm() < 1e-6 * force.norm(), "{}", held.force);
        ((tip(&shape).xy() - end.x).norm() / LENGTH, (held.moment.z + moment).abs() / moment.abs())
    };
    let [coarse, fine] = [solve(9), solve(17)];
    println!("{coarse:?} {fine:?}");
    assert!(end.x.y < -0.6 * LENGTH && fine.0 < 1e-5 && fine.1 < 1e-5, "{fine:?}");
    assert!(coarse.0 / fine.0 > 12.0, "{coarse:?} {fine:?}");
}

#[test]
fn an_end_moment_bends_the_rod_into_a_circle() {
    let moment = TAU * BENDING / LENGTH;
    for axes in [LoadAxes::World, LoadAxes::Material] {
        let frame = guide(9, &[]).rod.root.r;
        let world = Vector3::z() * moment;
        let given = if axes == LoadAxes::World { world } else { frame.transpose() * world };
        let model = guide(9, &[(TIP, axes, Vector3::zeros(), given)]);
        let (state, shape) = at_rest(&model, 0.0);
        assert!(tip(&shape).norm() < 1e-6 * LENGTH, "{axes:?}: {}", tip(&shape) / LENGTH);
        let held = model.reaction(&state).unwrap();
        assert!((held.moment + world).norm() < 1e-6 * moment, "{axes:?}: {}", held.moment);
        assert!(held.force.norm() < 1e-6 * moment / LENGTH);
    }
}

#[test]
fn an_end_torque_twists_the_rod() {
    let turn = 2.0;
    let torque = turn * TORSION / LENGTH;
    let model = guide(9, &[(TIP, LoadAxes::Material, Vector3::zeros(), Vector3::z() * torque)]);
    let (_, shape) = at_rest(&model, 0.0);
    let last = shape.points() - 1;
    let relative: Matrix3<f64> = model.rod.root.r.transpose() * shape.frame(last);
    let found = relative[(1, 0)].atan2(relative[(0, 0)]);
    assert!((found / turn - 1.0).abs() < 1e-6, "{found}");
}

#[test]
fn a_force_in_the_axes_of_the_rod_follows_it() {
    let size = 2.0 * BENDING / (LENGTH * LENGTH);
    let reference = PlanarRod { length: LENGTH, bending: BENDING, natural: 0.0, weight: 0.0 };
    let mut angle = 0.0;
    let mut end = reference.loaded(Vector2::zeros(), 0.0).1;
    for _ in 0..60 {
        angle = 0.5 * (angle + end.angle);
        let across = Vector2::new(angle.sin(), -angle.cos()) * size;
        end = reference.loaded(across, 0.0).1;
    }
    assert!((end.angle - angle).abs() < 1e-9);
    // Downwards at rest.
    let down = guide(17, &[]).rod.root.r.transpose() * Vector3::y() * -size;
    let model = guide(17, &[(TIP, LoadAxes::Material, down, Vector3::zeros())]);
    let (_, shape) = at_rest(&model, 0.0);
    let error = (tip(&shape).xy() - end.x).norm() / LENGTH;
    assert!(error < 1e-5 && end.angle < -0.8, "{error} {end:?}");
}

#[test]
fn a_force_that_follows_the_rod_feeds_no_swing_below_flutter() {
    // Beck's column at half of 20.05 EI/L², undamped: the greatest swing of the second second after a push over that of
    // the first. A force that lags by a step at 192 steps a second feeds it by a factor of thousands.
    let push = 0.5 * 20.05 * BENDING / LENGTH.powi(2);
    let force = Vector3::z() * -push;
    let mut model = guide(16, &[(TIP, LoadAxes::Material, force, Vector3::zeros())]);
    model.scheme = Scheme::FourStep;
    let env = Environment {
        gravity: Box::new(|t| Vector3::y() * if t < 3000.01 { -1.0 } else { 0.0 }),
        ..Environment::at_rest(Bodies::default())
    };
    let (start, h) = (3000.0, 1.0 / 192.0);
    let (mut state, mut scratch) = (GuideState::new(&model, &[], &env, start, h), GuideScratch::default());
    let mut greatest = [0.0_f64; 2];
    for i in 0..384 {
        let span = [start + f64::from(i) * h, start + f64::from(i + 1) * h];
        model.step(&env, &mut state, span, ContactMode::Bodies, &mut scratch);
        let second = usize::from(i >= 192);
        greatest[second] = greatest[second].max(state.x.last().unwrap().y.abs());
    }
    assert!(greatest[0] > 1e-6 && greatest[1] < 1.2 * greatest[0], "{greatest:?}");
}

#[test]
fn a_spread_load_is_a_weight_and_parts_of_it_add_up() {
    let weight = Vector3::y() * -WEIGHT;
    let of = |place, force| (place, LoadAxes::World, force, Vector3::zeros());
    let whole = [of(LoadPlace::SpanShare([0.0, 1.0]), weight)];
    let parts = [
        of(LoadPlace::Span([0.0, 0.031]), weight),
        of(LoadPlace::Span([0.031, 0.05]), weight),
        of(LoadPlace::SpanShare([0.5, 1.0]), weight),
    ];
    let fall = at_rest(&guide(17, &[]), 9.81).1;
    let [whole, parts] = [&whole[..], &parts].map(|loads| at_rest(&guide(17, loads), 0.0).1);
    for (k, found) in [("whole", whole), ("parts", parts)] {
        let apart = (tip(&found) - tip(&fall)).norm() / LENGTH;
        assert!(apart < 1e-6, "{k}: {apart}");
    }
    assert!(tip(&fall).y < -0.3 * LENGTH);
}

#[test]
fn a_load_beyond_the_tip_is_none() {
    let rod = guide(9, &[]).rod;
    let bears = |place: LoadPlace| {
        let zero = Keyframes::constant(Vector3::zeros());
        let guides = GuideSelection::default();
        let (force, moment, axes) = (Keyframes::constant(Vector3::x()), zero, LoadAxes::World);
        GuideLoad::new(&rod, &Load { name: String::new(), guides, place, force, moment, axes }).is_some()
    };
    assert!(bears(LoadPlace::Arc(0.099)) && bears(LoadPlace::Span([0.05, 0.2])));
    assert!(!bears(LoadPlace::Arc(0.101)) && !bears(LoadPlace::Span([0.15, 0.2])));
}
