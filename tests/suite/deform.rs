//! Strands and bodies that deform or close on them.

use crate::strand::hair;
use hairbake::bake;
use hairbake::bake::control::Control;
use hairbake::bake::job::{Job, JobOptions};
use hairbake::cache::Reader;
use hairbake::contact::{Bodies, Body};
use hairbake::dynamics::environment::Environment;
use hairbake::dynamics::guide::{ContactMode, GuideModel, GuideScratch, GuideState};
use hairbake::dynamics::step_record::StepRecord;
use hairbake::geometry::{Deformation, Shape, TriMesh};
use hairbake::rod::{RodShape, SegmentSize};
use hairbake::scene::anim::Scheme;
use hairbake::scene::{self, Collider, LoadOptions};
use nalgebra::{Isometry3, Vector3};
use std::f64::consts::TAU;
use std::path::{Path, PathBuf};
use std::sync::Arc;

const FPS: f64 = 24.0;
/// Steps a second.
const RATE: f64 = 192.0;
const THICKNESS: f64 = 5e-4;
const SCHEMES: [Scheme; 3] = [Scheme::BackwardEuler, Scheme::Bdf2, Scheme::FourStep];

fn collider(shape: Shape, deformation: Option<Deformation>) -> Collider {
    let deformation = deformation.map(Arc::new);
    Collider { name: "body".into(), body: 0, shape, deformation, friction: None, thickness: THICKNESS }
}

/// A mesh whose vertex p is at `shape(p, t)`, sampled at the frames of `seconds`.
fn moving(mesh: &TriMesh, seconds: f64, shape: impl Fn(&Vector3<f64>, f64) -> Vector3<f64>) -> Deformation {
    let sample = |i: usize| mesh.vertices.iter().map(|p| shape(p, i as f64 / FPS)).collect();
    let frames = (seconds * FPS).round() as usize;
    Deformation { start: 0.0, rate: FPS, samples: (0..=frames).map(sample).collect() }
}

/// [`run_with`] the default scheme.
fn run(
    colliders: &[Collider],
    place: &(dyn Fn(usize, f64) -> Vector3<f64> + Sync),
    seconds: f64,
    each: impl FnMut(&GuideState, f64, StepRecord),
) -> (f64, GuideState) {
    run_with(Scheme::default(), colliders, place, seconds, each)
}

/// Steps a hair for `seconds` among `colliders`, of which body b moves as `place(b, t)`; `each` sees every
/// step. Returns the largest relative change of a segment length, and the state.
fn run_with(
    scheme: Scheme,
    colliders: &[Collider],
    place: &(dyn Fn(usize, f64) -> Vector3<f64> + Sync),
    seconds: f64,
    mut each: impl FnMut(&GuideState, f64, StepRecord),
) -> (f64, GuideState) {
    let mut env = Environment {
        body: Box::new(|b, t| {
            Isometry3::from_parts(place(b, t).into(), nalgebra::UnitQuaternion::identity())
        }),
        ..Environment::at_rest(Bodies::new(colliders.iter().map(Body::from)))
    };
    let rod = hair(0.2, SegmentSize::FINE);
    let drag = vec![2e-5; rod.points()];
    let (thickness, h) = (vec![THICKNESS; colliders.len()], 1.0 / RATE);
    let mut scratch = GuideScratch::default();
    env.bodies.prepare([0.0, 0.0]);
    let model = GuideModel { scheme, ..GuideModel::new(rod, drag, 0.3) };
    let mut state = GuideState::new(&model, &thickness, &env, 0.0, h);
    for i in 0..(seconds * RATE) as u32 {
        let span = [f64::from(i) * h, f64::from(i + 1) * h];
        env.bodies.prepare(span);
        let record = model.step(&env, &mut state, span, ContactMode::Bodies, &mut scratch);
        each(&state, span[1], record);
    }
    let (rod, mut shape) = (&model.rod, RodShape::default());
    shape.update(rod, &rod.root.r, &state.q[0]);
    let drift = shape.length_drift(rod, &state.q[0]);
    (drift, state)
}

fn fastest(guide: &GuideState) -> f64 {
    guide.v.iter().map(|v| v.norm()).fold(0.0, f64::max)
}

/// A plate of 16 by 16 facets from x = 8 cm on.
fn plate() -> TriMesh {
    let vertex =
        |i: u32, j: u32| Vector3::new(0.08 + 0.015 * f64::from(i), 0.0, 0.015 * f64::from(j) - 0.1213);
    let at = |i: u32, j: u32| 17 * i + j;
    TriMesh {
        vertices: (0..17).flat_map(|i| (0..17).map(move |j| vertex(i, j))).collect(),
        triangles: (0..16)
            .flat_map(|i| (0..16).map(move |j| [at(i, j), at(i, j + 1), at(i + 1, j + 1), at(i + 1, j)]))
            .flat_map(|[a, b, c, d]| [[a, b, c], [a, c, d]])
            .collect(),
    }
}

#[test]
fn a_plate_that_rises_lifts_a_strand() {
    let mesh = plate();
    // At rest 6 cm down for half a second, then up by 9 cm in 0.6 s, then still.
    let height = |t: f64| {
        let u = ((t - 0.5) / 0.6).clamp(0.0, 1.0);
        -0.06 + 0.09 * u * u * (3.0 - 2.0 * u)
    };
    let motion = moving(&mesh, 2.5, |p, t| p + Vector3::y() * height(t));
    let mut deepest = f64::INFINITY;
    let mut carried = 0.0;
    let plate = [collider(Shape::Mesh(mesh), Some(motion.clone()))];
    let (_, guide) = run(&plate, &|_, _| Vector3::zeros(), 2.5, |guide, t, record| {
        let top = motion.vertices(t)[0].y;
        for x in guide.x.iter().filter(|x| x.x > 0.08) {
            deepest = deepest.min(x.y - top);
        }
        if t <= 0.8 {
            carried = guide.v[guide.v.len() - 1].y;
        }
        assert_eq!((record.unconverged, record.truncated), (0, 0), "at {t} s");
    });
    assert!(deepest > 0.0, "under the plate by {} mm", -1e3 * deepest);
    // Half way up the plate goes at 1.5 · 9 cm / 0.6 s.
    assert!((carried - 0.225).abs() < 0.02, "carried at {carried} m/s");
    let tip = guide.x[guide.x.len() - 1];
    assert!((0.03..0.032).contains(&tip.y), "the tip is at {} m", tip.y);
    assert!(fastest(&guide) < 5e-3, "still moves at {} m/s", fastest(&guide));
}

#[test]
fn a_sphere_that_breathes_keeps_the_strand_out() {
    let centre = Vector3::new(0.1, -0.045, 0.003);
    let ball = Shape::Sphere { centre, radius: 0.04 }.tessellate();
    let radius = |t: f64| 0.04 - 0.012 * (TAU * 2.0 * t).sin();
    let motion = moving(&ball, 1.5, |p, t| centre + (p - centre) * (radius(t) / 0.04));
    let (mut deepest, mut touched) = (f64::INFINITY, 0);
    let colliders = [collider(Shape::Mesh(ball), Some(motion.clone()))];
    run(&colliders, &|_, _| Vector3::zeros(), 1.5, |guide, t, record| {
        // The facets are outside of a sphere through their vertices shrunk by what they stand off it.
        let r = (motion.vertices(t)[0] - centre).norm() / 1.0022;
        for w in guide.x.windows(2) {
            let u = ((centre - w[0]).dot(&(w[1] - w[0])) / (w[1] - w[0]).norm_squared()).clamp(0.0, 1.0);
            deepest = deepest.min((w[0].lerp(&w[1], u) - centre).norm() - r);
        }
        touched += record.active;
        assert_eq!((record.unconverged, record.truncated), (0, 0), "at {t} s");
    });
    assert!(deepest > 0.0, "inside by {} mm", -1e3 * deepest);
    assert!(touched > 100, "hardly touches it");
}

/// A ball presses a strand on a floor, goes on into the floor, and leaves again: there is no place for the
/// strand meanwhile.
#[test]
fn a_strand_between_closing_bodies_stays_calm_and_is_reported() {
    let floor = Shape::Plane { point: Vector3::y() * -0.03, normal: Vector3::y() };
    let ball = Shape::Sphere { centre: Vector3::new(0.13, 0.0, 0.004), radius: 0.03 };
    // The bottom of the ball: 3 cm above the floor, then 4 mm into it, then up again.
    let above = |t: f64| {
        let share = |t: f64| t.clamp(0.0, 1.0).powi(2) * (3.0 - 2.0 * t.clamp(0.0, 1.0));
        0.03 - 0.034 * (share((t - 0.5) / 0.5) - share((t - 1.0) / 0.5))
    };
    let place = |b: usize, t: f64| if b == 1 { Vector3::y() * above(t) } else { Vector3::zeros() };
    let (mut speed, mut closed, mut pinched, mut deepest) = (0.0_f64, 0, 0, 0.0_f64);
    let colliders = [collider(floor, None), collider(ball, None)];
    let (drift, guide) = run(&colliders, &place, 2.5, |guide, t, record| {
        assert!(guide.x.iter().all(|x| x.iter().all(|c| c.is_finite())), "at {t} s");
        if t > 0.5 {
            speed = speed.max(fastest(guide));
        }
        if above(t) < 0.0 {
            closed += 1;
            pinched += u32::from(guide.is_pinched());
            deepest = deepest.max(record.penetration);
        }
        assert_eq!((record.unconverged, record.truncated), (0, 0), "at {t} s");
    });
    assert!(closed > 30 && pinched > 30, "pinched in {pinched} of {closed} steps");
    assert!(!guide.is_pinched());
    assert!(deepest < 5e-3, "{} mm deep", 1e3 * deepest);
    assert!(speed < 2.0, "thrown at {speed} m/s");
    let lowest = guide.x.iter().map(|x| x.y + 0.03).fold(f64::INFINITY, f64::min);
    assert!(lowest > 0.0, "left under the floor by {} mm", -1e3 * lowest);
    assert!(fastest(&guide) < 5e-3, "still moves at {} m/s", fastest(&guide));
    assert!(drift < 1e-3);
}

/// Two shapes as one mesh.
fn one_mesh(shapes: [Shape; 2]) -> TriMesh {
    let [mut mesh, other] = shapes.map(|shape| shape.tessellate());
    let first = mesh.vertices.len() as u32;
    mesh.vertices.extend(other.vertices);
    mesh.triangles.extend(other.triangles.iter().map(|t| t.map(|v| v + first)));
    mesh
}

/// Two balls of one mesh: the root is under one, and the other comes from below until the root is 8 mm inside.
/// Where it passes the root within a step, and with which motion, differs with its travel and the scheme.
#[test]
fn a_part_that_swallows_a_root_leaves_the_strand_with_it() {
    for travel in [0.058, 0.0588, 0.0594] {
        for scheme in SCHEMES {
            swallow_root(scheme, -Vector3::y(), travel);
        }
    }
}

/// The other comes from the side, where no surface faces that of the first.
#[test]
fn a_part_that_swallows_a_root_at_an_angle_leaves_the_strand_with_it() {
    for scheme in SCHEMES {
        swallow_root(scheme, -Vector3::z(), 0.058);
    }
}

/// The other ball comes by `travel`, m, from the side `from`, a unit vector.
fn swallow_root(scheme: Scheme, from: Vector3<f64>, travel: f64) {
    const RADIUS: f64 = 0.04;
    let ball = |centre: Vector3<f64>| Shape::Sphere { centre, radius: RADIUS };
    let share = |t: f64| t.clamp(0.0, 1.0).powi(2) * (3.0 - 2.0 * t.clamp(0.0, 1.0));
    let near = |t: f64| travel * (share((t - 0.2) / 0.8) - share((t - 1.1) / 0.8));
    let start = from * (0.05 + RADIUS);
    let balls = one_mesh([ball(Vector3::y() * (RADIUS + THICKNESS)), ball(start)]);
    let moves = |p: &Vector3<f64>| (p - start).norm() < 1.01 * RADIUS;
    let motion = moving(&balls, 2.0, |p, t| if moves(p) { p - from * near(t) } else { *p });
    let colliders = [collider(Shape::Mesh(balls), Some(motion))];
    let mut swallowed = 0.0_f64;
    run_with(scheme, &colliders, &|_, _| Vector3::zeros(), 2.0, |guide, t, record| {
        let case = || format!("{scheme:?}, {travel} m, {t} s");
        assert_eq!((record.unconverged, record.truncated), (0, 0), "{}", case());
        let centre = start - from * near(t);
        let depth = |x: &Vector3<f64>| RADIUS - (x - centre).norm();
        let root = depth(&guide.x[0]);
        swallowed = swallowed.max(root);
        let mut s = 0.0;
        for x in guide.x.windows(2) {
            s += (x[1] - x[0]).norm();
            // Out of the ball within a few centimetres, and never much deeper than the root.
            let allowed = if s > 0.06 { 1e-3 } else { root.max(0.0) + 2e-3 };
            assert!(depth(&x[1]) < allowed, "{} of {root} at {s} m: {}", depth(&x[1]), case());
        }
    });
    assert!(swallowed > 7e-3, "{swallowed}");
}

/// Two rolls of one mesh beside a hanging strand close on it, overlap by 1 cm, and part again.
#[test]
fn a_strand_between_parts_of_one_mesh_stays_between_them() {
    const RADIUS: f64 = 0.04;
    let roll = |side: f64| {
        let ends = [-0.2, 0.2].map(|x| Vector3::new(x, -0.12, side * 0.06));
        Shape::Capsule { ends, radius: RADIUS }
    };
    let rolls = one_mesh([roll(-1.0), roll(1.0)]);
    let share = |t: f64| t.clamp(0.0, 1.0).powi(2) * (3.0 - 2.0 * t.clamp(0.0, 1.0));
    let beside = |t: f64| RADIUS + 0.01 - 0.015 * (share((t - 0.8) / 0.3) - share((t - 1.4) / 0.3));
    let motion = moving(&rolls, 2.0, |p, t| p + Vector3::z() * ((beside(t) - 0.06) * p.z.signum()));
    let (mut deepest, mut speed, mut halvings) = (0.0_f64, 0.0_f64, 0);
    let mut shallow = 0.0;
    let colliders = [collider(Shape::Mesh(rolls), Some(motion))];
    run(&colliders, &|_, _| Vector3::zeros(), 2.0, |guide, t, record| {
        assert_eq!((record.unconverged, record.truncated, record.crossed), (0, 0, 0), "at {t} s");
        halvings += record.halvings;
        let overlap = (RADIUS - beside(t)).max(0.0);
        let depth = |x: &Vector3<f64>| {
            let rolls =
                [-1.0, 1.0].map(|side| RADIUS - (x - Vector3::new(0.0, -0.12, side * beside(t))).yz().norm());
            rolls[0].max(rolls[1])
        };
        shallow = guide.x.iter().map(depth).fold(f64::NEG_INFINITY, f64::max);
        // Never deeper than the middle between the two, whichever way they move.
        assert!(shallow < overlap + 1.2e-3, "{} mm deep in an overlap of {overlap} at {t} s", 1e3 * shallow);
        deepest = deepest.max(shallow);
        speed = if t > 0.7 { speed.max(fastest(guide)) } else { 0.0 };
    });
    assert!(deepest > 2e-3, "only {} mm deep", 1e3 * deepest);
    assert!(shallow < 2e-4, "left {} mm inside", 1e3 * shallow);
    assert!(speed < 1.0, "thrown at {speed} m/s");
    assert!(halvings < 20, "{halvings} halvings");
}

/// Long hair on a shoulder: a bodysuit that breathes, twists and shrugs, from its own sequence of files to
/// the cache.
#[test]
#[allow(clippy::print_stderr)]
fn hair_lies_on_a_garment_that_moves() {
    let heads = std::env::var_os("HAIRBAKE_DATA")
        .map_or_else(|| Path::new(env!("CARGO_MANIFEST_DIR")).join("../shared/data"), PathBuf::from)
        .join("heads");
    let suit = heads.join("makehuman_tights_shell_m.obj");
    let Ok(text) = std::fs::read_to_string(&suit) else {
        eprintln!("skipped: {} is not there", suit.display());
        return;
    };
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let (first, last) = (1, 14);
    for frame in first - 2..=last + 2 {
        let path = folder.join(format!("suit.{frame:04}.obj"));
        std::fs::write(path, deformed_obj(&text, f64::from(frame - first) / FPS)).unwrap();
    }
    std::fs::copy(&suit, folder.join("suit.obj")).unwrap();
    std::fs::copy(heads.join("makehuman_head_open_m.obj"), folder.join("head.obj")).unwrap();
    let strand = |i: u32| {
        let side = if i.is_multiple_of(2) { 1.0 } else { -1.0 };
        let z = 0.012 * f64::from(i / 2) - 0.03;
        let point = |k: u32| [side * (0.085 + 0.016 * f64::from(k)), 0.72 - 0.001 * f64::from(k * k), z];
        (0..16).map(point).collect::<Vec<_>>()
    };
    let points: Vec<[f64; 3]> = (0..16).flat_map(strand).collect();
    let groom = serde_json::json!({ "format": "hairbake-groom", "version": 1, "guides": { "vertices": 16, "points": points } });
    let mesh = |name: &str, file: &str, sequence: Option<&str>| {
        let mut shape = serde_json::json!({ "type": "mesh", "file": file });
        if let Some(sequence) = sequence {
            shape["sequence"] = sequence.into();
        }
        serde_json::json!({ "name": name, "shape": shape })
    };
    let anim = serde_json::json!({
        "format": "hairbake-anim", "version": 1, "fps": FPS, "frames": [first, last],
        "colliders": [mesh("head", "head.obj", None), mesh("suit", "suit.obj", Some("suit.####.obj"))],
    });
    let (groom_path, anim_path, out) =
        (folder.join("groom.json"), folder.join("anim.json"), folder.join("out"));
    std::fs::write(&groom_path, groom.to_string()).unwrap();
    std::fs::write(&anim_path, anim.to_string()).unwrap();

    let (groom, anim) = scene::load(&groom_path, &anim_path).unwrap();
    let inputs = bake::input_records(&groom_path, &anim_path, &LoadOptions::default()).unwrap();
    assert_eq!(inputs.iter().filter(|i| i.role == "deformation").count(), 18);
    let (mut active, mut shortened) = (0, 0);
    let job = Job::begin(groom, anim.clone(), inputs, JobOptions::default(), &out).unwrap();
    bake::bake(&job, &Control::default(), |record, _, _| {
        active += record.contacts_active;
        shortened += record.shortened;
    })
    .unwrap();
    assert!(active > 100, "{active} contacts push");
    assert_eq!(shortened, 0);

    let cache = Reader::open(&out).unwrap();
    assert_eq!(cache.header().colliders.iter().map(|c| c.deforms).collect::<Vec<_>>(), [false, true]);
    let mut bodies = Bodies::new(anim.colliders.iter().map(Body::from));
    let (mut deepest, mut near) = (f64::INFINITY, 0);
    for frame in cache.frames() {
        let t = anim.time(f64::from(*frame));
        bodies.prepare([t, t]);
        let frame = cache.read_frame(*frame).unwrap();
        let suit = anim.colliders[1].deformation.as_ref().unwrap().vertices(t);
        for (p, v) in frame.colliders[1].points.as_ref().unwrap().iter().zip(suit) {
            assert!((Vector3::from(*p).cast() - v).norm() < 1e-6);
        }
        for p in &frame.guides.points {
            let surface = bodies.closest(1, t, &Vector3::from(*p).cast(), 0.05);
            deepest = deepest.min(surface.map_or(0.05, |s| s.distance));
            near += usize::from(surface.is_some_and(|s| s.distance < 1e-3));
        }
    }
    assert!(deepest > -1e-5, "{} mm inside the suit", -1e3 * deepest);
    assert!(near > 100, "{near} points lie on the suit");
}

/// The OBJ file with its vertices where they are at `t`, s.
fn deformed_obj(text: &str, t: f64) -> String {
    let step = |x: f64, a: f64, b: f64| {
        let u = ((x - a) / (b - a)).clamp(0.0, 1.0);
        u * u * (3.0 - 2.0 * u)
    };
    let phase = (TAU * 1.2 * t).sin();
    let moved = |line: &str| {
        let xyz: Vec<f64> = line[2..].split_whitespace().map(|x| x.parse().unwrap()).collect();
        let (x, y, z) = (xyz[0], xyz[1], xyz[2]);
        // Chest and back out, shoulders up, and all above the waist turned.
        let swell = 1.0 + 0.05 * phase * step(y, 0.1, 0.35) * (1.0 - step(y, 0.45, 0.55));
        let shrug = 0.04 * phase * step(x.abs(), 0.05, 0.15) * step(y, 0.3, 0.5);
        let (sin, cos) = (0.25 * phase * step(y, 0.0, 0.5) * (1.0 - step(y, 0.55, 0.62))).sin_cos();
        let (x, z) = (x * swell, 0.05 + (z - 0.05) * swell);
        format!("v {:.6} {:.6} {:.6}", x * cos + z * sin, y + shrug, z * cos - x * sin)
    };
    let line = |line: &str| if line.starts_with("v ") { moved(line) } else { line.into() };
    text.lines().map(line).collect::<Vec<String>>().join("\n")
}
