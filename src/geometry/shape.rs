//! Shapes of colliders, as plain data.

use super::tri_mesh::TriMesh;
use nalgebra::{UnitQuaternion, Vector3};

/// Shape of a collider, in the rest space of its body; lengths in metres.
#[derive(Debug, Clone)]
pub enum Shape {
    /// Triangle mesh, open or closed.
    Mesh(TriMesh),
    /// Ball.
    Sphere {
        /// Centre.
        centre: Vector3<f64>,
        /// Radius.
        radius: f64,
    },
    /// Cylinder with hemispherical ends.
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
    /// Half-space bounded by a plane.
    Plane {
        /// A point of the plane.
        point: Vector3<f64>,
        /// Unit normal, pointing out of the solid.
        normal: Vector3<f64>,
    },
}
