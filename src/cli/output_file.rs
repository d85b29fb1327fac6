//! Output files and their folders.

use super::console;
use crate::error::{Error, Result};
use crate::scene::Groom;
use std::fmt::Display;
use std::path::Path;

/// The folder that holds `file`.
pub fn folder(file: &Path) -> &Path {
    file.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."))
}

/// Creates the folder that holds `file`.
///
/// # Errors
/// [`Error::Io`].
pub fn create_folder(file: &Path) -> Result<()> {
    let folder = folder(file);
    std::fs::create_dir_all(folder).map_err(|e| Error::io(folder, e))
}

/// Writes a groom and prints the report on it.
///
/// # Errors
/// [`Error::Io`].
pub fn write_groom(file: &Path, groom: &Groom, report: &impl Display) -> Result<()> {
    create_folder(file)?;
    groom.write(file)?;
    console::say(report.to_string().trim_end());
    console::wrote(file);
    Ok(())
}
