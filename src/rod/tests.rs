//! Tests of the rod that involve several of its files.

use super::block_factor::BlockFactor;
use super::hessian::hessian;
use super::joint::RootJoint;
use super::model::{Rod, RodSource, Taper, lerp_from_one};
use super::newton::Solver;
use super::potential::{Load, PointLoad, StrainSpring, energy, gradient};
use super::segment::SegmentSize;
use super::sensitivity::Sensitivity;
use super::shape::RodShape;
use crate::math::cholesky;
use crate::math::lanes::V3;
use nalgebra::Vector3;

#[test]
fn tapered_rod_bends_as_a_tapered_beam() {
    let (l, ei, density, g) = (0.1, 7.8e-9, 6.6e-6, 9.81);
    let arc: Vec<f64> = (0..33).map(|i| f64::from(i) / 32.0).collect();
    let taper = Taper { stiffness: 0.5, radius: 0.6, damping: 1.0 };
    let rod = Rod::new(&RodSource {
        stiffness: [ei, ei, 3.6e-9],
        line_density: density,
        taper,
        ..RodSource::hair(&[Vector3::zeros(), Vector3::x() * l], &arc)
    })
    .unwrap();
    // Curvature M/EI at the root and at half length under the weight beyond, by quadrature.
    let n = 20_000;
    let moment = |s: f64| -> f64 {
        let beyond = (0..n).map(|i| s + (l - s) * (f64::from(i) + 0.5) / f64::from(n));
        beyond.map(|x| density * lerp_from_one(0.6, x / l).powi(2) * g * (x - s)).sum::<f64>() * (l - s)
            / f64::from(n)
    };
    let mut shape = RodShape::default();
    let (mut sensitivity, zero) = (Sensitivity::default(), vec![0.0; rod.unknowns()]);
    shape.update(&rod, &rod.root.r, &zero);
    sensitivity.update(&rod, &shape, &zero);
    let mut load = vec![0.0; rod.unknowns()];
    for k in 1..rod.points() {
        sensitivity.add_row(k, &shape.x(k), &(Vector3::y() * -g), rod.mass[k], &mut load);
    }
    let strain = rod.static_strain(&load);
    for (node, s) in [(0, 0.0), (16, 0.5 * l)] {
        let u = s / l;
        let stiffness = ei * lerp_from_one(0.5, u) * lerp_from_one(0.6, u).powi(4);
        let found = Vector3::from_column_slice(&strain[3 * node..3 * node + 3]).norm();
        assert!((found / (moment(s) / stiffness) - 1.0).abs() < 2e-3, "{found} {}", moment(s) / stiffness);
    }
    let mass = density * l * (1.0 + 0.6 + 0.36) / 3.0;
    assert!((rod.mass.iter().sum::<f64>() / mass - 1.0).abs() < 1e-12);
}

fn curl() -> Rod {
    curl_with_segments(0.01)
}

fn curl_with_segments(length: f64) -> Rod {
    let points: Vec<_> = (0..40)
        .map(|i| {
            let a = i as f64 * 0.2;
            Vector3::new(0.01 * a.cos(), -0.006 * a, 0.01 * a.sin())
        })
        .collect();
    let arc: Vec<f64> = (0..6).map(|i| (i as f64 / 5.0).powf(1.3)).collect();
    Rod::new(&RodSource {
        stiffness: [8e-9, 6e-9, 4e-9],
        damping: 0.004,
        segment_size: SegmentSize { max_length: length, ..SegmentSize::FINE },
        ..RodSource::hair(&points, &arc)
    })
    .unwrap()
}

/// A load with all terms.
fn load(rod: &Rod, h: f64) -> Load {
    let wave =
        |k: usize, a: f64| Vector3::new((a + k as f64).sin(), (2.0 * a + k as f64).cos(), a.sin()) * 0.01;
    let points = (0..rod.points()).map(|k| PointLoad {
        inertial: wave(k, 1.0),
        previous: wave(k, 1.1),
        air: wave(k, 2.0) * 100.0,
        tangent: wave(k, 0.3).normalize(),
        drag: 2e-4 / (1.0 + k as f64),
    });
    let past: Vec<f64> = (0..rod.unknowns()).map(|i| (i as f64).sin() * 2.0).collect();
    let mut load = Load::default();
    load.set(rod, h, &Vector3::new(0.3, -9.81, 0.1), &past, points);
    let hold = |i: usize| StrainSpring { stiffness: 1e-9 * (i % 4) as f64, target: 3.0 - i as f64 };
    load.hold((0..rod.unknowns()).map(hold));
    for k in [0, 1, rod.points() / 2, rod.points() - 1] {
        load.add_moment(k, &rod.root.r, &(wave(k, 0.7) * 1e-4));
    }
    load
}

#[test]
fn held_unknowns_are_where_they_are_held() {
    let rod = curl();
    let mut load = load(&rod, 0.01);
    let target = |i: usize| 2.0 * (i as f64 * 0.7).sin();
    let held = |i: usize| i < 9;
    load.hold(
        (0..rod.unknowns())
            .map(|i| StrainSpring { stiffness: if held(i) { 1.0 } else { 0.0 }, target: target(i) }),
    );
    let mut q = vec![0.0; rod.unknowns()];
    let outcome = Solver::default().minimise(&rod, &rod.root.r, &load, &mut q, &vec![1.0; rod.unknowns()]);
    assert!(outcome.converged && outcome.iterations < 20, "{outcome:?}");
    let off = |i: usize| (q[i] - target(i)).abs();
    assert!((0..9).all(|i| off(i) < 1e-3), "{q:?}");
    assert!((9..q.len()).any(|i| off(i) > 1.0), "{q:?}");
}

#[test]
fn a_direction_without_bound_moves_no_point_too_far() {
    let rod = curl();
    let load = load(&rod, 0.01);
    let root = &rod.root.r;
    let q: Vec<f64> = (0..rod.unknowns()).map(|i| (i as f64).cos()).collect();
    let mut solver = Solver::default();
    for direction in [f64::INFINITY, f64::NAN, 1e300, 1e12] {
        let mut moved = q.clone();
        assert!(solver.shape.update(&rod, root, &q));
        assert!(solver.linearise(&rod, &load, &q));
        solver.direction.fill(direction);
        let far = solver.advance(&rod, root, &mut moved, 0.01);
        assert!(far.is_infinite() && moved == q || far <= 0.01, "{direction}: {far}");
        solver.direction.fill(direction);
        let far = solver.advance_loaded(&rod, root, &load, &mut moved, |_| 0.0, 0.01);
        assert!(far.is_infinite() || far <= 0.01, "{direction}: {far}");
        assert!(moved.iter().all(|q| q.is_finite()), "{direction}: {moved:?}");
    }
}

fn derivatives(rod: &Rod, load: &Load, q: &[f64]) -> (Vec<f64>, Vec<f64>) {
    let (mut shape, mut sens) = (RodShape::default(), Sensitivity::default());
    shape.update(rod, &rod.root.r, q);
    sens.update(rod, &shape, q);
    let (mut g, mut wrench, mut h) = (Vec::new(), Vec::new(), Vec::new());
    gradient(&rod.core, load, &shape, &sens, q, &mut g, &mut wrench);
    hessian(&rod.core, load, &shape, &sens, &wrench, q, 1.0, &mut h);
    (g, h)
}

#[test]
fn point_spring_is_inertia_weight_and_drag() {
    let (rod, h, g) = (curl(), 0.01, Vector3::new(0.3, -9.81, 0.1));
    let point = PointLoad {
        inertial: Vector3::new(0.01, 0.02, -0.03),
        previous: Vector3::new(0.02, -0.01, 0.01),
        air: Vector3::new(1.0, 2.0, -1.0),
        tangent: Vector3::new(0.6, 0.0, 0.8),
        drag: 3e-4,
    };
    let mut load = Load::default();
    let past = vec![0.0; rod.unknowns()];
    load.set(&rod, h, &g, &past, std::iter::repeat_n(point, rod.points()));
    let x = Vector3::new(0.03, 0.01, 0.02);
    for (spring, (w, mass)) in load.springs.iter().zip(rod.weight.iter().zip(&rod.mass).skip(1)) {
        let y = V3::from(x) - spring.target;
        let force: Vector3<f64> = (spring.u * spring.u.dot(y) - y * spring.alpha).into();
        let slip = (x - point.previous) / h - point.air;
        let along = point.tangent * point.tangent.dot(&slip);
        let sought =
            g * *mass - (x - point.inertial) * (mass / (h * h)) - (slip - along * 0.5) * (point.drag * w);
        assert!((force - sought).norm() < 1e-12 * sought.norm(), "{force} {sought}");
    }
}

#[test]
fn added_spring_adds_its_force_to_all_others() {
    let rod = curl();
    let (plain, goal, x) = (load(&rod, 0.01), Vector3::new(0.02, -0.03, 0.01), Vector3::new(0.01, 0.04, 0.0));
    let mut pulled = plain.clone();
    (0..rod.points()).for_each(|k| pulled.add_spring(k, &goal, 1e-3 * k as f64));
    for (k, (before, now)) in plain.springs.iter().zip(&pulled.springs).enumerate() {
        let more: Vector3<f64> = (now.force(x.into()) - before.force(x.into())).into();
        let sought = (goal - x) * (1e-3 * (k + 1) as f64);
        assert!((more - sought).norm() < 1e-12, "{more} {sought}");
    }
}

#[test]
fn natural_shape_is_reproduced_exactly() {
    let rod = curl();
    let mut shape = RodShape::default();
    shape.update(&rod, &rod.root.r, &vec![0.0; rod.unknowns()]);
    // The drawn tip relative to the drawn root.
    let tip = Vector3::new(0.01 * 7.8_f64.cos(), -0.006 * 7.8, 0.01 * 7.8_f64.sin());
    assert!((shape.x(rod.points() - 1) + rod.root.p - tip).norm() < 1e-13);
    assert!((rod.weight.iter().sum::<f64>() - rod.length()).abs() < 1e-14);
}

/// The same rod with its root on a joint.
fn joined(mut rod: Rod, joint: RootJoint) -> Rod {
    rod.join_root(joint);
    rod
}

/// Curls with roots that are held in all ways.
fn curls() -> [Rod; 3] {
    [RootJoint::Clamped, RootJoint::Pinned, RootJoint::Free].map(|joint| joined(curl(), joint))
}

/// Unknowns that bend `rod` far, and turn and move its root.
fn bent(rod: &Rod) -> Vec<f64> {
    let mut q: Vec<f64> = (0..rod.unknowns()).map(|i| (i as f64 * 1.7).cos() * 6.0).collect();
    let joint = [1.9, -1.6, 0.7, 0.02, 0.03, -0.05];
    let count = 3 * rod.joint().blocks();
    q[..count].copy_from_slice(&joint[..count]);
    q
}

#[test]
fn gradient_matches_differences_of_the_energy() {
    for rod in curls() {
        gradient_matches_differences(&rod);
    }
}

fn gradient_matches_differences(rod: &Rod) {
    let (load, q) = (load(rod, 1.0 / 192.0), bent(rod));
    let (g, _) = derivatives(rod, &load, &q);
    let (mut shape, mut scratch) = (RodShape::default(), Vec::new());
    let mut at = |q: &[f64]| {
        shape.update(rod, &rod.root.r, q);
        energy(&rod.core, &load, &shape, q, &mut scratch)
    };
    let scale = g.iter().fold(0.0_f64, |m, x| m.max(x.abs()));
    assert!(scale > 0.0);
    for i in 0..q.len() {
        let mut p = q.clone();
        p[i] += 1e-4;
        let hi = at(&p);
        p[i] -= 2e-4;
        let slope = (hi - at(&p)) / 2e-4;
        assert!((slope - g[i]).abs() < 1e-7 * scale, "{i}: {slope} {}", g[i]);
    }
}

/// Largest error of the Hessian, relative to its largest entry: of pairs of unknowns that share an element,
/// and of all other pairs.
fn hessian_error(rod: &Rod) -> (f64, f64) {
    let (load, q) = (load(rod, 1.0 / 192.0), bent(rod));
    let n = q.len();
    let (_, h) = derivatives(rod, &load, &q);
    let (mut shared, mut apart, mut scale) = (0.0_f64, 0.0_f64, 0.0_f64);
    for j in 0..n {
        let mut p = q.clone();
        p[j] += 1e-4;
        let (hi, _) = derivatives(rod, &load, &p);
        p[j] -= 2e-4;
        let (lo, _) = derivatives(rod, &load, &p);
        for i in j..n {
            let e = ((hi[i] - lo[i]) / 2e-4 - h[i * n + j]).abs();
            scale = scale.max(h[i * n + j].abs());
            let worst = if i / 3 > j / 3 + 1 { &mut apart } else { &mut shared };
            *worst = worst.max(e);
        }
    }
    (shared / scale, apart / scale)
}

#[test]
fn hessian_matches_differences_of_the_gradient() {
    let (shared, apart) = hessian_error(&curl_with_segments(0.002));
    assert!(apart < 1e-7, "{apart}");
    // Within a segment the error is of fourth order in its rotation.
    let (finer, apart) = hessian_error(&curl_with_segments(0.001));
    assert!(apart < 1e-7, "{apart}");
    assert!(finer < 0.1 * shared && shared < 2e-4, "{shared} {finer}");
    // The entries of a joint, in other units, are by far the largest.
    for joint in [RootJoint::Pinned, RootJoint::Free] {
        let (shared, apart) = hessian_error(&joined(curl_with_segments(0.001), joint));
        assert!(shared < 1e-7 && apart < 1e-7, "{joint:?}: {shared} {apart}");
    }
}

#[test]
fn elimination_by_blocks_solves_as_a_dense_factor_does() {
    let tip = |tip_strain: bool| {
        let points: Vec<_> = (0..60)
            .map(|i| Vector3::new(f64::from(i), (f64::from(i) * 0.3).sin() * 3.0, 0.0) * 4e-3)
            .collect();
        let arc: Vec<f64> = (0..12).map(|i| f64::from(i) / 11.0).collect();
        Rod::new(&RodSource { tip_strain, ..RodSource::hair(&points, &arc) }).unwrap()
    };
    let mut solved = 0;
    for (rod, strong) in [tip(true), tip(false), curl()].iter().flat_map(|rod| [(rod, true), (rod, false)]) {
        let q = bent(rod);
        let n = q.len();
        let (mut shape, mut sens) = (RodShape::default(), Sensitivity::default());
        shape.update(rod, &rod.root.r, &q);
        sens.update(rod, &shape, &q);
        let mut load = load(rod, 1.0 / 192.0);
        if !strong {
            let points = (0..rod.points()).map(|k| PointLoad {
                inertial: shape.x(k),
                previous: shape.x(k),
                air: Vector3::x(),
                tangent: shape.tangent(k),
                drag: 2e-4,
            });
            load.set(rod, 1.0 / 192.0, &Vector3::y(), &q, points);
        }
        let (mut g, mut wrench) = (Vec::new(), Vec::new());
        gradient(&rod.core, &load, &shape, &sens, &q, &mut g, &mut wrench);
        for geometric in [1.0, 0.0] {
            let mut h = Vec::new();
            hessian(&rod.core, &load, &shape, &sens, &wrench, &q, geometric, &mut h);
            let lower = h.clone();
            let mut blocks = BlockFactor::default();
            let positive = blocks.set(&rod.core, &load, &shape, &sens, &wrench, geometric);
            assert_eq!(positive, cholesky::factor(&mut h, n), "{n} unknowns, {geometric}");
            if positive == 0 {
                continue;
            }
            let (mut dense, mut sparse) = (g.clone(), g.clone());
            cholesky::solve(&h, n, &mut dense);
            blocks.solve(&mut sparse);
            // Largest residual of a row, as a share of what it sums.
            let residual = |x: &[f64]| {
                let row = |i: usize| {
                    let entries = (0..n).map(|j| lower[i.max(j) * n + i.min(j)] * x[j]);
                    let size = entries.clone().map(f64::abs).sum::<f64>() + g[i].abs();
                    (entries.sum::<f64>() - g[i]).abs() / size
                };
                (0..n).map(row).fold(0.0, f64::max)
            };
            let [dense, sparse] = [&dense, &sparse].map(|x| residual(x));
            assert!(sparse < 1e-13, "{n} unknowns, {geometric}: {sparse}, {dense} of a dense factor");
            solved += 1;
        }
    }
    // All 6 without geometric stiffness, and where forces are weak some with it.
    assert!(solved > 6, "{solved}");
}

#[test]
fn jacobian_rows_and_velocities_match_differences_of_positions() {
    for rod in curls() {
        rows_match_differences(&rod);
    }
}

fn rows_match_differences(rod: &Rod) {
    let q = bent(rod);
    let (mut shape, mut sens, mut moved) = (RodShape::default(), Sensitivity::default(), RodShape::default());
    shape.update(rod, &rod.root.r, &q);
    sens.update(rod, &shape, &q);
    let d = Vector3::new(0.3, -0.5, 0.8);
    let rate: Vec<f64> = (0..q.len()).map(|i| (i as f64 * 0.9).sin()).collect();
    let by = |h: f64| q.iter().zip(&rate).map(|(q, r)| q + h * r).collect::<Vec<f64>>();
    moved.update(rod, &rod.root.r, &by(1e-5));
    let mut behind = RodShape::default();
    behind.update(rod, &rod.root.r, &by(-1e-5));
    let velocities: Vec<_> = shape.velocities(rod, &q, &rate).collect();
    for (k, (velocity, spin)) in velocities.iter().enumerate() {
        let mut row = vec![0.0; q.len()];
        sens.add_row(k, &shape.x(k), &d, 2.0, &mut row);
        let slope = (moved.x(k) - behind.x(k)) / 2e-5;
        let by_row: f64 = row.iter().zip(&rate).map(|(a, b)| a * b).sum();
        assert!((by_row - 2.0 * d.dot(&slope)).abs() < 1e-8, "{k}");
        assert!((velocity - slope).norm() < 1e-8, "{k}");
        for axis in 0..3 {
            let frames = [&moved, &behind].map(|shape| shape.frame(k).column(axis).into_owned());
            let slope = (frames[0] - frames[1]) / 2e-5;
            assert!((spin.cross(&shape.frame(k).column(axis)) - slope).norm() < 1e-7, "{k} {axis}");
        }
    }
}
