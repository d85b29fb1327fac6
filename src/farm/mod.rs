//! A bake as a graph of tasks for schedulers: [`openjd`], [`slurm`], and JSON for all others.
//!
//! Segments of the simulation run one after the other. The chunks of frames of a segment depend only on the
//! simulation up to it. When all chunks are done the cache is assembled, then validated in chunks. A sweep
//! has such a graph for each combination of values, and a contact sheet of all.

pub mod openjd;
mod plan;
pub mod slurm;
#[cfg(test)]
mod tests;

pub use plan::{Commands, Division, FRAMES, PATH_MAP, Plan, Step, ValidateCommands};
