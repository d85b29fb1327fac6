//! A mesh that fur grows on.

use crate::geometry::{SolidMesh, TriMesh, barycentric};
use crate::import::plain::Field;
use nalgebra::Vector3;
use std::collections::BTreeMap;

/// The mesh, welded and oriented outwards.
pub(super) struct Surface {
    solid: SolidMesh,
    /// Number of triangles that bear fur: those that close holes come after them.
    pub(super) triangles: usize,
    /// For each triangle its index in the mesh as it was given, and the corners there.
    origin: Vec<(u32, [usize; 3])>,
    /// Unit normals of the vertices.
    pub(super) normals: Vec<Vector3<f64>>,
    /// Neighbours of each vertex along edges.
    pub(super) ring: Vec<Vec<u32>>,
}

/// A place on the surface.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Place {
    pub(super) triangle: u32,
    /// Barycentric coordinates.
    pub(super) shares: [f64; 3],
}

/// The place nearest to a point.
pub(super) struct Foot {
    pub(super) place: Place,
    /// Signed distance of the point from it, m; negative inside.
    pub(super) height: f64,
    /// Unit vector outwards along which the point lies.
    pub(super) out: Vector3<f64>,
}

impl Surface {
    /// The surface of a mesh, m, that has triangles.
    pub(super) fn new(mesh: &TriMesh) -> Self {
        let solid = SolidMesh::new(&mesh.vertices, &mesh.triangles);
        let triangles = solid.drawn_triangles() as usize;
        let bits = |x: &Vector3<f64>| <[f64; 3]>::from(*x).map(|x| (x + 0.0).to_bits());
        let key = |corners: [&Vector3<f64>; 3]| {
            let mut key = corners.map(bits);
            key.sort_unstable();
            key
        };
        let given = |t: &[u32; 3]| t.map(|v| &mesh.vertices[v as usize]);
        let mut index = BTreeMap::new();
        for (t, k) in mesh.triangles.iter().zip(0u32..) {
            index.entry(key(given(t))).or_insert(k);
        }
        let origin = (0..triangles as u32).map(|t| {
            let own = solid.triangle(t);
            // Always found: the vertices of the solid are some of the mesh.
            let k = index.get(&key(own)).copied().unwrap_or(0);
            let corners = given(&mesh.triangles[k as usize]);
            (k, own.map(|x| corners.iter().position(|corner| bits(corner) == bits(x)).unwrap_or(0)))
        });
        let origin = origin.collect();
        let count = solid.vertices().len();
        let (mut normals, mut ring) = (vec![Vector3::zeros(); count], vec![Vec::new(); count]);
        for t in 0..triangles as u32 {
            let [a, b, c] = solid.triangle(t);
            let normal = (b - a).cross(&(c - a));
            let corners = solid.corners(t);
            for k in 0..3 {
                let [v, next, last] = [0, 1, 2].map(|i| corners[(k + i) % 3]);
                normals[v as usize] += normal;
                ring[v as usize].extend([next, last]);
            }
        }
        for around in &mut ring {
            around.sort_unstable();
            around.dedup();
        }
        normals.iter_mut().for_each(|n| *n = n.try_normalize(0.0).unwrap_or_else(Vector3::y));
        Surface { solid, triangles, origin, normals, ring }
    }

    /// Vertices of a triangle.
    pub(super) fn corners(&self, triangle: u32) -> [u32; 3] {
        self.solid.corners(triangle)
    }

    /// Position of a vertex, m.
    pub(super) fn vertex(&self, v: u32) -> &Vector3<f64> {
        self.solid.vertex(v)
    }

    /// Positions of all vertices, m.
    pub(super) fn vertices(&self) -> &[Vector3<f64>] {
        self.solid.vertices()
    }

    /// Normal of a triangle, of twice its area, m².
    pub(super) fn doubled_area(&self, triangle: u32) -> Vector3<f64> {
        let [a, b, c] = self.solid.triangle(triangle);
        (b - a).cross(&(c - a))
    }

    /// Index of a triangle in the mesh as it was given.
    pub(super) fn given(&self, triangle: u32) -> u32 {
        self.origin[triangle as usize].0
    }

    /// Values of a field of the given mesh at the corners of a triangle.
    pub(super) fn values(&self, field: &Field, triangle: u32) -> [Vector3<f64>; 3] {
        let (given, corners) = self.origin[triangle as usize];
        corners.map(|corner| field.corners[given as usize][corner])
    }

    /// Value of a field at a place.
    pub(super) fn value(&self, field: &Field, place: &Place) -> Vector3<f64> {
        let values = self.values(field, place.triangle);
        values.iter().zip(place.shares).map(|(value, share)| value * share).sum()
    }

    /// Position of a place, m.
    pub(super) fn point(&self, place: &Place) -> Vector3<f64> {
        let corners = self.solid.triangle(place.triangle);
        corners.into_iter().zip(place.shares).map(|(x, share)| x * share).sum()
    }

    /// Sum of the values of the vertices at a place.
    pub(super) fn mean(&self, values: &[Vector3<f64>], place: &Place) -> Vector3<f64> {
        let corners = self.corners(place.triangle);
        corners.iter().zip(place.shares).map(|(v, share)| values[*v as usize] * share).sum()
    }

    /// Smooth unit normal at a place.
    pub(super) fn normal(&self, place: &Place) -> Vector3<f64> {
        let face = || self.doubled_area(place.triangle).normalize();
        self.mean(&self.normals, place).try_normalize(1e-6).unwrap_or_else(face)
    }

    /// The place nearest to `x`, m, of the triangles that bear fur.
    pub(super) fn foot(&self, x: &Vector3<f64>) -> Option<Foot> {
        let wanted = self.triangles as u32;
        let (triangle, point, local) = self.solid.nearest(x, f64::INFINITY, |t| t < wanted)?;
        let shares = barycentric(local, &point, self.solid.triangle(triangle));
        let found = self.solid.surface_point(x, &point, self.solid.feature(triangle, local));
        Some(Foot { place: Place { triangle, shares }, height: found.distance, out: found.normal })
    }

    /// Signed distance of `x` from the solid, m, holes closed; negative inside.
    pub(super) fn height(&self, x: &Vector3<f64>) -> f64 {
        self.solid.closest(x, f64::INFINITY).map_or(f64::INFINITY, |found| found.distance)
    }
}
