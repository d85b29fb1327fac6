//! What holds a rod against statics and dynamics: force and moment of its clamp, and forces of its ties.

use super::planar::PlanarRod;
use hairbake::contact::Bodies;
use hairbake::dynamics::environment::Environment;
use hairbake::dynamics::guide::{ContactMode, GuideModel, GuideScratch, GuideState};
use hairbake::dynamics::reaction::GuideReaction;
use hairbake::dynamics::tie::Tie;
use hairbake::rod::{Rod, RodSource};
use hairbake::scene::anim::Scheme;
use nalgebra::{Isometry3, Vector2, Vector3};

const LENGTH: f64 = 0.1;
const BENDING: f64 = 7.8e-9;
/// Weight of the hair, N, with ρSgL³/EI = 1.
const WEIGHT: f64 = BENDING / (LENGTH * LENGTH);
const GRAVITY: f64 = 9.81;

/// A guide through `points`, m, without drag, that records what holds it.
fn guide(points: &[Vector3<f64>]) -> GuideModel {
    let arc: Vec<f64> = (0..24).map(|i| f64::from(i) / 23.0).collect();
    let rod = Rod::new(&RodSource {
        stiffness: [BENDING, BENDING, 3.6e-9],
        line_density: WEIGHT / LENGTH / GRAVITY,
        ..RodSource::hair(points, &arc)
    });
    let rod = rod.unwrap();
    let drag = vec![0.0; rod.points()];
    GuideModel { records_reaction: true, ..GuideModel::new(rod, drag, 0.3) }
}

/// What holds `model` after `steps` steps of `h`, s.
fn held(model: &GuideModel, env: &Environment, h: f64, steps: u32) -> GuideReaction {
    let mut state = GuideState::new(model, &[], env, 0.0, h);
    let mut scratch = GuideScratch::default();
    for i in 0..steps {
        let span = [f64::from(i) * h, f64::from(i + 1) * h];
        let record = model.step(env, &mut state, span, ContactMode::Bodies, &mut scratch);
        assert_eq!((record.unconverged, record.truncated), (0, 0));
    }
    model.reaction(&state).unwrap()
}

/// The same at rest: steps of 100 s are quasi-static.
fn at_rest(model: GuideModel) -> GuideReaction {
    let model = GuideModel { scheme: Scheme::BackwardEuler, ..model };
    held(&model, &Environment::at_rest(Bodies::default()), 100.0, 20)
}

fn straight(direction: Vector3<f64>) -> [Vector3<f64>; 2] {
    [Vector3::zeros(), direction * LENGTH]
}

#[test]
fn a_clamp_at_rest_bears_the_weight_and_its_moment() {
    let weight = Vector3::y() * WEIGHT;
    let hanging = at_rest(guide(&straight(-Vector3::y())));
    assert!((hanging.force - weight).norm() < 1e-6 * WEIGHT, "{}", hanging.force);
    assert!(hanging.moment.norm() < 1e-6 * WEIGHT * LENGTH, "{}", hanging.moment);
    let horizontal = at_rest(guide(&straight(Vector3::x())));
    assert!((horizontal.force - weight).norm() < 1e-6 * WEIGHT, "{}", horizontal.force);
    let rod = PlanarRod { length: LENGTH, bending: BENDING, natural: 0.0, weight: WEIGHT / LENGTH };
    // The clamp bears what the rod exerts on it.
    let moment = Vector3::z() * -rod.loaded(Vector2::zeros(), 0.0).0;
    let error = (horizontal.moment - moment).norm();
    assert!(error < 1e-6 * WEIGHT * LENGTH, "{} {moment}", horizontal.moment);
    assert!(moment.norm() > 0.4 * WEIGHT * LENGTH);
}

#[test]
fn an_accelerated_clamp_bears_the_inertia_too() {
    let a = Vector3::new(0.0, 5.0, 0.0);
    let env = Environment {
        head: Box::new(move |t| Isometry3::from(a * (0.5 * t * t))),
        ..Environment::at_rest(Bodies::default())
    };
    let found = held(&guide(&straight(-Vector3::y())), &env, 1e-3, 50);
    let wanted = Vector3::y() * (WEIGHT * (1.0 + 5.0 / GRAVITY));
    assert!((found.force - wanted).norm() < 1e-6 * WEIGHT, "{} {wanted}", found.force);
}

#[test]
fn clamp_and_tie_bear_the_weight_as_statics_shares_it() {
    let radius = LENGTH / std::f64::consts::FRAC_PI_2;
    let angle = |i: i32| std::f64::consts::FRAC_PI_2 * f64::from(i) / 200.0;
    let points: Vec<_> =
        (0..=200).map(angle).map(|a| Vector3::new(a.sin(), 1.0 - a.cos(), 0.0) * radius).collect();
    let mut model = guide(&points);
    let last = 2 * model.rod.points() - 3;
    let tip = points[200];
    let tie = Tie::new(&model.rod, last, 1.0, tip);
    // The second does not hold yet.
    model.ties = vec![Tie { times: [1e9, 2e9], ..tie.clone() }, tie];
    let found = at_rest(model);
    assert_eq!([found.ties[0].force, found.ties[0].moment], [Vector3::zeros(); 2]);
    let sum = found.force + found.ties[1].force - Vector3::y() * WEIGHT;
    assert!(sum.norm() < 1e-6 * WEIGHT, "{sum}");
    let rod = PlanarRod { length: LENGTH, bending: BENDING, natural: 1.0 / radius, weight: WEIGHT / LENGTH };
    let (moment, force) = rod.held(tip.xy());
    let error = (found.ties[1].force.xy() - force).norm() / WEIGHT;
    let of_moment = (found.moment.z + moment).abs() / (WEIGHT * LENGTH);
    assert!(error < 1e-4 && of_moment < 1e-4, "{error} {of_moment}: {found:?} {force} {moment}");
}
