//! Contact between strands: which segments are near each other, and when moving ones first come too close.
//!
//! All strands of a scene move over a sub-step in a common frame. The frame of the head is best: motion that
//! the head carries along is no relative motion of strands. Every vertex moves linearly in that frame. A
//! strand meets itself where its segments are far enough apart along it.

mod broad_phase;
mod impact;
mod strands;

pub use impact::TOUCHING_SHARE;
pub use strands::{ClosestPair, MovingStrands, SegmentContact, SegmentPair};

#[cfg(test)]
mod tests;
