//! The scene of a bake: groom, animation, settings and output folder, the same for every stage.

use super::scene_changes::SceneChanges;
use super::settings::Explained;
use super::{console, summary, values};
use crate::bake::SceneWarning;
use crate::bake::base_cache::GroupSelection;
use crate::bake::job::{Job, JobOptions};
use crate::bake::over::{self, OverPlan, Undeformable};
use crate::cache::{DEFORM, InputRecord, MANIFEST, OVER, SHOT};
use crate::error::{Diagnostic, Error, Result};
use crate::scene::anim::OutputCurves;
use crate::scene::{Anim, Groom, LoadOptions, OverSource, Override, SourceCurves};
use crate::{bake, import, scene};
use clap::Args;
use std::path::{Path, PathBuf};

/// Heading of the options that select a part of the shot.
pub const SELECTION: &str = "Selection";
/// Heading of the options on what a command writes.
pub const OUTPUT: &str = "Output";

/// The scene as it is typed. All stages of a bake need the same one.
#[derive(Debug, Args)]
pub struct SceneArguments {
    /// Groom file (groom.json): materials, wisps, guides, render strands
    pub groom: PathBuf,
    /// Animation file (anim.json): frames, head motion, colliders, wind, settings
    pub anim: PathBuf,
    /// Folder for the cache, its report and its contact sheet; created if missing
    ///
    /// An unfinished bake in this folder is resumed, or replaced if inputs or settings changed. A finished
    /// cache of another bake is kept: choose another folder, or give --overwrite.
    #[arg(long, short, value_name = "DIR", help_heading = OUTPUT)]
    pub output: PathBuf,
    /// Replace a finished cache of other inputs, settings or frames
    #[arg(long, help_heading = OUTPUT)]
    overwrite: bool,
    /// Bake only these groups of the groom, by comma-separated names; needs --base
    ///
    /// All other curves are copied from --base, so that hair already approved does not change.
    #[arg(long, value_name = "NAMES", value_delimiter = ',', requires = "base", help_heading = SELECTION)]
    groups: Vec<String>,
    /// Finished cache that provides the curves of all other groups
    ///
    /// It must have the same head motion, frames, units and samples, and the same groom except for --groups.
    #[arg(long, value_name = "CACHE", requires = "groups", help_heading = SELECTION)]
    base: Option<PathBuf>,
    /// Put the motion over the curves that the groom was imported from, at and below this prim of a USD
    /// stage, as well [default: the curves that `import track` found in the stage of the motion, if any]
    ///
    /// Only points, velocities, accelerations, extent and normals are overridden, in the groom's own basis,
    /// order and space: materials, subsets, ids and all else stay. Open hair.shot.usda, or add hair.over.usda
    /// to the sublayers of the shot. The cache itself is written as always.
    ///
    /// With --curves guides it is hair.deform.usda, by which Houdini deforms the curves by the guides as it
    /// renders.
    #[arg(long, value_name = "FILE[:PRIM]", value_parser = values::stage_prim, help_heading = OUTPUT)]
    over: Option<OverSource>,
    /// Write the cache alone, without --over
    #[arg(long, conflicts_with = "over", help_heading = OUTPUT)]
    no_over: bool,
    #[command(flatten)]
    changes: SceneChanges,
}

impl SceneArguments {
    /// Reads and checks the scene of the frames `shot`, or of all frames, with the settings of the command
    /// line.
    ///
    /// # Errors
    /// [`Error::BadInput`], [`Error::Io`]; [`Error::Config`] for a path map that cannot be read;
    /// [`Error::Usage`] for settings that contradict each other.
    pub fn load(&self, shot: Option<(i32, i32)>) -> Result<Scene> {
        let options = self.changes.load_options()?;
        let paths = &options.path_map;
        let [groom_file, anim_file, out] =
            [&self.groom, &self.anim, &self.output].map(|path| paths.map_path(path));
        let base = self.base.as_ref().map(|base| paths.map_path(base));
        if base.as_deref().is_some_and(|base| crate::file::is_same(base, &out)) {
            let message = "--base and --output are the same folder; choose another with -o";
            return Err(Error::Usage(message.into()));
        }
        let only = base.map(|base| GroupSelection { groups: self.groups.clone(), base });
        let over =
            self.over.as_ref().map(|over| OverSource { file: paths.map_path(&over.file), ..over.clone() });
        let set = self.changes.settings.overrides().to_vec();
        let (groom, mut anim) =
            self.changes.load([&groom_file, &anim_file], &options, shot, only.is_some())?;
        let over = match (over, anim.over.take()) {
            (None, _) if self.no_over => None,
            (None, Some(_)) if !over::moves_all(&anim.settings) => {
                console::say("over mode is off: these settings leave out curves of the groom");
                None
            }
            // The unit and axis that `import track` was given for a stage are those of its other prims.
            (Some(over), Some(OverSource { file, metres_per_unit, up, .. }))
                if crate::file::is_same(&over.file, &file) =>
            {
                Some(OverSource { metres_per_unit, up, ..over })
            }
            (over, default) => over.or(default),
        };
        let over = over.filter(|_| {
            let strands = groom.source.as_ref().is_some_and(SourceCurves::has_strands);
            let alone = strands && anim.settings.curves == OutputCurves::Guides && self.over.is_none();
            let never = if alone { over::never_deforms(&groom, &anim) } else { None };
            never.inspect(|why| console::say(&format!("over mode is off: {why}"))).is_none()
        });
        let written = |over: &OverSource| {
            [SHOT, OVER, DEFORM].iter().any(|name| crate::file::is_same(&over.file, &out.join(name)))
        };
        if over.as_ref().is_some_and(written) {
            let message = "--over is a layer that the bake writes to --output; name the stage below it";
            return Err(Error::Usage(message.into()));
        }
        let over = match over.map(|over| over_plan(&over, &groom, &anim, &out)).transpose()? {
            Some(Ok(plan)) => Some(plan),
            Some(Err(undeformable)) if self.over.is_some() => return Err(Error::BadInput(undeformable)),
            Some(Err(undeformable)) => {
                let found = |found: &Diagnostic| format!("{}: {}", found.key, found.message);
                let found: Vec<String> = undeformable.iter().map(found).collect();
                console::say(&format!("over mode is off: {}", found.join("; ")));
                None
            }
            None => None,
        };
        let overwrite = self.overwrite;
        Ok(Scene { groom, anim, groom_file, anim_file, options, set, only, over, out, overwrite })
    }

    /// Starts or resumes the bake of the frames `shot`, or of all frames. Calls `check` before anything is
    /// written.
    ///
    /// # Errors
    /// As [`SceneArguments::load`]; those of `check`.
    pub fn job(&self, shot: Option<(i32, i32)>, check: impl FnOnce(&Anim) -> Result<()>) -> Result<Job> {
        let scene = self.load(shot)?;
        check(&scene.anim)?;
        let out = scene.out.clone();
        let job = scene.begin(&out)?;
        if !out.join(MANIFEST).exists() {
            summary::remove_old(&out)?;
        }
        Ok(job)
    }

    /// Groom, animation and output folder as absolute paths.
    ///
    /// # Errors
    /// [`Error::Io`] without a current folder; [`Error::Usage`] for a path that is not Unicode.
    pub fn absolute_paths(&self) -> Result<[String; 3]> {
        Ok([absolute(&self.groom)?, absolute(&self.anim)?, absolute(&self.output)?])
    }

    /// Every setting of `scene` with its value and origin.
    ///
    /// # Errors
    /// [`Error::Io`] if the animation can no longer be read.
    pub fn explained(&self, scene: &Scene) -> Result<Vec<Explained>> {
        let bytes = crate::file::read_file(&scene.anim_file).map_err(|e| Error::io(&scene.anim_file, e))?;
        let file: serde_json::Value = serde_json::from_slice(&bytes).unwrap_or_default();
        let name = scene.anim_file.display().to_string();
        let in_file = |key: &str| {
            let names = [Some(key), scene::former_name("settings", key)];
            names.into_iter().flatten().any(|name| file["settings"].get(name).is_some())
        };
        let mut rows = self.changes.settings.explained(&scene.anim, &name, in_file);
        if let Some(only) = &scene.only {
            for (name, value) in
                [("groups", only.groups.join(", ")), ("base", only.base.display().to_string())]
            {
                rows.push(Explained { name: name.into(), value, origin: format!("--{name}") });
            }
        }
        let over = scene.over.as_ref().map(|plan| plan.target.file.display().to_string());
        let origin = match (&over, self.over.is_some(), self.no_over) {
            (_, true, _) => "--over".into(),
            (_, _, true) => "--no-over".into(),
            (Some(_), ..) => name,
            (None, ..) => "default".into(),
        };
        rows.push(Explained { name: "over".into(), value: over.unwrap_or_else(|| "none".into()), origin });
        Ok(rows)
    }

    /// The options that give the same scene again in any folder, without groom, animation and output.
    ///
    /// # Errors
    /// [`Error::Io`] without a current folder; [`Error::Usage`] for a path that is not Unicode.
    pub fn to_words(&self) -> Result<Vec<String>> {
        let mut words = self.changes.settings.to_words();
        if self.overwrite {
            words.push("--overwrite".into());
        }
        if let Some(base) = &self.base {
            words.extend(["--groups".into(), self.groups.join(",")]);
            words.extend(["--base".into(), absolute(base)?]);
        }
        if let Some(OverSource { file, prims, .. }) = &self.over {
            let prims = prims.iter().map(|prim| format!(":{prim}")).collect::<String>();
            words.extend(["--over".into(), format!("{}{prims}", absolute(file)?)]);
        }
        if self.no_over {
            words.push("--no-over".into());
        }
        for (from, to) in &self.changes.paths.path_map {
            words.extend(["--path-map".into(), format!("{from}={to}")]);
        }
        Ok(words)
    }

    /// Name of the shot for the report.
    pub fn title(&self) -> String {
        self.anim.file_stem().unwrap_or_default().to_string_lossy().into_owned()
    }
}

/// A scene and the files it was read from.
pub struct Scene {
    /// The groom.
    pub groom: scene::Groom,
    /// The animation, with the settings of the bake.
    pub anim: scene::Anim,
    groom_file: PathBuf,
    anim_file: PathBuf,
    options: LoadOptions,
    /// The overrides of the files' values.
    set: Vec<Override>,
    only: Option<GroupSelection>,
    over: Option<OverPlan>,
    out: PathBuf,
    overwrite: bool,
}

impl Scene {
    /// Starts or resumes the bake in the folder `out`.
    ///
    /// # Errors
    /// Those of [`Job::begin`].
    pub fn begin(self, out: &Path) -> Result<Job> {
        self.job(out, Job::begin)
    }

    /// Checks where the groom lies when the bake starts; returns what the user is warned of. Writes nothing.
    ///
    /// # Errors
    /// Those of [`Job::new`] and [`Job::check_start`].
    pub fn check_start(self) -> Result<Vec<SceneWarning>> {
        let out = self.out.clone();
        let job = self.job(&out, Job::new)?;
        let at_start = job.check_start()?;
        Ok(job.warnings().into_iter().chain(at_start).collect())
    }

    /// The bake in the folder `out`, made by `make`.
    fn job(
        self,
        out: &Path,
        make: impl FnOnce(Groom, Anim, Vec<InputRecord>, JobOptions, &Path) -> Result<Job>,
    ) -> Result<Job> {
        let Scene { groom, anim, groom_file, anim_file, options, set, only, over, overwrite, .. } = self;
        let inputs = bake::input_records(&groom_file, &anim_file, &options)?;
        let options = JobOptions { set: &set, only: only.as_ref(), over, overwrite };
        make(groom, anim, inputs, options, out)
    }
}

/// A path that names the same file in any folder.
///
/// # Errors
/// [`Error::Io`] without a current folder; [`Error::Usage`] for a path that is not Unicode.
fn absolute(path: &Path) -> Result<String> {
    let path = std::path::absolute(path).map_err(|e| Error::io(path, e))?;
    let text = path.to_str().map(String::from);
    text.ok_or_else(|| Error::Usage(format!("the path {} is not valid Unicode", path.display())))
}

/// What a bake into the folder `out` does to the curves of a stage.
///
/// # Errors
/// As [`import::over_target`] and [`OverPlan::new`]; the help of each tells how to do without.
/// [`Error::Usage`] for a stage that shows the stage of the bake, which would show itself.
fn over_plan(
    over: &OverSource,
    groom: &Groom,
    anim: &Anim,
    out: &Path,
) -> Result<std::result::Result<OverPlan, Undeformable>> {
    let shown = out.join(SHOT);
    let time = groom.source.as_ref().and_then(|source| source.origin.time);
    let offsets: Vec<f64> = anim.settings.offsets().collect();
    let read = || {
        let target = import::over_target(over, time, [anim.shot.0 - 1, anim.shot.1 + 1], &offsets)?;
        if target.layers.iter().any(|layer| crate::file::is_same(&layer.file, &shown)) {
            let message = format!(
                "the stage that over mode moves curves of shows {SHOT}, which the bake writes; name the stage \
                 below it (--over), or bake with --no-over"
            );
            return Err(Error::Usage(message));
        }
        OverPlan::new(groom, anim, target)
    };
    let with_help = |mut found: Vec<Diagnostic>| {
        found.iter_mut().for_each(|found| found.help.push_str(", or bake with --no-over"));
        found
    };
    match read() {
        Ok(plan) => Ok(plan.map_err(with_help)),
        Err(Error::BadInput(found)) => Err(Error::BadInput(with_help(found))),
        Err(error) => Err(error),
    }
}
