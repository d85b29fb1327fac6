//! Who leads whom among the guides of a groom.

use super::GuideRod;
use crate::rod::Shape;
use crate::scene::{Groom, Tree};
use nalgebra::Vector3;

/// The hierarchy of wisps as guides that lead each other: every wisp is stood for by one guide, that nearest to its centre line, for with a mean of
/// curls their curl would be lost. That of a wisp is one of those of its parts, so each guide stands for the coarsest
/// wisp that it stands for and all of the finer ones, and is led by the one that stands for the wisp around that.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Hierarchy {
    /// The guide that leads each guide; none for those that stand for coarse wisps.
    pub leader: Vec<Option<usize>>,
    /// Level of the coarsest wisp that each guide stands for, 0 for a coarse wisp; one more than the finest wisp's for one that stands for none.
    pub level: Vec<u32>,
}

impl Hierarchy {
    /// Of the guides `rods` of `groom`, which must have its trees. A guide is led by none of another material.
    pub fn new(groom: &Groom, rods: &[GuideRod]) -> Self {
        let mut hierarchy = Hierarchy { leader: vec![None; rods.len()], level: vec![0; rods.len()] };
        let mut of_leaf: Vec<_> = groom.trees.iter().map(|tree| vec![Vec::new(); tree.wisps.len()]).collect();
        rods.iter().enumerate().for_each(|(i, r)| of_leaf[r.leaf.0][r.leaf.1].push(i));
        let sections: Vec<Vec<Vector3<f64>>> = rods.iter().map(sections).collect();
        for (tree, of_leaf) in groom.trees.iter().zip(of_leaf) {
            hierarchy.add(tree, of_leaf, &sections);
        }
        for i in 0..rods.len() {
            let of = |i: usize| groom.groups[groom.guides.curves.group[rods[i].guide] as usize].material;
            let alike = |leader: &usize| of(*leader) == of(i);
            hierarchy.leader[i] = hierarchy.leader[i].filter(alike);
        }
        hierarchy
    }

    /// Adds a tree whose leaf wisps hold the guides `of_leaf`, with the places of all guides at their sections, m.
    fn add(&mut self, tree: &Tree, of_leaf: Vec<Vec<usize>>, sections: &[Vec<Vector3<f64>>]) {
        // Those of which one comes to stand for each wisp.
        let mut candidates = of_leaf;
        let mut level = vec![0; tree.wisps.len()];
        for (w, wisp) in tree.wisps.iter().enumerate() {
            level[w] = wisp.parent.map_or(0, |parent| level[parent as usize] + 1);
        }
        // Parents come before their parts.
        for (w, wisp) in tree.wisps.iter().enumerate().rev() {
            let off = |g: &usize| -> f64 {
                let pairs = sections[*g].iter().zip(&wisp.sections);
                pairs.map(|(x, section)| (x - section.centre).norm_squared()).sum()
            };
            let nearer = |a: &&usize, b: &&usize| off(a).total_cmp(&off(b)).then(a.cmp(b));
            let Some(&first) = candidates[w].iter().min_by(nearer) else { continue };
            for &g in candidates[w].iter().filter(|g| **g != first) {
                self.leader[g] = Some(first);
                // It is what stands for a part, or a guide of a leaf.
                self.level[g] = level[w] + 1;
            }
            if let Some(parent) = wisp.parent {
                candidates[parent as usize].push(first);
            }
        }
    }
}

/// Where the sections of a guide are in the groom's pose, m, rest space.
fn sections(r: &GuideRod) -> Vec<Vector3<f64>> {
    let mut shape = Shape::default();
    shape.update(&r.rod, &r.rod.root.r, &r.rod.start);
    (0..r.rod.nodes.len()).map(|node| shape.x(r.rod.node_point(node)) + r.rod.root.p).collect()
}
