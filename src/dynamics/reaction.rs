//! Reactions at what holds a guide: the clamp at its root and its ties (`docs/theory.md` §4.8).

use crate::rod::contact_load::ContactLoad;
use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

/// What the clamp and the ties exert on a guide at the end of a step, world axes.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct GuideReaction {
    /// Force of the clamp, N.
    pub force: Vector3<f64>,
    /// Moment of the clamp about the root, N·m.
    pub moment: Vector3<f64>,
    /// That of each tie of the guide; zero while it does not hold.
    pub ties: Vec<TieReaction>,
}

/// What a tie exerts on a guide at the end of a step, world axes.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct TieReaction {
    /// Force, N.
    pub force: Vector3<f64>,
    /// Moment about the place that it holds, N·m; zero if that may turn.
    pub moment: Vector3<f64>,
}

impl GuideReaction {
    /// No reaction at the clamp and `ties` ties.
    pub fn none(ties: usize) -> Self {
        let zero = Vector3::zeros();
        GuideReaction { force: zero, moment: zero, ties: vec![TieReaction::default(); ties] }
    }

    /// Linear between two reactions at the share `u` of the way.
    pub fn lerp(&self, other: &Self, u: f64) -> Self {
        GuideReaction {
            force: self.force.lerp(&other.force, u),
            moment: self.moment.lerp(&other.moment, u),
            ties: self.ties.iter().zip(&other.ties).map(|(a, b)| a.lerp(b, u)).collect(),
        }
    }
}

impl TieReaction {
    /// That of the tie which is this load on the guide.
    pub(super) fn of(load: &ContactLoad) -> Self {
        let moment = load.moment.as_ref().map_or(Vector3::zeros(), |holding| holding.moment);
        TieReaction { force: load.force, moment }
    }

    fn lerp(&self, other: &Self, u: f64) -> Self {
        let (force, moment) = (self.force.lerp(&other.force, u), self.moment.lerp(&other.moment, u));
        TieReaction { force, moment }
    }
}
