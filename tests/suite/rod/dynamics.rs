//! Dynamics of the rod: damping and order of the time schemes.

use hairbake::contact::Bodies;
use hairbake::dynamics::environment::Environment;
use hairbake::dynamics::guide::{ContactMode, GuideModel, GuideScratch, GuideState};
use hairbake::rod::{Rod, RodSource, SegmentSize};
use hairbake::scene::anim::Scheme;
use nalgebra::{Isometry3, Vector3};
use std::f64::consts::TAU;

const LENGTH: f64 = 0.25;
const STIFFNESS: f64 = 7.8e-9;
const LINE_DENSITY: f64 = 6.6e-6;

/// A hair through `points` whose natural shape is straight.
fn hair(points: &[Vector3<f64>]) -> Rod {
    Rod::new(&RodSource {
        stiffness: [STIFFNESS, STIFFNESS, 3.6e-9],
        line_density: LINE_DENSITY,
        natural_strain: Some(Vector3::zeros()),
        segment_size: SegmentSize::COARSE,
        ..RodSource::hair(points, &hairbake::scene::Tree::default_arc(8))
    })
    .unwrap()
}

/// Tip of a hair after every step, m, on a head at `place` without gravity and air.
fn tips(
    rod: &Rod,
    scheme: Scheme,
    place: &(dyn Fn(f64) -> Vector3<f64> + Sync),
    seconds: f64,
    rate: f64,
) -> Vec<Vector3<f64>> {
    let pose = |t: f64| Isometry3::from_parts(place(t).into(), nalgebra::UnitQuaternion::identity());
    let env = Environment {
        head: Box::new(&pose),
        gravity: Box::new(|_| Vector3::zeros()),
        body: Box::new(|_, t| pose(t)),
        ..Environment::at_rest(Bodies::default())
    };
    let h = 1.0 / rate;
    let mut model = GuideModel::new(rod.clone(), vec![0.0; rod.points()], 0.3);
    let mut state = GuideState::new(&model, &[], &env, 0.0, h);
    model.scheme = scheme;
    let mut scratch = GuideScratch::default();
    (0..(seconds * rate).round() as u32)
        .map(|i| {
            let record = model.step(
                &env,
                &mut state,
                [f64::from(i) * h, f64::from(i + 1) * h],
                ContactMode::Bodies,
                &mut scratch,
            );
            assert_eq!((record.unconverged, record.halvings), (0, 0));
            state.x[rod.points() - 1]
        })
        .collect()
}

#[test]
fn schemes_have_their_order_of_convergence() {
    let rod = hair(&[Vector3::zeros(), Vector3::y() * -LENGTH]);
    // A displacement of 3 cm in 0.2 s, smooth at both ends.
    let place = |t: f64| {
        let u = (t / 0.2).clamp(0.0, 1.0);
        Vector3::x() * 0.03 * u.powi(4) * (35.0 - 84.0 * u + 70.0 * u * u - 20.0 * u.powi(3))
    };
    // Tip every 0.01 s.
    let path = |scheme, rate: f64| -> Vec<_> {
        let every = (rate / 100.0) as usize;
        tips(&rod, scheme, &place, 0.3, rate).into_iter().skip(every - 1).step_by(every).collect()
    };
    let truth = path(Scheme::FourStep, 12800.0);
    let error =
        |scheme, rate| path(scheme, rate).iter().zip(&truth).map(|(a, b)| (a - b).norm()).fold(0.0, f64::max);
    let order = |scheme| (error(scheme, 400.0) / error(scheme, 800.0)).log2();
    for (scheme, expected) in [(Scheme::BackwardEuler, 1.0), (Scheme::Bdf2, 2.0), (Scheme::FourStep, 2.0)] {
        let found = order(scheme);
        assert!((expected - 0.3..expected + 0.4).contains(&found), "{scheme:?}: {found}");
    }
    let bdf2 = error(Scheme::Bdf2, 400.0);
    assert!(bdf2 < 0.1 * error(Scheme::BackwardEuler, 400.0));
    assert!(error(Scheme::FourStep, 400.0) < 0.5 * bdf2);
}

#[test]
fn free_swing_decays_with_the_damping_of_the_scheme() {
    // A circular arc with a sagitta of L/20, released: nearly the first mode, ω = 1.8751² √(EI/ρSL⁴).
    let bend = 0.4 / LENGTH;
    let arc: Vec<_> = (0..=16)
        .map(|i| {
            let s = LENGTH * f64::from(i) / 16.0;
            Vector3::new((1.0 - (bend * s).cos()) / bend, -(bend * s).sin() / bend, 0.0)
        })
        .collect();
    let rod = hair(&arc);
    let omega = 1.8751_f64.powi(2) * (STIFFNESS / (LINE_DENSITY * LENGTH.powi(4))).sqrt();
    let (period, steps) = (TAU / omega, 40.0);
    let turn = TAU / steps;
    // Growth of y'' = −ω²y over a step: 1/(1 − iθ); for the others the root near 1 of the formula, to leading
    // order (docs/theory.md §4.6).
    let cubic = |loss: f64| (-TAU * turn.powi(3) * loss).exp();
    for (scheme, theory) in [
        (Scheme::BackwardEuler, 1.0 / (1.0 + turn * turn).powf(steps / 2.0)),
        (Scheme::Bdf2, cubic(0.25)),
        (Scheme::FourStep, cubic(0.02)),
    ] {
        let tip = tips(&rod, scheme, &|_| Vector3::zeros(), 4.5 * period, steps / period);
        let peak = |n: f64| {
            let (a, b) = ((n - 0.25) * steps, (n + 0.25) * steps);
            tip[a as usize..b as usize].iter().map(|x| x.x).fold(0.0, f64::max)
        };
        let measured = (peak(4.0) / peak(1.0)).cbrt();
        assert!((measured / theory - 1.0).abs() < 0.02, "{scheme:?}: {measured} {theory}");
    }
}
