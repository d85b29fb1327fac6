//! The GC hierarchy over a set of guides: wisps of guides with near roots and similar orientation along their whole length,
//! level by level from the coarse ones, with centre lines, frames and radii.

use super::cluster::{Space, divide};
use super::sections::{Features, Sections, distance_squared};
use crate::math::frame::rotation_minimising;
use crate::math::percentile;
use crate::math::spline::ArcSpline;
use crate::scene::{Section, Tree, Wisp};
use nalgebra::{UnitQuaternion, Vector3};
use rayon::prelude::*;

/// Most guides in a leaf wisp; leaves hold two on average.
const LEAF_GUIDES: usize = 3;
/// Wisps that a wisp splits into, on average, where the number of coarse ones is not given.
const BRANCHING: usize = 5;
/// Neighbours whose spacing gives a guide's own share of space.
const NEIGHBOURS: usize = 4;
/// Most room of a guide, as a multiple of the median over all guides at the same section.
const WIDEST: f64 = 1.5;
/// Smallest radius of a wisp, m.
const THINNEST: f64 = 1e-4;

/// The shape of the hierarchy.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Depth {
    /// Levels, 1 or more: 1 is leaf wisps alone, 2 is coarse wisps split into leaf wisps.
    pub levels: usize,
    /// Number of coarse wisps; `None` for a branching of about five at each level.
    pub coarse: Option<usize>,
    /// Number of leaf wisps; `None` for half as many as there are guides. A leaf never holds more than three guides.
    pub leaves: Option<usize>,
}

/// Groups guides into nested sets: `[level][wisp]` = (parent on the level above, guides in ascending order).
pub(super) fn nest(features: &Features, weight: &[f64], depth: Depth) -> Vec<Vec<(u32, Vec<u32>)>> {
    let guides = features.len();
    let leaves = depth.leaves.unwrap_or(guides.div_ceil(2)).clamp(1, guides);
    let coarse = depth
        .coarse
        .unwrap_or_else(|| (leaves as f64 / BRANCHING.pow(depth.levels as u32 - 1) as f64).ceil() as usize)
        .clamp(1, leaves);
    let space = Space { features, weight };
    let mut levels: Vec<Vec<(u32, Vec<u32>)>> = Vec::new();
    let mut sets = vec![(0..guides as u32).collect::<Vec<_>>()];
    for level in 0..depth.levels {
        // Numbers grow in equal ratio from the coarse level to the leaves.
        let share = if depth.levels > 1 { level as f64 / (depth.levels - 1) as f64 } else { 1.0 };
        let target = (coarse as f64 * (leaves as f64 / coarse as f64).powf(share)).round() as usize;
        let most = if level + 1 == depth.levels { LEAF_GUIDES } else { usize::MAX };
        let children: Vec<(u32, Vec<u32>)> = divide(space, &sets, target, most)
            .into_iter()
            .enumerate()
            .flat_map(|(parent, clusters)| clusters.into_iter().map(move |c| (parent as u32, c.members)))
            .collect();
        sets = children.iter().map(|c| c.1.clone()).collect();
        levels.push(children);
    }
    levels
}

/// The room a guide has for the hairs it stands for: at each section half the mean distance, square to the guide, of its
/// nearest neighbours in the measure of [`Features`]; m, `guides × sections`.
pub(super) fn footprints(guides: &Sections, features: &Features) -> Vec<f64> {
    let n = guides.len();
    let row = |i: usize| {
        let mut order: Vec<(f64, usize)> = (0..n)
            .filter(|&j| j != i)
            .map(|j| (distance_squared(features.row(i), features.row(j)), j))
            .collect();
        order.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        order.truncate(NEIGHBOURS);
        (0..guides.count)
            .map(move |k| {
                let (x, t) = (guides.points(i)[k], guides.tangents(i)[k]);
                let sum: f64 = order.iter().map(|&(_, j)| across(guides.points(j)[k] - x, t)).sum();
                (0.5 * sum / order.len().max(1) as f64).max(THINNEST)
            })
            .collect::<Vec<f64>>()
    };
    let mut room: Vec<f64> = (0..n).into_par_iter().flat_map_iter(row).collect();
    // A guide whose neighbours part from it would else fill the gap with stray hairs.
    for k in 0..guides.count {
        let most = WIDEST * percentile((0..n).map(|i| room[i * guides.count + k]).collect(), 0.5);
        (0..n).for_each(|i| room[i * guides.count + k] = room[i * guides.count + k].min(most));
    }
    room
}

/// Length of the part of `d` square to the unit vector `t`.
pub(super) fn across(d: Vector3<f64>, t: Vector3<f64>) -> f64 {
    (d - t * d.dot(&t)).norm()
}

/// What fills the wisps.
pub(super) struct Members<'a> {
    /// The guides in sections.
    pub(super) guides: &'a Sections,
    /// Hairs each guide stands for.
    pub(super) hairs: &'a [u32],
    /// Room of each guide ([`footprints`]).
    pub(super) footprint: &'a [f64],
    /// The render strands in sections; may be none.
    pub(super) strands: &'a Sections,
    /// The guide that each of them follows.
    pub(super) follows: &'a [u32],
}

/// Builds the trees of nested guide sets: centres are the members' mean, radii hold 95 % of the members (or, where no
/// strand follows, all of the guides' room), frames are rotation-minimising along the centre line.
pub(super) fn build(levels: &[Vec<(u32, Vec<u32>)>], arc: &[f64], members: &Members) -> Vec<Tree> {
    let mut of_guide: Vec<Vec<u32>> = vec![Vec::new(); members.guides.len()];
    members.follows.iter().enumerate().for_each(|(strand, &g)| of_guide[g as usize].push(strand as u32));
    let leaf_level = levels.len() - 1;
    let wisps: Vec<Vec<Wisp>> = levels
        .iter()
        .enumerate()
        .map(|(level, sets)| {
            sets.par_iter()
                .map(|(_, guides)| {
                    let mut wisp = members.wisp(guides, &of_guide, arc);
                    if level == leaf_level {
                        wisp.guides = guides.clone();
                    }
                    wisp
                })
                .collect()
        })
        .collect();
    // Each tree breadth first: where every wisp of a level went, in the level's own order.
    let mut trees: Vec<Tree> = Vec::new();
    let mut place: Vec<(usize, u32)> = Vec::new();
    for (sets, made) in levels.iter().zip(wisps) {
        let mut next = Vec::with_capacity(made.len());
        for ((parent, _), mut wisp) in sets.iter().zip(made) {
            let tree = match place.get(*parent as usize) {
                Some(&(tree, index)) => {
                    wisp.parent = Some(index);
                    tree
                }
                None => {
                    trees.push(Tree { arc: arc.to_vec(), wisps: Vec::new() });
                    trees.len() - 1
                }
            };
            next.push((tree, trees[tree].wisps.len() as u32));
            trees[tree].wisps.push(wisp);
        }
        place = next;
    }
    trees
}

impl Members<'_> {
    fn wisp(&self, guides: &[u32], of_guide: &[Vec<u32>], arc: &[f64]) -> Wisp {
        let m = self.guides.count;
        let mut rows: Vec<&[Vector3<f64>]> = guides.iter().map(|&g| self.guides.points(g as usize)).collect();
        let strands = guides.iter().flat_map(|&g| &of_guide[g as usize]);
        rows.extend(strands.map(|&s| self.strands.points(s as usize)));
        let centre: Vec<Vector3<f64>> =
            (0..m).map(|k| rows.iter().map(|row| row[k]).sum::<Vector3<f64>>() / rows.len() as f64).collect();
        let line = CentreLine::through(&centre, arc);
        let radius = |k: usize| {
            let off = |x: Vector3<f64>| across(x - centre[k], line.frame[k] * Vector3::z());
            let reach = if rows.len() > guides.len() {
                percentile(rows.iter().map(|row| off(row[k])).collect(), 0.95)
            } else {
                let with_room =
                    |&g: &u32| off(self.guides.points(g as usize)[k]) + self.footprint[g as usize * m + k];
                guides.iter().map(with_room).fold(0.0, f64::max)
            };
            reach.max(THINNEST)
        };
        Wisp {
            parent: None,
            length: line.length,
            strand_count: guides.iter().map(|&g| self.hairs[g as usize]).sum(),
            sections: (0..m)
                .map(|k| Section { centre: centre[k], frame: line.frame[k], radius: radius(k) })
                .collect(),
            guides: Vec::new(),
        }
    }
}

/// Length and frames of a wisp's centre line.
struct CentreLine {
    length: f64,
    frame: Vec<UnitQuaternion<f64>>,
}

impl CentreLine {
    fn through(centre: &[Vector3<f64>], arc: &[f64]) -> Self {
        match ArcSpline::through(centre) {
            Some(spline) => {
                // The spline leaves out centres that coincide, so places on it are found by the fractions.
                let length = spline.length();
                let s: Vec<f64> = arc.iter().map(|a| a * length).collect();
                CentreLine { length, frame: rotation_minimising(&spline, &s, None) }
            }
            None => CentreLine { length: 0.0, frame: vec![UnitQuaternion::identity(); centre.len()] },
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::Curves;

    /// Straight strands hanging from a square lattice of roots, `side` × `side`, 1 cm apart.
    fn lattice(side: usize) -> Sections {
        let n = side * side;
        let points = (0..n).flat_map(|i| {
            let (x, z) = ((i % side) as f64 * 0.01, (i / side) as f64 * 0.01);
            (0..5).map(move |v| Vector3::new(x, -0.05 * f64::from(v), z))
        });
        let curves = Curves {
            offsets: (0..=n).map(|i| 5 * i).collect(),
            points: points.collect(),
            id: (0..n as i32).collect(),
            group: vec![0; n],
            root_uv: vec![[0.0; 2]; n],
        };
        Sections::of(&curves, &Tree::default_arc(4))
    }

    fn nested(sections: &Sections, depth: Depth) -> Vec<Vec<(u32, Vec<u32>)>> {
        let features = Features::of(sections, &Tree::default_arc(4), 0.2);
        nest(&features, &vec![1.0; sections.len()], depth)
    }

    #[test]
    fn room_is_half_the_spacing() {
        let sections = lattice(6);
        let features = Features::of(&sections, &Tree::default_arc(4), 0.2);
        let room = footprints(&sections, &features);
        // Inside the lattice all four neighbours are 1 cm away; a corner has two farther ones.
        assert!((room[(2 * 6 + 2) * 4] - 0.005).abs() < 1e-9);
        assert!(room.iter().all(|r| (0.005 - 1e-9..0.0075).contains(r)));
    }

    #[test]
    fn levels_nest_and_leaves_hold_one_to_three_guides() {
        let sections = lattice(10);
        for (levels, coarse) in [(1, None), (2, None), (3, None), (2, Some(7))] {
            let nested = nested(&sections, Depth { levels, coarse, leaves: None });
            assert_eq!(nested.len(), levels);
            assert!(
                nested[levels - 1].len() >= 50 && nested[levels - 1].iter().all(|w| w.1.len() <= LEAF_GUIDES)
            );
            if let Some(coarse) = coarse {
                assert_eq!(nested[0].len(), coarse);
            }
            for (above, below) in nested.iter().zip(&nested[1..]) {
                for (parent, guides) in below {
                    assert!(guides.iter().all(|g| above[*parent as usize].1.contains(g)));
                }
            }
        }
    }

    #[test]
    fn a_tree_holds_its_strands() {
        let sections = lattice(8);
        let nested = nested(&sections, Depth { levels: 2, coarse: Some(4), leaves: None });
        let none = Sections { count: 4, point: vec![], tangent: vec![], length: vec![] };
        let members = Members {
            guides: &sections,
            hairs: &[3; 64],
            footprint: &[0.005; 256],
            strands: &none,
            follows: &[],
        };
        let trees = build(&nested, &Tree::default_arc(4), &members);
        assert_eq!(trees.len(), 4);
        for tree in &trees {
            let coarse = &tree.wisps[0];
            assert!(coarse.parent.is_none() && coarse.guides.is_empty());
            assert!((coarse.length - 0.2).abs() < 1e-9);
            let leaves = &tree.wisps[1..];
            assert!(leaves.iter().all(|w| w.parent == Some(0)));
            assert_eq!(leaves.iter().map(|w| w.strand_count).sum::<u32>(), coarse.strand_count);
            assert_eq!(
                coarse.strand_count as usize,
                3 * leaves.iter().map(|w| w.guides.len()).sum::<usize>()
            );
            for wisp in &tree.wisps {
                let guides = if wisp.guides.is_empty() {
                    leaves.iter().flat_map(|w| &w.guides).collect()
                } else {
                    wisp.guides.iter().collect::<Vec<_>>()
                };
                for (k, section) in wisp.sections.iter().enumerate() {
                    assert!(
                        (section.frame * Vector3::z() + Vector3::y()).norm() < 1e-9,
                        "frames follow the hair"
                    );
                    for &&g in &guides {
                        let d = (sections.points(g as usize)[k] - section.centre).norm();
                        assert!(d + 0.005 <= section.radius + 1e-9);
                    }
                }
            }
        }
    }
}
