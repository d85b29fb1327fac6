//! Triangle meshes as solids: topology, signed distance, inside and outside, deformation.

mod deforming;
mod distance_field;
mod solid_mesh;
mod topology;
mod winding;

pub use deforming::DeformingMesh;
pub use distance_field::DistanceField;
pub use solid_mesh::{SolidMesh, barycentric_point};
