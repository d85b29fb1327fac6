//! Files that a command reads.

use crate::error::{Error, Result};
use std::path::Path;

/// Checks that all files exist, so that one report names all that do not. Patterns of sequences (`####`) are
/// left to their readers.
///
/// # Errors
/// [`Error::BadInput`].
pub fn require<'a>(files: impl IntoIterator<Item = &'a Path>) -> Result<()> {
    let mut missing = Vec::new();
    for file in files {
        let found = std::fs::metadata(file).map(|meta| meta.is_dir());
        let error = match found {
            Ok(true) => std::io::ErrorKind::IsADirectory.into(),
            Err(error) if !file.to_string_lossy().contains('#') => error,
            _ => continue,
        };
        if let Error::BadInput(found) = Error::reading(file, error) {
            missing.extend(found);
        }
    }
    Error::if_any(missing)
}
