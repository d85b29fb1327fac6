//! The hierarchy of wisps on the guides' rods, and linear models of these rods (`docs/theory.md` §8;
//! Bertails, Kim, Cani & Neumann 2003).
//!
//! At full resolution every guide is simulated as one rod. At lower resolutions guides follow the mean of
//! their leaders ([`Hierarchy`]), corrected by their linear response to the motion of the head
//! ([`ModalResponse`]).

mod deflection;
mod frequency_response;
mod guide_rod;
mod head_excitation;
mod hierarchy;
mod leader_weights;
mod linear_kinematics;
mod linear_model;
mod modal_response;

pub use deflection::Deflection;
pub use guide_rod::{GuideRod, guide_rods};
pub use head_excitation::HeadExcitation;
pub use hierarchy::Hierarchy;
pub use linear_kinematics::LinearKinematics;
pub use modal_response::{ForceApart, ModalRates, ModalResponse, ModeState, NeighbourDrag};
