//! Distances compared with brute force: dense samples, and each triangle in turn.

use super::*;
use crate::math::random::Random;
use nalgebra::{UnitQuaternion, Vector3};

pub(crate) mod deforming;

/// A bumpy closed surface of about `2 n²` triangles about the origin, of radius near `radius`, m.
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
    // The poles and the seam are duplicated: welding must close them.
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

/// Unsigned distance of `p` from all triangles, m.
pub(crate) fn brute_force_distance(mesh: &SolidMesh, p: &Vector3<f64>) -> f64 {
    (0..mesh.triangle_count() as u32)
        .map(|t| (closest_on_triangle(p, mesh.triangle(t)).0 - p).norm())
        .fold(f64::INFINITY, f64::min)
}

#[test]
fn mesh_distance_agrees_with_brute_force_and_winding_number() {
    // A flattened blob has sharp edges, at which the normal of a single face gives the wrong side.
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
            assert!((s.distance.abs() - brute_force_distance(&mesh, &p)).abs() < 1e-14);
            assert_eq!(s.distance < 0.0, mesh.winding_number(&p) > 0.5, "{p}");
            assert!((p - s.normal * s.distance - s.point).norm() < 1e-13, "the normal points to the surface");
            assert!(mesh.closest(&p, s.distance.abs() * 0.999).is_none());
            inside += usize::from(s.distance < 0.0);
        }
        assert!(inside > 200 && inside < 1800);
    }
}

#[test]
fn winding_number_equals_the_sum_of_solid_angles() {
    // Two nested blobs without every third triangle, and points so near that half the solid angles of their
    // triangles add up to more than π.
    let [mut soup, inner] = [0.1, 0.05].map(|radius| blob(6, radius));
    soup.triangles.extend(inner.triangles.iter().map(|t| t.map(|i| i + soup.vertices.len() as u32)));
    soup.vertices.extend(inner.vertices);
    let mut n = 0;
    soup.triangles.retain(|_| {
        n += 1;
        n % 3 != 0
    });
    let mesh = SolidMesh::new(&soup.vertices, &soup.triangles);
    let (mut random, mut most) = (Random::new(3), [0.0_f64; 2]);
    for _ in 0..2000 {
        let p = random.vector() * 0.15;
        let w = mesh.winding_number(&p);
        assert!((w - sum_of_solid_angles(&mesh, &p)).abs() < 1e-12, "{p}: {w}");
        most = [most[0].min(w), most[1].max(w)];
    }
    assert!(most[0] < -0.01 && most[1] > 1.2, "{most:?}");
}

#[test]
fn winding_number_is_exact_where_edges_and_vertices_are_right_above() {
    // Two blobs that overlap, on a grid of coordinates: below, above and between their vertices and edges.
    let [mut soup, other] = [blob(6, 0.1), blob(7, 0.08)];
    soup.triangles.extend(other.triangles.iter().map(|t| t.map(|i| i + soup.vertices.len() as u32)));
    soup.vertices.extend(other.vertices.iter().map(|v| v + Vector3::new(0.05, 0.03, 0.02)));
    let on_grid = |v: &Vector3<f64>| v.map(|x| (x * 128.0).round() / 128.0);
    soup.vertices.iter_mut().for_each(|v| *v = on_grid(v));
    let mesh = SolidMesh::new(&soup.vertices, &soup.triangles);
    let with_midpoints = |t: u32| {
        let [a, b, c] = mesh.triangle(t);
        [*a, *b, *c, 0.5 * (a + b), 0.5 * (b + c), 0.5 * (c + a)]
    };
    let places = (0..mesh.triangle_count() as u32).flat_map(with_midpoints);
    let mut seen = [0; 3];
    for p in places.flat_map(|x| (-12..12).map(move |k| x + Vector3::z() * (f64::from(k) + 0.37) / 64.0)) {
        let w = sum_of_solid_angles(&mesh, &p);
        if mesh.closest(&p, 1.0).unwrap().distance.abs() > 1e-9 {
            assert_eq!(mesh.winding_number(&p), w.round(), "{p}");
            seen[w.round() as usize] += 1;
        }
    }
    assert!(seen.iter().all(|n| *n > 500), "{seen:?}");
}

/// The winding number of a mesh about `p`, by its definition.
fn sum_of_solid_angles(mesh: &SolidMesh, p: &Vector3<f64>) -> f64 {
    let half_angle = |t: u32| {
        let [a, b, c] = mesh.triangle(t).map(|v| v - p);
        let [la, lb, lc] = [a, b, c].map(|v| v.norm());
        let cos = la * lb * lc + a.dot(&b) * lc + b.dot(&c) * la + c.dot(&a) * lb;
        a.dot(&b.cross(&c)).atan2(cos)
    };
    (0..mesh.triangle_count() as u32).map(half_angle).sum::<f64>() / std::f64::consts::TAU
}

#[test]
fn mixed_orientation_is_repaired_and_a_closed_mesh_oriented_outward() {
    let soup = blob(8, 0.1);
    let oriented = SolidMesh::new(&soup.vertices, &soup.triangles);
    let mut random = Random::new(5);
    let mixed: Vec<[u32; 3]> = soup
        .triangles
        .iter()
        .map(|&[a, b, c]| if random.draw() > -0.5 { [a, c, b] } else { [a, b, c] })
        .collect();
    let repaired = SolidMesh::new(&soup.vertices, &mixed);
    for _ in 0..300 {
        let p = random.vector() * 0.15;
        let (a, b) = (oriented.closest(&p, 1.0).unwrap(), repaired.closest(&p, 1.0).unwrap());
        assert!((a.distance - b.distance).abs() < 1e-14);
    }
}

#[test]
fn points_beside_an_open_sheet_are_outside_and_points_behind_it_inside() {
    let v = |x: f64, z: f64| Vector3::new(x, 0.0, z);
    let sheet = SolidMesh::new(&[v(0., 0.), v(0., 1.), v(1., 1.), v(1., 0.)], &[[0, 1, 2], [0, 2, 3]]);
    let distance = |x, y| sheet.closest(&Vector3::new(x, y, 0.5), 9.0).unwrap();
    assert_eq!(distance(0.5, 0.25).distance, 0.25);
    assert_eq!(distance(0.5, -0.25).distance, -0.25);
    let beside = distance(1.3, -0.4);
    assert!((beside.distance - 0.5).abs() < 1e-15);
    assert!((beside.normal - Vector3::new(0.6, -0.8, 0.0)).norm() < 1e-15);
}

fn convex_shapes() -> Vec<Convex> {
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
fn convex_distance_is_the_minimum_over_surface_samples() {
    let mut random = Random::new(2);
    for shape in convex_shapes() {
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
fn ellipsoid_distance_is_exact_on_the_axes() {
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
    // On the long axis, inside the evolute, the closest point leaves the axis.
    let p = Vector3::new(0.0, 1.0, 0.0);
    let least = (0..100_000)
        .map(|k| k as f64 * std::f64::consts::PI / 100_000.0)
        .map(|t| (Vector3::new(t.sin(), 3.0 * t.cos(), 0.0) - p).norm())
        .fold(f64::INFINITY, f64::min);
    assert!((d(0., 1., 0.) + least).abs() < 1e-8);
}

#[test]
fn segment_triangle_distance_is_the_minimum_over_samples() {
    let mut random = Random::new(3);
    let mut intersecting = 0;
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
        intersecting += usize::from(pair.distance2 == 0.0);
    }
    assert!(intersecting > 50);
}

#[test]
fn first_intersection_is_the_first_sign_change_of_the_distance() {
    let mut random = Random::new(9);
    let convex = convex_shapes().into_iter().map(Solid::Convex);
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
                Some((fraction, normal)) => {
                    hits += 1;
                    assert!(distance(fraction).abs() < 1e-9, "{shape:?}");
                    assert!((normal.norm() - 1.0).abs() < 1e-12);
                    // Entering against the normal, leaving along it; never later than the samples.
                    assert_eq!(normal.dot(&(b - a)) < 0.0, side(0), "{shape:?} {fraction}");
                    assert!(changed.is_none_or(|k| fraction <= k as f64 / steps as f64 + 1e-9));
                    let before = (fraction * steps as f64 - 1e-6).max(0.0) as usize;
                    assert!((0..=before).all(|k| side(k) == side(0)));
                }
                None => assert_eq!(changed, None, "{shape:?} from {a} to {b}"),
            }
        }
    }
    assert!(hits > 300);
}

#[test]
fn parts_of_a_mesh_face_each_other_across_a_gap_and_an_overlap_but_not_through_a_solid() {
    // Two balls on the z axis whose surfaces are `gap` apart, in one mesh; and a lens.
    let balls = |gap: f64| {
        let [mut balls, other] = [1.0, -1.0].map(|side| {
            let centre = Vector3::z() * (side * (0.05 + 0.5 * gap));
            Shape::Sphere { centre, radius: 0.05 }.tessellate()
        });
        let first = balls.vertices.len() as u32;
        balls.vertices.extend(other.vertices);
        balls.triangles.extend(other.triangles.iter().map(|t| t.map(|v| v + first)));
        balls
    };
    let radii = Vector3::new(0.05, 0.05, 0.004);
    let rotation = UnitQuaternion::identity();
    let lens = Shape::Ellipsoid { centre: Vector3::zeros(), radii, rotation }.tessellate();
    let facing = |mesh: &TriMesh, height: f64| {
        let mesh = SolidMesh::new(&mesh.vertices, &mesh.triangles);
        let p = Vector3::new(2e-4, 1e-4, height);
        let on = mesh.closest(&p, 1.0).unwrap();
        mesh.facing(&p, &on, -0.5, 1.0).map(|part| [on.distance, part.distance])
    };
    for gap in [2e-3, -0.01] {
        let balls = balls(gap);
        for share in [-0.9, -0.3, 0.4, 0.8] {
            let [on, part] = facing(&balls, 0.5 * gap * share).unwrap();
            assert!((on + part - gap).abs() < 2e-4, "{on} and {part} of {gap}");
            let nearest = 0.5 * (gap.abs() * (1.0 - share.abs())).copysign(gap);
            assert!((on - nearest).abs() < 2e-4, "{on} is not {nearest}");
        }
    }
    // In front of a part that another overlaps: inside that one, and outside the nearest.
    let [on, part] = facing(&balls(-0.01), 0.0055).unwrap();
    assert!(on > 0.0 && (on + part + 0.01).abs() < 2e-4, "{on} and {part}");
    for height in [0.006, 0.0041, 0.003, 0.0, -0.003, -0.006] {
        assert_eq!(facing(&lens, height), None, "{height} m above the middle of a lens");
    }
}

#[test]
fn a_place_on_a_part_of_a_mesh_is_inside_another_part_at_any_angle() {
    // Two blocks: the side of the second, at x = 0, stands on the top of the first, at y = 0.
    let block = |lo: [f64; 3], hi: [f64; 3]| {
        let corner = |i: usize| Vector3::from_fn(|k, _| if i >> k & 1 == 1 { hi[k] } else { lo[k] });
        let quads = [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]];
        let triangles = quads.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]).collect();
        TriMesh { vertices: (0..8).map(corner).collect(), triangles }
    };
    let mut blocks = block([-0.1, -0.06, -0.1], [0.1, 0.0, 0.1]);
    let wall = block([0.0, -0.04, -0.04], [0.06, 0.05, 0.04]);
    let first = blocks.vertices.len() as u32;
    blocks.vertices.extend(wall.vertices);
    blocks.triangles.extend(wall.triangles.iter().map(|t| t.map(|v| v + first)));
    let mesh = SolidMesh::new(&blocks.vertices, &blocks.triangles);
    let found = |x: f64, y: f64| {
        let p = Vector3::new(x, y, 3e-3);
        let on = mesh.closest(&p, 1.0).unwrap();
        assert_eq!(mesh.facing(&p, &on, -0.5, 0.03), None);
        mesh.facing_or_around(&p, &on, -0.5, 0.03)
    };
    // On the top of the first block, and above it: 5 mm behind the side of the second.
    for y in [0.0, 2e-3] {
        let part = found(5e-3, y).unwrap();
        assert!((part.distance + 5e-3).abs() < 1e-12, "{y}: {}", part.distance);
        assert!((part.normal + Vector3::x()).norm() < 1e-9);
    }
    // In front of the side, and inside the first block alone.
    for (x, y) in [(-5e-3, 0.0), (-5e-3, 2e-3), (-5e-3, -2e-3)] {
        assert_eq!(found(x, y), None, "{x} {y}");
    }
}

#[test]
fn a_place_beside_a_fold_of_a_surface_through_itself_is_outside() {
    let mut ball = Shape::Sphere { centre: Vector3::zeros(), radius: 0.05 }.tessellate();
    // A point is pulled over its neighbours, out by 0.5 mm: the faces behind it show their backs.
    let pulled = (0..ball.vertices.len()).max_by(|a, b| ball.vertices[*a].x.total_cmp(&ball.vertices[*b].x));
    let pulled = pulled.unwrap();
    let of_pulled = ball.triangles.iter().filter(|t| t.contains(&(pulled as u32))).copied();
    let faces: Vec<[u32; 3]> = of_pulled.collect();
    let x = ball.vertices[pulled];
    let away = |v: &u32| (ball.vertices[*v as usize] - x).norm();
    let reach = faces.iter().flatten().map(away).fold(0.0, f64::max);
    ball.vertices[pulled] = (x + Vector3::y() * (2.0 * reach)).normalize() * 0.0505;
    let mesh = SolidMesh::new(&ball.vertices, &ball.triangles);
    let (mut random, mut backs) = (Random::new(7), 0);
    for _ in 0..5000 {
        let mut within = |half: f64| half * random.draw();
        let p = x + Vector3::new(within(2e-3), within(4.0 * reach), within(2.0 * reach));
        let on = mesh.closest(&p, 1.0).unwrap();
        let outside = mesh.winding_number(&p) <= 0.5;
        assert!(on.distance >= 0.0 || !outside, "{p}: {}", on.distance);
        // As a face tells by its normal alone.
        backs += u32::from(outside && (p - on.point).dot(&mesh.pseudonormal(on.feature)) < -5e-6);
        if on.distance > 0.0 {
            assert!((on.normal - (p - on.point).normalize()).norm() < 1e-9);
        }
    }
    assert!(backs > 50, "{backs}");
}
