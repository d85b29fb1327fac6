//! The groom's guides as rods.

use super::air_drag::HairDensity;
use super::clock;
use super::guide_frame::GuideFrame;
use super::hair_volume;
use super::load;
use super::sag_free::{self, SagFreeReport};
use super::tie;
use crate::rod::{Rod, RodShape, RootJoint, SegmentSize};
use crate::scene::anim::{ContactSetting, RootHold, Roots};
use crate::scene::{Anim, Groom};
use crate::wisp::{self, GuideRod};
use nalgebra::Isometry3;
use rayon::prelude::*;

/// The rods of a bake, in the groom's order: those simulated, and those that output and validation sample.
#[derive(Debug, Clone)]
pub struct GuideRods {
    /// The simulated rods.
    pub simulated: Vec<GuideRod>,
    /// The rods with fine segments, for output; empty if the simulated ones have fine segments.
    fine: Vec<Rod>,
    /// Density of the hair in the groom's pose.
    pub(super) density: HairDensity,
    /// How many hairs a hair of each guide stands for in contact with other hair as a volume; `None` without such
    /// contact.
    pub sampling: Option<Vec<f64>>,
    /// What the sag-free start changed.
    pub sag_free: SagFreeReport,
    /// For each guide whose root is free, what carries rest space to the world at the start of the pre-roll.
    pub start_pose: Vec<Option<Isometry3<f64>>>,
    /// True for each guide that the bake needs: all guides, or those of some groups and their leaders.
    pub required: Vec<bool>,
}

impl GuideRods {
    /// The rods of `groom`, which must have its trees. Segments are coarse if nothing is touched.
    pub fn new(groom: &Groom, anim: &Anim) -> Self {
        let contact = anim.settings.contact;
        let tip_strain = load::bends_tips(anim);
        let mut simulated = wisp::guide_rods(groom, SegmentSize::FINE, tip_strain);
        let density =
            HairDensity::new(simulated.iter().map(|r| (groom.guides.curves.curve(r.guide), r.hairs)));
        let guides_only = groom.strands.curves.is_empty();
        let meets = contact == ContactSetting::Volume;
        let sampling = if meets { hair_volume::sampling(&simulated, &density, guides_only) } else { None };
        let alone = anim.colliders.is_empty()
            && anim.ties.is_empty()
            && contact != ContactSetting::Full
            && sampling.is_none();
        let mut fine = Vec::new();
        if alone {
            fine =
                std::mem::replace(&mut simulated, wisp::guide_rods(groom, SegmentSize::COARSE, tip_strain));
        }
        for rods in [&mut simulated, &mut fine] {
            join_roots(groom, anim, rods);
        }
        let skin = |i: usize| groom.guides.curves.skin.get(i);
        let start = clock::time_after(anim, 0);
        let start_pose = |(i, r): (usize, &GuideRod)| r.rod.is_free().then(|| anim.carrier(skin(i), start));
        let start_pose = simulated.iter().enumerate().map(start_pose).collect();
        let report = sag_free::apply(&mut simulated, anim);
        let required = vec![true; simulated.len()];
        let fine = fine.into_iter().map(|r| r.rod).collect();
        GuideRods { sag_free: report, start_pose, required, simulated, fine, density, sampling }
    }

    /// The fine rod of every guide, with the simulated one.
    pub fn fine_and_simulated(&self) -> impl Iterator<Item = (&Rod, &GuideRod)> {
        self.simulated.iter().enumerate().map(|(i, guide)| (self.fine.get(i).unwrap_or(&guide.rod), guide))
    }

    /// Distance of the simulated guides from the groom's pose carried by the head, relative to their length:
    /// the mean over each guide's points; of these the mean and the maximum over the required guides. Guides whose
    /// roots are free are left out.
    pub fn departure(&self, frames: &[GuideFrame]) -> [f64; 2] {
        let required = self.simulated.par_iter().zip(frames).zip(&self.required);
        let required = required.filter(|((guide, _), required)| **required && !guide.rod.is_free());
        let each = required.map(|((GuideRod { rod, .. }, frame), _)| {
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

/// Frees the roots of `rods` as `anim` has it.
fn join_roots(groom: &Groom, anim: &Anim, rods: &mut [GuideRod]) {
    if !anim.frees_roots() {
        return;
    }
    rods.par_iter_mut().for_each(|r| {
        let drawn = tie::drawn(&r.rod);
        let of = |roots: &&Roots| tie::selects(&roots.guides, groom, r, &drawn);
        match anim.roots.iter().rfind(of).map(|roots| roots.hold) {
            None | Some(RootHold::Clamped) => {}
            Some(RootHold::Pinned) => r.rod.join_root(RootJoint::Pinned),
            Some(RootHold::Free) => r.rod.join_root(RootJoint::Free),
        }
    });
}
