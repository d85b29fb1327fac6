//! Render strands from guides, by interpolation in strain space (`docs/theory.md` §7).
//!
//! A render strand is a chain of rigid edges with its own rest shape. The deviations of its guides from their
//! rest shapes are blended in rest space and rotate edge after edge. Curls stay curls, edge lengths are
//! exact, and at rest the strand is that of the groom, to rounding. Where this *free chain* would enter a
//! body, a second, *projected chain* of the same edges is laid outside of it.

mod chain;
mod clearances;
mod fabrik;
mod free_chain;
mod guide_weights;
mod interpolator;
mod moment;
mod obstacles;
mod posed_guide;
mod projected_chain;
mod rest_guide;
mod retraction;
mod strand;
#[cfg(test)]
mod tests;
mod thinning;

pub use guide_weights::{GuideWeights, MAX_GUIDES, Membership, clumping, guide_weights};
pub use interpolator::{Interpolator, RetractionAt, Retractions, StrandMotion};
pub use moment::{DIFFERENCE_STEP, GuideMotion, HeadMotion, Moment};
pub use obstacles::Obstacles;
pub use retraction::RETRACTION_SPAN;
pub use thinning::thin;
