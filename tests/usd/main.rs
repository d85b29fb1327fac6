//! Crate files and caches: written, read back, and opened by usd-core.
#![allow(clippy::print_stdout)] // A skipped test says so.

mod cache;
mod faults;
mod layers;
mod python;
mod sample;
