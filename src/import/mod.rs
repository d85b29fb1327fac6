//! Plain strands and motion tracks made into `groom.json` and `anim.json`.
//!
//! [`groom`]: strand files are cleaned, guides chosen and resampled, the GC hierarchy built over them, render strands attached or
//! grown, and the result measured. [`track`]: the motion of a joint becomes an animation.

mod build;
mod bytes;
mod cluster;
#[cfg(test)]
mod faults;
mod fidelity;
mod groom;
mod grow;
mod hair;
mod hierarchy;
mod motion;
mod read;
#[cfg(test)]
mod real_data;
mod resample;
mod scalp;
mod sections;
mod tfx;
mod track;
mod usd;

pub(crate) use build::build;
pub use build::{BuildOptions, BuildReport};
pub use fidelity::{Curl, LevelFit};
pub use groom::{ALL_GUIDES, CHOSEN_GUIDES, GroomOptions, GroomReport, groom};
pub use grow::Growth;
pub use hierarchy::Depth;
pub use motion::Joint;
pub use read::{ReadMesh, SHORTEST, Source, SourceReport, mesh};
pub use resample::{Resample, ResampleError};
pub use track::{Mesh, Rest, Track, TrackOptions, TrackReport, root_centroid, track};

pub(crate) use scalp::Scalp;
pub use scalp::{OFF_SCALP, RootReport};
