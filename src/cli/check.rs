//! `hairbake check`.

use super::console;
use super::frame_list::{FrameList, frame_list};
use super::scene_arguments::SELECTION;
use super::scene_changes::SceneChanges;
use super::warnings::of_scene;
use crate::bake;
use crate::error::{Error, Result};
use crate::scene::{self, Format, LoadOptions};
use clap::Args;
use serde::Deserialize;
use std::path::{Path, PathBuf};

const EXAMPLES: &str = "\
Examples:
  hairbake check groom.json anim.json
  Check what a bake with the same options bakes:
    hairbake check groom.json anim.json --contact full --set groom.materials[0].friction=0.3";

/// `hairbake check` as it is typed.
#[derive(Debug, Args)]
#[command(after_help = EXAMPLES)]
pub struct CheckArguments {
    /// The files, grooms and animations in any order
    #[arg(required = true, value_name = "FILE")]
    files: Vec<PathBuf>,
    /// Frames of the bake, as --frames of `hairbake bake` [default: all frames of ANIM]
    #[arg(long, value_name = "LIST", value_parser = frame_list, allow_hyphen_values = true, help_heading = SELECTION)]
    frames: Option<FrameList>,
    #[command(flatten)]
    changes: SceneChanges,
}

/// Reports every error in the files, where grooms lie as a bake with each of the animations starts, and what a bake
/// warns of before it starts.
pub fn run(arguments: &CheckArguments) -> Result<()> {
    let options = arguments.changes.load_options()?;
    let files: Vec<PathBuf> = arguments.files.iter().map(|file| options.path_map.map_path(file)).collect();
    let paths: Vec<&Path> = files.iter().map(PathBuf::as_path).collect();
    let errors = scene::check_with(&paths, &options)?;
    if !errors.is_empty() {
        return Err(Error::BadInput(errors));
    }
    check_starts(arguments, &paths, &options)?;
    for file in &files {
        console::say(&format!("{}: no errors", file.display()));
    }
    Ok(())
}

/// Checks that a bake of each groom with each animation among `files`, which have no errors, can start; prints
/// warnings.
///
/// # Errors
/// [`Error::BadInput`] for each body that holds most of a groom, and for frames and resolutions that the files exclude;
/// [`Error::Usage`] for settings that contradict each other, and for values of a file that is not there; [`Error::Io`].
fn check_starts(arguments: &CheckArguments, files: &[&Path], options: &LoadOptions) -> Result<()> {
    let (mut grooms, mut anims, mut found) = (Vec::new(), Vec::new(), Vec::new());
    for file in files {
        if is_groom(file)? { grooms.push(file) } else { anims.push(file) }
    }
    let is_there = |format: Format| match format {
        Format::Groom => !grooms.is_empty(),
        Format::Anim => !anims.is_empty(),
    };
    if let Some(other) = arguments.changes.settings.overrides().iter().find(|o| !is_there(o.format)) {
        let message = format!("--set {}: no file of this kind is given", other.name());
        return Err(Error::Usage(message));
    }
    let shot = arguments.frames.as_ref().map(|list| list.shot);
    for anim_file in anims {
        for groom_file in &grooms {
            let loaded = arguments.changes.load([groom_file, anim_file], options, shot, false);
            match loaded.and_then(|(groom, anim)| bake::check_start(groom, &anim, anim_file)) {
                Err(Error::BadInput(errors)) => found.extend(errors),
                warnings => {
                    let text = |w| format!("{}: {}", anim_file.display(), of_scene(w).to_text());
                    warnings?.iter().for_each(|warning| console::warn(&text(warning)));
                }
            }
        }
    }
    Error::if_any(found)
}

/// Whether a file without errors is a groom; else it is an animation.
fn is_groom(file: &Path) -> Result<bool> {
    #[derive(Deserialize)]
    struct Start {
        format: String,
    }
    let bytes = crate::file::read_file(file).map_err(|e| Error::io(file, e))?;
    let start: Start = serde_json::from_slice(&bytes).map_err(|e| Error::Internal(e.to_string()))?;
    Ok(start.format == "hairbake-groom")
}
