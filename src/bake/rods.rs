//! The groom's guides as rods.

use super::sag::{self, Held};
use crate::rod::{Rod, SegmentSize};
use crate::scene::anim::Contact;
use crate::scene::{Anim, Groom};
use crate::strands::Membership;
use crate::wisp::{self, GuideRod};

/// The rods of a bake, in the groom's order: as they are simulated, and as they are followed and written.
#[derive(Debug, Clone)]
pub struct Rods {
    /// As they are simulated.
    pub simulated: Vec<GuideRod>,
    /// As finely cut as they are followed and written; none where they are simulated so.
    fine: Vec<Rod>,
    /// What keeps them from sagging at the start.
    pub held: Held,
    /// Which of them have to move: all, but in a bake of some groups. Those that lead these in wisps do so beside.
    pub moved: Vec<bool>,
}

impl Rods {
    /// The rods of `groom`, which must have its trees, coarse where `anim` lets nothing touch them.
    pub fn new(groom: &Groom, anim: &Anim) -> Self {
        let alone =
            anim.colliders.is_empty() && anim.ties.is_empty() && anim.settings.contact != Contact::Full;
        let mut simulated =
            wisp::guide_rods(groom, if alone { SegmentSize::COARSE } else { SegmentSize::FINE });
        let fine = if alone { wisp::guide_rods(groom, SegmentSize::FINE) } else { Vec::new() };
        let held = sag::hold(&mut simulated, anim);
        let moved = vec![true; simulated.len()];
        Rods { held, moved, simulated, fine: fine.into_iter().map(|r| r.rod).collect() }
    }

    /// The rod of every guide of `groom`, cut as finely as it is followed and written, and where it belongs.
    pub fn followed<'a>(&'a self, groom: &Groom) -> Vec<(&'a Rod, Membership)> {
        let rod = |(i, GuideRod { rod, leaf, guide, .. }): (usize, &'a GuideRod)| {
            let home =
                Membership { leaf: (leaf.0 as u32, leaf.1 as u32), group: groom.guides.curves.group[*guide] };
            (self.fine.get(i).unwrap_or(rod), home)
        };
        self.simulated.iter().enumerate().map(rod).collect()
    }
}
