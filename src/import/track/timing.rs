//! Frames of the bake and their relation to the samples of a motion.

use super::options::TrackOptions;
use crate::import::motion::Motion;
use crate::import::plain::SampleTimes;
use crate::import::source::Source;
use crate::scene::{Settings, lead_in};
use crate::{Diagnostic, Error, Result};

/// Default first frame of a bake.
pub(super) const DEFAULT_FIRST_FRAME: i32 = 1001;
/// Default frames per second of a bake.
const DEFAULT_FPS: f64 = 24.0;
/// Most frames after the last at which deforming meshes are sampled, for their velocity.
const HANDLES: i32 = 2;
/// Tolerance for frame numbers computed in floating point, frames.
const FRAME_TOLERANCE: f64 = 1e-6;

/// The frames of a bake.
pub(super) struct Timing {
    /// Frames per second.
    pub(super) fps: f64,
    /// First and last frame.
    pub(super) frames: [i32; 2],
    /// Frame number of the first sample of the motion; may be fractional.
    pub(super) first_sample: f64,
    /// Frame number of the last sample.
    last_sample: f64,
    /// Time codes of the file per frame.
    codes_per_frame: f64,
}

impl Timing {
    /// The frames that `options` ask for, or those that the motion covers.
    ///
    /// # Errors
    /// A rate out of range, frames that the motion does not cover.
    pub(super) fn new(options: &TrackOptions, motion: &Motion) -> Result<Timing> {
        let fps = options.fps.or(motion.numbering.map(|n| n.rate)).unwrap_or(DEFAULT_FPS);
        if !(1.0..=1000.0).contains(&fps) {
            return Err(Error::Usage(format!("{fps} frames per second: must be 1 to 1000")));
        }
        let span = (motion.poses.len() - 1) as f64 / motion.rate * fps;
        let numbered = motion.numbering.map(|n| n.first / n.rate * fps);
        let first_sample =
            numbered.unwrap_or(options.frames.map_or(DEFAULT_FIRST_FRAME, |frames| frames[0]).into());
        let last_sample = first_sample + span;
        let covered =
            [(first_sample - FRAME_TOLERANCE).ceil() as i32, (last_sample + FRAME_TOLERANCE).floor() as i32];
        // A stage may have samples before and after its shot.
        let shot = motion.numbering.zip(motion.stage.as_ref()).map(|(n, stage)| {
            let [first, last] = stage.shot.map(|code| code / n.rate * fps);
            let first = (first - FRAME_TOLERANCE).ceil() as i32;
            [first.max(covered[0]), ((last + FRAME_TOLERANCE).floor() as i32).min(covered[1])]
        });
        let frames = options.frames.or(shot).unwrap_or(covered);
        if frames[0] > frames[1] || frames[0] < covered[0] || frames[1] > covered[1] {
            return Err(not_covered(options, frames, covered));
        }
        let codes_per_frame = motion.numbering.map_or(1.0, |n| n.rate / fps);
        Ok(Timing { fps, frames, first_sample, last_sample, codes_per_frame })
    }

    /// First frame at which a deforming mesh is sampled: that of the pre-roll, within the motion.
    pub(super) fn first_mesh_frame(&self) -> i32 {
        let before = self.frames[0] - (self.first_sample - FRAME_TOLERANCE).ceil() as i32;
        self.frames[0] - before.clamp(0, lead_in(self.fps, Settings::default().preroll))
    }

    /// Time codes at which a deforming USD or glTF mesh is sampled: the frames of the bake, of its pre-roll,
    /// and up to [`HANDLES`] more, within the motion.
    pub(super) fn mesh_times(
        &self,
        options: &TrackOptions,
        mesh: &Source,
        motion: Option<&Motion>,
    ) -> SampleTimes {
        let [first, last] = [self.first_mesh_frame(), self.frames[1]];
        let after = ((self.last_sample + FRAME_TOLERANCE).floor() as i32 - last).clamp(0, HANDLES);
        let same_stage = mesh.path == options.motion.path;
        let stage = motion.and_then(|motion| motion.stage.as_ref()).filter(|_| same_stage);
        SampleTimes {
            start: f64::from(first) * self.codes_per_frame,
            step: self.codes_per_frame,
            count: (last + after - first + 1) as usize,
            origin: self.first_sample * self.codes_per_frame,
            rate: self.fps * self.codes_per_frame,
            joint: options.joint.clone(),
            carrier: stage.map(|stage| stage.prim.clone()).filter(|_| options.joint.name.is_none()),
            from_world: stage.and_then(|stage| stage.rest.from_world),
        }
    }
}

fn not_covered(options: &TrackOptions, frames: [i32; 2], covered: [i32; 2]) -> Error {
    Diagnostic::new(
        &options.motion.path,
        "frames",
        format!("{} to {} requested", frames[0], frames[1]),
        format!("a range within {} to {}, which the motion covers", covered[0], covered[1]),
        "shorten the range with --frames, or export a longer motion",
    )
    .into()
}
