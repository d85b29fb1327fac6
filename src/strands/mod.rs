//! Render strands from guides, by rotation with the guides (`docs/theory.md` §7).
//!
//! A render strand is a chain of rigid edges with its own rest shape. Each edge is rotated as its main guide
//! is at the same arc length, and turned towards the other guides. Curls stay curls, edge lengths are exact,
//! and at rest the strand is that of the groom, to rounding. Where this *free chain* would enter a body, a
//! second, *projected chain* of the same edges is laid outside of it. Its *deflections* from the free chain
//! at the frames are blended in time: what is written is smooth, and has exact velocities.

mod chain;
mod clearances;
mod curl;
mod deflection;
mod depths;
mod fabrik;
mod free_chain;
mod guide_place;
mod guide_weights;
mod interpolator;
mod jumps;
mod moment;
mod moving_rotation;
mod obstacles;
mod posed_guide;
mod projected_chain;
mod rest_guide;
mod retraction;
mod strand;
#[cfg(test)]
mod tests;
mod thinning;

pub use deflection::Deflection;
pub use depths::{Depths, GuideDepths};
pub use guide_weights::{GuideWeights, MAX_GUIDES, Membership, clumping, guide_weights};
pub use interpolator::{AroundFrame, DeflectionAt, Interpolator, LOOKAHEAD, LOOKBEHIND, StrandMotion};
pub use jumps::Jumps;
pub use moment::{Carriers, GuideMotion, RigidMotion};
pub use obstacles::Obstacles;
pub use posed_guide::PosedGuides;
pub use thinning::thin;
