//! What a stage did, frame by frame.

use super::frame_record::FrameRecord;
use super::job::Job;
use crate::cache::Manifest;
use serde::Serialize;

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
    pub(super) fn note(&mut self, job: &Job, record: &FrameRecord, mut seconds: Option<StageSeconds>) {
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
