//! Guides against guides within one sub-step: find, solve all that hang together for reactions, move, look again.
//!
//! `docs/theory.md` §5.2. Every guide has first moved as if it were alone with the bodies. Guides that would then come too close, or
//! that others pushed in the sub-step before, are solved together with all that are near them, their contacts with bodies included.

mod checkpoint;
mod contact_pairs;
mod island;
mod law;
mod member;
#[cfg(test)]
mod tests;

use super::environment::Environment;
use super::guide::{GuideModel, GuideState};
use super::step_record::StepRecord;
use crate::rod::RodShape;
use contact_pairs::ContactPairs;
use island::{Island, Reactions, Sets};
pub(super) use law::BundleProperties;
use member::{Member, Resort};
use nalgebra::{Isometry3, UnitQuaternion, Vector3};
use rayon::prelude::*;
use std::collections::BTreeSet;

/// Times that reactions are solved for, guides moved and contacts looked for in one sub-step.
const MAX_ROUNDS: u32 = 16;

/// The guides of a simulation as they touch each other: those that move by themselves, each with the hairs of all that follow it.
#[derive(Debug)]
pub(super) struct StrandContacts {
    /// What each guide is with its own hairs alone.
    own: Vec<BundleProperties>,
    /// The guides that move by themselves, ascending.
    active: Vec<usize>,
    places: ContactPairs,
    members: Vec<Member>,
    /// Guides that another pushed in the sub-step before. They are solved with the others from the start: alone, they would fall
    /// through what holds them.
    pushed: Vec<bool>,
}

impl StrandContacts {
    /// Of guides that are this to each other, none of which are in it before [`StrandContacts::muster`].
    pub fn new(own: Vec<BundleProperties>) -> Self {
        StrandContacts {
            active: Vec::new(),
            members: own.iter().map(|_| Member::new()).collect(),
            pushed: vec![false; own.len()],
            places: ContactPairs::new(&[], Vec::new()),
            own,
        }
    }

    /// Takes over who moves by itself from time `t`, s, on, and where it is; `mover` is the guide with which each moves, itself or another. What is known
    /// of the contacts of guides that stay in is kept.
    pub fn rebuild(
        &mut self,
        models: &[GuideModel],
        states: &[GuideState],
        mover: impl Fn(usize) -> usize,
        env: &Environment,
        t: f64,
    ) {
        let mut skin = self.own.clone();
        let mut arc: Vec<&[f64]> = vec![&[]; models.len()];
        self.active.clear();
        for (g, model) in models.iter().enumerate() {
            let mover = mover(g);
            if mover == g {
                arc[g] = &model.rod.arc;
                self.active.push(g);
            } else {
                skin[mover].carry(&self.own[g]);
                self.pushed[g] = false;
            }
        }
        let known = std::mem::take(&mut self.places.known);
        self.places = ContactPairs { known, ..ContactPairs::new(&arc, skin) };
        self.places.forget(|g| !arc[g].is_empty());
        self.places.x[0] = curves(models, states, &self.active, env, t);
    }

    /// The guides that move by themselves, ascending.
    pub fn active(&self) -> &[usize] {
        &self.active
    }

    /// Keeps apart what would come too close in the sub-step from `t[0]` to `t[1]`, s, which each of them has just taken alone.
    pub fn resolve(
        &mut self,
        models: &[GuideModel],
        states: &mut [GuideState],
        env: &Environment,
        t: [f64; 2],
        records: &mut [StepRecord],
    ) {
        let head = (env.head)(t[1]).inverse();
        let to_world = head.rotation.inverse();
        self.places.x[1] = curves(models, states, &self.active, env, t[1]);
        self.places.begin();
        self.members.iter_mut().zip(&*records).for_each(|(m, record)| m.begin(record));
        let mut strayed = 0.0;
        for _ in 0..MAX_ROUNDS {
            let mut islands = self.open(models, states, env, t);
            islands.retain(|island| island.members.iter().any(|&g| self.members[g].stirred));
            if islands.is_empty() {
                break;
            }
            self.solve(models, states, env, &islands, &to_world);
            strayed += self.advance(models, states, env, &islands, &head);
            if strayed > contact_pairs::MARGIN {
                strayed = 0.0;
                self.places.find_pairs();
            }
            self.look();
        }
        self.give_way(models, states, env, t);
        self.note(models, states, env, records);
        self.close(models, states, env, t);
    }

    /// Opens the guides that hang together, over places, with one that is too close to another, clings to it, or was pushed; returns these islands. What
    /// did not converge stays where it is.
    fn open(
        &mut self,
        models: &[GuideModel],
        states: &mut [GuideState],
        env: &Environment,
        t: [f64; 2],
    ) -> Vec<Island> {
        let whole = |g: usize| self.members[g].whole;
        let mut sets = Sets::new(models.len());
        let mut wanted = self.pushed.clone();
        for place in &self.places.found {
            let [a, b] = self.places.guides(&place.contact);
            if whole(a) && whole(b) {
                sets.join(a, b);
            }
            if place.acts() {
                wanted[a] = true;
                wanted[b] = true;
            }
        }
        let wanted = (0..models.len()).filter(|&g| whole(g) && (wanted[g] || self.members[g].open));
        let (mut islands, island_of) = Island::of(sets, models.len(), wanted);
        self.members.iter_mut().for_each(|m| m.parts.clear());
        for (i, place) in self.places.found.iter().enumerate() {
            for (side, g) in self.places.guides(&place.contact).into_iter().enumerate() {
                let Some(island) = island_of[g] else { continue };
                if islands[island].places.last() != Some(&i) {
                    islands[island].places.push(i);
                }
                self.members[g].parts.push((i, side));
            }
        }
        let opened = self.members.par_iter_mut().zip(models).zip(states).zip(&island_of);
        opened
            .filter(|(((m, _), _), island)| island.is_some() && !m.open)
            .for_each(|(((m, model), state), _)| m.open(model, state, env, t));
        islands
    }

    /// Linearises the members of the islands, solves for the reactions of all their contacts, and adds what these do to the solvers'
    /// directions.
    fn solve(
        &mut self,
        models: &[GuideModel],
        states: &mut [GuideState],
        env: &Environment,
        islands: &[Island],
        to_world: &UnitQuaternion<f64>,
    ) {
        let StrandContacts { members, places, .. } = self;
        active(members, models, states, islands)
            .for_each(|(m, model, state)| m.linearise(model, state, env, places, to_world));
        let reactions: Vec<_> =
            islands.par_iter().map(|island| island.react(models, members, places, to_world)).collect();
        for (island, Reactions { pushes, forces, outcome }) in islands.iter().zip(&reactions) {
            let (mut pushes, mut forces) = (&pushes[..], &forces[..]);
            for &g in &island.members {
                let m = &mut members[g];
                let direction = &mut m.scratch.solver.direction;
                let (push, pushes_left) = pushes.split_at(direction.len());
                direction.iter_mut().zip(push).for_each(|(d, w)| *d += w);
                let (last, forces_left) = forces.split_at(3 * m.scratch.contact.problem.laws.len());
                m.scratch.contact.reactions.forces.clear();
                m.scratch.contact.reactions.forces.extend_from_slice(last);
                m.residual = outcome.residual;
                m.rounds += 1;
                (pushes, forces) = (pushes_left, forces_left);
            }
            for (&i, r) in island.places.iter().zip(forces.chunks_exact(3)) {
                places.push(i, r, to_world);
            }
        }
    }

    /// Moves the members of the islands along their directions; returns the largest displacement, m.
    fn advance(
        &mut self,
        models: &[GuideModel],
        states: &mut [GuideState],
        env: &Environment,
        islands: &[Island],
        head: &Isometry3<f64>,
    ) -> f64 {
        let to_world = head.rotation.inverse();
        let StrandContacts { members, places, .. } = self;
        active(members, models, states, islands)
            .for_each(|(m, model, state)| m.advance(model, state, env, places, &to_world));
        self.gather(head);
        islands.iter().flat_map(|i| &i.members).map(|&g| self.members[g].moved).fold(0.0, f64::max)
    }

    /// Takes over the ends of the members.
    fn gather(&mut self, head: &Isometry3<f64>) {
        for (g, m) in self.members.iter().enumerate().filter(|(_, m)| m.open && m.resort != Resort::Still) {
            for (end, x) in self.places.end_of(g).iter_mut().zip(&m.curve) {
                *end = carry(head, x);
            }
        }
    }

    /// Looks where the motions lead, and asks for another round of the guides that do not keep apart.
    fn look(&mut self) {
        let old = self.places.found.len();
        self.places.look();
        for (i, place) in self.places.found.iter().enumerate() {
            for g in self.places.guides(&place.contact) {
                self.members[g].stirred |= i >= old;
                self.members[g].stir(!place.is_kept());
            }
        }
        for &pair in &self.places.crossing {
            for g in self.places.guides_of(pair) {
                self.members[g].stir(true);
            }
        }
    }

    /// The last resorts. A guide that still crosses a body, or is deep in what it keeps from one, goes where it went alone; guides that cross
    /// each other go half of their way, or a quarter, or do not move on the head, and so does what then crosses one of them. The last word is
    /// the bodies': what may not rest on the head for their sake goes where it went alone, whatever other guide is there.
    fn give_way(&mut self, models: &[GuideModel], states: &mut [GuideState], env: &Environment, t: [f64; 2]) {
        let head = &(env.head)(t[1]).inverse();
        let lost: Vec<usize> = (0..models.len()).filter(|&g| self.members[g].is_lost()).collect();
        for &g in &lost {
            self.members[g].go_alone(&models[g]);
        }
        if !lost.is_empty() {
            self.look_afresh(head);
        }
        loop {
            let crossing = self.places.crossing.iter().flat_map(|&pair| self.places.guides_of(pair));
            let crossing: BTreeSet<usize> = crossing.filter(|&g| !self.members[g].has_yielded()).collect();
            if crossing.is_empty() {
                break;
            }
            for g in crossing {
                let (m, model, state) = (&mut self.members[g], &models[g], &mut states[g]);
                if !m.open && m.whole {
                    m.open(model, state, env, t);
                }
                m.cut_short(model, state, env, t);
                if m.resort == Resort::Still {
                    self.places.stop(g);
                }
            }
            self.look_afresh(head);
        }
    }

    /// Looks where the motions lead whose ends may have been moved anywhere.
    fn look_afresh(&mut self, head: &Isometry3<f64>) {
        self.gather(head);
        self.places.find_pairs();
        self.places.look();
    }

    fn note(
        &mut self,
        models: &[GuideModel],
        states: &mut [GuideState],
        env: &Environment,
        records: &mut [StepRecord],
    ) {
        let members = self.members.iter_mut().zip(models).zip(states).zip(&mut *records);
        for (((m, model), state), record) in members {
            m.note(model, state, env, record);
        }
        for place in &self.places.found {
            let record = &mut records[self.places.guides(&place.contact)[0]].strands;
            record.found += 1;
            record.active += u32::from(place.pushes());
        }
        for &pair in &self.places.crossing {
            records[self.places.guides_of(pair)[0]].strands.crossings += 1;
        }
    }

    /// Ends the sub-step.
    fn close(&mut self, models: &[GuideModel], states: &mut [GuideState], env: &Environment, t: [f64; 2]) {
        self.members.par_iter_mut().zip(models).zip(states).for_each(|((m, model), state)| {
            if m.resort == Resort::Still {
                state.rest_on_head(model, env, t);
            } else if m.open {
                model.close(state, &m.root, t[1] - t[0], &m.scratch);
            }
        });
        self.pushed.fill(false);
        for place in self.places.found.iter().filter(|p| p.pushes()) {
            for g in self.places.guides(&place.contact) {
                self.pushed[g] = true;
            }
        }
        self.places.end();
    }
}

/// The members of islands, with their guides.
fn active<'a>(
    members: &'a mut [Member],
    models: &'a [GuideModel],
    states: &'a mut [GuideState],
    islands: &[Island],
) -> impl ParallelIterator<Item = (&'a mut Member, &'a GuideModel, &'a mut GuideState)> {
    let mut chosen = vec![false; models.len()];
    islands.iter().flat_map(|island| &island.members).for_each(|&g| chosen[g] = true);
    let all = members.par_iter_mut().zip(models).zip(states).zip(chosen).filter(|(_, chosen)| *chosen);
    all.map(|(((member, model), state), _)| (member, model, state))
}

/// The curves of the guides that move at time `t`, s, in the frame of the head.
fn curves(
    models: &[GuideModel],
    states: &[GuideState],
    active: &[usize],
    env: &Environment,
    t: f64,
) -> Vec<Vector3<f64>> {
    let head = (env.head)(t).inverse();
    let of = |shape: &mut RodShape, g: &usize| -> Vec<Vector3<f64>> {
        let (rod, q) = (&models[*g].rod, &states[*g].q[0]);
        let root = env.root(&rod.root, t);
        shape.update(rod, &root.r, q);
        shape.refined_curve(rod, q).map(|x| carry(&head, &(x + root.p))).collect()
    };
    let curves: Vec<_> = active.par_iter().map_init(RodShape::default, of).collect();
    curves.concat()
}

fn carry(pose: &Isometry3<f64>, x: &Vector3<f64>) -> Vector3<f64> {
    pose.rotation * x + pose.translation.vector
}
