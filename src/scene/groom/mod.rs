//! The groom and its format, `groom.json`.

mod default_trees;
pub mod file;
pub mod material_file;
pub mod model;
pub(super) mod read;
pub mod source;
mod write;

pub use model::{Curves, Factors, Groom, Group, Guides, Material, RodSection, Section, Strands, Tree, Wisp};
pub use source::{SourceCurves, SourcePrim};
