//! `hairbake GROOM ANIM -o OUT`: the bake.

use super::progress::Progress;
use super::{console, summary, values};
use crate::error::{Error, Problem, Result};
use crate::{bake, scene};
use clap::Args;
use std::path::{Path, PathBuf};

/// The bake as it is typed.
#[derive(Debug, Args)]
pub struct BakeArguments {
    /// Groom: materials, hierarchy, guides, render strands (groom.json)
    groom: PathBuf,
    /// Animation: frames, head track, colliders, wind, settings (anim.json)
    anim: PathBuf,
    /// Folder for the cache, the report and the contact sheet; made if need be, replaced if it holds a cache
    #[arg(long, short, value_name = "OUT", help_heading = "Output")]
    output: PathBuf,
    /// Bake this part of the shot only
    #[arg(long, value_name = "A-B", value_parser = values::frames, allow_hyphen_values = true, help_heading = "Output")]
    frames: Option<(i32, i32)>,
    /// Draw no contact sheet; it takes a few seconds
    #[arg(long, help_heading = "Output")]
    no_pictures: bool,
    /// End with exit code 1 if a guarantee was broken: a surface crossed, a motion cut short, a solve that failed, reactions that do not
    /// add up. All is written nevertheless
    #[arg(long, help_heading = "Output")]
    strict: bool,
    /// Steps of the solver in one frame: more follows quick motion truer, and costs in proportion [default: the anim's, 8]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=10_000), help_heading = "Settings (over those of the anim)")]
    substeps: Option<u32>,
    /// Time simulated before the first frame, s, in which hair settles and comes out of the body: more if it still moves at the
    /// start [default: the anim's, 1]
    #[arg(long, value_name = "S", value_parser = preroll, help_heading = "Settings (over those of the anim)")]
    preroll: Option<f64>,
    /// Strain nodes of guides in grooms without wisps: more bends finer and costs more [default: the anim's, 8]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(2..=256), help_heading = "Settings (over those of the anim)")]
    nodes: Option<u32>,
    /// Time scheme, bdf2 or backward-euler: the second is cheaper in contact, and damps swinging hair more than air and hair do
    /// [default: the anim's, bdf2]
    #[arg(long, value_name = "NAME", value_parser = values::scheme, help_heading = "Settings (over those of the anim)")]
    scheme: Option<scene::anim::Scheme>,
    /// What hair touches, full or bodies: full is bodies and other hair, and costs more [default: the anim's, bodies]
    #[arg(long, value_name = "NAME", value_parser = values::contact, help_heading = "Settings (over those of the anim)")]
    contact: Option<scene::anim::Contact>,
}

fn preroll(text: &str) -> std::result::Result<f64, String> {
    values::not_negative(text).ok().filter(|s| *s <= 60.0).ok_or_else(|| "0 to 60 s".into())
}

/// What a bake is to do, all checked.
pub struct Job {
    /// The groom's file.
    pub groom_file: PathBuf,
    /// The animation's file.
    pub anim_file: PathBuf,
    /// The folder to write.
    pub out: PathBuf,
    /// Whether pictures are drawn.
    pub pictures: bool,
    strict: bool,
    groom: scene::Groom,
    anim: scene::Anim,
}

impl BakeArguments {
    /// Reads and checks the scene, and puts the command line's settings over the file's.
    pub fn resolve(self) -> Result<Job> {
        let (groom, mut anim) = scene::load(&self.groom, &self.anim)?;
        if let Some(frames) = self.frames {
            check_frames(&self.anim, frames, anim.frames)?;
            anim.frames = frames;
        }
        let settings = &mut anim.settings;
        settings.substeps = self.substeps.unwrap_or(settings.substeps);
        settings.preroll = self.preroll.unwrap_or(settings.preroll);
        settings.nodes = self.nodes.unwrap_or(settings.nodes);
        settings.scheme = self.scheme.unwrap_or(settings.scheme);
        settings.contact = self.contact.unwrap_or(settings.contact);
        Ok(Job {
            groom_file: self.groom,
            anim_file: self.anim,
            out: self.output,
            pictures: !self.no_pictures,
            strict: self.strict,
            groom,
            anim,
        })
    }
}

fn check_frames(file: &Path, (first, last): (i32, i32), shot: (i32, i32)) -> Result<()> {
    if first >= shot.0 && last <= shot.1 {
        return Ok(());
    }
    Err(Error::BadInput(vec![Problem {
        file: file.into(),
        span: None,
        key: "frames".into(),
        what: format!("--frames asks for {first} to {last}"),
        allowed: format!("{} to {}, the frames of the animation", shot.0, shot.1),
        remedy: "ask for fewer frames, or widen \"frames\" in the file if its track goes further".into(),
    }]))
}

/// Bakes, then reports.
pub fn run(job: Job, quiet: bool) -> Result<()> {
    let Job { groom_file, anim_file, out, pictures, strict, groom, anim } = job;
    let inputs = bake::inputs(&groom_file, &anim_file)?;
    summary::remove_old(&out)?;
    let mut progress = Progress::start(quiet);
    let result = bake::bake(groom, &anim, inputs, &out, |record, done, total| {
        progress.show(record, done, total);
    });
    progress.finish();
    let result = result?;
    let title = anim_file.file_stem().unwrap_or_default().to_string_lossy();
    summary::write(&result, &title, &out, pictures)?;
    if !quiet {
        console::say(&summary::text(&result, &out, pictures));
    }
    if strict { unbroken(&result) } else { Ok(()) }
}

/// # Errors
/// [`Error::Broken`] where a frame breaks a guarantee; it names the first.
fn unbroken(summary: &bake::BakeSummary) -> Result<()> {
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
