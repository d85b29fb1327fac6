//! The rod: statics and dynamics against theory, robustness, and allocations.

mod allocations;
mod dynamics;
mod ends;
mod free;
mod loads;
mod planar;
mod reactions;
mod robustness;
mod statics;
