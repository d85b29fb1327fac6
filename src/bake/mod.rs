//! The bake: guides simulated, strands interpolated, the cache written, in stages that may run in one process
//! or in many.
//!
//! [`simulate`] goes from frame to frame and writes the guides' state at each; [`interpolate`] makes a
//! frame's file of the states around it; [`assemble`] ends the cache. [`bake()`] does all of it. Whichever
//! way, the cache has the same bytes: every stage begins by looking what is done, and a frame depends on
//! nothing but the [`Job`](job::Job).

pub mod base_cache;
mod cache_content;
pub mod checked_file;
pub mod control;
pub mod frame_record;
mod frame_state;
mod frame_stepper;
mod frame_writer;
pub mod job;
mod manifest;
pub mod output;
pub mod over;
mod scene_warnings;
mod single;
mod stages;
mod start_check;
mod summary;
pub mod work_dir;

pub use scene_warnings::{SceneWarning, start_warnings};
pub use stages::{assemble, bake, input_records, interpolate, simulate};
pub use start_check::check_start;
pub use summary::{BakeSummary, StageSeconds};
