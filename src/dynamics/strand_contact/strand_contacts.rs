//! The coupled solve of one sub-step.

use super::contact_law::BundleProperties;
use super::contact_pair::ContactPair;
use super::contact_pairs::ContactPairs;
use super::coupled_guide::{CoupledGuide, EndState};
use super::given_motion::GivenMotion;
use super::island::{DisjointSets, Island};
use super::reactions::Reactions;
use crate::dynamics::environment::Environment;
use crate::dynamics::guide::{GuideModel, GuideState};
use crate::dynamics::step_record::StepRecord;
use crate::rod::RodShape;
use nalgebra::{Isometry3, UnitQuaternion, Vector3};
use rayon::prelude::*;
use std::collections::BTreeSet;

/// Most rounds of solving, moving and detecting in one sub-step.
const MAX_ROUNDS: u32 = 16;

/// Displacement of a point by which a guide may close contacts in its first round, m.
const FIRST_DISPLACEMENT: f64 = 1.5e-4;

/// Number of displacements like that of the last round by which a guide may close contacts in the next.
const FORESEEN_ROUNDS: f64 = 2.0;

/// Contact between the active guides of a simulation, each with the hairs of its followers.
#[derive(Debug)]
pub(in crate::dynamics) struct StrandContacts {
    /// Each guide with its own hairs only.
    pub(super) own_bundles: Vec<BundleProperties>,
    /// The active guides, ascending.
    pub(super) active: Vec<usize>,
    pub(super) pairs: ContactPairs,
    pub(super) guides: Vec<CoupledGuide>,
    /// Guides that others, or they themselves, pushed in the sub-step before. They are coupled from the start:
    /// uncoupled, they would fall through what supports them.
    pub(super) pushed: Vec<bool>,
    /// Motions of guides that have taken a part of a sub-step that others take again.
    pub(super) given: Vec<Option<GivenMotion>>,
    /// Pairs of a free guide and one with a given motion that it pushed or crossed in the part just taken.
    pub(super) touched: Vec<[usize; 2]>,
}

impl StrandContacts {
    /// Guides with these bundles; none is active before [`StrandContacts::rebuild`].
    pub fn new(own_bundles: Vec<BundleProperties>) -> Self {
        StrandContacts {
            active: Vec::new(),
            guides: own_bundles.iter().map(|_| CoupledGuide::new()).collect(),
            pushed: vec![false; own_bundles.len()],
            given: vec![None; own_bundles.len()],
            touched: Vec::new(),
            pairs: ContactPairs::new(&[], Vec::new()),
            own_bundles,
        }
    }

    /// Kinetic energy of the active guides, J, and that which they would have at `speed`, m/s; each guide
    /// counts as its bundle.
    pub fn kinetic_energy(&self, models: &[GuideModel], states: &[GuideState], speed: f64) -> [f64; 2] {
        let of = |&g: &usize| {
            let (mass, hairs) = (&models[g].rod.mass, self.pairs.bundles[g].hairs);
            let twice =
                |square: &dyn Fn(usize) -> f64| mass.iter().enumerate().map(|(k, m)| m * square(k)).sum();
            let energies: [f64; 2] = [twice(&|k| states[g].v[k].norm_squared()), twice(&|_| speed * speed)];
            energies.map(|e| 0.5 * hairs * e)
        };
        self.active.iter().map(of).fold([0.0; 2], |sum, e| [sum[0] + e[0], sum[1] + e[1]])
    }

    /// Sets the active guides from time `t`, s, on, and their curves there; `leader` maps each guide to the
    /// active guide that it moves with. The history of contacts between guides that remain active is kept.
    pub fn rebuild(
        &mut self,
        models: &[GuideModel],
        states: &[GuideState],
        leader: impl Fn(usize) -> usize,
        env: &Environment,
        t: f64,
    ) {
        let mut bundles = self.own_bundles.clone();
        let mut arc: Vec<&[f64]> = vec![&[]; models.len()];
        self.active.clear();
        for (g, model) in models.iter().enumerate() {
            let leader = leader(g);
            if leader == g {
                arc[g] = &model.rod.arc;
                self.active.push(g);
            } else {
                bundles[leader].add(&self.own_bundles[g]);
                self.pushed[g] = false;
            }
        }
        self.pairs.rebuild(&arc, bundles);
        self.active.iter().filter(|g| models[**g].rod.is_free()).for_each(|g| self.pairs.free_root(*g));
        self.pairs.roots = models.iter().map(|model| model.rod.root.p).collect();
        self.pairs.drawn = drawn_curves(models, &self.active);
        self.pairs.x[0] = head_frame_curves(models, states, &self.active, env, t);
    }

    /// The active guides, ascending.
    pub fn active(&self) -> &[usize] {
        &self.active
    }

    /// Resolves the contacts of the sub-step from `t[0]` to `t[1]`, s, which each free guide has just taken
    /// uncoupled. If the caller `may_divide` it for guides that fail, these are left as they are. Ends early, wherever
    /// the guides are then, once the sub-step is to be abandoned.
    pub fn resolve(
        &mut self,
        models: &[GuideModel],
        states: &mut [GuideState],
        env: &Environment,
        (t, may_divide): ([f64; 2], bool),
        records: &mut [StepRecord],
    ) {
        let head = (env.head)(t[1]).inverse();
        let to_world = head.rotation.inverse();
        self.pairs.x[1] = head_frame_curves(models, states, &self.active, env, t[1]);
        self.place_given(t);
        let StrandContacts { pairs, given, .. } = self;
        pairs.begin(t[1] - t[0], |g| given[g].is_none());
        for ((guide, record), given) in self.guides.iter_mut().zip(&*records).zip(&self.given) {
            guide.begin(record.unconverged == 0 && given.is_none());
        }
        for round in 1..=MAX_ROUNDS {
            if env.interrupt.is_asked_for() {
                return;
            }
            let mut islands = self.couple_islands(models, states, env, t);
            islands.retain(|island| island.guides.iter().any(|&g| self.guides[g].needs_round));
            if islands.is_empty() {
                break;
            }
            self.solve(models, states, env, &islands, &to_world, round == MAX_ROUNDS);
            self.advance(models, states, env, &islands, &head);
            self.detect(&islands);
            if may_divide {
                self.give_up(states, &islands);
            }
        }
        self.touched = self.touching_given();
        // What fails again and again is not a reason to divide.
        if !may_divide || self.failing().any(|g| states[g].stuck) {
            self.apply_fallbacks(models, states, env, t);
            self.touched.extend(self.touching_given());
        }
        self.record(models, states, env, records);
        self.finish(models, states, env, t);
    }

    /// Whether a contact may have a reaction in the next round: one that has, or pulls, or that its guides may
    /// come to violate. Another that they violate nevertheless takes part in the round after.
    fn may_act(&self, pair: &ContactPair) -> bool {
        let closes = |g: usize| match &self.guides[g] {
            guide if guide.rounds == 0 => FIRST_DISPLACEMENT,
            guide => FORESEEN_ROUNDS * guide.displacement,
        };
        let [a, b] = self.pairs.guides(&pair.contact);
        pair.is_active() || pair.cohesion > 0.0 || pair.gap() < closes(a) + closes(b)
    }

    /// Couples all guides connected, over contacts that may act, with a guide that is in a violated or cohesive contact,
    /// was pushed before, or is already coupled; returns their islands. Guides whose uncoupled step did not
    /// converge, and those given up, stay where they are.
    fn couple_islands(
        &mut self,
        models: &[GuideModel],
        states: &mut [GuideState],
        env: &Environment,
        t: [f64; 2],
    ) -> Vec<Island> {
        let joins = |g: usize| self.guides[g].converged && !self.guides[g].given_up;
        let mut sets = DisjointSets::new(models.len());
        let mut wanted = self.pushed.clone();
        let acting: Vec<bool> = self.pairs.contacts.iter().map(|pair| self.may_act(pair)).collect();
        for (pair, acts) in self.pairs.contacts.iter().zip(&acting) {
            let [a, b] = self.pairs.guides(&pair.contact);
            if *acts && joins(a) && joins(b) {
                sets.unite(a, b);
            }
            if pair.needs_coupling() {
                wanted[a] = true;
                wanted[b] = true;
            }
        }
        let wanted = (0..models.len()).filter(|&g| joins(g) && (wanted[g] || self.guides[g].is_coupled));
        let (mut islands, island_of) = Island::from_sets(sets, models.len(), wanted);
        self.guides.iter_mut().for_each(|guide| guide.sides.clear());
        let may_act = self.pairs.contacts.iter().enumerate().filter(|(i, _)| acting[*i]);
        for (i, pair) in may_act {
            for (side, g) in self.pairs.guides(&pair.contact).into_iter().enumerate() {
                let Some(island) = island_of[g] else { continue };
                if islands[island].contacts.last() != Some(&i) {
                    islands[island].contacts.push(i);
                }
                self.guides[g].sides.push((i, side));
            }
        }
        let all = self.guides.par_iter_mut().zip(models).zip(states).zip(&island_of);
        all.filter(|(((guide, _), _), island)| island.is_some() && !guide.is_coupled)
            .for_each(|(((guide, model), state), _)| guide.couple(model, state, env, t));
        islands
    }

    /// Linearises the guides of the islands, solves for the reactions of all their contacts, and adds their effect to the
    /// solvers' directions. No round after the `last` one corrects what it leaves.
    fn solve(
        &mut self,
        models: &[GuideModel],
        states: &mut [GuideState],
        env: &Environment,
        islands: &[Island],
        to_world: &UnitQuaternion<f64>,
        last: bool,
    ) {
        let StrandContacts { guides, pairs, .. } = self;
        island_guides(guides, models, states, islands)
            .for_each(|(guide, model, state)| guide.linearise(model, state, env, pairs, to_world));
        let reactions: Vec<_> = islands
            .par_iter()
            .map(|island| Reactions::solve(island, models, guides, pairs, to_world, last, &env.interrupt))
            .collect();
        for (island, Reactions { pushes, forces, outcome, provisional }) in islands.iter().zip(&reactions) {
            let (mut pushes, mut forces) = (&pushes[..], &forces[..]);
            for &g in &island.guides {
                let guide = &mut guides[g];
                let direction = &mut guide.scratch.solver.direction;
                let (push, next_pushes) = pushes.split_at(direction.len());
                direction.iter_mut().zip(push).for_each(|(d, w)| *d += w);
                let body_contact = &mut guide.scratch.contact;
                let (body_forces, next_forces) = forces.split_at(3 * body_contact.problem.friction.len());
                body_contact.reactions.forces.clear();
                body_contact.reactions.forces.extend_from_slice(body_forces);
                guide.residual = outcome.residual;
                guide.provisional = *provisional;
                guide.rounds += 1;
                (pushes, forces) = (next_pushes, next_forces);
            }
            for (&i, r) in island.contacts.iter().zip(forces.chunks_exact(3)) {
                pairs.set_reaction(i, r, to_world);
            }
        }
    }

    /// Moves the guides of the islands along their directions, and finds the candidates of those that have moved far.
    fn advance(
        &mut self,
        models: &[GuideModel],
        states: &mut [GuideState],
        env: &Environment,
        islands: &[Island],
        head: &Isometry3<f64>,
    ) {
        let to_world = head.rotation.inverse();
        let StrandContacts { guides, pairs, .. } = self;
        island_guides(guides, models, states, islands)
            .for_each(|(guide, model, state)| guide.advance(model, state, env, pairs, &to_world));
        self.update_ends(head);
        let moved: Vec<bool> = self.guides.iter_mut().map(CoupledGuide::has_left_its_candidates).collect();
        if moved.contains(&true) {
            self.pairs.add_candidates(|g| moved[g]);
        }
    }

    /// Updates the ends of the coupled guides in the contact pairs.
    fn update_ends(&mut self, head: &Isometry3<f64>) {
        let moves = |guide: &CoupledGuide| guide.is_coupled && guide.end_state != EndState::AtRestOnHead;
        for (g, guide) in self.guides.iter().enumerate().filter(|(_, guide)| moves(guide)) {
            for (end, x) in self.pairs.end_mut(g).iter_mut().zip(&guide.curve) {
                *end = transform(head, x);
            }
        }
    }

    /// Detects contacts on the current motions after those of the guides of `islands` have changed, and requests
    /// another round of guides in new, violated or crossing ones.
    fn detect(&mut self, islands: &[Island]) {
        let old = self.pairs.contacts.len();
        let mut moved = vec![false; self.guides.len()];
        islands.iter().flat_map(|island| &island.guides).for_each(|&g| moved[g] = true);
        self.pairs.detect(|g| moved[g]);
        for (i, pair) in self.pairs.contacts.iter().enumerate() {
            for g in self.pairs.guides(&pair.contact) {
                self.guides[g].needs_round |= i >= old && pair.needs_round();
                self.guides[g].request_round_if(pair.needs_round());
            }
        }
        for &pair in &self.pairs.crossing {
            for g in self.pairs.guides_of(pair) {
                self.guides[g].request_round_if(true);
            }
        }
    }

    /// Gives up guides of `islands` that do not come to rest, unless that is no reason to divide, with all that takes
    /// parts with them then. The others go on.
    pub(super) fn give_up(&mut self, states: &[GuideState], islands: &[Island]) {
        let all = islands.iter().flat_map(|island| island.guides.iter().copied());
        let hopeless: Vec<usize> =
            all.filter(|&g| !states[g].stuck && self.guides[g].is_hopeless()).collect();
        if !hopeless.is_empty() {
            let group = self.links().group(hopeless);
            group.into_iter().for_each(|g| self.guides[g].given_up = true);
        }
    }

    /// The free guides that violate a body or cross another guide.
    fn failing(&self) -> impl Iterator<Item = usize> {
        let violating = (0..self.guides.len()).filter(|&g| self.guides[g].violates_bodies());
        let crossing = self.pairs.crossing.iter().flat_map(|&pair| self.pairs.guides_of(pair));
        violating.chain(crossing).filter(|&g| self.given[g].is_none())
    }

    /// Applies the fallbacks. Guides that still violate a body end uncoupled. Guides that cross each other
    /// take half of their motion, then a quarter, then rest on the head; so do guides that then cross these.
    /// Bodies take precedence: a guide that a body prevents from resting on the head ends uncoupled, even if
    /// it crosses another guide.
    fn apply_fallbacks(
        &mut self,
        models: &[GuideModel],
        states: &mut [GuideState],
        env: &Environment,
        t: [f64; 2],
    ) {
        let head = &(env.head)(t[1]).inverse();
        let violating: Vec<usize> = (0..models.len()).filter(|&g| self.guides[g].violates_bodies()).collect();
        for &g in &violating {
            self.guides[g].end_uncoupled(&models[g]);
        }
        if !violating.is_empty() {
            self.redetect(head);
        }
        loop {
            let crossing = self.pairs.crossing.iter().flat_map(|&pair| self.pairs.guides_of(pair));
            let may_be_cut = |&g: &usize| self.given[g].is_none() && !self.guides[g].is_fully_truncated();
            let crossing: BTreeSet<usize> = crossing.filter(may_be_cut).collect();
            if crossing.is_empty() {
                break;
            }
            for g in crossing {
                let (guide, model, state) = (&mut self.guides[g], &models[g], &mut states[g]);
                if !guide.is_coupled && guide.converged {
                    guide.couple(model, state, env, t);
                }
                guide.truncate_motion(model, state, env, t);
                if guide.end_state == EndState::AtRestOnHead {
                    self.pairs.hold(g);
                }
            }
            self.redetect(head);
        }
    }

    /// Detects contacts after guides have moved by any distance.
    fn redetect(&mut self, head: &Isometry3<f64>) {
        self.update_ends(head);
        let StrandContacts { pairs, given, .. } = self;
        pairs.find_candidates(|g| given[g].is_none());
        pairs.detect(|_| true);
    }

    fn record(
        &mut self,
        models: &[GuideModel],
        states: &mut [GuideState],
        env: &Environment,
        records: &mut [StepRecord],
    ) {
        let mut loses_contact = vec![false; self.guides.len()];
        for pair in self.pairs.contacts.iter().filter(|pair| pair.is_lost()) {
            let [a, b] = self.pairs.guides(&pair.contact);
            (loses_contact[a], loses_contact[b]) = (true, true);
        }
        let guides = self.guides.iter_mut().zip(models).zip(states).zip(loses_contact).zip(&mut *records);
        for ((((guide, model), state), loses_contact), record) in guides {
            guide.record(model, state, env, loses_contact, record);
        }
        // What a free guide has with one whose motion is given is its own.
        let owner = |[a, b]: [usize; 2]| if self.given[a].is_none() { a } else { b };
        for pair in &self.pairs.contacts {
            let record = &mut records[owner(self.pairs.guides(&pair.contact))].strands;
            record.found += 1;
            record.active += u32::from(pair.is_active());
            record.work += pair.force().dot(&self.pairs.slip(pair));
        }
        for (pair, share) in self.pairs.missing() {
            let record = &mut records[owner(self.pairs.guides_of(pair))].strands;
            record.missing = record.missing.max(share);
        }
        for &pair in &self.pairs.crossing {
            records[owner(self.pairs.guides_of(pair))].strands.crossings += 1;
        }
    }

    /// Commits the ends of the guides and stores the contact history.
    fn finish(&mut self, models: &[GuideModel], states: &mut [GuideState], env: &Environment, t: [f64; 2]) {
        self.guides.par_iter_mut().zip(models).zip(states).for_each(|((guide, model), state)| {
            if guide.end_state == EndState::AtRestOnHead {
                state.rest_on_head(model, env, t);
            } else if guide.is_coupled {
                guide.close(model, state, t);
            }
        });
        self.pushed.fill(false);
        for pair in self.pairs.contacts.iter().filter(|p| p.is_active()) {
            for g in self.pairs.guides(&pair.contact) {
                self.pushed[g] = true;
            }
        }
        self.pairs.end();
    }
}

/// The guides of islands.
fn island_guides<'a>(
    guides: &'a mut [CoupledGuide],
    models: &'a [GuideModel],
    states: &'a mut [GuideState],
    islands: &[Island],
) -> impl ParallelIterator<Item = (&'a mut CoupledGuide, &'a GuideModel, &'a mut GuideState)> {
    let mut chosen = vec![false; models.len()];
    islands.iter().flat_map(|island| &island.guides).for_each(|&g| chosen[g] = true);
    let all = guides.par_iter_mut().zip(models).zip(states).zip(chosen).filter(|(_, chosen)| *chosen);
    all.map(|(((guide, model), state), _)| (guide, model, state))
}

/// The curves of the active guides in the groom's pose relative to their roots, m, concatenated.
fn drawn_curves(models: &[GuideModel], active: &[usize]) -> Vec<Vector3<f64>> {
    let of = |shape: &mut RodShape, &g: &usize| -> Vec<Vector3<f64>> {
        let rod = &models[g].rod;
        shape.update(rod, &rod.root.r, &rod.initial_q);
        shape.refined_curve(rod, &rod.initial_q).collect()
    };
    active.par_iter().map_init(RodShape::default, of).collect::<Vec<_>>().concat()
}

/// The curves of the active guides at time `t`, s, in the frame of the head, m, concatenated.
fn head_frame_curves(
    models: &[GuideModel],
    states: &[GuideState],
    active: &[usize],
    env: &Environment,
    t: f64,
) -> Vec<Vector3<f64>> {
    let head = (env.head)(t).inverse();
    let of = |shape: &mut RodShape, g: &usize| -> Vec<Vector3<f64>> {
        let (rod, q) = (&models[*g].rod, &states[*g].q[0]);
        let root = models[*g].root(env, t);
        shape.update(rod, &root.r, q);
        shape.refined_curve(rod, q).map(|x| transform(&head, &(x + root.p))).collect()
    };
    let curves: Vec<_> = active.par_iter().map_init(RodShape::default, of).collect();
    curves.concat()
}

fn transform(pose: &Isometry3<f64>, x: &Vector3<f64>) -> Vector3<f64> {
    pose.rotation * x + pose.translation.vector
}
