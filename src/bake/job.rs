//! One bake of a scene into a folder: the inputs of every stage.

mod finished_cache;

use super::base_cache::{BaseCache, GroupSelection};
use super::cache_content::CacheContent;
use super::over::OverPlan;
use super::scene_warnings::{SceneWarning, scene_warnings};
use super::start_check;
use super::work_dir::WorkDir;
use crate::Result;
use crate::cache::{InputRecord, sha256};
use crate::dynamics::clock;
use crate::dynamics::guide_rods::GuideRods;
use crate::scene::anim::{ContactSetting, Resolution};
use crate::scene::{Anim, Groom, Override};
use crate::strands::LOOKAHEAD;
use finished_cache::Planned;
use serde_json::{Value, json};
use std::collections::BTreeSet;
use std::ops::RangeInclusive;
use std::path::{Path, PathBuf};

/// A bake, ready for any stage.
pub struct Job {
    /// The groom, with its trees.
    pub groom: Groom,
    /// The animation, with the settings and the frames of this bake.
    pub anim: Anim,
    /// The groom's guides as rods.
    pub rods: GuideRods,
    /// The cache that provides the groups that are not baked, in a bake of some groups.
    pub base: Option<BaseCache>,
    /// What the bake does to the curves of a stage, in over mode.
    pub over: Option<OverPlan>,
    /// The files of the scene.
    pub inputs: Vec<InputRecord>,
    /// The resolved settings, with all overrides of the files' values.
    pub settings: Value,
    /// Folder of the cache.
    pub out: PathBuf,
    /// Hash of everything that the bytes of the cache depend on.
    pub key: String,
    /// The work folder.
    pub work: WorkDir,
}

/// Options of a bake beside its settings.
#[derive(Debug, Default)]
pub struct JobOptions<'a> {
    /// Overrides of the files' values.
    pub set: &'a [Override],
    /// Groups to bake over an earlier cache.
    pub only: Option<&'a GroupSelection>,
    /// What to do to the curves of a stage; made for the same groom and animation.
    pub over: Option<OverPlan>,
    /// Whether to replace a finished cache of another bake.
    pub overwrite: bool,
}

impl Job {
    /// Begins or resumes a bake into the folder `out`; `inputs` are the files of the scene.
    ///
    /// # Errors
    /// [`crate::Error::Io`] if the folder cannot be written; before anything is written or removed, those of
    /// [`Job::new`] and [`Job::check_start`], and a finished cache of another bake in the folder.
    pub fn begin(
        groom: Groom,
        anim: Anim,
        inputs: Vec<InputRecord>,
        options: JobOptions,
        out: &Path,
    ) -> Result<Self> {
        let overwrite = options.overwrite;
        let job = Job::new(groom, anim, inputs, options, out)?;
        if !overwrite {
            let Job { key, inputs, settings, anim, .. } = &job;
            finished_cache::keep(out, &Planned { key, inputs, settings, frames: anim.frames })?;
        }
        // A bake that has begun has passed the check.
        if !job.work.has_begun() {
            job.check_start()?;
        }
        let frames = job.frames();
        job.work.begin((*frames.start(), *frames.end()))?;
        Ok(job)
    }

    /// A bake into the folder `out`, of which nothing is written yet; `inputs` are the files of the scene.
    ///
    /// # Errors
    /// Those of [`BaseCache::open`].
    pub fn new(
        groom: Groom,
        anim: Anim,
        mut inputs: Vec<InputRecord>,
        options: JobOptions,
        out: &Path,
    ) -> Result<Self> {
        let JobOptions { set, only, over, .. } = options;
        if let Some(OverPlan { target, .. }) = &over {
            let file = target.file.file_name().unwrap_or_default().to_string_lossy().into_owned();
            inputs.push(InputRecord { role: "over".into(), file, sha256: target.sha256.clone() });
        }
        let groom = groom.with_default_trees(anim.settings.nodes);
        let mut rods = GuideRods::new(&groom, &anim);
        let mut settings = settings(&anim, set);
        let base = match only {
            Some(only) => {
                let written = CacheContent::new(&groom, &anim, &rods);
                let base = BaseCache::open(only, &groom, &anim, &written.header())?;
                rods.required = required_guides(&groom, &anim, &rods, &base, &written);
                inputs.push(base.record()?);
                settings["groups"] = only.groups.iter().cloned().collect();
                Some(base)
            }
            None => None,
        };
        let key = key(&anim, &inputs, &settings);
        let work = WorkDir::new(out, &key);
        Ok(Job { groom, anim, rods, base, over, inputs, settings, out: out.into(), key, work })
    }

    /// Checks where the groom lies when the pre-roll starts; returns what the user is warned of there.
    ///
    /// # Errors
    /// [`crate::Error::BadInput`] for each body that holds most of the groom.
    pub fn check_start(&self) -> Result<Vec<SceneWarning>> {
        let anim = self.inputs.iter().find(|input| input.role == "anim");
        let file = Path::new(anim.map_or("anim.json", |input| &input.file));
        start_check::check(&self.groom, &self.anim, &self.rods, file)
    }

    /// What the user is warned of in the scene.
    pub fn warnings(&self) -> Vec<SceneWarning> {
        scene_warnings(&self.groom, &self.anim, &self.rods)
    }

    /// As [`cache_frames`].
    pub fn frames(&self) -> RangeInclusive<i32> {
        cache_frames(&self.anim)
    }

    /// As [`simulated_frames`].
    pub fn simulated(&self) -> RangeInclusive<i32> {
        simulated_frames(&self.anim)
    }

    /// Sub-steps from the start of the pre-roll to a frame.
    pub(super) fn steps_to(&self, frame: i32) -> i64 {
        clock::substeps_to(&self.anim, frame)
    }

    /// Sub-steps from the start of the pre-roll to the start of a stage whose first frame is `frame`; the
    /// pre-roll belongs to the first frame.
    pub(super) fn steps_before(&self, frame: i32) -> i64 {
        if frame > *self.frames().start() { self.steps_to(frame - 1) } else { 0 }
    }
}

/// The frames of the cache of a bake of `anim`: the shot with one handle frame before it and one after it.
pub fn cache_frames(anim: &Anim) -> RangeInclusive<i32> {
    anim.frames.0 - 1..=anim.frames.1 + 1
}

/// The frames that a bake of `anim` simulates: the strands of the last frame depend on some frames after it.
pub fn simulated_frames(anim: &Anim) -> RangeInclusive<i32> {
    let frames = cache_frames(anim);
    *frames.start()..=frames.end() + LOOKAHEAD as i32
}

/// Which guides a bake of some groups must simulate: its own, those that its strands are interpolated from,
/// and those that exchange friction with these. The simulation adds their leaders in wisps.
fn required_guides(
    groom: &Groom,
    anim: &Anim,
    rods: &GuideRods,
    base: &BaseCache,
    written: &CacheContent,
) -> Vec<bool> {
    let settings = &anim.settings;
    let friction = rods.simulated.iter().any(|r| r.material.wisp_friction > 0.0);
    let meets_hair = match settings.contact {
        ContactSetting::Full => true,
        ContactSetting::Volume => rods.sampling.is_some(),
        ContactSetting::Bodies | ContactSetting::Penalty => false,
    };
    // Leaders exchange friction with other guides, which may have further leaders.
    if meets_hair || friction && anim.resolution() != Resolution::Full {
        return vec![true; rods.simulated.len()];
    }
    let mut required = vec![false; rods.simulated.len()];
    let followed = base.baked(&written.strands.curves).flat_map(|strand| &written.guide_weights[strand]);
    followed.for_each(|(guide, _)| required[*guide] = true);
    base.baked(&groom.guides.curves).for_each(|guide| required[guide] = true);
    // Guides of a coarse wisp exchange friction.
    let wisps: BTreeSet<usize> = rods
        .simulated
        .iter()
        .zip(&required)
        .filter(|(_, required)| **required)
        .map(|(r, _)| r.leaf.0)
        .collect();
    rods.simulated
        .iter()
        .zip(required)
        .map(|(r, required)| required || friction && wisps.contains(&r.leaf.0))
        .collect()
}

/// Hash of everything that the bytes depend on: program, inputs, settings and the first frame, before which
/// the hair settles. The last frame, threads and file locations do not matter.
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

/// The settings of a bake as in the manifest.
fn settings(anim: &Anim, set: &[Override]) -> Value {
    let mut settings = json!({
        "substeps": anim.settings.substeps,
        "preroll_s": anim.settings.preroll,
        "nodes": anim.settings.nodes,
        "scheme": anim.settings.scheme,
        "resolution": anim.resolution(),
        "split_tolerance": anim.settings.split_tolerance,
        "contact": anim.settings.contact,
        "curves": anim.settings.curves,
        "keep": anim.settings.keep,
        "samples": anim.settings.samples,
        "shutter": anim.settings.shutter,
        "accelerations": anim.settings.accelerations,
        "normals": anim.settings.normals,
        "reactions": anim.settings.reactions,
        "gravity_m_s2": [anim.gravity.x, anim.gravity.y, anim.gravity.z],
    });
    if !set.is_empty() {
        settings["set"] = set.iter().map(|o| (o.name(), o.value.clone())).collect();
    }
    settings
}
