//! Crate files and caches: round trips, and reading by usd-core.

mod cache;
mod faults;
mod layers;
mod python;
mod sample;
