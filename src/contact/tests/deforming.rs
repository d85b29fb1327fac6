//! Contact detection with deforming meshes.

use super::*;
use crate::geometry::Deformation;
use crate::geometry::tests::deforming::writhing;
use nalgebra::Matrix3;
use std::sync::Arc;

/// A body of `mesh` whose vertices p pass through `shape(p, i)` at times i = 0, 1, …, s.
fn deforming(mesh: &TriMesh, samples: usize, shape: impl Fn(&Vector3<f64>, usize) -> Vector3<f64>) -> Bodies {
    let sample = |i: usize| mesh.vertices.iter().map(|p| shape(p, i)).collect();
    let deformation = Deformation { start: 0.0, rate: 1.0, samples: (0..samples).map(sample).collect() };
    Bodies::new([Body::new(&mesh_shape(mesh), Some(&Arc::new(deformation)), None)])
}

#[test]
fn impacts_with_a_deforming_mesh_prevent_tunnelling() {
    for (seed, amplitude, turn) in [(51, 0.03, 0.3), (52, 0.005, 1.5)] {
        let bodies = &mut deforming(&blob(5, 0.08), 100, writhing(seed, amplitude, turn));
        let parts = [[0.0, 1.0], [0.0, 0.5], [0.5, 1.0], [0.625, 0.75]];
        check_impacts_over(bodies, seed, 80, 0.3, |bodies, case| {
            let start = case as f64;
            bodies.prepare([start, start + 1.0]);
            parts[case % 4].map(|u| start + u)
        });
    }
}

/// Covers edges against edges, and corners against the interior of segments.
#[test]
fn a_moving_triangle_has_an_impact_with_a_segment() {
    let triangle = TriMesh {
        vertices: vec![Vector3::zeros(), Vector3::x() * 0.02, Vector3::z() * -0.02],
        triangles: vec![[0, 1, 2]],
    };
    let mut random = Random::new(61);
    let (mut hits, mut features) = (0, [0; 3]);
    for _ in 0..400 {
        let offsets: Vec<[Vector3<f64>; 3]> =
            (0..2).map(|_| [0; 3].map(|_| random.vector() * 0.02)).collect();
        let throw = random.vector() * 0.02 - Vector3::y() * 0.05;
        let corner = |p: &Vector3<f64>| triangle.vertices.iter().position(|v| v == p).unwrap();
        let mut bodies = deforming(&triangle, 2, |p, i| p + offsets[i][corner(p)] + throw * i as f64);
        bodies.prepare([0.0, 1.0]);
        let x = [random.vector() * 0.02 - Vector3::y() * 0.04, random.vector() * 0.02 - Vector3::y() * 0.04];
        let line = MovingPolyline { x0: &x, x1: &x, clearance: &[[5e-4; 2]], by_part: false };
        let shape = &bodies.bodies[0].solid;
        if sampled_distance(shape, &still(), &line, 0.0, 0.0, 1) < 1e-4 {
            continue;
        }
        let mut contacts = Vec::new();
        let toi = bodies.impacts(&[still()], &line, &mut ContactCache::default(), &mut contacts);
        let MovingSurface::Mesh([before, _]) = shape.surface_over([0.0, 1.0]) else { panic!("a mesh") };
        let whole = sampled_distance(shape, &still(), &line, 0.0, 1.0, 800);
        if toi == 1.0 {
            // A start behind the sheet is inside, and has no impact.
            let inside =
                |k: i32| before.closest(&x[0].lerp(&x[1], f64::from(k) / 50.0), 1.0).unwrap().distance < 0.0;
            let behind = (0..=50).any(inside);
            assert!(whole > 0.0 || behind, "passes through without an impact");
            continue;
        }
        assert!(sampled_distance(shape, &still(), &line, 0.0, toi, 800) > 0.0, "stops too late");
        let at = sampled_distance(shape, &still(), &line, toi, toi, 1);
        assert!(at > 0.0 && at < 0.126e-3, "stops {at} m away");
        hits += 1;
        features[match contacts[0].feature {
            Feature::Face(_) => 0,
            Feature::Edge(_) => 1,
            _ => 2,
        }] += 1;
    }
    assert!(hits > 40 && features[0] > 5 && features[1] > 5, "{hits} hits, {features:?}");
}

/// Under an affine map every material point of the surface is known in closed form.
#[test]
fn contacts_carry_the_material_point_at_both_ends() {
    let maps = [
        Matrix3::new(1.1, 0.1, 0.0, -0.1, 0.9, 0.2, 0.0, 0.1, 1.0),
        Matrix3::new(1.0, -0.1, 0.1, 0.1, 1.05, 0.1, 0.0, 0.0, 1.1),
    ];
    let mut bodies = deforming(&blob(6, 0.08), 2, |p, i| maps[i] * p);
    bodies.prepare([0.0, 1.0]);
    let back = maps[0] * maps[1].try_inverse().unwrap();
    let mut random = Random::new(71);
    let mut seen = [0; 3];
    for k in 0..400 {
        let mut a = random.vector().normalize() * 0.16;
        if k % 2 == 0 {
            // Aimed at a vertex.
            let MovingSurface::Mesh([_, mesh]) = bodies.bodies[0].solid.surface_over([0.0, 1.0]) else {
                panic!("a mesh")
            };
            a = mesh.vertex(k / 2 % 60) * 2.0;
        }
        let (x0, x1) = ([a, a * 1.2], [a * (0.51 + 0.2 * random.draw().max(0.0)), a]);
        let line = MovingPolyline { x0: &x0, x1: &x1, clearance: &[[1e-3; 2]], by_part: false };
        let (mut cache, mut contacts) = (ContactCache::default(), Vec::new());
        bodies.candidates(&[still()], &line, 5e-3, &mut cache, &mut contacts);
        bodies.impacts(&[still()], &line, &mut cache, &mut contacts);
        for c in &contacts {
            assert!((c.point[0] - back * c.point[1]).norm() < 1e-12, "{c:?}");
            assert!((c.normal.norm() - 1.0).abs() < 1e-12);
            seen[match c.feature {
                Feature::Face(_) => 0,
                Feature::Edge(_) => 1,
                _ => 2,
            }] += 1;
        }
    }
    assert!(seen.iter().all(|n| *n > 5), "{seen:?}");
}

#[test]
fn rotating_vertices_are_equivalent_to_a_rotating_body() {
    let turn = UnitQuaternion::from_scaled_axis(Vector3::new(0.0, 0.02, 0.01));
    let shift = Vector3::new(0.0, 0.002, 0.0);
    let mesh = blob(8, 0.1);
    let mut soft = deforming(&mesh, 2, |p, i| if i == 0 { *p } else { turn * p + shift });
    soft.prepare([0.0, 1.0]);
    let rigid = Bodies::from_shapes(&[mesh_shape(&mesh)]);
    let moving = BodyMotion { end: Isometry3::from_parts(shift.into(), turn), ..still() };
    let mut random = Random::new(81);
    let mut compared = 0;
    for _ in 0..300 {
        let a = random.vector().normalize() * 0.16;
        let (x0, x1) = ([a, a * 1.2], [a * (0.55 + 0.1 * random.draw()), a]);
        let line = MovingPolyline { x0: &x0, x1: &x1, clearance: &[[1e-3; 2]], by_part: false };
        let find = |bodies: &Bodies, motion: BodyMotion| {
            let mut contacts = Vec::new();
            bodies.candidates(&[motion], &line, 2e-3, &mut ContactCache::default(), &mut contacts);
            let candidates = contacts.len();
            let toi = bodies.impacts(&[motion], &line, &mut ContactCache::default(), &mut contacts);
            (toi, candidates, contacts)
        };
        let (toi, n, contacts) = find(&soft, still());
        let (rigid_toi, rigid_n, rigid_contacts) = find(&rigid, moving);
        // The paths differ, by up to half a millimetre: grazes may be missed, and times differ slightly.
        if contacts.len() != rigid_contacts.len() {
            continue;
        }
        assert!((toi - rigid_toi).abs() < 1e-2, "{toi} {rigid_toi}");
        assert_eq!(n, rigid_n);
        for (a, b) in contacts[..n].iter().zip(&rigid_contacts) {
            let apart = [0, 1].map(|i| (a.point[i] - b.point[i]).norm());
            assert!(a.feature == b.feature && apart[0] < 1e-12 && apart[1] < 1e-12, "{a:?} {b:?}");
            assert!((a.normal - b.normal).norm() < 1e-10, "{a:?} {b:?}");
            compared += 1;
        }
    }
    assert!(compared > 50, "{compared} compared");
}

#[test]
fn cached_bounds_change_no_contact_with_a_deforming_mesh() {
    let bodies = &mut deforming(&blob(8, 0.08), 200, writhing(91, 0.01, 0.02));
    let mut random = Random::new(92);
    let mut cache = ContactCache::default();
    let home: Vec<_> = (0..12).map(|k| Vector3::new(0.08 + 0.012 * k as f64, 0.03, 0.0)).collect();
    let mut x = home.clone();
    let (mut found, mut skipped) = (0, 0);
    for i in 0..199 {
        let start = f64::from(i);
        bodies.prepare([start, start + 1.0]);
        // Every second step is divided into halves.
        let parts: &[[f64; 2]] = if i % 2 == 0 { &[[0.0, 1.0]] } else { &[[0.0, 0.5], [0.5, 1.0]] };
        for part in parts {
            let x1: Vec<_> = home.iter().map(|v| v + random.vector() * 4e-4).collect();
            let line = MovingPolyline { x0: &x, x1: &x1, clearance: &[[1e-3; 2]; 11], by_part: false };
            let motion = BodyMotion { times: part.map(|u| start + u), ..still() };
            let all = |cache: &mut ContactCache| {
                let mut contacts = Vec::new();
                bodies.candidates(&[motion], &line, 2e-3, cache, &mut contacts);
                let toi = bodies.impacts(&[motion], &line, cache, &mut contacts);
                (toi, contacts)
            };
            let before = cache.bounds.clone();
            let with = all(&mut cache);
            assert_eq!(with, all(&mut ContactCache::default()));
            found += with.1.len();
            skipped += before.iter().zip(&cache.bounds).filter(|(a, b)| a == b).count();
            x = x1;
        }
    }
    assert!(found > 50 && skipped > 300, "{found} contacts, {skipped} searches skipped");
}

#[test]
fn where_parts_overlap_a_vertex_is_out_of_that_which_it_is_least_deep_in() {
    // Two slabs, the upper thin: the lower ends at y = 0 and the upper is from y = -1.5 to 1.5 mm.
    let (mut mesh, thin) = (slab([-0.1, 0.0]), slab([-1.5e-3, 1.5e-3]));
    let first = mesh.vertices.len() as u32;
    mesh.vertices.extend(thin.vertices);
    mesh.triangles.extend(thin.triangles.iter().map(|t| t.map(|v| v + first)));
    let mut bodies = deforming(&mesh, 2, |p, _| *p);
    bodies.prepare([0.0, 1.0]);
    let found = |y: f64| {
        let x = [Vector3::new(0.01, y, 0.02), Vector3::new(0.01, y + 0.05, 0.02)];
        let line = MovingPolyline { x0: &x, x1: &x, clearance: &[[5e-4; 2]], by_part: true };
        let mut contacts = Vec::new();
        bodies.candidates(&[still()], &line, 2e-3, &mut ContactCache::default(), &mut contacts);
        let mut planes: Vec<_> =
            contacts.iter().filter(|c| c.u == 0.0).map(|c| (c.normal.y, c.gap)).collect();
        planes.sort_by(|a, b| a.1.total_cmp(&b.1));
        planes
    };
    let near = |found: &[(f64, f64)], expected: &[(f64, f64)]| {
        let same = |(a, b): (&(f64, f64), &(f64, f64))| (a.0 - b.0).abs() + (a.1 - b.1).abs() < 1e-9;
        assert!(found.len() == expected.len() && found.iter().zip(expected).all(same), "{found:?}");
    };
    // Above both: in front of the upper sides of both, and behind the lower side of the thin slab only by its
    // being thin. In the thin slab: out of it, above the lower one. In both: out of the lower one.
    near(&found(2e-3), &[(1.0, 0.0), (1.0, 1.5e-3)]);
    near(&found(1e-3), &[(1.0, -1e-3), (1.0, 5e-4)]);
    near(&found(-2e-4), &[(1.0, -7e-4)]);
}
