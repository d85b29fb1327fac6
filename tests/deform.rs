//! Strands and bodies that deform or close on them.

use hairbake::bake::guide::{Guide, StepRecord, Surroundings, Workspace};
use hairbake::contact::Bodies;
use hairbake::rod::{Rod, RodSource};
use hairbake::scene::{Collider, Deformation, Shape, Tree, TriMesh};
use nalgebra::{Isometry3, Vector3};
use std::f64::consts::TAU;
use std::sync::Arc;

const FPS: f64 = 24.0;
/// Steps a second.
const RATE: f64 = 192.0;
const THICKNESS: f64 = 5e-4;

/// A straight horizontal hair of 20 cm, clamped at the origin.
fn hair() -> Rod {
    Rod::new(&RodSource {
        points: &[Vector3::zeros(), Vector3::x() * 0.2],
        root_frame: None,
        arc: &Tree::default_arc(8),
        stiffness: [7.8e-9, 7.8e-9, 3.6e-9],
        line_density: 6.6e-6,
        damping: 0.005,
        natural: None,
        max_step: 0.01,
    })
    .unwrap()
}

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

/// Steps a hair for `seconds` among `colliders`, body b of which is moved by `place(b, t)`; `each` sees every step.
fn run(
    colliders: &[Collider],
    place: &(dyn Fn(usize, f64) -> Vector3<f64> + Sync),
    seconds: f64,
    mut each: impl FnMut(&Guide, f64, StepRecord),
) -> Guide {
    let mut bodies = Bodies::new(colliders);
    let around = |bodies: &Bodies, work: &mut dyn FnMut(&Surroundings)| {
        work(&Surroundings {
            head: &|_| Isometry3::identity(),
            gravity: &|_| Vector3::y() * -9.81,
            wind: &[],
            bodies,
            body: &|b, t| Isometry3::from_parts(place(b, t).into(), nalgebra::UnitQuaternion::identity()),
            brought_out: &|_| 1.0,
        });
    };
    let rod = hair();
    let drag = vec![2e-5; rod.points()];
    let (thickness, h) = (vec![THICKNESS; colliders.len()], 1.0 / RATE);
    let (mut guide, mut work) = (None, Workspace::default());
    bodies.prepare([0.0, 0.0]);
    around(&bodies, &mut |around| {
        guide = Some(Guide::new(rod.clone(), drag.clone(), 0.3, &thickness, around, 0.0, h));
    });
    let mut guide = guide.unwrap();
    for i in 0..(seconds * RATE) as u32 {
        let times = [f64::from(i) * h, f64::from(i + 1) * h];
        bodies.prepare(times);
        around(&bodies, &mut |around| {
            let record = guide.advance(around, times[0], times[1], &mut work);
            each(&guide, times[1], record);
        });
    }
    guide
}

fn fastest(guide: &Guide) -> f64 {
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
        ..TriMesh::default()
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
    let guide = run(&plate, &|_, _| Vector3::zeros(), 2.5, |guide, t, record| {
        let top = motion.vertices(t)[0].y;
        for x in guide.x.iter().filter(|x| x.x > 0.08) {
            deepest = deepest.min(x.y - top);
        }
        if t <= 0.8 {
            carried = guide.v[guide.v.len() - 1].y;
        }
        assert_eq!((record.unconverged, record.shortened), (0, 0), "at {t} s");
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
        assert_eq!((record.unconverged, record.shortened), (0, 0), "at {t} s");
    });
    assert!(deepest > 0.0, "inside by {} mm", -1e3 * deepest);
    assert!(touched > 100, "hardly touches it");
}

/// A ball presses a strand on a floor, goes on into the floor, and leaves again: there is no place for the strand meanwhile.
#[test]
fn a_strand_between_closing_bodies_stays_calm_and_is_reported() {
    let floor = Shape::Plane { point: Vector3::y() * -0.03, normal: Vector3::y() };
    let ball = Shape::Sphere { centre: Vector3::new(0.13, 0.0, 0.004), radius: 0.03 };
    // The bottom of the ball: 3 cm above the floor, then 4 mm into it, then up again.
    let above = |t: f64| {
        let share = |t: f64| t.clamp(0.0, 1.0).powi(2) * (3.0 - 2.0 * t.clamp(0.0, 1.0));
        0.03 - 0.034 * (share((t - 0.5) / 0.5) - share((t - 1.5) / 0.5))
    };
    let place = |b: usize, t: f64| if b == 1 { Vector3::y() * above(t) } else { Vector3::zeros() };
    let (mut speed, mut closed, mut deepest, mut shortened) = (0.0_f64, 0, 0.0_f64, 0);
    let colliders = [collider(floor, None), collider(ball, None)];
    let guide = run(&colliders, &place, 3.0, |guide, t, record| {
        assert!(guide.x.iter().all(|x| x.iter().all(|c| c.is_finite())), "at {t} s");
        if t > 0.5 {
            speed = speed.max(fastest(guide));
        }
        if above(t) < 0.0 {
            closed += 1;
            deepest = deepest.max(record.penetration);
            shortened += record.shortened;
        }
        assert_eq!(record.unconverged, 0, "at {t} s");
        println!(
            "{t:.3} {:.5} {:.3} {} {:.6} {}",
            above(t),
            fastest(guide),
            record.shortened,
            record.penetration,
            record.residual
        );
    });
    assert!(closed > 50);
    assert!(
        shortened > 0 || deepest > 1e-3,
        "nothing told: {shortened} cut short, {} mm deep",
        1e3 * deepest
    );
    assert!(deepest < 5e-3, "{} mm deep", 1e3 * deepest);
    assert!(speed < 1.0, "thrown at {speed} m/s");
    let lowest = guide.x.iter().map(|x| x.y + 0.03).fold(f64::INFINITY, f64::min);
    assert!(lowest > 0.0, "left under the floor by {} mm", -1e3 * lowest);
    assert!(fastest(&guide) < 5e-3, "still moves at {} m/s", fastest(&guide));
    assert!(guide.length_drift() < 1e-3);
}
