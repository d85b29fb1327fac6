//! One guide: its constants ([`GuideModel`]), its state ([`GuideState`]), and one implicit step of it
//! ([`GuideModel::step`]).

mod body_contact;
mod goal_pull;
mod goal_scratch;
mod midway;
mod model;
mod scratch;
mod state;
mod step;
mod ties;

pub(super) use body_contact::ContactSolve;
pub use model::{ContactMode, GoalSpring, GuideModel};
pub(super) use scratch::FreeSolve;
pub use scratch::GuideScratch;
pub use state::GuideState;
pub(super) use step::{MAX_HALVINGS, MAX_HALVINGS_AT_CROSSINGS};
