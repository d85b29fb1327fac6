//! The bake: guides simulated, strands interpolated, the cache written, in stages that may run in one process or in many.
//!
//! [`simulate`] goes from frame to frame and writes the guides' state at each; [`interpolate`] makes a frame's file of the states
//! around it; [`assemble`] ends the cache. [`bake()`] does all of it. Whichever way, the cache has the same bytes: every stage begins by
//! looking what is done, and a frame depends on nothing but the [`Job`].

pub mod air;
pub mod base;
mod clearance;
pub mod company;
pub mod control;
pub mod guide;
pub mod job;
pub mod output;
pub mod record;
pub mod rods;
mod rubbing;
pub mod sag;
mod scheme;
pub mod sealed;
pub mod simulation;
pub mod state;
mod stepper;
mod tangle;
pub mod tie;
mod together;
mod touch;
pub mod wisps;
pub mod work;

use crate::cache::{self, InputRecord, Manifest, Writer};
use crate::file::FileRecord;
use crate::scene::Reading;
use crate::strands::RETRACTION_SPAN;
use crate::{Error, Result};
use control::Control;
use job::Job;
use output::{Output, Seen};
use rayon::prelude::*;
use record::FrameRecord;
use serde::Serialize;
use serde_json::{Map, Value, json};
use state::FrameState;
use std::collections::{BTreeMap, BTreeSet, VecDeque};
use std::path::{Path, PathBuf};
use std::time::Instant;
use stepper::{Stepper, stopped};

/// Wall-clock time of the stages of one frame, s. Kept out of the cache: it changes from run to run.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize)]
pub struct StageSeconds {
    /// Sub-steps of the guides.
    pub simulate: f64,
    /// Render strands from guides.
    pub interpolate: f64,
    /// Encoding and writing the frame file.
    pub write: f64,
}

/// What a stage did, frame by frame.
#[derive(Debug, Clone, Default)]
pub struct BakeSummary {
    /// Figures of each frame.
    pub frames: Vec<FrameRecord>,
    /// Time that each frame took; `None` for what was done already.
    pub seconds: Vec<Option<StageSeconds>>,
    /// Time of the pre-roll, s; `None` where this process had no part in it.
    pub preroll_seconds: Option<f64>,
    /// The manifest, once it is written.
    pub manifest: Option<Manifest>,
}

impl BakeSummary {
    /// Enters a frame. The steps of the first of all are the pre-roll's.
    fn note(&mut self, job: &Job, record: &FrameRecord, mut seconds: Option<StageSeconds>) {
        if let Some(seconds) = seconds.as_mut().filter(|_| record.frame == *job.frames().start()) {
            self.preroll_seconds = Some(std::mem::take(&mut seconds.simulate)).filter(|s| *s > 0.0);
        }
        self.frames.push(record.clone());
        self.seconds.push(seconds);
    }

    /// How many frames this process has done something for.
    pub fn fresh(&self) -> usize {
        self.seconds.iter().flatten().count()
    }
}

/// Name and checksum of every file that a bake of the scene reads. Errors: files that cannot be read.
pub fn inputs(groom: &Path, anim: &Path, reading: &Reading) -> Result<Vec<InputRecord>> {
    let record = |(role, path): (&str, PathBuf)| {
        let bytes = crate::file::read_file(&path).map_err(|e| Error::io(&path, e))?;
        let file = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
        Ok(InputRecord { role: role.into(), file, sha256: cache::sha256(&bytes) })
    };
    crate::scene::inputs(groom, anim, reading)?.into_iter().map(record).collect()
}

/// Does all that is left of a bake, frame by frame; `progress` is told each frame that is on disk, and how many of how many
/// that makes.
///
/// # Errors
/// [`Error::Stopped`] where `control` asked for it; [`Error::Io`] where a file cannot be written.
pub fn bake(
    job: &Job,
    control: &Control,
    mut progress: impl FnMut(&FrameRecord, usize, usize),
) -> Result<BakeSummary> {
    let frames: Vec<i32> = job.frames().collect();
    let done: Vec<Option<FileRecord>> = frames.par_iter().map(|frame| job.work.done(*frame).ok()).collect();
    let mut stepper = Stepper::new(job, control, job.simulated());
    let mut strands = Strands::new(job, &frames)?;
    let mut summary = BakeSummary::default();
    let mut finished = Vec::new();
    // The strands of a frame depend on the guides of those around it, so the simulation is ahead.
    let mut ahead = job.simulated().peekable();
    let mut simulated = VecDeque::new();
    for (i, (&frame, done)) in frames.iter().zip(done).enumerate() {
        while let Some(next) = ahead.next_if(|next| *next <= frame + RETRACTION_SPAN as i32) {
            stepper.attend()?;
            let (state, seconds) = stepper.state(next)?;
            simulated.push_back(seconds);
            strands.hold(state);
        }
        let simulate = simulated.pop_front().flatten();
        let mut seconds = simulate.map(|simulate| StageSeconds { simulate, ..StageSeconds::default() });
        let file = match done {
            Some(file) => file,
            None => strands.write(frame, seconds.get_or_insert_default())?,
        };
        let state = strands.state(frame)?;
        summary.note(job, &state.record, seconds);
        progress(&state.record, i + 1, frames.len());
        finished.push(Finished::new(state, file));
    }
    stepper.finish()?;
    summary.manifest = Some(finish(job, strands.writer, finished)?);
    Ok(summary)
}

/// Simulates the frames from `first` to `last` and keeps the guides' state at each. Where `first` is not the first of all, the stage that
/// ends before it must be done.
///
/// # Errors
/// As [`bake()`], and [`Error::NotYet`] where the frame before is not simulated.
pub fn simulate(
    job: &Job,
    [first, last]: [i32; 2],
    control: &Control,
    mut progress: impl FnMut(&FrameRecord, usize, usize),
) -> Result<BakeSummary> {
    if first > *job.frames().start() && job.work.state(first - 1).is_err() {
        return Err(Error::NotYet(format!(
            "frame {} is not simulated yet, from where this goes on",
            first - 1
        )));
    }
    let mut stepper = Stepper::new(job, control, first..=last);
    let mut summary = BakeSummary::default();
    let total = (last - first + 1) as usize;
    for (i, frame) in (first..=last).enumerate() {
        stepper.attend()?;
        // The last frame is only done if another stage can go on from there.
        let whole = frame < last || job.work.has_checkpoint(job.steps_to(last));
        let (state, seconds) = if whole {
            stepper.state(frame)?
        } else {
            let (state, seconds) = stepper.simulate(frame)?;
            (state, Some(seconds))
        };
        summary.note(
            job,
            &state.record,
            seconds.map(|simulate| StageSeconds { simulate, ..StageSeconds::default() }),
        );
        progress(&state.record, i + 1, total);
    }
    stepper.finish()?;
    Ok(summary)
}

/// Makes the files of `frames`, in any order, as far as they are not done, of the guides' states.
///
/// # Errors
/// As [`bake()`], and [`Error::NotYet`] where a frame is not simulated.
pub fn interpolate(
    job: &Job,
    frames: &[i32],
    control: &Control,
    mut progress: impl FnMut(&FrameRecord, usize, usize),
) -> Result<BakeSummary> {
    let mut strands = Strands::new(job, frames)?;
    let mut summary = BakeSummary::default();
    for (i, &frame) in frames.iter().enumerate() {
        if control.stops() {
            return Err(stopped(&format!("before frame {frame}")));
        }
        let mut seconds = None;
        if job.work.done(frame).is_err() {
            strands.write(frame, seconds.get_or_insert_default())?;
        }
        let state = strands.state(frame)?;
        summary.note(job, &state.record, seconds);
        progress(&state.record, i + 1, frames.len());
    }
    job.work.settle_marks(frames)?;
    Ok(summary)
}

/// Ends a cache all of whose frames are done: root layer, manifest, checksums.
///
/// # Errors
/// [`Error::NotYet`] where frames are missing or damaged; it names them. [`Error::Io`].
pub fn assemble(job: &Job) -> Result<BakeSummary> {
    let frames: Vec<i32> = job.frames().collect();
    let found: Vec<_> = frames
        .par_iter()
        .map(|&frame| {
            let file = job.work.done(frame).map_err(|flaw| format!("the file of frame {frame}: {flaw}"))?;
            let state =
                job.work.state(frame).map_err(|flaw| format!("the guides at frame {frame}: {flaw}"))?;
            Ok(Finished::new(&state, file))
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
    let mut summary = BakeSummary::default();
    finished.iter().for_each(|f| summary.note(job, &f.record, None));
    Stepper::new(job, &Control::default(), job.simulated()).finish()?;
    summary.manifest = Some(finish(job, Strands::new(job, &frames)?.writer, finished)?);
    Ok(summary)
}

/// From the guides' states at frames to their files.
struct Strands<'a> {
    job: &'a Job,
    output: Output<'a>,
    writer: Writer,
    /// States that were needed last, and what is known of the strands at them, as far as that was asked for.
    held: BTreeMap<i32, (FrameState, Option<Seen>)>,
    /// Frames that this task makes.
    own: BTreeSet<i32>,
}

impl<'a> Strands<'a> {
    fn new(job: &'a Job, own: &[i32]) -> Result<Self> {
        let output = Output::new(&job.groom, &job.anim, &job.rods, job.base.as_ref());
        let writer = Writer::create(&job.out, output.header())?;
        Ok(Strands { job, output, writer, held: BTreeMap::new(), own: own.iter().copied().collect() })
    }

    /// Takes a state that is at hand, and lets those go that are far from it.
    fn hold(&mut self, state: FrameState) {
        let frame = state.record.frame;
        self.held.insert(frame, (state, None));
        self.held.retain(|other, _| other.abs_diff(frame) <= 2 * RETRACTION_SPAN as u32);
    }

    /// The state at a frame.
    fn state(&mut self, frame: i32) -> Result<&FrameState> {
        if !self.held.contains_key(&frame) {
            self.hold(self.job.work.state(frame).map_err(|flaw| {
                Error::NotYet(format!("the guides at frame {frame} are not simulated yet: {flaw}"))
            })?);
        }
        Ok(&self.held[&frame].0)
    }

    /// Looks at the strands at a frame that is held. How far they retreat is told to other tasks that need it too, and taken from where one
    /// has told it: the ends of chunks are worked out once.
    fn see(&mut self, frame: i32) -> Result<()> {
        let Some((state, seen @ None)) = self.held.get_mut(&frame) else { return Ok(()) };
        let (span, work) = (RETRACTION_SPAN as i32, &self.job.work);
        let shared =
            (frame - span..=frame + span).any(|f| self.job.frames().contains(&f) && !self.own.contains(&f));
        let own = self.own.contains(&frame);
        // Of its own frames it needs more than is told.
        let told = if shared && !own { work.retreats(frame, self.output.vertices()) } else { None };
        let tell = shared && told.is_none();
        let seen = seen.insert(match told {
            Some(retreats) => Seen { retreats, laid: None },
            None => self.output.seen(frame, &state.guides, own),
        });
        if tell {
            work.write_retreats(frame, &seen.retreats)?;
        }
        Ok(())
    }

    /// Writes a frame's file, then the mark that it is done.
    fn write(&mut self, frame: i32, seconds: &mut StageSeconds) -> Result<FileRecord> {
        let start = Instant::now();
        let first = *self.job.frames().start();
        // Before the first frame all is as it is there.
        let around: [i32; 2 * RETRACTION_SPAN + 1] =
            std::array::from_fn(|i| (frame + i as i32 - RETRACTION_SPAN as i32).max(first));
        for near in around {
            self.state(near)?;
            self.see(near)?;
        }
        let laid = self.held.get_mut(&frame).and_then(|(_, seen)| seen.as_mut()?.laid.take());
        let retreats = around.map(|near| self.held[&near].1.as_ref().map_or(&[][..], |seen| &seen.retreats));
        let states = [frame, frame + 1].map(|near| &self.held[&near].0.guides[..]);
        let arrays = self.output.frame(frame, states, &self.held[&(frame + 1)].0.steps, &retreats, laid)?;
        seconds.interpolate = start.elapsed().as_secs_f64();
        let start = Instant::now();
        let file = self.writer.write_frame(&arrays)?;
        self.job.work.set_done(frame, &file)?;
        seconds.write = start.elapsed().as_secs_f64();
        Ok(file)
    }
}

/// What the manifest needs of a frame.
#[derive(Clone)]
struct Finished {
    record: FrameRecord,
    machine: String,
    file: FileRecord,
}

impl Finished {
    fn new(state: &FrameState, file: FileRecord) -> Self {
        Finished { record: state.record.clone(), machine: state.machine.clone(), file }
    }
}

/// Ends the cache.
fn finish(job: &Job, writer: Writer, finished: Vec<Finished>) -> Result<Manifest> {
    let mut manifest = Manifest::new(writer.header());
    manifest.key = job.key.clone();
    manifest.machines =
        finished.iter().map(|f| f.machine.clone()).collect::<BTreeSet<_>>().into_iter().collect();
    manifest.inputs = job.inputs.clone();
    manifest.settings = job.settings.clone();
    manifest.totals = totals(&finished);
    // What is exempt in the end is so for good.
    let exempt = finished.last().map_or(0, |f| f.record.exempt_segments);
    let first = job.work.state(*job.frames().start()).map_err(|flaw| Error::NotYet(flaw.to_string()))?;
    let [mean, largest] = sag::departure(&job.rods, &first.guides);
    manifest.scene_figures = object(json!({
        "exempt_guide_segments": exempt,
        "groom_notes": job.groom.notes,
        "sag_free": job.rods.held,
        "first_frame_from_groom": { "mean": mean, "largest": largest },
    }));
    for Finished { record, file, .. } in finished {
        manifest.frames.push(cache::FrameRecord { frame: record.frame, file, figures: figures(&record) });
    }
    let manifest = writer.finish(manifest)?;
    job.work.settle_marks(&job.frames().collect::<Vec<_>>())?;
    job.work.tidy(job.frames())?;
    Ok(manifest)
}

/// Figures over all frames: the worst of each, and the sums of what should be rare.
fn totals(finished: &[Finished]) -> Map<String, Value> {
    let worst = |of: fn(&FrameRecord) -> f64| finished.iter().map(|f| of(&f.record)).fold(0.0, f64::max);
    let sum = |of: fn(&FrameRecord) -> u32| finished.iter().map(|f| u64::from(of(&f.record))).sum::<u64>();
    let totals = json!({
        "penetration_m": worst(|f| f.penetration_m),
        "length_drift": worst(|f| f.length_drift),
        "speed_max_m_s": worst(|f| f.speed_max_m_s),
        "contact_residual": worst(|f| f.contact_residual),
        "unconverged": sum(|f| f.unconverged.len() as u32),
        "shortened": sum(|f| f.shortened),
        "unsettled": sum(|f| f.unsettled),
        "strand_residual": worst(|f| f.strand_residual),
        "crossings": sum(|f| f.crossings),
        "strands_unsettled": sum(|f| f.strands_unsettled),
        "strands_shortened": sum(|f| f.strands_shortened),
        "tie_slack_m": worst(|f| f.tie_slack_m),
        "halvings": sum(|f| f.halvings),
    });
    object(totals)
}

fn figures(record: &FrameRecord) -> Map<String, Value> {
    let mut figures = object(json!(record));
    figures.remove("frame");
    figures
}

fn object(value: Value) -> Map<String, Value> {
    match value {
        Value::Object(map) => map,
        _ => Map::new(),
    }
}
