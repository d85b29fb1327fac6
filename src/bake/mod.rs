//! The frame loop: sub-steps, statistics, the cache written as it goes.

pub mod air;
pub mod guide;
pub mod simulation;
