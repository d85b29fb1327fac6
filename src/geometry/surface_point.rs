//! Points of surfaces, and the features that they lie on.

use nalgebra::Vector3;

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
