//! The folder of an output file.

use crate::error::{Error, Result};
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
