//! Grows fur on a mesh.
//!
//! `convert` reads the mesh and what is painted on it, and puts the parts together. `surface` is the mesh
//! with its normals, `flow` the direction of the fur on it, `scatter` places roots, `strand` grows a strand
//! from a root, `clump` draws strands together. `docs/theory.md` §7.4 describes the steps.

mod clump;
pub(super) mod convert;
mod flow;
pub(super) mod options;
pub(super) mod report;
mod scatter;
mod strand;
mod surface;
#[cfg(test)]
mod tests;
