//! Wisps in motion: which guides move by themselves, and which follow the one that leads them (`docs/theory.md` §8; Bertails, Kim, Cani & Neumann
//! 2003).

use super::guide::{Guide, Surroundings};
use super::state::Unfit;
use crate::contact::Outside;
use crate::math::se3::Pose;
use crate::rod::{Rod, Shape};
use crate::wisp::Hierarchy;
use nalgebra::{Isometry3, Matrix3, Vector3};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

/// Time in which the motion that a guide has of its own when it begins to follow fades, and for which it moves by itself at least, s.
const FADING: f64 = 0.25;

/// How many times less than in a free fall a guide parts from its wisp that is stirred: hair is held by its stiffness, its air and its likes.
/// Measured on three of the samples (short, short curly, long), shaken: the mean of what strands are off is then below the share that they may part.
const HELD: f64 = 20.0;

/// Share of the stirring at which a guide comes away from its wisp, below which it may join again.
const CALM: f64 = 0.5;

/// How far a guide that follows may go into a body's thickness; before it would go farther, it comes away. As a share of that.
const INTRUSION: f64 = 0.5;

const G: f64 = 9.81;

/// The guides of a groom as wisps: those that lead, and those that follow them as far as they have not come away.
pub(super) struct Wisps {
    hierarchy: Hierarchy,
    /// The share of its length by which a guide may part from its wisp before it comes away; `None` where none does.
    parting: Option<f64>,
    /// How far a guide that follows may go into the thickness of each body, m.
    slack: Vec<f64>,
    /// Length of a sub-step, s.
    h: f64,
    /// How each guide rests; none before wisps are gathered.
    rest: Vec<Rest>,
    followers: Vec<Follower>,
    /// Where each guide that follows was last seen outside of bodies.
    memory: Vec<Vec<Outside>>,
}

/// A guide at rest.
#[derive(Debug, Clone, Default)]
struct Rest {
    /// Unknowns, 1/m.
    q: Vec<f64>,
    /// What turns the deviation of its leader from rest into its own, node by node.
    carry: Vec<Matrix3<f64>>,
    /// Distance to its leader at each node, m.
    apart: Vec<f64>,
    /// Distance from bodies at which it comes away, m; see [`Guide::kept`].
    kept: Vec<f64>,
}

/// What changes of a guide beside its motion.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
struct Follower {
    /// Whether it follows its leader.
    follows: bool,
    /// Since when it does what it does, s.
    since: f64,
    /// Where it follows: by how much it lies otherwise beside its leader than it did at rest, 1/m, and how fast it came to, 1/(m·s).
    offset: Vec<f64>,
    drift: Vec<f64>,
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

/// What is to become of a guide.
#[derive(Debug, Clone)]
enum Change {
    /// It moves by itself from now on: its unknowns now, and one and two sub-steps ago.
    Split([Vec<f64>; 3]),
    /// It follows.
    Merge(Follower),
}

impl Wisps {
    /// Every guide by itself, until [`Wisps::gather`]. `thickness` is that of each body, m, `h` the sub-step, s.
    pub fn new(hierarchy: Hierarchy, parting: Option<f64>, thickness: Vec<f64>, h: f64) -> Self {
        let guides = hierarchy.leader.len();
        Wisps {
            hierarchy,
            parting,
            slack: thickness.into_iter().map(|d| INTRUSION * d).collect(),
            h,
            rest: Vec::new(),
            followers: vec![Follower::default(); guides],
            memory: vec![Vec::new(); guides],
        }
    }

    /// Whether guide `i` moves by itself.
    pub fn is_free(&self, i: usize) -> bool {
        !self.followers[i].follows
    }

    /// The guide that guide `i` moves with: itself, or that which it follows, which moves by itself.
    pub fn mover(&self, i: usize) -> usize {
        match self.hierarchy.leader[i] {
            Some(leader) if !self.is_free(i) => self.mover(leader),
            _ => i,
        }
    }

    /// Level of the wisp that guide `i` moves with.
    pub fn level(&self, i: usize) -> u32 {
        match self.hierarchy.leader[i] {
            Some(leader) if !self.is_free(i) => self.level(leader),
            _ => self.hierarchy.level[i],
        }
    }

    /// Lets all guides that something leads follow; how each of `guides` is now, beside the others, is how it rests. What a tie holds moves by itself.
    pub fn gather(&mut self, guides: &[Guide]) {
        self.settle(guides, guides.iter().map(|g| g.q[0].clone()).collect());
        for (i, follower) in self.followers.iter_mut().enumerate() {
            follower.follows = self.hierarchy.leader[i].is_some() && guides[i].ties.is_empty();
        }
    }

    /// Takes `guides` as resting at unknowns `q`, 1/m.
    fn settle(&mut self, guides: &[Guide], q: Vec<Vec<f64>>) {
        let poses: Vec<Vec<Pose>> =
            guides.par_iter().zip(&q).map(|(guide, q)| sections(&guide.rod, q)).collect();
        let leader = &self.hierarchy.leader;
        let rest = |(i, q): (usize, Vec<f64>)| {
            let Some(l) = leader[i] else { return Rest { q, ..Rest::default() } };
            let pairs = || poses[i].iter().zip(&poses[l]);
            // Both turn alike at the same share of their length.
            let scale = guides[l].rod.length() / guides[i].rod.length();
            let carry = pairs().map(|(own, led)| own.r.transpose() * led.r * scale).collect();
            let apart = pairs().map(|(own, led)| (own.p - led.p).norm()).collect();
            Rest { q, carry, apart, kept: guides[i].kept(&self.slack) }
        };
        self.rest = q.into_iter().enumerate().map(rest).collect();
    }

    /// Unknowns of guide `i`, 1/m, `back` sub-steps before time `t`, s, `guides` being at `t`.
    pub fn unknowns(&self, guides: &[Guide], i: usize, back: usize, t: f64) -> Vec<f64> {
        if self.is_free(i) {
            return guides[i].q[back].clone();
        }
        let mut q = self.led(guides, i, back, t);
        self.followers[i].add_own(t - back as f64 * self.h, &mut q);
        q
    }

    /// The same as its leader alone makes them: it deviates from rest as its leader does.
    fn led(&self, guides: &[Guide], i: usize, back: usize, t: f64) -> Vec<f64> {
        let Some(leader) = self.hierarchy.leader[i] else { return guides[i].q[back].clone() };
        let mut q = self.unknowns(guides, leader, back, t);
        let (own, led) = (&self.rest[i], &self.rest[leader]);
        for (k, (q, carry)) in q.chunks_exact_mut(3).zip(&own.carry).enumerate() {
            let [at_rest, rest] = [&led.q, &own.q].map(|q| Vector3::from_column_slice(&q[3 * k..3 * k + 3]));
            let deviation = Vector3::from_column_slice(q) - at_rest;
            q.copy_from_slice((rest + carry * deviation).as_slice());
        }
        q
    }

    /// Lets guides come away from their wisps where these are stirred at time `t`, s, the end of a sub-step. `looks` says whether it
    /// is the time to look which are calm enough to join again.
    pub fn adapt(&mut self, guides: &mut [Guide], around: &Surroundings, t: f64, looks: bool) -> Changes {
        let Some(parting) = self.parting else { return Changes::default() };
        let heads = [t, t - self.h].map(|t| Moving::new(around, t));
        let stirred: Vec<Vec<f64>> = guides
            .par_iter()
            .enumerate()
            .map(|(i, g)| if self.is_free(i) { g.accelerations(&heads, self.h) } else { Vec::new() })
            .collect();
        // At the end of the next sub-step; what deforms is taken to stay as it is.
        let poses: Vec<_> = (0..around.bodies.len()).map(|b| (around.body)(b, t + self.h)).collect();
        let mut memory = std::mem::take(&mut self.memory);
        let change = |(i, memory): (usize, &mut Vec<Outside>)| {
            let leader = self.hierarchy.leader[i].filter(|_| guides[i].ties.is_empty())?;
            let length = guides[i].rod.length();
            // In the time of a free fall of its length, √(2 L / g), with the share ϱ/L of its leader's acceleration.
            let share = self.stirring(leader, &self.rest[i].apart, &stirred) / (G * length) / HELD;
            if !self.is_free(i) {
                let parts = share > parting || self.intrudes(guides, i, around, t, &poses, memory);
                return parts.then(|| Change::Split([0, 1, 2].map(|back| self.unknowns(guides, i, back, t))));
            }
            let rested = t - self.followers[i].since >= FADING - 0.5 * self.h;
            if !(looks && rested && share < CALM * parting) {
                return None;
            }
            let led = [0, 1, 2].map(|back| self.led(guides, i, back, t));
            let own = |n: usize| [0, 1, 2].map(|back| guides[i].q[back][n] - led[back][n]);
            let n = 0..led[0].len();
            let joined = Follower {
                follows: true,
                since: t,
                offset: n.clone().map(|n| own(n)[0]).collect(),
                drift: n.map(|n| slope(own(n), self.h)).collect(),
            };
            // As it will go, whatever it has of its own.
            let ahead = |later: f64| {
                let mut q = led[0].clone();
                joined.add_own(t + later, &mut q);
                points(&guides[i].rod, &q, around, t)
            };
            let [now, next] = [ahead(0.0), ahead(self.h)];
            let parts = now
                .iter()
                .zip(&next)
                .map(|(a, b)| (b - a).norm_squared() / (self.h * self.h))
                .fold(0.0, f64::max);
            (parts < parting * parting * G * length).then_some(Change::Merge(joined))
        };
        let changes: Vec<Option<Change>> = memory.par_iter_mut().enumerate().map(change).collect();
        self.memory = memory;
        let mut done = Changes::default();
        for (i, change) in changes.into_iter().enumerate() {
            match change {
                None => {}
                Some(Change::Split(q)) => {
                    guides[i].place(q, around, t, self.h);
                    self.followers[i] = Follower { since: t, ..Follower::default() };
                    done.splits += 1;
                }
                Some(Change::Merge(follower)) => {
                    self.followers[i] = follower;
                    done.merges += 1;
                }
            }
        }
        done
    }

    /// Largest product of the acceleration of what leads a guide and the distance from it, m²/s², by the guide's `leader`, its distance
    /// `apart` from that at each node, and the accelerations of all that move by themselves.
    fn stirring(&self, leader: usize, apart: &[f64], stirred: &[Vec<f64>]) -> f64 {
        let mut apart = apart.to_vec();
        let mut leader = leader;
        while let (false, Some(next)) = (self.is_free(leader), self.hierarchy.leader[leader]) {
            apart.iter_mut().zip(&self.rest[leader].apart).for_each(|(a, more)| *a += more);
            leader = next;
        }
        stirred[leader].iter().zip(&apart).map(|(a, apart)| a * apart).fold(0.0, f64::max)
    }

    /// Whether guide `i`, going on as it goes at time `t`, s, is too deep in a body's thickness at the end of the next sub-step.
    fn intrudes(
        &self,
        guides: &[Guide],
        i: usize,
        around: &Surroundings,
        t: f64,
        poses: &[Isometry3<f64>],
        memory: &mut Vec<Outside>,
    ) -> bool {
        // Strains go on by their last three values; where the root goes is known.
        let [mut q, one, two] = [0, 1, 2].map(|back| self.unknowns(guides, i, back, t));
        q.iter_mut().zip(one.iter().zip(&two)).for_each(|(q, (one, two))| *q = 3.0 * (*q - one) + two);
        let next = points(&guides[i].rod, &q, around, t + self.h);
        around.bodies.any_nearer((t, poses), &next, &self.rest[i].kept, memory)
    }
}

/// The head at a moment, and how it moves.
pub(super) struct Moving {
    pose: Isometry3<f64>,
    beside: [Isometry3<f64>; 2],
}

impl Moving {
    /// Half the time over which its velocity is taken, s.
    const DELTA: f64 = 1e-4;

    pub fn new(around: &Surroundings, t: f64) -> Self {
        let beside = [t + Moving::DELTA, t - Moving::DELTA].map(|t| (around.head)(t));
        Moving { pose: (around.head)(t), beside }
    }

    /// Velocity `v`, m/s, of what is at `x`, m, as seen from the head, in its frame.
    pub fn seen(&self, x: &Vector3<f64>, v: &Vector3<f64>) -> Vector3<f64> {
        let local = self.pose.inverse_transform_point(&(*x).into());
        let carried = (self.beside[0] * local - self.beside[1] * local) / (2.0 * Moving::DELTA);
        self.pose.rotation.inverse() * (v - carried)
    }

    /// A vector of its frame in the world.
    pub fn to_world(&self, v: &Vector3<f64>) -> Vector3<f64> {
        self.pose.rotation * v
    }
}

/// Frame and place of a rod at each node, rest space, at unknowns `q`, 1/m.
fn sections(rod: &Rod, q: &[f64]) -> Vec<Pose> {
    let mut shape = Shape::default();
    shape.update(rod, &rod.root.r, q);
    let poses: Vec<Pose> = shape.poses().collect();
    let section = |node: usize| {
        let Pose { r, p } = poses[rod.node_point(node)];
        Pose { r, p: p + rod.root.p }
    };
    (0..rod.nodes.len()).map(section).collect()
}

/// Points of a rod, m, world, at unknowns `q`, 1/m, and time `t`, s.
fn points(rod: &Rod, q: &[f64], around: &Surroundings, t: f64) -> Vec<Vector3<f64>> {
    let root = around.root(&rod.root, t);
    let mut shape = Shape::default();
    shape.update(rod, &root.r, q);
    (0..rod.points()).map(|k| shape.x(k) + root.p).collect()
}

/// Rate now by three values a step of `h`, s, apart, the newest first; of second order.
pub(super) fn slope([now, one, two]: [f64; 3], h: f64) -> f64 {
    (3.0 * now - 4.0 * one + two) / (2.0 * h)
}

/// What a checkpoint holds of wisps.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub(super) struct Saved {
    rest: Vec<Vec<f64>>,
    followers: Vec<Follower>,
}

impl Wisps {
    /// What changes.
    pub fn state(&self) -> Saved {
        Saved { rest: self.rest.iter().map(|r| r.q.clone()).collect(), followers: self.followers.clone() }
    }

    /// Goes back to a state of the same `guides`.
    pub fn restore(&mut self, state: Saved, guides: &[Guide]) -> Result<(), Unfit> {
        Unfit::unless_same("followers", state.followers.len(), guides.len())?;
        self.followers = state.followers;
        self.rest.clear();
        if !state.rest.is_empty() {
            Unfit::unless_same("guides at rest", state.rest.len(), guides.len())?;
            for (q, guide) in state.rest.iter().zip(guides) {
                Unfit::unless_same("unknowns at rest", q.len(), guide.rod.unknowns())?;
            }
            self.settle(guides, state.rest);
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_joins_goes_on_as_it_went_until_it_has_faded() {
        let joined = Follower { follows: true, since: 1.0, offset: vec![0.1], drift: vec![2.0] };
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
