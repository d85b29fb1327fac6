//! Geometry: shapes, triangle meshes, their deformation, and distances to them. Lengths in metres.
//!
//! - [`Shape`], [`TriMesh`], [`Deformation`], [`Friction`]: plain data of a collider.
//! - [`Solid`]: a shape prepared for queries (closest point, signed distance, intersection, containment), as
//!   a [`Convex`], a [`SolidMesh`] or a [`DeformingMesh`].
//! - [`Skin`], [`SkinPoint`]: places on a deforming mesh, and what they carry.
//! - [`DistanceField`]: cached bounds of the distance to a mesh.
//! - [`segment_segment`], [`segment_triangle`], [`closest_on_triangle`], [`closest_on_ellipsoid`]: closest
//!   points of primitives.

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
pub use distance::ellipsoid::closest_on_ellipsoid;
pub use distance::segment::segment_segment;
pub use distance::triangle::{
    ClosestPoints, TriangleFeature, barycentric, barycentric_point, closest_on_triangle, segment_triangle,
};
pub use friction::Friction;
pub use mesh::deforming::{DeformingMesh, FromRest};
pub use mesh::distance_field::DistanceField;
pub use mesh::skin::{Skin, SkinPoint};
pub use mesh::solid_mesh::SolidMesh;
pub use shape::Shape;
pub use solid::{MovingSurface, Solid};
pub use surface_point::{Feature, SurfacePoint};
pub use tri_mesh::TriMesh;

#[cfg(test)]
pub(crate) mod tests;
