//! What the command line changes of a scene as it is read: overridden values, settings, frames and paths.

use super::settings::SettingsArguments;
use super::values;
use crate::error::{Diagnostic, Error, Result};
use crate::scene::anim::{OutputCurves, Resolution};
use crate::scene::{self, Anim, Groom, LoadOptions, PathMap};
use clap::Args;
use clap::builder::{OsStringValueParser, TypedValueParser};
use std::path::{Path, PathBuf};

/// Heading of the options for render farms.
pub const FARM: &str = "Render farm";

/// The changes as they are typed: the same for a bake and for `hairbake check`.
#[derive(Debug, Args)]
pub struct SceneChanges {
    #[command(flatten)]
    pub settings: SettingsArguments,
    #[command(flatten)]
    pub paths: PathMapArguments,
}

/// Where files are that have other paths on the machine that made the scene.
#[derive(Debug, Args)]
pub struct PathMapArguments {
    /// Replace the start FROM of paths by TO; may be repeated
    ///
    /// Applies to the command line and to the names of files inside the input files. FROM matches whole
    /// names: /show does not match /shows.
    #[arg(long, value_name = "FROM=TO", value_parser = values::path_rule, help_heading = FARM)]
    pub path_map: Vec<(String, String)>,
    /// Read path map rules from a JSON file in the format of OpenJD
    #[arg(long, value_name = "FILE", value_parser = OsStringValueParser::new().map(PathBuf::from),
        env = "HAIRBAKE_PATH_MAP_FILE", help_heading = FARM)]
    path_map_file: Option<PathBuf>,
}

impl PathMapArguments {
    fn read(&self) -> Result<PathMap> {
        let mut map = PathMap(self.path_map.clone());
        // An empty variable names no file.
        if let Some(file) = self.path_map_file.as_ref().filter(|file| !file.as_os_str().is_empty()) {
            map.0.extend(PathMap::read(file)?.0);
        }
        Ok(map)
    }
}

impl SceneChanges {
    /// The changes that are made to the files as they are read.
    ///
    /// # Errors
    /// [`Error::Config`] for a path map that cannot be read.
    pub fn load_options(&self) -> Result<LoadOptions> {
        Ok(LoadOptions { overrides: self.settings.overrides_for_reading(), path_map: self.paths.read()? })
    }

    /// Reads and checks a groom and an animation with their changes, `options`, and the settings, for the frames
    /// `shot` or all frames. Of the groom only some groups are baked if `some_groups`.
    ///
    /// # Errors
    /// [`Error::BadInput`], [`Error::Io`]; [`Error::Usage`] for settings that contradict each other.
    pub fn load(
        &self,
        [groom_file, anim_file]: [&Path; 2],
        options: &LoadOptions,
        shot: Option<(i32, i32)>,
        some_groups: bool,
    ) -> Result<(Groom, Anim)> {
        let (groom, mut anim) = scene::load_with(groom_file, anim_file, options)?;
        if let Some(frames) = shot {
            check_frames(anim_file, frames, anim.shot)?;
            anim.frames = frames;
        }
        self.settings.apply(&mut anim.settings);
        check_resolution(anim_file, &anim)?;
        check_curves(&groom, &anim, some_groups)?;
        Ok((groom, anim))
    }
}

/// Checks that `anim`, read from `file`, steps guides whose roots are pinned or free.
///
/// # Errors
/// [`Error::BadInput`].
fn check_resolution(file: &Path, anim: &Anim) -> Result<()> {
    let resolution = anim.resolution();
    if !anim.frees_roots() || resolution == Resolution::Full {
        return Ok(());
    }
    let message = format!("is {}, and some roots are pinned or free", values::name(&resolution));
    let help = "leave it out, or clamp all roots";
    Err(Error::from(Diagnostic::new(file, "settings.resolution", message, "full, or auto", help)))
}

fn check_frames(file: &Path, (first, last): (i32, i32), shot: (i32, i32)) -> Result<()> {
    if first >= shot.0 && last <= shot.1 {
        return Ok(());
    }
    Err(Error::BadInput(vec![Diagnostic {
        file: file.into(),
        span: None,
        key: "frames".into(),
        message: format!("--frames selects {first} to {last}"),
        allowed: format!("{} to {}, the frames of the animation", shot.0, shot.1),
        help: "select fewer frames, or extend \"frames\" in the file if its track covers more".into(),
    }]))
}

/// Checks that the curves to write exist.
fn check_curves(groom: &Groom, anim: &Anim, some_groups: bool) -> Result<()> {
    let settings = &anim.settings;
    if settings.curves == OutputCurves::Strands && groom.strands.curves.is_empty() {
        let message = "the groom has no render strands to write; use --curves guides";
        return Err(Error::Usage(message.into()));
    }
    let frames_only = settings.samples > 1 || anim.resolution() != Resolution::Full || some_groups;
    if settings.curves == OutputCurves::Steps && frames_only {
        let message = "--curves steps needs --resolution full and --samples 1, and excludes --base";
        return Err(Error::Usage(message.into()));
    }
    Ok(())
}
