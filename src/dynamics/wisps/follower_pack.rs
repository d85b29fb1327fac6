//! Placement of followers: their strains are the weighted means of their leaders', corrected for modes and
//! bodies.

use super::control_variate::LeaderMeans;
use super::depenetration::{DepenetrationScratch, Target, depenetrate};
use super::follower::Follower;
use super::leader_motion::LeaderMotion;
use super::snapshot::EnvironmentSnapshot;
use crate::contact::ProximityCache;
use crate::dynamics::guide::{GuideModel, GuideState};
use crate::math::lanes::MAX_LANES;
use crate::rod::Rod;
use crate::rod::pack::{Pack, PackBuffers, PointsTask};
use nalgebra::Vector3;

/// Guides with equal numbers of unknowns that are placed in the SIMD lanes of one pack.
pub(super) struct FollowerPack {
    guides: Vec<usize>,
    pack: Pack,
}

/// A follower to be placed.
pub(super) struct FollowerMut<'a> {
    pub model: &'a GuideModel,
    pub state: &'a mut GuideState,
    pub follower: &'a mut Follower,
    pub cache: &'a mut ProximityCache,
    /// Receives the unknowns at the end of the last frame.
    pub previous_q: &'a mut [Vec<f64>; 3],
}

/// Buffers of one thread.
#[derive(Default)]
pub(super) struct PlacementScratch {
    means: LeaderMeans,
    correction: Vec<f64>,
    pack: PackBuffers,
    /// Points of the guides of a pack, m, world.
    points: [Vec<Vector3<f64>>; MAX_LANES],
    depenetration: DepenetrationScratch,
}

impl FollowerPack {
    /// Packs `guides`, at most as many as the pack is wide.
    pub fn new(guides: &[usize], models: &[GuideModel]) -> Self {
        let rods: Vec<&Rod> = guides.iter().map(|i| &models[*i].rod).collect();
        FollowerPack { guides: guides.to_vec(), pack: Pack::new(&rods) }
    }

    /// Takes the entries of this pack's guides from those of all.
    pub fn take<'a>(&self, all: &mut [Option<FollowerMut<'a>>]) -> [Option<FollowerMut<'a>>; MAX_LANES] {
        let mut taken = self.guides.iter().map(|i| all[*i].take());
        std::array::from_fn(|_| taken.next().flatten())
    }

    /// Places those of the pack's guides that follow, at the time of `now`.
    pub fn place(
        &self,
        motion: &LeaderMotion,
        followers: &mut [Option<FollowerMut>; MAX_LANES],
        now: &EnvironmentSnapshot,
        scratch: &mut PlacementScratch,
    ) {
        let PlacementScratch { means, correction, pack, points, depenetration } = scratch;
        for (i, follower) in self.guides.iter().zip(&mut *followers) {
            if let Some(follower) = follower {
                follower.predict(*i, motion, now.time(), means);
            }
        }
        let mut tasks = followers.iter().zip(&mut *points).map(|(follower, points)| {
            let FollowerMut { model, state, .. } = follower.as_ref()?;
            Some(PointsTask { root: now.root(model), q: &state.q[0], points })
        });
        let mut tasks = std::array::from_fn(|_| tasks.next().flatten());
        self.pack.evaluate_points(&mut tasks, pack);
        for ((i, follower), points) in self.guides.iter().zip(followers).zip(&*points) {
            if let Some(follower) = follower {
                follower.keep_out(*i, motion, points, now, correction, depenetration);
                follower.set_midway(motion);
            }
        }
    }
}

impl FollowerMut<'_> {
    /// Sets its unknowns to its leaders' prediction at time `t`, s, plus its own deviation.
    fn predict(&mut self, i: usize, motion: &LeaderMotion, t: f64, means: &mut LeaderMeans) {
        let FollowerMut { model, state, follower, previous_q, .. } = self;
        // The swapped-in unknowns are overwritten below.
        std::mem::swap(*previous_q, &mut state.q);
        motion.leader_means(i, means);
        motion.update_variate(i, means, &mut follower.variate);
        motion.add_modal_correction(i, follower.variate.coefficient(), means);
        for (back, q) in state.q.iter_mut().enumerate() {
            motion.rest[i].unknowns(&model.rod, means.deflection.strain(back), q);
            follower.add_deviation(t - back as f64 * motion.h, q);
        }
    }

    /// Corrects its unknowns so that it keeps out of the bodies; `points` are its points, m, world.
    fn keep_out(
        &mut self,
        i: usize,
        motion: &LeaderMotion,
        points: &[Vector3<f64>],
        now: &EnvironmentSnapshot,
        correction: &mut Vec<f64>,
        scratch: &mut DepenetrationScratch,
    ) {
        let FollowerMut { model, state, follower, cache, previous_q } = self;
        let (rod, q) = (&model.rod, &mut state.q);
        correction.clone_from(&follower.correction);
        let root = now.root(model);
        let target =
            Target { rod, root, rest: &motion.rest[i], q: &q[0], points, previous_q: &previous_q[0] };
        let displacement = depenetrate(now, &target, correction, cache, scratch);
        follower.relative_displacement = displacement.unwrap_or(0.0) / rod.length();
        if displacement.is_none() && follower.correction.is_empty() {
            return;
        }
        // Corrections are known at frames only; between frames they are interpolated.
        let at = |of: &[f64], n: usize| of.get(n).copied().unwrap_or(0.0);
        for (back, q) in q.iter_mut().enumerate() {
            let share = back as f64 * motion.h / motion.frame;
            let interpolated =
                |n: usize| at(correction, n) * (1.0 - share) + at(&follower.correction, n) * share;
            q.iter_mut().enumerate().for_each(|(n, q)| *q += interpolated(n));
        }
        std::mem::swap(&mut follower.correction, correction);
    }

    /// Sets its unknowns half-way through the frame to those of the cubic between its ends.
    fn set_midway(&mut self, motion: &LeaderMotion) {
        let ([end, before_end, _], [start, before_start, _]) = (&self.state.q, &*self.previous_q);
        // An eighth of the frame times the difference of the rates over the last sub-steps.
        let share = motion.frame / (8.0 * motion.h);
        for (n, midway) in self.state.midway.iter_mut().enumerate() {
            let bend = (start[n] - before_start[n]) - (end[n] - before_end[n]);
            *midway = 0.5 * (start[n] + end[n]) + share * bend;
        }
    }
}
