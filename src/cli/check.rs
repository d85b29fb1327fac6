//! `hairbake check` and `hairbake schema`.

use super::arguments::SchemaFormat;
use super::console;
use super::scene_arguments::check_resolution;
use crate::bake;
use crate::error::{Error, Result};
use crate::scene::{self, Format};
use serde::Deserialize;
use std::path::{Path, PathBuf};

/// Reports every error in the files, and where grooms lie as a bake with each of the animations starts.
pub fn check(files: &[PathBuf]) -> Result<()> {
    let paths: Vec<&Path> = files.iter().map(PathBuf::as_path).collect();
    let errors = scene::check(&paths)?;
    if !errors.is_empty() {
        return Err(Error::BadInput(errors));
    }
    check_starts(&paths)?;
    for file in files {
        console::say(&format!("{}: no errors", file.display()));
    }
    Ok(())
}

/// Checks that a bake of each groom with each animation among `files`, which have no errors, can start.
///
/// # Errors
/// [`Error::BadInput`] for each body that holds most of a groom, and for resolutions that roots exclude;
/// [`Error::Io`].
fn check_starts(files: &[&Path]) -> Result<()> {
    let (mut grooms, mut anims, mut found) = (Vec::new(), Vec::new(), Vec::new());
    for file in files {
        if is_groom(file)? { grooms.push(file) } else { anims.push(file) }
    }
    for anim_file in anims {
        for groom_file in &grooms {
            let (groom, anim) = scene::load(groom_file, anim_file)?;
            let start = || bake::check_start(groom, &anim, anim_file);
            match check_resolution(anim_file, &anim).and_then(|()| start()) {
                Err(Error::BadInput(errors)) => found.extend(errors),
                other => other?,
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

/// Prints the schema of a format.
pub fn schema(format: SchemaFormat) -> Result<()> {
    let format = match format {
        SchemaFormat::Groom => Format::Groom,
        SchemaFormat::Anim => Format::Anim,
    };
    console::data(scene::schema(format).as_bytes())
}
