//! Shapes of colliders.

use super::tri_mesh::TriMesh;
use nalgebra::{UnitQuaternion, Vector3};

/// Shape of a collider, metres, rest space of its body.
#[derive(Debug, Clone)]
pub enum Shape {
    /// Triangles, open or closed.
    Mesh(TriMesh),
    /// Ball.
    Sphere {
        /// Centre.
        centre: Vector3<f64>,
        /// Radius.
        radius: f64,
    },
    /// Cylinder with round ends.
    Capsule {
        /// Ends of the axis.
        ends: [Vector3<f64>; 2],
        /// Radius.
        radius: f64,
    },
    /// Ellipsoid.
    Ellipsoid {
        /// Centre.
        centre: Vector3<f64>,
        /// Semi-axes.
        radii: Vector3<f64>,
        /// Orientation of the axes.
        rotation: UnitQuaternion<f64>,
    },
    /// Half-space below a plane.
    Plane {
        /// A point of the plane.
        point: Vector3<f64>,
        /// Unit normal, away from the solid side.
        normal: Vector3<f64>,
    },
}
