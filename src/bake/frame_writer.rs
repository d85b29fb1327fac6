//! Writes the files of frames from the guides' states.

use super::frame_record::WrittenMeasures;
use super::frame_state::FrameState;
use super::job::Job;
use super::output::{FrameStrands, Output};
use super::over::Over;
use super::summary::StageSeconds;
use super::work_dir::WrittenFrame;
use crate::cache::Writer;
use crate::dynamics::guide_frame::MovingGuide;
use crate::strands::{Deflection, LOOKAHEAD, LOOKBEHIND};
use crate::{Error, Result};
use std::collections::{BTreeMap, BTreeSet};
use std::time::Instant;

/// Number of frames after a frame whose states are used when it is written. The strands of each own frame
/// that it depends on are laid with their velocities, which depend on the next state.
pub(super) const RUN_AHEAD: usize = LOOKAHEAD + 1;

/// Frames within this distance of the latest are kept.
const KEPT: usize = LOOKBEHIND + 1 + RUN_AHEAD;

/// Writes the files of frames from the guides' states.
pub(super) struct FrameWriter<'a> {
    job: &'a Job,
    output: Output<'a>,
    over: Option<Over>,
    writer: Writer,
    /// States in use.
    states: BTreeMap<i32, Near>,
    /// Frames that this task writes.
    own: BTreeSet<i32>,
}

/// A state in use, with what is computed from it once it is needed.
struct Near {
    state: FrameState,
    /// The guides in motion, and the number of those with limited rates.
    moving: Option<(Vec<MovingGuide>, u32)>,
    strands: Option<FrameStrands>,
    settled: Option<Vec<Deflection>>,
}

impl<'a> FrameWriter<'a> {
    pub fn new(job: &'a Job, own: &[i32]) -> Result<Self> {
        let output = Output::new(&job.groom, &job.anim, &job.rods, job.base.as_ref());
        let mut writer = Writer::create(&job.out, output.header())?;
        let over = match &job.over {
            Some(plan) => Over::planned(&job.groom, &job.anim, output.header(), plan, &job.out)?,
            None => None,
        };
        if let Some(over) = &over {
            writer = writer.with_over(over.header().clone())?;
        }
        Ok(FrameWriter {
            job,
            output,
            over,
            writer,
            states: BTreeMap::new(),
            own: own.iter().copied().collect(),
        })
    }

    /// Takes over a state, and drops states of distant frames.
    pub fn insert(&mut self, state: FrameState) {
        let frame = state.record.frame;
        self.states.insert(frame, Near { state, moving: None, strands: None, settled: None });
        self.states.retain(|other, _| other.abs_diff(frame) <= KEPT as u32);
    }

    /// The state at a frame, from memory or from the work folder.
    pub fn state(&mut self, frame: i32) -> Result<&FrameState> {
        if !self.states.contains_key(&frame) {
            self.insert(self.job.work.state(frame).map_err(|fault| {
                Error::NotYet(format!("the guides at frame {frame} are not simulated yet: {fault}"))
            })?);
        }
        Ok(&self.states[&frame].state)
    }

    /// Computes the rates of the guides at a frame.
    fn compute_rates(&mut self, frame: i32) -> Result<()> {
        let before = (frame > *self.job.frames().start()).then_some(frame - 1);
        for near in before.into_iter().chain([frame, frame + 1]) {
            self.state(near)?;
        }
        if self.states[&frame].moving.is_none() {
            let guides = |near: i32| &self.states[&near].state.guides[..];
            let moving = self.output.in_motion(frame, before.map(guides), [frame, frame + 1].map(guides));
            self.states.entry(frame).and_modify(|near| near.moving = Some(moving));
        }
        Ok(())
    }

    /// Computes the strands' deflections at a frame. Deflections that several tasks need are shared through
    /// the work folder, so that they are computed once.
    fn deflect(&mut self, frame: i32) -> Result<()> {
        let own = self.own.contains(&frame);
        if own {
            // Its own frames need the strands' motion as well, which is not shared.
            self.compute_rates(frame)?;
        }
        self.state(frame)?;
        let Some(Near { state, moving, strands: strands @ None, .. }) = self.states.get_mut(&frame) else {
            return Ok(());
        };
        let work = &self.job.work;
        let users = frame - LOOKAHEAD as i32..=frame + LOOKBEHIND as i32;
        let shared = users.into_iter().any(|f| self.job.frames().contains(&f) && !self.own.contains(&f));
        let found = if shared && !own { work.deflections(frame, self.output.vertices()) } else { None };
        let share = shared && found.is_none();
        let strands = strands.insert(match found {
            Some(deflections) => FrameStrands { deflections, ..FrameStrands::default() },
            None => {
                let moving = moving.as_ref().map(|(guides, _)| &guides[..]);
                self.output.deflect(frame, &state.guides, moving)
            }
        });
        if share {
            work.write_deflections(frame, &strands.deflections)?;
        }
        Ok(())
    }

    /// Computes the settled deflections at a frame.
    fn settle(&mut self, frame: i32) -> Result<()> {
        let around = self.around(frame);
        for near in around {
            self.deflect(near)?;
        }
        if self.states[&frame].settled.is_none() {
            let raw = around.map(|near| {
                self.states[&near].strands.as_ref().map_or(&[][..], |strands| &strands.deflections)
            });
            let Near { state, strands, .. } = &self.states[&frame];
            let posed = strands.as_ref().and_then(|strands| strands.guides.as_ref());
            let settled = self.output.settle(frame, &state.guides, posed, &raw);
            self.states.entry(frame).and_modify(|near| near.settled = Some(settled));
        }
        Ok(())
    }

    /// `N` consecutive frames of which `frame` is in the middle, or the last before it. Before the first
    /// frame the guides are as at it.
    fn around<const N: usize>(&self, frame: i32) -> [i32; N] {
        let first = *self.job.frames().start();
        std::array::from_fn(|i| (frame + i as i32 - (N as i32 - 1) / 2).max(first))
    }

    /// Writes a frame's file, then marks it as done.
    pub fn write(&mut self, frame: i32, seconds: &mut StageSeconds) -> Result<WrittenFrame> {
        let start = Instant::now();
        let around: [i32; 4] = self.around(frame);
        for near in around {
            self.settle(near)?;
        }
        for end in [frame, frame + 1] {
            self.compute_rates(end)?;
        }
        let strands = self.states.get_mut(&frame).and_then(|near| near.strands.as_mut());
        let known = strands.and_then(|strands| strands.guides.take().zip(strands.free.take()));
        let settled = around.map(|near| self.states[&near].settled.as_deref().unwrap_or_default());
        let moving = |near: i32| self.states[&near].moving.as_ref();
        let states = [frame, frame + 1].map(|near| moving(near).map_or(&[][..], |(guides, _)| guides));
        let limited_rates = moving(frame).map_or(0, |(_, limited)| *limited);
        let steps = &self.states[&(frame + 1)].state.steps;
        let (arrays, depths) = self.output.frame(frame, states, steps, settled, known)?;
        let overs = self.over.as_ref().map(|over| over.frame(&self.job.anim, &arrays));
        let jumps = self.output.jumps([settled[1], settled[2]]);
        seconds.interpolate = start.elapsed().as_secs_f64();
        let start = Instant::now();
        let file = self.writer.write_frame(&arrays)?;
        let over = overs.map(|moments| self.writer.write_over_frame(&moments)).transpose()?;
        let written = WrittenFrame { file, over, measures: WrittenMeasures { depths, jumps, limited_rates } };
        self.job.work.mark_done(frame, &written)?;
        seconds.write = start.elapsed().as_secs_f64();
        Ok(written)
    }

    /// The writer of the cache.
    pub fn into_writer(self) -> Writer {
        self.writer
    }
}
