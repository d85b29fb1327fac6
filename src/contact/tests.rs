//! Contact detection compared with brute force: dense samples in space and time, and each triangle in turn.

use super::*;
use crate::geometry::tests::blob;
use crate::geometry::{Feature, MovingSurface, Shape, Solid, TriMesh, segment_triangle};
use crate::math::random::Random;
use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};

mod deforming;

fn still() -> BodyMotion {
    BodyMotion { times: [0.0, 1.0], start: Isometry3::identity(), end: Isometry3::identity() }
}

fn mesh_shape(mesh: &TriMesh) -> Shape {
    Shape::Mesh(mesh.clone())
}

/// Minimum distance of the polyline from a solid, m, over dense samples of the motion between the fractions
/// `from` and `to`; signed for a convex shape.
fn sampled_distance(
    shape: &Solid,
    motion: &BodyMotion,
    line: &MovingPolyline,
    from: f64,
    to: f64,
    samples: usize,
) -> f64 {
    let into = |pose: &Isometry3<f64>, x: &Vector3<f64>| pose.inverse() * nalgebra::Point3::from(*x);
    let mut least = f64::INFINITY;
    for step in 0..=samples {
        let t = from + (to - from) * step as f64 / samples as f64;
        let x: Vec<Vector3<f64>> = (0..line.x0.len())
            .map(|k| into(&motion.start, &line.x0[k]).coords.lerp(&into(&motion.end, &line.x1[k]).coords, t))
            .collect();
        for k in 0..x.len() - 1 {
            match shape.surface_over(motion.times) {
                MovingSurface::Convex(convex) => {
                    least = least.min(convex.closest_to_segment(&x[k], &x[k + 1]).1.distance)
                }
                MovingSurface::Mesh([start, end]) => {
                    for i in 0..end.triangle_count() as u32 {
                        let (from, to) = (start.triangle(i), end.triangle(i));
                        let corners = [0, 1, 2].map(|j| from[j].lerp(to[j], t));
                        let d2 = segment_triangle(&x[k], &x[k + 1], corners.each_ref()).distance2;
                        least = least.min(d2.sqrt());
                    }
                }
            }
        }
    }
    least
}

/// Asserts for random moving polylines that those without impact stay outside a body, and that the others are
/// close to it at the time of impact.
fn check_impacts(shape: Shape, seed: u64, cases: usize, spin: f64) {
    let bodies = &mut Bodies::from_shapes(&[shape]);
    check_impacts_over(bodies, seed, cases, spin, |_, _| [0.0, 1.0]);
}

/// The same for a deforming body: `step` prepares it for a case and returns the times of the sub-step.
fn check_impacts_over(
    bodies: &mut Bodies,
    seed: u64,
    cases: usize,
    spin: f64,
    mut step: impl FnMut(&mut Bodies, usize) -> [f64; 2],
) {
    let mut random = Random::new(seed);
    let mut cache = ContactCache::default();
    let (mut hits, mut free) = (0, 0);
    while hits + free < cases {
        let start = random.vector() * 0.25;
        let direction = random.vector().normalize();
        let x0: Vec<_> =
            (0..4).map(|k| start + direction * 0.03 * k as f64 + random.vector() * 0.01).collect();
        let times = step(bodies, hits + free);
        let motion = BodyMotion {
            times,
            start: Isometry3::identity(),
            end: Isometry3::from_parts(
                Translation3::from(random.vector() * 0.1),
                UnitQuaternion::from_scaled_axis(random.vector() * spin),
            ),
        };
        let throw = random.vector() * 0.08 - start;
        let x1: Vec<_> = x0.iter().map(|x| x + throw + random.vector() * 0.02).collect();
        let clearance = [[1e-3; 2]; 3];
        let line = MovingPolyline { x0: &x0, x1: &x1, clearance: &clearance, by_part: false };
        let shape = &bodies.bodies[0].solid;
        let inside = x0.iter().any(|x| shape.contains(times[0], x));
        if inside || sampled_distance(shape, &motion, &line, 0.0, 0.0, 1) <= 1e-6 {
            continue;
        }
        let mut contacts = Vec::new();
        let toi = bodies.impacts(&[motion], &line, &mut cache, &mut contacts);
        let fresh = bodies.impacts(&[motion], &line, &mut ContactCache::default(), &mut Vec::new());
        assert_eq!(toi, fresh, "the cache changes no result");
        // Zero, not the minimum separation: samples may miss a near approach.
        assert!(sampled_distance(shape, &motion, &line, 0.0, toi, 150) > 0.0, "tunnels before {toi}");
        if toi < 1.0 {
            hits += 1;
            let at = sampled_distance(shape, &motion, &line, toi, toi, 1);
            assert!(at > 0.0 && at < 0.26e-3, "stops {at} m away");
            assert!(contacts.iter().any(|c| c.gap < 0.0 || c.normal.norm() > 0.999));
        } else {
            free += 1;
            assert!(contacts.is_empty());
        }
    }
    assert!(hits > cases / 20 && free > cases / 20, "{hits} hits, {free} free");
}

#[test]
fn impacts_with_a_mesh_prevent_tunnelling() {
    check_impacts(mesh_shape(&blob(5, 0.08)), 21, 60, 0.3);
}

#[test]
fn impacts_with_a_fast_rotating_thin_mesh_prevent_tunnelling() {
    let mut thin = blob(5, 0.1);
    thin.vertices.iter_mut().for_each(|v| v.y *= 0.01);
    check_impacts(mesh_shape(&thin), 22, 60, 2.2);
}

#[test]
fn impacts_with_convex_shapes_prevent_tunnelling() {
    check_impacts(Shape::Sphere { centre: Vector3::zeros(), radius: 0.07 }, 23, 100, 0.3);
    let ends = [Vector3::new(-0.05, 0.0, 0.0), Vector3::new(0.05, 0.02, 0.0)];
    check_impacts(Shape::Capsule { ends, radius: 0.01 }, 24, 100, 2.2);
    let radii = Vector3::new(0.1, 0.003, 0.06);
    let rotation = UnitQuaternion::from_euler_angles(0.3, 0.2, 0.1);
    check_impacts(Shape::Ellipsoid { centre: Vector3::zeros(), radii, rotation }, 25, 60, 1.0);
    check_impacts(Shape::Plane { point: Vector3::zeros(), normal: Vector3::y() }, 26, 100, 0.3);
}

#[test]
fn head_on_impacts_have_exact_time_and_feature() {
    // An octahedron: its top vertex at y = 0.1, its upper edges between.
    let r = 0.1;
    let vertices = [(r, 0., 0.), (-r, 0., 0.), (0., r, 0.), (0., -r, 0.), (0., 0., r), (0., 0., -r)]
        .map(|(x, y, z)| Vector3::new(x, y, z))
        .to_vec();
    let triangles =
        vec![[2, 4, 0], [2, 0, 5], [2, 5, 1], [2, 1, 4], [3, 0, 4], [3, 5, 0], [3, 1, 5], [3, 4, 1]];
    let body = Bodies::from_shapes(&[mesh_shape(&TriMesh { vertices, triangles })]);
    let d = [[1e-4; 2]];
    let drop = |a: Vector3<f64>, b: Vector3<f64>, fall: Vector3<f64>| {
        let (x0, x1) = ([a, b], [a + fall, b + fall]);
        let mut contacts = Vec::new();
        let line = MovingPolyline { x0: &x0, x1: &x1, clearance: &d, by_part: false };
        let toi = body.impacts(&[still()], &line, &mut ContactCache::default(), &mut contacts);
        assert_eq!(contacts.len(), 1);
        (toi, contacts[0])
    };
    let down = Vector3::new(0.0, -0.3, 0.0);
    // A vertex of the strand on the vertex of the mesh.
    let (toi, c) = drop(Vector3::new(0., 0.2, 0.), Vector3::new(0., 0.3, 0.), down);
    assert_eq!((c.feature, c.u), (Feature::Vertex(2), 0.0));
    assert!((toi - (0.1 - 0.25e-4) / 0.3).abs() < 1e-4, "{toi}");
    // The middle of a segment on the vertex.
    let (_, c) = drop(Vector3::new(-0.1, 0.2, 0.03), Vector3::new(0.1, 0.2, -0.03), down);
    assert_eq!(c.feature, Feature::Vertex(2));
    assert!((c.u - 0.5).abs() < 1e-9 && (c.normal - Vector3::y()).norm() < 1e-6);
    // The middle of a segment across an edge.
    let (_, c) = drop(Vector3::new(0.05, 0.2, -0.1), Vector3::new(0.05, 0.2, 0.1), down);
    assert!(matches!(c.feature, Feature::Edge(_)));
    assert!((c.normal - Vector3::new(1.0, 1.0, 0.0).normalize()).norm() < 1e-4, "{}", c.normal);
    assert!(c.gap < -0.1);
}

#[test]
fn a_jump_of_the_head_causes_an_impact() {
    let body = Bodies::from_shapes(&[mesh_shape(&blob(8, 0.1))]);
    let x0: Vec<_> = (0..17).map(|k| Vector3::new(0.14 + 0.001 * k as f64, -0.012 * k as f64, 0.0)).collect();
    let pop = Isometry3::from_parts(
        Translation3::new(0.18, 0.0, 0.0),
        UnitQuaternion::from_scaled_axis(Vector3::new(0.0, 127f64.to_radians(), 0.0)),
    );
    let motion = BodyMotion { times: [0.0, 1.0], start: Isometry3::identity(), end: pop };
    let line = MovingPolyline { x0: &x0, x1: &x0, clearance: &[[1e-4; 2]; 16], by_part: false };
    let toi = body.impacts(&[motion], &line, &mut ContactCache::default(), &mut Vec::new());
    assert!(toi > 0.0 && toi < 1.0);
    assert!(sampled_distance(&body.bodies[0].solid, &motion, &line, 0.0, toi, 400) > 0.0);
}

#[test]
fn cached_bounds_change_no_contact() {
    let shapes = [mesh_shape(&blob(10, 0.1)), Shape::Sphere { centre: Vector3::x() * 0.2, radius: 0.05 }];
    let bodies = Bodies::from_shapes(&shapes);
    let mut random = Random::new(31);
    let mut cache = ContactCache::default();
    let mut x: Vec<_> = (0..12).map(|k| Vector3::new(0.11 + 0.012 * k as f64, 0.05, 0.0)).collect();
    let mut pose = Isometry3::identity();
    let (mut found, mut skipped) = (0, 0);
    for _ in 0..300 {
        let x1: Vec<_> = x.iter().map(|v| v + random.vector() * 0.004).collect();
        let end = Isometry3::from_parts(
            Translation3::from(pose.translation.vector + random.vector() * 0.002),
            UnitQuaternion::from_scaled_axis(random.vector() * 0.02) * pose.rotation,
        );
        let motions = [BodyMotion { times: [0.0, 1.0], start: pose, end }; 2];
        let line = MovingPolyline { x0: &x, x1: &x1, clearance: &[[1e-3; 2]; 22], by_part: false };
        let all = |cache: &mut ContactCache| {
            let mut contacts = Vec::new();
            bodies.candidates(&motions, &line, 2e-3, cache, &mut contacts);
            let toi = bodies.impacts(&motions, &line, cache, &mut contacts);
            (toi, contacts)
        };
        let before = cache.bounds.clone();
        let with = all(&mut cache);
        assert_eq!(with, all(&mut ContactCache::default()));
        found += with.1.len();
        skipped += before.iter().zip(&cache.bounds).filter(|(a, b)| a == b).count();
        (x, pose) = (x1, end);
    }
    assert!(found > 100 && skipped > 500, "{found} contacts, {skipped} searches skipped");
}

#[test]
fn a_segment_at_rest_on_a_plane_has_contacts_at_both_ends() {
    let plane = Shape::Plane { point: Vector3::zeros(), normal: Vector3::y() };
    let bodies = Bodies::from_shapes(&[plane]);
    let x = [Vector3::new(0.0, 1e-3, 0.0), Vector3::new(0.1, 1e-3, 0.0)];
    let line = MovingPolyline { x0: &x, x1: &x, clearance: &[[1e-3; 2]], by_part: false };
    let mut contacts = Vec::new();
    bodies.candidates(&[still()], &line, 1e-4, &mut ContactCache::default(), &mut contacts);
    assert_eq!(contacts.iter().map(|c| c.u).collect::<Vec<_>>(), [0.0, 1.0]);
    assert!(contacts.iter().all(|c| c.gap.abs() < 1e-15 && c.normal == Vector3::y()));
}

#[test]
fn a_vertex_in_a_crease_touches_both_walls() {
    // A valley along z between the walls y = |x|.
    let v = |x: f64, z: f64| Vector3::new(x, x.abs(), z);
    let vertices = vec![v(0., -1.), v(0., 1.), v(1., -1.), v(1., 1.), v(-1., -1.), v(-1., 1.)];
    let triangles = vec![[0, 1, 3], [0, 3, 2], [0, 4, 5], [0, 5, 1]];
    let bodies = Bodies::from_shapes(&[mesh_shape(&TriMesh { vertices, triangles })]);
    let x = [Vector3::new(0.001, 0.5, 0.2), Vector3::new(0.001, 0.01, 0.2)];
    let line = MovingPolyline { x0: &x, x1: &x, clearance: &[[1e-3; 2]], by_part: false };
    let mut contacts = Vec::new();
    bodies.candidates(&[still()], &line, 0.01, &mut ContactCache::default(), &mut contacts);
    assert_eq!(contacts.len(), 2);
    assert!(contacts.iter().all(|c| c.u == 1.0 && c.normal.y > 0.7));
    assert!(contacts[0].normal.x * contacts[1].normal.x < -0.49);
}

/// A square box between two heights, m, 10 cm wide.
fn slab([low, high]: [f64; 2]) -> TriMesh {
    let corner = |i: usize| {
        let side = |k: usize| if i >> k & 1 == 1 { 0.05 } else { -0.05 };
        Vector3::new(side(0), if i >> 1 & 1 == 1 { high } else { low }, side(2))
    };
    let quads = [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]];
    let triangles = quads.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]).collect();
    TriMesh { vertices: (0..8).map(corner).collect(), triangles }
}

#[test]
fn a_vertex_inside_a_thin_plate_leaves_on_the_side_it_entered() {
    // A plate 2 mm thick; the vertex ends nearer to the far side.
    let bodies = Bodies::from_shapes(&[mesh_shape(&slab([-0.001, 0.001]))]);
    let at = |y: f64| [Vector3::new(0.01, y + 0.01, 0.0), Vector3::new(0.01, y, 0.0)];
    let line = MovingPolyline { x0: &at(0.003), x1: &at(-0.0007), clearance: &[[1e-4; 2]], by_part: false };
    let mut contacts = Vec::new();
    bodies.candidates(&[still()], &line, 2e-3, &mut ContactCache::default(), &mut contacts);
    assert_eq!(contacts.len(), 1, "{contacts:?}");
    assert!((contacts[0].normal - Vector3::y()).norm() < 1e-12);
    assert!((contacts[0].gap + 0.0018).abs() < 1e-12);
}

#[test]
fn exempt_segments_have_no_contact_and_negative_clearances_are_kept() {
    let bodies = Bodies::from_shapes(&[mesh_shape(&blob(8, 0.1))]);
    let x: Vec<_> = (0..4).map(|k| Vector3::new(0.0, 0.08 + 0.02 * k as f64, 0.0)).collect();
    let mut contacts = Vec::new();
    let exempt = [[f64::NEG_INFINITY; 2], [f64::NEG_INFINITY, 1e-3], [1e-3; 2]];
    let line = MovingPolyline { x0: &x, x1: &x, clearance: &exempt, by_part: false };
    let mut cache = ContactCache::default();
    bodies.candidates(&[still()], &line, 5e-3, &mut cache, &mut contacts);
    assert!(contacts.iter().all(|c| c.segment + usize::from(c.u == 1.0) >= 2));
    assert_eq!(bodies.impacts(&[still()], &line, &mut cache, &mut contacts), 1.0);
    // A vertex 30 mm deep that must now be no deeper than 25 mm.
    contacts.clear();
    let gentle = [[-0.025; 2], [f64::NEG_INFINITY; 2], [f64::NEG_INFINITY; 2]];
    let line = MovingPolyline { x0: &x, x1: &x, clearance: &gentle, by_part: false };
    bodies.candidates(&[still()], &line, 5e-3, &mut cache, &mut contacts);
    assert_eq!(contacts.len(), 1);
    let depth = bodies.closest(0, 0.0, &x[0], 1.0).unwrap().distance;
    assert!((contacts[0].gap - (depth + 0.025)).abs() < 1e-12 && contacts[0].gap < 0.0);
}

#[test]
fn a_segment_that_passes_through_a_surface_stays_in_front_where_it_keeps_more_than_the_tolerance() {
    let plane = Shape::Plane { point: Vector3::zeros(), normal: Vector3::y() };
    let bodies = Bodies::from_shapes(&[plane]);
    // From the distance to keep at both ends of the step, or where that is negative from the surface on.
    let line = |from: f64| [Vector3::new(0.0, from, 0.0), Vector3::new(0.01, 1e-3, 0.0)];
    let first = |x0: [Vector3<f64>; 2], sinks: f64, clearance: [f64; 2]| {
        let x1 = x0.map(|x| x - Vector3::y() * sinks);
        let line = MovingPolyline { x0: &x0, x1: &x1, clearance: &[clearance], by_part: false };
        let mut impacts = Vec::new();
        bodies.impacts(&[still()], &line, &mut ContactCache::default(), &mut impacts);
        impacts.first().map(|impact| (impact.u, line.stays_in_front(impact)))
    };
    let passing = [-1e-3, 1e-3];
    let at = |clearance: f64| 0.5 * (1.0 + clearance / 1e-3);
    assert_eq!(first(line(2e-6), 1e-6, passing), None);
    let (u, stays) = first(line(-1e-3 + 2e-5), 1e-3, passing).unwrap();
    assert!((u - at(GAP_TOLERANCE)).abs() < 1e-9 && stays, "{u}");
    // One that keeps as little all along is stopped nevertheless.
    assert_eq!(
        first([Vector3::y() * 2e-6, Vector3::new(0.01, 2e-6, 0.0)], 1e-3, [1e-6; 2]),
        Some((0.0, true))
    );
    assert_eq!(first([Vector3::y() * 2e-6, Vector3::new(0.01, 2e-6, 0.0)], 1e-3, [-1e-3, 9e-6]), None);
}

#[test]
fn an_inner_point_that_started_inside_has_a_contact() {
    // A roof with its ridge along z; the segment goes through it, 3 mm below the ridge.
    let end = |z: f64| [(0.0, 0.1), (-0.1, 0.0), (0.1, 0.0)].map(|(x, y)| Vector3::new(x, y, z));
    let vertices = [end(-0.2), end(0.2)].concat();
    let triangles =
        vec![[0, 2, 1], [3, 4, 5], [0, 1, 4], [0, 4, 3], [0, 3, 5], [0, 5, 2], [1, 2, 5], [1, 5, 4]];
    let roof = TriMesh { vertices, triangles };
    let bodies = Bodies::from_shapes(&[mesh_shape(&roof)]);
    let x = [Vector3::new(-0.05, 0.097, 0.013), Vector3::new(0.05, 0.097, 0.013)];
    assert!(x.iter().all(|x| bodies.closest(0, 0.0, x, 1.0).unwrap().distance > 0.03));
    let line = MovingPolyline { x0: &x, x1: &x, clearance: &[[5e-4; 2]], by_part: false };
    let mut contacts = Vec::new();
    bodies.candidates(&[still()], &line, 5e-3, &mut ContactCache::default(), &mut contacts);
    assert_eq!(contacts.len(), 1, "{contacts:?}");
    let Contact { u, normal, gap, .. } = contacts[0];
    assert!((u - 0.5).abs() < 1e-9 && (normal - Vector3::y()).norm() < 1e-9 && (gap + 3.5e-3).abs() < 1e-9);
}
