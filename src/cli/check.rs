//! `hairbake check` and `hairbake schema`.

use super::arguments::SchemaFormat;
use super::console;
use crate::error::{Error, Result};
use crate::scene::{self, Format};
use std::path::{Path, PathBuf};

/// Reports every error in the files.
pub fn check(files: &[PathBuf]) -> Result<()> {
    let paths: Vec<&Path> = files.iter().map(PathBuf::as_path).collect();
    let errors = scene::check(&paths)?;
    if !errors.is_empty() {
        return Err(Error::BadInput(errors));
    }
    for file in files {
        console::say(&format!("{}: no errors", file.display()));
    }
    Ok(())
}

/// Prints the schema of a format.
pub fn schema(format: SchemaFormat) -> Result<()> {
    let format = match format {
        SchemaFormat::Groom => Format::Groom,
        SchemaFormat::Anim => Format::Anim,
    };
    console::data(scene::schema(format).as_bytes())
}
