//! Builds a groom from strands.
//!
//! `convert` chooses the guides among the strands of a file. `build` resamples them, clusters them into the
//! wisp hierarchy, attaches the render strands or generates them, and measures the fit.
//! `drawn` records which curves of which file they were.

pub(super) mod build;
mod cluster;
pub(super) mod convert;
mod coverage;
pub(super) mod drawn;
mod features;
pub(super) mod fidelity;
pub(super) mod generate;
pub(super) mod hierarchy;
pub(super) mod options;
pub(super) mod report;
pub(super) mod resample;
pub(super) mod scalp;
mod sections;
