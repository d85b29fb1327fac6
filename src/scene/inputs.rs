//! Which files a scene is made of.

use super::document::Document;
use crate::error::Result;
use std::path::{Path, PathBuf};

/// The groom and the animation with every file that they name, in the order in which they name them: what
/// each is to the scene (`groom`, `anim`, `buffer`, `track`, `collider`) and its path.
///
/// # Errors
/// As [`super::load`].
pub fn inputs(groom: &Path, anim: &Path) -> Result<Vec<(&'static str, PathBuf)>> {
    let mut files = Vec::new();
    for (role, path) in [("groom", groom), ("anim", anim)] {
        let doc = Document::open(path)?;
        files.push((role, path.to_path_buf()));
        for (role, list, place) in [
            ("buffer", "buffers", "/uri"),
            ("track", "bodies", "/track/file"),
            ("collider", "colliders", "/shape/file"),
        ] {
            files.extend(doc.named_files(list, place).into_iter().map(|file| (role, file)));
        }
    }
    Ok(files)
}
