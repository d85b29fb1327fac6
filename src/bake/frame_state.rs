//! The simulated state of a frame, as in the work folder.

use super::frame_record::FrameRecord;
use crate::dynamics::guide_frame::{GuideFrame, SolverStep};
use serde::{Deserialize, Serialize};

/// The guides at a frame: everything that interpolation needs from the simulation, and the frame's record.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct FrameState {
    /// Record of the frame.
    pub record: FrameRecord,
    /// Instruction set of the simulating machine.
    pub machine: String,
    /// The guides, in the groom's order.
    pub guides: Vec<GuideFrame>,
    /// Configurations that the solver reached since the frame before, if they are written.
    pub steps: Vec<SolverStep>,
}
