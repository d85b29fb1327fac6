//! Which guides lead which.

use super::frequency_response::{RootExtent, frequency_response};
use super::guide_rod::GuideRod;
use super::leader_weights::{Difference, RestPose, leader_weights, response_error};
use crate::scene::{Groom, Tree};
use nalgebra::Vector3;
use rayon::prelude::*;

/// Largest number of leaders of a guide.
const MAX_LEADERS: usize = 12;

/// The hierarchy of wisps as leaders and followers among the guides (`docs/theory.md` §8.1). Each wisp is
/// represented by the guide closest to its centre line: a mean of curls has no curl. The representative of a
/// wisp is that of one of its parts, so a guide represents the coarsest wisp of which it is the
/// representative and all finer ones in between. Its leaders are the closest guides that represent coarser
/// wisps.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Hierarchy {
    /// For each guide, its leaders with their weights (of sum 1), the closest first; none for guides that
    /// represent the coarsest wisps.
    pub leaders: Vec<Vec<(usize, f64)>>,
    /// For each guide, the error of its leaders' mean response to small motions of the head relative to its
    /// own response; 0 without leaders.
    pub response_error: Vec<f64>,
    /// For each guide, the level of the coarsest wisp that it represents, 0 for the coarsest wisps; one more
    /// than the level of its leaf wisp if it represents none.
    pub level: Vec<u32>,
    /// For each guide, the representative of the wisp around its own, or where that has another material or other node
    /// fractions its closest leader; none for guides that represent the coarsest wisps, and without either.
    pub parent: Vec<Option<usize>>,
}

impl Hierarchy {
    /// The hierarchy of the guides `rods` of `groom`, whose trees must be built, under `gravity`, m/s², rest
    /// space. `drag(i)` are the drag coefficients at the points of guide i, N·s/m². Leaders have the material
    /// and the node fractions of their followers.
    pub fn new<'a>(
        groom: &Groom,
        rods: &[GuideRod],
        gravity: &Vector3<f64>,
        drag: impl Fn(usize) -> &'a [f64] + Sync,
    ) -> Self {
        let mut of_leaf: Vec<_> = groom.trees.iter().map(|tree| vec![Vec::new(); tree.wisps.len()]).collect();
        rods.iter().enumerate().for_each(|(i, r)| of_leaf[r.leaf.0][r.leaf.1].push(i));
        let poses: Vec<RestPose> = rods.par_iter().map(RestPose::new).collect();
        let (mut level, mut parent) = (vec![0; rods.len()], vec![None; rods.len()]);
        for (tree, of_leaf) in groom.trees.iter().zip(of_leaf) {
            elect_representatives(tree, of_leaf, &poses, &mut level, &mut parent);
        }
        let material = |i: usize| groom.groups[groom.guides.curves.group[rods[i].guide] as usize].material;
        let arc = |i: usize| &groom.trees[rods[i].leaf.0].arc;
        let deepest = level.iter().copied().max().unwrap_or(0);
        let candidates: Vec<usize> = (0..rods.len()).filter(|i| level[*i] < deepest).collect();
        let roots = RootExtent::new(rods);
        let response = |i: usize| frequency_response(&rods[i], drag(i), gravity, &roots);
        let responses: Vec<_> = candidates.par_iter().map(|i| response(*i)).collect();
        let leaders = |i: usize| {
            let may_lead = |j: usize| level[j] < level[i] && material(j) == material(i) && arc(j) == arc(i);
            let pose_difference = |j: usize| poses[j].difference(&poses[i]);
            let mut near: Vec<(f64, usize)> = (0..candidates.len())
                .filter(|l| may_lead(candidates[*l]))
                .map(|l| (pose_difference(candidates[l]).square(), l))
                .collect();
            near.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
            near.truncate(MAX_LEADERS);
            if near.is_empty() {
                return (Vec::new(), 0.0);
            }
            let own = response(i);
            let difference = |(_, l): &(f64, usize)| {
                poses[i].with_response(pose_difference(candidates[*l]), &own, &responses[*l])
            };
            let differences: Vec<Difference> = near.iter().map(difference).collect();
            let weights = leader_weights(&differences);
            let error = response_error(&differences, &weights);
            (near.iter().map(|(_, l)| candidates[*l]).zip(weights).collect(), error)
        };
        let (leaders, response_error): (Vec<Vec<(usize, f64)>>, _) =
            (0..rods.len()).into_par_iter().map(leaders).unzip();
        // What acts on a guide acts on one that it moves with.
        for (i, parent) in parent.iter_mut().enumerate() {
            if parent.is_some_and(|j| material(j) != material(i) || arc(j) != arc(i)) {
                *parent = leaders[i].first().map(|(leader, _)| *leader);
            }
        }
        Hierarchy { leaders, response_error, level, parent }
    }

    /// Extends `active` (one flag per guide) to all guides on which active ones depend: their leaders and
    /// parents. Removes the leaders of all others.
    pub fn restrict_to(&mut self, active: &mut [bool]) {
        let mut order: Vec<usize> = (0..self.level.len()).collect();
        // Leaders and parents represent coarser wisps, so they come later.
        order.sort_by_key(|i| std::cmp::Reverse(self.level[*i]));
        for i in order {
            if active[i] {
                let leaders = self.leaders[i].iter().map(|(leader, _)| *leader);
                leaders.chain(self.parent[i]).for_each(|j| active[j] = true);
            } else {
                self.leaders[i].clear();
            }
        }
    }
}

/// Elects the representatives of the wisps of a tree, whose leaf wisps hold the guides `of_leaf`, and sets
/// `level` and `parent` of these guides.
fn elect_representatives(
    tree: &Tree,
    of_leaf: Vec<Vec<usize>>,
    poses: &[RestPose],
    level: &mut [u32],
    parent: &mut [Option<usize>],
) {
    // For each wisp, its guides if it is a leaf, and else the representatives of its parts.
    let mut candidates = of_leaf;
    let mut wisp_level = vec![0; tree.wisps.len()];
    for (w, wisp) in tree.wisps.iter().enumerate() {
        wisp_level[w] = wisp.parent.map_or(0, |parent| wisp_level[parent as usize] + 1);
    }
    // Wisps are stored before their parts.
    for (w, wisp) in tree.wisps.iter().enumerate().rev() {
        let distance = |g: &usize| poses[*g].distance_from(&wisp.sections);
        let nearer = |a: &&usize, b: &&usize| distance(a).total_cmp(&distance(b)).then(a.cmp(b));
        let Some(&representative) = candidates[w].iter().min_by(nearer) else { continue };
        for &g in candidates[w].iter().filter(|g| **g != representative) {
            (level[g], parent[g]) = (wisp_level[w] + 1, Some(representative));
        }
        if let Some(parent) = wisp.parent {
            candidates[parent as usize].push(representative);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn restriction_keeps_dependencies_and_clears_other_leaders() {
        // 3 is led by 1, whose leader is 0 and whose parent is 2; 4 is led by 0.
        let led_by = |leaders: &[usize]| leaders.iter().map(|j| (*j, 1.0)).collect::<Vec<_>>();
        let mut hierarchy = Hierarchy {
            leaders: [&[][..], &[0], &[], &[1], &[0]].map(led_by).to_vec(),
            response_error: vec![0.0; 5],
            level: vec![0, 1, 0, 2, 1],
            parent: vec![None, Some(2), None, Some(1), Some(0)],
        };
        let mut active = vec![false, false, false, true, false];
        hierarchy.restrict_to(&mut active);
        assert_eq!(active, [true, true, true, true, false]);
        assert_eq!(hierarchy.leaders[3], led_by(&[1]));
        assert!(hierarchy.leaders[4].is_empty());
    }
}
