//! The validated scene: plain data in SI units, metres, Y up. Reads `groom.json` and `anim.json` into
//! [`Groom`] and [`Anim`], and reports all errors of both files at once.

pub mod anim;
mod convention;
mod file_sequence;
mod format;
mod goal;
pub mod groom;
mod input_files;
mod json;
mod keyframes;
mod load;
mod load_options;
pub(crate) mod obj;
pub(crate) mod obj_curves;
mod origin;
mod over_target;
pub(crate) mod placement;
mod root_binding;
mod skin;
pub(crate) mod track;

pub(crate) use anim::motion_file::load_motion;
pub use anim::{Anim, AnimFile, Body, Collider, Settings};
pub use convention::{Convention, UpAxis};
pub(crate) use file_sequence::{FileSequence, lead_in};
pub use format::Format;
pub use groom::{
    Curves, Factors, Groom, Group, Guides, Material, RodSection, Section, SourceCurves, SourcePrim, Strands,
    Tree, Wisp,
};
pub use input_files::input_files;
pub use json::array::{Array, BufferFile, ElementType, View};
pub(crate) use json::former_names::former_name;
pub use load::{check, check_with, load, load_anim, load_groom, load_with, schema};
pub use load_options::{LoadOptions, Override, PathMap};
pub use origin::{Origin, RestSpace};
pub use over_target::{OverKind, OverNormals, OverPrim, OverSource, OverTarget, StageLayer, StageMetadata};
pub use root_binding::RootBinding;

#[cfg(test)]
mod tests;
