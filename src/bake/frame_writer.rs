//! From the guides' states to the files of frames.

use super::frame_state::FrameState;
use super::job::Job;
use super::output::{Output, Seen};
use super::summary::StageSeconds;
use crate::cache::Writer;
use crate::file::FileRecord;
use crate::strands::RETRACTION_SPAN;
use crate::{Error, Result};
use std::collections::{BTreeMap, BTreeSet};
use std::time::Instant;

/// From the guides' states at frames to their files.
pub(super) struct FrameWriter<'a> {
    job: &'a Job,
    output: Output<'a>,
    pub writer: Writer,
    /// States that were needed last, and what is known of the strands at them, as far as that was asked for.
    held: BTreeMap<i32, (FrameState, Option<Seen>)>,
    /// Frames that this task makes.
    own: BTreeSet<i32>,
}

impl<'a> FrameWriter<'a> {
    pub fn new(job: &'a Job, own: &[i32]) -> Result<Self> {
        let output = Output::new(&job.groom, &job.anim, &job.rods, job.base.as_ref());
        let writer = Writer::create(&job.out, output.header())?;
        Ok(FrameWriter { job, output, writer, held: BTreeMap::new(), own: own.iter().copied().collect() })
    }

    /// Takes a state that is at hand, and lets those go that are far from it.
    pub fn hold(&mut self, state: FrameState) {
        let frame = state.record.frame;
        self.held.insert(frame, (state, None));
        self.held.retain(|other, _| other.abs_diff(frame) <= 2 * RETRACTION_SPAN as u32);
    }

    /// The state at a frame.
    pub fn state(&mut self, frame: i32) -> Result<&FrameState> {
        if !self.held.contains_key(&frame) {
            self.hold(self.job.work.state(frame).map_err(|fault| {
                Error::NotYet(format!("the guides at frame {frame} are not simulated yet: {fault}"))
            })?);
        }
        Ok(&self.held[&frame].0)
    }

    /// Looks at the strands at a frame that is held. How far they retreat is told to other tasks that need it too, and taken from where one
    /// has told it: the ends of chunks are worked out once.
    pub fn see(&mut self, frame: i32) -> Result<()> {
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
    pub fn write(&mut self, frame: i32, seconds: &mut StageSeconds) -> Result<FileRecord> {
        let start = Instant::now();
        let first = *self.job.frames().start();
        // Before the first frame all is as it is there.
        let env: [i32; 2 * RETRACTION_SPAN + 1] =
            std::array::from_fn(|i| (frame + i as i32 - RETRACTION_SPAN as i32).max(first));
        for near in env {
            self.state(near)?;
            self.see(near)?;
        }
        let laid = self.held.get_mut(&frame).and_then(|(_, seen)| seen.as_mut()?.laid.take());
        let retreats = env.map(|near| self.held[&near].1.as_ref().map_or(&[][..], |seen| &seen.retreats));
        let states = [frame, frame + 1].map(|near| &self.held[&near].0.guides[..]);
        let arrays = self.output.frame(frame, states, &self.held[&(frame + 1)].0.steps, &retreats, laid)?;
        seconds.interpolate = start.elapsed().as_secs_f64();
        let start = Instant::now();
        let file = self.writer.write_frame(&arrays)?;
        self.job.work.mark_done(frame, &file)?;
        seconds.write = start.elapsed().as_secs_f64();
        Ok(file)
    }
}
