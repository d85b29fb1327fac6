//! A bake on a farm: divided, killed, stopped, run twice, out of space; whatever happens, the same bytes in the end.

#![allow(clippy::print_stdout)] // A skipped test says so, and the storm how it went.

#[path = "../common/mod.rs"]
#[allow(dead_code)]
mod common;
mod disk;
mod engines;
mod shot;
mod signals;
mod slurm;
mod stages;
mod storm;
