//! The groom's guides as rods.

use super::guide_frame::GuideFrame;
use super::sag_free::{self, SagFreeReport};
use crate::rod::{Rod, RodShape, SegmentSize};
use crate::scene::anim::ContactSetting;
use crate::scene::{Anim, Groom};
use crate::wisp::{self, GuideRod};
use rayon::prelude::*;

/// The rods of a bake, in the groom's order: as they are simulated, and as they are followed and written.
#[derive(Debug, Clone)]
pub struct GuideRods {
    /// As they are simulated.
    pub simulated: Vec<GuideRod>,
    /// As finely cut as they are followed and written; none where they are simulated so.
    fine: Vec<Rod>,
    /// What keeps them from sagging at the start.
    pub held: SagFreeReport,
    /// Which of them have to move: all, but in a bake of some groups. Those that lead these in wisps do so beside.
    pub moved: Vec<bool>,
}

impl GuideRods {
    /// The rods of `groom`, which must have its trees, coarse where `anim` lets nothing touch them.
    pub fn new(groom: &Groom, anim: &Anim) -> Self {
        let alone = anim.colliders.is_empty()
            && anim.ties.is_empty()
            && anim.settings.contact != ContactSetting::Full;
        let mut simulated =
            wisp::guide_rods(groom, if alone { SegmentSize::COARSE } else { SegmentSize::FINE });
        let fine = if alone { wisp::guide_rods(groom, SegmentSize::FINE) } else { Vec::new() };
        let held = sag_free::apply(&mut simulated, anim);
        let moved = vec![true; simulated.len()];
        GuideRods { held, moved, simulated, fine: fine.into_iter().map(|r| r.rod).collect() }
    }

    /// The rod of every guide, cut as finely as it is followed and written, with the simulated one.
    pub fn followed(&self) -> impl Iterator<Item = (&Rod, &GuideRod)> {
        self.simulated.iter().enumerate().map(|(i, guide)| (self.fine.get(i).unwrap_or(&guide.rod), guide))
    }

    /// Distance of the simulated guides from the groom's pose carried by the head, over their length: the mean over each guide's points, of
    /// which the mean and the largest over all guides that move.
    pub fn departure(&self, frames: &[GuideFrame]) -> [f64; 2] {
        let moved = self.simulated.par_iter().zip(frames).zip(&self.moved).filter(|(_, moved)| **moved);
        let each = moved.map(|((GuideRod { rod, .. }, frame), _)| {
            let [groom, now] = [&rod.initial_q, &frame.q].map(|q| {
                let mut shape = RodShape::default();
                shape.update(rod, &rod.root.r, q);
                shape
            });
            let sum: f64 = (0..rod.points()).map(|k| (now.x(k) - groom.x(k)).norm()).sum();
            sum / (rod.points() as f64 * rod.length())
        });
        let each: Vec<f64> = each.collect();
        [each.iter().sum::<f64>() / each.len().max(1) as f64, each.iter().copied().fold(0.0, f64::max)]
    }
}
