//! Writing a cache.

use super::deform::DeformHeader;
use super::frame::Frame;
use super::header::Header;
use super::layers;
use super::manifest::Manifest;
use super::names::{
    CLIP_MANIFEST, DEFORM, MANIFEST, OVER, OVER_CLIP_MANIFEST, ROOT, SHOT, TOPOLOGY, frame_file_name,
    frames_on_disk, frames_with_handles, over_frame_file_name,
};
use super::over::{OverFrame, OverHeader};
use crate::file::{FileRecord, remove_file, write_file, write_file_if_changed};
use crate::usd::{crate_file, text};
use crate::{Error, Result};
use std::ops::RangeInclusive;
use std::path::{Path, PathBuf};

/// A cache being written. Each of its files is written atomically.
#[derive(Debug)]
pub struct Writer {
    dir: PathBuf,
    header: Header,
    layers: Vec<FileRecord>,
    over: Option<OverHeader>,
    deform: Option<DeformHeader>,
}

impl Writer {
    /// Begins or resumes a cache in `dir`, which is created if missing: writes topology and clip manifest if
    /// they changed. Collider names are made unique identifiers in the files: `left arm` becomes `left_arm`.
    ///
    /// # Errors
    /// [`Error::Io`] if the folder cannot be written; [`Error::Internal`] if the header is inconsistent.
    pub fn create(dir: &Path, header: &Header) -> Result<Self> {
        header.check().map_err(Error::Internal)?;
        std::fs::create_dir_all(dir).map_err(|e| Error::io(dir, e))?;
        let mut writer = Writer {
            dir: dir.to_path_buf(),
            header: header.clone(),
            layers: Vec::new(),
            over: None,
            deform: None,
        };
        let topology = layers::topology_layer(header);
        let clip_manifest = text::encode(&layers::clip_manifest_layer(header));
        writer.layers = vec![
            write_file_if_changed(&dir.join(TOPOLOGY), &crate_file::encode(&topology))?,
            write_file_if_changed(&dir.join(CLIP_MANIFEST), &[clip_manifest])?,
        ];
        Ok(writer)
    }

    /// Writes the layers of over mode as well.
    ///
    /// # Errors
    /// [`Error::Io`].
    pub fn with_over(mut self, over: OverHeader) -> Result<Self> {
        let clip_manifest = text::encode(&over.clip_manifest_layer());
        self.layers.push(write_file_if_changed(&self.dir.join(OVER_CLIP_MANIFEST), &[clip_manifest])?);
        self.over = Some(over);
        Ok(self)
    }

    /// Writes the layer by which Houdini deforms curves as well.
    pub fn with_deform(mut self, deform: DeformHeader) -> Self {
        self.deform = Some(deform);
        self
    }

    /// The constant part.
    pub fn header(&self) -> &Header {
        &self.header
    }

    /// Writes one frame of the shot or a handle frame with one or more time samples, the first of which is at
    /// the frame itself. Frames may be written in any order and from several threads.
    ///
    /// # Errors
    /// [`Error::Io`] if the file cannot be written; [`Error::Internal`] if the frame contradicts the header.
    pub fn write_frame(&self, samples: &[Frame]) -> Result<FileRecord> {
        let frame = Frame::check_samples(samples, &self.header).map_err(Error::Internal)?;
        if !frames_with_handles(&self.header).contains(&frame) {
            return Err(Error::Internal(format!("frame {frame} is outside the range of the cache")));
        }
        let layer = layers::frame_layer(&self.header, samples);
        write_file(&self.dir.join(frame_file_name(frame)), &crate_file::encode(&layer))
    }

    /// Writes the overs of one frame with its moments.
    ///
    /// # Errors
    /// [`Error::Io`]; [`Error::Internal`] without moments, or without over mode.
    pub fn write_over_frame(&self, moments: &[OverFrame]) -> Result<FileRecord> {
        let (Some(over), Some(first)) = (&self.over, moments.first()) else {
            return Err(Error::Internal("there are no overs to write".into()));
        };
        let path = self.dir.join(over_frame_file_name(first.frame));
        write_file(&path, &crate_file::encode(&over.frame_layer(moments)))
    }

    /// Writes the root layers and, last, `manifest.json`, if they changed. Sets [`Manifest::layers`] and
    /// sorts the frames. Removes frame files outside the range, which are from an earlier bake.
    ///
    /// # Errors
    /// [`Error::Io`] if a file cannot be written; [`Error::Internal`] if the manifest does not list every
    /// frame of the range once.
    pub fn finish(self, mut manifest: Manifest) -> Result<Manifest> {
        let range = frames_with_handles(&self.header);
        manifest.frames.sort_by_key(|record| record.frame);
        if !manifest.frames.iter().map(|record| record.frame).eq(range.clone()) {
            return Err(Error::Internal("the manifest does not list every frame once".into()));
        }
        let remove_outside = |name_of: fn(i32) -> String, range: &RangeInclusive<i32>| {
            let frames = frames_on_disk(&self.dir, name_of)?;
            let mut outside = frames.into_iter().filter(|frame| !range.contains(frame));
            outside.try_for_each(|frame| remove_file(&self.dir.join(name_of(frame))))
        };
        remove_outside(frame_file_name, &range)?;
        let root = text::encode(&layers::root_layer(&self.header, &manifest));
        let root = write_file_if_changed(&self.dir.join(ROOT), &[root])?;
        manifest.layers = [vec![root], self.layers].concat();
        match &self.over {
            Some(over) => {
                remove_outside(over_frame_file_name, &range)?;
                let overs = text::encode(&over.over_layer(range));
                manifest.layers.push(write_file_if_changed(&self.dir.join(OVER), &[overs])?);
                // It depends on where the stage lies, so the manifest does not list it.
                write_file_if_changed(&self.dir.join(SHOT), &[text::encode(&over.stage.layer(OVER))])?;
            }
            None => {
                #[expect(clippy::reversed_empty_ranges, reason = "no frame is kept")]
                remove_outside(over_frame_file_name, &(1..=0))?;
                remove_file(&self.dir.join(OVER_CLIP_MANIFEST))?;
            }
        }
        if let Some(deform) = &self.deform {
            let layer = text::encode(&deform.layer(&self.header));
            manifest.layers.push(write_file_if_changed(&self.dir.join(DEFORM), &[layer])?);
            write_file_if_changed(&self.dir.join(SHOT), &[text::encode(&deform.stage.layer(DEFORM))])?;
        }
        write_file_if_changed(&self.dir.join(MANIFEST), &[manifest.to_json()?])?;
        Ok(manifest)
    }
}

/// Marks the cache in `dir` as unfinished: removes `manifest.json` and the root layers.
///
/// # Errors
/// [`Error::Io`] if they cannot be removed.
pub fn mark_unfinished(dir: &Path) -> Result<()> {
    [MANIFEST, ROOT, OVER, DEFORM, SHOT].iter().try_for_each(|name| remove_file(&dir.join(name)))
}
