//! Wisps for a groom that has none.

use super::{Curves, Groom, Section, Tree, Wisp};
use crate::math::spline::ArcSpline;
use nalgebra::{Matrix3, Rotation3, UnitQuaternion, Vector3};

impl Tree {
    /// Arc-length fractions of the strain nodes of a guide: s_k = (k / (n − 1))^p, p = 1.5, k = 0 … n − 1.
    /// Gravity loads the root most (the bending moment of a hanging strand falls with the length below),
    /// so nodes crowd there.
    pub fn default_arc(nodes: usize) -> Vec<f64> {
        let last = nodes.max(2) - 1;
        (0..=last).map(|k| (k as f64 / last as f64).powf(1.5)).collect()
    }
}

impl Groom {
    /// The groom with a tree of one wisp for every guide if it has no trees of its own; otherwise as it is.
    /// `nodes`: strain nodes on a guide (see [`crate::scene::Settings::nodes`]), 2 or more.
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
            wisp(guides, g, root, &arc, section.a1.max(section.a2), strand_count.max(1))
        };
        self.trees = strands.into_iter().enumerate().map(tree).collect();
        self
    }
}

/// The wisp of guide `g` alone.
fn wisp(
    guides: &Curves,
    g: usize,
    root: Option<UnitQuaternion<f64>>,
    arc: &[f64],
    radius: f64,
    strand_count: u32,
) -> Tree {
    let points = guides.curve(g);
    let sections_and_length = ArcSpline::through(points).map(|spline| {
        let samples: Vec<_> = arc.iter().map(|s| spline.at(s * spline.length())).collect();
        let mut axis = root.map_or_else(|| any_normal(&samples[0].tangent), |q| q * Vector3::x());
        let mut sections: Vec<Section> = Vec::with_capacity(arc.len());
        for (k, here) in samples.iter().enumerate() {
            if k > 0 {
                axis = double_reflection(
                    &samples[k - 1].x,
                    &samples[k - 1].tangent,
                    &here.x,
                    &here.tangent,
                    &axis,
                );
            }
            sections.push(Section { centre: here.x, frame: frame(&axis, &here.tangent), radius });
        }
        (sections, spline.length())
    });
    let (sections, length) = sections_and_length.unwrap_or_default();
    let wisp = Wisp { parent: None, length, strand_count, sections, guides: vec![g as u32] };
    Tree { arc: arc.to_vec(), wisps: vec![wisp] }
}

/// A unit vector at right angles to `tangent`: from the coordinate axis farthest from it.
fn any_normal(tangent: &Vector3<f64>) -> Vector3<f64> {
    let mut axis = Vector3::zeros();
    axis[tangent.iamin()] = 1.0;
    (axis - tangent * tangent.dot(&axis)).normalize()
}

/// The normal `axis` at (x0, t0) carried to (x1, t1) with least rotation (Wang, Jüttler, Zheng & Liu 2008, "Computation
/// of rotation minimizing frames", algorithm 1).
fn double_reflection(
    x0: &Vector3<f64>,
    t0: &Vector3<f64>,
    x1: &Vector3<f64>,
    t1: &Vector3<f64>,
    axis: &Vector3<f64>,
) -> Vector3<f64> {
    let reflect = |v: Vector3<f64>, across: &Vector3<f64>| {
        let square = across.norm_squared();
        if square > 0.0 { v - across * (2.0 * across.dot(&v) / square) } else { v }
    };
    let across = x1 - x0;
    let (tangent, axis) = (reflect(*t0, &across), reflect(*axis, &across));
    reflect(axis, &(t1 - tangent))
}

/// The frame with third axis `tangent` and first axis next to `axis`.
fn frame(axis: &Vector3<f64>, tangent: &Vector3<f64>) -> UnitQuaternion<f64> {
    let d1 = (axis - tangent * tangent.dot(axis)).normalize();
    let columns = Matrix3::from_columns(&[d1, tangent.cross(&d1), *tangent]);
    UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(columns))
}
