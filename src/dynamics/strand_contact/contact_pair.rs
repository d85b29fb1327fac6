//! One contact between two guides.

use crate::contact::pairs::SegmentContact;
use nalgebra::{UnitQuaternion, Vector3};
use serde::{Deserialize, Serialize};

/// Share of the distance of the law by which two guides may be too close. A share, because hairs are some
/// tenths of a millimetre apart and thick locks centimetres; of the law, not of what a sub-step begins with,
/// because over many short sub-steps the latter would lose any distance.
const TOLERATED_SHARE: f64 = 5e-3;

/// Share of the required distance that may be missing after a round. The linearisation of a round errs by the
/// square of its motion; what it leaves is regained in the sub-steps that follow.
const UNRESOLVED_SHARE: f64 = 0.05;

/// Shares of the required distance, and where some of that is missing of that of the law, below which a contact is lost.
/// The second bounds what many sub-steps may take together; much of it may be missing where hair was pressed together.
const LOST_SHARES: [f64; 2] = [0.5, 0.1];

/// Share of the required distance at which a contact prevents a crossing beside it.
const PREVENTING_SHARE: f64 = 0.5;

/// Two guides near each other, or meeting within the sub-step, in the frame of the head. Positions and axes
/// are fixed until the sub-step ends: contacts that turned in every round would not converge.
#[derive(Debug, Clone, Copy)]
pub(super) struct ContactPair {
    pub contact: SegmentContact,
    /// Distance required at the end of the sub-step, m.
    pub required: f64,
    /// Distance by the law, as far as the pair has had it, m.
    pub lawful: f64,
    /// Upper bound of the required distance, m: the largest distance that the pair has had.
    pub limit: f64,
    /// Axes of the contact: its normal, and tangents along and across the guides. The former is shorter where
    /// friction along the guides is weaker.
    pub local_axes: [Vector3<f64>; 3],
    /// Cohesive force between the guides, N.
    pub cohesion: f64,
    /// Contact force on the first guide without cohesion, N.
    pub reaction: Vector3<f64>,
}

/// What one sub-step passes to the next about a contact.
#[derive(Debug, Clone, Copy, Serialize, Deserialize)]
pub(super) struct ContactHistory {
    pub guides: [u32; 2],
    /// Positions along the two guides, in segments of their rods from the root.
    pub at: [f64; 2],
    pub limit: f64,
    pub reaction: Vector3<f64>,
}

impl ContactPair {
    /// The axes of the contact in the world.
    pub fn axes(&self, to_world: &UnitQuaternion<f64>) -> [Vector3<f64>; 3] {
        self.local_axes.map(|d| to_world * d)
    }

    /// Total force on the first guide, N.
    pub fn force(&self) -> Vector3<f64> {
        self.reaction - self.contact.normal * self.cohesion
    }

    /// True if the uncoupled motion violates the contact, or cohesion acts.
    pub fn needs_coupling(&self) -> bool {
        !self.is_kept() || self.cohesion > 0.0
    }

    /// Distance less the required one, m.
    pub fn gap(&self) -> f64 {
        self.contact.distance - self.required
    }

    /// True if the required distance is kept.
    pub fn is_kept(&self) -> bool {
        self.contact.distance >= self.required.min((1.0 - TOLERATED_SHARE) * self.lawful)
    }

    /// True if another round is to keep the required distance.
    pub fn needs_round(&self) -> bool {
        self.contact.distance < (1.0 - UNRESOLVED_SHARE) * self.required
    }

    /// True if too little of its distance is left to take the next sub-step from there.
    pub fn is_lost(&self) -> bool {
        let [required, lawful] = LOST_SHARES;
        let distance = self.contact.distance;
        distance < required * self.required || self.needs_round() && distance < lawful * self.lawful
    }

    /// True if segments that cross beside the contact pass it by.
    pub fn is_passed_by(&self) -> bool {
        self.contact.distance >= PREVENTING_SHARE * self.required
    }

    /// True if the reaction is not zero.
    pub fn is_active(&self) -> bool {
        self.reaction != Vector3::zeros()
    }
}
