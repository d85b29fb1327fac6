//! The wisp hierarchy made rods: which rod elements exist now.
//!
//! At full resolution every leaf wisp is active from root to tip and each of its guides is one rod, with a strain
//! node on every section of its tree. Otherwise guides lead each other ([`Hierarchy`]).

mod hierarchy;
mod linear;
mod reach;
mod response;
mod swing;

pub use hierarchy::Hierarchy;
pub use reach::LinearKinematics;
pub use swing::{HeadExcitation, ModalResponse, ModeState};

use crate::rod::{Rod, RodSource, SegmentSize, Taper};
use crate::scene::{Groom, Material};
use rayon::prelude::*;

/// A guide as a rod.
#[derive(Debug, Clone)]
pub struct GuideRod {
    /// Index of the guide in the groom.
    pub guide: usize,
    /// Its leaf: (tree, wisp in the tree).
    pub leaf: (usize, usize),
    /// How many hairs it stands for.
    pub hairs: f64,
    /// Its material, with its own factors.
    pub material: Material,
    /// The rod.
    pub rod: Rod,
}

/// A rod for every guide of the groom, in the order of the guides, cut as `segment_size` says.
pub fn guide_rods(groom: &Groom, segment_size: SegmentSize) -> Vec<GuideRod> {
    let leaves = groom.trees.iter().enumerate().flat_map(|(t, tree)| {
        tree.wisps
            .iter()
            .enumerate()
            .flat_map(move |(w, wisp)| wisp.guides.iter().map(move |&g| (g as usize, (t, w))))
    });
    let mut leaves: Vec<_> = leaves.collect();
    leaves.sort_unstable();
    // A validated groom has no guide without length.
    leaves.into_par_iter().filter_map(|(guide, leaf)| rod(groom, guide, leaf, segment_size)).collect()
}

/// The rod of a guide of the wisp `leaf`; `None` where it has no length.
fn rod(groom: &Groom, guide: usize, leaf: (usize, usize), segment_size: SegmentSize) -> Option<GuideRod> {
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
    })?;
    let hairs = f64::from(wisp.strand_count) / wisp.guides.len() as f64;
    Some(GuideRod { guide, leaf, hairs, material: m, rod })
}

/// (E I1, E I2, G J) of a material, N·m².
fn stiffness(m: &Material) -> [f64; 3] {
    let [i1, i2, j] = m.section.moments();
    [m.young_modulus * i1, m.young_modulus * i2, m.shear_modulus * j]
}
