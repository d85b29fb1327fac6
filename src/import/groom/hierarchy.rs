//! The wisp hierarchy over a set of guides (generalised cylinders: Bertails & Cani 2004): nested wisps of
//! guides that are near in the metric of [`Features`], with centre lines, frames and radii.

use super::cluster::{Space, divide};
use super::features::{Features, Neighbours};
use super::sections::{Sections, perpendicular_distance};
use crate::math::frame::rotation_minimising;
use crate::math::percentile;
use crate::math::spline::ArcSpline;
use crate::scene::{Section, Tree, Wisp};
use nalgebra::{UnitQuaternion, Vector3};
use rayon::prelude::*;

/// Most guides in a leaf wisp.
const MAX_LEAF_GUIDES: usize = 3;
/// Default mean number of children of a wisp.
const BRANCHING: usize = 5;
/// Nearest neighbours whose distance gives the footprint of a guide.
const NEIGHBOURS: usize = 4;
/// Largest footprint, as a multiple of the median over all guides at the same section.
const MAX_FOOTPRINT: f64 = 1.5;
/// Smallest radius of a wisp, m.
const MIN_RADIUS: f64 = 1e-4;
/// Share of the strands within the radius of a wisp.
const RADIUS_PERCENTILE: f64 = 0.95;

/// Size of the hierarchy.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct HierarchyShape {
    /// Number of levels, at least 1: 1 for leaf wisps only, 2 for coarse wisps divided into leaf wisps.
    pub levels: usize,
    /// Number of coarse wisps; `None` for about five children per wisp.
    pub coarse: Option<usize>,
    /// Number of leaf wisps; `None` for half the number of guides. A leaf holds at most three guides.
    pub leaves: Option<usize>,
}

/// A wisp as a set of guides.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct GuideSet {
    /// Index of its parent on the level above; 0 on the coarse level.
    parent: u32,
    /// Its guides, ascending.
    guides: Vec<u32>,
}

/// Groups guides into nested sets, from the coarse level to the leaves: `[level][wisp]`.
pub(super) fn nest(features: &Features, weight: &[f64], shape: HierarchyShape) -> Vec<Vec<GuideSet>> {
    let guides = features.len();
    let leaves = shape.leaves.unwrap_or(guides.div_ceil(2)).clamp(1, guides);
    let coarse = shape
        .coarse
        .unwrap_or_else(|| (leaves as f64 / BRANCHING.pow(shape.levels as u32 - 1) as f64).ceil() as usize)
        .clamp(1, leaves);
    let space = Space { features, weight };
    let mut levels: Vec<Vec<GuideSet>> = Vec::new();
    let mut sets = vec![(0..guides as u32).collect::<Vec<_>>()];
    for level in 0..shape.levels {
        // The number of wisps grows geometrically from the coarse level to the leaves.
        let share = if shape.levels > 1 { level as f64 / (shape.levels - 1) as f64 } else { 1.0 };
        let target = (coarse as f64 * (leaves as f64 / coarse as f64).powf(share)).round() as usize;
        let most = if level + 1 == shape.levels { MAX_LEAF_GUIDES } else { usize::MAX };
        let children: Vec<GuideSet> = divide(space, &sets, target, most)
            .into_iter()
            .enumerate()
            .flat_map(|(parent, clusters)| {
                clusters.into_iter().map(move |c| GuideSet { parent: parent as u32, guides: c.members })
            })
            .collect();
        sets = children.iter().map(|set| set.guides.clone()).collect();
        levels.push(children);
    }
    levels
}

/// Radius around each guide that its hairs may fill: at each section half the mean distance to the nearest
/// neighbours, perpendicular to the guide; m, `guides × sections`. Neighbours are nearest in the metric of
/// [`Features`].
pub(super) fn footprints(guides: &Sections, features: &Features) -> Vec<f64> {
    let n = guides.len();
    let neighbours = Neighbours::new(features);
    let row = |i: usize| {
        let order = neighbours.nearest(features.row(i), NEIGHBOURS, |j| j != i);
        (0..guides.count)
            .map(move |k| {
                let (x, t) = (guides.points(i)[k], guides.tangents(i)[k]);
                let sum: f64 =
                    order.iter().map(|&j| perpendicular_distance(guides.points(j)[k] - x, t)).sum();
                (0.5 * sum / order.len().max(1) as f64).max(MIN_RADIUS)
            })
            .collect::<Vec<f64>>()
    };
    let mut radius: Vec<f64> = (0..n).into_par_iter().flat_map_iter(row).collect();
    // Otherwise a guide that diverges from its neighbours would fill the gap with stray hairs.
    for k in 0..guides.count {
        let column = (0..n).map(|i| radius[i * guides.count + k]).collect();
        let largest = MAX_FOOTPRINT * percentile(column, 0.5);
        (0..n).for_each(|i| radius[i * guides.count + k] = radius[i * guides.count + k].min(largest));
    }
    radius
}

/// The strands that wisps are fitted to.
pub(super) struct Members<'a> {
    /// The guides.
    pub(super) guides: &'a Sections,
    /// Number of hairs that each guide represents.
    pub(super) hairs: &'a [u32],
    /// Footprint of each guide ([`footprints`]).
    pub(super) footprint: &'a [f64],
    /// The render strands; may be empty.
    pub(super) strands: &'a Sections,
    /// The guide of each render strand.
    pub(super) guide_of_strand: &'a [u32],
}

/// Builds the trees of nested guide sets. The centre line of a wisp is the mean of its members. Its radius
/// covers 95 % of them or, without render strands, the footprints of all its guides. Its frames are
/// rotation-minimising.
pub(super) fn build(levels: &[Vec<GuideSet>], arc: &[f64], members: &Members) -> Vec<Tree> {
    let mut strands_of: Vec<Vec<u32>> = vec![Vec::new(); members.guides.len()];
    for (strand, &guide) in members.guide_of_strand.iter().enumerate() {
        strands_of[guide as usize].push(strand as u32);
    }
    let leaf_level = levels.len() - 1;
    let wisps: Vec<Vec<Wisp>> = levels
        .iter()
        .enumerate()
        .map(|(level, sets)| {
            sets.par_iter()
                .map(|GuideSet { guides, .. }| {
                    let mut wisp = members.wisp(guides, &strands_of, arc);
                    if level == leaf_level {
                        wisp.guides = guides.clone();
                    }
                    wisp
                })
                .collect()
        })
        .collect();
    assemble(levels, arc, wisps)
}

/// Distributes the wisps of all levels to trees, breadth first. Each coarse wisp is the root of a tree.
fn assemble(levels: &[Vec<GuideSet>], arc: &[f64], wisps: Vec<Vec<Wisp>>) -> Vec<Tree> {
    let mut trees: Vec<Tree> = Vec::new();
    // Tree and index of each wisp on the level above.
    let mut above: Vec<(usize, u32)> = Vec::new();
    for (sets, wisps) in levels.iter().zip(wisps) {
        let mut placed = Vec::with_capacity(wisps.len());
        for (set, mut wisp) in sets.iter().zip(wisps) {
            let tree = match above.get(set.parent as usize) {
                Some(&(tree, index)) => {
                    wisp.parent = Some(index);
                    tree
                }
                None => {
                    trees.push(Tree { arc: arc.to_vec(), wisps: Vec::new() });
                    trees.len() - 1
                }
            };
            placed.push((tree, trees[tree].wisps.len() as u32));
            trees[tree].wisps.push(wisp);
        }
        above = placed;
    }
    trees
}

impl Members<'_> {
    /// The wisp of some guides and their render strands.
    fn wisp(&self, guides: &[u32], strands_of: &[Vec<u32>], arc: &[f64]) -> Wisp {
        let m = self.guides.count;
        let mut rows: Vec<&[Vector3<f64>]> = guides.iter().map(|&g| self.guides.points(g as usize)).collect();
        let strands = guides.iter().flat_map(|&g| &strands_of[g as usize]);
        rows.extend(strands.map(|&s| self.strands.points(s as usize)));
        let centre: Vec<Vector3<f64>> =
            (0..m).map(|k| rows.iter().map(|row| row[k]).sum::<Vector3<f64>>() / rows.len() as f64).collect();
        let line = CentreLine::through(&centre, arc);
        let radius = |k: usize| {
            let distance =
                |x: Vector3<f64>| perpendicular_distance(x - centre[k], line.frame[k] * Vector3::z());
            let radius = if rows.len() > guides.len() {
                percentile(rows.iter().map(|row| distance(row[k])).collect(), RADIUS_PERCENTILE)
            } else {
                let with_footprint = |&g: &u32| {
                    distance(self.guides.points(g as usize)[k]) + self.footprint[g as usize * m + k]
                };
                guides.iter().map(with_footprint).fold(0.0, f64::max)
            };
            radius.max(MIN_RADIUS)
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

/// Length and frames of the centre line of a wisp.
struct CentreLine {
    length: f64,
    frame: Vec<UnitQuaternion<f64>>,
}

impl CentreLine {
    fn through(centre: &[Vector3<f64>], arc: &[f64]) -> Self {
        match ArcSpline::through(centre) {
            Some(spline) => {
                // The spline skips coincident centres, so sections are located by arc length and not by
                // index.
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

    /// Straight vertical strands with roots on a `side` × `side` lattice of 1 cm.
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
            skin: Vec::new(),
        };
        Sections::of(&curves, &Tree::default_arc(4))
    }

    fn nested(sections: &Sections, shape: HierarchyShape) -> Vec<Vec<GuideSet>> {
        let features = Features::of(sections, &Tree::default_arc(4), 0.2);
        nest(&features, &vec![1.0; sections.len()], shape)
    }

    #[test]
    fn footprint_is_half_the_spacing() {
        let sections = lattice(6);
        let features = Features::of(&sections, &Tree::default_arc(4), 0.2);
        let footprint = footprints(&sections, &features);
        // Inside the lattice all four neighbours are 1 cm away; at a corner two are farther.
        assert!((footprint[(2 * 6 + 2) * 4] - 0.005).abs() < 1e-9);
        assert!(footprint.iter().all(|r| (0.005 - 1e-9..0.0075).contains(r)));
    }

    #[test]
    fn levels_nest_and_leaves_hold_one_to_three_guides() {
        let sections = lattice(10);
        for (levels, coarse) in [(1, None), (2, None), (3, None), (2, Some(7))] {
            let nested = nested(&sections, HierarchyShape { levels, coarse, leaves: None });
            assert_eq!(nested.len(), levels);
            assert!(
                nested[levels - 1].len() >= 50
                    && nested[levels - 1].iter().all(|w| w.guides.len() <= MAX_LEAF_GUIDES)
            );
            if let Some(coarse) = coarse {
                assert_eq!(nested[0].len(), coarse);
            }
            for (above, below) in nested.iter().zip(&nested[1..]) {
                for GuideSet { parent, guides } in below {
                    assert!(guides.iter().all(|g| above[*parent as usize].guides.contains(g)));
                }
            }
        }
    }

    #[test]
    fn wisps_enclose_their_guides() {
        let sections = lattice(8);
        let nested = nested(&sections, HierarchyShape { levels: 2, coarse: Some(4), leaves: None });
        let none = Sections { count: 4, point: vec![], tangent: vec![], length: vec![] };
        let members = Members {
            guides: &sections,
            hairs: &[3; 64],
            footprint: &[0.005; 256],
            strands: &none,
            guide_of_strand: &[],
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
                    assert!((section.frame * Vector3::z() + Vector3::y()).norm() < 1e-9, "z is the tangent");
                    for &&g in &guides {
                        let d = (sections.points(g as usize)[k] - section.centre).norm();
                        assert!(d + 0.005 <= section.radius + 1e-9);
                    }
                }
            }
        }
    }
}
