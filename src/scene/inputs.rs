//! Which files a scene is made of.

use super::document::Document;
use super::reading::Reading;
use super::sequence::Sequence;
use crate::error::Result;
use std::path::{Path, PathBuf};

/// Where files name others: a list at the root, and the place in its elements. Buffers, tracks, meshes, sequences of meshes.
pub(super) const NAMED: &[(&str, &str)] = &[
    ("buffers", "/uri"),
    ("bodies", "/track/file"),
    ("colliders", "/shape/file"),
    ("colliders", "/shape/sequence"),
];

/// The groom and the animation with every file that they name, in the order in which they name them: what
/// each is to the scene (`groom`, `anim`, `buffer`, `track`, `collider`, and `deformation` for each frame of a deforming
/// collider) and its path.
///
/// # Errors
/// As [`super::load`].
pub fn inputs(groom: &Path, anim: &Path, reading: &Reading) -> Result<Vec<(&'static str, PathBuf)>> {
    let mut files = Vec::new();
    for (role, path) in [("groom", groom), ("anim", anim)] {
        let doc = Document::open_as(role, path, reading)?;
        files.push((role, path.to_path_buf()));
        for (role, (list, place)) in ["buffer", "track", "collider"].into_iter().zip(NAMED) {
            files.extend(doc.named(list, place).map(|name| (role, doc.folder().join(name))));
        }
        for sequence in doc.named("colliders", "/shape/sequence").filter_map(Sequence::new) {
            let folder = doc.folder();
            let Some((first, last)) = doc.range_at("frames").map(|frames| sequence.reach(&folder, frames))
            else {
                continue;
            };
            files.extend((first..=last).map(|frame| ("deformation", sequence.path(&folder, frame))));
        }
    }
    Ok(files)
}
