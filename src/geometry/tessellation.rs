//! Tessellation of shapes, for caches and pictures.

use super::shape::Shape;
use super::tri_mesh::TriMesh;
use crate::math::frame::transport;
use nalgebra::{Matrix3, Vector3};
use std::f64::consts::{PI, TAU};

/// Bands of latitude from pole to pole of a round shape; even, so that one ring is the equator.
const BANDS: usize = 48;
/// Half the side of the square that represents a plane, m.
const PLANE_HALF: f64 = 1.0;

impl Shape {
    /// Triangles of the shape, rest space, counter-clockwise seen from outside. A mesh is returned unchanged.
    ///
    /// The polyhedra of round shapes are circumscribed and exceed the shape by at most 0.22 % of the radius
    /// (of the longest semi-axis for an ellipsoid). A plane, which is unbounded, becomes a square of 2 m
    /// about its point.
    pub fn tessellate(&self) -> TriMesh {
        match self {
            Shape::Mesh(mesh) => mesh.clone(),
            Shape::Sphere { centre, radius } => {
                circumscribed([*centre; 2], &Matrix3::from_diagonal_element(*radius))
            }
            Shape::Capsule { ends: [a, b], radius } => {
                let axes = pole_towards(&(b - a));
                circumscribed([*b, *a], &(axes * *radius))
            }
            Shape::Ellipsoid { centre, radii, rotation } => {
                let axes = rotation.to_rotation_matrix().into_inner() * Matrix3::from_diagonal(radii);
                circumscribed([*centre; 2], &axes)
            }
            Shape::Plane { point, normal } => {
                let axes = pole_towards(normal);
                let corner = |x: f64, z: f64| point + axes * Vector3::new(x, 0.0, z) * PLANE_HALF;
                let vertices = vec![corner(-1., -1.), corner(-1., 1.), corner(1., 1.), corner(1., -1.)];
                TriMesh { vertices, triangles: vec![[0, 1, 2], [0, 2, 3]] }
            }
        }
    }
}

/// Smallest rotation that takes y to `direction`; the identity for the null vector.
fn pole_towards(direction: &Vector3<f64>) -> Matrix3<f64> {
    direction.try_normalize(0.0).map_or_else(Matrix3::identity, |pole| transport(&Vector3::y(), &pole))
}

/// A polyhedron circumscribed about the unit sphere, mapped by `axes`: its upper half about `centres[0]`, its
/// lower half about `centres[1]`.
fn circumscribed(centres: [Vector3<f64>; 2], axes: &Matrix3<f64>) -> TriMesh {
    let columns = 2 * BANDS;
    // A trapezoid between two rings of the unit sphere is nearest to the centre at the equator, where half
    // its height and half its width each contribute a cosine. The polyhedron is scaled up by their product.
    let scale = 1.0 / ((PI / (2.0 * BANDS as f64)).cos() * (PI / columns as f64).cos());
    let polar = |i: usize| PI * i as f64 / BANDS as f64;
    let mut vertices = vec![centres[0] + axes * Vector3::y() * scale];
    let ring = |i: usize, centre: Vector3<f64>| {
        (0..columns).map(move |j| {
            let (theta, phi) = (polar(i), TAU * j as f64 / columns as f64);
            let unit = Vector3::new(theta.sin() * phi.sin(), theta.cos(), theta.sin() * phi.cos());
            centre + axes * unit * scale
        })
    };
    // The equator appears twice if the centres differ: the ends of a capsule's cylinder.
    let two_equators = centres[0] != centres[1];
    let half = BANDS / 2;
    let upper = (1..=half).map(|i| (i, centres[0]));
    let lower = (if two_equators { half } else { half + 1 }..BANDS).map(|i| (i, centres[1]));
    let rings: Vec<_> = upper.chain(lower).collect();
    rings.iter().for_each(|&(i, centre)| vertices.extend(ring(i, centre)));
    vertices.push(centres[1] - axes * Vector3::y() * scale);
    TriMesh { vertices, triangles: sphere_triangles(rings.len(), columns) }
}

/// Triangles of a sphere whose vertices are the upper pole, `rings` rings of `columns` vertices, and the
/// lower pole.
fn sphere_triangles(rings: usize, columns: usize) -> Vec<[u32; 3]> {
    let south = (1 + rings * columns) as u32;
    let at = |row: usize, j: usize| (1 + row * columns + j % columns) as u32;
    let last = rings - 1;
    let mut triangles = Vec::new();
    for j in 0..columns {
        triangles.push([0, at(0, j), at(0, j + 1)]);
        for row in 0..last {
            let [a, b, c, d] = [at(row, j), at(row + 1, j), at(row + 1, j + 1), at(row, j + 1)];
            triangles.extend([[a, b, c], [a, c, d]]);
        }
        triangles.push([south, at(last, j + 1), at(last, j)]);
    }
    triangles
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::UnitQuaternion;

    /// Asserts that the planes of all triangles lie outside the unit ball, and all vertices within 1.0022.
    /// `into_unit` maps the shape to the unit ball.
    fn check_ball(mesh: &TriMesh, into_unit: impl Fn(&Vector3<f64>) -> Vector3<f64>) {
        for t in &mesh.triangles {
            let [a, b, c] = t.map(|i| into_unit(&mesh.vertices[i as usize]));
            let n = (b - a).cross(&(c - a)).normalize();
            let height = n.dot(&a);
            assert!(height > 1.0 - 1e-12, "intersects the ball or is oriented inward: {height}");
        }
        assert!(mesh.vertices.iter().all(|v| into_unit(v).norm() < 1.0022));
    }

    fn closed(mesh: &TriMesh) -> bool {
        let mut sides: Vec<[u32; 2]> =
            mesh.triangles.iter().flat_map(|t| (0..3).map(|i| [t[i], t[(i + 1) % 3]])).collect();
        sides.sort_unstable();
        sides.windows(2).all(|w| w[0] != w[1])
            && sides.iter().all(|&[a, b]| sides.binary_search(&[b, a]).is_ok())
    }

    #[test]
    fn round_shapes_are_closed_and_circumscribed() {
        let centre = Vector3::new(0.1, -0.2, 0.3);
        let sphere = Shape::Sphere { centre, radius: 0.5 }.tessellate();
        check_ball(&sphere, |v| (v - centre) / 0.5);
        assert!(closed(&sphere));
        let (radii, rotation) =
            (Vector3::new(0.1, 0.4, 0.2), UnitQuaternion::from_euler_angles(0.4, 1.0, -0.7));
        let ellipsoid = Shape::Ellipsoid { centre, radii, rotation }.tessellate();
        check_ball(&ellipsoid, |v| (rotation.inverse() * (v - centre)).component_div(&radii));
        assert!(closed(&ellipsoid));
    }

    #[test]
    fn a_capsule_is_closed_and_circumscribed() {
        for end in [Vector3::new(0.3, 0.1, -0.2), -Vector3::y()] {
            let (radius, length) = (0.1, end.norm());
            let capsule = Shape::Capsule { ends: [Vector3::zeros(), end], radius }.tessellate();
            assert!(closed(&capsule));
            for t in &capsule.triangles {
                let [a, b, c] = t.map(|i| capsule.vertices[i as usize]);
                let n = (b - a).cross(&(c - a)).normalize();
                // The support function of a capsule in direction n.
                assert!(n.dot(&a) > radius + n.dot(&end).max(0.0) - 1e-12);
            }
            let axis = end / length;
            assert!(capsule.vertices.iter().all(|v| {
                let along = v.dot(&axis).clamp(0.0, length);
                (v - axis * along).norm() < radius * 1.0022
            }));
        }
    }

    #[test]
    fn a_plane_is_a_square_with_its_normal() {
        let normal = Vector3::new(0.6, -0.8, 0.0);
        let plane = Shape::Plane { point: Vector3::x(), normal }.tessellate();
        for t in &plane.triangles {
            let [a, b, c] = t.map(|i| plane.vertices[i as usize]);
            assert!(((b - a).cross(&(c - a)).normalize() - normal).norm() < 1e-12);
            assert!((a - Vector3::x()).dot(&normal).abs() < 1e-12);
        }
    }
}
