//! What a stage did, frame by frame.

use super::frame_record::FrameRecord;
use super::job::Job;
use super::scene_warnings::SceneWarning;
use crate::cache::Manifest;
use serde::Serialize;

/// Wall-clock time of the stages of one frame, s. It varies between runs, so it is not written into the
/// cache.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize)]
pub struct StageSeconds {
    /// Simulation of the guides.
    pub simulate: f64,
    /// Interpolation of the render strands.
    pub interpolate: f64,
    /// Encoding and writing the frame file.
    pub write: f64,
}

impl StageSeconds {
    /// The time `simulate`, s, alone.
    pub(super) fn simulation(simulate: f64) -> Self {
        StageSeconds { simulate, ..StageSeconds::default() }
    }
}

/// What a stage did, frame by frame.
#[derive(Debug, Clone, Default)]
pub struct BakeSummary {
    /// What the user is warned of in the scene.
    pub scene: Vec<SceneWarning>,
    /// Records of the frames.
    pub frames: Vec<FrameRecord>,
    /// Time of each frame; `None` if it was done already.
    pub seconds: Vec<Option<StageSeconds>>,
    /// Time of the pre-roll, s; `None` if this process did not simulate it.
    pub preroll_seconds: Option<f64>,
    /// The manifest, once written.
    pub manifest: Option<Manifest>,
}

impl BakeSummary {
    /// Adds a frame. The simulation time of the first frame is that of the pre-roll.
    pub(super) fn add(&mut self, job: &Job, record: &FrameRecord, mut seconds: Option<StageSeconds>) {
        if let Some(seconds) = seconds.as_mut().filter(|_| record.frame == *job.frames().start()) {
            self.preroll_seconds = Some(std::mem::take(&mut seconds.simulate)).filter(|s| *s > 0.0);
        }
        self.frames.push(record.clone());
        self.seconds.push(seconds);
    }

    /// Number of frames that this process worked on.
    pub fn fresh(&self) -> usize {
        self.seconds.iter().flatten().count()
    }
}
