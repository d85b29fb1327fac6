//! The inputs of an evaluation: guides, head and obstacles at one moment.

use super::obstacles::Obstacles;
use crate::rod::Rod;
use nalgebra::{Matrix3, Vector3};

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

/// Motion of the head, which carries all roots, at one moment: rest space to world.
#[derive(Debug, Clone, Copy)]
pub struct HeadMotion {
    /// Rotation.
    pub rotation: Matrix3<f64>,
    /// Translation, m.
    pub translation: Vector3<f64>,
    /// Angular velocity, rad/s, world axes.
    pub spin: Vector3<f64>,
    /// Velocity of the point of the head that is at the rest origin, m/s.
    pub velocity: Vector3<f64>,
}

impl HeadMotion {
    /// World position, m, and velocity, m/s, of the point of the head at `p`, m, rest space.
    pub fn carry(&self, p: &Vector3<f64>) -> (Vector3<f64>, Vector3<f64>) {
        let arm = self.rotation * p;
        (arm + self.translation, self.velocity + self.spin.cross(&arm))
    }
}

/// A moment at which strands are evaluated.
#[derive(Debug, Clone, Copy)]
pub struct Moment<'a> {
    /// Motion of the head.
    pub head: HeadMotion,
    /// The bodies to stay out of; may be empty.
    pub obstacles: Obstacles<'a>,
}
