//! What does not change during a simulation. `bake` builds a [`Model`] once for each run;
//! [`super::simulation::step`] reads it.

use super::air_drag::{self, HairDensity};
use super::clock;
use super::environment::Environment;
use super::goal::AnimatedGoal;
use super::guide::{ContactMode, GoalSpring, GuideModel};
use super::guide_rods::GuideRods;
use super::load;
use super::strand_contact::BundleProperties;
use super::tie;
use super::wisp_friction::{FrictionSampler, WispFriction};
use crate::rod::{Rod, RodShape};
use crate::scene::anim::{ContactSetting, OutputCurves, Resolution};
use crate::scene::{Anim, Groom};
use crate::wisp::GuideRod;
use rayon::prelude::*;

/// Volume fraction of hair in a pressed bundle: between loose packing (0.4) and the densest packing of
/// cylinders (hexagonal, 0.91).
const PACKING: f64 = 0.6;

/// What does not change during a simulation: the guides' models and the settings of the animation.
pub struct Model<'a> {
    /// The animation.
    pub anim: &'a Anim,
    /// The guides, in the groom's order.
    pub guides: Vec<GuideModel>,
    /// True for each guide that the bake needs ([`GuideRods::required`]); the others are never stepped.
    pub simulated: Vec<bool>,
    /// Each guide with its own hairs, as other guides touch it.
    pub(super) bundles: Vec<BundleProperties>,
    /// Friction within coarse wisps, if any material has it.
    pub(super) wisp_friction: Option<WispFriction>,
    /// Tolerance at which guides split from their wisp, as a share of their length; `None` where none does.
    pub(super) split_tolerance: Option<f64>,
    /// Sub-steps of the pre-roll.
    preroll: i64,
}

impl<'a> Model<'a> {
    /// The model of `groom`, whose guides have the rods `rods`, moving as in `anim`.
    pub fn new(groom: &Groom, anim: &'a Anim, rods: &GuideRods) -> Self {
        let simulated = rods.required.clone();
        let GuideRods { simulated: rods, density, start_pose, .. } = rods;
        let mut guides: Vec<GuideModel> = rods.par_iter().map(|r| guide(anim, density, r)).collect();
        for (guide, skin) in guides.iter_mut().zip(&groom.guides.curves.skin) {
            guide.skin = Some(skin.clone());
        }
        guides.iter_mut().zip(start_pose).for_each(|(guide, start_pose)| guide.start_pose = *start_pose);
        animate(groom, anim, rods, &mut guides);
        for (guide, ties) in guides.iter_mut().zip(tie::ties(groom, anim, rods)) {
            guide.ties = ties;
        }
        for (guide, loads) in guides.iter_mut().zip(load::loads(groom, anim, rods)) {
            guide.loads = loads;
        }
        let adaptive = anim.resolution() == Resolution::Adaptive;
        Model {
            anim,
            guides,
            simulated,
            bundles: bundles(rods),
            wisp_friction: wisp_friction(rods),
            split_tolerance: adaptive.then_some(anim.settings.split_tolerance),
            preroll: clock::preroll(anim),
        }
    }

    /// Sub-step, s.
    pub fn substep(&self) -> f64 {
        1.0 / (self.anim.fps * f64::from(self.anim.settings.substeps))
    }

    /// Time after `taken` sub-steps, s. The pre-roll ends one frame before the first, on the handle frame.
    pub fn time_after(&self, taken: i64) -> f64 {
        clock::time_after(self.anim, taken)
    }

    /// Times of all frames from the start of the pre-roll to the one after the last, s.
    pub(super) fn frame_times(&self) -> Vec<f64> {
        let (first, last) = (self.time_after(0) * self.anim.fps, f64::from(self.anim.frames.1) + 1.0);
        (first.floor() as i64..=last as i64).map(|frame| frame as f64 / self.anim.fps).collect()
    }

    /// True if `taken` sub-steps are those of the pre-roll.
    pub(super) fn is_preroll_end(&self, taken: i64) -> bool {
        taken == self.preroll
    }

    /// True if a frame ends after `taken` sub-steps.
    pub(super) fn is_at_frame(&self, taken: i64) -> bool {
        let after_preroll = taken - self.preroll;
        after_preroll >= 0 && after_preroll % i64::from(self.anim.settings.substeps) == 0
    }

    /// The number of the sub-step of its frame, from 1, that ends after `taken` sub-steps; `None` if the
    /// pre-roll began within this frame.
    pub(super) fn substep_of_frame(&self, taken: i64) -> Option<i64> {
        let k = (taken - self.preroll - 1).rem_euclid(i64::from(self.anim.settings.substeps)) + 1;
        (k <= taken).then_some(k)
    }

    /// True if the configurations between frames are written after `taken` sub-steps.
    pub(super) fn writes_steps(&self, taken: i64) -> bool {
        self.anim.settings.curves == OutputCurves::Steps && taken >= self.preroll
    }

    /// How contact constrains a sub-step.
    pub(super) fn contact_mode(&self) -> ContactMode {
        match self.anim.settings.contact {
            ContactSetting::Volume | ContactSetting::Bodies => ContactMode::Bodies,
            ContactSetting::Full => ContactMode::Coupled,
            ContactSetting::Penalty => ContactMode::Springs,
        }
    }

    /// How far (0..=1) guides that start inside a body are pushed out of it by a time, s: the first half of
    /// the pre-roll pushes out, the second settles.
    pub(super) fn push_out(&self) -> impl Fn(f64) -> f64 + Sync + 'static {
        let (end, preroll) = (self.time_after(self.preroll), self.anim.settings.preroll);
        move |t| match preroll {
            p if p > 0.0 => ((t - end + p) / (0.5 * p)).clamp(0.0, 1.0),
            _ => 1.0,
        }
    }
}

/// Gives the guides, whose roots are bound to their skins, the animated goals of `anim`.
fn animate(groom: &Groom, anim: &Anim, rods: &[GuideRod], guides: &mut [GuideModel]) {
    let mut curves = vec![None; guides.len()];
    for goal in &anim.goals {
        goal.guides.iter().enumerate().for_each(|(curve, &guide)| curves[guide] = Some((goal, curve)));
    }
    let of_guides = guides.par_iter_mut().zip(rods).zip(curves).enumerate();
    of_guides.for_each(|(i, ((guide, r), curve))| {
        let skin = groom.guides.curves.skin.get(i);
        let root = |t: f64| Environment::root_on(&anim.carrier(skin, t), &r.rod.root);
        guide.animated_goal = curve
            .and_then(|(goal, curve)| AnimatedGoal::new(&r.rod, goal, curve, r.material.goal_weight, root));
    });
}

/// The model of one guide, without its ties.
fn guide(anim: &Anim, density: &HairDensity, r: &GuideRod) -> GuideModel {
    let mut shape = RodShape::default();
    shape.update(&r.rod, &r.rod.root.r, &r.rod.initial_q);
    // A shape has its origin at the root.
    let position = |k: usize| shape.x(k) + r.rod.root.p;
    let drag =
        (0..r.rod.points()).map(|k| air_drag::coefficient(&r.material, density, &position(k))).collect();
    let at_tip = r.material.friction.scaled(r.material.friction_at_tip);
    GuideModel {
        scheme: anim.settings.scheme,
        friction: [r.material.friction, at_tip],
        friction_across: r.material.friction_across,
        records_reaction: anim.settings.reactions,
        goal: goal(&r.rod, &shape, r.material.goal),
        ..GuideModel::new(r.rod.clone(), drag, r.material.friction)
    }
}

/// Springs that pull the points of a rod to where they are in `shape` (`docs/theory.md` §4.1, goals). `hz`
/// are their frequencies at root and tip, Hz, linear in arc length; anchors are in the root frame. None if the root is
/// free.
fn goal(rod: &Rod, shape: &RodShape, hz: [f64; 2]) -> Vec<GoalSpring> {
    if hz == [0.0; 2] || rod.is_free() {
        return Vec::new();
    }
    let spring = |(k, s): (usize, f64)| {
        let omega = std::f64::consts::TAU * (hz[0] + (hz[1] - hz[0]) * (s / rod.length()));
        GoalSpring { anchor: rod.root.r.transpose() * shape.x(k), stiffness: rod.mass[k] * omega * omega }
    };
    rod.arc.iter().copied().enumerate().map(spring).collect()
}

/// Each guide as the bundle of the hairs that it represents. Their number counts as a share of the median
/// over all guides.
fn bundles(rods: &[GuideRod]) -> Vec<BundleProperties> {
    let mut hairs: Vec<f64> = rods.iter().map(|r| r.hairs).collect();
    hairs.sort_by(f64::total_cmp);
    let median = |hairs: &[f64]| hairs[hairs.len() / 2];
    let bundle = |r: &GuideRod| {
        let material = &r.material;
        let area = material.section.area();
        let radius = |area: f64| (area / std::f64::consts::PI).sqrt();
        BundleProperties {
            hair_radius: radius(area),
            bundle_radius: radius(area * r.hairs / PACKING),
            parallel_friction: material.friction_parallel,
            cohesion: material.cohesion,
            hairs: r.hairs / median(&hairs),
        }
    };
    rods.iter().map(bundle).collect()
}

fn wisp_friction(rods: &[GuideRod]) -> Option<WispFriction> {
    // A loose hair has left its wisp.
    let rate = |r: &GuideRod| if r.rod.is_free() { 0.0 } else { r.material.wisp_friction };
    let sampler = |r: &GuideRod| FrictionSampler::new(&r.rod, r.hairs, rate(r));
    let wisps: Vec<usize> = rods.iter().map(|r| r.leaf.0).collect();
    WispFriction::new(rods.iter().map(sampler).collect(), &wisps)
}
