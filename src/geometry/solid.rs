//! Solids: shapes prepared for distance queries.

use super::convex::Convex;
use super::deformation::Deformation;
use super::mesh::deforming::DeformingMesh;
use super::mesh::distance_field::DistanceField;
use super::mesh::solid_mesh::SolidMesh;
use super::shape::Shape;
use super::surface_point::{Feature, SurfacePoint};
use crate::math::polyline::closest_on_segment;
use nalgebra::Vector3;
use std::sync::Arc;

/// A solid in the frame of its body, rigid or deforming.
#[derive(Debug)]
pub enum Solid {
    /// A convex shape.
    Convex(Convex),
    /// A rigid triangle mesh, and cached bounds of the distance to it.
    Mesh(Box<SolidMesh>, Box<DistanceField>),
    /// A mesh whose vertices move in the body's frame.
    Deforming(Box<DeformingMesh>),
}

/// The surface of a solid over an interval of time.
#[derive(Debug, Clone, Copy)]
pub enum MovingSurface<'a> {
    /// A convex shape, which does not move.
    Convex(&'a Convex),
    /// The mesh at the start and at the end of the interval; the same mesh twice if it is rigid.
    Mesh([&'a SolidMesh; 2]),
}

impl Solid {
    /// The solid of `shape`. `deformation` moves the vertices of a mesh; other shapes are rigid.
    pub fn new(shape: &Shape, deformation: Option<&Arc<Deformation>>) -> Self {
        match *shape {
            Shape::Sphere { centre, radius } => {
                Solid::Convex(Convex::Capsule { ends: [centre, centre], radius })
            }
            Shape::Capsule { ends, radius } => Solid::Convex(Convex::Capsule { ends, radius }),
            Shape::Ellipsoid { centre, radii, rotation } => {
                Solid::Convex(Convex::Ellipsoid { centre, radii, rotation })
            }
            Shape::Plane { point, normal } => Solid::Convex(Convex::Plane { point, normal }),
            Shape::Mesh(ref mesh) => match deformation {
                Some(d) => {
                    let deforming = DeformingMesh::new(&mesh.vertices, &mesh.triangles, d.clone());
                    Solid::Deforming(Box::new(deforming))
                }
                None => {
                    let mesh = Box::new(SolidMesh::new(&mesh.vertices, &mesh.triangles));
                    let field = Box::new(DistanceField::new(&mesh));
                    Solid::Mesh(mesh, field)
                }
            },
        }
    }

    /// Triangles that close the holes of a mesh, as indices of its vertices.
    pub fn caps(&self) -> &[[u32; 3]] {
        match self.surface_over([0.0, 0.0]) {
            MovingSurface::Convex(_) => &[],
            MovingSurface::Mesh([mesh, _]) => mesh.caps(),
        }
    }

    /// The surface between two times, s.
    pub fn surface_over(&self, times: [f64; 2]) -> MovingSurface<'_> {
        match self {
            Solid::Convex(convex) => MovingSurface::Convex(convex),
            Solid::Mesh(mesh, _) => MovingSurface::Mesh([mesh, mesh]),
            Solid::Deforming(deforming) => MovingSurface::Mesh(times.map(|t| deforming.at(t))),
        }
    }

    /// Upper bound, m, on the path length of any surface point in the body's frame up to time `t`, s.
    pub fn max_travel(&self, t: f64) -> f64 {
        match self {
            Solid::Convex(_) | Solid::Mesh(..) => 0.0,
            Solid::Deforming(deforming) => deforming.max_travel(t),
        }
    }

    /// Surface point closest to `p`, body frame, at time `t`, s; `None` if it is `max_distance`, m, away or
    /// more.
    pub fn closest(&self, t: f64, p: &Vector3<f64>, max_distance: f64) -> Option<SurfacePoint> {
        match self.surface_over([t, t]) {
            MovingSurface::Convex(convex) => {
                Some(convex.closest(p)).filter(|s| s.distance.abs() < max_distance)
            }
            MovingSurface::Mesh([mesh, _]) => mesh.closest(p, max_distance),
        }
    }

    /// Whether its surface moves in its frame.
    pub fn deforms(&self) -> bool {
        matches!(self, Solid::Deforming(_))
    }

    /// The mesh at time `t`, s; `None` of a convex shape.
    pub fn mesh(&self, t: f64) -> Option<&SolidMesh> {
        match self.surface_over([t, t]) {
            MovingSurface::Convex(_) => None,
            MovingSurface::Mesh([mesh, _]) => Some(mesh),
        }
    }

    /// Lower bound on the signed distance of `p`, body frame, and upper bound on its magnitude, m, without a
    /// search.
    pub fn distance_bounds(&self, p: &Vector3<f64>) -> [f64; 2] {
        match self {
            Solid::Convex(convex) => [convex.closest(p).distance, f64::INFINITY],
            Solid::Mesh(mesh, field) => field.bounds(mesh, p),
            Solid::Deforming(_) => [f64::NEG_INFINITY, f64::INFINITY],
        }
    }

    /// Lower bound, m, on the signed distance of `p`, body frame. Far from a mesh it is looser than
    /// [`Solid::distance_bounds`], and cheaper.
    pub fn distance_lower_bound(&self, p: &Vector3<f64>) -> f64 {
        match self {
            Solid::Mesh(mesh, field) => field.lower_bound(mesh, p),
            Solid::Convex(Convex::Capsule { ends: [a, b], radius }) => {
                (p - a.lerp(b, closest_on_segment(p, a, b))).norm() * (1.0 - 1e-9) - radius
            }
            Solid::Convex(_) | Solid::Deforming(_) => self.distance_bounds(p)[0],
        }
    }

    /// First intersection of the segment from `a` to `b`, body frame, with the surface at time `t`, s: the
    /// fraction of the segment, and the outward normal there.
    pub fn first_intersection(
        &self,
        t: f64,
        a: &Vector3<f64>,
        b: &Vector3<f64>,
    ) -> Option<(f64, Vector3<f64>)> {
        match self.surface_over([t, t]) {
            MovingSurface::Convex(convex) => convex.first_intersection(a, b),
            MovingSurface::Mesh([mesh, _]) => {
                let (fraction, triangle) = mesh.first_intersection(a, b)?;
                Some((fraction, mesh.pseudonormal(Feature::Face(triangle))))
            }
        }
    }

    /// Whether `p`, body frame, is inside the solid at time `t`, s. Uses the winding number of a mesh.
    pub fn contains(&self, t: f64, p: &Vector3<f64>) -> bool {
        match self.surface_over([t, t]) {
            MovingSurface::Convex(convex) => convex.closest(p).distance < 0.0,
            MovingSurface::Mesh([mesh, _]) => mesh.winding_number(p) > 0.5,
        }
    }
}
