//! What a bake will be and take, before it is run: `hairbake estimate`, `--dry-run`, `--explain`.

use super::progress::Progress;
use super::scene::{Scene, SceneArguments};
use super::{console, summary, values};
use crate::bake::control::Control;
use crate::bake::{self, BakeSummary, StageSeconds};
use crate::error::{Error, Result};
use crate::strands::RETRACTION_SPAN;
use clap::parser::ValueSource;
use clap::{ArgMatches, Args, Command};
use std::fmt::Write;

/// Frames that are tried; with the handle frames there are two more.
const TRIED: i32 = 4;
/// Pre-roll of the trial, s.
const PREROLL: f64 = 0.25;

const EXAMPLES: &str = "\
Examples:
  hairbake estimate groom.json anim.json -o out
  hairbake estimate groom.json anim.json -o out --substeps 4 --threads 8

A few frames from the shot's start are baked into a temporary folder. Where hair hits something later the bake takes longer.";

/// `hairbake estimate` as it is typed.
#[derive(Debug, Args)]
#[command(after_help = EXAMPLES)]
pub struct EstimateArguments {
    #[command(flatten)]
    scene: SceneArguments,
    /// The part of the shot that is to be baked [default: all of it]
    #[arg(long, value_name = "A-B", value_parser = values::frames, allow_hyphen_values = true, help_heading = "Output")]
    frames: Option<(i32, i32)>,
}

/// Bakes a few frames elsewhere and says what all will take.
pub fn run(arguments: &EstimateArguments, typed: &Typed, progress: Progress) -> Result<()> {
    let scene = arguments.scene.load(arguments.frames)?;
    let mut text = plan(&arguments.scene, &scene, typed)?;
    let whole = scene.anim.frames;
    let folder = tempfile::tempdir().map_err(|e| Error::io(std::env::temp_dir(), e))?;
    let tried = (whole.0, whole.1.min(whole.0.saturating_add(TRIED - 1)));
    let mut trial = arguments.scene.load(Some(tried))?;
    let preroll = trial.anim.settings.preroll;
    trial.anim.settings.preroll = preroll.min(PREROLL);
    let (settled, fps) = (trial.anim.settings.preroll, trial.anim.fps);
    let job = trial.begin(folder.path())?;
    let summary = progress.through(|show| bake::bake(&job, &Control::default(), show))?;
    figures(&mut text, &summary, whole, preroll, (settled, fps));
    console::data(text.as_bytes())
}

/// Enters time, disk and memory of the frames `whole`, from a trial whose pre-roll was `settled` s at `fps`.
fn figures(
    text: &mut String,
    trial: &BakeSummary,
    whole: (i32, i32),
    preroll: f64,
    (settled, fps): (f64, f64),
) {
    let tried = trial.fresh().max(1) as f64;
    let sum = |of: fn(&StageSeconds) -> f64| trial.seconds.iter().flatten().map(of).sum::<f64>();
    // The steps of the first frame are in the pre-roll's time.
    let simulate = sum(|s| s.simulate) / (tried - 1.0).max(1.0);
    let write = sum(|s| s.interpolate + s.write) / tried;
    let frames = f64::from(whole.1) - f64::from(whole.0) + 3.0;
    // Hair moves most while it settles.
    let settle = match trial.preroll_seconds {
        Some(seconds) if settled > 0.0 => (seconds / settled).max(simulate * fps) * preroll,
        _ => simulate * fps * preroll,
    };
    let seconds = simulate * (frames + f64::from(RETRACTION_SPAN as u32)) + write * frames + settle;
    let disk = trial.manifest.as_ref().map_or(0.0, |manifest| {
        let still: u64 = manifest.layers.iter().map(|layer| layer.bytes).sum();
        let moving: u64 = manifest.frames.iter().map(|frame| frame.file.bytes).sum();
        still as f64 + moving as f64 / tried * frames
    });
    row(
        text,
        "time",
        &format!(
            "{}: {:.3} s/frame and {settle:.1} s to settle, as {tried} frames took it",
            clock(seconds),
            simulate + write
        ),
        "",
    );
    row(text, "disk", &format!("{:.1} MB, {frames} files of frames", disk * 1e-6), "");
    if let Some(bytes) = summary::peak_memory() {
        row(text, "memory", &format!("{:.0} MB, for any number of frames", bytes as f64 * 1e-6), "");
    }
}

/// What is to be baked, and every setting with where its value comes from.
pub fn plan(arguments: &SceneArguments, scene: &Scene, typed: &Typed) -> Result<String> {
    let mut text = String::new();
    let (first, last) = scene.anim.frames;
    let (guides, strands) = (&scene.groom.guides.curves, &scene.groom.strands.curves);
    row(
        &mut text,
        "frames",
        &format!("{first} to {last} at {} a second, and a handle frame at each end", scene.anim.fps),
        "",
    );
    row(&mut text, "guides", &format!("{}, {} points", guides.len(), guides.points.len()), "");
    row(&mut text, "strands", &format!("{}, {} points", strands.len(), strands.points.len()), "");
    row(&mut text, "colliders", &scene.anim.colliders.len().to_string(), "");
    for (name, value, origin) in arguments.settings_explained(scene)? {
        row(&mut text, &name, &value, &origin);
    }
    for (name, value, origin) in typed.explained() {
        row(&mut text, &name, &value, &origin);
    }
    Ok(text)
}

fn row(text: &mut String, name: &str, value: &str, origin: &str) {
    // Writing to a string does not fail.
    let _ = writeln!(text, "{}", format!("{name:<20}{value:<18}{origin}").trim_end());
}

/// A time as people say it.
fn clock(seconds: f64) -> String {
    match seconds {
        s if s < 120.0 => format!("{s:.0} s"),
        s if s < 7200.0 => format!("{:.0} min", s / 60.0),
        s => format!("{:.1} h", s / 3600.0),
    }
}

/// The command line with where each of its values comes from.
pub struct Typed {
    /// The command that is run, and what was typed of it.
    command: Command,
    matches: ArgMatches,
    /// The variable of a queue that gave the number of threads.
    queue: Option<&'static str>,
}

impl Typed {
    /// The innermost command of what was typed.
    pub fn new(mut command: Command, mut matches: ArgMatches, queue: Option<&'static str>) -> Self {
        // Globals reach the commands below only so.
        command.build();
        while let Some((name, below)) = matches.remove_subcommand() {
            if let Some(found) = command.find_subcommand(&name) {
                command = found.clone();
            }
            matches = below;
        }
        Typed { command, matches, queue }
    }

    /// Name, value and origin of every option that the environment may give.
    fn explained(&self) -> Vec<(String, String, String)> {
        let of_environment = self.command.get_arguments().filter(|a| a.get_env().is_some());
        let row = |argument: &clap::Arg| {
            let id = argument.get_id().as_str();
            let name = argument.get_long().unwrap_or(id);
            let values = self.matches.get_raw(id).into_iter().flatten();
            let value = values.map(|v| v.to_string_lossy().into_owned()).collect::<Vec<_>>().join(",");
            let variable = argument.get_env().unwrap_or_default().to_string_lossy();
            let (value, origin) = match self.matches.value_source(id) {
                Some(ValueSource::CommandLine) => (value, format!("--{name}")),
                Some(ValueSource::EnvVariable) => (value, variable.into_owned()),
                _ if id == "threads" => {
                    let threads = rayon::current_num_threads().to_string();
                    (threads, self.queue.unwrap_or("processors of this machine").into())
                }
                Some(_) => (value, "default".into()),
                None => ("none".into(), "default".into()),
            };
            (name.to_string(), value, origin)
        };
        of_environment.map(row).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_as_people_say_them() {
        assert_eq!([3.4, 119.0, 600.0, 9000.0].map(clock), ["3 s", "119 s", "10 min", "2.5 h"]);
    }
}
