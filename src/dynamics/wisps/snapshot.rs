//! The bodies and the head at one time, and rods among them.

use crate::contact::ProximityCache;
use crate::dynamics::environment::Environment;
use crate::dynamics::guide::GuideModel;
use crate::math::se3::Pose;
use crate::rod::{Rod, RodShape};
use nalgebra::{Isometry3, Vector3};

/// The bodies and the head at one time.
pub(super) struct EnvironmentSnapshot<'a> {
    env: &'a Environment<'a>,
    t: f64,
    head: Isometry3<f64>,
    body_poses: Vec<Isometry3<f64>>,
}

/// A rod in the shape of given unknowns.
#[derive(Default)]
pub(super) struct PosedRod {
    q: Vec<f64>,
    pub shape: RodShape,
    /// The rod's points, then the midpoints of the curve between consecutive ones, m, world.
    pub x: Vec<Vector3<f64>>,
}

/// A point near a body.
#[derive(Clone, Copy)]
pub(super) struct NearPoint {
    /// The point and the body: `body * points + point`.
    pub index: usize,
    /// Distance missing to the required one, m.
    pub shortfall: f64,
    /// Outward normal of the body.
    pub normal: Vector3<f64>,
}

impl PosedRod {
    /// Poses a rod with unknowns `q`, 1/m, on its root, world.
    pub fn pose(&mut self, rod: &Rod, root: &Pose, q: impl Iterator<Item = f64>) {
        self.q.clear();
        self.q.extend(q);
        self.shape.update(rod, &root.r, &self.q);
        self.shape.points_and_midpoints(rod, &root.p, &mut self.x);
    }
}

impl<'a> EnvironmentSnapshot<'a> {
    /// The environment at time `t`, s.
    pub fn new(env: &'a Environment<'a>, t: f64) -> Self {
        let body_poses = env.body_poses(t);
        EnvironmentSnapshot { env, t, head: (env.head)(t), body_poses }
    }

    /// Its time, s.
    pub fn time(&self) -> f64 {
        self.t
    }

    /// Root pose of a guide, world.
    pub fn root(&self, model: &GuideModel) -> Pose {
        match &model.skin {
            None => Environment::root_on(&self.head, &model.rod.root),
            Some(_) => model.root(self.env, self.t),
        }
    }

    /// Distances of the points of a rod with unknowns `q`, 1/m, on its `root`, world, from the bodies, m,
    /// clamped to `limits`, both indexed as in [`NearPoint`].
    pub fn distances(&self, rod: &Rod, root: &Pose, q: &[f64], limits: &[f64]) -> Vec<f64> {
        let mut distances = limits.to_vec();
        let mut posed = PosedRod::default();
        posed.pose(rod, root, q.iter().copied());
        let at = (self.t, &self.body_poses[..]);
        self.env.bodies.each_point_within(
            at,
            &posed.x,
            limits,
            &mut ProximityCache::default(),
            |i, distance, _| distances[i] = distance,
        );
        distances
    }

    /// Sets `near` to the points of `x` nearer to a body than `required`, m, indexed as in [`NearPoint`], in
    /// ascending order. `cache` is that of
    /// [`Bodies::each_point_within`](crate::contact::Bodies::each_point_within).
    pub fn find_near(
        &self,
        x: &[Vector3<f64>],
        required: &[f64],
        cache: &mut ProximityCache,
        near: &mut Vec<NearPoint>,
    ) {
        near.clear();
        self.env.bodies.each_point_within(
            (self.t, &self.body_poses),
            x,
            required,
            cache,
            |index, distance, normal| {
                near.push(NearPoint { index, shortfall: required[index] - distance, normal });
            },
        );
    }
}
