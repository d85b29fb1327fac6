//! Simulates from frame to frame, resuming from the newest checkpoint.

use super::checked_file::FileFault;
use super::control::Control;
use super::frame_record::FrameRecord;
use super::frame_state::FrameState;
use super::job::Job;
use super::work_dir::RunCheckpoint;
use crate::contact::friction::Interrupt;
use crate::dynamics::checkpoint::Checkpoint;
use crate::dynamics::simulation::Simulation;
use crate::rod::pack::Pack;
use crate::{Error, Result};
use std::ops::RangeInclusive;
use std::time::Instant;

/// Provides the states of a stage's frames in order: from the work folder, or by simulation.
pub struct FrameStepper<'a> {
    job: &'a Job,
    control: &'a Control,
    stage: RangeInclusive<i32>,
    /// `None` until a state is missing.
    run: Option<Run<'a>>,
}

impl<'a> FrameStepper<'a> {
    /// For a stage of the frames `stage`.
    pub fn new(job: &'a Job, control: &'a Control, stage: RangeInclusive<i32>) -> Self {
        FrameStepper { job, control, stage, run: None }
    }

    /// The state at `frame`, which must not precede that of the last call, and the time to simulate it, s, if
    /// it was missing.
    ///
    /// # Errors
    /// As [`FrameStepper::simulate`].
    pub fn state(&mut self, frame: i32) -> Result<(FrameState, Option<f64>)> {
        match self.job.work.state(frame) {
            Ok(state) => return Ok((state, None)),
            Err(FileFault::Damaged(what)) => {
                tracing::warn!("the state of frame {frame} is damaged ({what}): simulating it again");
            }
            Err(FileFault::Missing | FileFault::Stale) => {}
        }
        let (state, seconds) = self.simulate(frame)?;
        Ok((state, Some(seconds)))
    }

    /// Simulates to `frame`, from the current state or the newest checkpoint before it; returns the state and
    /// the time taken, s.
    ///
    /// # Errors
    /// [`Error::Stopped`] if asked to stop, after writing a checkpoint; [`Error::Io`].
    pub fn simulate(&mut self, frame: i32) -> Result<(FrameState, f64)> {
        let start = Instant::now();
        let run = match self.run.take().filter(|run| run.next <= frame) {
            Some(run) => run,
            None => Run::before(self.job, self.control, self.stage.clone(), frame)?,
        };
        let run = self.run.insert(run);
        loop {
            let state = run.step()?;
            if state.record.frame == frame {
                self.job.work.write_state(&state)?;
                run.unsynced.push(frame);
                return Ok((state, start.elapsed().as_secs_f64()));
            }
        }
    }

    /// Handles requests between two frames.
    ///
    /// # Errors
    /// As [`FrameStepper::simulate`].
    pub fn poll_control(&mut self) -> Result<()> {
        match &mut self.run {
            Some(run) => run.poll_control(),
            None if self.control.stops() => Err(stopped("between two frames")),
            None => Ok(()),
        }
    }

    /// Ends the stage: syncs its states to disk, and keeps only the checkpoints of its last two frames.
    ///
    /// # Errors
    /// [`Error::Io`].
    pub fn finish(mut self) -> Result<()> {
        self.run.as_mut().map_or(Ok(()), Run::sync)?;
        let (since, ends) = checkpoint_bounds(self.job, &self.stage);
        self.job.work.keep_checkpoints(since + 1..=ends[1], &ends)
    }
}

/// A running simulation.
struct Run<'a> {
    job: &'a Job,
    control: &'a Control,
    /// Abandons a sub-step in which a stop is requested.
    interrupt: Interrupt,
    stage: RangeInclusive<i32>,
    simulation: Simulation<'a>,
    /// The frame in progress.
    next: i32,
    /// Its record so far.
    record: FrameRecord,
    /// Sub-steps and time of the last checkpoint.
    saved: (i64, Instant),
    /// Frames whose states are not yet synced to disk.
    unsynced: Vec<i32>,
}

impl<'a> Run<'a> {
    /// Starts from the newest checkpoint before `frame`, else from the start of the pre-roll.
    fn before(job: &'a Job, control: &'a Control, stage: RangeInclusive<i32>, frame: i32) -> Result<Self> {
        let mut simulation = Simulation::new(&job.groom, &job.anim, &job.rods);
        let mut record = FrameRecord::default();
        let mut next = *job.frames().start();
        if let Some(checkpoint) = job.work.checkpoint(job.steps_to(frame))? {
            simulation
                .restore(checkpoint.simulation)
                .map_err(|e| Error::Internal(format!("a checkpoint belongs to another scene: {e}")))?;
            record = checkpoint.record;
            while job.steps_to(next) <= simulation.taken() {
                next += 1;
            }
        }
        let saved = (simulation.taken(), Instant::now());
        let interrupt = control.interrupt();
        Ok(Run { job, control, interrupt, stage, simulation, next, record, saved, unsynced: Vec::new() })
    }

    /// Simulates to the next frame and returns the state there.
    fn step(&mut self) -> Result<FrameState> {
        let frame = self.next;
        while self.simulation.taken() < self.job.steps_to(frame) {
            self.poll_control()?;
            // One that was abandoned left no trace, and the next poll stops the run.
            if let Ok(step) = self.simulation.step_unless(&self.interrupt) {
                self.record.add(step, &self.job.groom.guides.curves.id);
            }
        }
        let (mut record, steps) = (std::mem::take(&mut self.record), self.simulation.take_path());
        record.frame = frame;
        record.close(&self.simulation);
        if frame == *self.job.frames().start() {
            record.started_in.clone_from(&self.simulation.started_in);
        }
        self.next += 1;
        // The next segment resumes from the last frame; the frame before is a fallback. Both checkpoints are
        // synced before the state, so that a process that finds all states finds them too.
        let due = self.control.every_frames.is_some_and(|n| i64::from(frame) % i64::from(n) == 0);
        if due || frame >= self.stage.end() - 1 {
            self.save()?;
        }
        Ok(FrameState { record, machine: machine(), guides: self.simulation.frame(), steps })
    }

    fn poll_control(&mut self) -> Result<()> {
        let stops = self.control.stops();
        let old = self.control.every.is_some_and(|every| self.saved.1.elapsed() >= every);
        if self.control.saves() || stops || old {
            self.save()?;
        }
        if stops { Err(stopped(&format!("on the way to frame {}", self.next))) } else { Ok(()) }
    }

    /// Syncs the states: a process that resumes from a checkpoint does not check the states before it, so
    /// they must be as durable.
    fn sync(&mut self) -> Result<()> {
        self.job.work.sync_states(&std::mem::take(&mut self.unsynced))
    }

    fn save(&mut self) -> Result<()> {
        let taken = self.simulation.taken();
        if taken != self.saved.0 {
            self.sync()?;
            let checkpoint =
                RunCheckpoint { record: self.record.clone(), simulation: self.simulation.state() };
            let (since, ends) = checkpoint_bounds(self.job, &self.stage);
            self.job.work.write_checkpoint(taken, &checkpoint, since, &ends)?;
        }
        self.saved = (taken, Instant::now());
        Ok(())
    }
}

/// Sub-steps to the start of a stage, whose checkpoint belongs to the stage before; and to its last two
/// frames, whose checkpoints are kept.
fn checkpoint_bounds(job: &Job, stage: &RangeInclusive<i32>) -> (i64, [i64; 2]) {
    let (start, end) = (*stage.start(), *stage.end());
    (job.steps_before(start), [end - 1, end].map(|frame| job.steps_to(frame)))
}

/// The error of a stage that was asked to stop.
pub fn stopped(at: &str) -> Error {
    Error::Stopped(format!("stopped as requested, {at}; run the same command to resume"))
}

/// Instruction set of the simulation. It affects speed only, not bits, as far as tested.
fn machine() -> String {
    format!("{}, {} lanes", std::env::consts::ARCH, Pack::width())
}
