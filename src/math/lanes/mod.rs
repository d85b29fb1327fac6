//! Numbers in lanes: one kernel for one rod and for several with the same number of unknowns at once.
//!
//! A kernel that is generic over [`Real`] runs on plain `f64` and on [`Lane`], as many numbers as a vector register of the
//! processor holds. No operation mixes lanes and none is fused, so every lane has the bits of the `f64` kernel, on any
//! processor and beside any other lanes.

mod lane;
mod real;
mod vector;

pub use lane::Lane;
pub use real::{MAX_LANES, Mask, Real};
pub use vector::{M3, Pose, Twist, V3};
