//! Buffers of the pull of an animated goal.

use crate::dynamics::integrator::DifferenceFormula;
use crate::rod::RodShape;
use nalgebra::Vector3;

/// The goal pose over a step.
#[derive(Debug, Clone, Default)]
pub(in crate::dynamics) struct GoalScratch {
    /// At the end and the start of the step, and at the starts of the steps before that a difference formula
    /// may use.
    pub poses: [GoalPose; DifferenceFormula::PAST + 1],
    /// The guide one step before.
    pub guide: GoalPose,
    /// The rod in one of them.
    pub shape: RodShape,
    /// Weight of each point.
    pub weights: Vec<f64>,
}

/// A pose at one time.
#[derive(Debug, Clone, Default)]
pub(in crate::dynamics) struct GoalPose {
    /// The rod's unknowns, 1/m.
    pub q: Vec<f64>,
    /// Points relative to the root at the end of the step, m, world axes.
    pub x: Vec<Vector3<f64>>,
}
