//! The rod: statics and dynamics against theory, robustness, and no allocation in a step.

mod allocations;
mod dynamics;
mod robustness;
mod statics;
