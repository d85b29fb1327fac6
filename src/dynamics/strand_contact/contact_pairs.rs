//! Where guides are near each other in one sub-step, and what each pair keeps.
//!
//! Everything here is in the frame of the head: what the head carries along is no motion of one guide against another. The law
//! is that of `docs/theory.md` §5.2: crossing guides keep the thickness of their bundles, parallel ones that of a hair.

use super::law::{BundleProperties, Encounter, REACH};
use crate::contact::pairs::{ClosestPair, MovingStrands, SegmentContact, SegmentPair};
use crate::dynamics::body_contact::GAP_TOLERANCE;
use nalgebra::{UnitQuaternion, Vector3};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

/// What the rounds of a sub-step may move a point before pairs are looked for anew, m.
pub(super) const MARGIN: f64 = 1e-3;

/// Arc length from the root up to which guides do not touch each other, m: there they stand as they were drawn, and to push them apart
/// by a hair's breadth would fling their tips.
const ROOTED: f64 = 0.01;

/// Least distance that a pair is to have in the end, m, however near to each other it was drawn: rounding shall not make it cross.
const LEAST: f64 = 1e-4;

/// Share of what is missing to the wanted distance at the start of a sub-step that is gained in it.
const GAINED: f64 = 0.1;

/// Share of the kept distance that is distance enough at the end of a sub-step.
const SQUEEZED: f64 = 0.5;

/// A known contact is the same one as long as it has slid by no more sub-steps of the rods than this along both guides together.
const SLID: f64 = 2.0;

/// An impact this near to an earlier one, in sub-steps of the rods along both guides together, is a consequence of it.
const BESIDE: f64 = 3.0;

/// Two places this near to each other, in sub-steps of the rods along both guides together, may stand for each other.
const SAME: f64 = 0.3;

/// A place where two guides are near each other, or meet on their way. It stays as it was found until the sub-step ends, its normal
/// included: contacts that turned with every round would never come to rest.
#[derive(Debug, Clone, Copy)]
pub(super) struct ContactPair {
    pub contact: SegmentContact,
    /// Distance at the end of the sub-step that is asked for, m.
    pub keep: f64,
    /// The most that the pair is asked to keep, m: no more than it has had.
    limit: f64,
    /// The axes of the contact: its normal, and tangents along and across the guides, the former shorter where friction is weaker along.
    axes: [Vector3<f64>; 3],
    /// Force with which the guides cling together, N.
    pub cling: f64,
    /// Force of contact on the first guide, N, without that.
    pub reaction: Vector3<f64>,
}

impl ContactPair {
    /// The axes of the contact in the world.
    pub fn axes(&self, to_world: &UnitQuaternion<f64>) -> [Vector3<f64>; 3] {
        self.axes.map(|d| to_world * d)
    }

    /// Force on the first guide, N.
    pub fn force(&self) -> Vector3<f64> {
        self.reaction - self.contact.normal * self.cling
    }

    /// Whether it asks for its guides to be solved together, before anything has come of their motion.
    pub fn acts(&self) -> bool {
        self.gap() < -GAP_TOLERANCE || self.cling > 0.0
    }

    /// Distance over what is to be kept, m.
    pub fn gap(&self) -> f64 {
        self.contact.distance - self.keep
    }

    /// Whether it keeps its distance, near enough.
    pub fn is_kept(&self) -> bool {
        self.contact.distance >= SQUEEZED * self.keep
    }

    /// Whether its guides push each other.
    pub fn pushes(&self) -> bool {
        self.reaction != Vector3::zeros()
    }
}

/// What is known of a place from the sub-step before: where it is along the two guides, in sub-steps of their rods from the root.
#[derive(Debug, Clone, Copy, Serialize, Deserialize)]
pub(super) struct Known {
    guides: [u32; 2],
    at: [f64; 2],
    limit: f64,
    reaction: Vector3<f64>,
}

/// A pair that may meet within the sub-step.
#[derive(Debug, Clone, Copy)]
pub(super) struct Candidate {
    near: ClosestPair,
    /// Distance by the angle between its segments, m.
    law: f64,
}

/// An impact on the way to the end of the sub-step.
struct Hit {
    guides: [usize; 2],
    time: f64,
    contact: SegmentContact,
    /// Whether the segments would pass through each other.
    crosses: bool,
}

/// The guides that may touch each other as polylines, as they are written: through the points of the rods and the middles of the curves between them. And where
/// they are near each other.
#[derive(Debug)]
pub(super) struct ContactPairs {
    pub skin: Vec<BundleProperties>,
    /// Whether each point is so near the root that it hardly moves.
    pub rooted: Vec<bool>,
    /// Guide of each point of all of them, and the first point of each guide; of one that has none that of the next.
    pub guide: Vec<u32>,
    pub first: Vec<u32>,
    /// Points at the start and at the end of the sub-step, m.
    pub x: [Vec<Vector3<f64>>; 2],
    pub pairs: Vec<Candidate>,
    /// The places of this sub-step, in ascending order of pairs as far as they were found at the same time.
    pub found: Vec<ContactPair>,
    /// Pairs that would pass through each other.
    pub crossing: Vec<SegmentPair>,
    /// What the sub-step before has left.
    pub known: Vec<Known>,
}

impl ContactPairs {
    /// From the arc lengths of the points of each guide's rod, m, none of those that touch no other, and what the guides are to each other.
    pub fn new(arc: &[&[f64]], skin: Vec<BundleProperties>) -> Self {
        let points = arc.iter().map(|s| (2 * s.len()).saturating_sub(1));
        let with_midpoints = |s: &&[f64]| -> Vec<f64> {
            let between = s.windows(2).flat_map(|s| [0.5 * (s[0] + s[1]), s[1]]);
            s.iter().take(1).copied().chain(between).collect()
        };
        ContactPairs {
            skin,
            rooted: arc.iter().flat_map(with_midpoints).map(|s| s < ROOTED).collect(),
            guide: points.clone().enumerate().flat_map(|(g, n)| std::iter::repeat_n(g as u32, n)).collect(),
            first: points.scan(0, |at, n| Some(std::mem::replace(at, *at + n as u32))).collect(),
            x: [Vec::new(), Vec::new()],
            pairs: Vec::new(),
            found: Vec::new(),
            crossing: Vec::new(),
            known: Vec::new(),
        }
    }

    /// What a force between guides comes to on one hair of that on one side of a contact, as a share of it.
    pub fn per_hair(&self, contact: &SegmentContact, side: usize) -> f64 {
        1.0 / self.skin[self.guides(contact)[side]].hairs
    }

    /// The two guides of a pair.
    pub fn guides_of(&self, pair: SegmentPair) -> [usize; 2] {
        [pair.0, pair.1].map(|k| self.guide[k as usize] as usize)
    }

    /// The two guides of a contact.
    pub fn guides(&self, contact: &SegmentContact) -> [usize; 2] {
        self.guides_of(contact.pair)
    }

    /// Where a contact is on one side: the sub-step of the guide's rod, and the fraction of it.
    pub fn on_rod(&self, contact: &SegmentContact, side: usize) -> (usize, f64) {
        let k = [contact.pair.0, contact.pair.1][side];
        let half = k - self.first[self.guide[k as usize] as usize];
        ((half / 2) as usize, 0.5 * (f64::from(half % 2) + contact.u[side]))
    }

    /// Where a contact is along the two guides, in sub-steps of their rods from the root.
    fn along_rods(&self, contact: &SegmentContact) -> [f64; 2] {
        let (at, guides) = (along(contact), self.guides(contact));
        [0, 1].map(|side| at[side] - 0.5 * f64::from(self.first[guides[side]]))
    }

    /// Forgets what is known of guides that are not `kept`.
    pub fn forget(&mut self, kept: impl Fn(usize) -> bool) {
        self.known.retain(|known| known.guides.iter().all(|&g| kept(g as usize)));
    }

    /// Sets the reaction of a place, `r` in its frame, N.
    pub fn push(&mut self, i: usize, r: &[f64], to_world: &UnitQuaternion<f64>) {
        let place = &mut self.found[i];
        let [n, t1, t2] = place.axes(to_world);
        place.reaction = to_world.inverse_transform_vector(&(n * r[0] + t1 * r[1] + t2 * r[2]));
    }

    /// The points of guide `g` at the end of the sub-step.
    pub fn end_of(&mut self, g: usize) -> &mut [Vector3<f64>] {
        let end = self.first.get(g + 1).map_or(self.x[1].len(), |&k| k as usize);
        &mut self.x[1][self.first[g] as usize..end]
    }

    /// Leaves guide `g` where it was at the start.
    pub fn stop(&mut self, g: usize) {
        let end = self.first.get(g + 1).map_or(self.guide.len(), |&k| k as usize);
        let range = self.first[g] as usize..end;
        let [start, end] = &mut self.x;
        end[range.clone()].copy_from_slice(&start[range]);
    }

    fn strands(&self) -> MovingStrands<'_> {
        MovingStrands { x0: &self.x[0], x1: &self.x[1], strand: &self.guide }
    }

    /// How far the first guide of a place slides past the second, m.
    pub fn slip(&self, place: &ContactPair) -> Vector3<f64> {
        self.strands().slip(&place.contact)
    }

    /// Begins a sub-step: the places that are there at its start, or are met on the way to the ends that the guides have now.
    pub fn begin(&mut self) {
        self.found.clear();
        self.find_pairs();
        let (strands, places) = (self.strands(), &*self);
        let near = |Candidate { near, law }: &Candidate| {
            let contact = (near.distance < law + REACH).then(|| strands.contact_candidate(near))??;
            Some(places.place(contact))
        };
        let near: Vec<ContactPair> = self.pairs.par_iter().filter_map(near).collect();
        self.found = self.thinned(near);
        self.look();
    }

    /// Of places that stand for each other only the tightest: together they would hold the same thing twice, and share the force between them as
    /// they please.
    fn thinned(&self, near: Vec<ContactPair>) -> Vec<ContactPair> {
        let slack =
            |p: &ContactPair| self.strands().closest_pair(p.contact.pair).distance - self.law(p.contact.pair);
        let slack: Vec<f64> = near.par_iter().map(slack).collect();
        let guides = |i: usize| self.guides(&near[i].contact);
        let mut order: Vec<usize> = (0..near.len()).collect();
        order.par_sort_by_key(|&i| guides(i));
        let tightest = |same: &mut [usize]| {
            same.sort_by(|&i, &j| slack[i].total_cmp(&slack[j]));
            let mut kept: Vec<usize> = Vec::new();
            for &i in &*same {
                if kept.iter().all(|&k| !stands_for(&near[k].contact, &near[i].contact)) {
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

    /// Pairs that may meet within this sub-step, if no point moves by more than [`MARGIN`] beyond the ends as they are now.
    pub fn find_pairs(&mut self) {
        let widest = self.skin.iter().map(|s| s.hair + s.bundle).fold(0.0, f64::max);
        let reach = 2.0 * widest + REACH + MARGIN;
        let (strands, places) = (self.strands(), &*self);
        let candidate = |pair: SegmentPair| {
            let rooted = [pair.0, pair.1].iter().all(|&k| places.rooted[k as usize]);
            let near = (!rooted)
                .then(|| strands.closest_pair(pair))
                .filter(|near| strands.distance_lower_bound(near) < reach)?;
            Some(Candidate { near, law: places.law(pair) })
        };
        self.pairs = strands.broad_phase(reach).into_par_iter().filter_map(candidate).collect();
    }

    /// Looks along the motion to the ends as they are now: brings the distances of all places up to date, adds those that are met on the way
    /// and not yet known, and lists the pairs that cross. Returns how many were added.
    pub fn look(&mut self) -> usize {
        let (strands, places) = (self.strands(), &*self);
        let mut hits: Vec<Hit> = self
            .pairs
            .par_iter()
            .filter_map(|Candidate { near, law }| {
                let (contact, time) = strands.impact(near, *law)?;
                let guides = places.guides(&contact);
                Some(Hit { guides, time, contact, crosses: strands.crosses(near.pair) })
            })
            .collect();
        self.crossing.clear();
        self.crossing.extend(hits.iter().filter(|h| h.crosses).map(|h| h.contact.pair));
        let strands = MovingStrands { x0: &self.x[0], x1: &self.x[1], strand: &self.guide };
        self.found.par_iter_mut().for_each(|place| place.contact.distance = strands.distance(&place.contact));
        hits.sort_by(|a, b| a.guides.cmp(&b.guides).then(a.time.total_cmp(&b.time)));
        let mut known: Vec<([usize; 2], ContactPair)> =
            self.found.iter().map(|p| (self.guides(&p.contact), *p)).collect();
        known.sort_by_key(|(guides, _)| *guides);
        let old = self.found.len();
        for hits in hits.chunk_by(|a, b| a.guides == b.guides) {
            let from = known.partition_point(|(guides, _)| *guides < hits[0].guides);
            let known = known[from..].iter().take_while(|(guides, _)| *guides == hits[0].guides);
            let first = self.found.len();
            for hit in hits {
                // What follows an impact close by, or a place that has not been kept, would not happen without it. A place that stands for
                // the impact, and is kept, but lets the segments through all the same, does not hold them: near to each other and
                // almost along each other, they pass beside it.
                let follows = |m: &SegmentContact| slid(m, &hit.contact) <= BESIDE;
                let averts = |p: &ContactPair| !hit.crosses || !p.is_kept();
                let in_vain = known.clone().any(|(_, p)| {
                    follows(&p.contact) && p.contact.distance < 0.0
                        || stands_for(&p.contact, &hit.contact) && averts(p)
                });
                if !in_vain && !self.found[first..].iter().any(|p| follows(&p.contact)) {
                    self.found.push(self.place(hit.contact));
                }
            }
        }
        self.found.len() - old
    }

    /// Distance by the angle between two segments, m (S6).
    fn law(&self, pair: SegmentPair) -> f64 {
        self.encounter(pair).kept()
    }

    fn encounter(&self, pair: SegmentPair) -> Encounter {
        Encounter::new(self.guides_of(pair).map(|g| self.skin[g]), self.strands().directions(pair))
    }

    fn place(&self, contact: SegmentContact) -> ContactPair {
        let before = self.strands().closest_pair(contact.pair).distance;
        let known = self.recall(&contact);
        let limit = known.map_or(before, |k| k.limit.max(before));
        let encounter = self.encounter(contact.pair);
        let wanted = encounter.kept().min(limit.max(LEAST));
        let keep = if before < wanted { before + GAINED * (wanted - before) } else { wanted };
        ContactPair {
            contact,
            keep,
            limit,
            axes: encounter.axes(&contact.normal),
            cling: encounter.cohesion(before - wanted, self.strands().mean_length(contact.pair)),
            reaction: known.map_or_else(Vector3::zeros, |k| k.reaction),
        }
    }

    /// What is known of a place: of the nearest one of the same two guides.
    fn recall(&self, contact: &SegmentContact) -> Option<&Known> {
        let guides = self.guides(contact).map(|g| g as u32);
        let at = self.along_rods(contact);
        let from = self.known.partition_point(|k| k.guides < guides);
        self.known[from..]
            .iter()
            .take_while(|k| k.guides == guides)
            .map(|k| ((k.at[0] - at[0]).abs() + (k.at[1] - at[1]).abs(), k))
            .filter(|(slid, _)| *slid <= SLID)
            .min_by(|a, b| a.0.total_cmp(&b.0))
            .map(|(_, k)| k)
    }

    /// Ends a sub-step: keeps what the next needs to know.
    pub fn end(&mut self) {
        let known = self.found.iter().map(|p| Known {
            guides: self.guides(&p.contact).map(|g| g as u32),
            at: self.along_rods(&p.contact),
            limit: p.limit.max(p.contact.distance),
            reaction: p.reaction,
        });
        self.known = known.collect();
        self.known.sort_by(|a, b| {
            let places = || a.at[0].total_cmp(&b.at[0]).then(a.at[1].total_cmp(&b.at[1]));
            a.guides.cmp(&b.guides).then_with(places)
        });
        self.x.swap(0, 1);
    }

    /// How far a place of the sub-step that has just ended slid, m.
    #[cfg(test)]
    pub fn last_slip(&self, place: &ContactPair) -> Vector3<f64> {
        MovingStrands { x0: &self.x[1], x1: &self.x[0], strand: &self.guide }.slip(&place.contact)
    }
}

/// Where a contact is along the two guides, in sub-steps of the rods from the first of all.
fn along(contact: &SegmentContact) -> [f64; 2] {
    [f64::from(contact.pair.0) + contact.u[0], f64::from(contact.pair.1) + contact.u[1]].map(|k| 0.5 * k)
}

/// How far apart two meetings are along both guides together, in sub-steps of the rods.
fn slid(a: &SegmentContact, b: &SegmentContact) -> f64 {
    let (a, b) = (along(a), along(b));
    (a[0] - b[0]).abs() + (a[1] - b[1]).abs()
}

/// Whether holding two segments apart at `a` does so at `b` too.
fn stands_for(a: &SegmentContact, b: &SegmentContact) -> bool {
    slid(a, b) < SAME && a.normal.dot(&b.normal) > 0.98
}
