//! Distances against brute force: dense samples, triangle by triangle.

use super::*;
use crate::math::random::Random;
use nalgebra::{UnitQuaternion, Vector3};

/// A bumpy closed surface of about `2 n²` triangles around the origin, radius near `radius`.
pub(crate) fn blob(n: usize, radius: f64) -> TriMesh {
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
    TriMesh { vertices, triangles }
}

pub(crate) fn unsigned_brute(mesh: &SolidMesh, p: &Vector3<f64>) -> f64 {
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
        let mesh = SolidMesh::new(&soup.vertices, &soup.triangles);
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
    let mesh = SolidMesh::new(&soup.vertices, &soup.triangles);
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
    let tidy = SolidMesh::new(&soup.vertices, &soup.triangles);
    let mut random = Random::new(5);
    let mixed: Vec<[u32; 3]> = soup
        .triangles
        .iter()
        .map(|&[a, b, c]| if random.draw() > -0.5 { [a, c, b] } else { [a, b, c] })
        .collect();
    let mended = SolidMesh::new(&soup.vertices, &mixed);
    for _ in 0..300 {
        let p = random.vector() * 0.15;
        let (a, b) = (tidy.closest(&p, 1.0).unwrap(), mended.closest(&p, 1.0).unwrap());
        assert!((a.distance - b.distance).abs() < 1e-14);
    }
}

#[test]
fn beside_an_open_sheet_is_outside_and_behind_it_is_inside() {
    let v = |x: f64, z: f64| Vector3::new(x, 0.0, z);
    let sheet = SolidMesh::new(&[v(0., 0.), v(0., 1.), v(1., 1.), v(1., 0.)], &[[0, 1, 2], [0, 2, 3]]);
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
    let convex = shapes().into_iter().map(Solid::Convex);
    let mesh = Solid::new(&Shape::Mesh(blob(24, 0.09)), None);
    let mut hits = 0;
    for shape in convex.chain([mesh]) {
        for _ in 0..300 {
            let (a, b) = (random.vector() * 0.15, random.vector() * 0.15);
            let distance = |u: f64| shape.closest(0.0, &a.lerp(&b, u), 9.0).unwrap().distance;
            let steps = 200;
            let side = |k: usize| distance(k as f64 / steps as f64) > 0.0;
            let changed = (1..=steps).find(|k| side(*k) != side(0));
            match shape.first_intersection(0.0, &a, &b) {
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
