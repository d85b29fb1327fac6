//! Writes the files of frames from the guides' states.

use super::frame_state::FrameState;
use super::job::Job;
use super::output::{Output, Retracted};
use super::summary::StageSeconds;
use crate::cache::Writer;
use crate::file::FileRecord;
use crate::strands::RETRACTION_SPAN;
use crate::{Error, Result};
use std::collections::{BTreeMap, BTreeSet};
use std::time::Instant;

/// Writes the files of frames from the guides' states.
pub(super) struct FrameWriter<'a> {
    job: &'a Job,
    output: Output<'a>,
    writer: Writer,
    /// States in use, with the strands' retractions at them once they are needed.
    states: BTreeMap<i32, (FrameState, Option<Retracted>)>,
    /// Frames that this task writes.
    own: BTreeSet<i32>,
}

impl<'a> FrameWriter<'a> {
    pub fn new(job: &'a Job, own: &[i32]) -> Result<Self> {
        let output = Output::new(&job.groom, &job.anim, &job.rods, job.base.as_ref());
        let writer = Writer::create(&job.out, output.header())?;
        Ok(FrameWriter { job, output, writer, states: BTreeMap::new(), own: own.iter().copied().collect() })
    }

    /// Takes over a state, and drops states of distant frames.
    pub fn insert(&mut self, state: FrameState) {
        let frame = state.record.frame;
        self.states.insert(frame, (state, None));
        self.states.retain(|other, _| other.abs_diff(frame) <= 2 * RETRACTION_SPAN as u32);
    }

    /// The state at a frame, from memory or from the work folder.
    pub fn state(&mut self, frame: i32) -> Result<&FrameState> {
        if !self.states.contains_key(&frame) {
            self.insert(self.job.work.state(frame).map_err(|fault| {
                Error::NotYet(format!("the guides at frame {frame} are not simulated yet: {fault}"))
            })?);
        }
        Ok(&self.states[&frame].0)
    }

    /// Computes the strands' retractions at a frame whose state is loaded. Retractions that several tasks
    /// need are shared through the work folder, so that they are computed once.
    pub fn retract(&mut self, frame: i32) -> Result<()> {
        let Some((state, retracted @ None)) = self.states.get_mut(&frame) else { return Ok(()) };
        let (span, work) = (RETRACTION_SPAN as i32, &self.job.work);
        let shared =
            (frame - span..=frame + span).any(|f| self.job.frames().contains(&f) && !self.own.contains(&f));
        let own = self.own.contains(&frame);
        // Its own frames need the strands' motion as well, which is not shared.
        let found = if shared && !own { work.retractions(frame, self.output.vertices()) } else { None };
        let share = shared && found.is_none();
        let retracted = retracted.insert(match found {
            Some(retractions) => Retracted { retractions, unretracted: None },
            None => self.output.retract(frame, &state.guides, own),
        });
        if share {
            work.write_retractions(frame, &retracted.retractions)?;
        }
        Ok(())
    }

    /// Writes a frame's file, then marks it as done.
    pub fn write(&mut self, frame: i32, seconds: &mut StageSeconds) -> Result<FileRecord> {
        let start = Instant::now();
        let first = *self.job.frames().start();
        // Before the first frame the guides are as at it.
        let env: [i32; 2 * RETRACTION_SPAN + 1] =
            std::array::from_fn(|i| (frame + i as i32 - RETRACTION_SPAN as i32).max(first));
        for near in env {
            self.state(near)?;
            self.retract(near)?;
        }
        let unretracted =
            self.states.get_mut(&frame).and_then(|(_, retracted)| retracted.as_mut()?.unretracted.take());
        let retractions =
            env.map(|near| self.states[&near].1.as_ref().map_or(&[][..], |retracted| &retracted.retractions));
        let states = [frame, frame + 1].map(|near| &self.states[&near].0.guides[..]);
        let arrays = self.output.frame(
            frame,
            states,
            &self.states[&(frame + 1)].0.steps,
            &retractions,
            unretracted,
        )?;
        seconds.interpolate = start.elapsed().as_secs_f64();
        let start = Instant::now();
        let file = self.writer.write_frame(&arrays)?;
        self.job.work.mark_done(frame, &file)?;
        seconds.write = start.elapsed().as_secs_f64();
        Ok(file)
    }

    /// The writer of the cache.
    pub fn into_writer(self) -> Writer {
        self.writer
    }
}
