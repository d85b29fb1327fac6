//! The stages of a bake, as the command line runs them: [`simulate`], [`interpolate`] and [`assemble`] each
//! in a process of its own on a farm, or all of them in one by [`bake()`].

use super::control::Control;
use super::frame_record::FrameRecord;
use super::frame_stepper::{FrameStepper, stopped};
use super::frame_writer::{FrameWriter, RUN_AHEAD};
use super::job::Job;
use super::manifest::{Finished, finish};
use super::summary::{BakeSummary, StageSeconds};
use super::work_dir::WrittenFrame;
use crate::cache::{self, InputRecord};
use crate::scene::LoadOptions;
use crate::{Error, Result};
use rayon::prelude::*;
use std::collections::VecDeque;
use std::path::{Path, PathBuf};

/// Role, name and checksum of every file of the scene, for the manifest and the key of the bake.
///
/// # Errors
/// [`Error::Io`] for files that cannot be read.
pub fn input_records(groom: &Path, anim: &Path, options: &LoadOptions) -> Result<Vec<InputRecord>> {
    let record = |(role, path): (&str, PathBuf)| {
        let bytes = crate::file::read_file(&path).map_err(|e| Error::io(&path, e))?;
        let file = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
        Ok(InputRecord { role: role.into(), file, sha256: cache::sha256(&bytes) })
    };
    crate::scene::input_files(groom, anim, options)?.into_iter().map(record).collect()
}

/// Runs all stages in this process, frame by frame, and skips what an earlier run finished. `progress` is
/// called for each finished frame with its record, the number of finished frames and their total.
///
/// # Errors
/// [`Error::Stopped`] if `control` asked for it; [`Error::Io`] if a file cannot be written.
pub fn bake(
    job: &Job,
    control: &Control,
    mut progress: impl FnMut(&FrameRecord, usize, usize),
) -> Result<BakeSummary> {
    let frames: Vec<i32> = job.frames().collect();
    let done: Vec<Option<WrittenFrame>> = frames.par_iter().map(|frame| job.work.done(*frame).ok()).collect();
    let mut stepper = FrameStepper::new(job, control, job.simulated());
    let mut writer = FrameWriter::new(job, &frames)?;
    let mut summary = BakeSummary { scene: job.warnings(), ..BakeSummary::default() };
    let mut finished = Vec::new();
    // The strands of a frame depend on the guides of the frames around it, so the simulation runs ahead.
    let mut ahead = job.simulated().peekable();
    // Time to simulate each frame that is ahead; `None` if its state was in the work folder.
    let mut simulation_seconds = VecDeque::new();
    for (i, (&frame, done)) in frames.iter().zip(done).enumerate() {
        while let Some(next) = ahead.next_if(|next| *next <= frame + RUN_AHEAD as i32) {
            stepper.poll_control()?;
            let (state, seconds) = stepper.state(next)?;
            simulation_seconds.push_back(seconds);
            writer.insert(state);
        }
        let mut seconds = simulation_seconds.pop_front().flatten().map(StageSeconds::simulation);
        let written = match done {
            Some(written) => written,
            None => writer.write(frame, seconds.get_or_insert_default())?,
        };
        let frame = Finished::new(writer.state(frame)?, written);
        summary.add(job, &frame.record, seconds);
        progress(&frame.record, i + 1, frames.len());
        finished.push(frame);
    }
    stepper.finish()?;
    summary.manifest = Some(finish(job, writer.into_writer(), finished)?);
    Ok(summary)
}

/// Simulates the segment of the frames `first` to `last` and writes the guides' state at each to the work
/// folder. Unless `first` is the first frame of the cache, the segment that ends before it must be done.
///
/// # Errors
/// As [`bake()`], and [`Error::NotYet`] if the frame before is not simulated.
pub fn simulate(
    job: &Job,
    [first, last]: [i32; 2],
    control: &Control,
    mut progress: impl FnMut(&FrameRecord, usize, usize),
) -> Result<BakeSummary> {
    if first > *job.frames().start() && job.work.state(first - 1).is_err() {
        return Err(Error::NotYet(format!(
            "frame {} is not simulated yet; this segment starts from it",
            first - 1
        )));
    }
    let mut stepper = FrameStepper::new(job, control, first..=last);
    let mut summary = BakeSummary::default();
    let total = (last - first + 1) as usize;
    for (i, frame) in (first..=last).enumerate() {
        stepper.poll_control()?;
        // The last frame is done only if the next segment can start from it.
        let resumable = frame < last || job.work.has_checkpoint(job.steps_to(last));
        let (state, seconds) = if resumable {
            stepper.state(frame)?
        } else {
            let (state, seconds) = stepper.simulate(frame)?;
            (state, Some(seconds))
        };
        summary.add(job, &state.record, seconds.map(StageSeconds::simulation));
        progress(&state.record, i + 1, total);
    }
    stepper.finish()?;
    Ok(summary)
}

/// Interpolates the render strands of those `frames` that are not done, from the guides' states, and writes
/// the frame files. Frames may come in any order.
///
/// # Errors
/// As [`bake()`], and [`Error::NotYet`] if a frame is not simulated.
pub fn interpolate(
    job: &Job,
    frames: &[i32],
    control: &Control,
    mut progress: impl FnMut(&FrameRecord, usize, usize),
) -> Result<BakeSummary> {
    let mut writer = FrameWriter::new(job, frames)?;
    let mut summary = BakeSummary::default();
    for (i, &frame) in frames.iter().enumerate() {
        if control.stops() {
            return Err(stopped(&format!("before frame {frame}")));
        }
        let mut seconds = None;
        let written = match job.work.done(frame) {
            Ok(written) => written,
            Err(_) => writer.write(frame, seconds.get_or_insert_default())?,
        };
        let record = writer.state(frame)?.record.with_written(written.measures);
        summary.add(job, &record, seconds);
        progress(&record, i + 1, frames.len());
    }
    job.work.sync_marks(frames)?;
    Ok(summary)
}

/// Completes a cache of which all frames are done: root layer, manifest, checksums.
///
/// # Errors
/// [`Error::NotYet`] if frames are missing or damaged, naming the first; [`Error::Io`].
pub fn assemble(job: &Job) -> Result<BakeSummary> {
    let frames: Vec<i32> = job.frames().collect();
    let found: Vec<_> = frames
        .par_iter()
        .map(|&frame| {
            let written =
                job.work.done(frame).map_err(|fault| format!("the file of frame {frame}: {fault}"))?;
            let state =
                job.work.state(frame).map_err(|fault| format!("the guides at frame {frame}: {fault}"))?;
            Ok(Finished::new(&state, written))
        })
        .collect();
    let missing: Vec<String> =
        found.iter().filter_map(|f: &std::result::Result<_, String>| f.clone().err()).collect();
    if let Some(first) = missing.first() {
        return Err(Error::NotYet(format!(
            "{} of {} frames are not done; {first}",
            missing.len(),
            frames.len()
        )));
    }
    let finished: Vec<Finished> = found.into_iter().flatten().collect();
    let mut summary = BakeSummary { scene: job.warnings(), ..BakeSummary::default() };
    finished.iter().for_each(|f| summary.add(job, &f.record, None));
    FrameStepper::new(job, &Control::default(), job.simulated()).finish()?;
    summary.manifest = Some(finish(job, FrameWriter::new(job, &frames)?.into_writer(), finished)?);
    Ok(summary)
}
