//! Tests of the interpolation as a whole.

use super::deflection::Deflection;
use super::guide_weights::{Membership, guide_weights};
use super::interpolator::{DeflectionAt, Interpolator};
use super::jumps::Jumps;
use super::moment::{Carriers, GuideMotion, RigidMotion};
use super::obstacles::Obstacles;
use crate::contact::Bodies;
use crate::math::se3;
use crate::rod::{Rod, RodShape, RodSource, SegmentSize};
use crate::scene::Curves;
use nalgebra::{Isometry3, Matrix3, Vector3};
use std::f64::consts::TAU;

const MEMBERSHIP: Membership = Membership { leaf: (0, 0), group: 0 };

/// Across the plane in which equal entries of a rod along x bend it, m.
const BESIDE: Vector3<f64> = Vector3::new(0.0, 0.055, 0.055);

fn helix(n: usize, phase: f64) -> Vec<Vector3<f64>> {
    (0..n)
        .map(|i| {
            let a = i as f64 / (n - 1) as f64 * 6.0;
            Vector3::new(
                0.01 * ((a + phase).cos() - phase.cos()),
                -0.03 * a,
                0.01 * ((a + phase).sin() - phase.sin()),
            )
        })
        .collect()
}

/// A ringlet with four turns of 7 mm radius and 3 cm pitch.
fn ringlet(n: usize, phase: f64) -> Vec<Vector3<f64>> {
    let turns = |i: usize| i as f64 / (n - 1) as f64 * 4.0;
    let at = |i: usize| (turns(i) * TAU + phase).sin_cos();
    let (sine, cosine) = phase.sin_cos();
    (0..n)
        .map(|i| Vector3::new(0.007 * (at(i).1 - cosine), -0.03 * turns(i), 0.007 * (at(i).0 - sine)))
        .collect()
}

fn rod(points: &[Vector3<f64>]) -> Rod {
    let arc: Vec<f64> = (0..8).map(|i| (i as f64 / 7.0).powf(1.5)).collect();
    Rod::new(&RodSource {
        stiffness: [8e-9, 8e-9, 4e-9],
        segment_size: SegmentSize { max_length: 0.005, ..SegmentSize::FINE },
        ..RodSource::hair(points, &arc)
    })
    .unwrap()
}

/// A moment at which strands are evaluated.
struct Moment<'a> {
    carriers: Carriers,
    obstacles: Obstacles<'a>,
}

fn still() -> RigidMotion {
    RigidMotion {
        rotation: Matrix3::identity(),
        translation: Vector3::zeros(),
        spin: Vector3::zeros(),
        velocity: Vector3::zeros(),
    }
}

fn curves(strands: &[Vec<Vector3<f64>>]) -> Curves {
    let mut c = Curves { offsets: vec![0], ..Curves::default() };
    for (i, s) in strands.iter().enumerate() {
        c.points.extend(s);
        c.offsets.push(c.points.len());
        c.id.push(i as i32);
    }
    c
}

/// Strands of one wisp that follow `rods`.
fn interpolator(c: &Curves, rods: &[&Rod], bodies: &Bodies, thickness: &[f64]) -> Interpolator {
    let guides: Vec<_> = rods.iter().map(|r| (*r, MEMBERSHIP)).collect();
    let weights = guide_weights(c, &vec![MEMBERSHIP; c.len()], &[0.0], &guides);
    Interpolator::new(c, weights, rods, bodies, thickness)
}

fn run(
    c: &Curves,
    rods: &[&Rod],
    q: &[Vec<f64>],
    rate: &[Vec<f64>],
    head: &RigidMotion,
) -> [Vec<[f32; 3]>; 2] {
    let bodies = Bodies::from_shapes(&[]);
    let interpolator = interpolator(c, rods, &bodies, &[]);
    let moment = Moment {
        carriers: Carriers::Head(*head),
        obstacles: Obstacles { bodies: &bodies, time: 0.0, poses: &[] },
    };
    let motion: Vec<_> =
        rods.iter().zip(q).zip(rate).map(|((&rod, q), rate)| GuideMotion { rod, q, rate }).collect();
    evaluated(&interpolator, &moment, &motion)
}

/// Points and velocities of all strands, while bodies and deflections rest.
fn evaluated(interpolator: &Interpolator, moment: &Moment, motion: &[GuideMotion]) -> [Vec<[f32; 3]>; 2] {
    let (raw, settled) = settled(interpolator, moment, motion);
    let posed = interpolator.pose(moment.carriers.clone(), Some(&moment.obstacles), motion);
    let (free, found) = interpolator.evaluate_free(&moment.obstacles, &posed, &Matrix3::identity());
    assert_eq!(found, raw);
    let at = DeflectionAt { frames: [&settled; 4], fraction: 0.0, interval: 1.0 };
    let evaluate = |free| interpolator.evaluate(&posed, &at, &Matrix3::identity(), free);
    let out = evaluate(None);
    // Known free strands change nothing.
    assert_eq!(evaluate(Some(free)), out);
    [out.points, out.velocities]
}

/// Deflections of all strands while bodies and guides rest, before and after they are settled.
fn settled(
    interpolator: &Interpolator,
    moment: &Moment,
    motion: &[GuideMotion],
) -> (Vec<Deflection>, Vec<Deflection>) {
    let posed = interpolator.pose(moment.carriers.clone(), Some(&moment.obstacles), motion);
    let raw = interpolator.deflections(&moment.obstacles, &posed);
    let settled = interpolator.settle(&moment.obstacles, &posed, &[&raw[..]; 3]);
    (raw, settled)
}

fn wide(p: &[f32; 3]) -> Vector3<f64> {
    Vector3::new(p[0].into(), p[1].into(), p[2].into())
}

#[test]
fn rest_shape_is_the_groom_and_edge_lengths_are_exact() {
    for strands in [[helix(16, 0.0), helix(24, 1.0)], [ringlet(65, 0.0), ringlet(33, 2.0)]] {
        keeps_rest_shape_and_edge_lengths(&strands);
    }
}

fn keeps_rest_shape_and_edge_lengths(strands: &[Vec<Vector3<f64>>; 2]) {
    let r = rod(&strands[0]);
    let c = curves(strands);
    let zero = vec![0.0; r.unknowns()];
    let [p, _] = run(&c, &[&r], std::slice::from_ref(&zero), std::slice::from_ref(&zero), &still());
    for (a, b) in p.iter().zip(&c.points) {
        assert!((wide(a) - b).norm() < 1e-7);
    }
    let q: Vec<f64> = (0..r.unknowns()).map(|i| (i as f64).sin() * 15.0).collect();
    let [p, _] = run(&c, &[&r], &[q], &[zero], &still());
    for s in 0..2 {
        let range = c.offsets[s]..c.offsets[s + 1];
        for (a, b) in p[range.clone()].windows(2).zip(c.points[range].windows(2)) {
            let rest = (b[1] - b[0]).norm();
            assert!(((wide(&a[1]) - wide(&a[0])).norm() / rest - 1.0).abs() < 1e-4);
        }
    }
}

#[test]
fn strand_on_its_guide_stays_on_it_to_second_order() {
    // Second order in the edges: 4 times closer with edges half as long.
    let off = |n: usize| {
        let points = helix(n, 0.0);
        let r = rod(&helix(200, 0.0));
        let q: Vec<f64> = (0..r.unknowns()).map(|i| (i as f64 * 0.7).sin() * 8.0).collect();
        let zero = vec![0.0; q.len()];
        let [p, _] = run(&curves(&[points]), &[&r], std::slice::from_ref(&q), &[zero], &still());
        let mut shape = RodShape::default();
        shape.update(&r, &r.root.r, &q);
        (wide(&p[n - 1]) - shape.x(r.points() - 1)).norm() / r.length()
    };
    let (coarse, fine) = (off(17), off(33));
    assert!(coarse < 0.02 && fine < 0.35 * coarse, "{coarse} {fine}");
}

#[test]
fn strand_beside_its_guide_rotates_with_it() {
    // Across the guide, where transport by the smallest rotation between the tangents would fail.
    let line: Vec<_> = (0..200).map(|i| Vector3::x() * (0.2 * f64::from(i) / 199.0)).collect();
    let r = rod(&line);
    let across: Vec<_> =
        (0..129).map(|i| (Vector3::y() + Vector3::x()) * (0.14 * f64::from(i) / 128.0)).collect();
    let q: Vec<f64> = (0..r.unknowns()).map(|i| (i as f64 * 0.7).sin() * 8.0).collect();
    let zero = vec![0.0; q.len()];
    let [p, _] =
        run(&curves(std::slice::from_ref(&across)), &[&r], std::slice::from_ref(&q), &[zero], &still());
    let mut shape = RodShape::default();
    shape.update(&r, &r.root.r, &q);
    let turn = shape.poses().last().unwrap().r * r.root.r.transpose();
    let rest = (across[128] - across[127]).normalize();
    let now = (wide(&p[128]) - wide(&p[127])).normalize();
    assert!((now - rest).norm() > 0.1, "the guide does not rotate");
    assert!((now - turn * rest).norm() < 0.01, "{now} {}", turn * rest);
}

#[test]
fn velocities_match_differences_of_the_points() {
    velocities_match([helix(16, 0.3), helix(16, 2.0)], helix(16, 1.0));
    velocities_match([ringlet(65, 0.3), ringlet(65, 2.0)], ringlet(33, 3.0));
}

fn velocities_match(guides: [Vec<Vector3<f64>>; 2], strand: Vec<Vector3<f64>>) {
    let rods = guides.map(|points| rod(&points));
    let c = curves(&[strand]);
    let q: Vec<Vec<f64>> =
        rods.iter().map(|r| (0..r.unknowns()).map(|i| (i as f64).cos() * 10.0).collect()).collect();
    let rate: Vec<Vec<f64>> =
        q.iter().map(|q| (0..q.len()).map(|i| (i as f64 * 1.3).sin() * 40.0).collect()).collect();
    let spin = Vector3::new(3.0, -1.0, 2.0);
    let at = |t: f64| {
        let q: Vec<Vec<f64>> =
            q.iter().zip(&rate).map(|(q, r)| q.iter().zip(r).map(|(q, r)| q + t * r).collect()).collect();
        let head = RigidMotion {
            rotation: se3::exp_so3(&(spin * t)),
            translation: Vector3::new(0.2, -0.1, 0.4) * t,
            spin,
            velocity: Vector3::new(0.2, -0.1, 0.4),
        };
        run(&c, &[&rods[0], &rods[1]], &q, &rate, &head)
    };
    let t = 2e-3;
    let [_, v] = at(0.0);
    let ([hi, _], [lo, _]) = (at(t), at(-t));
    for i in 0..v.len() {
        let slope = (wide(&hi[i]) - wide(&lo[i])) / (2.0 * t);
        assert!((slope - wide(&v[i])).norm() < 2e-3 * (1.0 + slope.norm()), "{i}: {slope} {:?}", v[i]);
    }
}

/// A straight strand, and a guide beside it that bends it into a ball: the curves, the guide, and the centre
/// of the ball.
struct Bent {
    curves: Curves,
    rod: Rod,
    q: Vec<f64>,
    centre: Vector3<f64>,
}

impl Bent {
    fn new() -> Self {
        let line: Vec<_> = (0..33).map(|i| Vector3::x() * (0.2 * f64::from(i) / 32.0)).collect();
        let rod = rod(&line.iter().map(|p| p + BESIDE).collect::<Vec<_>>());
        let q: Vec<f64> = (0..rod.unknowns()).map(|i| if i % 3 == 2 { 0.0 } else { 12.0 }).collect();
        let mut free = RodShape::default();
        free.update(&rod, &rod.root.r, &q);
        let middle = free.x(rod.points() * 6 / 10);
        let centre = middle + (middle - Vector3::x() * 0.12).normalize() * 0.02;
        Bent { curves: curves(&[line]), rod, q, centre }
    }

    /// The guide's unknowns after `frame` frames: it bends further.
    fn q_at(&self, frame: f64) -> Vec<f64> {
        self.q.iter().map(|q| q * (1.0 + 0.02 * frame)).collect()
    }
}

#[test]
fn projected_strand_stays_out_of_a_body_with_exact_lengths() {
    use crate::geometry::Shape;
    let bent = Bent::new();
    let ball = Shape::Sphere { centre: bent.centre, radius: 0.05 };
    let bodies = Bodies::from_shapes(&[ball]);
    let interpolator = interpolator(&bent.curves, &[&bent.rod], &bodies, &[0.0005]);
    let obstacles = Obstacles { bodies: &bodies, time: 0.0, poses: &[Isometry3::identity()] };
    let moment = Moment { carriers: Carriers::Head(still()), obstacles };
    let still = vec![0.0; bent.q.len()];
    let motion = [GuideMotion { rod: &bent.rod, q: &bent.q, rate: &still }];
    let [p, _] = evaluated(&interpolator, &moment, &motion);
    let depth = |p: &[[f32; 3]]| p.iter().map(|x| 0.05 - (wide(x) - bent.centre).norm()).fold(-1.0, f64::max);
    assert!((-0.002..1e-6).contains(&depth(&p)), "is not in contact with the ball: {}", depth(&p));
    for e in p.windows(2) {
        assert!(((wide(&e[1]) - wide(&e[0])).norm() / 0.00625 - 1.0).abs() < 1e-4);
    }
    // It approaches its guide, beside which it ran.
    let mut free = RodShape::default();
    free.update(&bent.rod, &bent.rod.root.r, &bent.q);
    let across = (bent.rod.root.p + free.x(bent.rod.points() - 1) - wide(&p[32])).dot(&BESIDE.normalize());
    assert!(across < 0.9 * BESIDE.norm(), "{across} m beside its guide");
    // What is written is measured.
    let posed = interpolator.pose(moment.carriers.clone(), Some(&obstacles), &motion);
    let measured = |p: &[[f32; 3]]| interpolator.depths(&obstacles, &posed, p, &Matrix3::identity());
    assert_eq!((measured(&p).inside, measured(&p).strands < 1e-6), (0, true));
    let (free, _) = interpolator.evaluate_free(&moment.obstacles, &posed, &Matrix3::identity());
    let deepest = depth(&free.points);
    assert!(deepest > 0.01 && (measured(&free.points).strands - deepest).abs() < 1e-6, "{deepest}");
    assert_eq!(measured(&free.points).inside, 1);
}

#[test]
fn a_strand_leaves_a_part_of_the_skin_that_has_swallowed_its_root() {
    use crate::contact::{Body, pinch};
    use crate::geometry::{Deformation, Shape};
    use std::sync::Arc;
    // On the top of a small ball, out of which guide and strand grow; a large one, far at rest, comes down on
    // it, so that the shortest way out leads back down.
    let (depth, radius) = (0.008, 0.05);
    let ball = |y: f64, radius| Shape::Sphere { centre: Vector3::y() * y, radius }.tessellate();
    let [mut mesh, large] = [ball(-0.0045, 0.004), ball(radius - depth, radius)];
    let first = mesh.vertices.len() as u32;
    mesh.triangles.extend(large.triangles.iter().map(|t| t.map(|v| v + first)));
    let closed: Vec<_> = mesh.vertices.iter().chain(&large.vertices).copied().collect();
    mesh.vertices.extend(large.vertices.iter().map(|x| x + Vector3::y()));
    let deformation = Deformation { start: 0.0, rate: 1.0, samples: vec![closed; 2] };
    let skin = Body::new(&Shape::Mesh(mesh), Some(&Arc::new(deformation)), None);
    let mut bodies = Bodies::new([skin]);
    let line = |x: f64| -> Vec<_> { (0..21).map(|i| Vector3::new(x, 1.5e-3 * f64::from(i), 0.0)).collect() };
    let (guide, strands) = (rod(&line(1e-4)), curves(&[line(0.0)]));
    let interpolator = interpolator(&strands, &[&guide], &bodies, &[5e-4]);
    bodies.prepare([0.0, 0.0]);
    let obstacles = Obstacles { bodies: &bodies, time: 0.0, poses: &[Isometry3::identity()] };
    let moment = Moment { carriers: Carriers::Head(still()), obstacles };
    let rate = vec![0.0; guide.initial_q.len()];
    let motion = [GuideMotion { rod: &guide, q: &guide.initial_q, rate: &rate }];
    let [points, _] = evaluated(&interpolator, &moment, &motion);
    let outside = |p: &[f32; 3]| (wide(p) - Vector3::y() * (radius - depth)).norm() - radius;
    for (p, s) in points.iter().zip((0..).map(|i| 1.5e-3 * f64::from(i))) {
        let least = pinch::leaving(-depth, -1.0, s);
        assert!(outside(p) > least - 1.6e-3, "{} of {least} m at {s} m", outside(p));
    }
    assert!(outside(&points[20]) > -0.01, "free, the tip is 38 mm inside");
    let posed = interpolator.pose(moment.carriers.clone(), Some(&obstacles), &motion);
    let depths = interpolator.depths(&obstacles, &posed, &points, &Matrix3::identity());
    assert!(depths.strands < 1e-4 && depths.pinched > 0.003, "{depths:?}");
}

#[test]
fn velocities_of_projected_strands_match_differences_between_frames() {
    use crate::geometry::Shape;
    let bent = Bent::new();
    let bodies = Bodies::from_shapes(&[Shape::Sphere { centre: bent.centre, radius: 0.05 }]);
    let interpolator = interpolator(&bent.curves, &[&bent.rod], &bodies, &[0.0005]);
    let obstacles = Obstacles { bodies: &bodies, time: 0.0, poses: &[Isometry3::identity()] };
    let moment = Moment { carriers: Carriers::Head(still()), obstacles };
    // Guides at frames a second apart; the bend starts anew at frame 3, so that the strand jumps off the
    // ball.
    let rate: Vec<f64> = bent.q.iter().map(|q| 0.02 * q).collect();
    let q_at = |frame: f64| bent.q_at(if frame < 3.0 { frame } else { frame - 60.0 });
    let settled: Vec<Vec<Deflection>> = (-2..8)
        .map(|frame| {
            let q = q_at(f64::from(frame));
            let motion = [GuideMotion { rod: &bent.rod, q: &q, rate: &rate }];
            self::settled(&interpolator, &moment, &motion).1
        })
        .collect();
    let at = |time: f64| {
        let q = q_at(time);
        let motion = [GuideMotion { rod: &bent.rod, q: &q, rate: &rate }];
        let frame = time.floor();
        let frames = std::array::from_fn(|i| &settled[frame as usize + 1 + i][..]);
        let at = DeflectionAt { frames, fraction: time - frame, interval: 1.0 };
        let posed = interpolator.pose(moment.carriers.clone(), None, &motion);
        interpolator.evaluate(&posed, &at, &Matrix3::identity(), None)
    };
    let t = 1e-3;
    for time in [0.0 + t, 0.5, 1.0 - t, 1.5, 2.0 + t, 2.5, 4.5] {
        let (v, [hi, lo]) = (at(time).velocities, [at(time + t), at(time - t)]);
        for (i, v) in v.iter().enumerate() {
            let slope = (wide(&hi.points[i]) - wide(&lo.points[i])) / (2.0 * t);
            let off = (slope - wide(v)).norm();
            assert!(off < 2e-3 * slope.norm() + 1e-4, "{i} at {time}: {slope} {v:?}");
        }
    }
}

#[test]
fn strand_keeps_near_its_guides_where_they_part() {
    // Three guides side by side are whirled apart, each about an axis of its own. The strand between them may
    // go with any of them.
    let beside =
        |z: f64| (0..33).map(|i| Vector3::new(0.2 * f64::from(i) / 32.0, 0.0, z)).collect::<Vec<_>>();
    let roots = [0.0, 0.01, 0.024];
    let rods = roots.map(|z| rod(&beside(z)));
    let c = curves(&[beside(0.006)]);
    let whirled = |t: f64| -> Vec<Vec<f64>> {
        let bend = |g: usize, i: usize| match i % 3 {
            0 => (60.0 + 20.0 * g as f64) * (t + 2.0 * g as f64).sin(),
            1 => 90.0 * (1.3 * t + 1.7 * g as f64).cos(),
            _ => 40.0 * (0.7 * t + g as f64).sin(),
        };
        rods.iter().enumerate().map(|(g, rod)| (0..rod.unknowns()).map(|i| bend(g, i)).collect()).collect()
    };
    let rods: Vec<&Rod> = rods.iter().collect();
    let mut shape = RodShape::default();
    let (mut last, mut last_tips) = (None, [Vector3::zeros(); 3]);
    for step in 0..400 {
        let q = whirled(0.01 * f64::from(step));
        let still: Vec<Vec<f64>> = q.iter().map(|q| vec![0.0; q.len()]).collect();
        let [p, _] = run(&c, &rods, &q, &still, &self::still());
        let tip = wide(p.last().unwrap());
        let tips: [Vector3<f64>; 3] = std::array::from_fn(|g| {
            shape.update(rods[g], &rods[g].root.r, &q[g]);
            rods[g].root.p + shape.x(rods[g].points() - 1)
        });
        let near = tips.iter().map(|x| (x - tip).norm()).fold(f64::INFINITY, f64::min);
        assert!(near < 0.06, "step {step}: {near} m from every guide");
        if let Some(last) = last.replace(tip) {
            let fastest = tips.iter().zip(last_tips).map(|(x, y)| (x - y).norm()).fold(0.0, f64::max);
            assert!(
                (tip - last).norm() < 3.0 * fastest + 1e-3,
                "step {step}: jumps {} m",
                (tip - last).norm()
            );
        }
        last_tips = tips;
    }
}

/// Root mean square angle between consecutive edges of a curve, rad.
fn winding(points: &[Vector3<f64>]) -> f64 {
    let square = |x: &[Vector3<f64>]| (x[1] - x[0]).angle(&(x[2] - x[1])).powi(2);
    (points.windows(3).map(square).sum::<f64>() / (points.len() - 2) as f64).sqrt()
}

#[test]
fn ringlets_of_any_phase_go_where_their_guide_goes_when_it_unwinds() {
    let rod = rod(&ringlet(129, 0.0));
    let strands: Vec<_> = (0..9).map(|i| ringlet(65, 0.7 * f64::from(i))).collect();
    let c = curves(&strands);
    // Twisted, a curl stretches or tightens.
    for twist in [60.0, -40.0] {
        let q: Vec<f64> = (0..rod.unknowns()).map(|i| if i % 3 == 2 { twist } else { 0.0 }).collect();
        let zero = vec![0.0; q.len()];
        let [p, _] = run(&c, &[&rod], std::slice::from_ref(&q), &[zero], &still());
        let mut shape = RodShape::default();
        shape.update(&rod, &rod.root.r, &q);
        let tip = rod.root.p + shape.x(rod.points() - 1);
        let moved = (tip - ringlet(129, 0.0)[128]).norm();
        assert!(moved > 0.02, "the guide moves by {moved} m only");
        for (i, strand) in strands.iter().enumerate() {
            let points: Vec<_> = p[c.offsets[i]..c.offsets[i + 1]].iter().map(wide).collect();
            let away = (points[64] - tip).norm();
            // The diameters of the curls at rest and now.
            assert!(away < 0.03, "strand {i}, twist {twist}: {away} m");
            let [now, at_rest] = [winding(&points), winding(strand)];
            assert!((now / at_rest - 1.0).abs() < 0.1, "{i}: {now} {at_rest}");
        }
    }
}

#[test]
fn body_is_found_after_vertices_that_needed_no_search() {
    use crate::geometry::Shape;
    // Far from its guide, with a search for bodies; near it, without one; then into the ball, which has come
    // here.
    let at = |x: f64, y: f64| Vector3::new(x, y, 0.0);
    let c = curves(&[vec![at(0.0, 0.0), at(0.01, 0.03), at(0.02, 0.0), at(0.05, 0.01)]]);
    let r = rod(&(0..9).map(|i| at(0.05 * f64::from(i) / 8.0, 0.0)).collect::<Vec<_>>());
    let bodies = Bodies::from_shapes(&[Shape::Sphere { centre: Vector3::x(), radius: 0.01 }]);
    let interpolator = interpolator(&c, &[&r], &bodies, &[0.0005]);
    let poses = [Isometry3::translation(-0.945, 0.018, 0.0)];
    let moment = Moment {
        carriers: Carriers::Head(still()),
        obstacles: Obstacles { bodies: &bodies, time: 0.0, poses: &poses },
    };
    let still = vec![0.0; r.unknowns()];
    let motion = [GuideMotion { rod: &r, q: &still, rate: &still }];
    let [p, _] = evaluated(&interpolator, &moment, &motion);
    let distance = |x: &Vector3<f64>| (x - at(0.055, 0.018)).norm() - 0.01;
    assert!(distance(&c.points[3]) < -5e-4 && distance(&wide(&p[3])) > 4e-4, "{:?}", p[3]);
}

#[test]
fn strand_stays_out_of_the_crease_between_two_bodies() {
    use crate::geometry::Shape;
    // A floor and a wall that overhangs it have moved to the strand: a rotation out of the wall leads into
    // the floor.
    let run = Vector3::new(0.9, -0.3, 0.3).normalize() * 0.008;
    let line = |z: f64| (0..9).map(|i| run * f64::from(i) + Vector3::z() * z).collect::<Vec<_>>();
    let (c, r) = (curves(&[line(0.0)]), rod(&line(0.1)));
    let walls = [(Vector3::y(), -0.01), (Vector3::new(-0.75_f64.sqrt(), -0.5, 0.0), -0.02)];
    let shapes = walls.map(|(normal, _)| Shape::Plane { point: -normal, normal });
    let bodies = Bodies::from_shapes(&shapes);
    let interpolator = interpolator(&c, &[&r], &bodies, &[0.0005; 2]);
    let poses = walls.map(|(normal, at)| Isometry3::from(normal * (1.0 + at)));
    let moment = Moment {
        carriers: Carriers::Head(still()),
        obstacles: Obstacles { bodies: &bodies, time: 0.0, poses: &poses },
    };
    let zero = vec![0.0; r.unknowns()];
    let motion = [GuideMotion { rod: &r, q: &zero, rate: &zero }];
    let [p, _] = evaluated(&interpolator, &moment, &motion);
    for (normal, at) in &walls {
        let depth = |x: &Vector3<f64>| at - normal.dot(x);
        assert!(depth(&line(0.0)[8]) > 5e-3);
        let deepest = p.iter().map(|x| depth(&wide(x))).fold(f64::NEG_INFINITY, f64::max);
        assert!(deepest < 1e-4, "{deepest} m inside {normal}");
    }
}

#[test]
fn strand_stays_on_its_guides_side_of_a_thin_body() {
    use crate::geometry::{Shape, TriMesh};
    // A guide bends down to above a plate. Its strand, which runs below the guide, would pass through the
    // plate.
    let line = |y: f64| (0..33).map(|i| Vector3::new(0.2 * f64::from(i) / 32.0, y, 0.0)).collect::<Vec<_>>();
    let mut strand = line(0.0);
    // Real strands have edges of zero length.
    strand.insert(16, strand[16]);
    let (r, c) = (rod(&line(0.03)), curves(&[strand]));
    let mut free = RodShape::default();
    // The combination of entries of a rod along x that bends it in this plane.
    let bend = |i: usize| (0..r.unknowns()).map(|k| if k % 3 == i { 1.0 } else { 0.0 }).collect::<Vec<f64>>();
    let basis = [bend(0), bend(1)];
    let lift = basis.clone().map(|q| {
        free.update(&r, &r.root.r, &q);
        free.x(r.points() - 1).yz()
    });
    let det = lift[0].perp(&lift[1]);
    let (a, b) = (-0.022 * lift[1].y / det, 0.022 * lift[0].y / det);
    let q: Vec<f64> = basis[0].iter().zip(&basis[1]).map(|(u, v)| a * u + b * v).collect();
    free.update(&r, &r.root.r, &q);
    let tip = free.x(r.points() - 1) + r.root.p;
    assert!((0.006..0.010).contains(&tip.y) && tip.z.abs() < 2e-3, "{tip}");
    let corner = |i: usize| {
        let pick = |bit: usize, ends: [f64; 2]| ends[(i >> bit) & 1];
        Vector3::new(pick(0, [0.05, 0.3]), pick(1, [-0.007, -0.005]), pick(2, [-0.1, 0.1]))
    };
    let quads = [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]];
    let plate = TriMesh {
        vertices: (0..8).map(corner).collect(),
        triangles: quads.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]).collect(),
    };
    let lowest = |bodies: &Bodies, poses: &[Isometry3<f64>]| {
        let thickness = vec![0.0005; poses.len()];
        let interpolator = interpolator(&c, &[&r], bodies, &thickness);
        let moment =
            Moment { carriers: Carriers::Head(still()), obstacles: Obstacles { bodies, time: 0.0, poses } };
        let motion = [GuideMotion { rod: &r, q: &q, rate: &vec![0.0; q.len()] }];
        let [p, v] = evaluated(&interpolator, &moment, &motion);
        assert!(p.iter().chain(&v).flatten().all(|x| x.is_finite()));
        p.iter().map(|x| f64::from(x[1])).fold(0.0, f64::min)
    };
    assert!(lowest(&Bodies::from_shapes(&[]), &[]) < -0.015, "would not pass through");
    let held = lowest(&Bodies::from_shapes(&[Shape::Mesh(plate)]), &[Isometry3::identity()]);
    assert!(held > -0.005, "{held}");
}

#[test]
fn strand_has_the_same_bits_alone_and_in_any_pack() {
    let r = rod(&helix(60, 0.0));
    let sizes = [9, 9, 9, 12, 9, 9, 9, 9, 9, 9, 9, 9, 9, 5, 5, 2];
    let strands: Vec<_> = sizes.iter().enumerate().map(|(i, n)| helix(*n, 0.3 * i as f64)).collect();
    // Some rotations from edge to edge exceed half a turn.
    let q: Vec<f64> = (0..r.unknowns()).map(|i| (i as f64).sin() * 150.0).collect();
    let rate: Vec<f64> = (0..r.unknowns()).map(|i| (i as f64).cos() * 40.0).collect();
    let head = RigidMotion { spin: Vector3::new(1.0, 2.0, 3.0), velocity: Vector3::x(), ..still() };
    let run = |strands: &[Vec<Vector3<f64>>]| {
        run(&curves(strands), &[&r], std::slice::from_ref(&q), std::slice::from_ref(&rate), &head)
    };
    let alone = strands.iter().map(|strand| run(std::slice::from_ref(strand)));
    let alone = alone.fold([Vec::new(), Vec::new()], |[p, v], one| {
        [[p, one[0].clone()].concat(), [v, one[1].clone()].concat()]
    });
    assert_eq!(run(&strands), alone);
}

#[test]
fn a_jump_is_the_way_by_which_deflections_move_a_strand() {
    let line = |z: f64| (0..11).map(|i| Vector3::new(0.01 * f64::from(i), 0.0, z)).collect::<Vec<_>>();
    let r = rod(&line(0.0));
    let c = curves(&[line(0.0), line(0.01)]);
    let interpolator = interpolator(&c, &[&r], &Bodies::from_shapes(&[]), &[]);
    let straight = vec![[0.0; 3]; 22];
    // All edges of the second strand turn by an angle; its tip moves along a chord of 10 cm radius.
    let turned = |angle: f32| {
        let mut by = straight.clone();
        by[12..].fill([0.0, angle, 0.0]);
        by
    };
    assert_eq!(interpolator.jumps([&straight, &straight]), Jumps::default());
    for (angle, strands) in [(0.4, 0), (1.2, 1)] {
        let jumps = interpolator.jumps([&turned(-angle), &turned(angle)]);
        let way = 0.2 * f64::from(angle).sin();
        assert!((jumps.largest - way).abs() < 1e-6, "{jumps:?}, {way}");
        assert_eq!(jumps.strands, 1);
        let half = interpolator.jumps([&straight, &turned(angle)]);
        assert!((half.largest - 0.2 * f64::from(0.5 * angle).sin()).abs() < 1e-6);
        assert_eq!(half.strands, strands);
    }
}
