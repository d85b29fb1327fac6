//! Segments of guides exempt from contact with bodies: how many there are, and how deep they lie.

use super::contact_polyline::with_midpoints;
use super::guide::GuideState;
use super::simulation::Simulation;
use crate::rod::RodShape;
use nalgebra::Vector3;
use rayon::prelude::*;

/// The segments exempt from contact with one body, or with all of them.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Exemption {
    /// Exempt segments.
    pub exempt: usize,
    /// All segments of the simulated guides.
    pub segments: usize,
}

impl Exemption {
    /// Exempt segments as a share of all; 0 without segments.
    pub fn share(self) -> f64 {
        self.exempt as f64 / self.segments.max(1) as f64
    }
}

impl Simulation<'_> {
    /// The segments exempt from contact with each body.
    pub fn exemptions(&self) -> Vec<Exemption> {
        let bodies = self.env.bodies.len();
        let mut exemptions = vec![Exemption::default(); bodies];
        for (_, guide) in self.simulated() {
            for (of_all, [exempt, segments]) in exemptions.iter_mut().zip(guide.clearance.by_body()) {
                of_all.exempt += exempt;
                of_all.segments += segments;
            }
        }
        exemptions
    }

    /// Depth of the deepest point of an exempt segment inside the body that it is exempt from, m; 0 if none
    /// is inside. Roots do not count: they lie in the skin.
    pub fn exempt_depth(&self) -> f64 {
        if self.env.bodies.is_empty() {
            return 0.0;
        }
        let t = self.time();
        let poses = self.env.body_poses(t);
        let simulated: Vec<_> = self.simulated().collect();
        let depth = |&(i, guide): &(usize, &GuideState)| {
            guide.clearance.exempt_depth(&self.env.bodies, t, &poses, &self.polyline(i))
        };
        simulated.par_iter().map(depth).reduce(|| 0.0, f64::max)
    }

    /// The polyline in which guide `i` meets bodies, m, world, by its unknowns and its root: of a follower,
    /// the points of its state are those at which it last moved by itself.
    pub fn polyline(&self, i: usize) -> Vec<Vector3<f64>> {
        let model = &self.model.guides[i];
        let (rod, root) = (&model.rod, model.root(&self.env, self.time()));
        let (mut shape, mut polyline) = (RodShape::default(), Vec::new());
        shape.update(rod, &root.r, &self.state.guides[i].q[0]);
        with_midpoints(&rod.arc, |k| shape.x(k) + root.p, |k| shape.tangent(k), &mut polyline);
        polyline
    }

    /// The simulated guides, with their indices.
    fn simulated(&self) -> impl Iterator<Item = (usize, &GuideState)> {
        let simulated = self.state.guides.iter().enumerate().zip(&self.model.simulated);
        simulated.filter(|(_, simulated)| **simulated).map(|(guide, _)| guide)
    }
}
