//! Writing a cache.

use super::layout::{self, CLIP_MANIFEST, MANIFEST, ROOT, TOPOLOGY, frame_file_name, frames_with_handles};
use super::{FileRecord, Frame, Header, Manifest};
use crate::file::write_file;
use crate::usd::{Layer, crate_file, text};
use crate::{Error, Result};
use std::io::ErrorKind;
use std::path::{Path, PathBuf};

/// A cache being written. Every file of it appears whole or not at all.
#[derive(Debug)]
pub struct Writer {
    dir: PathBuf,
    header: Header,
    layers: Vec<FileRecord>,
}

impl Writer {
    /// Begins a cache in `dir`, made if it is not there, and writes topology and clip manifest.
    ///
    /// An earlier bake's `manifest.json` and root layer are removed, so that the cache is visibly
    /// unfinished until [`Self::finish`], and with them its frames outside of the new range; frames
    /// inside the range stay until they are replaced. Collider names that are no identifiers, or
    /// double, are changed in the files: `left arm` becomes `left_arm`.
    ///
    /// # Errors
    /// [`Error::Io`] where the folder cannot be written; [`Error::Internal`] where the header's arrays do
    /// not fit together.
    pub fn create(dir: &Path, header: &Header) -> Result<Self> {
        header.check().map_err(Error::Internal)?;
        std::fs::create_dir_all(dir).map_err(|e| Error::io(dir, e))?;
        remove(&dir.join(MANIFEST))?;
        remove(&dir.join(ROOT))?;
        let frames = frames_with_handles(header);
        for frame in super::reader::frames_on_disk(dir)? {
            if !frames.contains(&frame) {
                remove(&dir.join(frame_file_name(frame)))?;
            }
        }
        let mut writer = Writer { dir: dir.to_path_buf(), header: header.clone(), layers: Vec::new() };
        let topology = writer.write_crate(TOPOLOGY, &layout::topology_layer(header))?;
        let clip_manifest = writer.write_text(CLIP_MANIFEST, &layout::clip_manifest_layer(header))?;
        writer.layers = vec![topology, clip_manifest];
        Ok(writer)
    }

    /// Writes one frame, handle frames (one before the first, one after the last) included. Frames may
    /// come in any order and from several threads.
    ///
    /// # Errors
    /// [`Error::Io`] where the file cannot be written; [`Error::Internal`] where the frame does not fit to
    /// the header.
    pub fn write_frame(&self, frame: &Frame) -> Result<FileRecord> {
        frame.check(&self.header).map_err(Error::Internal)?;
        if !frames_with_handles(&self.header).contains(&frame.frame) {
            return Err(Error::Internal(format!("frame {} is outside of the cache", frame.frame)));
        }
        self.write_crate(&frame_file_name(frame.frame), &layout::frame_layer(&self.header, frame))
    }

    /// Writes the root layer and, last of all, `manifest.json`; fills in [`Manifest::layers`] and puts the
    /// frames in order.
    ///
    /// # Errors
    /// [`Error::Io`] where a file cannot be written; [`Error::Internal`] where a frame of the range is not in
    /// the manifest or is there twice.
    pub fn finish(self, mut manifest: Manifest) -> Result<Manifest> {
        manifest.frames.sort_by_key(|record| record.frame);
        if !manifest.frames.iter().map(|record| record.frame).eq(frames_with_handles(&self.header)) {
            return Err(Error::Internal("the manifest does not list every frame once".into()));
        }
        let root = self.write_text(ROOT, &layout::root_layer(&self.header))?;
        manifest.layers = [vec![root], self.layers].concat();
        let path = self.dir.join(MANIFEST);
        let mut json = serde_json::to_vec_pretty(&manifest).map_err(|e| Error::Internal(e.to_string()))?;
        json.push(b'\n');
        write_file(&path, &[json])?;
        Ok(manifest)
    }

    fn write_crate(&self, name: &str, layer: &Layer) -> Result<FileRecord> {
        write_file(&self.dir.join(name), &crate_file::encode(layer))
    }

    fn write_text(&self, name: &str, layer: &Layer) -> Result<FileRecord> {
        write_file(&self.dir.join(name), &[text::encode(layer)])
    }
}

/// Removes a file that may not be there.
fn remove(path: &Path) -> Result<()> {
    match std::fs::remove_file(path) {
        Err(e) if e.kind() != ErrorKind::NotFound => Err(Error::io(path, e)),
        _ => Ok(()),
    }
}
