//! `hairbake estimate`: bakes a few frames and predicts what the whole bake takes.

use super::explain::{self, OptionOrigins, row};
use super::frame_list::frame_range;
use super::progress::Progress;
use super::scene_arguments::{SELECTION, SceneArguments};
use super::{console, summary};
use crate::bake::control::Control;
use crate::bake::{self, BakeSummary, StageSeconds};
use crate::cache::FrameEntry;
use crate::error::{Error, Result};
use crate::strands::LOOKAHEAD;
use clap::Args;

/// Frames of the trial bake; its handle frames are two more.
const TRIAL_FRAMES: i32 = 4;
/// Longest pre-roll of the trial bake, s.
const TRIAL_PREROLL: f64 = 0.25;

const EXAMPLES: &str = "\
Examples:
  hairbake estimate groom.json anim.json -o out
  hairbake estimate groom.json anim.json -o out --substeps 4 --threads 8

The estimate comes from a trial bake of the first frames into a temporary folder.
The bake takes longer if hair hits more later in the shot.";

/// `hairbake estimate` as it is typed.
#[derive(Debug, Args)]
#[command(after_help = EXAMPLES)]
pub struct EstimateArguments {
    #[command(flatten)]
    scene: SceneArguments,
    /// Frames of the bake, such as 1001-1100 [default: all frames of ANIM]
    #[arg(long, value_name = "A-B", value_parser = frame_range, allow_hyphen_values = true, help_heading = SELECTION)]
    frames: Option<(i32, i32)>,
}

/// Runs the trial bake and prints the plan with the estimate.
pub fn run(arguments: &EstimateArguments, origins: &OptionOrigins, progress: Progress) -> Result<()> {
    let scene = arguments.scene.load(arguments.frames)?;
    let mut text = explain::plan(&arguments.scene, &scene, origins)?;
    let (first, last) = scene.anim.frames;
    let folder = tempfile::tempdir().map_err(|e| Error::io(std::env::temp_dir(), e))?;
    let mut trial = arguments.scene.load(Some((first, last.min(first.saturating_add(TRIAL_FRAMES - 1)))))?;
    let settings = &mut trial.anim.settings;
    let preroll = Preroll { whole: settings.preroll, trial: settings.preroll.min(TRIAL_PREROLL) };
    settings.preroll = preroll.trial;
    let fps = trial.anim.fps;
    let job = trial.begin(folder.path())?;
    let summary = progress.through(|show| bake::bake(&job, &Control::default(), show))?;
    // Two handle frames, and one more for a range that includes both ends.
    let frames = f64::from(last) - f64::from(first) + 3.0;
    write_estimate(&mut text, &summary, frames, preroll, fps);
    console::data(text.as_bytes())
}

/// Length of the pre-roll, s, of the whole bake and of the trial.
#[derive(Clone, Copy)]
struct Preroll {
    whole: f64,
    trial: f64,
}

/// Appends time, disk space and memory of a bake of so many `frames`, scaled from the trial's.
fn write_estimate(text: &mut String, trial: &BakeSummary, frames: f64, preroll: Preroll, fps: f64) {
    let measured = trial.fresh().max(1) as f64;
    let sum = |of: fn(&StageSeconds) -> f64| trial.seconds.iter().flatten().map(of).sum::<f64>();
    // The solver steps of the first frame belong to the pre-roll.
    let simulate = sum(|s| s.simulate) / (measured - 1.0).max(1.0);
    let write = sum(|s| s.interpolate + s.write) / measured;
    // Hair moves most while it settles, so that a second of pre-roll costs at least a second of the shot.
    let settle = match trial.preroll_seconds {
        Some(seconds) if preroll.trial > 0.0 => (seconds / preroll.trial).max(simulate * fps) * preroll.whole,
        _ => simulate * fps * preroll.whole,
    };
    let seconds = simulate * (frames + f64::from(LOOKAHEAD as u32)) + write * frames + settle;
    let pace = simulate + write;
    let time = format!(
        "{} ({pace:.3} s/frame plus {settle:.1} s pre-roll, from a trial of {measured} frames)",
        duration(seconds)
    );
    row(text, "time", &time, "");
    let disk = trial.manifest.as_ref().map_or(0.0, |manifest| {
        let once: u64 = manifest.layers.iter().map(|layer| layer.bytes).sum();
        let per_frame: u64 = manifest.frames.iter().map(FrameEntry::bytes).sum();
        once as f64 + per_frame as f64 / measured * frames
    });
    row(text, "disk", &format!("{:.1} MB in {frames} frame files", disk * 1e-6), "");
    if let Some(bytes) = summary::peak_memory() {
        row(
            text,
            "memory",
            &format!("{:.0} MB, independent of the number of frames", bytes as f64 * 1e-6),
            "",
        );
    }
}

/// A duration in seconds, minutes or hours.
fn duration(seconds: f64) -> String {
    match seconds {
        s if s < 120.0 => format!("{s:.0} s"),
        s if s < 7200.0 => format!("{:.0} min", s / 60.0),
        s => format!("{:.1} h", s / 3600.0),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn durations_have_units_of_their_size() {
        assert_eq!([3.4, 119.0, 600.0, 9000.0].map(duration), ["3 s", "119 s", "10 min", "2.5 h"]);
    }
}
