//! Triangle meshes as solids: topology, signed distance, winding numbers, deformation, places on them.

pub mod deforming;
pub mod distance_field;
mod holes;
pub mod skin;
pub mod solid_mesh;
mod topology;
mod winding;
