//! Writing a cache.

use super::layout::{self, CLIP_MANIFEST, MANIFEST, ROOT, TOPOLOGY, frame_file_name, frames_with_handles};
use super::{FileRecord, Frame, Header, Manifest};
use crate::file::{remove_file, write_file, write_file_if_new};
use crate::usd::{crate_file, text};
use crate::{Error, Result};
use std::path::{Path, PathBuf};

/// A cache being written. Every file of it appears whole or not at all.
#[derive(Debug)]
pub struct Writer {
    dir: PathBuf,
    header: Header,
    layers: Vec<FileRecord>,
}

impl Writer {
    /// Begins a cache in `dir`, made if it is not there, or goes on with it: writes topology and clip manifest unless they are there
    /// already. Collider names that are no identifiers, or double, are changed in the files: `left arm` becomes `left_arm`.
    ///
    /// # Errors
    /// [`Error::Io`] where the folder cannot be written; [`Error::Internal`] where the header's arrays do
    /// not fit together.
    pub fn create(dir: &Path, header: &Header) -> Result<Self> {
        header.check().map_err(Error::Internal)?;
        std::fs::create_dir_all(dir).map_err(|e| Error::io(dir, e))?;
        let mut writer = Writer { dir: dir.to_path_buf(), header: header.clone(), layers: Vec::new() };
        let topology = layout::topology_layer(header);
        let clip_manifest = text::encode(&layout::clip_manifest_layer(header));
        writer.layers = vec![
            write_file_if_new(&dir.join(TOPOLOGY), &crate_file::encode(&topology))?,
            write_file_if_new(&dir.join(CLIP_MANIFEST), &[clip_manifest])?,
        ];
        Ok(writer)
    }

    /// The cache's header.
    pub fn header(&self) -> &Header {
        &self.header
    }

    /// Writes one frame, handle frames (one before the first, one after the last) included, at one moment or more, the first at the
    /// frame itself. Frames may come in any order and from several threads.
    ///
    /// # Errors
    /// [`Error::Io`] where the file cannot be written; [`Error::Internal`] where the frame does not fit to
    /// the header.
    pub fn write_frame(&self, moments: &[Frame]) -> Result<FileRecord> {
        let frame = Frame::check_all(moments, &self.header).map_err(Error::Internal)?;
        if !frames_with_handles(&self.header).contains(&frame) {
            return Err(Error::Internal(format!("frame {frame} is outside of the cache")));
        }
        let layer = layout::frame_layer(&self.header, moments);
        write_file(&self.dir.join(frame_file_name(frame)), &crate_file::encode(&layer))
    }

    /// Writes the root layer and, last of all, `manifest.json`, as far as they are not there already; fills in [`Manifest::layers`]
    /// and puts the frames in order. Frames outside of the range, an earlier bake's, are removed.
    ///
    /// # Errors
    /// [`Error::Io`] where a file cannot be written; [`Error::Internal`] where a frame of the range is not in
    /// the manifest or is there twice.
    pub fn finish(self, mut manifest: Manifest) -> Result<Manifest> {
        let range = frames_with_handles(&self.header);
        manifest.frames.sort_by_key(|record| record.frame);
        if !manifest.frames.iter().map(|record| record.frame).eq(range.clone()) {
            return Err(Error::Internal("the manifest does not list every frame once".into()));
        }
        for frame in super::reader::frames_on_disk(&self.dir)? {
            if !range.contains(&frame) {
                remove_file(&self.dir.join(frame_file_name(frame)))?;
            }
        }
        let root = text::encode(&layout::root_layer(&self.header, &manifest));
        let root = write_file_if_new(&self.dir.join(ROOT), &[root])?;
        manifest.layers = [vec![root], self.layers].concat();
        write_file_if_new(&self.dir.join(MANIFEST), &[manifest.to_json()?])?;
        Ok(manifest)
    }
}

/// Makes the cache in `dir` visibly unfinished: without `manifest.json` and root layer.
///
/// # Errors
/// [`Error::Io`] where they stay.
pub fn unfinish(dir: &Path) -> Result<()> {
    remove_file(&dir.join(MANIFEST))?;
    remove_file(&dir.join(ROOT))
}
