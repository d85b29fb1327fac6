//! The inputs of an evaluation: guides and what carries the roots at one moment.

use crate::rod::{Rod, RodShape};
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
    /// Each root has a motion of its own: it rides on a skin, or is that of a free root.
    Each {
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
            Carriers::Each { guides, .. } => &guides[i],
        }
    }

    /// What carries strand `i`.
    pub fn strand(&self, i: usize) -> &RigidMotion {
        match self {
            Carriers::Head(head) => head,
            Carriers::Each { strands, .. } => &strands[i],
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

    /// No motion from this pose.
    pub fn still(pose: &Isometry3<f64>) -> Self {
        RigidMotion {
            rotation: pose.rotation.to_rotation_matrix().into_inner(),
            translation: pose.translation.vector,
            spin: Vector3::zeros(),
            velocity: Vector3::zeros(),
        }
    }

    /// The motion of the free root of a guide that `carrier` takes from rest to the world.
    pub fn of_free_root(GuideMotion { rod, q, rate }: &GuideMotion, carrier: &Isometry3<f64>) -> Self {
        let (carried, mut shape) = (RigidMotion::still(carrier), RodShape::default());
        shape.update(rod, &(carried.rotation * rod.root.r), q);
        let x = shape.x(0);
        let (velocity, spin) = shape.velocities(rod, q, rate).next().unwrap_or_default();
        let rotation = shape.frame(0) * rod.root.r.transpose();
        let arm = rotation * rod.root.p;
        let translation = carried.carry(&rod.root.p).0 + x - arm;
        RigidMotion { rotation, translation, spin, velocity: velocity - spin.cross(&arm) }
    }

    /// World position, m, and velocity, m/s, of the point at `p`, m, rest space.
    pub fn carry(&self, p: &Vector3<f64>) -> (Vector3<f64>, Vector3<f64>) {
        let arm = self.rotation * p;
        (arm + self.translation, self.velocity + self.spin.cross(&arm))
    }
}
