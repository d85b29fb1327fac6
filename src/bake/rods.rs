//! The groom's guides as rods.

use crate::rod::{Cut, Rod};
use crate::scene::anim::Contact;
use crate::scene::{Anim, Groom};
use crate::wisp::{self, GuideRod};

/// The rods of a bake, in the groom's order: as they are simulated, and as they are written.
#[derive(Debug, Clone)]
pub struct Rods {
    /// As they are simulated: coarse where nothing may touch them.
    pub simulated: Vec<GuideRod>,
    /// As finely cut as contact sees them; none where they are simulated so.
    fine: Vec<Rod>,
    /// As they are written, finer again.
    pub drawn: Vec<Rod>,
}

impl Rods {
    /// The rods of `groom`, which must have its trees, in the scene `anim`.
    pub fn new(groom: &Groom, anim: &Anim) -> Self {
        let alone =
            anim.colliders.is_empty() && anim.ties.is_empty() && anim.settings.contact == Contact::Bodies;
        let cut = |cut| wisp::rods(groom, cut).into_iter().map(|r| r.rod).collect();
        Rods {
            simulated: wisp::rods(groom, if alone { Cut::COARSE } else { Cut::FINE }),
            fine: if alone { cut(Cut::FINE) } else { Vec::new() },
            drawn: cut(Cut::DRAWN),
        }
    }

    /// The rod of every guide, as render strands follow it, and its leaf wisp: (tree, wisp).
    pub fn followed<'a>(&'a self) -> Vec<(&'a Rod, (u32, u32))> {
        let rod = |(i, GuideRod { rod, leaf, .. }): (usize, &'a GuideRod)| {
            (self.fine.get(i).unwrap_or(rod), (leaf.0 as u32, leaf.1 as u32))
        };
        self.simulated.iter().enumerate().map(rod).collect()
    }
}
