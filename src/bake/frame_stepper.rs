//! The simulation from frame to frame: as far as it is not done yet, from the newest checkpoint on.

use super::checked_file::FileFault;
use super::control::Control;
use super::frame_record::FrameRecord;
use super::frame_state::FrameState;
use super::job::Job;
use super::output::head_motion;
use super::work_dir::RunCheckpoint;
use crate::dynamics::checkpoint::Checkpoint;
use crate::dynamics::simulation::Simulation;
use crate::rod::pack::Pack;
use crate::{Error, Result};
use std::ops::RangeInclusive;
use std::time::Instant;

/// The states of a stage's frames, one after the other: from the work folder, or simulated and put there.
pub struct FrameStepper<'a> {
    job: &'a Job,
    control: &'a Control,
    stage: RangeInclusive<i32>,
    /// Nothing until a state is missing.
    run: Option<Run<'a>>,
}

impl<'a> FrameStepper<'a> {
    /// For a stage of these frames.
    pub fn new(job: &'a Job, control: &'a Control, stage: RangeInclusive<i32>) -> Self {
        FrameStepper { job, control, stage, run: None }
    }

    /// The state at `frame`, not before that of the last call, and how long it took to simulate it, s, if it was not there.
    ///
    /// # Errors
    /// As [`FrameStepper::simulate`].
    pub fn state(&mut self, frame: i32) -> Result<(FrameState, Option<f64>)> {
        match self.job.work.state(frame) {
            Ok(state) => return Ok((state, None)),
            Err(FileFault::Damaged(what)) => {
                tracing::warn!("the state of frame {frame} is damaged: {what}; simulating it again");
            }
            Err(FileFault::Missing | FileFault::Stale) => {}
        }
        let (state, seconds) = self.simulate(frame)?;
        Ok((state, Some(seconds)))
    }

    /// Simulates to `frame`, from the newest checkpoint before it unless it is already on the way there; returns the state and how
    /// long that took, s.
    ///
    /// # Errors
    /// [`Error::Stopped`] where it was asked to stop, with all saved; [`Error::Io`].
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
                run.unsettled.push(frame);
                return Ok((state, start.elapsed().as_secs_f64()));
            }
        }
    }

    /// Between two frames, does what it has been asked for in the meantime.
    ///
    /// # Errors
    /// As [`FrameStepper::simulate`].
    pub fn attend(&mut self) -> Result<()> {
        match &mut self.run {
            Some(run) => run.attend(),
            None if self.control.stops() => Err(stopped("between two frames")),
            None => Ok(()),
        }
    }

    /// Ends the stage: its states are on the disk, and of its checkpoints those of its last two frames stay.
    ///
    /// # Errors
    /// [`Error::Io`].
    pub fn finish(mut self) -> Result<()> {
        self.run.as_mut().map_or(Ok(()), Run::settle)?;
        let (since, ends) = bounds(self.job, &self.stage);
        self.job.work.keep_checkpoints(since + 1..=ends[1], &ends)
    }
}

/// A simulation on its way.
struct Run<'a> {
    job: &'a Job,
    control: &'a Control,
    stage: RangeInclusive<i32>,
    simulation: Simulation<'a>,
    /// The frame that it is on the way to, and the figures so far of that.
    next: i32,
    record: FrameRecord,
    /// Sub-steps at the last checkpoint, and when that was.
    saved: (i64, Instant),
    /// Frames whose states are not yet known to be on the disk.
    unsettled: Vec<i32>,
}

impl<'a> Run<'a> {
    /// At the newest checkpoint on the way to `frame`, else at the start of the pre-roll.
    fn before(job: &'a Job, control: &'a Control, stage: RangeInclusive<i32>, frame: i32) -> Result<Self> {
        let mut simulation = Simulation::new(&job.groom, &job.anim, &job.rods);
        let mut record = FrameRecord::default();
        let mut next = *job.frames().start();
        if let Some(checkpoint) = job.work.checkpoint(job.steps_to(frame))? {
            simulation
                .restore(checkpoint.simulation)
                .map_err(|e| Error::Internal(format!("a checkpoint is of another scene: {e}")))?;
            record = checkpoint.record;
            while job.steps_to(next) <= simulation.taken() {
                next += 1;
            }
        }
        let saved = (simulation.taken(), Instant::now());
        Ok(Run { job, control, stage, simulation, next, record, saved, unsettled: Vec::new() })
    }

    /// Goes on to the next frame and returns the state there.
    fn step(&mut self) -> Result<FrameState> {
        let frame = self.next;
        while self.simulation.taken() < self.job.steps_to(frame) {
            self.attend()?;
            self.record.add(self.simulation.step(), &self.job.groom.guides.curves.id);
        }
        let (mut record, steps) = (std::mem::take(&mut self.record), self.simulation.take_path());
        record.frame = frame;
        record.close(&self.simulation, &head_motion(&self.job.anim, self.simulation.time()));
        self.next += 1;
        // From the last frame a later stage may go on; the one before it stands in should that be damaged. They are on the disk before
        // the state is, so that who finds all states finds these too.
        let due = self.control.every_frames.is_some_and(|n| i64::from(frame) % i64::from(n) == 0);
        if due || frame >= self.stage.end() - 1 {
            self.save()?;
        }
        Ok(FrameState { record, machine: machine(), guides: self.simulation.frame(), steps })
    }

    fn attend(&mut self) -> Result<()> {
        let stops = self.control.stops();
        let old = self.control.every.is_some_and(|every| self.saved.1.elapsed() >= every);
        if self.control.saves() || stops || old {
            self.save()?;
        }
        if stops { Err(stopped(&format!("on the way to frame {}", self.next))) } else { Ok(()) }
    }

    /// Who goes on from a checkpoint does not look behind it: the states before it have to outlive what it outlives.
    fn settle(&mut self) -> Result<()> {
        self.job.work.sync_states(&std::mem::take(&mut self.unsettled))
    }

    fn save(&mut self) -> Result<()> {
        let taken = self.simulation.taken();
        if taken != self.saved.0 {
            self.settle()?;
            let checkpoint =
                RunCheckpoint { record: self.record.clone(), simulation: self.simulation.state() };
            let (since, ends) = bounds(self.job, &self.stage);
            self.job.work.write_checkpoint(taken, &checkpoint, since, &ends)?;
        }
        self.saved = (taken, Instant::now());
        Ok(())
    }
}

/// Sub-steps to where a stage begins, which is another one's end and not this one's to remove; and to its last two frames, whose
/// checkpoints stay.
fn bounds(job: &Job, stage: &RangeInclusive<i32>) -> (i64, [i64; 2]) {
    let (start, end) = (*stage.start(), *stage.end());
    (job.steps_before(start), [end - 1, end].map(|frame| job.steps_to(frame)))
}

/// That a stage stopped because it was asked to, and where.
pub fn stopped(at: &str) -> Error {
    Error::Stopped(format!("stopped as asked, {at}; the same command goes on from there"))
}

/// The instruction set that guides are simulated with: how many of them at a time. It steers the speed, and no bit as far as is known.
fn machine() -> String {
    format!("{}, {} lanes", std::env::consts::ARCH, Pack::width())
}
