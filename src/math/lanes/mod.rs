//! SIMD lanes: one kernel for a single rod and for several rods with the same number of unknowns.
//!
//! A kernel that is generic over [`Real`] runs on `f64` and on [`Lane`], the numbers that a vector register
//! of the processor holds. No operation mixes lanes and none is fused, so every lane has the bits of the
//! `f64` kernel, on any processor and for any contents of the other lanes.

mod lane;
mod real;
mod vector;

pub use lane::Lane;
pub use real::{MAX_LANES, Mask, Real};
pub use vector::{M3, Pose, Twist, V3};
