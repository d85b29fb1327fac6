use super::super::*;
use super::file;
use crate::test_data::shared_data;
use approx::assert_relative_eq;
use nalgebra::Vector3;

#[test]
fn polygons_are_split_and_degenerate_triangles_dropped() {
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
