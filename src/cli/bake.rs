//! `hairbake GROOM ANIM -o OUT`: the bake, all of it or stage by stage.

use super::estimate::{self, Typed};
use super::progress::Progress;
use super::scene::{RunArguments, SceneArguments};
use super::values::FrameList;
use super::{console, summary, values};
use crate::bake::{self, BakeSummary};
use crate::error::{Error, Result};
use crate::scene::Anim;
use crate::scene::anim::Contact;
use crate::strands::RETRACTION_SPAN;
use clap::Args;
use std::ops::RangeInclusive;
use std::path::Path;

/// The bake as it is typed, besides its scene.
#[derive(Debug, Args)]
pub struct BakeArguments {
    /// Bake this part of the shot only. Of one with a step, such as 1001-1100x5, these frames are made and nothing else: without the step the
    /// bake goes on and is ended
    #[arg(long, value_name = "LIST", value_parser = values::frame_list, allow_hyphen_values = true, help_heading = "Output")]
    frames: Option<FrameList>,
    #[command(flatten)]
    end: EndArguments,
    #[command(flatten)]
    run: RunArguments,
    /// Check all, print what would be baked and each setting with where it comes from, and write nothing
    #[arg(long, help_heading = "Output")]
    dry_run: bool,
    /// Say before the bake where the value of each setting comes from: an option, a variable, a file, or the default
    #[arg(long, help_heading = "Output")]
    explain: bool,
}

/// How a bake ends.
#[derive(Debug, Args)]
pub struct EndArguments {
    /// Draw no contact sheet; it takes a few seconds
    #[arg(long, help_heading = "Output")]
    no_pictures: bool,
    /// End with exit code 1 if a guarantee was broken: a surface crossed, a motion cut short, a solve that failed, reactions that do not
    /// add up. All is written nevertheless
    #[arg(long, help_heading = "Output")]
    strict: bool,
}

impl EndArguments {
    /// # Errors
    /// [`Error::Usage`] where guarantees are asked for of a bake that has none.
    fn are_for(&self, anim: &Anim) -> Result<()> {
        if self.strict && anim.settings.contact == Contact::Penalty {
            let message =
                "--contact penalty guarantees nothing: ask for --contact bodies, or leave --strict away";
            return Err(Error::Usage(message.into()));
        }
        Ok(())
    }
}

const STAGES: &str = "\
The stages of a bake, for a farm (docs/farm.md): simulate, interpolate, assemble, validate. All of one bake have to be told the same \
scene, --shot and settings. Each does what is not done yet. Frames are those of the cache: one handle frame before the shot and one after it are \
among them. The strands of a frame depend on the guides two frames around it, so two more are simulated.

Examples, for a shot of 1001-1100:
  hairbake simulate groom.json anim.json -o out --frames 1000-1050
  hairbake simulate groom.json anim.json -o out --frames 1051-1103
  hairbake interpolate groom.json anim.json -o out --frames 1000-1048
  hairbake interpolate groom.json anim.json -o out --frames 1049-1101x2,1050-1100x2
  hairbake assemble groom.json anim.json -o out

Exit codes:
  0 done   75 what an earlier stage makes is not there yet   85 stopped as asked, run again to go on";

/// `hairbake simulate` as it is typed.
#[derive(Debug, Args)]
#[command(after_help = STAGES)]
pub struct SimulateArguments {
    #[command(flatten)]
    scene: SceneArguments,
    #[command(flatten)]
    shot: ShotArgument,
    /// Segment to simulate; it goes on from where the one before it has ended [default: all]
    #[arg(long, value_name = "A-B", value_parser = values::frames, allow_hyphen_values = true, help_heading = "Output")]
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
    shot: ShotArgument,
    /// Frames to make, such as 1001-1010, 1001-1100x5 or 1001,1003,1010-1020 [default: all]
    #[arg(long, value_name = "LIST", value_parser = values::frame_list, allow_hyphen_values = true, help_heading = "Output")]
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
    shot: ShotArgument,
    #[command(flatten)]
    end: EndArguments,
}

/// Which part of the shot the bake is of.
#[derive(Debug, Args)]
struct ShotArgument {
    /// The part of the shot that is baked in all, as --frames of the one command [default: all of it]
    #[arg(long, value_name = "A-B", value_parser = values::frames, allow_hyphen_values = true, help_heading = "Output")]
    shot: Option<(i32, i32)>,
}

/// Does all that is left of a bake, then reports; or makes some of its frames.
pub fn run(
    scene: &SceneArguments,
    arguments: &BakeArguments,
    typed: &Typed,
    progress: Progress,
) -> Result<()> {
    let list = arguments.frames.as_ref();
    if arguments.dry_run || arguments.explain {
        let plan = estimate::plan(scene, &scene.load(list.map(|list| list.shot))?, typed)?;
        if arguments.dry_run {
            return console::data(plan.as_bytes());
        }
        console::say(plan.trim_end());
    }
    let control = arguments.run.control()?;
    let job = scene.job(list.map(|list| list.shot), |anim| arguments.end.are_for(anim))?;
    if let Some(FrameList { frames, .. }) = list.filter(|list| !list.is_whole()) {
        let last = frames.iter().max().map_or(*job.frames().start(), |last| last + RETRACTION_SPAN as i32);
        let segment = [*job.frames().start(), last];
        let summary = progress.through(|show| {
            bake::simulate(&job, segment, &control, &mut *show)?;
            bake::interpolate(&job, frames, &control, show)
        })?;
        tell("made", &summary, &job.out);
        return Ok(());
    }
    let summary = progress.through(|show| bake::bake(&job, &control, show))?;
    report(&summary, &job.out, &scene.title(), &arguments.end)
}

/// Simulates a segment.
pub fn simulate(arguments: &SimulateArguments, progress: Progress) -> Result<()> {
    let control = arguments.run.control()?;
    let job = arguments.scene.job(arguments.shot.shot, |_| Ok(()))?;
    let all = job.simulated();
    let (first, last) = arguments.frames.unwrap_or((*all.start(), *all.end()));
    are_in(&all, &[first, last])?;
    let summary = progress.through(|show| bake::simulate(&job, [first, last], &control, show))?;
    tell("simulated", &summary, &job.out);
    Ok(())
}

/// Makes frames of what is simulated.
pub fn interpolate(arguments: &InterpolateArguments, progress: Progress) -> Result<()> {
    let control = arguments.run.control()?;
    let job = arguments.scene.job(arguments.shot.shot, |_| Ok(()))?;
    let frames = arguments.frames.as_ref().map_or_else(|| job.frames().collect(), |list| list.frames.clone());
    are_in(&job.frames(), &frames)?;
    let summary = progress.through(|show| bake::interpolate(&job, &frames, &control, show))?;
    tell("interpolated", &summary, &job.out);
    Ok(())
}

/// Ends a cache whose frames are done.
pub fn assemble(arguments: &AssembleArguments) -> Result<()> {
    let job = arguments.scene.job(arguments.shot.shot, |anim| arguments.end.are_for(anim))?;
    report(&bake::assemble(&job)?, &job.out, &arguments.scene.title(), &arguments.end)
}

/// # Errors
/// [`Error::Usage`] where there are `frames` that the stage has not.
fn are_in(all: &RangeInclusive<i32>, frames: &[i32]) -> Result<()> {
    match frames.iter().find(|frame| !all.contains(frame)) {
        Some(frame) => Err(Error::Usage(format!(
            "frame {frame} is none of this stage, which has {} to {}",
            all.start(),
            all.end()
        ))),
        None => Ok(()),
    }
}

fn tell(what: &str, summary: &BakeSummary, out: &Path) {
    let (fresh, all) = (summary.fresh(), summary.frames.len());
    console::say(&format!("{}: {fresh} frames {what}, {} were done already", out.display(), all - fresh));
}

fn report(summary: &BakeSummary, out: &Path, title: &str, end: &EndArguments) -> Result<()> {
    let pictures = !end.no_pictures;
    if summary.fresh() == 0 && summary::is_there(out, pictures) {
        console::say(&format!("{}: up to date, {} frames", out.display(), summary.frames.len()));
    } else {
        summary::write(summary, title, out, pictures)?;
        console::say(&summary::text(summary, out, pictures));
    }
    if end.strict { unbroken(summary) } else { Ok(()) }
}

/// # Errors
/// [`Error::Broken`] where a frame breaks a guarantee; it names the first.
fn unbroken(summary: &BakeSummary) -> Result<()> {
    let mut broken =
        summary.frames.iter().map(|f| (f.frame, f.broken())).filter(|(_, what)| !what.is_empty());
    match broken.next() {
        None => Ok(()),
        Some((frame, what)) => {
            let (what, others) = (what.join(", "), broken.count());
            Err(Error::Broken(format!(
                "frame {frame}: {what}; guarantees are broken in {} frames",
                others + 1
            )))
        }
    }
}
