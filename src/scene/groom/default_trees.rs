//! Default wisps: one per guide.

use super::model::{Curves, Groom, Section, Tree, Wisp};
use crate::math::frame::rotation_minimising;
use crate::math::spline::ArcSpline;
use nalgebra::{UnitQuaternion, Vector3};

impl Tree {
    /// Arc-length fractions of the n strain nodes of a guide: s_k = (k / (n − 1))^1.5, k = 0 … n − 1. Nodes
    /// are denser towards the root, which carries the largest bending moment.
    pub fn default_arc(nodes: usize) -> Vec<f64> {
        let last = nodes.max(2) - 1;
        (0..=last).map(|k| (k as f64 / last as f64).powf(1.5)).collect()
    }
}

impl Groom {
    /// The groom with one tree of one wisp per guide, if it has no trees; otherwise the groom unchanged.
    /// `nodes`: strain nodes per guide, at least 2.
    pub fn with_default_trees(mut self, nodes: u32) -> Self {
        if !self.trees.is_empty() {
            return self;
        }
        let guides = &self.guides.curves;
        let arc = Tree::default_arc(nodes as usize);
        let mut strands = vec![0; guides.len()];
        for &(guide, _) in &self.strands.leaf {
            strands[guide as usize] += 1;
        }
        let tree = |(g, strand_count): (usize, u32)| {
            let section = self.materials[self.groups[guides.group[g] as usize].material as usize].section;
            let root = self.guides.root_frame.as_ref().map(|frames| frames[g]);
            tree_of_guide(guides, g, root, &arc, section.a1.max(section.a2), strand_count.max(1))
        };
        self.trees = strands.into_iter().enumerate().map(tree).collect();
        self
    }
}

/// The tree of guide `g`.
fn tree_of_guide(
    guides: &Curves,
    g: usize,
    root: Option<UnitQuaternion<f64>>,
    arc: &[f64],
    radius: f64,
    strand_count: u32,
) -> Tree {
    let fitted = ArcSpline::through(guides.curve(g)).map(|spline| {
        let s: Vec<f64> = arc.iter().map(|share| share * spline.length()).collect();
        let d1 = root.map(|frame| frame * Vector3::x());
        let frames = rotation_minimising(&spline, &s, d1.as_ref());
        let section =
            |(s, frame): (&f64, UnitQuaternion<f64>)| Section { centre: spline.at(*s).x, frame, radius };
        (s.iter().zip(frames).map(section).collect(), spline.length())
    });
    let (sections, length) = fitted.unwrap_or_default();
    let wisp = Wisp { parent: None, length, strand_count, sections, guides: vec![g as u32] };
    Tree { arc: arc.to_vec(), wisps: vec![wisp] }
}
