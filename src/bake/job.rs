//! One bake of a scene into a folder: what every stage of it starts from.

use super::base_cache::{BaseCache, GroupSelection};
use super::output::Written;
use super::work_dir::WorkDir;
use crate::Result;
use crate::cache::{InputRecord, sha256};
use crate::dynamics::guide_rods::GuideRods;
use crate::dynamics::model;
use crate::scene::anim::{ContactSetting, Resolution};
use crate::scene::{Anim, Groom, Override};
use crate::strands::RETRACTION_SPAN;
use serde_json::{Value, json};
use std::collections::BTreeSet;
use std::ops::RangeInclusive;
use std::path::{Path, PathBuf};

/// A bake, ready for any of its stages.
pub struct Job {
    /// The groom, with its trees.
    pub groom: Groom,
    /// The animation, with the settings of this bake and the part of the shot that it covers.
    pub anim: Anim,
    /// The groom's guides as rods.
    pub rods: GuideRods,
    /// The cache that has what this bake does not make, if it does not make all.
    pub base: Option<BaseCache>,
    /// The files that the scene was read from.
    pub inputs: Vec<InputRecord>,
    /// The settings of the bake, resolved, and all values put in place of the files'.
    pub settings: Value,
    /// Folder of the cache.
    pub out: PathBuf,
    /// What the bytes of the cache follow from, hashed.
    pub key: String,
    /// What is done so far.
    pub work: WorkDir,
}

impl Job {
    /// Begins a bake into the folder `out`, or goes on with one. `set` are the values put in place of the files'; `only` is for a bake of some groups.
    ///
    /// # Errors
    /// [`crate::Error::Io`] where the folder cannot be written; those of [`BaseCache::open`], before anything is.
    pub fn begin(
        groom: Groom,
        anim: Anim,
        mut inputs: Vec<InputRecord>,
        set: &[Override],
        only: Option<&GroupSelection>,
        out: &Path,
    ) -> Result<Self> {
        let groom = groom.with_default_trees(anim.settings.nodes);
        let mut rods = GuideRods::new(&groom, &anim);
        let mut settings = settings(&anim, set);
        let base = match only {
            Some(only) => {
                let written = Written::new(&groom, &anim, &rods);
                let base = BaseCache::open(only, &groom, &anim, &written.header())?;
                let moved = moved(&groom, &anim, &rods, &base, &written);
                rods.moved = moved;
                inputs.push(base.record()?);
                settings["groups"] = only.groups.iter().cloned().collect();
                Some(base)
            }
            None => None,
        };
        let key = key(&anim, &inputs, &settings);
        let (first, last) = anim.frames;
        let work = WorkDir::begin(out, &key, (first - 1, last + 1))?;
        Ok(Job { groom, anim, rods, base, inputs, settings, out: out.into(), key, work })
    }

    /// All frames, with a handle frame before the shot and one after it.
    pub fn frames(&self) -> RangeInclusive<i32> {
        self.anim.frames.0 - 1..=self.anim.frames.1 + 1
    }

    /// The frames that are simulated: beyond the last there are some that the strands of the last depend on.
    pub fn simulated(&self) -> RangeInclusive<i32> {
        *self.frames().start()..=self.frames().end() + RETRACTION_SPAN as i32
    }

    /// Sub-steps from the start of the pre-roll to a frame.
    pub(super) fn steps_to(&self, frame: i32) -> i64 {
        model::substeps_to(&self.anim, frame)
    }

    /// Sub-steps from the start of the pre-roll to where a stage begins whose first frame is `frame`: to the frame before, but the
    /// pre-roll belongs to the first frame.
    pub(super) fn steps_before(&self, frame: i32) -> i64 {
        if frame > *self.frames().start() { self.steps_to(frame - 1) } else { 0 }
    }
}

/// Which guides a bake of some groups has to move: its own, those that its strands follow, and those that these rub
/// against. The simulation adds what leads them in wisps.
fn moved(groom: &Groom, anim: &Anim, rods: &GuideRods, base: &BaseCache, written: &Written) -> Vec<bool> {
    let settings = &anim.settings;
    let rubs = rods.simulated.iter().any(|r| r.material.wisp_friction > 0.0);
    // What leads rubs against others, and those may be led by more.
    if settings.contact == ContactSetting::Full || rubs && settings.resolution() != Resolution::Full {
        return vec![true; rods.simulated.len()];
    }
    let mut moved = vec![false; rods.simulated.len()];
    let followed = base.baked(&written.strands.curves).flat_map(|strand| &written.follows[strand]);
    followed.for_each(|(guide, _)| moved[*guide] = true);
    base.baked(&groom.guides.curves).for_each(|guide| moved[guide] = true);
    // Guides of a coarse wisp may rub against each other.
    let wisps: BTreeSet<usize> =
        rods.simulated.iter().zip(&moved).filter(|(_, moved)| **moved).map(|(r, _)| r.leaf.0).collect();
    rods.simulated.iter().zip(moved).map(|(r, moved)| moved || rubs && wisps.contains(&r.leaf.0)).collect()
}

/// What every byte follows from: program, inputs, settings and the first frame, before which the hair settles; not the last frame,
/// nor threads, nor where anything lies.
fn key(anim: &Anim, inputs: &[InputRecord], settings: &Value) -> String {
    let inputs: Vec<[&str; 2]> = inputs.iter().map(|i| [i.role.as_str(), i.sha256.as_str()]).collect();
    let all = json!({
        "hairbake": env!("CARGO_PKG_VERSION"),
        "build": crate::BUILD,
        "target": [std::env::consts::ARCH, std::env::consts::OS],
        "inputs": inputs,
        "settings": settings,
        "first_frame": anim.frames.0,
    });
    sha256(all.to_string().as_bytes())
}

/// The settings of a bake as the manifest holds them.
fn settings(anim: &Anim, set: &[Override]) -> Value {
    let mut settings = json!({
        "substeps": anim.settings.substeps,
        "preroll_s": anim.settings.preroll,
        "nodes": anim.settings.nodes,
        "scheme": anim.settings.scheme,
        "resolution": anim.settings.resolution(),
        "split_tolerance": anim.settings.split_tolerance,
        "contact": anim.settings.contact,
        "curves": anim.settings.curves,
        "keep": anim.settings.keep,
        "samples": anim.settings.samples,
        "shutter": anim.settings.shutter,
        "accelerations": anim.settings.accelerations,
        "gravity_m_s2": [anim.gravity.x, anim.gravity.y, anim.gravity.z],
    });
    if !set.is_empty() {
        settings["set"] = set.iter().map(|o| (o.name(), o.value.clone())).collect();
    }
    settings
}
