//! Plain strands and motion tracks made into `groom.json` and `anim.json`.
//!
//! [`groom`]: strand files ([`read`]) are cleaned and resampled, guides chosen, the GC hierarchy built over them
//! ([`hierarchy`]), render strands attached or grown, and the result measured ([`fidelity`]).

mod bytes;
mod cluster;
mod fault;
pub mod fidelity;
mod groom;
pub mod grow;
mod hair;
pub mod hierarchy;
mod read;
#[cfg(test)]
mod real_data;
mod resample;
mod scalp;
mod sections;
mod tfx;

pub use groom::{GroomOptions, GroomReport, groom};
pub use grow::Growth;
pub use hierarchy::Depth;
pub use read::{SHORTEST, Source, SourceReport};
pub use resample::{Resample, ResampleError};
pub use scalp::{OFF_SCALP, RootReport};
