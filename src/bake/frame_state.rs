//! What the work folder keeps of a frame: the guides, and the figures of its sub-steps.

use super::frame_record::FrameRecord;
use crate::dynamics::guide_frame::{GuideFrame, SolverStep};
use serde::{Deserialize, Serialize};

/// The guides at a frame: all that interpolation needs of the simulation, and its figures.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct FrameState {
    /// What the frame's sub-steps did.
    pub record: FrameRecord,
    /// The instruction set that it was simulated with.
    pub machine: String,
    /// The guides, in the groom's order.
    pub guides: Vec<GuideFrame>,
    /// Where the solver brought them on the way from the frame before, where that is written.
    pub steps: Vec<SolverStep>,
}
