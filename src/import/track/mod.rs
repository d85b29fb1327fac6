//! Makes an animation from the motion of a joint and the meshes that the hair collides with.

pub(super) mod colliders;
pub(super) mod convert;
mod goals;
pub(super) mod options;
pub(super) mod report;
mod timing;
