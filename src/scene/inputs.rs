//! The files that a scene consists of.

use super::anim::Settings;
use super::file_sequence::{FileSequence, lead_in};
use super::format::Format;
use super::load_options::{FILE_NAMES, LoadOptions};
use crate::error::Result;
use std::path::{Path, PathBuf};

/// The groom, the animation and every file that they name, in the order of the names: role and path. Roles
/// are `groom`, `anim`, `buffer`, `track`, `collider`, and `deformation` for each frame of a deforming
/// collider.
///
/// # Errors
/// As [`super::load`].
pub fn inputs(groom: &Path, anim: &Path, options: &LoadOptions) -> Result<Vec<(&'static str, PathBuf)>> {
    let mut files = Vec::new();
    for (format, role, path) in [(Format::Groom, "groom", groom), (Format::Anim, "anim", anim)] {
        let doc = options.open(format, path)?;
        files.push((role, path.to_path_buf()));
        for (role, (list, pointer)) in ["buffer", "track", "collider"].into_iter().zip(FILE_NAMES) {
            files.extend(doc.strings(list, pointer).map(|name| (role, doc.folder().join(name))));
        }
        let folder = doc.folder();
        let Some(frames) = doc.integer_pair("frames") else { continue };
        let preroll = doc.number("/settings/preroll_s").unwrap_or(Settings::default().preroll);
        let lead = lead_in(doc.number("/fps").unwrap_or_default(), preroll);
        for sequence in doc.strings("colliders", "/shape/sequence").filter_map(FileSequence::new) {
            let (first, last) = sequence.available_frames(&folder, frames, lead);
            files.extend((first..=last).map(|frame| ("deformation", sequence.path(&folder, frame))));
        }
    }
    Ok(files)
}
