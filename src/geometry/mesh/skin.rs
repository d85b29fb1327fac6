//! Places on a deforming mesh, and the rigid motion that carries what grows there (`docs/theory.md` eqs. 2.1
//! to 2.3).

use super::solid_mesh::SolidMesh;
use crate::geometry::deformation::Deformation;
use crate::geometry::distance::triangle::barycentric;
use crate::geometry::tri_mesh::TriMesh;
use nalgebra::{Isometry3, Matrix3, Rotation3, Translation3, UnitQuaternion, Vector3};
use std::collections::BTreeMap;

/// A mesh at rest, ready to find places on it.
#[derive(Debug)]
pub struct Skin {
    mesh: SolidMesh,
    /// Normal of each vertex times the area around it, m².
    normals: Vec<Vector3<f64>>,
    /// Area of the triangles of each vertex, m².
    areas: Vec<f64>,
}

/// A place bound to a skin. Its position and its tangents are sums over vertices with fixed weights.
#[derive(Debug, Clone, PartialEq)]
pub struct SkinPoint {
    support: Vec<Support>,
    /// The place at rest, m.
    rest: Vector3<f64>,
    /// What is bound, relative to the point of the surface at rest, m.
    offset: Vector3<f64>,
    /// The frame at rest.
    frame: Matrix3<f64>,
    /// Area spanned by the tangents at rest.
    area: f64,
}

/// What a vertex contributes to a place.
#[derive(Debug, Clone, PartialEq)]
struct Support {
    /// Index of the vertex in the mesh that the skin was made from.
    vertex: u32,
    /// Barycentric coordinate.
    weight: f64,
    /// Weights in the two tangents, 1/m.
    slope: [f64; 2],
}

/// A surface at a place: its point, m, and the images of two orthonormal tangents at rest.
#[derive(Clone, Copy)]
struct Tangents {
    point: Vector3<f64>,
    along: [Vector3<f64>; 2],
}

impl Skin {
    /// The skin of a mesh at rest, m. Its vertices that coincide there and in all samples of `deformation` are
    /// one, so that seams are smooth.
    pub fn new(mesh: &TriMesh, deformation: Option<&Deformation>) -> Self {
        let mut positions = vec![&mesh.vertices[..]];
        positions.extend(deformation.iter().flat_map(|d| &d.samples).map(Vec::as_slice));
        let mesh = SolidMesh::from_positions(&positions, &mesh.triangles);
        let mut skin = Skin {
            normals: vec![Vector3::zeros(); mesh.vertices.len()],
            areas: vec![0.0; mesh.vertices.len()],
            mesh,
        };
        for t in 0..skin.drawn() {
            let normal = skin.doubled_area(t) * 0.5;
            for v in skin.mesh.topology.triangles[t as usize] {
                skin.normals[v as usize] += normal;
                skin.areas[v as usize] += normal.norm();
            }
        }
        skin
    }

    /// Number of its triangles without those that close holes, which come last.
    fn drawn(&self) -> u32 {
        (self.mesh.topology.triangles.len() - self.mesh.topology.caps.len()) as u32
    }

    /// Normal of triangle `t`, of twice its area, m².
    fn doubled_area(&self, t: u32) -> Vector3<f64> {
        let [a, b, c] = self.mesh.triangle(t);
        (b - a).cross(&(c - a))
    }

    /// Binds `x`, m, rest space, to the nearest place; also its distance, m. `None` if it is `max_distance`, m,
    /// away or more.
    pub fn bind(&self, x: &Vector3<f64>, max_distance: f64) -> Option<(SkinPoint, f64)> {
        let drawn = self.drawn();
        let (triangle, point, local) = self.mesh.nearest(x, max_distance, |t| t < drawn)?;
        let corners = self.mesh.topology.triangles[triangle as usize];
        let shares = barycentric(local, &point, self.mesh.triangle(triangle));
        let of_corners = || corners.iter().zip(shares).filter(|(_, share)| *share > 0.0);
        let mean = of_corners().map(|(v, share)| {
            self.normals[*v as usize] * (share / self.areas[*v as usize])
        });
        // At an edge where two sheets meet, normals may cancel: that of the triangle is one.
        let face = self.doubled_area(triangle).normalize();
        let normal = mean.sum::<Vector3<f64>>().try_normalize(1e-6).unwrap_or(face);
        let across = Vector3::ith(normal.iamin(), 1.0);
        let first = normal.cross(&across).normalize();
        let tangents = [first, normal.cross(&first)];

        let mut weights: BTreeMap<u32, (f64, Vector3<f64>)> = BTreeMap::new();
        for (v, share) in of_corners() {
            weights.entry(*v).or_default().0 += share;
            for &t in self.mesh.topology.vertex_triangles.get(*v).iter().filter(|t| **t < drawn) {
                let normal = self.doubled_area(t).normalize();
                let triangle = self.mesh.topology.triangles[t as usize];
                for (k, vertex) in triangle.iter().enumerate() {
                    // The gradient of the vertex's hat function times the area of the triangle.
                    let [from, to] = [1, 2].map(|next| self.mesh.vertex(triangle[(k + next) % 3]));
                    let gradient = normal.cross(&(to - from)) * 0.5;
                    weights.entry(*vertex).or_default().1 += gradient * (share / self.areas[*v as usize]);
                }
            }
        }
        let support = |(vertex, (weight, gradient)): (u32, (f64, Vector3<f64>))| Support {
            vertex: self.mesh.topology.source[vertex as usize],
            weight,
            slope: tangents.map(|tangent| gradient.dot(&tangent)),
        };
        let mut bound = SkinPoint {
            support: weights.into_iter().map(support).collect(),
            rest: *x,
            offset: Vector3::zeros(),
            frame: Matrix3::identity(),
            area: 0.0,
        };
        let source = &self.mesh.topology.source;
        let rest: BTreeMap<u32, &Vector3<f64>> =
            source.iter().copied().zip(&self.mesh.vertices).collect();
        let surface = bound.surface(|v| *rest[&v]);
        bound.offset = x - surface.point;
        bound.area = surface.area();
        bound.frame = surface.frame();
        Some((bound, (x - point).norm()))
    }
}

impl SkinPoint {
    /// The surface there, with its vertices at `vertex`, m.
    fn surface(&self, vertex: impl Fn(u32) -> Vector3<f64>) -> Tangents {
        let mut surface = Tangents { point: Vector3::zeros(), along: [Vector3::zeros(); 2] };
        for Support { vertex: v, weight, slope } in &self.support {
            let x = vertex(*v);
            surface.point += x * *weight;
            surface.along.iter_mut().zip(slope).for_each(|(sum, slope)| *sum += x * *slope);
        }
        surface
    }

    /// The rigid motion from rest that carries what is bound there, with the vertices of the mesh at `vertex`,
    /// m.
    pub fn carry(&self, vertex: impl Fn(u32) -> Vector3<f64>) -> Isometry3<f64> {
        let surface = self.surface(vertex);
        let turn = surface.frame() * self.frame.transpose();
        let place = surface.point + turn * self.offset;
        let rotation = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(turn));
        Isometry3::from_parts(Translation3::from(place - turn * self.rest), rotation)
    }

    /// Area of the surface there with the vertices of the mesh at `vertex`, m, over that at rest: 0 where it
    /// has collapsed and has no frame.
    pub fn stretch(&self, vertex: impl Fn(u32) -> Vector3<f64>) -> f64 {
        self.surface(vertex).area() / self.area
    }

    /// The place at rest, m.
    pub fn rest(&self) -> &Vector3<f64> {
        &self.rest
    }
}

impl Tangents {
    fn area(&self) -> f64 {
        let [first, second] = self.along;
        first.cross(&second).norm()
    }

    /// The frame whose third axis is the normal, and whose first two are the nearest to the tangents.
    fn frame(&self) -> Matrix3<f64> {
        let [first, second] = self.along;
        let normal = first.cross(&second).normalize();
        let first = (first + second.cross(&normal)).normalize();
        Matrix3::from_columns(&[first, normal.cross(&first), normal])
    }
}
