//! The files that a scene consists of.

use super::anim::Settings;
use super::file_sequence::{FileSequence, lead_in};
use super::format::Format;
use super::load_options::{FILE_NAMES, FileName, LoadOptions, SEQUENCE_NAMES};
use crate::error::Result;
use std::path::{Path, PathBuf};

/// Role and path of the groom, the animation and every file that they name; the manifest of a cache records
/// them with their checksums. The groom and its files come first; the files of one role are in the order of
/// the document.
///
/// Roles are `groom`, `anim`, `buffer`, `track`, `collider`, `deformation` for each frame of a deforming
/// collider, and `goal` for each frame of the curves of a goal.
///
/// # Errors
/// As [`super::load`] for the two documents; no other file is opened.
pub fn input_files(groom: &Path, anim: &Path, options: &LoadOptions) -> Result<Vec<(&'static str, PathBuf)>> {
    let mut files = Vec::new();
    for (format, role, path) in [(Format::Groom, "groom", groom), (Format::Anim, "anim", anim)] {
        let doc = options.open(format, path)?;
        let folder = doc.folder();
        files.push((role, path.to_path_buf()));
        for FileName { role, list, pointer } in FILE_NAMES {
            files.extend(doc.strings(list, pointer).map(|name| (role, folder.join(name))));
        }
        // Only animations have frames, and sequences of files.
        let Some(frames) = doc.integer_pair("frames") else { continue };
        let preroll = doc.number("/settings/preroll_s").unwrap_or(Settings::default().preroll);
        let lead = lead_in(doc.number("/fps").unwrap_or_default(), preroll);
        for FileName { role, list, pointer } in SEQUENCE_NAMES {
            for sequence in doc.strings(list, pointer).filter_map(FileSequence::new) {
                let (first, last) = sequence.available_frames(&folder, frames, lead);
                files.extend((first..=last).map(|frame| (role, sequence.path(&folder, frame))));
            }
        }
    }
    Ok(files)
}
