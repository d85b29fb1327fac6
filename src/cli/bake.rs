//! `hairbake bake`: all stages of a bake in one process.

use super::explain::{self, OptionOrigins};
use super::frame_list::{FrameList, frame_list};
use super::progress::Progress;
use super::run_arguments::RunArguments;
use super::scene_arguments::{OUTPUT, SELECTION, SceneArguments};
use super::warnings::of_scene;
use super::{console, summary};
use crate::bake::{self, BakeSummary};
use crate::error::{Error, Result};
use crate::scene::anim::{ContactSetting, Settings};
use crate::strands::LOOKAHEAD;
use clap::Args;
use std::path::Path;

const EXAMPLES: &str = "\
Examples:
  Bake a shot:
    hairbake groom.json anim.json -o out
  Try a few frames with half of the solver steps:
    hairbake groom.json anim.json -o try --frames 1001-1012 --substeps 4
  Bake one group again and keep all other hair:
    hairbake groom.json anim.json -o v2 --groups fringe --base out
  See every setting and where its value comes from:
    hairbake groom.json anim.json -o out --dry-run";

/// `hairbake bake` as it is typed.
#[derive(Debug, Args)]
#[command(after_help = EXAMPLES)]
pub struct BakeArguments {
    #[command(flatten)]
    scene: SceneArguments,
    /// Frames to bake, such as 1001-1100 [default: all frames of ANIM]
    ///
    /// With a step, as in 1001-1100x5, only these frames are written and the cache stays unfinished. Run
    /// again without the step to finish it.
    #[arg(long, value_name = "LIST", value_parser = frame_list, allow_hyphen_values = true, help_heading = SELECTION)]
    frames: Option<FrameList>,
    #[command(flatten)]
    finish: FinishArguments,
    #[command(flatten)]
    run: RunArguments,
    /// Check the inputs, print the plan and the origin of every setting, and write nothing
    #[arg(long, help_heading = OUTPUT)]
    dry_run: bool,
    /// Print the origin of every setting before the bake
    ///
    /// The origin is an option, an environment variable, a file or the default.
    #[arg(long, help_heading = OUTPUT)]
    explain: bool,
}

/// How a finished bake is reported.
#[derive(Debug, Args)]
pub struct FinishArguments {
    /// Do not draw the contact sheet, and leave the view out of the report
    ///
    /// Both together take a few seconds.
    #[arg(long, help_heading = OUTPUT)]
    no_pictures: bool,
    /// Print the figures of the bake as well: time, memory, penetration, how close its start is to the groom
    ///
    /// The report has them for every frame.
    #[arg(long, help_heading = OUTPUT)]
    figures: bool,
    /// Exit with code 1 if the bake broke a guarantee
    ///
    /// Guarantees: hair crosses no surface, no motion is truncated, every solve converges, contact forces
    /// balance to 1e-3, and every tie, load and goal acts in the shot. Hair inside bodies that leave no room
    /// for it breaks none. The cache is written in either case.
    #[arg(long, help_heading = OUTPUT)]
    strict: bool,
}

impl FinishArguments {
    /// Checks the options against the settings of the bake.
    ///
    /// # Errors
    /// [`Error::Usage`] for `--strict` with settings that guarantee nothing.
    pub fn check(&self, settings: &Settings) -> Result<()> {
        if self.strict && settings.contact == ContactSetting::Penalty {
            let message =
                "--contact penalty guarantees nothing; use --contact volume (the default) or omit --strict";
            return Err(Error::Usage(message.into()));
        }
        Ok(())
    }

    /// Writes and prints the report of a finished bake.
    ///
    /// # Errors
    /// [`Error::Io`]; with `--strict` [`Error::Broken`] if a frame breaks a guarantee.
    pub fn report(&self, summary: &BakeSummary, out: &Path, title: &str) -> Result<()> {
        let pictures = !self.no_pictures;
        if summary.fresh() == 0 && summary::exists(out, pictures) {
            console::say(&format!("{}: up to date, {} frames", out.display(), summary.frames.len()));
        } else {
            summary::write(summary, title, out, pictures)?;
            console::say(&summary::text(summary, out, pictures, self.figures));
        }
        if self.strict { check_guarantees(summary) } else { Ok(()) }
    }
}

/// Completes a bake and reports it; with a list of frames that has gaps, writes these frames only.
pub fn run(arguments: &BakeArguments, origins: &OptionOrigins, progress: Progress) -> Result<()> {
    let BakeArguments { scene, frames, finish, run, dry_run, explain } = arguments;
    let shot = frames.as_ref().map(|list| list.shot);
    if *dry_run || *explain {
        let loaded = scene.load(shot)?;
        let plan = explain::plan(scene, &loaded, origins)?;
        if *dry_run {
            let warnings = loaded.check_start()?;
            warnings.iter().for_each(|warning| console::warn(&of_scene(warning).to_text()));
            return console::data(plan.as_bytes());
        }
        console::say(plan.trim_end());
    }
    let control = run.control()?;
    let job = scene.job(shot, |anim| finish.check(&anim.settings))?;
    if let Some(FrameList { frames, .. }) = frames.as_ref().filter(|list| !list.is_complete()) {
        let last = frames.iter().max().map_or(*job.frames().start(), |last| last + LOOKAHEAD as i32);
        let segment = [*job.frames().start(), last];
        let summary = progress.through(|show| {
            bake::simulate(&job, segment, &control, &mut *show)?;
            bake::interpolate(&job, frames, &control, show)
        })?;
        say_frames("wrote", &summary, &job.out);
        return Ok(());
    }
    let summary = progress.through(|show| bake::bake(&job, &control, show))?;
    finish.report(&summary, &job.out, &scene.title())
}

/// Prints how many frames a stage processed, and how many were done before.
pub fn say_frames(verb: &str, summary: &BakeSummary, out: &Path) {
    let (fresh, all) = (summary.fresh(), summary.frames.len());
    let before = match all - fresh {
        0 => String::new(),
        done => format!(" ({done} already done)"),
    };
    console::say(&format!("{}: {verb} {fresh} of {all} frames{before}", out.display()));
}

/// Checks that scene and frames kept the guarantees of `--strict`.
///
/// # Errors
/// [`Error::Broken`] with the first frame that breaks a guarantee, or what of the scene does.
fn check_guarantees(summary: &BakeSummary) -> Result<()> {
    let mut broken =
        summary.frames.iter().map(|f| (f.frame, f.broken())).filter(|(_, what)| !what.is_empty());
    match broken.next() {
        None => match summary.scene.iter().find_map(|warning| warning.broken.as_ref()) {
            Some(what) => Err(Error::Broken(format!("guarantees are broken: {what}"))),
            None => Ok(()),
        },
        Some((frame, what)) => {
            let (what, more) = (what.join(", "), broken.count());
            let and_preroll =
                if summary.frames.first().is_some_and(|f| f.frame == frame) { " or before it" } else { "" };
            let more = if more > 0 { format!(", and in {more} more frames") } else { String::new() };
            Err(Error::Broken(format!("guarantees are broken in frame {frame}{and_preroll}: {what}{more}")))
        }
    }
}
