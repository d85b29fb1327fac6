//! Contact of moving polylines with bodies and with each other: detection, and Coulomb friction.
//!
//! A polyline moves over a sub-step from `x0` to `x1`. Bodies are kinematic: each has a pose at the start and
//! at the end of the sub-step, and is rigid or deforms in its own frame, where its vertices then move
//! linearly. A vertex of a polyline is taken to move linearly **in the frame of the body** it is tested
//! against, from pose(0)⁻¹ x0 to pose(1)⁻¹ x1. For a body that rotates by α in the sub-step, this differs
//! from the screw motion by at most r (1 − cos α/2) at distance r from its axis (2 µm at 0.1 m and 0.7°), and
//! agrees with it at both ends.
//!
//! - `candidates`: contacts near the end of the sub-step (discrete detection).
//! - `ccd`: times of impact (continuous detection).
//! - [`pinch`]: what distances bodies leave room for.
//! - [`pairs`]: strands against strands, discrete and continuous.
//! - [`friction`]: Signorini's condition with Coulomb's law, solved to a given residual.

mod bodies;
mod cache;
mod candidates;
mod ccd;
mod detection;
pub mod friction;
pub mod pairs;
pub mod pinch;
mod polyline;
mod proximity;

pub use bodies::{Bodies, Body};
pub use cache::ContactCache;
pub use friction::{FrictionOutcome, FrictionProblem, FrictionScratch, FrictionTolerance, solve};
pub use polyline::{BodyMotion, Contact, GAP_TOLERANCE, MovingPolyline};
pub use proximity::ProximityCache;

#[cfg(test)]
mod tests;
