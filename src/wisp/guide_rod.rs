//! Guides as rods.

use crate::rod::{Rod, RodSource, SegmentSize, Taper};
use crate::scene::{Groom, Material};
use rayon::prelude::*;

/// A guide and its rod.
#[derive(Debug, Clone)]
pub struct GuideRod {
    /// Index of the guide in the groom.
    pub guide: usize,
    /// Leaf wisp of the guide: index of the tree, and of the wisp in the tree.
    pub leaf: (usize, usize),
    /// Number of hairs that the guide represents.
    pub hairs: f64,
    /// Material, with the guide's own factors applied.
    pub material: Material,
    /// The rod: one hair.
    pub rod: Rod,
}

/// The rods of all guides of a groom, in the order of the guides, with a strain node at every section of
/// their tree; with `tip_strain` they may bear moments at their tips.
pub fn guide_rods(groom: &Groom, segment_size: SegmentSize, tip_strain: bool) -> Vec<GuideRod> {
    let leaves = groom.trees.iter().enumerate().flat_map(|(t, tree)| {
        tree.wisps
            .iter()
            .enumerate()
            .flat_map(move |(w, wisp)| wisp.guides.iter().map(move |&g| (g as usize, (t, w))))
    });
    let mut leaves: Vec<_> = leaves.collect();
    leaves.sort_unstable();
    // A validated groom has no guide of zero length, so none is dropped.
    let rod = |(guide, leaf)| guide_rod(groom, guide, leaf, (segment_size, tip_strain));
    leaves.into_par_iter().filter_map(rod).collect()
}

/// The rod of a guide of the wisp `leaf`; `None` if the guide has zero length.
fn guide_rod(
    groom: &Groom,
    guide: usize,
    leaf: (usize, usize),
    (segment_size, tip_strain): (SegmentSize, bool),
) -> Option<GuideRod> {
    let tree = &groom.trees[leaf.0];
    let wisp = &tree.wisps[leaf.1];
    let m = groom.material_of(guide);
    let rod = Rod::new(&RodSource {
        points: groom.guides.curves.curve(guide),
        root_frame: groom.guides.root_frame.as_ref().map(|f| f[guide]),
        arc: &tree.arc,
        stiffness: stiffness(&m),
        line_density: m.density * m.section.area(),
        damping: m.damping,
        taper: Taper { stiffness: m.stiffness_at_tip, radius: m.radius_at_tip, damping: m.damping_at_tip },
        natural_strain: m.natural,
        segment_size,
        tip_strain,
    })?;
    let hairs = f64::from(wisp.strand_count) / wisp.guides.len() as f64;
    Some(GuideRod { guide, leaf, hairs, material: m, rod })
}

/// (E I1, E I2, G J) of a material, N·m².
fn stiffness(m: &Material) -> [f64; 3] {
    let [i1, i2, j] = m.section.moments();
    [m.young_modulus * i1, m.young_modulus * i2, m.shear_modulus * j]
}
