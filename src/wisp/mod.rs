//! The wisp hierarchy made rods: which rod elements exist now.
//!
//! At full resolution every leaf wisp is active from root to tip and each of its guides is one rod, with a strain
//! node on every section of its tree.

use crate::rod::{Cut, Rod, RodSource};
use crate::scene::{Groom, Material};

/// Largest change of natural strain that sag-free pre-bending may make, 1/m: a curl of 10 cm diameter. Gravity
/// would ask for a spiral of a few millimetres to hold a long strand out straight, and such a strand snaps over.
pub const PREBEND_LIMIT: f64 = 20.0;

/// A guide as a rod.
#[derive(Debug, Clone)]
pub struct GuideRod {
    /// Index of the guide in the groom.
    pub guide: usize,
    /// Its leaf: (tree, wisp in the tree).
    pub leaf: (usize, usize),
    /// How many hairs it stands for.
    pub hairs: f64,
    /// Its material, index into the groom's.
    pub material: usize,
    /// The rod.
    pub rod: Rod,
}

/// A rod for every guide of the groom, in the order of the guides, cut as `cut` says.
pub fn rods(groom: &Groom, cut: Cut) -> Vec<GuideRod> {
    let mut out: Vec<GuideRod> = Vec::with_capacity(groom.guides.curves.len());
    for (t, tree) in groom.trees.iter().enumerate() {
        for (w, wisp) in tree.wisps.iter().enumerate() {
            for &guide in &wisp.guides {
                let guide = guide as usize;
                let material = groom.groups[groom.guides.curves.group[guide] as usize].material as usize;
                let m = &groom.materials[material];
                let rod = Rod::new(&RodSource {
                    points: groom.guides.curves.curve(guide),
                    root_frame: groom.guides.root_frame.as_ref().map(|f| f[guide]),
                    arc: &tree.arc,
                    stiffness: stiffness(m),
                    line_density: m.density * m.section.area(),
                    damping: m.damping,
                    natural: m.natural,
                    cut,
                });
                // A validated groom has no guide without length.
                let Some(rod) = rod else { continue };
                let hairs = f64::from(wisp.strand_count) / wisp.guides.len() as f64;
                out.push(GuideRod { guide, leaf: (t, w), hairs, material, rod });
            }
        }
    }
    out.sort_by_key(|g| g.guide);
    out
}

/// (E I1, E I2, G J) of a material, N·m².
fn stiffness(m: &Material) -> [f64; 3] {
    let [i1, i2, j] = m.section.moments();
    [m.young_modulus * i1, m.young_modulus * i2, m.shear_modulus * j]
}
