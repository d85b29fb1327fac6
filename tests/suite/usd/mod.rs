//! Crate files and caches: written, read back, and opened by usd-core.

mod cache;
mod faults;
mod layers;
mod python;
mod sample;
