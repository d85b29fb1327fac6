//! Makes an animation from the motion of a joint and the meshes that the hair collides with.

pub(super) mod colliders;
pub(super) mod convert;
mod goals;
mod names;
pub(super) mod options;
pub(super) mod report;
mod timing;

/// Decimal places of points in written OBJ files: nanometres.
const OBJ_DIGITS: usize = 9;
