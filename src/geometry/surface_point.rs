//! Points of a surface and the features they lie on.

use nalgebra::Vector3;

/// The part of a surface that a point lies on.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Feature {
    /// The smooth surface of a convex shape.
    Smooth,
    /// A triangle of a mesh, by index.
    Face(u32),
    /// An edge of a mesh, by index.
    Edge(u32),
    /// A vertex of a mesh, by index.
    Vertex(u32),
}

/// The point of a surface closest to a query point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SurfacePoint {
    /// Signed distance of the query point, m; negative inside.
    pub distance: f64,
    /// Unit outward normal: the gradient of the signed distance at the query point.
    pub normal: Vector3<f64>,
    /// The closest point, m, body frame.
    pub point: Vector3<f64>,
    /// The feature that the closest point lies on.
    pub feature: Feature,
}
