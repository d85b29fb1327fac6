//! What acts on the guides: motion of the head and the bodies, gravity, wind.

use crate::contact::Bodies;
use crate::contact::friction::Interrupt;
use crate::geometry::FromRest;
use crate::math::se3::Pose;
use crate::scene::RootBinding;
use crate::scene::anim::{GRAVITY, Wind};
use nalgebra::{Isometry3, Vector3};

/// A function of time, s.
pub type OfTime<'a, T> = Box<dyn Fn(f64) -> T + Sync + 'a>;

/// A pose that depends on an index and on time, s.
pub type PoseOf<'a> = Box<dyn Fn(usize, f64) -> Isometry3<f64> + Sync + 'a>;

/// Where a deforming body is on its way from rest, by its index and time, s; `None` where its deformation has it.
pub type FromRestOf<'a> = Box<dyn Fn(usize, f64) -> Option<FromRest> + Sync + 'a>;

/// The motion that carries a root on a skin, by its binding and time, s.
pub type CarriedBySkin<'a> = Box<dyn Fn(&RootBinding, f64) -> Isometry3<f64> + Sync + 'a>;

/// What acts on the guides.
pub struct Environment<'a> {
    /// Head rest space to world. With skins it is a frame of reference for what guides have in common.
    pub head: OfTime<'a, Isometry3<f64>>,
    /// Rest space around a root on a skin to world.
    pub skin: CarriedBySkin<'a>,
    /// Gravity plus uniform force fields, m/s².
    pub gravity: OfTime<'a, Vector3<f64>>,
    /// Wind fields.
    pub wind: &'a [Wind],
    /// Bodies that the guides collide with, prepared for the current sub-step.
    pub bodies: Bodies,
    /// Rest space of body `b` of `bodies` to world.
    pub body: PoseOf<'a>,
    /// Where each deforming body of `bodies` is on its way from rest, by the time, s.
    pub from_rest: FromRestOf<'a>,
    /// Rest space of body `b` of the animation to world: ties are attached to these.
    pub carrier: PoseOf<'a>,
    /// Progress (0..=1) of pushing points that start inside a body out of it.
    pub push_out: OfTime<'a, f64>,
    /// Whether the sub-step is to be abandoned; only coupled ones are.
    pub interrupt: Interrupt,
}

/// Bodies, of which skins are at rest.
pub struct SkinsAtRest {
    /// The bodies.
    pub bodies: Bodies,
    /// Which of them are skins at rest.
    pub at_rest: Vec<bool>,
}

impl SkinsAtRest {
    /// Poses of the bodies around a root that `carrier` takes from rest to the world: skins are carried with
    /// it, the others have their own `poses`.
    pub fn poses_around(&self, carrier: &Isometry3<f64>, poses: &[Isometry3<f64>]) -> Vec<Isometry3<f64>> {
        let around = self.at_rest.iter().zip(poses);
        around.map(|(at_rest, pose)| if *at_rest { *carrier } else { *pose }).collect()
    }
}

impl<'a> Environment<'a> {
    /// A head and `bodies` at rest under [`GRAVITY`] along −Y, without wind.
    pub fn at_rest(bodies: Bodies) -> Self {
        Environment {
            head: Box::new(|_| Isometry3::identity()),
            skin: Box::new(|_, _| Isometry3::identity()),
            gravity: Box::new(|_| Vector3::y() * -GRAVITY),
            wind: &[],
            bodies,
            body: Box::new(|_, _| Isometry3::identity()),
            from_rest: Box::new(|_, _| None),
            carrier: Box::new(|_, _| Isometry3::identity()),
            push_out: Box::new(|_| 1.0),
            interrupt: Interrupt::default(),
        }
    }

    /// Rest space around a root to world at time `t`, s: by its place on a skin, or by the head.
    pub fn carried(&self, root: Option<&RootBinding>, t: f64) -> Isometry3<f64> {
        root.map_or_else(|| (self.head)(t), |root| (self.skin)(root, t))
    }

    /// World pose of a root with pose `rest` in rest space, which `carrier` takes to the world.
    pub fn root_on(carrier: &Isometry3<f64>, rest: &Pose) -> Pose {
        let r = carrier.rotation.to_rotation_matrix();
        Pose { r: r.matrix() * rest.r, p: r * rest.p + carrier.translation.vector }
    }

    /// Prepares the bodies for the sub-step between two times, s.
    pub fn prepare_bodies(&mut self, times: [f64; 2]) {
        self.bodies.prepare_from_rest(times, &self.from_rest);
    }

    /// World poses of `bodies` at time `t`, s.
    pub fn body_poses(&self, t: f64) -> Vec<Isometry3<f64>> {
        (0..self.bodies.len()).map(|b| (self.body)(b, t)).collect()
    }
}
