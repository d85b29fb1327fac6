//! Signed distance of one body in its own frame: exact closest point, outward normal.

use super::convex::Convex;
use super::deformation::Deformation;
use super::mesh::{DeformingMesh, DistanceField, SolidMesh};
use super::shape::Shape;
use super::surface_point::{Feature, SurfacePoint};
use crate::math::polyline::closest_on_segment;
use nalgebra::Vector3;
use std::sync::Arc;

/// A body's surface.
#[derive(Debug)]
pub enum Solid {
    /// A convex formula.
    Convex(Convex),
    /// Triangles, and what is remembered of the distance to them.
    Mesh(Box<SolidMesh>, Box<DistanceField>),
    /// Triangles that move in the body's frame.
    Deforming(Box<DeformingMesh>),
}

/// A body's surface surface_over some time.
#[derive(Debug, Clone, Copy)]
pub enum MovingSurface<'a> {
    /// A convex formula.
    Convex(&'a Convex),
    /// Triangles at the start and at the end; one mesh where they do not move.
    Mesh([&'a SolidMesh; 2]),
}

impl Solid {
    /// The surface of `shape`, whose vertices `deformation` moves.
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
                    Solid::Deforming(Box::new(DeformingMesh::new(&mesh.vertices, &mesh.triangles, d.clone())))
                }
                None => {
                    let mesh = Box::new(SolidMesh::new(&mesh.vertices, &mesh.triangles));
                    let field = Box::new(DistanceField::new(&mesh));
                    Solid::Mesh(mesh, field)
                }
            },
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

    /// Way in the body's frame that no point of the surface has exceeded up to time `t`, s; m.
    pub fn max_travel(&self, t: f64) -> f64 {
        match self {
            Solid::Convex(_) | Solid::Mesh(..) => 0.0,
            Solid::Deforming(deforming) => deforming.travel(t),
        }
    }

    /// Closest surface point to `p`, body frame, at time `t`, s, or `None` where it is `max_distance` away or more.
    pub fn closest(&self, t: f64, p: &Vector3<f64>, max_distance: f64) -> Option<SurfacePoint> {
        match self.surface_over([t, t]) {
            MovingSurface::Convex(convex) => {
                Some(convex.closest(p)).filter(|s| s.distance.abs() < max_distance)
            }
            MovingSurface::Mesh([mesh, _]) => mesh.closest(p, max_distance),
        }
    }

    /// What the signed distance of `p`, body frame, is not below, and its magnitude not above, m, as far as it is known without a search.
    pub fn distance_bounds(&self, p: &Vector3<f64>) -> [f64; 2] {
        match self {
            Solid::Convex(convex) => [convex.closest(p).distance, f64::INFINITY],
            Solid::Mesh(mesh, field) => field.bounds(mesh, p),
            Solid::Deforming(_) => [f64::NEG_INFINITY, f64::INFINITY],
        }
    }

    /// What the signed distance of `p`, body frame, is not below, m; far from a mesh less exactly than [`Solid::distance_bounds`] says, and sooner.
    pub fn distance_lower_bound(&self, p: &Vector3<f64>) -> f64 {
        match self {
            Solid::Mesh(mesh, field) => field.least(mesh, p),
            Solid::Convex(Convex::Capsule { ends: [a, b], radius }) => {
                (p - a.lerp(b, closest_on_segment(p, a, b))).norm() * (1.0 - 1e-9) - radius
            }
            Solid::Convex(_) | Solid::Deforming(_) => self.distance_bounds(p)[0],
        }
    }

    /// Where the way from `a` to `b`, body frame, first goes through the surface at time `t`, s: share of the way, and the outward normal.
    pub fn first_intersection(
        &self,
        t: f64,
        a: &Vector3<f64>,
        b: &Vector3<f64>,
    ) -> Option<(f64, Vector3<f64>)> {
        match self.surface_over([t, t]) {
            MovingSurface::Convex(convex) => convex.first_intersection(a, b),
            MovingSurface::Mesh([mesh, _]) => {
                let (share, triangle) = mesh.first_intersection(a, b)?;
                Some((share, mesh.pseudonormal(Feature::Face(triangle))))
            }
        }
    }

    /// Whether `p`, body frame, is inside the solid at time `t`, s. For a mesh by its winding number: dear, for set-up only.
    pub fn contains(&self, t: f64, p: &Vector3<f64>) -> bool {
        match self.surface_over([t, t]) {
            MovingSurface::Convex(convex) => convex.closest(p).distance < 0.0,
            MovingSurface::Mesh([mesh, _]) => mesh.winding_number(p) > 0.5,
        }
    }
}
