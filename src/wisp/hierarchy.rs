//! Who leads whom among the guides of a groom.

use super::response::{Scalp, response};
use super::{GuideRod, LinearKinematics};
use crate::math::cholesky;
use crate::rod::RodShape;
use crate::scene::{Groom, Tree};
use nalgebra::Vector3;
use rayon::prelude::*;

/// Most guides that lead one.
const LEADERS: usize = 12;

/// How dearly leaders far away are paid for; see [`shares`].
const SPREAD: f64 = 0.03;

/// How dearly it is paid for that hair lies elsewhere by its length, where answering otherwise altogether costs 1.
const PLACE: f64 = 0.3;

/// The hierarchy of wisps as guides that lead each other: every wisp is stood for by one guide, that nearest to its centre line, for with a mean of
/// curls their curl would be lost. That of a wisp is one of those of its parts, so each guide stands for the coarsest
/// wisp that it stands for and all of the finer ones. It is led by those that stand for coarser wisps and lie nearest: that around it and its neighbours.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Hierarchy {
    /// The guides that lead each guide and their shares, of sum 1, the nearest first; none for those that stand for coarse wisps.
    pub leaders: Vec<Vec<(usize, f64)>>,
    /// Share of each guide's answers to small motions of the head that the mean of its leaders' misses; 0 without leaders.
    pub response_error: Vec<f64>,
    /// Level of the coarsest wisp that each guide stands for, 0 for a coarse wisp; one more than the finest wisp's for one that stands for none.
    pub level: Vec<u32>,
    /// The guide that stands for the wisp around each guide's own; none for those that stand for coarse wisps.
    pub parent: Vec<Option<usize>>,
}

impl Hierarchy {
    /// Of the guides `rods` of `groom`, which must have its trees, pulled by `pull`, m/s², rest space; `drag` is that of the points of each, N·s/m². A guide is
    /// led by none of another material or with its nodes elsewhere.
    pub fn new<'a>(
        groom: &Groom,
        rods: &[GuideRod],
        pull: &Vector3<f64>,
        drag: impl Fn(usize) -> &'a [f64] + Sync,
    ) -> Self {
        let mut of_leaf: Vec<_> = groom.trees.iter().map(|tree| vec![Vec::new(); tree.wisps.len()]).collect();
        rods.iter().enumerate().for_each(|(i, r)| of_leaf[r.leaf.0][r.leaf.1].push(i));
        let stances: Vec<Stance> = rods.par_iter().map(Stance::new).collect();
        let (mut level, mut parent) = (vec![0; rods.len()], vec![None; rods.len()]);
        for (tree, of_leaf) in groom.trees.iter().zip(of_leaf) {
            rank(tree, of_leaf, &stances, &mut level, &mut parent);
        }
        let material = |i: usize| groom.groups[groom.guides.curves.group[rods[i].guide] as usize].material;
        let arc = |i: usize| &groom.trees[rods[i].leaf.0].arc;
        let mut may_lead: Vec<usize> = (0..rods.len()).collect();
        let deepest = level.iter().copied().max().unwrap_or(0);
        may_lead.retain(|i| level[*i] < deepest);
        let scalp = Scalp::new(rods);
        let answer = |i: usize| response(&rods[i], drag(i), pull, &scalp);
        let answers: Vec<_> = may_lead.par_iter().map(|i| answer(*i)).collect();
        let leaders = |i: usize| {
            let fit = |j: &usize| level[*j] < level[i] && material(*j) == material(i) && arc(*j) == arc(i);
            let beside = |j: usize| stances[j].beside(&stances[i]);
            let mut near: Vec<(f64, usize)> = (0..may_lead.len())
                .filter(|l| fit(&may_lead[*l]))
                .map(|l| (beside(may_lead[l]).square(), l))
                .collect();
            near.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
            near.truncate(LEADERS);
            if near.is_empty() {
                return (Vec::new(), 0.0);
            }
            let own = answer(i);
            let apart = |l: usize| stances[i].apart(beside(may_lead[l]), &own, &answers[l]);
            let apart: Vec<Apart> = near.iter().map(|(_, l)| apart(*l)).collect();
            let shares = shares(&apart);
            let missed = missed(&apart, &shares);
            (near.iter().map(|(_, l)| may_lead[*l]).zip(shares).collect(), missed)
        };
        let (leaders, response_error) = (0..rods.len()).into_par_iter().map(leaders).unzip();
        Hierarchy { leaders, response_error, level, parent }
    }

    /// Adds to `moved`, which tells of each guide whether it moves, all that those depend on: what leads them, and what stands for the wisps around them. What does
    /// not move follows nothing from now on.
    pub fn restrict_to(&mut self, moved: &mut [bool]) {
        let mut order: Vec<usize> = (0..self.level.len()).collect();
        // All of these stand for coarser wisps.
        order.sort_by_key(|i| std::cmp::Reverse(self.level[*i]));
        for i in order {
            if moved[i] {
                let leaders = self.leaders[i].iter().map(|(leader, _)| *leader);
                leaders.chain(self.parent[i]).for_each(|j| moved[j] = true);
            } else {
                self.leaders[i].clear();
            }
        }
    }
}

/// Sets the `level` of guides, and what stands for the wisp `around` theirs, of a tree whose leaf wisps hold the guides `of_leaf`, all guides standing so.
fn rank(
    tree: &Tree,
    of_leaf: Vec<Vec<usize>>,
    stances: &[Stance],
    level: &mut [u32],
    around: &mut [Option<usize>],
) {
    // Those of which one comes to stand for each wisp.
    let mut candidates = of_leaf;
    let mut wisp_level = vec![0; tree.wisps.len()];
    for (w, wisp) in tree.wisps.iter().enumerate() {
        wisp_level[w] = wisp.parent.map_or(0, |parent| wisp_level[parent as usize] + 1);
    }
    // Parents come before their parts.
    for (w, wisp) in tree.wisps.iter().enumerate().rev() {
        let off = |g: &usize| -> f64 {
            let pairs = stances[*g].sections.iter().zip(&wisp.sections);
            pairs.map(|(x, section)| (x - section.centre).norm_squared()).sum()
        };
        let nearer = |a: &&usize, b: &&usize| off(a).total_cmp(&off(b)).then(a.cmp(b));
        let Some(&first) = candidates[w].iter().min_by(nearer) else { continue };
        for &g in candidates[w].iter().filter(|g| **g != first) {
            // It is what stands for a part, or a guide of a leaf.
            (level[g], around[g]) = (wisp_level[w] + 1, Some(first));
        }
        if let Some(parent) = wisp.parent {
            candidates[parent as usize].push(first);
        }
    }
}

/// How a guide stands at rest.
struct Stance {
    /// Its sections, m, rest space.
    sections: Vec<Vector3<f64>>,
    length: f64,
    reach: LinearKinematics,
}

impl Stance {
    fn new(r: &GuideRod) -> Self {
        let mut shape = RodShape::default();
        shape.update(&r.rod, &r.rod.root.r, &r.rod.initial_q);
        let section = |node: usize| shape.x(r.rod.node_point(node)) + r.rod.root.p;
        let sections: Vec<_> = (0..r.rod.nodes.len()).map(section).collect();
        Stance { reach: LinearKinematics::new(&sections, &r.rod.nodes), sections, length: r.rod.length() }
    }

    /// What it is elsewhere than `other`: section by section, and by its length; m, weighted so that a product is the mean along the hair.
    fn beside(&self, other: &Self) -> Apart {
        let scale = 1.0 / (self.sections.len() as f64).sqrt();
        let sections = self.sections.iter().zip(&other.sections).map(|(a, b)| (a - b) * scale);
        let place = sections.chain([Vector3::x() * (self.length - other.length)]).collect();
        Apart { place, answer: Vec::new() }
    }

    /// What a leader that is `beside` this guide is otherwise, both in place and in how this guide would move if it turned as the leader's answers `led`
    /// say and not as its `own`: without unit.
    fn apart(&self, beside: Apart, own: &[Vec<Vector3<f64>>], led: &[Vec<Vector3<f64>>]) -> Apart {
        let ways = |turn: Vec<Vector3<f64>>| {
            self.reach.displacements(turn.into_iter()).map(|(way, _)| way).collect::<Vec<_>>()
        };
        let moved: f64 = own.iter().flat_map(|own| ways(own.clone())).map(|way| way.norm_squared()).sum();
        let other = |(own, led): (&Vec<Vector3<f64>>, &Vec<Vector3<f64>>)| {
            ways(led.iter().zip(own).map(|(led, own)| (led - own) / moved.sqrt()).collect())
        };
        let place = beside.place.into_iter().map(|d| d * (PLACE.sqrt() / self.length)).collect();
        Apart { place, answer: own.iter().zip(led).flat_map(other).collect() }
    }
}

/// What a guide is otherwise than another, in parts that count alike.
struct Apart {
    /// In how it lies and how long it is.
    place: Vec<Vector3<f64>>,
    /// In how it answers motions of the head.
    answer: Vec<Vector3<f64>>,
}

impl Apart {
    fn dot(&self, other: &Self) -> f64 {
        let dot =
            |a: &[Vector3<f64>], b: &[Vector3<f64>]| a.iter().zip(b).map(|(a, b)| a.dot(b)).sum::<f64>();
        dot(&self.place, &other.place) + dot(&self.answer, &other.answer)
    }

    fn square(&self) -> f64 {
        self.dot(self)
    }
}

/// Shares w of leaders that are `apart` from a guide, with which their mean comes nearest to it while it is not made of what is far: least
/// |Σ w_j d_j|² + ε Σ w_j² |d_j|², Σ w_j = 1, with means along the hair. Some may be below 0, as what differs from leader to leader goes on beyond them.
fn shares(apart: &[Apart]) -> Vec<f64> {
    let n = apart.len();
    let mut normal: Vec<f64> = (0..n * n).map(|at| apart[at / n].dot(&apart[at % n])).collect();
    for j in 0..n {
        // One that lies on the guide may have it all.
        normal[j * n + j] += SPREAD * normal[j * n + j] + f64::MIN_POSITIVE;
    }
    let mut shares = vec![1.0; n];
    if cholesky::factor(&mut normal, n) == 1 {
        cholesky::solve(&normal, n, &mut shares);
    }
    let sum: f64 = shares.iter().sum();
    shares.iter().map(|w| w / sum).collect()
}

/// Share of its answers that a guide's leaders, which are `apart` from it, miss with these shares.
fn missed(apart: &[Apart], shares: &[f64]) -> f64 {
    let part = |k: usize| -> Vector3<f64> { apart.iter().zip(shares).map(|(a, w)| a.answer[k] * *w).sum() };
    (0..apart[0].answer.len()).map(|k| part(k).norm_squared()).sum::<f64>().sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_moves_brings_along_what_it_depends_on_and_the_rest_follows_nothing() {
        // 3 is led by 1, that by 0 and stands within the wisp of 2; 4 is led by 0.
        let led_by = |leaders: &[usize]| leaders.iter().map(|j| (*j, 1.0)).collect::<Vec<_>>();
        let mut hierarchy = Hierarchy {
            leaders: [&[][..], &[0], &[], &[1], &[0]].map(led_by).to_vec(),
            response_error: vec![0.0; 5],
            level: vec![0, 1, 0, 2, 1],
            parent: vec![None, Some(2), None, Some(1), Some(0)],
        };
        let mut moved = vec![false, false, false, true, false];
        hierarchy.restrict_to(&mut moved);
        assert_eq!(moved, [true, true, true, true, false]);
        assert_eq!(hierarchy.leaders[3], led_by(&[1]));
        assert!(hierarchy.leaders[4].is_empty());
    }

    #[test]
    fn shares_are_those_of_the_mean_that_comes_nearest() {
        let hair = |x: f64, y: f64, length: f64| {
            let arc: Vec<f64> = (0..8).map(|k| length / 7.0 * f64::from(k)).collect();
            let sections: Vec<_> = arc.iter().map(|s| Vector3::new(x, y, *s)).collect();
            Stance { reach: LinearKinematics::new(&sections, &arc), sections, length }
        };
        let leaders = [(0.0, 0.0), (0.02, 0.0), (0.0, 0.02), (0.02, 0.02)];
        let of = |guide: &Stance, lengths: [f64; 4]| {
            let apart = leaders.iter().zip(lengths).map(|(l, length)| hair(l.0, l.1, length).beside(guide));
            let shares = shares(&apart.collect::<Vec<_>>());
            assert!((shares.iter().sum::<f64>() - 1.0).abs() < 1e-12);
            let middle: Vector3<f64> =
                leaders.iter().zip(&shares).map(|(l, w)| Vector3::new(l.0, l.1, 0.0) * *w).sum();
            (shares, middle)
        };
        let (even, _) = of(&hair(0.01, 0.01, 0.1), [0.1; 4]);
        assert!(even.iter().all(|w| (w - 0.25).abs() < 1e-9), "{even:?}");
        let (uneven, middle) = of(&hair(0.006, 0.004, 0.1), [0.1; 4]);
        assert!(
            (middle - Vector3::new(0.006, 0.004, 0.0)).norm() < 1e-3 && uneven[0] > 0.4,
            "{uneven:?} {middle}"
        );
        // A little beyond them all; on one of them: that one alone; of the length of two of them: more of these.
        let (_, beyond) = of(&hair(-0.002, 0.01, 0.1), [0.1; 4]);
        assert!((-0.002..0.002).contains(&beyond.x), "{beyond}");
        let (on, _) = of(&hair(0.02, 0.0, 0.1), [0.1; 4]);
        assert!((on[1] - 1.0).abs() < 1e-9, "{on:?}");
        let (long, _) = of(&hair(0.01, 0.01, 0.12), [0.12, 0.1, 0.1, 0.12]);
        assert!(long[0] > 0.4 && long[3] > 0.4, "{long:?}");
    }
}
