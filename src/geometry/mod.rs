//! Geometry: shapes, meshes, their motion, and distances to them. Knows no file formats.

mod bounds;
mod convex;
mod deformation;
mod distance;
mod friction;
mod mesh;
mod shape;
mod solid;
mod surface_point;
mod tessellation;
mod tri_mesh;

pub use bounds::Bounds;
pub use convex::Convex;
pub use deformation::Deformation;
pub use distance::{
    ClosestPoints, TriangleFeature, barycentric, closest_on_ellipsoid, closest_on_triangle, segment_segment,
    segment_triangle,
};
pub use friction::Friction;
pub use mesh::{DeformingMesh, DistanceField, SolidMesh, barycentric_point};
pub use shape::Shape;
pub use solid::{MovingSurface, Solid};
pub use surface_point::{Feature, SurfacePoint};
pub use tri_mesh::TriMesh;

#[cfg(test)]
pub(crate) mod tests;
