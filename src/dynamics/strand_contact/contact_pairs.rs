//! Detection of the contacts between guides in one sub-step.
//!
//! All quantities are in the frame of the head, whose motion is no relative motion of the guides. The law is
//! that of `docs/theory.md` §5.2: crossing guides keep the thickness of their bundles, parallel ones that of
//! a hair.

use super::contact_law::{BundlePair, BundleProperties, REACH};
use super::contact_pair::{ContactHistory, ContactPair};
use crate::contact::pairs::{ClosestPair, MovingStrands, SegmentContact, SegmentPair, TOUCHING_SHARE};
use nalgebra::{UnitQuaternion, Vector3};
use rayon::prelude::*;
use std::ops::Range;

/// Displacement of a point of a guide over the rounds of a sub-step after which candidates of the guide are found
/// again, m. At most [`REACH`], so that two guides that both move by it find each other.
pub(super) const MARGIN: f64 = REACH;

/// Arc length from the root, m, over which the distance that two guides keep there grows from nothing to that of the
/// law: roots stand where they are drawn, and pushing hair apart next to them would fling its tips.
const ROOT_LENGTH: f64 = 0.01;

/// Least limit of the required distance, m, however close the guides were drawn: a guard against crossing by rounding.
/// Next to roots less is required.
const MIN_REQUIRED: f64 = 1e-4;

/// Distance of two roots, m, below which they grow from one place, next to which they cannot be kept apart.
const ONE_PLACE: f64 = 1e-4;

/// Time in which missing distance falls to 1/e, s. Shorter, it pushes hair apart at a speed that is seen;
/// longer, locks that were pressed together stay thin.
const RECOVERY_TIME: f64 = 0.05;

/// Largest speed at which missing distance is regained, m/s.
pub(in crate::dynamics) const RECOVERY_SPEED: f64 = 0.05;

/// Most that a contact slides in a sub-step, in segments summed over both guides; one farther away is a new
/// contact.
const MAX_SLIDE: f64 = 2.0;

/// Distance within which an impact is a consequence of an earlier one, in segments summed over both guides.
const CONSEQUENCE_DISTANCE: f64 = 3.0;

/// Arc length within which a guide does not meet itself, over the largest distance that it must keep from
/// itself: half a turn as tight as that distance allows.
const HALF_TURN: f64 = std::f64::consts::FRAC_PI_2;

/// Distance within which two contacts may be equivalent, in segments summed over both guides.
const DUPLICATE_DISTANCE: f64 = 0.3;

/// A pair of segments that may meet within the sub-step.
#[derive(Debug, Clone, Copy)]
pub(super) struct Candidate {
    closest: ClosestPair,
    /// Distance by the contact law, m.
    required: f64,
}

/// An impact within the sub-step.
#[derive(Debug, Clone, Copy)]
pub(super) struct Impact {
    guides: [usize; 2],
    time: f64,
    contact: SegmentContact,
    /// True if the segments would pass through each other.
    crosses: bool,
    /// True if they would, or end at less than [`TOUCHING_SHARE`] of the distance that they have or keep.
    touches: bool,
}

/// The active guides as polylines through the points of their rods and the midpoints of the curve between
/// them, and their contacts.
#[derive(Debug)]
pub(super) struct ContactPairs {
    /// Bundle of each guide.
    pub bundles: Vec<BundleProperties>,
    /// Arc length of each point from the root over [`ROOT_LENGTH`], at most 1: the share of the distance of the law that
    /// is kept there; 1 if nothing holds the root.
    pub root_share: Vec<f64>,
    /// Root of each guide in the groom's pose, m.
    pub roots: Vec<Vector3<f64>>,
    /// Arc length of each point from the root, over that within which its guide does not meet itself.
    pub half_turns: Vec<f64>,
    /// Points in the groom's pose, m, each guide relative to its root.
    pub drawn: Vec<Vector3<f64>>,
    /// Guide of each point.
    pub guide: Vec<u32>,
    /// First point of each guide; for a guide without points, that of the next.
    pub first: Vec<u32>,
    /// Points at the start and at the end of the sub-step, m.
    pub x: [Vec<Vector3<f64>>; 2],
    pub candidates: Vec<Candidate>,
    /// The contacts of the sub-step; those found by the same detection ascend by pair.
    pub contacts: Vec<ContactPair>,
    /// Pairs that would pass through each other.
    pub crossing: Vec<SegmentPair>,
    /// The impacts on the motion to the current ends.
    pub impacts: Vec<Impact>,
    /// Contacts of the sub-step before, in ascending order of guides.
    pub history: Vec<ContactHistory>,
    /// Duration of the sub-step, s.
    pub duration: f64,
}

impl ContactPairs {
    /// No contacts, for guides with arc lengths `arc` of their rods' points, m (empty for guides without
    /// contact), and with `bundles`.
    pub fn new(arc: &[&[f64]], bundles: Vec<BundleProperties>) -> Self {
        let points = arc.iter().map(|s| (2 * s.len()).saturating_sub(1));
        let with_midpoints = |s: &&[f64]| -> Vec<f64> {
            let between = s.windows(2).flat_map(|s| [0.5 * (s[0] + s[1]), s[1]]);
            s.iter().take(1).copied().chain(between).collect()
        };
        let half_turns = |(s, bundle): (&&[f64], &BundleProperties)| {
            let half_turn = HALF_TURN * 2.0 * (bundle.hair_radius + bundle.bundle_radius);
            with_midpoints(s).into_iter().map(move |s| s / half_turn)
        };
        ContactPairs {
            root_share: arc.iter().flat_map(with_midpoints).map(|s| (s / ROOT_LENGTH).min(1.0)).collect(),
            roots: Vec::new(),
            half_turns: arc.iter().zip(&bundles).flat_map(half_turns).collect(),
            drawn: Vec::new(),
            bundles,
            guide: points.clone().enumerate().flat_map(|(g, n)| std::iter::repeat_n(g as u32, n)).collect(),
            first: points.scan(0, |at, n| Some(std::mem::replace(at, *at + n as u32))).collect(),
            x: [Vec::new(), Vec::new()],
            candidates: Vec::new(),
            contacts: Vec::new(),
            crossing: Vec::new(),
            impacts: Vec::new(),
            history: Vec::new(),
            duration: 0.0,
        }
    }

    /// Replaces the guides; keeps the history of contacts between guides with points.
    pub fn rebuild(&mut self, arc: &[&[f64]], bundles: Vec<BundleProperties>) {
        let remains = |known: &&ContactHistory| known.guides.iter().all(|&g| !arc[g as usize].is_empty());
        let history = self.history.iter().filter(remains).copied().collect();
        *self = ContactPairs { history, ..ContactPairs::new(arc, bundles) };
    }

    /// Share of a force on the bundle on one side of a contact that acts on one hair.
    pub fn hair_share(&self, contact: &SegmentContact, side: usize) -> f64 {
        1.0 / self.bundles[self.guides(contact)[side]].hairs
    }

    /// The two guides of a pair: one and the same where a guide meets itself.
    pub fn guides_of(&self, pair: SegmentPair) -> [usize; 2] {
        [pair.0, pair.1].map(|k| self.guide[k as usize] as usize)
    }

    /// The two guides of a contact.
    pub fn guides(&self, contact: &SegmentContact) -> [usize; 2] {
        self.guides_of(contact.pair)
    }

    /// Position of a contact on one side: the segment of the rod, and the fraction of it.
    pub fn position_on_rod(&self, contact: &SegmentContact, side: usize) -> (usize, f64) {
        let k = [contact.pair.0, contact.pair.1][side];
        let half = k - self.first[self.guide[k as usize] as usize];
        ((half / 2) as usize, 0.5 * (f64::from(half % 2) + contact.u[side]))
    }

    /// Positions of a contact along the two guides, in segments of their rods from the root.
    fn positions_on_guides(&self, contact: &SegmentContact) -> [f64; 2] {
        let (at, guides) = (positions(contact), self.guides(contact));
        [0, 1].map(|side| at[side] - 0.5 * f64::from(self.first[guides[side]]))
    }

    /// Sets the reaction of contact `i`: `r` along its axes, N.
    pub fn set_reaction(&mut self, i: usize, r: &[f64], to_world: &UnitQuaternion<f64>) {
        let contact = &mut self.contacts[i];
        let [n, t1, t2] = contact.axes(to_world);
        contact.reaction = to_world.inverse_transform_vector(&(n * r[0] + t1 * r[1] + t2 * r[2]));
    }

    /// The points of guide `g`.
    pub fn points_of(&self, g: usize) -> Range<usize> {
        let end = self.first.get(g + 1).map_or(self.guide.len(), |&k| k as usize);
        self.first[g] as usize..end
    }

    /// The points of guide `g` at the end of the sub-step.
    pub fn end_mut(&mut self, g: usize) -> &mut [Vector3<f64>] {
        let points = self.points_of(g);
        &mut self.x[1][points]
    }

    /// Makes the root of guide `g` one that nothing holds: contact finds it as any other place.
    pub fn free_root(&mut self, g: usize) {
        let points = self.points_of(g);
        self.root_share[points].fill(1.0);
    }

    /// Sets the end of guide `g` to its start.
    pub fn hold(&mut self, g: usize) {
        let points = self.points_of(g);
        let [start, end] = &mut self.x;
        end[points.clone()].copy_from_slice(&start[points]);
    }

    fn strands(&self) -> MovingStrands<'_> {
        self.moving([&self.x[0], &self.x[1]])
    }

    /// The guides on the way from the points `x[0]` to `x[1]`.
    fn moving<'a>(&'a self, [x0, x1]: [&'a [Vector3<f64>]; 2]) -> MovingStrands<'a> {
        MovingStrands { x0, x1, strand: &self.guide, arc: &self.half_turns }
    }

    /// Slip of the first guide of a contact relative to the second, m.
    pub fn slip(&self, contact: &ContactPair) -> Vector3<f64> {
        self.strands().slip(&contact.contact)
    }

    /// The pairs that lack some of their distance at the end, each with the share of it that is missing.
    pub fn missing(&self) -> Vec<(SegmentPair, f64)> {
        let strands = self.strands();
        let missing = |Candidate { closest, required }: &Candidate| {
            let end = strands.end_distance(closest.pair);
            let share =
                (end < *required).then(|| 1.0 - end / self.new_contact(strands.contact(closest)).lawful)?;
            (share > 0.0).then_some((closest.pair, share))
        };
        self.candidates.par_iter().filter_map(missing).collect()
    }

    /// Begins a sub-step of `duration`, s: finds the contacts at its start and the impacts on the way to the
    /// current ends, of guides that are `wanted`.
    pub fn begin(&mut self, duration: f64, wanted: impl Fn(usize) -> bool + Sync) {
        self.duration = duration;
        self.contacts.clear();
        self.find_candidates(wanted);
        let (strands, pairs) = (self.strands(), &*self);
        let near = |Candidate { closest, required }: &Candidate| {
            let contact =
                (closest.distance < required + REACH).then(|| strands.contact_candidate(closest))??;
            Some(pairs.new_contact(contact))
        };
        let near: Vec<ContactPair> = self.candidates.par_iter().filter_map(near).collect();
        self.contacts = self.without_duplicates(near);
        self.detect(|_| true);
    }

    /// Keeps only the tightest of equivalent contacts: duplicates would leave the reactions between them
    /// undetermined.
    fn without_duplicates(&self, near: Vec<ContactPair>) -> Vec<ContactPair> {
        let slack = |p: &ContactPair| {
            self.strands().closest_pair(p.contact.pair).distance - self.required_distance(p.contact.pair)
        };
        let slack: Vec<f64> = near.par_iter().map(slack).collect();
        let guides = |i: usize| self.guides(&near[i].contact);
        let mut order: Vec<usize> = (0..near.len()).collect();
        order.par_sort_by_key(|&i| guides(i));
        let tightest = |same: &mut [usize]| {
            same.sort_by(|&i, &j| slack[i].total_cmp(&slack[j]));
            let mut kept: Vec<usize> = Vec::new();
            for &i in &*same {
                if kept.iter().all(|&k| !are_equivalent(&near[k].contact, &near[i].contact)) {
                    kept.push(i);
                }
            }
            kept
        };
        let mut kept: Vec<usize> =
            order.par_chunk_by_mut(|&i, &j| guides(i) == guides(j)).flat_map_iter(tightest).collect();
        kept.sort_unstable();
        kept.into_iter().map(|i| near[i]).collect()
    }

    /// Finds the pairs of `wanted` guides that may meet within this sub-step if no point moves by more than
    /// [`MARGIN`] from the current ends.
    pub fn find_candidates(&mut self, wanted: impl Fn(usize) -> bool + Sync) {
        self.candidates.clear();
        self.add_candidates(wanted);
    }

    /// Adds the pairs of guides that have `moved` that may meet within this sub-step if no point moves by more
    /// than [`MARGIN`] from the current ends.
    pub fn add_candidates(&mut self, moved: impl Fn(usize) -> bool + Sync) {
        let (strands, pairs) = (self.strands(), &*self);
        let reach = |g: u32| {
            let BundleProperties { hair_radius, bundle_radius, .. } = pairs.bundles[g as usize];
            hair_radius + bundle_radius + 0.5 * (REACH + MARGIN)
        };
        let candidate = |pair: SegmentPair| {
            let closest = (!pairs.grow_from_one_place(pair)).then(|| strands.closest_pair(pair))?;
            let required = pairs.required_distance(pair);
            let is_near = strands.distance_lower_bound(&closest) < required + REACH + MARGIN;
            is_near.then_some(Candidate { closest, required })
        };
        let found = strands.broad_phase(reach, |g| moved(g as usize));
        let found: Vec<Candidate> = found.into_par_iter().filter_map(candidate).collect();
        self.candidates.extend(found);
        self.candidates.par_sort_by_key(|candidate| candidate.closest.pair);
        self.candidates.dedup_by_key(|candidate| candidate.closest.pair);
    }

    /// Detects contacts on the motion to the current ends, where guides have `moved` since the last detection:
    /// updates the distances of all contacts, adds new impacts, and lists the crossing pairs.
    pub fn detect(&mut self, moved: impl Fn(usize) -> bool + Sync) {
        let mut impacts = std::mem::take(&mut self.impacts);
        impacts.retain(|impact| !impact.guides.iter().any(|&g| moved(g)));
        impacts.extend(self.impacts_of(moved));
        self.crossing.clear();
        self.crossing.extend(impacts.iter().filter(|h| h.crosses).map(|h| h.contact.pair));
        let [x0, x1] = &self.x;
        let strands = MovingStrands { x0, x1, strand: &self.guide, arc: &self.half_turns };
        self.contacts.par_iter_mut().for_each(|p| p.contact.distance = strands.distance(&p.contact));
        impacts.sort_by(|a, b| a.guides.cmp(&b.guides).then(a.time.total_cmp(&b.time)));
        let mut known: Vec<([usize; 2], ContactPair)> =
            self.contacts.iter().map(|p| (self.guides(&p.contact), *p)).collect();
        known.sort_by_key(|(guides, _)| *guides);
        for same in impacts.chunk_by(|a, b| a.guides == b.guides) {
            let from = known.partition_point(|(guides, _)| *guides < same[0].guides);
            let known = known[from..].iter().take_while(|(guides, _)| *guides == same[0].guides);
            let first = self.contacts.len();
            for impact in same {
                // An impact close after another one, or close to a violated contact, is a consequence of it.
                // An equivalent contact that is kept while the segments touch or cross does not prevent that:
                // segments that are nearly parallel, or turn, pass it by.
                let near = |m: &SegmentContact| distance(m, &impact.contact) <= CONSEQUENCE_DISTANCE;
                let prevents = |p: &ContactPair| !impact.touches || !p.is_passed_by();
                let is_covered = known.clone().any(|(_, p)| {
                    near(&p.contact) && p.contact.distance < 0.0
                        || are_equivalent(&p.contact, &impact.contact) && prevents(p)
                });
                if !is_covered && !self.contacts[first..].iter().any(|p| near(&p.contact)) {
                    self.contacts.push(self.new_contact(impact.contact));
                }
            }
        }
        self.impacts = impacts;
    }

    /// The impacts of the candidates of guides that have `moved`, on the motion to the current ends.
    fn impacts_of(&self, moved: impl Fn(usize) -> bool + Sync) -> Vec<Impact> {
        let strands = self.strands();
        let impact = |Candidate { closest, required }: &Candidate| {
            if !self.guides_of(closest.pair).iter().any(|&g| moved(g)) {
                return None;
            }
            let (contact, time) = strands.impact(closest, *required)?;
            let guides = self.guides(&contact);
            let crosses = strands.crosses(closest.pair);
            let least = TOUCHING_SHARE * required.min(closest.distance);
            let touches = crosses || strands.end_distance(closest.pair) < least;
            Some(Impact { guides, time, contact, crosses, touches })
        };
        self.candidates.par_iter().filter_map(impact).collect()
    }

    /// Largest distance that the contact law requires of two segments, m.
    fn required_distance(&self, pair: SegmentPair) -> f64 {
        self.bundle_pair(pair).required_distance() * self.share_at_roots(pair, [1.0, 1.0])
    }

    /// The share of the distance of the law that two segments keep at the fractions `u` of them: less than 1 where both
    /// are near their roots.
    fn share_at_roots(&self, pair: SegmentPair, u: [f64; 2]) -> f64 {
        let [a, b] = self.guides_of(pair);
        let at = |k: u32, u: f64| {
            let k = k as usize;
            self.root_share[k] + (self.root_share[k + 1] - self.root_share[k]) * u
        };
        if a == b { 1.0 } else { at(pair.0, u[0]).max(at(pair.1, u[1])) }
    }

    /// Whether two segments are near roots that grow from one place, where they cannot be kept apart.
    fn grow_from_one_place(&self, pair: SegmentPair) -> bool {
        let [a, b] = self.guides_of(pair);
        self.share_at_roots(pair, [0.0, 0.0]) < 1.0 && (self.roots[a] - self.roots[b]).norm() < ONE_PLACE
    }

    fn bundle_pair(&self, pair: SegmentPair) -> BundlePair {
        BundlePair::new(self.guides_of(pair).map(|g| self.bundles[g]), self.strands().directions(pair))
    }

    /// Distance of two segments of one guide in the groom's pose, m: there it is at rest. Infinite for segments
    /// of different guides.
    fn drawn(&self, pair: SegmentPair) -> f64 {
        let [a, b] = self.guides_of(pair);
        if a == b { self.moving([&self.drawn; 2]).closest_pair(pair).distance } else { f64::INFINITY }
    }

    fn new_contact(&self, contact: SegmentContact) -> ContactPair {
        let strands = self.strands();
        let before = strands.distance_around(&strands.closest_pair(contact.pair));
        let known = self.find_history(&contact);
        let limit = known.map_or(before, |k| k.limit.max(before));
        let bundles = self.bundle_pair(contact.pair);
        let law = bundles.required_distance() * self.share_at_roots(contact.pair, contact.u);
        let lawful = law.min(limit.max(MIN_REQUIRED)).min(self.drawn(contact.pair));
        let missing = (lawful - before).max(0.0);
        let recovered = missing * -(-self.duration / RECOVERY_TIME).exp_m1();
        ContactPair {
            contact,
            required: lawful - missing + recovered.min(RECOVERY_SPEED * self.duration),
            lawful,
            limit,
            local_axes: bundles.axes(&contact.normal),
            cohesion: bundles.cohesion(before - lawful, strands.mean_length(contact.pair)),
            reaction: known.map_or_else(Vector3::zeros, |k| k.reaction),
        }
    }

    /// The history of the nearest contact of the same two guides.
    fn find_history(&self, contact: &SegmentContact) -> Option<&ContactHistory> {
        let guides = self.guides(contact).map(|g| g as u32);
        let at = self.positions_on_guides(contact);
        let from = self.history.partition_point(|k| k.guides < guides);
        self.history[from..]
            .iter()
            .take_while(|k| k.guides == guides)
            .map(|k| ((k.at[0] - at[0]).abs() + (k.at[1] - at[1]).abs(), k))
            .filter(|(slide, _)| *slide <= MAX_SLIDE)
            .min_by(|a, b| a.0.total_cmp(&b.0))
            .map(|(_, k)| k)
    }

    /// Ends a sub-step: stores the history and makes its end the next start.
    pub fn end(&mut self) {
        let history = self.contacts.iter().map(|p| ContactHistory {
            guides: self.guides(&p.contact).map(|g| g as u32),
            at: self.positions_on_guides(&p.contact),
            limit: p.limit.max(p.contact.distance),
            reaction: p.reaction,
        });
        self.history = history.collect();
        self.sort_history();
        self.x.swap(0, 1);
    }

    /// Restores the order of the history.
    pub fn sort_history(&mut self) {
        self.history.sort_by(|a, b| {
            let positions = || a.at[0].total_cmp(&b.at[0]).then(a.at[1].total_cmp(&b.at[1]));
            a.guides.cmp(&b.guides).then_with(positions)
        });
    }

    /// Slip of a contact in the sub-step that has just ended, m.
    #[cfg(test)]
    pub fn last_slip(&self, contact: &ContactPair) -> Vector3<f64> {
        self.moving([&self.x[1], &self.x[0]]).slip(&contact.contact)
    }
}

/// Positions of a contact along the concatenated polylines, in segments of the rods.
fn positions(contact: &SegmentContact) -> [f64; 2] {
    [f64::from(contact.pair.0) + contact.u[0], f64::from(contact.pair.1) + contact.u[1]].map(|k| 0.5 * k)
}

/// Distance of two contacts, in segments of the rods, summed over both guides.
fn distance(a: &SegmentContact, b: &SegmentContact) -> f64 {
    let (a, b) = (positions(a), positions(b));
    (a[0] - b[0]).abs() + (a[1] - b[1]).abs()
}

/// True if keeping the distance at `a` keeps it at `b`.
fn are_equivalent(a: &SegmentContact, b: &SegmentContact) -> bool {
    distance(a, b) < DUPLICATE_DISTANCE && a.normal.dot(&b.normal) > 0.98
}
