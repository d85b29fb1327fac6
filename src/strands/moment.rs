//! The inputs of an evaluation: guides and what carries the roots at one moment.

use crate::rod::Rod;
use nalgebra::{Isometry3, Matrix3, Vector3};

/// A guide at one moment.
#[derive(Debug, Clone, Copy)]
pub struct GuideMotion<'a> {
    /// The guide.
    pub rod: &'a Rod,
    /// Unknowns: deviation of the strain at its nodes, 1/m.
    pub q: &'a [f64],
    /// Rate of `q`, 1/(m·s); empty where no velocities are asked for.
    pub rate: &'a [f64],
}

/// A rigid motion of rest space to the world at one moment.
#[derive(Debug, Clone, Copy)]
pub struct RigidMotion {
    /// Rotation.
    pub rotation: Matrix3<f64>,
    /// Translation, m.
    pub translation: Vector3<f64>,
    /// Angular velocity, rad/s, world axes.
    pub spin: Vector3<f64>,
    /// Velocity of the point that is at the rest origin, m/s.
    pub velocity: Vector3<f64>,
}

/// What carries the roots at one moment.
#[derive(Debug, Clone)]
pub enum Carriers {
    /// The head carries all.
    Head(RigidMotion),
    /// Each root rides on a skin.
    Skin {
        /// What carries each guide.
        guides: Vec<RigidMotion>,
        /// What carries each strand.
        strands: Vec<RigidMotion>,
    },
}

impl Carriers {
    /// What carries guide `i`.
    pub fn guide(&self, i: usize) -> &RigidMotion {
        match self {
            Carriers::Head(head) => head,
            Carriers::Skin { guides, .. } => &guides[i],
        }
    }

    /// What carries strand `i`.
    pub(super) fn strand(&self, i: usize) -> &RigidMotion {
        match self {
            Carriers::Head(head) => head,
            Carriers::Skin { strands, .. } => &strands[i],
        }
    }
}

impl RigidMotion {
    /// The motion with these poses over time, s, at time `t`: its velocity by central differences.
    pub fn of(pose: impl Fn(f64) -> Isometry3<f64>, t: f64) -> Self {
        let delta = 1e-4;
        let (now, after, before) = (pose(t), pose(t + delta), pose(t - delta));
        RigidMotion {
            rotation: now.rotation.to_rotation_matrix().into_inner(),
            translation: now.translation.vector,
            spin: (after.rotation * before.rotation.inverse()).scaled_axis() / (2.0 * delta),
            velocity: (after.translation.vector - before.translation.vector) / (2.0 * delta),
        }
    }

    /// World position, m, and velocity, m/s, of the point at `p`, m, rest space.
    pub fn carry(&self, p: &Vector3<f64>) -> (Vector3<f64>, Vector3<f64>) {
        let arm = self.rotation * p;
        (arm + self.translation, self.velocity + self.spin.cross(&arm))
    }
}
