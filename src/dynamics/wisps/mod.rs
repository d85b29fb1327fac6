//! Wisps in motion: which guides move by themselves, and which follow those that lead them (`docs/theory.md` §8; Bertails, Kim, Cani & Neumann
//! 2003).

mod keep_out;
mod modal_correction;
mod rest;

use super::checkpoint::StateMismatch;
use super::environment::Environment;
use super::guide::{GuideModel, GuideState};
use super::integrator::backward_difference;
use crate::contact::ProximityCache;
use crate::math::lanes::MAX_LANES;
use crate::rod::Rod;
use crate::rod::pack::{Pack, PackBuffers, PointsTask};
use crate::wisp::{Deflection, Hierarchy};
use keep_out::Moment;
use modal_correction::{Agreement, ModalCorrection};
use nalgebra::Vector3;
use rayon::prelude::*;
use rest::{Rest, Settled};
use serde::{Deserialize, Serialize};

/// Time in which the motion that a guide has of its own when it begins to follow fades, and for which it is calm before, s.
const FADING: f64 = 0.25;

/// Share of what a guide may be off at which it comes away from its wisps, below which it may join again.
const CALM: f64 = 0.5;

const G: f64 = 9.81;

/// The guides of a groom as wisps: those that lead, and those that follow them as far as they have not come away. All that is decided is at the ends of
/// frames; what follows has no state in between.
pub(super) struct Wisps {
    hierarchy: Hierarchy,
    /// The share of its length by which a guide may be off, about, before it comes away from its wisps; `None` where none does.
    parting: Option<f64>,
    /// Length of a sub-step, and of a frame, s.
    h: f64,
    frame: f64,
    /// How each guide rests; none before wisps are gathered.
    rest: Vec<Rest>,
    /// All guides that may follow, by level.
    files: Vec<Vec<File>>,
    followers: Vec<Follower>,
    /// Where each guide that follows was last seen outside of bodies.
    memory: Vec<ProximityCache>,
    /// Unknowns of each guide that follows at the end of the last frame, as [`GuideState::q`].
    earlier: Vec<[Vec<f64>; 3]>,
    /// Which guides lead others, and their deflections at the end of the last frame.
    leads: Vec<bool>,
    deflections: Vec<Deflection>,
    /// How all of them would swing; none before wisps are gathered.
    swings: ModalCorrection,
}

/// Guides that are placed at once where they follow.
struct File {
    guides: Vec<usize>,
    pack: Pack,
}

/// What changes of a guide beside its motion.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
struct Follower {
    /// Whether it follows its leaders.
    follows: bool,
    /// Since when it does, s; where it does not, since when it has been calm.
    since: f64,
    /// Where it follows: by how much it lies otherwise beside its leaders than it did at rest, 1/m, and how fast it came to, 1/(m·s).
    offset: Vec<f64>,
    drift: Vec<f64>,
    /// What kept it out of bodies at the end of the last frame, 1/m; empty where nothing had to.
    out: Vec<f64>,
    /// How far that moved it on average, as a share of its length; infinite where it did not come out.
    #[serde(skip)]
    off: f64,
    /// How much the swings of its leaders tell.
    agreement: Agreement,
}

impl Follower {
    /// Adds what it has of its own at time `t`, s. Its drift does not break off.
    fn add_own(&self, t: f64, q: &mut [f64]) {
        let since = t - self.since;
        let u = (since / FADING).clamp(0.0, 1.0);
        let left = since * (1.0 - u * u * u * (10.0 - 15.0 * u + 6.0 * u * u));
        let own = self.offset.iter().zip(&self.drift);
        q.iter_mut().zip(own).for_each(|(q, (offset, drift))| *q += offset + left * drift);
    }
}

/// What a sub-step did to the wisps.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Changes {
    /// Guides that came away from their wisps.
    pub splits: u32,
    /// Guides that joined theirs.
    pub merges: u32,
}

/// Three moments: now, and one and two sub-steps ago.
const BACK: [usize; Deflection::MOMENTS] = [0, 1, 2];

/// The vector of each node.
fn vectors(numbers: &[f64]) -> impl Iterator<Item = Vector3<f64>> {
    numbers.chunks_exact(3).map(Vector3::from_column_slice)
}

/// Workspace of a thread in which guides follow.
#[derive(Default)]
struct Workspace {
    means: Means,
    out: Vec<f64>,
    pack: PackBuffers,
    /// Places of the guides of a file, m, world.
    places: [Vec<Vector3<f64>>; MAX_LANES],
    keep_out: keep_out::Work,
}

/// Weighted means over the leaders of a guide.
#[derive(Default)]
struct Means {
    /// Of their deflections.
    deflection: Deflection,
    /// Of their modal responses.
    modal: Deflection,
}

/// A guide that follows.
struct Led<'a> {
    model: &'a GuideModel,
    state: &'a mut GuideState,
    follower: &'a mut Follower,
    /// Where it was last seen outside of bodies.
    memory: &'a mut ProximityCache,
    earlier: &'a mut [Vec<f64>; 3],
}

/// What is to become of a guide that moves by itself.
enum Change {
    /// It is not calm enough to follow.
    Wait,
    /// It follows.
    Merge(Follower),
}

impl Wisps {
    /// Every guide by itself, until [`Wisps::gather`]. `h` is the sub-step, `frame` the frame, s.
    pub fn new(hierarchy: Hierarchy, parting: Option<f64>, h: f64, frame: f64) -> Self {
        let guides = hierarchy.leaders.len();
        let mut leads = vec![false; guides];
        hierarchy.leaders.iter().flatten().for_each(|(leader, _)| leads[*leader] = true);
        Wisps {
            hierarchy,
            leads,
            deflections: vec![Deflection::default(); guides],
            parting,
            h,
            frame,
            rest: Vec::new(),
            files: Vec::new(),
            followers: vec![Follower::default(); guides],
            memory: vec![ProximityCache::default(); guides],
            earlier: vec![Default::default(); guides],
            swings: ModalCorrection::default(),
        }
    }

    /// Whether guide `i` moves by itself.
    pub fn is_active(&self, i: usize) -> bool {
        !self.followers[i].follows
    }

    /// The guide that stands for what guide `i` moves with, and moves by itself: that, or that of a wisp around its own.
    pub fn leader(&self, i: usize) -> usize {
        match self.hierarchy.parent[i] {
            Some(env) if !self.is_active(i) => self.leader(env),
            _ => i,
        }
    }

    /// Level of the wisp that guide `i` moves with.
    pub fn level(&self, i: usize) -> u32 {
        self.hierarchy.level[self.leader(i)]
    }

    /// Lets all guides that something leads follow; how each of `guides` is at time `t`, s, beside the others, is how it rests. What a tie holds moves by
    /// itself.
    pub fn gather(&mut self, models: &[GuideModel], states: &[GuideState], env: &Environment, t: f64) {
        let now = Moment::new(env, t);
        let settled = |(model, state): (&GuideModel, &GuideState)| Settled {
            q: state.q[0].clone(),
            // What lies nearer to a body than it should is not to start.
            kept: now.distances(&model.rod, &state.q[0], &state.required_distances()),
        };
        self.settle(models, models.par_iter().zip(states).map(settled).collect());
        self.swings = ModalCorrection::new(models, &self.rest, env, t, self.h);
        for (i, follower) in self.followers.iter_mut().enumerate() {
            follower.follows = !self.hierarchy.leaders[i].is_empty() && models[i].ties.is_empty();
        }
    }

    fn settle(&mut self, models: &[GuideModel], settled: Vec<Settled>) {
        self.rest = settled.into_par_iter().zip(models).map(|(s, model)| Rest::new(&model.rod, s)).collect();
        let deepest = self.hierarchy.level.iter().copied().max().unwrap_or(0);
        let file = |members: &[usize]| {
            let rods: Vec<&Rod> = members.iter().map(|i| &models[*i].rod).collect();
            File { guides: members.to_vec(), pack: Pack::new(&rods) }
        };
        let of_level = |level: u32| {
            let led = |i: &usize| self.hierarchy.level[*i] == level && !self.hierarchy.leaders[*i].is_empty();
            let led: Vec<usize> = (0..models.len()).filter(led).collect();
            let alike = led.chunk_by(|a, b| models[*a].rod.unknowns() == models[*b].rod.unknowns());
            alike.flat_map(|alike| alike.chunks(Pack::width())).map(file).collect()
        };
        self.files = (0..=deepest).map(of_level).collect();
    }

    /// Levels of the hierarchy.
    pub fn levels(&self) -> u32 {
        self.files.len() as u32
    }

    /// ModalCorrection all guides through the frame from time `t[0]` to `t[1]`, s, before they are led.
    pub fn advance_modes(&mut self, env: &Environment, t: [f64; 2]) {
        self.swings.advance(env, t, self.h);
    }

    /// Learns how much swings tell of the guides of a level that move by themselves.
    fn learn(&mut self, level: u32) {
        let mut followers = std::mem::take(&mut self.followers);
        let free = followers.par_iter_mut().enumerate().filter(|(i, follower)| {
            !follower.follows && self.hierarchy.level[*i] == level && !self.hierarchy.leaders[*i].is_empty()
        });
        free.for_each_init(Means::default, |means, (i, follower)| {
            self.average(i, means);
            self.ask(i, means, &mut follower.agreement);
        });
        self.followers = followers;
    }

    /// Asks the leaders of guide `i`, whose means are given, how much their swings tell.
    fn ask(&self, i: usize, means: &Means, agreement: &mut Agreement) {
        let leader =
            |(j, share): &(usize, f64)| (share.abs(), &self.deflections[*j], self.swings.deflection(*j));
        let leaders = self.hierarchy.leaders[i].iter().map(leader);
        agreement.learn(self.frame, leaders, self.swings.deflection(i), means);
    }

    /// Moves what follows of a level to where it is at the end of the frame from time `t[0]` to `t[1]`, s. What comes away there does so at the frame's start,
    /// where it still followed well: it is put back there, to be taken through the frame by itself. Returns which guides do.
    pub fn lead(
        &mut self,
        level: u32,
        models: &[GuideModel],
        states: &mut [GuideState],
        env: &Environment,
        t: [f64; 2],
    ) -> Vec<usize> {
        self.place_all(level, models, states, &Moment::new(env, t[1]));
        let Some(parting) = self.parting else { return Vec::new() };
        self.learn(level);
        let parts = |i: &usize| {
            self.hierarchy.level[*i] == level
                && !self.is_active(*i)
                && self.followers[*i].off + self.missed(*i) > parting
        };
        let away: Vec<usize> = (0..models.len()).into_par_iter().filter(parts).collect();
        for &i in &away {
            states[i].q.clone_from(&self.earlier[i]);
            states[i].resume(&models[i], env, t[0], self.h);
            let agreement = self.followers[i].agreement;
            self.followers[i] = Follower { since: t[1], agreement, ..Follower::default() };
        }
        away
    }

    /// Notes how what leads others is turned, of a level.
    pub fn record_level(&mut self, level: u32, models: &[GuideModel], states: &[GuideState]) {
        let leading = self.deflections.par_iter_mut().zip(states).enumerate();
        leading
            .filter(|(i, _)| self.hierarchy.level[*i] == level && self.leads[*i])
            .for_each(|(i, (deflection, state))| self.rest[i].deflection(&models[i].rod, state, deflection));
    }

    /// Lets guides that move by themselves follow, at time `t`, s, once all levels are noted; returns how many begin to.
    pub fn merge(&mut self, models: &[GuideModel], states: &[GuideState], t: f64) -> u32 {
        let Some(parting) = self.parting else { return 0 };
        let change = |i: usize| {
            if !self.is_active(i) || self.hierarchy.leaders[i].is_empty() || !models[i].ties.is_empty() {
                return None;
            }
            let still = self.speed(i, &models[i], &states[i]) < parting * (G / models[i].rod.length()).sqrt();
            if !still || self.missed(i) > CALM * parting {
                return Some(Change::Wait);
            }
            let rested = t - self.followers[i].since >= FADING - 0.5 * self.h;
            rested.then(|| Change::Merge(self.joined(i, &models[i], &states[i], t)))
        };
        let changes: Vec<Option<Change>> = (0..models.len()).into_par_iter().map(change).collect();
        let mut merges = 0;
        for (follower, change) in self.followers.iter_mut().zip(changes) {
            match change {
                None => {}
                Some(Change::Wait) => follower.since = t,
                Some(Change::Merge(joined)) => {
                    *follower = joined;
                    merges += 1;
                }
            }
        }
        merges
    }

    /// Moves what follows of a level to where it is `now`.
    fn place_all(&mut self, level: u32, models: &[GuideModel], states: &mut [GuideState], now: &Moment) {
        let (mut followers, mut memory, mut earlier) = (
            std::mem::take(&mut self.followers),
            std::mem::take(&mut self.memory),
            std::mem::take(&mut self.earlier),
        );
        let guides = models.iter().zip(states);
        let of_all = guides.zip(&mut followers).zip(memory.iter_mut().zip(&mut earlier));
        let mut of_all: Vec<Option<Led>> = of_all
            .map(|(((model, state), follower), (memory, earlier))| {
                follower.follows.then_some(Led { model, state, follower, memory, earlier })
            })
            .collect();
        let mut of_files: Vec<(&File, [Option<Led>; MAX_LANES])> = self.files[level as usize]
            .iter()
            .map(|file| {
                let mut led = file.guides.iter().map(|i| of_all[*i].take());
                (file, std::array::from_fn(|_| led.next().flatten()))
            })
            .collect();
        of_files.par_iter_mut().for_each_init(Workspace::default, |work, (file, led)| {
            self.place(file, led, now, work);
        });
        (self.followers, self.memory, self.earlier) = (followers, memory, earlier);
    }

    /// Moves the guides of a file that follow to where they are led.
    fn place(&self, file: &File, led: &mut [Option<Led>; MAX_LANES], now: &Moment, work: &mut Workspace) {
        for (i, led) in file.guides.iter().zip(&mut *led) {
            let Some(Led { model, state, follower, earlier, .. }) = led else { continue };
            // All of it is set anew.
            std::mem::swap(*earlier, &mut state.q);
            self.average(*i, &mut work.means);
            self.ask(*i, &work.means, &mut follower.agreement);
            self.swing_on(*i, follower.agreement.share(), &mut work.means);
            for (back, q) in state.q.iter_mut().enumerate() {
                self.rest[*i].unknowns(&model.rod, work.means.deflection.strain(back), q);
                follower.add_own(now.time() - back as f64 * self.h, q);
            }
        }
        let mut bent = led.iter().zip(&mut work.places).map(|(led, places)| {
            let Led { model, state, .. } = led.as_ref()?;
            Some(PointsTask { root: now.root(&model.rod), q: &state.q[0], points: places })
        });
        let mut bent = std::array::from_fn(|_| bent.next().flatten());
        file.pack.evaluate_points(&mut bent, &mut work.pack);
        let places = std::mem::take(&mut work.places);
        for ((i, led), places) in file.guides.iter().zip(led).zip(&places) {
            let Some(led) = led else { continue };
            self.keep_out(&self.rest[*i], led, places, now, work);
        }
        work.places = places;
    }

    /// Brings a guide that is `rest` at rest out of bodies, its places being those given, m, world.
    fn keep_out(
        &self,
        rest: &Rest,
        Led { model, state, follower, memory, earlier }: &mut Led,
        places: &[Vector3<f64>],
        now: &Moment,
        work: &mut Workspace,
    ) {
        let Workspace { out, keep_out, .. } = work;
        let (rod, q) = (&model.rod, &mut state.q);
        out.clone_from(&follower.out);
        let led = keep_out::Led { rod, rest, q: &q[0], places, before: &earlier[0] };
        let way = now.bring_out(&led, out, memory, keep_out);
        follower.off = way.unwrap_or(0.0) / rod.length();
        if way.is_none() && follower.out.is_empty() {
            return;
        }
        // What bodies do to it is known at frames only: between them it goes evenly.
        let at = |of: &[f64], n: usize| of.get(n).copied().unwrap_or(0.0);
        for (back, q) in q.iter_mut().enumerate() {
            let share = back as f64 * self.h / self.frame;
            let kept = |n: usize| at(out, n) * (1.0 - share) + at(&follower.out, n) * share;
            q.iter_mut().enumerate().for_each(|(n, q)| *q += kept(n));
        }
        std::mem::swap(&mut follower.out, out);
    }

    /// Sets `means` to those of the leaders of guide `i`.
    fn average(&self, i: usize, Means { deflection, modal }: &mut Means) {
        let own = self.swings.deflection(i);
        deflection.reset_like(own);
        modal.reset_like(own);
        for (leader, share) in &self.hierarchy.leaders[i] {
            deflection.add_scaled(*share, &self.deflections[*leader]);
            modal.add_scaled(*share, self.swings.deflection(*leader));
        }
    }

    /// Adds `nu` times by how much guide `i` swings otherwise than its leaders.
    fn swing_on(&self, i: usize, nu: f64, Means { deflection, modal }: &mut Means) {
        deflection.add_scaled_difference(nu, self.swings.deflection(i), modal);
    }

    /// How guide `i` is and was led to be turned.
    fn led(&self, i: usize) -> Deflection {
        let mut means = Means::default();
        self.average(i, &mut means);
        self.swing_on(i, self.followers[i].agreement.share(), &mut means);
        means.deflection
    }

    /// Speed of guide `i`, which moves by itself, as seen from where its leaders would move it, as a share of its length, 1/s.
    fn speed(&self, i: usize, model: &GuideModel, state: &GuideState) -> f64 {
        let (led, mut own) = (self.led(i), Deflection::default());
        self.rest[i].deflection(&model.rod, state, &mut own);
        let rate = |n: usize| {
            backward_difference(BACK.map(|back| own.strain(back)[n] - led.strain(back)[n]), self.h)
        };
        let rates: Vec<f64> = (0..led.strain(0).len()).map(rate).collect();
        self.rest[i].reach.mean_displacement(vectors(&rates))
    }

    /// What guide `i` is when it begins to follow at time `t`, s.
    fn joined(&self, i: usize, model: &GuideModel, state: &GuideState, t: f64) -> Follower {
        let deflection = self.led(i);
        let led = BACK.map(|back| {
            let mut q = Vec::new();
            self.rest[i].unknowns(&model.rod, deflection.strain(back), &mut q);
            q
        });
        let own = |n: usize| BACK.map(|back| state.q[back][n] - led[back][n]);
        let n = 0..led[0].len();
        Follower {
            follows: true,
            since: t,
            offset: n.clone().map(|n| own(n)[0]).collect(),
            drift: n.map(|n| backward_difference(own(n), self.h)).collect(),
            agreement: self.followers[i].agreement,
            ..Follower::default()
        }
    }

    /// By how much of its length guide `i` may be off: by how much it is elsewhere for one of its leaders than for all, but for how they swing, as the root mean square by their
    /// shares, times the share of its answers that they miss. Of a single one nothing tells by how much others would differ: that may be all of its way
    /// from rest.
    fn missed(&self, i: usize) -> f64 {
        self.hierarchy.response_error[i] * self.spread(i)
    }

    fn spread(&self, i: usize) -> f64 {
        let mut means = Means::default();
        self.average(i, &mut means);
        let reach = &self.rest[i].reach;
        if self.hierarchy.leaders[i].len() == 1 {
            return reach.mean_displacement(means.deflection.strain_vectors(0));
        }
        let nu = self.followers[i].agreement.share();
        let square = |&(leader, share): &(usize, f64)| {
            let difference = |of: &Deflection, mean: &Deflection| {
                let vectors = of.strain_vectors(0).zip(mean.strain_vectors(0));
                vectors.map(|(of, mean)| of - mean).collect::<Vec<_>>()
            };
            let own = difference(&self.deflections[leader], &means.deflection);
            let modal = difference(self.swings.deflection(leader), &means.modal);
            let way = reach.mean_displacement(own.iter().zip(&modal).map(|(own, modal)| own - nu * modal));
            share.abs() * way * way
        };
        self.hierarchy.leaders[i].iter().map(square).sum::<f64>().sqrt()
    }
}

/// What a checkpoint holds of wisps.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub(super) struct WispsState {
    rest: Vec<Settled>,
    followers: Vec<Follower>,
    swings: modal_correction::Saved,
}

impl Wisps {
    /// What changes.
    pub fn state(&self) -> WispsState {
        WispsState {
            rest: self.rest.iter().map(|r| r.settled.clone()).collect(),
            followers: self.followers.clone(),
            swings: self.swings.state(),
        }
    }

    /// Goes back to a state of the same `guides`.
    pub fn restore(
        &mut self,
        state: WispsState,
        models: &[GuideModel],
        states: &[GuideState],
    ) -> Result<(), StateMismatch> {
        StateMismatch::unless_same("followers", state.followers.len(), models.len())?;
        self.followers = state.followers;
        self.rest.clear();
        if !state.rest.is_empty() {
            StateMismatch::unless_same("guides at rest", state.rest.len(), models.len())?;
            for ((rest, model), guide) in state.rest.iter().zip(models).zip(states) {
                StateMismatch::unless_same("unknowns at rest", rest.q.len(), model.rod.unknowns())?;
                StateMismatch::unless_same(
                    "distances kept",
                    rest.kept.len(),
                    guide.required_distances().len(),
                )?;
            }
            self.settle(models, state.rest);
        }
        self.swings = ModalCorrection::restored(state.swings, models, &self.rest)?;
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_joins_goes_on_as_it_went_until_it_has_faded() {
        let (offset, drift) = (vec![0.1], vec![2.0]);
        let joined = Follower { follows: true, since: 1.0, offset, drift, ..Follower::default() };
        let own = |t: f64| {
            let mut q = [0.0];
            joined.add_own(t, &mut q);
            q[0]
        };
        let rate = |t: f64| (own(t + 1e-6) - own(t)) / 1e-6;
        assert_eq!(own(1.0), 0.1);
        assert!((rate(1.0) - 2.0).abs() < 1e-4, "{}", rate(1.0));
        assert_eq!((own(1.0 + FADING), rate(1.0 + FADING)), (0.1, 0.0));
        let most = (0..=1000).map(|k| (rate(1.0 + FADING * f64::from(k) / 1000.0)).abs()).fold(0.0, f64::max);
        assert!(most < 2.01, "{most}");
    }
}
