//! Signed distance of one body in its own frame: exact closest point, outward normal.

use super::distance::closest_on_ellipsoid;
use super::mesh::{Deforming, DistanceField, Mesh};
use crate::math::frame::any_frame;
use crate::math::polyline::closest_on_segment;
use crate::scene::{Deformation, Shape as SceneShape};
use nalgebra::{UnitQuaternion, Vector3};
use std::sync::Arc;

/// Which part of a body's surface a point lies on.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Feature {
    /// The smooth surface of a convex shape.
    Smooth,
    /// A triangle of a mesh.
    Face(u32),
    /// An edge of a mesh.
    Edge(u32),
    /// A vertex of a mesh.
    Vertex(u32),
}

/// The point of a surface closest to a query point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SurfacePoint {
    /// Signed distance, m; negative inside.
    pub distance: f64,
    /// Unit outward direction of increasing distance at the query point.
    pub normal: Vector3<f64>,
    /// The closest point, body frame.
    pub point: Vector3<f64>,
    /// Where on the surface it lies.
    pub feature: Feature,
}

/// A convex shape given by a formula; its signed distance is a convex function.
#[derive(Debug, Clone)]
pub enum Convex {
    /// All points within `radius` of a segment; a sphere where the ends coincide.
    Capsule {
        /// Ends of the axis.
        ends: [Vector3<f64>; 2],
        /// Radius, m.
        radius: f64,
    },
    /// Ellipsoid.
    Ellipsoid {
        /// Centre.
        centre: Vector3<f64>,
        /// Semi-axes, m.
        radii: Vector3<f64>,
        /// Orientation of the axes.
        rotation: UnitQuaternion<f64>,
    },
    /// Half-space below a plane.
    Plane {
        /// A point of the plane.
        point: Vector3<f64>,
        /// Unit normal, out of the solid.
        normal: Vector3<f64>,
    },
}

/// A body's surface.
#[derive(Debug)]
pub enum Shape {
    /// A convex formula.
    Convex(Convex),
    /// Triangles, and what is remembered of the distance to them.
    Mesh(Box<Mesh>, Box<DistanceField>),
    /// Triangles that move in the body's frame.
    Deforming(Box<Deforming>),
}

/// A body's surface over some time.
#[derive(Debug, Clone, Copy)]
pub(super) enum Surface<'a> {
    /// A convex formula.
    Convex(&'a Convex),
    /// Triangles at the start and at the end; one mesh where they do not move.
    Mesh([&'a Mesh; 2]),
}

impl Shape {
    /// The surface of `shape`, whose vertices `deformation` moves.
    pub fn new(shape: &SceneShape, deformation: Option<&Arc<Deformation>>) -> Self {
        match *shape {
            SceneShape::Sphere { centre, radius } => {
                Shape::Convex(Convex::Capsule { ends: [centre, centre], radius })
            }
            SceneShape::Capsule { ends, radius } => Shape::Convex(Convex::Capsule { ends, radius }),
            SceneShape::Ellipsoid { centre, radii, rotation } => {
                Shape::Convex(Convex::Ellipsoid { centre, radii, rotation })
            }
            SceneShape::Plane { point, normal } => Shape::Convex(Convex::Plane { point, normal }),
            SceneShape::Mesh(ref mesh) => match deformation {
                Some(d) => {
                    Shape::Deforming(Box::new(Deforming::new(&mesh.vertices, &mesh.triangles, d.clone())))
                }
                None => {
                    let mesh = Box::new(Mesh::new(&mesh.vertices, &mesh.triangles));
                    let field = Box::new(DistanceField::new(&mesh));
                    Shape::Mesh(mesh, field)
                }
            },
        }
    }

    /// The surface between two times, s.
    pub(super) fn over(&self, times: [f64; 2]) -> Surface<'_> {
        match self {
            Shape::Convex(convex) => Surface::Convex(convex),
            Shape::Mesh(mesh, _) => Surface::Mesh([mesh, mesh]),
            Shape::Deforming(deforming) => Surface::Mesh(times.map(|t| deforming.at(t))),
        }
    }

    /// Way in the body's frame that no point of the surface has exceeded up to time `t`, s; m.
    pub(super) fn travel(&self, t: f64) -> f64 {
        match self {
            Shape::Convex(_) | Shape::Mesh(..) => 0.0,
            Shape::Deforming(deforming) => deforming.travel(t),
        }
    }

    /// Closest surface point to `p`, body frame, at time `t`, s, or `None` where it is `max_distance` away or more.
    pub fn closest(&self, t: f64, p: &Vector3<f64>, max_distance: f64) -> Option<SurfacePoint> {
        match self.over([t, t]) {
            Surface::Convex(convex) => Some(convex.closest(p)).filter(|s| s.distance.abs() < max_distance),
            Surface::Mesh([mesh, _]) => mesh.closest(p, max_distance),
        }
    }

    /// What the signed distance of `p`, body frame, is not below, and its magnitude not above, m, as far as it is known without a search.
    pub fn distance_bounds(&self, p: &Vector3<f64>) -> [f64; 2] {
        match self {
            Shape::Convex(convex) => [convex.closest(p).distance, f64::INFINITY],
            Shape::Mesh(mesh, field) => field.bounds(mesh, p),
            Shape::Deforming(_) => [f64::NEG_INFINITY, f64::INFINITY],
        }
    }

    /// What the signed distance of `p`, body frame, is not below, m; far from a mesh less exactly than [`Shape::distance_bounds`] says, and sooner.
    pub(super) fn least_distance(&self, p: &Vector3<f64>) -> f64 {
        match self {
            Shape::Mesh(mesh, field) => field.least(mesh, p),
            Shape::Convex(Convex::Capsule { ends: [a, b], radius }) => {
                (p - a.lerp(b, closest_on_segment(p, a, b))).norm() * (1.0 - 1e-9) - radius
            }
            Shape::Convex(_) | Shape::Deforming(_) => self.distance_bounds(p)[0],
        }
    }

    /// Where the way from `a` to `b`, body frame, first goes through the surface at time `t`, s: share of the way, and the outward normal.
    pub fn first_hit(&self, t: f64, a: &Vector3<f64>, b: &Vector3<f64>) -> Option<(f64, Vector3<f64>)> {
        match self.over([t, t]) {
            Surface::Convex(convex) => convex.first_hit(a, b),
            Surface::Mesh([mesh, _]) => {
                let (share, triangle) = mesh.first_hit(a, b)?;
                Some((share, mesh.pseudonormal(Feature::Face(triangle))))
            }
        }
    }

    /// Whether `p`, body frame, is inside the solid at time `t`, s. For a mesh by its winding number: dear, for set-up only.
    pub fn inside(&self, t: f64, p: &Vector3<f64>) -> bool {
        match self.over([t, t]) {
            Surface::Convex(convex) => convex.closest(p).distance < 0.0,
            Surface::Mesh([mesh, _]) => mesh.winding_number(p) > 0.5,
        }
    }
}

impl Convex {
    /// Closest surface point to `p`, body frame. The solid lies in the half-space below the plane through it.
    pub fn closest(&self, p: &Vector3<f64>) -> SurfacePoint {
        let (distance, normal, point) = match self {
            Convex::Capsule { ends: [a, b], radius } => {
                let axis_point = a + (b - a) * closest_on_segment(p, a, b);
                let normal = (p - axis_point).try_normalize(0.0).unwrap_or_else(|| across(&(b - a)));
                ((p - axis_point).norm() - radius, normal, axis_point + normal * *radius)
            }
            Convex::Ellipsoid { centre, radii, rotation } => {
                let local = rotation.inverse() * (p - centre);
                let x = closest_on_ellipsoid(&local, radii);
                // The gradient of the quadric, not p − x, which loses its digits near the surface.
                let gradient = x.component_div(radii).component_div(radii);
                let normal = gradient.normalize();
                ((local - x).dot(&normal), rotation * normal, centre + rotation * x)
            }
            Convex::Plane { point, normal } => {
                let distance = normal.dot(&(p - point));
                (distance, *normal, p - normal * distance)
            }
        };
        SurfacePoint { distance, normal, point, feature: Feature::Smooth }
    }

    /// Where the way from `a` to `b` first goes through the surface: share of the way, and the outward normal.
    fn first_hit(&self, a: &Vector3<f64>, b: &Vector3<f64>) -> Option<(f64, Vector3<f64>)> {
        let outside = |u: f64| self.closest(&a.lerp(b, u)).distance > 0.0;
        let (u, _) = self.closest_to_segment(a, b);
        let (mut from, mut to) = (0.0, if outside(0.0) { u } else { 1.0 });
        if outside(to) == outside(from) {
            return None;
        }
        // The distance is convex along the way: from outside to its least point, or from inside to a far end, it changes sign once.
        for _ in 0..50 {
            let middle = 0.5 * (from + to);
            if outside(middle) == outside(0.0) { from = middle } else { to = middle }
        }
        Some((to, self.closest(&a.lerp(b, to)).normal))
    }

    /// Parameter of the point of segment `ab` of least signed distance, and the surface point closest to it.
    ///
    /// The distance is convex along the segment, so the zero of its slope is bracketed and found by regula falsi with
    /// the Illinois modification (Dowell & Jarratt 1971), bisecting where the slope jumps.
    pub fn closest_to_segment(&self, a: &Vector3<f64>, b: &Vector3<f64>) -> (f64, SurfacePoint) {
        let d = b - a;
        let tolerance = 1e-12 * d.norm();
        let (mut lo, mut hi) = (0.0, 1.0);
        let start = self.closest(a);
        let mut slope_lo = start.normal.dot(&d);
        if slope_lo >= -tolerance {
            return (0.0, start);
        }
        let end = self.closest(b);
        let mut slope_hi = end.normal.dot(&d);
        if slope_hi <= tolerance {
            return (1.0, end);
        }
        let mut best = (0.0, start);
        for k in 0..60 {
            let u = if k % 3 == 2 {
                0.5 * (lo + hi)
            } else {
                (lo * slope_hi - hi * slope_lo) / (slope_hi - slope_lo)
            };
            let at = self.closest(&(a + d * u));
            best = (u, at);
            let slope = at.normal.dot(&d);
            if slope.abs() <= tolerance || hi - lo < 1e-15 {
                break;
            }
            if slope < 0.0 {
                (lo, slope_lo) = (u, slope);
                slope_hi *= 0.5;
            } else {
                (hi, slope_hi) = (u, slope);
                slope_lo *= 0.5;
            }
        }
        best
    }
}

/// Some unit vector across `axis`; for an axis of no length, any.
fn across(axis: &Vector3<f64>) -> Vector3<f64> {
    axis.try_normalize(0.0).map_or_else(Vector3::y, |tangent| any_frame(&tangent).column(1).into())
}
