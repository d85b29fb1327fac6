//! Contact against brute force: dense sampling in place and time, triangle by triangle.

use super::distance::{closest_on_triangle, segment_triangle};
use super::mesh::Mesh;
use super::shape::{Convex, Shape, Surface};
use super::*;
use crate::math::random;
use crate::scene::{Shape as SceneShape, TriMesh};
use crate::test_data::shared_data;
use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};

mod deforming;

/// Random numbers in [-1, 1), the same at every run.
pub(super) struct Random {
    seed: u64,
    next: u64,
}

impl Random {
    pub fn new(seed: u64) -> Self {
        Random { seed, next: 0 }
    }

    pub fn next(&mut self) -> f64 {
        self.next += 1;
        2.0 * random::unit(self.seed, self.next - 1) - 1.0
    }

    pub fn vector(&mut self) -> Vector3<f64> {
        Vector3::from_fn(|_, _| self.next())
    }
}

/// A bumpy closed surface of about `2 n²` triangles around the origin, radius near `radius`.
fn blob(n: usize, radius: f64) -> TriMesh {
    let ring = 2 * n;
    let point = |i: usize, j: usize| {
        let (polar, azimuth) = (
            std::f64::consts::PI * i as f64 / n as f64,
            std::f64::consts::TAU * (j % ring) as f64 / ring as f64,
        );
        let ring_radius = if i.is_multiple_of(n) { 0.0 } else { polar.sin() };
        let bump = 1.0 + 0.25 * (5.0 * azimuth).sin() * ring_radius.powi(2) + 0.1 * (4.0 * polar).cos();
        let direction = Vector3::new(ring_radius * azimuth.cos(), polar.cos(), -ring_radius * azimuth.sin());
        direction * radius * bump
    };
    // Poles and the seam are repeated on purpose: welding must close them.
    let vertices = (0..=n).flat_map(|i| (0..=ring).map(move |j| point(i, j))).collect();
    let at = |i: usize, j: usize| (i * (ring + 1) + j) as u32;
    let triangles = (0..n)
        .flat_map(|i| {
            (0..ring).flat_map(move |j| {
                [[at(i, j), at(i + 1, j), at(i + 1, j + 1)], [at(i, j), at(i + 1, j + 1), at(i, j + 1)]]
            })
        })
        .collect();
    TriMesh { file: Default::default(), vertices, triangles }
}

fn unsigned_brute(mesh: &Mesh, p: &Vector3<f64>) -> f64 {
    (0..mesh.triangle_count() as u32)
        .map(|t| (closest_on_triangle(p, mesh.triangle(t)).0 - p).norm())
        .fold(f64::INFINITY, f64::min)
}

#[test]
fn mesh_distance_agrees_with_brute_force_and_its_sign_with_the_winding_number() {
    // Flattened, its edges are sharp: there the normal of one face alone tells the wrong side.
    for flatness in [1.0, 0.05] {
        let mut soup = blob(12, 0.1);
        soup.vertices.iter_mut().for_each(|v| v.y *= flatness);
        let mesh = Mesh::new(&soup.vertices, &soup.triangles);
        let mut random = Random::new(1);
        let mut inside = 0;
        for _ in 0..2000 {
            let mut p = random.vector() * 0.15;
            p.y *= flatness;
            let s = mesh.closest(&p, 1.0).unwrap();
            assert!((s.distance.abs() - unsigned_brute(&mesh, &p)).abs() < 1e-14);
            assert_eq!(s.distance < 0.0, mesh.winding_number(&p) > 0.5, "{p}");
            assert!((p - s.normal * s.distance - s.point).norm() < 1e-13, "normal leads to the surface");
            assert!(mesh.closest(&p, s.distance.abs() * 0.999).is_none());
            inside += usize::from(s.distance < 0.0);
        }
        assert!(inside > 200 && inside < 1800);
    }
}

#[test]
fn winding_number_is_the_sum_of_solid_angles() {
    // Two blobs, one in the other, each with a hole; triangles as large as angles of more than half a turn, from near them.
    let [mut soup, inner] = [0.1, 0.05].map(|radius| blob(6, radius));
    soup.triangles.extend(inner.triangles.iter().map(|t| t.map(|i| i + soup.vertices.len() as u32)));
    soup.vertices.extend(inner.vertices);
    let mut n = 0;
    soup.triangles.retain(|_| {
        n += 1;
        n % 11 != 0
    });
    let mesh = Mesh::new(&soup.vertices, &soup.triangles);
    let plain = |p: &Vector3<f64>| {
        let half_angle = |t: u32| {
            let [a, b, c] = mesh.triangle(t).map(|v| v - p);
            let [la, lb, lc] = [a, b, c].map(|v| v.norm());
            let cos = la * lb * lc + a.dot(&b) * lc + b.dot(&c) * la + c.dot(&a) * lb;
            a.dot(&b.cross(&c)).atan2(cos)
        };
        (0..mesh.triangle_count() as u32).map(half_angle).sum::<f64>() / std::f64::consts::TAU
    };
    let (mut random, mut most) = (Random::new(3), [0.0_f64; 2]);
    for _ in 0..2000 {
        let p = random.vector() * 0.15;
        let w = mesh.winding_number(&p);
        assert!((w - plain(&p)).abs() < 1e-12, "{p}: {w}");
        most = [most[0].min(w), most[1].max(w)];
    }
    assert!(most[0] < -0.01 && most[1] > 1.2, "{most:?}");
}

#[test]
fn mixed_winding_is_mended_and_a_closed_mesh_turned_outward() {
    let soup = blob(8, 0.1);
    let tidy = Mesh::new(&soup.vertices, &soup.triangles);
    let mut random = Random::new(5);
    let mixed: Vec<[u32; 3]> = soup
        .triangles
        .iter()
        .map(|&[a, b, c]| if random.next() > -0.5 { [a, c, b] } else { [a, b, c] })
        .collect();
    let mended = Mesh::new(&soup.vertices, &mixed);
    for _ in 0..300 {
        let p = random.vector() * 0.15;
        let (a, b) = (tidy.closest(&p, 1.0).unwrap(), mended.closest(&p, 1.0).unwrap());
        assert!((a.distance - b.distance).abs() < 1e-14);
    }
}

#[test]
fn beside_an_open_sheet_is_outside_and_behind_it_is_inside() {
    let v = |x: f64, z: f64| Vector3::new(x, 0.0, z);
    let sheet = Mesh::new(&[v(0., 0.), v(0., 1.), v(1., 1.), v(1., 0.)], &[[0, 1, 2], [0, 2, 3]]);
    let distance = |x, y| sheet.closest(&Vector3::new(x, y, 0.5), 9.0).unwrap();
    assert_eq!(distance(0.5, 0.25).distance, 0.25);
    assert_eq!(distance(0.5, -0.25).distance, -0.25);
    let beside = distance(1.3, -0.4);
    assert!((beside.distance - 0.5).abs() < 1e-15);
    assert!((beside.normal - Vector3::new(0.6, -0.8, 0.0)).norm() < 1e-15);
}

fn shapes() -> Vec<Convex> {
    let rotation = UnitQuaternion::from_euler_angles(0.3, -0.8, 1.1);
    let centre = Vector3::new(0.02, -0.01, 0.03);
    vec![
        Convex::Capsule { ends: [centre, centre], radius: 0.08 },
        Convex::Capsule { ends: [centre, Vector3::new(0.05, 0.09, -0.02)], radius: 0.04 },
        Convex::Ellipsoid { centre, radii: Vector3::new(0.05, 0.09, 0.07), rotation },
        Convex::Ellipsoid { centre, radii: Vector3::new(0.002, 0.09, 0.09), rotation },
        Convex::Plane { point: centre, normal: rotation * Vector3::y() },
    ]
}

#[test]
fn convex_distance_is_the_least_over_the_surface_and_changes_sign_on_it() {
    let mut random = Random::new(2);
    for shape in shapes() {
        let surface: Vec<Vector3<f64>> =
            (0..4000).map(|_| shape.closest(&(random.vector() * 0.3)).point).collect();
        for _ in 0..200 {
            let p = random.vector() * 0.12;
            let s = shape.closest(&p);
            assert!((s.normal.norm() - 1.0).abs() < 1e-14);
            assert!((p - s.normal * s.distance - s.point).norm() < 1e-10, "{shape:?} {p}");
            assert!(shape.closest(&s.point).distance.abs() < 1e-12);
            assert!(shape.closest(&(s.point + s.normal * 1e-3)).distance > 0.0);
            let least = surface.iter().map(|q| (p - q).norm()).fold(f64::INFINITY, f64::min);
            assert!(s.distance.abs() <= least + 1e-12);
            assert!(s.distance.abs() > least - 0.02);
        }
    }
}

#[test]
fn ellipsoid_distance_holds_at_the_symmetric_points() {
    let e = Convex::Ellipsoid {
        centre: Vector3::zeros(),
        radii: Vector3::new(1.0, 3.0, 2.0),
        rotation: UnitQuaternion::identity(),
    };
    let d = |x, y, z| e.closest(&Vector3::new(x, y, z)).distance;
    assert!((d(0., 0., 0.) + 1.0).abs() < 1e-15);
    assert!((d(2., 0., 0.) - 1.0).abs() < 1e-15);
    assert!((d(0., 5., 0.) - 2.0).abs() < 1e-15);
    assert!((d(0., 0., -3.) - 1.0).abs() < 1e-15);
    assert!(d(0., 3., 0.).abs() < 1e-15);
    // On the long axis, inside the evolute, the closest point leaves the axis; compared with samples.
    let p = Vector3::new(0.0, 1.0, 0.0);
    let least = (0..100_000)
        .map(|k| k as f64 * std::f64::consts::PI / 100_000.0)
        .map(|t| (Vector3::new(t.sin(), 3.0 * t.cos(), 0.0) - p).norm())
        .fold(f64::INFINITY, f64::min);
    assert!((d(0., 1., 0.) + least).abs() < 1e-8);
}

#[test]
fn segment_triangle_distance_is_the_least_over_samples() {
    let mut random = Random::new(3);
    let mut pierced = 0;
    for _ in 0..2000 {
        let [a, b, c, p, q] = [0; 5].map(|_| random.vector());
        let pair = segment_triangle(&p, &q, [&a, &b, &c]);
        let x = p.lerp(&q, pair.u);
        assert!(((x - pair.point).norm_squared() - pair.distance2).abs() < 1e-12);
        let sampled = (0..=200)
            .map(|k| {
                let x = p.lerp(&q, k as f64 / 200.0);
                (closest_on_triangle(&x, [&a, &b, &c]).0 - x).norm()
            })
            .fold(f64::INFINITY, f64::min);
        let distance = pair.distance2.sqrt();
        assert!(distance <= sampled + 1e-12 && distance > sampled - (q - p).norm() / 400.0 - 1e-12);
        pierced += usize::from(pair.distance2 == 0.0);
    }
    assert!(pierced > 50);
}

#[test]
fn first_hit_is_where_the_distance_first_changes_sign() {
    let mut random = Random::new(9);
    let convex = shapes().into_iter().map(Shape::Convex);
    let mesh = Shape::new(&mesh_shape(&blob(24, 0.09)), None);
    let mut hits = 0;
    for shape in convex.chain([mesh]) {
        for _ in 0..300 {
            let (a, b) = (random.vector() * 0.15, random.vector() * 0.15);
            let distance = |u: f64| shape.closest(0.0, &a.lerp(&b, u), 9.0).unwrap().distance;
            let steps = 200;
            let side = |k: usize| distance(k as f64 / steps as f64) > 0.0;
            let changed = (1..=steps).find(|k| side(*k) != side(0));
            match shape.first_hit(0.0, &a, &b) {
                Some((share, normal)) => {
                    hits += 1;
                    assert!(distance(share).abs() < 1e-9, "{shape:?}");
                    assert!((normal.norm() - 1.0).abs() < 1e-12);
                    // In at a face that looks back, out at one that looks on; never later than the samples tell.
                    assert_eq!(normal.dot(&(b - a)) < 0.0, side(0), "{shape:?} {share}");
                    assert!(changed.is_none_or(|k| share <= k as f64 / steps as f64 + 1e-9));
                    let before = (share * steps as f64 - 1e-6).max(0.0) as usize;
                    assert!((0..=before).all(|k| side(k) == side(0)));
                }
                None => assert_eq!(changed, None, "{shape:?} from {a} to {b}"),
            }
        }
    }
    assert!(hits > 300);
}

fn still() -> Motion {
    Motion { times: [0.0, 1.0], start: Isometry3::identity(), end: Isometry3::identity() }
}

fn mesh_shape(mesh: &TriMesh) -> SceneShape {
    SceneShape::Mesh(mesh.clone())
}

/// Least signed distance of the polyline to a body's surface over dense samples in time, body frame, from time `from` to
/// time `to`; negative where it went inside.
fn least_distance(
    shape: &Shape,
    motion: &Motion,
    line: &Polyline,
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
            match shape.over(motion.times) {
                Surface::Convex(convex) => {
                    least = least.min(convex.closest_to_segment(&x[k], &x[k + 1]).1.distance)
                }
                Surface::Mesh([start, end]) => {
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

/// Random moving polylines against a body: what the detection lets pass never came near, and where it stops it is near.
fn no_tunnelling(shape: SceneShape, seed: u64, cases: usize, spin: f64) {
    let bodies = &mut Bodies::from_shapes(&[shape]);
    no_tunnelling_over(bodies, seed, cases, spin, |_, _| [0.0, 1.0]);
}

/// The same; `step` prepares the body for the step of a case and says which part of it is meant.
fn no_tunnelling_over(
    bodies: &mut Bodies,
    seed: u64,
    cases: usize,
    spin: f64,
    mut step: impl FnMut(&mut Bodies, usize) -> [f64; 2],
) {
    let mut random = Random::new(seed);
    let mut work = Workspace::default();
    let (mut hits, mut free) = (0, 0);
    while hits + free < cases {
        let start = random.vector() * 0.25;
        let direction = random.vector().normalize();
        let x0: Vec<_> =
            (0..4).map(|k| start + direction * 0.03 * k as f64 + random.vector() * 0.01).collect();
        let times = step(bodies, hits + free);
        let motion = Motion {
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
        let line = Polyline { x0: &x0, x1: &x1, clearance: &clearance };
        let shape = &bodies.bodies[0].shape;
        let inside = x0.iter().any(|x| shape.inside(times[0], x));
        if inside || least_distance(shape, &motion, &line, 0.0, 0.0, 1) <= 1e-6 {
            continue;
        }
        let mut contacts = Vec::new();
        let toi = bodies.impacts(&[motion], &line, &mut work, &mut contacts);
        let fresh = bodies.impacts(&[motion], &line, &mut Workspace::default(), &mut Vec::new());
        assert_eq!(toi, fresh, "memory changes no result");
        // A sample may fall between two grazes; the bound is that of what must never be reached at all.
        assert!(least_distance(shape, &motion, &line, 0.0, toi, 150) > 0.0, "tunnels before {toi}");
        if toi < 1.0 {
            hits += 1;
            let at = least_distance(shape, &motion, &line, toi, toi, 1);
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
fn nothing_tunnels_into_a_mesh() {
    no_tunnelling(mesh_shape(&blob(5, 0.08)), 21, 60, 0.3);
}

#[test]
fn nothing_tunnels_into_a_thin_mesh_that_turns_fast() {
    let mut thin = blob(5, 0.1);
    thin.vertices.iter_mut().for_each(|v| v.y *= 0.01);
    no_tunnelling(mesh_shape(&thin), 22, 60, 2.2);
}

#[test]
fn nothing_tunnels_into_convex_shapes() {
    no_tunnelling(SceneShape::Sphere { centre: Vector3::zeros(), radius: 0.07 }, 23, 100, 0.3);
    let ends = [Vector3::new(-0.05, 0.0, 0.0), Vector3::new(0.05, 0.02, 0.0)];
    no_tunnelling(SceneShape::Capsule { ends, radius: 0.01 }, 24, 100, 2.2);
    let radii = Vector3::new(0.1, 0.003, 0.06);
    let rotation = UnitQuaternion::from_euler_angles(0.3, 0.2, 0.1);
    no_tunnelling(SceneShape::Ellipsoid { centre: Vector3::zeros(), radii, rotation }, 25, 60, 1.0);
    no_tunnelling(SceneShape::Plane { point: Vector3::zeros(), normal: Vector3::y() }, 26, 100, 0.3);
}

#[test]
fn vertices_and_edges_hit_head_on_are_found_at_the_right_time() {
    // An octahedron: its top vertex at y = 0.1, its upper edges between.
    let r = 0.1;
    let vertices = [(r, 0., 0.), (-r, 0., 0.), (0., r, 0.), (0., -r, 0.), (0., 0., r), (0., 0., -r)]
        .map(|(x, y, z)| Vector3::new(x, y, z))
        .to_vec();
    let triangles =
        vec![[2, 4, 0], [2, 0, 5], [2, 5, 1], [2, 1, 4], [3, 0, 4], [3, 5, 0], [3, 1, 5], [3, 4, 1]];
    let body = Bodies::from_shapes(&[mesh_shape(&TriMesh { file: Default::default(), vertices, triangles })]);
    let d = [[1e-4; 2]];
    let drop = |a: Vector3<f64>, b: Vector3<f64>, fall: Vector3<f64>| {
        let (x0, x1) = ([a, b], [a + fall, b + fall]);
        let mut contacts = Vec::new();
        let line = Polyline { x0: &x0, x1: &x1, clearance: &d };
        let toi = body.impacts(&[still()], &line, &mut Workspace::default(), &mut contacts);
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
fn a_pop_of_the_head_is_caught() {
    let body = Bodies::from_shapes(&[mesh_shape(&blob(8, 0.1))]);
    let x0: Vec<_> = (0..17).map(|k| Vector3::new(0.14 + 0.001 * k as f64, -0.012 * k as f64, 0.0)).collect();
    let pop = Isometry3::from_parts(
        Translation3::new(0.18, 0.0, 0.0),
        UnitQuaternion::from_scaled_axis(Vector3::new(0.0, 127f64.to_radians(), 0.0)),
    );
    let motion = Motion { times: [0.0, 1.0], start: Isometry3::identity(), end: pop };
    let line = Polyline { x0: &x0, x1: &x0, clearance: &[[1e-4; 2]; 16] };
    let toi = body.impacts(&[motion], &line, &mut Workspace::default(), &mut Vec::new());
    assert!(toi > 0.0 && toi < 1.0);
    assert!(least_distance(&body.bodies[0].shape, &motion, &line, 0.0, toi, 400) > 0.0);
}

#[test]
fn memory_of_far_segments_changes_no_result() {
    let shapes =
        [mesh_shape(&blob(10, 0.1)), SceneShape::Sphere { centre: Vector3::x() * 0.2, radius: 0.05 }];
    let bodies = Bodies::from_shapes(&shapes);
    let mut random = Random::new(31);
    let mut remembering = Workspace::default();
    let mut x: Vec<_> = (0..12).map(|k| Vector3::new(0.11 + 0.012 * k as f64, 0.05, 0.0)).collect();
    let mut pose = Isometry3::identity();
    let (mut found, mut spared) = (0, 0);
    for _ in 0..300 {
        let x1: Vec<_> = x.iter().map(|v| v + random.vector() * 0.004).collect();
        let end = Isometry3::from_parts(
            Translation3::from(pose.translation.vector + random.vector() * 0.002),
            UnitQuaternion::from_scaled_axis(random.vector() * 0.02) * pose.rotation,
        );
        let motions = [Motion { times: [0.0, 1.0], start: pose, end }; 2];
        let line = Polyline { x0: &x, x1: &x1, clearance: &[[1e-3; 2]; 22] };
        let all = |work: &mut Workspace| {
            let mut contacts = Vec::new();
            bodies.candidates(&motions, &line, 2e-3, work, &mut contacts);
            let toi = bodies.impacts(&motions, &line, work, &mut contacts);
            (toi, contacts)
        };
        let before = remembering.remembered.clone();
        let with = all(&mut remembering);
        assert_eq!(with, all(&mut Workspace::default()));
        found += with.1.len();
        spared += before.iter().zip(&remembering.remembered).filter(|(a, b)| a == b).count();
        (x, pose) = (x1, end);
    }
    assert!(found > 100 && spared > 500, "{found} contacts, {spared} searches spared");
}

#[test]
fn a_segment_at_rest_on_a_plane_is_held_at_both_ends() {
    let plane = SceneShape::Plane { point: Vector3::zeros(), normal: Vector3::y() };
    let bodies = Bodies::from_shapes(&[plane]);
    let x = [Vector3::new(0.0, 1e-3, 0.0), Vector3::new(0.1, 1e-3, 0.0)];
    let line = Polyline { x0: &x, x1: &x, clearance: &[[1e-3; 2]] };
    let mut contacts = Vec::new();
    bodies.candidates(&[still()], &line, 1e-4, &mut Workspace::default(), &mut contacts);
    assert_eq!(contacts.iter().map(|c| c.u).collect::<Vec<_>>(), [0.0, 1.0]);
    assert!(contacts.iter().all(|c| c.gap.abs() < 1e-15 && c.normal == Vector3::y()));
}

#[test]
fn in_a_crease_both_walls_hold_a_vertex() {
    // A valley along z between the walls y = |x|.
    let v = |x: f64, z: f64| Vector3::new(x, x.abs(), z);
    let vertices = vec![v(0., -1.), v(0., 1.), v(1., -1.), v(1., 1.), v(-1., -1.), v(-1., 1.)];
    let triangles = vec![[0, 1, 3], [0, 3, 2], [0, 4, 5], [0, 5, 1]];
    let bodies =
        Bodies::from_shapes(&[mesh_shape(&TriMesh { file: Default::default(), vertices, triangles })]);
    let x = [Vector3::new(0.001, 0.5, 0.2), Vector3::new(0.001, 0.01, 0.2)];
    let line = Polyline { x0: &x, x1: &x, clearance: &[[1e-3; 2]] };
    let mut contacts = Vec::new();
    bodies.candidates(&[still()], &line, 0.01, &mut Workspace::default(), &mut contacts);
    assert_eq!(contacts.len(), 2);
    assert!(contacts.iter().all(|c| c.u == 1.0 && c.normal.y > 0.7));
    assert!(contacts[0].normal.x * contacts[1].normal.x < -0.49);
}

#[test]
fn what_passed_into_a_thin_part_is_pushed_back_the_way_it_came() {
    // A plate 2 mm thick; the vertex ends nearer to the far side.
    let radii = Vector3::new(0.05, 0.001, 0.05);
    let box_vertices =
        (0..8).map(|i| Vector3::from_fn(|k, _| if i >> k & 1 == 1 { radii[k] } else { -radii[k] })).collect();
    let quads = [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]];
    let triangles = quads.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]).collect();
    let plate = TriMesh { file: Default::default(), vertices: box_vertices, triangles };
    let bodies = Bodies::from_shapes(&[mesh_shape(&plate)]);
    let at = |y: f64| [Vector3::new(0.01, y + 0.01, 0.0), Vector3::new(0.01, y, 0.0)];
    let line = Polyline { x0: &at(0.003), x1: &at(-0.0007), clearance: &[[1e-4; 2]] };
    let mut contacts = Vec::new();
    bodies.candidates(&[still()], &line, 2e-3, &mut Workspace::default(), &mut contacts);
    assert_eq!(contacts.len(), 1, "{contacts:?}");
    assert!((contacts[0].normal - Vector3::y()).norm() < 1e-12);
    assert!((contacts[0].gap + 0.0018).abs() < 1e-12);
}

#[test]
fn exempt_roots_meet_nothing_and_points_inside_are_brought_out_gently() {
    let bodies = Bodies::from_shapes(&[mesh_shape(&blob(8, 0.1))]);
    let x: Vec<_> = (0..4).map(|k| Vector3::new(0.0, 0.08 + 0.02 * k as f64, 0.0)).collect();
    let mut contacts = Vec::new();
    let exempt = [[f64::NEG_INFINITY; 2], [f64::NEG_INFINITY, 1e-3], [1e-3; 2]];
    let line = Polyline { x0: &x, x1: &x, clearance: &exempt };
    let mut work = Workspace::default();
    bodies.candidates(&[still()], &line, 5e-3, &mut work, &mut contacts);
    assert!(contacts.iter().all(|c| c.segment + usize::from(c.u == 1.0) >= 2));
    assert_eq!(bodies.impacts(&[still()], &line, &mut work, &mut contacts), 1.0);
    // A vertex 30 mm deep that must now be no deeper than 25 mm.
    contacts.clear();
    let gentle = [[-0.025; 2], [f64::NEG_INFINITY; 2], [f64::NEG_INFINITY; 2]];
    let line = Polyline { x0: &x, x1: &x, clearance: &gentle };
    bodies.candidates(&[still()], &line, 5e-3, &mut work, &mut contacts);
    assert_eq!(contacts.len(), 1);
    let depth = bodies.closest(0, 0.0, &x[0], 1.0).unwrap().distance;
    assert!((contacts[0].gap - (depth + 0.025)).abs() < 1e-12 && contacts[0].gap < 0.0);
}

#[test]
fn the_middle_of_a_segment_that_began_inside_is_pushed_out_too() {
    // A roof with its ridge along z; the segment goes through it, 3 mm below the ridge.
    let end = |z: f64| [(0.0, 0.1), (-0.1, 0.0), (0.1, 0.0)].map(|(x, y)| Vector3::new(x, y, z));
    let vertices = [end(-0.2), end(0.2)].concat();
    let triangles =
        vec![[0, 2, 1], [3, 4, 5], [0, 1, 4], [0, 4, 3], [0, 3, 5], [0, 5, 2], [1, 2, 5], [1, 5, 4]];
    let roof = TriMesh { file: Default::default(), vertices, triangles };
    let bodies = Bodies::from_shapes(&[mesh_shape(&roof)]);
    let x = [Vector3::new(-0.05, 0.097, 0.013), Vector3::new(0.05, 0.097, 0.013)];
    assert!(x.iter().all(|x| bodies.closest(0, 0.0, x, 1.0).unwrap().distance > 0.03));
    let line = Polyline { x0: &x, x1: &x, clearance: &[[5e-4; 2]] };
    let mut contacts = Vec::new();
    bodies.candidates(&[still()], &line, 5e-3, &mut Workspace::default(), &mut contacts);
    assert_eq!(contacts.len(), 1, "{contacts:?}");
    let Contact { u, normal, gap, .. } = contacts[0];
    assert!((u - 0.5).abs() < 1e-9 && (normal - Vector3::y()).norm() < 1e-9 && (gap + 3.5e-3).abs() < 1e-9);
}

#[test]
fn distances_to_real_heads_agree_with_brute_force_and_winding_numbers() {
    let Some(heads) = shared_data("heads") else { return };
    for (name, closed) in [
        ("sintel_bust_m", false),
        ("sintel_collider_watertight_m", true),
        ("makehuman_skirt_m", false),
        ("makehuman_head_open_m", false),
    ] {
        let path = heads.join(format!("{name}.obj"));
        let (soup, _) = TriMesh::load_obj(&path, &crate::scene::Convention::default()).unwrap();
        let mesh = Mesh::new(&soup.vertices, &soup.triangles);
        let (low, high) = soup
            .vertices
            .iter()
            .fold((soup.vertices[0], soup.vertices[0]), |(low, high), v| (low.inf(v), high.sup(v)));
        let mut random = Random::new(41);
        for _ in 0..200 {
            let p = low + (high - low).component_mul(&(random.vector().add_scalar(1.0) * 0.5));
            let s = mesh.closest(&p, 10.0).unwrap();
            assert!((s.distance.abs() - unsigned_brute(&mesh, &p)).abs() < 1e-12, "{name}");
            if closed {
                assert_eq!(s.distance < 0.0, mesh.winding_number(&p) > 0.5, "{name}");
            }
        }
    }
}
