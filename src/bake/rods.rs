//! The groom's guides as rods.

use crate::rod::{Cut, Rod};
use crate::scene::anim::Contact;
use crate::scene::{Anim, Groom};
use crate::wisp::{self, GuideRod};

/// The rods of a bake, in the groom's order: as they are simulated, and as they are written.
#[derive(Debug, Clone)]
pub struct Rods {
    /// As they are simulated.
    pub simulated: Vec<GuideRod>,
    /// As they are written, finer.
    drawn: Vec<Rod>,
}

impl Rods {
    /// The rods of `groom`, which must have its trees, coarse where `anim` lets nothing touch them.
    pub fn new(groom: &Groom, anim: &Anim) -> Self {
        let alone =
            anim.colliders.is_empty() && anim.ties.is_empty() && anim.settings.contact == Contact::Bodies;
        let simulated = wisp::rods(groom, if alone { Cut::COARSE } else { Cut::FINE });
        let drawn = wisp::rods(groom, Cut::DRAWN).into_iter().map(|r| r.rod).collect();
        Rods { simulated, drawn }
    }

    /// The rod of every guide, cut as finely as it is written, and its leaf wisp: (tree, wisp).
    pub fn drawn(&self) -> Vec<(&Rod, (u32, u32))> {
        let leaf = |r: &GuideRod| (r.leaf.0 as u32, r.leaf.1 as u32);
        self.drawn.iter().zip(self.simulated.iter().map(leaf)).collect()
    }
}
