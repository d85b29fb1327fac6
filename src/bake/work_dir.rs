//! The work folder of a bake, `.hairbake` in the cache's folder: what is done, and where to resume.
//!
//! | file | content |
//! |---|---|
//! | `job.json` | the bake's key and frames |
//! | `states/1001` | the guides at a frame, for interpolation (`FrameState`) |
//! | `frames/1001.json` | marks the frame's file as done, with its checksum |
//! | `checkpoints/8064` | the whole simulation after 8064 sub-steps ([`RunCheckpoint`]) |
//! | `deflections/1001` | deflections of the strands at a frame that two tasks need; removed by `assemble` |
//!
//! Every file contains the bake's key and is written atomically. Two processes that write the same file write
//! the same bytes, so no file needs a lock, and a stage may run twice at once.

use super::checked_file::{self, FileFault, Kind};
use super::frame_record::{FrameRecord, WrittenMeasures};
use super::frame_state::FrameState;
use crate::cache::{frame_file_name, over_frame_file_name};
use crate::dynamics::simulation::SimulationState;
use crate::file::{
    self, FileRecord, read_file, record_of, remove_file, write_file_if_changed, write_file_unrecorded,
};
use crate::strands::Deflection;
use crate::{Error, Result};
use serde::{Deserialize, Serialize};
use std::ops::RangeInclusive;
use std::path::{Path, PathBuf};
use std::str::FromStr;

/// Name of the work folder in the cache's folder.
pub const FOLDER: &str = ".hairbake";

/// Its subfolders.
const FOLDERS: [&str; 4] = ["states", "frames", "checkpoints", "deflections"];

/// Checkpoints kept while a simulation runs: the newest, and one to fall back on.
const KEPT: usize = 2;

const STATE: Kind = Kind { name: "state", version: 1, durable: false };
const DEFLECTIONS: Kind = Kind { name: "deflections", version: 1, durable: false };
const CHECKPOINT: Kind = Kind { name: "checkpoint", version: 1, durable: true };

/// The whole simulation between two sub-steps.
#[derive(Serialize, Deserialize)]
pub struct RunCheckpoint {
    /// Record so far of the frame in progress.
    pub record: FrameRecord,
    /// State of the simulation.
    pub simulation: SimulationState,
}

/// Identifies the bake of a work folder.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Description {
    /// Always `hairbake-work`.
    pub format: String,
    /// Version of this format.
    pub version: u32,
    /// Key of the bake.
    pub key: String,
    /// First and last frame, handles included.
    pub frames: (i32, i32),
}

/// Marks a frame as done.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
struct Mark {
    key: String,
    #[serde(flatten)]
    frame: WrittenFrame,
}

/// A frame that is written.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct WrittenFrame {
    /// Its file.
    #[serde(flatten)]
    pub file: FileRecord,
    /// Its file of overs, in over mode.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub over: Option<FileRecord>,
    /// What is measured of it.
    #[serde(flatten)]
    pub measures: WrittenMeasures,
}

impl WrittenFrame {
    /// Its files by their names.
    fn files(&self, frame: i32) -> impl Iterator<Item = (String, &FileRecord)> {
        let over = self.over.iter().map(move |over| (over_frame_file_name(frame), over));
        std::iter::once((frame_file_name(frame), &self.file)).chain(over)
    }
}

/// The work folder of one bake.
#[derive(Debug, Clone)]
pub struct WorkDir {
    out: PathBuf,
    key: String,
}

impl WorkDir {
    /// The work folder of the bake with this key in the cache folder `out`; it need not exist yet.
    pub fn new(out: &Path, key: &str) -> Self {
        WorkDir { out: out.into(), key: key.into() }
    }

    /// True once [`WorkDir::begin`] has been called for this bake, in any process, and not for another since.
    pub fn has_begun(&self) -> bool {
        Description::read(&self.out).is_ok_and(|description| description.key == self.key)
    }

    /// Opens the folder, or makes it. Removes the files of another bake, and marks its cache as unfinished.
    ///
    /// # Errors
    /// [`Error::Io`].
    pub fn begin(&self, frames: (i32, i32)) -> Result<()> {
        let WorkDir { out, key } = self;
        // The cache may come from an untrusted source: its work folder must not link elsewhere.
        for folder in [out.join(FOLDER)].into_iter().chain(FOLDERS.map(|name| self.folder(name))) {
            std::fs::create_dir_all(&folder).map_err(|e| Error::io(&folder, e))?;
            if folder.is_symlink() {
                return Err(Error::io(
                    &folder,
                    std::io::Error::other("is a link; work files must stay in the cache's folder"),
                ));
            }
        }
        let description =
            Description { format: "hairbake-work".into(), version: 1, key: key.clone(), frames };
        if Description::read(out).ok().as_ref() != Some(&description) {
            crate::cache::mark_unfinished(out)?;
            self.clear_other_bakes()?;
            let json = serde_json::to_vec_pretty(&description).map_err(|e| Error::Internal(e.to_string()))?;
            write_file_if_changed(&out.join(FOLDER).join("job.json"), &[json])?;
        }
        Ok(())
    }

    /// Opens an existing work folder without changing it.
    ///
    /// # Errors
    /// As [`Description::read`].
    pub fn open(out: &Path) -> Result<(Self, Description)> {
        let description = Description::read(out)?;
        Ok((WorkDir { out: out.into(), key: description.key.clone() }, description))
    }

    /// Removes the files of other bakes. Files of this bake may have just been written by another process.
    fn clear_other_bakes(&self) -> Result<()> {
        for (name, kind) in [("states", STATE), ("checkpoints", CHECKPOINT), ("deflections", DEFLECTIONS)] {
            for number in numbers::<i64>(&self.folder(name))? {
                let path = self.folder(name).join(number.to_string());
                if checked_file::read::<serde::de::IgnoredAny>(&path, kind, &self.key)
                    == Err(FileFault::Stale)
                {
                    remove_file(&path)?;
                }
            }
        }
        for frame in numbers(&self.folder("frames"))? {
            if self.mark(frame) == Err(FileFault::Stale) {
                remove_file(&self.mark_path(frame))?;
            }
        }
        Ok(())
    }

    /// The guides at a frame.
    ///
    /// # Errors
    /// [`FileFault`].
    pub fn state(&self, frame: i32) -> std::result::Result<FrameState, FileFault> {
        checked_file::read(&self.state_path(frame), STATE, &self.key)
    }

    /// Writes the guides at a frame.
    ///
    /// # Errors
    /// [`Error::Io`].
    pub fn write_state(&self, state: &FrameState) -> Result<()> {
        checked_file::write(&self.state_path(state.record.frame), STATE, &self.key, state)
    }

    /// The record of a frame that is marked as done; its file is not checked.
    ///
    /// # Errors
    /// [`FileFault`] of the mark.
    pub fn mark(&self, frame: i32) -> std::result::Result<WrittenFrame, FileFault> {
        let bytes = read_file(&self.mark_path(frame)).map_err(|_| FileFault::Missing)?;
        let mark: Mark = serde_json::from_slice(&bytes).map_err(|e| FileFault::Damaged(e.to_string()))?;
        if mark.key == self.key { Ok(mark.frame) } else { Err(FileFault::Stale) }
    }

    /// As [`WorkDir::mark`], and checks that the file exists with the recorded length.
    ///
    /// # Errors
    /// [`FileFault`] of the mark or of the file.
    pub fn marked(&self, frame: i32) -> std::result::Result<WrittenFrame, FileFault> {
        let mark = self.mark(frame)?;
        for (name, file) in mark.files(frame) {
            match std::fs::metadata(self.out.join(name)) {
                Ok(meta) if meta.len() == file.bytes => {}
                Ok(_) => return Err(FileFault::Damaged("the length differs".into())),
                Err(_) => return Err(FileFault::Missing),
            }
        }
        Ok(mark)
    }

    /// As [`WorkDir::mark`], and checks the file's checksum.
    ///
    /// # Errors
    /// [`FileFault`] of the mark or of the file.
    pub fn done(&self, frame: i32) -> std::result::Result<WrittenFrame, FileFault> {
        let mark = self.mark(frame)?;
        for (name, file) in mark.files(frame) {
            match record_of(&self.out.join(name)) {
                Ok(found) if found == *file => {}
                Ok(_) => return Err(FileFault::Damaged("the checksum differs".into())),
                Err(_) => return Err(FileFault::Missing),
            }
        }
        Ok(mark)
    }

    /// Marks a frame, whose file is synced to disk, as done.
    ///
    /// # Errors
    /// [`Error::Io`].
    pub fn mark_done(&self, frame: i32, written: &WrittenFrame) -> Result<()> {
        let mark = Mark { key: self.key.clone(), frame: written.clone() };
        let json = serde_json::to_vec(&mark).map_err(|e| Error::Internal(e.to_string()))?;
        write_file_unrecorded(&self.mark_path(frame), &[json], false)
    }

    /// Deflections of the strands at a frame, one per vertex, if another task has written them.
    pub fn deflections(&self, frame: i32, vertices: usize) -> Option<Vec<Deflection>> {
        let some: Vec<(u32, Deflection)> =
            checked_file::read(&self.deflections_path(frame), DEFLECTIONS, &self.key).ok()?;
        let mut deflections = vec![[0.0; 3]; vertices];
        for (vertex, by) in some {
            *deflections.get_mut(vertex as usize)? = by;
        }
        Some(deflections)
    }

    /// Writes the deflections of the strands at a frame for other tasks; only those that are not zero.
    ///
    /// # Errors
    /// [`Error::Io`].
    pub fn write_deflections(&self, frame: i32, deflections: &[Deflection]) -> Result<()> {
        let all = (0u32..).zip(deflections.iter().copied());
        let some: Vec<(u32, Deflection)> = all.filter(|(_, by)| *by != [0.0; 3]).collect();
        checked_file::write(&self.deflections_path(frame), DEFLECTIONS, &self.key, &some)
    }

    /// Syncs the states of frames to disk.
    ///
    /// # Errors
    /// [`Error::Io`].
    pub fn sync_states(&self, frames: &[i32]) -> Result<()> {
        let paths: Vec<PathBuf> = frames.iter().map(|frame| self.state_path(*frame)).collect();
        file::sync_files(&self.folder("states"), &paths)
    }

    /// Syncs the marks of frames to disk.
    ///
    /// # Errors
    /// [`Error::Io`].
    pub fn sync_marks(&self, frames: &[i32]) -> Result<()> {
        let paths: Vec<PathBuf> = frames.iter().map(|frame| self.mark_path(*frame)).collect();
        file::sync_files(&self.folder("frames"), &paths)
    }

    /// The newest valid checkpoint of fewer than `before` sub-steps; warns of each damaged one.
    ///
    /// # Errors
    /// [`Error::Io`] if the folder cannot be read.
    pub fn checkpoint(&self, before: i64) -> Result<Option<RunCheckpoint>> {
        let mut all: Vec<i64> = numbers(&self.folder("checkpoints"))?;
        all.retain(|taken| *taken < before);
        for taken in all.into_iter().rev() {
            let path = self.checkpoint_path(taken);
            match checked_file::read(&path, CHECKPOINT, &self.key) {
                Ok(checkpoint) => return Ok(Some(checkpoint)),
                // Another process has just replaced it by newer ones, or it belongs to another bake.
                Err(FileFault::Missing | FileFault::Stale) => {}
                Err(fault) => {
                    tracing::warn!("{}: {fault}; falling back to the checkpoint before it", path.display())
                }
            }
        }
        Ok(None)
    }

    /// Whether there is a valid checkpoint after `taken` sub-steps.
    pub fn has_checkpoint(&self, taken: i64) -> bool {
        checked_file::read::<RunCheckpoint>(&self.checkpoint_path(taken), CHECKPOINT, &self.key).is_ok()
    }

    /// Writes a checkpoint; removes all but the newest two after `since` sub-steps, except those listed in
    /// `kept`.
    ///
    /// # Errors
    /// [`Error::Io`].
    pub fn write_checkpoint(
        &self,
        taken: i64,
        checkpoint: &RunCheckpoint,
        since: i64,
        kept: &[i64],
    ) -> Result<()> {
        checked_file::write(&self.checkpoint_path(taken), CHECKPOINT, &self.key, checkpoint)?;
        let mut all: Vec<i64> = numbers(&self.folder("checkpoints"))?;
        all.retain(|other| (since + 1..=taken).contains(other) && !kept.contains(other));
        all.iter().rev().skip(KEPT).try_for_each(|old| remove_file(&self.checkpoint_path(*old)))
    }

    /// Removes the checkpoints of a range of sub-steps, except those listed in `kept`.
    ///
    /// # Errors
    /// [`Error::Io`].
    pub fn keep_checkpoints(&self, range: RangeInclusive<i64>, kept: &[i64]) -> Result<()> {
        let all: Vec<i64> = numbers(&self.folder("checkpoints"))?;
        let old = all.iter().filter(|taken| range.contains(taken) && !kept.contains(taken));
        old.into_iter().try_for_each(|taken| remove_file(&self.checkpoint_path(*taken)))
    }

    /// Removes files left by killed processes, files shared between tasks, and marks of frames outside
    /// `frames`.
    ///
    /// # Errors
    /// [`Error::Io`].
    pub fn tidy(&self, frames: RangeInclusive<i32>) -> Result<()> {
        for folder in
            [self.out.clone(), self.out.join(FOLDER)].into_iter().chain(FOLDERS.map(|name| self.folder(name)))
        {
            file::remove_stale_temporaries(&folder)?;
        }
        let shared: Vec<i32> = numbers(&self.folder("deflections"))?;
        shared.into_iter().try_for_each(|frame| remove_file(&self.deflections_path(frame)))?;
        let marks: Vec<i32> = numbers(&self.folder("frames"))?;
        let outside = marks.into_iter().filter(|frame| !frames.contains(frame));
        outside.into_iter().try_for_each(|frame| remove_file(&self.mark_path(frame)))
    }

    fn folder(&self, name: &str) -> PathBuf {
        self.out.join(FOLDER).join(name)
    }

    fn state_path(&self, frame: i32) -> PathBuf {
        self.folder("states").join(frame.to_string())
    }

    fn deflections_path(&self, frame: i32) -> PathBuf {
        self.folder("deflections").join(frame.to_string())
    }

    fn mark_path(&self, frame: i32) -> PathBuf {
        self.folder("frames").join(format!("{frame}.json"))
    }

    fn checkpoint_path(&self, taken: i64) -> PathBuf {
        self.folder("checkpoints").join(taken.to_string())
    }
}

impl Description {
    /// Reads the description of the work folder in `out`.
    ///
    /// # Errors
    /// [`Error::Io`] if there is none; [`Error::Damaged`] if it cannot be parsed.
    pub fn read(out: &Path) -> Result<Self> {
        let path = out.join(FOLDER).join("job.json");
        let bytes = read_file(&path).map_err(|e| Error::io(&path, e))?;
        serde_json::from_slice(&bytes).map_err(|e| Error::Damaged { path, what: e.to_string() })
    }
}

/// The numbers that name the files of a folder, ascending.
fn numbers<N: FromStr + Ord>(folder: &Path) -> Result<Vec<N>> {
    let mut numbers = Vec::new();
    for entry in std::fs::read_dir(folder).map_err(|e| Error::io(folder, e))? {
        let path = entry.map_err(|e| Error::io(folder, e))?.path();
        let stem = path.file_stem().and_then(|stem| stem.to_str());
        numbers.extend(stem.and_then(|stem| stem.parse().ok()));
    }
    numbers.sort_unstable();
    Ok(numbers)
}
