//! What acts on the guides: motion of the head and the bodies, gravity, wind.

use crate::contact::Bodies;
use crate::math::se3::Pose;
use crate::scene::anim::{GRAVITY, Wind};
use nalgebra::{Isometry3, Vector3};

/// A function of time, s.
pub type OfTime<'a, T> = Box<dyn Fn(f64) -> T + Sync + 'a>;

/// A pose that depends on an index and on time, s.
pub type PoseOf<'a> = Box<dyn Fn(usize, f64) -> Isometry3<f64> + Sync + 'a>;

/// What acts on the guides.
pub struct Environment<'a> {
    /// Head rest space to world.
    pub head: OfTime<'a, Isometry3<f64>>,
    /// Gravity plus uniform force fields, m/s².
    pub gravity: OfTime<'a, Vector3<f64>>,
    /// Wind fields.
    pub wind: &'a [Wind],
    /// Bodies that the guides collide with, prepared for the current sub-step.
    pub bodies: Bodies,
    /// Rest space of body `b` of `bodies` to world.
    pub body: PoseOf<'a>,
    /// Rest space of body `b` of the animation to world: ties are attached to these.
    pub carrier: PoseOf<'a>,
    /// Progress (0..=1) of pushing points that start inside a body out of it.
    pub push_out: OfTime<'a, f64>,
}

impl<'a> Environment<'a> {
    /// A head and `bodies` at rest under [`GRAVITY`] along −Y, without wind.
    pub fn at_rest(bodies: Bodies) -> Self {
        Environment {
            head: Box::new(|_| Isometry3::identity()),
            gravity: Box::new(|_| Vector3::y() * -GRAVITY),
            wind: &[],
            bodies,
            body: Box::new(|_, _| Isometry3::identity()),
            carrier: Box::new(|_, _| Isometry3::identity()),
            push_out: Box::new(|_| 1.0),
        }
    }

    /// World pose at time `t`, s, of a root with pose `rest` in head rest space.
    pub fn root(&self, rest: &Pose, t: f64) -> Pose {
        Environment::root_on(&(self.head)(t), rest)
    }

    /// World pose of a root with pose `rest` in head rest space, for a given `head` pose.
    pub fn root_on(head: &Isometry3<f64>, rest: &Pose) -> Pose {
        let r = head.rotation.to_rotation_matrix();
        Pose { r: r.matrix() * rest.r, p: r * rest.p + head.translation.vector }
    }

    /// World poses of `bodies` at time `t`, s.
    pub fn body_poses(&self, t: f64) -> Vec<Isometry3<f64>> {
        (0..self.bodies.len()).map(|b| (self.body)(b, t)).collect()
    }
}
