//! Contact detection for a film character: 228 guides of 16 segments against a bust of 5,952 triangles, with
//! the head rotating at 5 rad/s and moving at 1 m/s, for one sub-step of 1/192 s of all guides on one thread.
//!
//! Skipped without the data (`HAIRBAKE_DATA`, or `../shared/data`).

use divan::Bencher;
use hairbake::contact::{
    Bodies, BodyMotion, ContactCache, FrictionProblem, FrictionScratch, FrictionTolerance, MovingPolyline,
    solve,
};
use hairbake::geometry::{Shape, TriMesh};
use hairbake::scene::Convention;
use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};
use std::path::{Path, PathBuf};

fn main() {
    divan::main();
}

const SEGMENTS: usize = 16;

struct Scene {
    bodies: Bodies,
    motion: BodyMotion,
    /// Vertices of each guide at the start and at the end, m.
    guides: Vec<[Vec<Vector3<f64>>; 2]>,
    clearances: Vec<Vec<[f64; 2]>>,
}

/// The guides, m, with 17 of the 32 vertices of each.
fn guides(path: &Path) -> Option<Vec<Vec<Vector3<f64>>>> {
    let bytes = std::fs::read(path).ok()?;
    let number = |i: usize| f32::from_le_bytes([bytes[i], bytes[i + 1], bytes[i + 2], bytes[i + 3]]);
    let (strands, vertices, header) = (228, 32, 160);
    let point = |s: usize, v: usize| {
        let at = header + 16 * (s * vertices + v);
        Vector3::from_fn(|axis, _| f64::from(number(at + 4 * axis)) * 0.01)
    };
    let strand = |s| (0..=SEGMENTS).map(|k| point(s, (k * (vertices - 1)).div_ceil(SEGMENTS))).collect();
    Some((0..strands).map(strand).collect())
}

fn sintel() -> Option<Scene> {
    let beside = Path::new(env!("CARGO_MANIFEST_DIR")).join("../shared/data");
    let data = std::env::var_os("HAIRBAKE_DATA").map_or(beside, PathBuf::from);
    let curves = guides(&data.join("grooms/sintel_guides_228x32_cm.tfx"))?;
    let centimetres = Convention { metres_per_unit: 0.01, ..Convention::default() };
    let (mesh, _) = TriMesh::load_obj(&data.join("heads/sintel_bust_cm.obj"), &centimetres).ok()?;
    let bodies = Bodies::from_shapes(&[Shape::Mesh(mesh)]);
    let step = 1.0 / 192.0;
    let centre = curves.iter().map(|curve| curve[0]).sum::<Vector3<f64>>() / curves.len() as f64;
    let turn = UnitQuaternion::from_scaled_axis(Vector3::y() * 5.0 * step);
    let end = Isometry3::from_parts(Translation3::from(centre - turn * centre + Vector3::x() * step), turn);
    let motion = BodyMotion { times: [0.0, 1.0], start: Isometry3::identity(), end };
    let mut scene = Scene { bodies, motion, guides: Vec::new(), clearances: Vec::new() };
    for x0 in curves {
        let carried = |x: &Vector3<f64>| end.rotation * x + end.translation.vector;
        // The root follows the head, the tip stays.
        let x1 = x0.iter().enumerate().map(|(k, x)| carried(x).lerp(x, k as f64 / SEGMENTS as f64)).collect();
        let clearance = |(k, x): (usize, &Vector3<f64>)| match k {
            0 | 1 => f64::NEG_INFINITY,
            _ => scene.bodies.closest(0, 0.0, x, 1.0).map_or(2e-4, |s| s.distance.min(2e-4)),
        };
        let clearances: Vec<f64> = x0.iter().enumerate().map(clearance).collect();
        scene.clearances.push(clearances.array_windows().copied().collect());
        scene.guides.push([x0, x1]);
    }
    Some(scene)
}

fn each_guide(bencher: Bencher, mut work: impl FnMut(&Scene, &MovingPolyline, &mut ContactCache) -> usize) {
    let Some(scene) = sintel() else { return };
    let mut caches = vec![ContactCache::default(); scene.guides.len()];
    bencher.bench_local(|| {
        let mut found = 0;
        for (([x0, x1], clearance), cache) in scene.guides.iter().zip(&scene.clearances).zip(&mut caches) {
            found += work(&scene, &MovingPolyline { x0, x1, clearance, by_part: false }, cache);
        }
        assert!(found > 0, "no contacts: not the expected scene");
        found
    });
}

#[divan::bench]
fn candidates(bencher: Bencher) {
    let mut contacts = Vec::new();
    each_guide(bencher, |scene, line, work| {
        contacts.clear();
        scene.bodies.candidates(&[scene.motion], line, 5e-4, work, &mut contacts);
        contacts.len()
    });
}

#[divan::bench]
fn impacts(bencher: Bencher) {
    let mut contacts = Vec::new();
    each_guide(bencher, |scene, line, work| {
        contacts.clear();
        scene.bodies.impacts(&[scene.motion], line, work, &mut contacts);
        contacts.len()
    });
}

#[divan::bench]
fn candidates_and_impacts(bencher: Bencher) {
    let mut contacts = Vec::new();
    each_guide(bencher, |scene, line, work| {
        contacts.clear();
        scene.bodies.candidates(&[scene.motion], line, 5e-4, work, &mut contacts);
        scene.bodies.impacts(&[scene.motion], line, work, &mut contacts);
        contacts.len()
    });
}

/// With empty caches, as after a jump.
#[divan::bench]
fn candidates_and_impacts_without_cached_bounds(bencher: Bencher) {
    let mut contacts = Vec::new();
    each_guide(bencher, |scene, line, _| {
        contacts.clear();
        let mut work = ContactCache::default();
        scene.bodies.candidates(&[scene.motion], line, 5e-4, &mut work, &mut contacts);
        scene.bodies.impacts(&[scene.motion], line, &mut work, &mut contacts);
        contacts.len()
    });
}

/// Signed distance of every guide vertex, without caches.
#[divan::bench]
fn closest_of_3876_vertices(bencher: Bencher) {
    each_guide(bencher, |scene, line, _| {
        line.x0
            .iter()
            .filter_map(|x| scene.bodies.closest(0, 0.0, x, 0.05))
            .filter(|s| s.distance < 0.0)
            .count()
    });
}

/// A strand with 24 unknowns and `n` contacts, from zero impulses.
#[divan::bench(args = [4, 16, 32])]
fn coulomb(bencher: Bencher, n: usize) {
    let (rows, freedoms) = (3 * n, 24);
    let entry = |i: usize, j: usize| ((i * 37 + j * 91) as f64 * 0.618).sin();
    let w: Vec<f64> = (0..rows * rows)
        .map(|k| {
            (0..freedoms).map(|j| entry(k / rows, j) * entry(k % rows, j)).sum::<f64>() / freedoms as f64
        })
        .collect();
    let b: Vec<f64> = (0..rows).map(|i| (0..freedoms).map(|j| entry(i, j) * entry(j, 7)).sum()).collect();
    let friction = vec![0.3.into(); n];
    let problem = FrictionProblem { w: &w, b: &b, friction: &friction };
    let tolerance = FrictionTolerance { residual: 1e-6, sweeps: 500, continuation: true };
    let (mut r, mut scratch) = (vec![0.0; rows], FrictionScratch::default());
    bencher.bench_local(|| {
        r.fill(0.0);
        solve(&problem, tolerance, &mut r, &mut scratch)
    });
}
