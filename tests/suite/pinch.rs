//! A strand between bodies that close on it and open again, and a strand whose root a body swallows.

use crate::common::{Scene, bake, here};
use crate::strand::hair;
use hairbake::contact::Bodies;
use hairbake::dynamics::environment::Environment;
use hairbake::dynamics::guide::{ContactMode, GuideModel, GuideScratch, GuideState};
use hairbake::dynamics::step_record::StepRecord;
use hairbake::geometry::Shape;
use hairbake::rod::SegmentSize;
use hairbake::scene::anim::Scheme;
use nalgebra::{Isometry3, Vector3};
use serde_json::{Value, json};

const RADIUS: f64 = 0.04;
const THICKNESS: f64 = 5e-4;
const STEP: f64 = 1.0 / 192.0;
const SCHEMES: [Scheme; 3] = [Scheme::BackwardEuler, Scheme::Bdf2, Scheme::FourStep];

/// How two rolls lie at a time, s: their centres, m.
type Centres = dyn Fn(f64) -> [Vector3<f64>; 2] + Sync;

/// How a hair is stepped.
struct Hair {
    scheme: Scheme,
    friction: f64,
    /// Where its clamp is at a time, s, m.
    root: fn(f64) -> Vector3<f64>,
}

impl Default for Hair {
    fn default() -> Self {
        Self { scheme: Scheme::default(), friction: 0.3, root: |_| Vector3::zeros() }
    }
}

/// A hair of 20 cm along x among two rolls of this half axis, m, for 2 s. Calls `each` after every step.
fn run(
    Hair { scheme, friction, root }: Hair,
    half: Vector3<f64>,
    centres: &Centres,
    mut each: impl FnMut(&GuideState, [Vector3<f64>; 2], StepRecord),
) {
    let roll = Shape::Capsule { ends: [-half, half], radius: RADIUS };
    let env = Environment {
        head: Box::new(|t| Isometry3::from(root(t))),
        body: Box::new(|b, t| Isometry3::translation(centres(t)[b].x, centres(t)[b].y, centres(t)[b].z)),
        ..Environment::at_rest(Bodies::from_shapes(&[roll.clone(), roll]))
    };
    let rod = hair(0.2, SegmentSize::FINE);
    let drag = vec![2e-5; rod.points()];
    let model = GuideModel { scheme, ..GuideModel::new(rod, drag, friction) };
    let mut state = GuideState::new(&model, &[THICKNESS; 2], &env, 0.0, STEP);
    let mut scratch = GuideScratch::default();
    for i in 0..(2.0 / STEP) as u32 {
        let span = [f64::from(i) * STEP, f64::from(i + 1) * STEP];
        let record = model.step(&env, &mut state, span, ContactMode::Bodies, &mut scratch);
        each(&state, centres(span[1]), record);
    }
}

/// From 0 to 1 in 0.3 s from time `from`, s.
fn ramp(from: f64, t: f64) -> f64 {
    let u = ((t - from) / 0.3).clamp(0.0, 1.0);
    u * u * (3.0 - 2.0 * u)
}

/// From 0 to 1 between 0.8 and 1.1 s, and back to 0 between 1.4 and 1.7 s.
fn closed(t: f64) -> f64 {
    ramp(0.8, t) - ramp(1.4, t)
}

#[test]
fn a_strand_between_bodies_that_close_and_open_stays_between_them() {
    // Beside the hanging strand, from 2 cm apart to an overlap of 1 cm.
    let centres = |t: f64| {
        let beside = RADIUS + 0.01 - 0.015 * closed(t);
        [-1.0, 1.0].map(|side| Vector3::new(0.0, -0.12, side * beside))
    };
    let (mut deepest, mut fastest, mut halvings): (f64, f64, u32) = (0.0, 0.0, 0);
    let mut shallow: f64 = 0.0;
    // Long rolls, which hair cannot leave sideways.
    run(Hair::default(), Vector3::x() * 0.2, &centres, |state, centres, record| {
        assert_eq!((record.truncated, record.crossed, record.unconverged), (0, 0, 0), "{record:?}");
        halvings += record.halvings;
        let overlap = (2.0 * RADIUS - (centres[1] - centres[0]).norm()).max(0.0);
        for x in &state.x {
            let depths = centres.map(|c| RADIUS - (x - c).yz().norm());
            // Never deeper than the middle between the two, whichever way they move.
            let depth = depths[0].max(depths[1]);
            assert!(depth < 0.5 * overlap + 1e-3, "{depths:?} of {overlap}");
            deepest = deepest.max(depth);
        }
        if overlap > 0.0 || centres[0].z.abs() < RADIUS + 0.005 {
            fastest = fastest.max(state.v.iter().map(|v| v.norm()).fold(0.0, f64::max));
        }
        shallow = state
            .x
            .iter()
            .flat_map(|x| centres.map(|c| RADIUS - (x - c).yz().norm()))
            .fold(f64::NEG_INFINITY, f64::max);
    });
    // The strand was in the overlap, is out of it, and was not thrown.
    assert!(deepest > 2e-3, "{deepest}");
    assert!(shallow <= 0.0, "{shallow}");
    assert!(fastest < 1.0, "{fastest}");
    assert!(halvings < 20, "{halvings}");
}

#[test]
fn a_strand_is_drawn_out_from_between_bodies_that_leave_no_room() {
    // Rolls across it close to an overlap of 2 cm, from which it runs out of a wedge on both sides.
    for (friction, place) in [(0.3, 0.1), (1.0, 0.1), (1.0, 0.05)] {
        let root = |t: f64| Vector3::x() * -0.1 * ramp(1.1, t);
        let centres = move |t: f64| {
            let beside = RADIUS + 0.02 - 0.03 * ramp(0.4, t);
            [-1.0, 1.0].map(|side| Vector3::new(place, -0.02 + side * beside, 0.0))
        };
        let (mut fastest, mut tips): (f64, Vec<f64>) = (0.0, Vec::new());
        let hair = Hair { friction, root, ..Hair::default() };
        run(hair, Vector3::z() * 0.2, &centres, |state, _, record| {
            assert_eq!((record.truncated, record.crossed, record.unconverged), (0, 0, 0), "{record:?}");
            fastest = fastest.max(state.v.iter().map(|v| v.norm()).fold(0.0, f64::max));
            tips.push(state.x[state.x.len() - 1].x);
        });
        assert!(fastest < 3.0, "{fastest}");
        // At 1.1 s and in the end.
        let [before, after] = [(1.1 / STEP) as usize, tips.len() - 1].map(|i| tips[i]);
        assert!(before - after > 0.03, "{before} {after}");
    }
}

/// A ball comes from below, or also from the side, until the root is some 8 mm inside. Where it passes the root
/// within a step, and with which motion, differs with its travel and the scheme: it may end a step just inside, just
/// outside, or at the distance that hair keeps.
#[test]
fn a_body_that_swallows_a_root_leaves_the_strand_with_it() {
    for from in [-Vector3::y(), (Vector3::z() - Vector3::y()).normalize()] {
        for travel in [0.0577, 0.058, 0.0588] {
            SCHEMES.iter().for_each(|scheme| swallow_root(*scheme, from, travel));
        }
    }
}

/// A ball comes from the side `from`, a unit vector, by `travel`, m, and leaves again.
fn swallow_root(scheme: Scheme, from: Vector3<f64>, travel: f64) {
    let centres = move |t: f64| [from * (0.05 + RADIUS - travel * closed(t)), Vector3::repeat(5.0)];
    let (mut swallowed, mut fastest): (f64, f64) = (0.0, 0.0);
    let hair = Hair { scheme, ..Hair::default() };
    run(hair, Vector3::x() * 1e-6, &centres, |state, [centre, _], record| {
        let case = || format!("{scheme:?}, {travel} m: {record:?}");
        assert_eq!((record.truncated, record.crossed, record.unconverged), (0, 0, 0), "{}", case());
        let depth = |x: &Vector3<f64>| RADIUS - (x - centre).norm();
        let root = depth(&state.x[0]);
        swallowed = swallowed.max(root);
        let mut s = 0.0;
        for x in state.x.windows(2) {
            s += (x[1] - x[0]).norm();
            // Out of the body within a few centimetres, and never much deeper than the root.
            let allowed = if s > 0.06 { 5e-4 } else { root.max(0.0) + 2e-3 };
            assert!(depth(&x[1]) < allowed, "{} of {root} at {s}, {}", depth(&x[1]), case());
        }
        if root > -0.01 {
            fastest = fastest.max(state.v.iter().map(|v| v.norm()).fold(0.0, f64::max));
        }
    });
    assert!(swallowed > 7e-3, "{swallowed}");
    assert!(fastest < 1.5, "{fastest} m/s: {scheme:?}, {travel} m from {from:?}");
}

#[test]
fn pinched_hair_is_recorded_and_warned_of_and_breaks_no_guarantee() {
    let scene = Scene::import();
    let points: Vec<Value> = (0..=30).map(|i| json!([0.0, -0.01 * f64::from(i), 0.0])).collect();
    let groom = json!({
        "format": "hairbake-groom", "version": 1,
        "guides": { "points": points, "vertices": [31] }
    });
    let mut anim: Value = serde_json::from_slice(&here(&scene.anim)).unwrap();
    // From 12 cm apart to 7 cm within two frames: the balls overlap by 1 cm then.
    let body = |name: &str, side: f64| {
        let at = |i: i32| 0.06 - 0.025 * (f64::from(i - 2) / 2.0).clamp(0.0, 1.0);
        let translation: Vec<Value> = (0..8).map(|i| json!([0.0, 1.35, side * at(i)])).collect();
        json!({ "name": name, "track": { "fps": 24.0, "translation": translation } })
    };
    let bodies = anim["bodies"].as_array_mut().unwrap();
    bodies.push(body("left", -1.0));
    bodies.push(body("right", 1.0));
    let ball = |name: &str| {
        let shape = json!({ "type": "sphere", "centre": [0.0, 0.0, 0.0], "radius": RADIUS });
        json!({ "name": name, "body": name, "shape": shape })
    };
    anim["colliders"] = json!([ball("left"), ball("right")]);
    std::fs::write(&scene.groom, groom.to_string()).unwrap();
    std::fs::write(&scene.anim, anim.to_string()).unwrap();
    let out = scene.folder.path().join("out");
    let assert = bake(&scene.groom, &scene.anim, &out).args(["--strict", "--figures"]).assert().success();
    let text = String::from_utf8_lossy(&assert.get_output().stderr).into_owned();
    assert!(text.contains("leave no room for it: it is inside left, right"), "{text}");
    assert!(text.contains("pinched"), "{text}");
    let manifest: Value = serde_json::from_slice(&here(&out.join("manifest.json"))).unwrap();
    let frames = manifest["frames"].as_array().unwrap();
    let figures = &frames[frames.len() - 1]["figures"];
    assert!(figures["pinched_segments"].as_u64() > Some(0), "{figures}");
    let totals = &manifest["totals"];
    assert!(totals["pinched_penetration_m"].as_f64() > Some(3e-3), "{totals}");
    assert!(figures["penetration_m"].as_f64() < Some(1e-3), "{figures}");
}
