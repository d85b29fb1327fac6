//! Imports strands, meshes and head motion from other programs into `groom.json` and `anim.json`.
//!
//! [`groom`](fn@groom) cleans strands, chooses and resamples guides, builds the wisp hierarchy over them,
//! attaches or generates render strands, and measures the result. [`grow`](fn@grow) makes a groom of fur
//! from a mesh. [`track`](fn@track) turns the motion of a joint into an animation.
//!
//! From the bottom: [`Source`] names a file; `plain` and `motion` hold what a file contains, in its own unit
//! and axes; `formats` has a reader per format; `strand_file`, `mesh_file` and `motion_file` pick the reader
//! and convert to metres, Y up; `groom`, `grow` and `track` use the result.

mod formats;
mod groom;
mod grow;
mod joint_selector;
mod mesh_file;
#[cfg(test)]
mod messages;
mod motion;
mod motion_file;
mod over;
mod plain;
#[cfg(test)]
mod real_data;
mod rigid;
mod source;
mod strand_file;
mod track;
mod units;

pub use groom::build::{BuildOptions, BuildReport};
pub(crate) use groom::build::{RenderStrands, build};
pub use groom::convert::groom;
pub use groom::fidelity::{Curl, LevelFit};
pub use groom::generate::Generation;
pub use groom::hierarchy::HierarchyShape;
pub use groom::options::{ALL_GUIDES_UP_TO, DEFAULT_GUIDES, GroomOptions};
pub use groom::report::GroomReport;
pub use groom::resample::{Resample, ResampleError};
pub use groom::scalp::{OFF_SCALP, RootReport};
pub use grow::convert::grow;
pub use grow::options::{
    Clumps, Direction, FurShape, GROWN_GUIDES, GrowOptions, LENGTH_SHARE, STRANDS_PER_GUIDE, StrandCount,
};
pub use grow::report::GrowReport;
pub use joint_selector::JointSelector;
pub use mesh_file::{ImportedMesh, read_mesh};
pub use over::over_target;
pub use source::Source;
pub use strand_file::{MIN_STRAND_LENGTH, StrandFileReport};
pub use track::convert::{Track, track};
pub use track::options::{ColliderMesh, GoalCurvesSource, RestPose, TrackGroom, TrackOptions};
pub use track::report::TrackReport;
