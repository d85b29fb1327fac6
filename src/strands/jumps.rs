//! How far contact moves strands from a frame to the next.

use super::deflection::{Deflection, deflected};
use super::strand::Strand;
use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

/// Way from a frame to the next beyond which a strand jumps, m.
const MOST: f64 = 0.05;

/// What deflections do to strands between two frames. A strand that slips off an ear or a shoulder may do so
/// within one frame, since its projection has no memory.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub struct Jumps {
    /// Number of strands with a vertex that they move by more than 5 cm.
    pub strands: u32,
    /// Largest way by which they move a vertex, m.
    pub largest: f64,
}

impl Jumps {
    /// Of one strand, from its deflections at two frames.
    pub(super) fn of_strand(strand: &Strand, [from, to]: [&[Deflection]; 2]) -> Jumps {
        if from == to {
            return Jumps::default();
        }
        // In rest space, as if the guides turned all of its edges alike.
        let mut way = Vector3::zeros();
        let mut largest: f64 = 0.0;
        for (edge, ends) in strand.chain.edges.iter().zip(from.iter().zip(to).skip(1)) {
            let turned = |by: &Deflection| {
                let by = Vector3::from(by.map(f64::from));
                deflected(&edge.vector(), &by, &Vector3::zeros())[0]
            };
            way += turned(ends.1) - turned(ends.0);
            largest = largest.max(way.norm());
        }
        Jumps { strands: u32::from(largest > MOST), largest }
    }

    /// Of both.
    pub(super) fn and(self, other: Jumps) -> Jumps {
        Jumps { strands: self.strands + other.strands, largest: self.largest.max(other.largest) }
    }
}
