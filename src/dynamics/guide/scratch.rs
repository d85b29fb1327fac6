//! Buffers of the steps of one thread.

use super::goal_scratch::GoalScratch;
use crate::contact::BodyMotion;
use crate::dynamics::body_contact::BodyContactScratch;
use crate::dynamics::tie::ActiveTie;
use crate::math::se3::Pose;
use crate::rod::newton::{NewtonOutcome, Solver};
use crate::rod::potential::Load;
use crate::rod::{Rod, RodShape};
use nalgebra::Vector3;

/// Buffers of the steps of one thread. They carry nothing from one step to the next.
#[derive(Debug, Default)]
pub struct GuideScratch {
    /// Newton solver with the shape at `q`.
    pub(in crate::dynamics) solver: Solver,
    /// Load of the step.
    pub(in crate::dynamics) load: Load,
    /// Unknowns at the end of the step, 1/m.
    pub(in crate::dynamics) q: Vec<f64>,
    /// Unknowns q* that the difference formula asks for, 1/m.
    pub(super) q_star: Vec<f64>,
    /// Unknowns of the solve without contact, 1/m.
    pub(super) free_q: Vec<f64>,
    /// The animated goal over the step.
    pub(super) goal: GoalScratch,
    /// What the guide meets in the step.
    pub(super) inputs: ContactInputs,
    /// Buffers of the contact with bodies.
    pub(in crate::dynamics) contact: BodyContactScratch,
}

impl GuideScratch {
    /// Sets what the ties exert under the last reactions of bodies and the forces `others`: segment, fraction of
    /// it, force, N, world. The solver is that of the last linearisation.
    pub(in crate::dynamics) fn balance_ties(
        &mut self,
        rod: &Rod,
        others: impl Iterator<Item = (usize, f64, Vector3<f64>)>,
    ) {
        self.contact.balance_ties(&self.inputs.ties, rod, &self.solver, others);
    }
}

/// What a guide meets in one step.
#[derive(Debug, Default)]
pub(super) struct ContactInputs {
    /// Motion of each body.
    pub motions: Vec<BodyMotion>,
    /// Distance to keep from body b at both ends of half segment k, m, at `b * halves + k`.
    pub clearance: Vec<[f64; 2]>,
    /// The same before they are lowered to what bodies leave room for.
    pub asked: Vec<[f64; 2]>,
    /// True if bodies leave no room for some of these distances, which are lowered.
    pub pinched: bool,
    /// Whether the guide slides on each body without friction.
    pub slides: Vec<bool>,
    /// [`MovingPolyline::by_part`](crate::contact::MovingPolyline).
    pub by_part: bool,
    /// Contact polyline at the start of the step, m, world.
    pub polyline: Vec<Vector3<f64>>,
    /// True while the distances to keep from bodies that the groom is drawn in still rise to their own.
    pub pushed_out: bool,
    /// Speed gained from gravity and force fields in the step, m/s.
    pub falling_speed: f64,
    /// Ties that hold at the end of the step.
    pub ties: Vec<ActiveTie>,
    /// The rod at the start of the step, where ties hold its frame.
    pub shape: RodShape,
}

/// The solved motion of a step without contact.
#[derive(Debug, Clone, Copy)]
pub(in crate::dynamics) struct FreeSolve {
    /// Root as it is carried at the end of the step, world.
    pub root: Pose,
    /// Outcome of the Newton solve.
    pub outcome: NewtonOutcome,
}
