//! `hairbake simulate`, `interpolate` and `assemble`: the stages of a bake, one process each.

use super::bake::{FinishArguments, say_frames};
use super::frame_list::{FrameList, frame_list, frame_range};
use super::progress::Progress;
use super::run_arguments::RunArguments;
use super::scene_arguments::{SELECTION, SceneArguments};
use crate::bake;
use crate::bake::job::{cache_frames, simulated_frames};
use crate::error::{Error, Result};
use clap::Args;
use std::ops::RangeInclusive;

const STAGES: &str = "\
Stages of a bake on a farm:
  simulate, interpolate, assemble and validate, in this order; see docs/farm.md.
  All stages need the same scene, --shot and settings. Each one does only what is
  not done yet. Frames include a handle frame before and after the shot. A frame
  of strands depends on the guides two frames before and after it, so simulate
  runs two frames further.

Examples, for the shot 1001-1100:
  hairbake simulate groom.json anim.json -o out --frames 1000-1050
  hairbake simulate groom.json anim.json -o out --frames 1051-1103
  hairbake interpolate groom.json anim.json -o out --frames 1000-1048
  hairbake interpolate groom.json anim.json -o out --frames 1049-1101
  hairbake assemble groom.json anim.json -o out

Exit codes:
   0  done
  75  the output of an earlier stage is missing; try again later
  85  stopped on request; run again to resume";

/// `hairbake simulate` as it is typed.
#[derive(Debug, Args)]
#[command(after_help = STAGES)]
pub struct SimulateArguments {
    #[command(flatten)]
    scene: SceneArguments,
    #[command(flatten)]
    whole: ShotArgument,
    /// Segment of frames to simulate, such as 1000-1050 [default: all]
    ///
    /// It continues where the segment before it ends.
    #[arg(long, value_name = "A-B", value_parser = frame_range, allow_hyphen_values = true, help_heading = SELECTION)]
    frames: Option<(i32, i32)>,
    #[command(flatten)]
    run: RunArguments,
}

/// `hairbake interpolate` as it is typed.
#[derive(Debug, Args)]
#[command(after_help = STAGES)]
pub struct InterpolateArguments {
    #[command(flatten)]
    scene: SceneArguments,
    #[command(flatten)]
    whole: ShotArgument,
    /// Frames to write, such as 1001-1010, 1001-1100x5 or 1001,1003,1010-1020 [default: all]
    #[arg(long, value_name = "LIST", value_parser = frame_list, allow_hyphen_values = true, help_heading = SELECTION)]
    frames: Option<FrameList>,
    #[command(flatten)]
    run: RunArguments,
}

/// `hairbake assemble` as it is typed.
#[derive(Debug, Args)]
#[command(after_help = STAGES)]
pub struct AssembleArguments {
    #[command(flatten)]
    scene: SceneArguments,
    #[command(flatten)]
    whole: ShotArgument,
    #[command(flatten)]
    finish: FinishArguments,
}

/// The frames of the whole bake.
#[derive(Debug, Args)]
struct ShotArgument {
    /// Frames of the whole bake, as --frames of `hairbake bake` [default: all frames of ANIM]
    #[arg(long, value_name = "A-B", value_parser = frame_range, allow_hyphen_values = true, help_heading = SELECTION)]
    shot: Option<(i32, i32)>,
}

/// Simulates a segment.
pub fn simulate(arguments: &SimulateArguments, progress: Progress) -> Result<()> {
    let control = arguments.run.control()?;
    let job = arguments.scene.job(arguments.whole.shot, |anim| match arguments.frames {
        Some((first, last)) => check_frames(&simulated_frames(anim), &[first, last]),
        None => Ok(()),
    })?;
    let all = job.simulated();
    let (first, last) = arguments.frames.unwrap_or((*all.start(), *all.end()));
    let summary = progress.through(|show| bake::simulate(&job, [first, last], &control, show))?;
    say_frames("simulated", &summary, &job.out);
    Ok(())
}

/// Writes frames from simulated guides.
pub fn interpolate(arguments: &InterpolateArguments, progress: Progress) -> Result<()> {
    let control = arguments.run.control()?;
    let given = arguments.frames.as_ref().map(|list| &list.frames);
    let job = arguments.scene.job(arguments.whole.shot, |anim| match given {
        Some(frames) => check_frames(&cache_frames(anim), frames),
        None => Ok(()),
    })?;
    let frames = given.cloned().unwrap_or_else(|| job.frames().collect());
    let summary = progress.through(|show| bake::interpolate(&job, &frames, &control, show))?;
    say_frames("interpolated", &summary, &job.out);
    Ok(())
}

/// Finishes a cache whose frames are done.
pub fn assemble(arguments: &AssembleArguments) -> Result<()> {
    let finish = &arguments.finish;
    let job = arguments.scene.job(arguments.whole.shot, |anim| finish.check(&anim.settings))?;
    finish.report(&bake::assemble(&job)?, &job.out, &arguments.scene.title())
}

/// # Errors
/// [`Error::Usage`] if one of `frames` is not in `all`.
fn check_frames(all: &RangeInclusive<i32>, frames: &[i32]) -> Result<()> {
    match frames.iter().find(|frame| !all.contains(frame)) {
        Some(frame) => Err(Error::Usage(format!(
            "frame {frame} is outside the frames of this stage, {} to {}",
            all.start(),
            all.end()
        ))),
        None => Ok(()),
    }
}
