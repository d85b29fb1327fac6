use super::super::*;
use super::file;
use crate::geometry::tests::brute_force_distance;
use crate::geometry::{SolidMesh, TriMesh};
use crate::math::random::Random;
use crate::test_data::shared_data;
use approx::assert_relative_eq;
use nalgebra::Vector3;

#[test]
fn polygons_are_triangulated_and_triangles_without_area_dropped() {
    let text =
        "o a\nv 0 0 0\nv 100 0 0\nv 100 0 100\nv 0 0 100\nf 1 2 3 4\no b\nv 0 0 200\nf 1 2 -1\nf 1 2 2\n";
    let (_folder, path) = file("box.obj", text);
    let convention = Convention { metres_per_unit: 0.01, up: UpAxis::Z };
    let (mesh, degenerate) = TriMesh::load_obj(&path, &convention).unwrap();
    assert_eq!((mesh.triangles.len(), degenerate), (3, 1));
    let [a, b, c] = mesh.triangles[2].map(|i| mesh.vertices[i as usize]);
    assert_relative_eq!(a, Vector3::zeros());
    assert_relative_eq!(b, Vector3::x());
    assert_relative_eq!(c, Vector3::y() * 2.0, epsilon = 1e-15);
}

#[test]
fn real_heads_load() {
    let Some(heads) = shared_data("heads") else { return };
    let load = |name: &str, metres_per_unit: f64| {
        let convention = Convention { metres_per_unit, up: UpAxis::Y };
        TriMesh::load_obj(&heads.join(name), &convention).unwrap().0
    };
    assert_eq!(load("sintel_bust_m.obj", 1.0).triangles.len(), 5952);
    assert_eq!(load("sintel_bust_cm.obj", 0.01).triangles.len(), 5952);
    assert_eq!(load("makehuman_body_m.obj", 1.0).triangles.len(), 26756);
    assert_eq!(load("ratboy_body_m.obj", 1.0).triangles.len(), 25814);
}

#[test]
fn distances_to_real_heads_agree_with_brute_force_and_winding_numbers() {
    let Some(heads) = shared_data("heads") else { return };
    // All but one have holes, which are closed.
    let names =
        ["sintel_bust_m", "sintel_collider_watertight_m", "makehuman_skirt_m", "makehuman_head_open_m"];
    for name in names {
        let path = heads.join(format!("{name}.obj"));
        let (soup, _) = TriMesh::load_obj(&path, &Convention::default()).unwrap();
        let mesh = SolidMesh::new(&soup.vertices, &soup.triangles);
        assert_eq!(mesh.caps().is_empty(), name.contains("watertight"), "{name}");
        assert!(mesh.boundary().next().is_none(), "{name}");
        let (low, high) = soup
            .vertices
            .iter()
            .fold((soup.vertices[0], soup.vertices[0]), |(low, high), v| (low.inf(v), high.sup(v)));
        let mut random = Random::new(41);
        for _ in 0..200 {
            let p = low + (high - low).component_mul(&(random.vector().add_scalar(1.0) * 0.5));
            let s = mesh.closest(&p, 10.0).unwrap();
            assert!((s.distance.abs() - brute_force_distance(&mesh, &p)).abs() < 1e-12, "{name}");
            assert_eq!(s.distance < 0.0, mesh.winding_number(&p) > 0.5, "{name}");
        }
        // Behind the lids of an eye the cap passes through the surface, whose pseudonormals then do not tell
        // the side of what is nearest to its rim.
        let near: Vec<_> = (mesh.caps().iter().flatten())
            .flat_map(|&i| std::iter::repeat_n(soup.vertices[i as usize], 30))
            .map(|vertex| vertex + random.vector() * 0.05)
            .collect();
        let side = |p: &Vector3<f64>| mesh.closest(p, 10.0).unwrap().distance < 0.0;
        let turned = near.iter().filter(|p| side(p) != (mesh.winding_number(p) > 0.5)).count();
        assert_eq!(turned, 0, "{name}: of {}", near.len());
    }
}
