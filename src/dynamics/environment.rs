//! What acts on the guides: motion of head and bodies, gravity, wind.

use crate::contact::Bodies;
use crate::math::se3::Pose;
use crate::scene::anim::Wind;
use nalgebra::{Isometry3, Vector3};

/// What surrounds the guides: motion and air.
pub struct Environment<'a> {
    /// Rest space of the head to world at a time, s.
    pub head: &'a (dyn Fn(f64) -> Isometry3<f64> + Sync),
    /// Gravity plus uniform force fields at a time, m/s².
    pub gravity: &'a (dyn Fn(f64) -> Vector3<f64> + Sync),
    /// Wind fields.
    pub wind: &'a [Wind],
    /// What the guides collide with, prepared for the sub-step.
    pub bodies: &'a Bodies,
    /// Rest space of a body of `bodies` to world at a time, s.
    pub body: &'a (dyn Fn(usize, f64) -> Isometry3<f64> + Sync),
    /// Rest space of a body of the animation to world at a time, s.
    pub carrier: &'a (dyn Fn(usize, f64) -> Isometry3<f64> + Sync),
    /// Progress (0..=1) of bringing out what starts inside a body, at a time, s.
    pub brought_out: &'a (dyn Fn(f64) -> f64 + Sync),
}

impl Environment<'_> {
    /// World pose of a root that has pose `rest` in rest space, at time `t`, s.
    pub fn root(&self, rest: &Pose, t: f64) -> Pose {
        Environment::rooted(&(self.head)(t), rest)
    }

    /// World pose of a root that has pose `rest` in rest space, with the head at `head`.
    pub fn rooted(head: &Isometry3<f64>, rest: &Pose) -> Pose {
        let r = head.rotation.to_rotation_matrix();
        Pose { r: r.matrix() * rest.r, p: r * rest.p + head.translation.vector }
    }
}
