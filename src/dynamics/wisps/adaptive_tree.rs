//! Which guides are active and which follow (`docs/theory.md` §8), decided at the ends of frames by
//! [`crate::dynamics::simulation`]: `make_followers` once, after the pre-roll; then, frame by frame,
//! `advance_modes`; level by level, coarse first, `place_and_split` and `record_level`; and `merge`.

use super::control_variate::LeaderMeans;
use super::follower::{FADE_TIME, Follower};
use super::follower_pack::{FollowerMut, FollowerPack, PlacementScratch};
use super::leader_motion::LeaderMotion;
use super::modal_correction::ModalCorrection;
use super::rest_shape::{RestShape, RestState};
use super::snapshot::EnvironmentSnapshot;
use crate::contact::ProximityCache;
use crate::dynamics::environment::Environment;
use crate::dynamics::guide::{GuideModel, GuideState};
use crate::math::lanes::MAX_LANES;
use crate::rod::pack::Pack;
use crate::scene::anim::GRAVITY;
use crate::wisp::{ForceApart, Hierarchy, NeighbourDrag};
use rayon::prelude::*;

/// Share of the split tolerance below which a guide may merge again.
const MERGE_SHARE: f64 = 0.5;

/// The guides of a groom in their wisp hierarchy: active ones, which are stepped, and followers, which move
/// as the mean of their leaders. Splits and merges happen at the ends of frames; followers have no state in
/// between.
pub(in crate::dynamics) struct AdaptiveTree {
    pub(super) motion: LeaderMotion,
    /// Estimated error at which a guide splits from its wisp, as a share of its length; `None` if none ever
    /// does.
    split_tolerance: Option<f64>,
    /// Guides that may follow, by level, packed for the SIMD lanes.
    packs: Vec<Vec<FollowerPack>>,
    pub(super) followers: Vec<Follower>,
    /// Proximity cache of each guide.
    caches: Vec<ProximityCache>,
    /// Unknowns of each follower at the end of the last frame, as [`GuideState::q`].
    previous_q: Vec<[Vec<f64>; 3]>,
}

/// Numbers of splits and merges at the end of a frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct WispChanges {
    /// Guides that split from their wisps.
    pub splits: u32,
    /// Guides that merged with their wisps.
    pub merges: u32,
}

/// What happens to an active guide with leaders at the end of a frame.
enum Decision {
    /// It is not calm: its calm period starts anew, while its leaders disagree so.
    RestartCalm(Vec<f64>),
    /// It becomes this follower.
    Merge(Follower),
}

impl AdaptiveTree {
    /// All guides active, until [`AdaptiveTree::make_followers`]. `h` is the sub-step, `frame` the time of a
    /// frame, s.
    pub fn new(hierarchy: Hierarchy, split_tolerance: Option<f64>, h: f64, frame: f64) -> Self {
        let guides = hierarchy.leaders.len();
        AdaptiveTree {
            motion: LeaderMotion::new(hierarchy, h, frame),
            split_tolerance,
            packs: Vec::new(),
            followers: vec![Follower::default(); guides],
            caches: vec![ProximityCache::default(); guides],
            previous_q: vec![Default::default(); guides],
        }
    }

    /// True if guide `i` is active.
    pub fn is_active(&self, i: usize) -> bool {
        !self.followers[i].follows
    }

    /// The active guide that guide `i` moves with: itself, or the nearest active one up the hierarchy.
    pub fn leader(&self, i: usize) -> usize {
        match self.motion.hierarchy.parent[i] {
            Some(parent) if !self.is_active(i) => self.leader(parent),
            _ => i,
        }
    }

    /// Level of the wisp that guide `i` moves with.
    pub fn level(&self, i: usize) -> u32 {
        self.motion.hierarchy.level[self.leader(i)]
    }

    /// Number of levels of the hierarchy.
    pub fn levels(&self) -> u32 {
        self.packs.len() as u32
    }

    /// True if guide `i`, or one that it would follow, has a tie or a load, or an animated goal has pulled it at any
    /// time before `t`, s: it must move by itself. Leaders that are held tell nothing of the motion of one that is not.
    fn is_held(&self, models: &[GuideModel], i: usize, t: f64) -> bool {
        let mut guides = self.motion.hierarchy.leaders[i].iter().map(|(leader, _)| *leader).chain([i]);
        guides.any(|guide| !models[guide].ties.is_empty() || models[guide].was_pulled(t))
    }

    /// Makes every guide with leaders a follower, except those that are held and those whose leaders are. The states at
    /// time `t`, s, are taken as the rest shapes.
    pub fn make_followers(
        &mut self,
        models: &[GuideModel],
        states: &[GuideState],
        env: &Environment,
        t: f64,
    ) {
        let now = EnvironmentSnapshot::new(env, t);
        let rest = |(model, state): (&GuideModel, &GuideState)| RestState {
            q: state.q[0].clone(),
            // A guide that is nearer to a body than required keeps the distance that it has.
            required_distances: now.distances(
                &model.rod,
                &now.root(model),
                &state.q[0],
                &state.required_distances(),
            ),
        };
        self.set_rest(models, models.par_iter().zip(states).map(rest).collect());
        let LeaderMotion { hierarchy, rest, h, .. } = &self.motion;
        self.motion.modal = ModalCorrection::new(models, hierarchy, rest, env, [t, *h]);
        for i in 0..models.len() {
            self.followers[i].follows =
                !self.motion.hierarchy.leaders[i].is_empty() && !self.is_held(models, i, t);
        }
    }

    /// Sets the rest shapes, and packs the guides that may follow.
    pub(super) fn set_rest(&mut self, models: &[GuideModel], states: Vec<RestState>) {
        let shape = |(state, model): (RestState, &GuideModel)| RestShape::new(&model.rod, state);
        self.motion.rest = states.into_par_iter().zip(models).map(shape).collect();
        let deepest = self.motion.hierarchy.level.iter().copied().max().unwrap_or(0);
        let packs_of = |level: u32| {
            let guides: Vec<usize> =
                (0..models.len()).filter(|i| self.motion.may_follow_at(level, *i)).collect();
            let alike = guides.chunk_by(|a, b| models[*a].rod.is_like(&models[*b].rod));
            let packs = alike.flat_map(|alike| alike.chunks(Pack::width()));
            packs.map(|guides| FollowerPack::new(guides, models)).collect()
        };
        self.packs = (0..=deepest).map(packs_of).collect();
    }

    /// Advances the modal responses through the frame from time `t[0]` to `t[1]`, s, before followers are
    /// placed. `hair` opposes what a guide moves relative to its leaders; `apart` are the forces that these do not
    /// have.
    pub fn advance_modes(
        &mut self,
        models: &[GuideModel],
        hair: impl Fn(usize) -> NeighbourDrag + Sync,
        apart: &[Vec<ForceApart>],
        env: &Environment,
        t: [f64; 2],
    ) {
        if self.packs.iter().all(Vec::is_empty) {
            // No guide has leaders.
            return;
        }
        let LeaderMotion { hierarchy, modal, h, .. } = &mut self.motion;
        modal.advance(models, hierarchy, &hair, env, t, *h);
        modal.move_apart(apart, hair, *h, ((t[1] - t[0]) / *h).round() as usize);
    }

    /// Places the followers of a level at the end of the frame from time `t[0]` to `t[1]`, s, and splits
    /// those whose estimated error exceeds the tolerance, and those that an animated goal begins to pull, or
    /// whose leaders it does: they become active, in their state at the start of the frame, where their error
    /// was within it. Returns these guides; the caller steps them through the frame.
    pub fn place_and_split(
        &mut self,
        level: u32,
        models: &[GuideModel],
        states: &mut [GuideState],
        env: &Environment,
        t: [f64; 2],
    ) -> Vec<usize> {
        self.place_followers(level, models, states, &EnvironmentSnapshot::new(env, t[1]));
        if self.split_tolerance.is_some() {
            self.update_active_variates(level);
        }
        let errs = |i: usize| {
            let error = || self.followers[i].relative_displacement + self.prediction_error(i);
            self.split_tolerance.is_some_and(|tolerance| error() + self.motion.apart(i) > tolerance)
        };
        let splits = |i: &usize| {
            self.motion.hierarchy.level[*i] == level
                && !self.is_active(*i)
                && (self.is_held(models, *i, t[1]) || errs(*i))
        };
        let split: Vec<usize> = (0..models.len()).into_par_iter().filter(splits).collect();
        for &i in &split {
            states[i].q.clone_from(&self.previous_q[i]);
            states[i].resume(&models[i], env, t[0], self.motion.h);
            let variate = self.followers[i].variate;
            let disagreement = self.motion.disagreement(i, variate.coefficient());
            self.followers[i] = Follower { since: t[1], variate, disagreement, ..Follower::default() };
        }
        split
    }

    /// Records the deflections of the guides of a level at the end of a frame, which those they lead follow.
    pub fn record_level(&mut self, level: u32, models: &[GuideModel], states: &[GuideState]) {
        self.motion.record_level(level, models, states);
    }

    /// Merges calm guides with their wisps at time `t`, s, once all levels are recorded; returns how many
    /// merge. A guide is calm if for [`FADE_TIME`] its error as a follower, counted from the start of that time,
    /// is small and it moves slowly relative to its leaders: by less than the tolerance in the time sqrt(L/g)
    /// of a pendulum of its length.
    pub fn merge(&mut self, models: &[GuideModel], states: &[GuideState], t: f64) -> u32 {
        let Some(tolerance) = self.split_tolerance else { return 0 };
        let decide = |i: usize| {
            let (model, state) = (&models[i], &states[i]);
            let leads = !self.is_active(i) || self.motion.hierarchy.leaders[i].is_empty();
            if leads || self.is_held(models, i, t) {
                return None;
            }
            let Follower { variate, disagreement, since, .. } = &self.followers[i];
            let nu = variate.coefficient();
            let now = self.motion.disagreement(i, nu);
            let speed = self.motion.relative_speed(i, nu, model, state);
            let slow = speed < tolerance * (GRAVITY / model.rod.length()).sqrt();
            if !slow || self.motion.prediction_error(i, &now, disagreement) > MERGE_SHARE * tolerance {
                return Some(Decision::RestartCalm(now));
            }
            let calm = t - since >= FADE_TIME - 0.5 * self.motion.h;
            calm.then(|| {
                let [offset, offset_rate] = self.motion.deviation(i, nu, model, state);
                let follower = Follower {
                    follows: true,
                    since: t,
                    offset,
                    offset_rate,
                    disagreement: now,
                    variate: *variate,
                    ..Follower::default()
                };
                Decision::Merge(follower)
            })
        };
        let decisions: Vec<Option<Decision>> = (0..models.len()).into_par_iter().map(decide).collect();
        let mut merges = 0;
        for (follower, decision) in self.followers.iter_mut().zip(decisions) {
            match decision {
                None => {}
                Some(Decision::RestartCalm(disagreement)) => {
                    (follower.since, follower.disagreement) = (t, disagreement);
                }
                Some(Decision::Merge(merged)) => {
                    *follower = merged;
                    merges += 1;
                }
            }
        }
        merges
    }

    /// Estimated error of follower `i` since it began to follow, as a share of its length, without the displacement
    /// that keeps it out of bodies.
    fn prediction_error(&self, i: usize) -> f64 {
        let Follower { variate, disagreement, .. } = &self.followers[i];
        let now = self.motion.disagreement(i, variate.coefficient());
        self.motion.prediction_error(i, &now, disagreement)
    }

    /// Updates the control variates (`docs/theory.md` eq. 8.5) of the active guides of a level.
    fn update_active_variates(&mut self, level: u32) {
        let AdaptiveTree { motion, followers, .. } = self;
        let active = followers
            .par_iter_mut()
            .enumerate()
            .filter(|(i, follower)| !follower.follows && motion.may_follow_at(level, *i));
        active.for_each_init(LeaderMeans::default, |means, (i, follower)| {
            motion.leader_means(i, means);
            motion.update_variate(i, means, &mut follower.variate);
        });
    }

    /// Places the followers of a level at the time of `now`.
    fn place_followers(
        &mut self,
        level: u32,
        models: &[GuideModel],
        states: &mut [GuideState],
        now: &EnvironmentSnapshot,
    ) {
        let AdaptiveTree { motion, packs, followers, caches, previous_q, .. } = self;
        let guides = models.iter().zip(states).zip(followers).zip(caches.iter_mut().zip(previous_q));
        let mut all: Vec<Option<FollowerMut>> = guides
            .map(|(((model, state), follower), (cache, previous_q))| {
                follower.follows.then_some(FollowerMut { model, state, follower, cache, previous_q })
            })
            .collect();
        let mut packs: Vec<(&FollowerPack, [Option<FollowerMut>; MAX_LANES])> =
            packs[level as usize].iter().map(|pack| (pack, pack.take(&mut all))).collect();
        packs.par_iter_mut().for_each_init(PlacementScratch::default, |scratch, (pack, followers)| {
            pack.place(motion, followers, now, scratch);
        });
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::contact::Bodies;
    use crate::dynamics::tie::Tie;
    use crate::rod::{Rod, RodSource};
    use crate::scene::Tree;
    use nalgebra::{Isometry3, Vector3};

    const FRAME: f64 = 1.0 / 24.0;
    const H: f64 = FRAME / 8.0;

    /// Two hairs of 16 cm that lead a third of half the length, on a head that is shaken.
    fn guides(env: &Environment) -> (AdaptiveTree, Vec<GuideModel>, Vec<GuideState>) {
        let model = |(i, length): (usize, f64)| {
            let root = Vector3::x() * (0.01 * i as f64);
            let tip = root + Vector3::new(0.3, -1.0, 0.0) * length;
            let rod = Rod::new(&RodSource::hair(&[root, tip], &Tree::default_arc(8))).unwrap();
            GuideModel::new(rod.clone(), vec![0.0; rod.points()], 0.3)
        };
        let models: Vec<GuideModel> = [0.16, 0.16, 0.08].into_iter().enumerate().map(model).collect();
        let states = models.iter().map(|model| GuideState::new(model, &[], env, 0.0, H)).collect();
        let hierarchy = Hierarchy {
            leaders: vec![vec![], vec![], vec![(0, 0.5), (1, 0.5)]],
            response_error: vec![0.0, 0.0, 0.5],
            level: vec![0, 0, 1],
            parent: vec![None, None, Some(0)],
        };
        (AdaptiveTree::new(hierarchy, Some(0.01), H, FRAME), models, states)
    }

    fn shaken<'a>() -> Environment<'a> {
        let head = |t: f64| Isometry3::translation(0.05 * (10.0 * t).sin(), 0.0, 0.0);
        Environment { head: Box::new(head), ..Environment::at_rest(Bodies::default()) }
    }

    #[test]
    fn a_follower_whose_modes_move_as_those_of_its_leaders_do_not_is_off_though_they_agree() {
        let env = shaken();
        let (mut tree, models, states) = guides(&env);
        tree.make_followers(&models, &states, &env, 0.0);
        tree.record_level(0, &models, &states);
        assert!(tree.followers[2].follows && tree.prediction_error(2) == 0.0);
        let none = |_| NeighbourDrag::default();
        for frame in 0..4 {
            let t = [frame, frame + 1].map(|frame| f64::from(frame) * FRAME);
            tree.advance_modes(&models, none, &vec![Vec::new(); 3], &env, t);
            // The leaders move alike: not at all.
            tree.record_level(0, &models, &states);
        }
        let modal = |i: usize| tree.motion.modal.deflection(i).strain(0).to_vec();
        let missing: Vec<f64> = modal(2).iter().zip(modal(0)).map(|(own, led)| own - led).collect();
        let strains = missing.chunks_exact(3).map(Vector3::from_column_slice);
        let off = tree.motion.rest[2].kinematics.mean_displacement(strains);
        assert!(off > 0.01 && (tree.prediction_error(2) / off - 1.0).abs() < 1e-9, "{off}");
    }

    #[test]
    fn what_is_tied_leads_none_that_is_not() {
        let env = shaken();
        for tied in [0, 2] {
            let (mut tree, mut models, states) = guides(&env);
            let tie = Tie::new(&models[tied].rod, 0, 0.5, Vector3::zeros());
            models[tied].ties.push(tie);
            tree.make_followers(&models, &states, &env, 0.0);
            assert!(tree.is_active(2), "{tied}");
        }
    }
}
