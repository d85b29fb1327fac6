//! Deforming meshes.

use super::*;
use std::sync::Arc;

/// A random wave and rotation for each sample i, of these amplitudes, m and rad.
pub(crate) fn writhing(
    seed: u64,
    amplitude: f64,
    turn: f64,
) -> impl Fn(&Vector3<f64>, usize) -> Vector3<f64> {
    move |p, i| {
        let mut random = Random::new(seed + i as u64);
        let (wave, way) = (random.vector() * 40.0, random.vector() * amplitude);
        UnitQuaternion::from_scaled_axis(random.vector() * turn)
            * (p + way * (wave.dot(p) + 3.0 * random.draw()).sin())
    }
}

#[test]
fn parts_of_a_step_are_linear_and_independent_of_history() {
    let mesh = blob(6, 0.08);
    let sample = |i: usize| mesh.vertices.iter().map(|p| writhing(95, 0.02, 0.3)(p, i)).collect();
    let motion = Arc::new(Deformation { start: 0.0, rate: 1.0, samples: (0..6).map(sample).collect() });
    let solid = Solid::new(&Shape::Mesh(mesh.clone()), Some(&motion));
    assert!(matches!(solid, Solid::Deforming(_)));
    let new = || DeformingMesh::new(&mesh.vertices, &mesh.triangles, motion.clone());
    let (mut used, mut fresh) = (new(), new());
    for i in 0..4 {
        used.prepare([f64::from(i), f64::from(i) + 1.0], |_| None);
    }
    fresh.prepare([3.0, 4.0], |_| None);
    for fraction in [0.0, 0.375, 0.5, 1.0] {
        let (a, b) = (used.at(3.0 + fraction), fresh.at(3.0 + fraction));
        let p = Vector3::new(0.05, 0.09, 0.02);
        assert_eq!(a.closest(&p, 1.0), b.closest(&p, 1.0));
        for t in 0..a.triangle_count() as u32 {
            let ends = [a.triangle(t), fresh.at(3.0).triangle(t), fresh.at(4.0).triangle(t)];
            assert!((0..3).all(|k| (ends[0][k] - ends[1][k].lerp(ends[2][k], fraction)).norm() < 1e-15));
        }
        assert!((brute_force_distance(a, &p) - a.closest(&p, 1.0).unwrap().distance.abs()).abs() < 1e-14);
        let mut near = Vec::new();
        a.triangles_in(&Bounds::around([&p], 0.05), &mut near);
        let all = (0..a.triangle_count() as u32)
            .filter(|&t| (closest_on_triangle(&p, a.triangle(t)).0 - p).norm() < 0.05)
            .all(|t| near.contains(&t));
        assert!(all, "the hierarchy has the current triangles");
    }
    assert!(fresh.max_travel(4.0) > fresh.max_travel(3.5) && fresh.max_travel(3.0) > 0.0);
}

#[test]
fn separating_points_are_not_welded_and_collapsed_triangles_are_valid() {
    // Two triangles that share an edge, of which one vertex is duplicated: the mesh opens along that edge.
    let v = |x: f64, z: f64| Vector3::new(x, 0.0, z);
    let mesh = TriMesh {
        vertices: vec![v(0., 0.), v(0., 1.), v(1., 0.), v(0., 0.), v(-1., 0.)],
        triangles: vec![[0, 1, 2], [3, 4, 1]],
    };
    let opened = |i: usize| {
        let mut vertices = mesh.vertices.clone();
        vertices[3].y -= 0.1 * i as f64;
        // At the end the second triangle has collapsed to a segment.
        if i == 2 {
            vertices[4] = vertices[3].lerp(&vertices[1], 0.5);
        }
        vertices
    };
    let motion = Arc::new(Deformation { start: 0.0, rate: 1.0, samples: (0..3).map(opened).collect() });
    let mut deforming = DeformingMesh::new(&mesh.vertices, &mesh.triangles, motion);
    deforming.prepare([1.0, 2.0], |_| None);
    let p = Vector3::new(0.0, -0.19, 0.01);
    for (t, distance) in [(1.0, 0.09), (2.0, 0.01)] {
        let s = deforming.at(t).closest(&p, 1.0).unwrap();
        assert!(
            (s.distance.abs() - distance).abs() < 1e-2 && s.normal.iter().all(|x| x.is_finite()),
            "{s:?}"
        );
    }
}
