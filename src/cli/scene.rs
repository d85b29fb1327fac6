//! The scene and the settings of a bake, as every stage of it is told them.

use super::{summary, values};
use crate::bake::base_cache::Only;
use crate::bake::control::Control;
use crate::bake::job::Job;
use crate::cache::MANIFEST;
use crate::error::{Diagnostic, Error, Result};
use crate::scene::anim::{Contact, Resolution, Scheme, Written};
use crate::scene::{Override, PathMap, Reading};
use crate::{bake, scene};
use clap::Args;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

/// What is baked, and how. All stages of a bake have to be told the same.
#[derive(Debug, Args)]
pub struct SceneArguments {
    /// Groom: materials, hierarchy, guides, render strands (groom.json)
    pub groom: PathBuf,
    /// Animation: frames, head track, colliders, wind, settings (anim.json)
    pub anim: PathBuf,
    /// Folder for the cache, the report and the contact sheet; made if need be. A bake that it holds already is gone on with, unless
    /// inputs or settings are others: then it is replaced
    #[arg(long, short, value_name = "OUT", help_heading = "Output")]
    pub output: PathBuf,
    /// Bake these groups of the groom alone, by name, and take all other curves as they are from --base: a part of the hair is done again without
    /// touching what is approved
    #[arg(long, value_name = "NAMES", value_delimiter = ',', requires = "base", help_heading = "Output")]
    groups: Vec<String>,
    /// Finished cache that has the curves --groups leaves: of the same groom but for those groups, head track, range, units and samples
    #[arg(long, value_name = "CACHE", requires = "groups", help_heading = "Output")]
    base: Option<PathBuf>,
    /// Steps of the solver in one frame: more follows quick motion truer, and costs in proportion [default: the anim's, 8]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=10_000), help_heading = SETTINGS)]
    substeps: Option<u32>,
    /// Time simulated before the first frame, s, in which hair settles and comes out of the body: more if it still moves at the
    /// start [default: the anim's, 1]
    #[arg(long, value_name = "S", value_parser = preroll, help_heading = SETTINGS)]
    preroll: Option<f64>,
    /// Strain nodes of guides in grooms without wisps: more bends finer and costs more [default: the anim's, 8]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(2..=256), help_heading = SETTINGS)]
    nodes: Option<u32>,
    /// Time scheme, bdf2 or backward-euler: the second is cheaper in contact, and damps swinging hair more than air and hair do
    /// [default: the anim's, bdf2]
    #[arg(long, value_name = "NAME", value_parser = values::scheme, help_heading = SETTINGS)]
    scheme: Option<Scheme>,
    /// What hair touches, full, bodies or penalty: full is bodies and other hair, and costs more; penalty is bodies by springs, for a quick look,
    /// and guarantees nothing [default: the anim's, bodies]
    #[arg(long, value_name = "NAME", value_parser = values::contact, help_heading = SETTINGS)]
    contact: Option<Contact>,
    /// What moves by itself, adaptive, full or coarse: coarse wisps with what comes away from them where they are stirred, every guide, or
    /// coarse wisps only, for a quick look; auto is full where hair touches hair or --curves is steps, else adaptive [default: the anim's, auto]
    #[arg(long, value_name = "NAME", value_parser = values::resolution, help_heading = SETTINGS)]
    resolution: Option<Resolution>,
    /// Where the resolution is adaptive, the share of its length by which a guide that follows may be off, about, before it comes away: less is more
    /// accurate and slower [default: the anim's, 0.005]
    #[arg(long, value_name = "SHARE", value_parser = values::share, help_heading = SETTINGS)]
    parting: Option<f64>,
    /// Which curves to write, guides, strands or both; or steps: guides, and where the solver brought them between frames [default: the anim's, both]
    #[arg(long, value_name = "NAME", value_parser = values::curves, help_heading = SETTINGS)]
    curves: Option<Written>,
    /// Share of the render strands to write, wider so that they cover as much: level of detail [default: the anim's, 1]
    #[arg(long, value_name = "SHARE", value_parser = values::kept, help_heading = SETTINGS)]
    keep: Option<f64>,
    /// Moments of each frame to write for motion blur, from the frame to the end of the shutter [default: the anim's, 1]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=64), help_heading = SETTINGS)]
    samples: Option<u32>,
    /// How long the shutter is open from a frame on, frames [default: the anim's, 0.5]
    #[arg(long, value_name = "FRAMES", value_parser = values::shutter, help_heading = SETTINGS)]
    shutter: Option<f64>,
    /// Write accelerations too, for renderers that blur motion by them: points, velocities and they are the motion to the end of the shutter
    #[arg(long, help_heading = SETTINGS)]
    accelerations: bool,
    /// Put a value in place of one of the files', such as groom.materials[0].friction=0.3; may be given again
    #[arg(long, value_name = "FILE.KEY=VALUE", value_parser = Override::parse, help_heading = SETTINGS)]
    set: Vec<Override>,
    /// Read what the files name below FROM at TO; may be given again
    #[arg(long, value_name = "FROM=TO", value_parser = values::path_rule, help_heading = "Farm")]
    path_map: Vec<(String, String)>,
    /// Rules of the same kind from a file, as OpenJD writes it for a session [default: HAIRBAKE_PATH_MAP_FILE]
    #[arg(long, value_name = "FILE", help_heading = "Farm")]
    path_map_file: Option<PathBuf>,
}

/// Names the file of path rules where no option does. Were clap to read it, it would take it for a part of the one command's line and ask for
/// the rest of that before every other command.
const PATH_MAP_FILE: &str = "HAIRBAKE_PATH_MAP_FILE";

const SETTINGS: &str = "Settings (over those of the anim)";

fn contact(contact: Contact) -> &'static str {
    match contact {
        Contact::Full => "full",
        Contact::Bodies => "bodies",
        Contact::Penalty => "penalty",
    }
}

fn resolution(resolution: Resolution) -> &'static str {
    match resolution {
        Resolution::Auto => "auto",
        Resolution::Adaptive => "adaptive",
        Resolution::Full => "full",
        Resolution::Coarse => "coarse",
    }
}

fn curves(curves: Written) -> &'static str {
    match curves {
        Written::Guides => "guides",
        Written::Steps => "steps",
        Written::Strands => "strands",
        Written::Both => "both",
    }
}

fn scheme(scheme: Scheme) -> &'static str {
    match scheme {
        Scheme::BackwardEuler => "backward-euler",
        Scheme::Bdf2 => "bdf2",
    }
}

fn preroll(text: &str) -> std::result::Result<f64, String> {
    values::not_negative(text).ok().filter(|s| *s <= 60.0).ok_or_else(|| "0 to 60 s".into())
}

impl SceneArguments {
    /// Reads and checks the scene of `shot`, or of all frames, and puts the command line's settings over the file's.
    ///
    /// # Errors
    /// [`Error::BadInput`], [`Error::Io`]; [`Error::Config`] where a path map cannot be read.
    pub fn load(&self, shot: Option<(i32, i32)>) -> Result<Scene> {
        let mut paths = PathMap(self.path_map.clone());
        let of_session =
            || std::env::var_os(PATH_MAP_FILE).filter(|name| !name.is_empty()).map(PathBuf::from);
        if let Some(file) = self.path_map_file.clone().or_else(of_session) {
            paths.0.extend(PathMap::read(&file)?.0);
        }
        let [groom_file, anim_file, out] =
            [&self.groom, &self.anim, &self.output].map(|path| paths.map_path(path));
        let base = self.base.as_ref().map(|base| paths.map_path(base));
        if base.as_deref().is_some_and(|base| same_folder(base, &out)) {
            let message = "--base is the folder that the bake is written to: give it another with -o";
            return Err(Error::Usage(message.into()));
        }
        let only = base.map(|base| Only { groups: self.groups.clone(), base });
        let reading = Reading { set: self.set.clone(), paths };
        let (groom, mut anim) = scene::load_as(&groom_file, &anim_file, &reading)?;
        if let Some(frames) = shot {
            check_frames(&anim_file, frames, anim.frames)?;
            anim.frames = frames;
        }
        let settings = &mut anim.settings;
        settings.substeps = self.substeps.unwrap_or(settings.substeps);
        settings.preroll = self.preroll.unwrap_or(settings.preroll);
        settings.nodes = self.nodes.unwrap_or(settings.nodes);
        settings.scheme = self.scheme.unwrap_or(settings.scheme);
        settings.contact = self.contact.unwrap_or(settings.contact);
        settings.resolution = self.resolution.unwrap_or(settings.resolution);
        settings.parting = self.parting.unwrap_or(settings.parting);
        settings.curves = self.curves.unwrap_or(settings.curves);
        settings.keep = self.keep.unwrap_or(settings.keep);
        settings.samples = self.samples.unwrap_or(settings.samples);
        settings.shutter = self.shutter.unwrap_or(settings.shutter);
        settings.accelerations |= self.accelerations;
        if settings.curves == Written::Strands && groom.strands.curves.is_empty() {
            let message = "the groom has no render strands to write: ask for --curves guides";
            return Err(Error::Usage(message.into()));
        }
        let frames_only =
            settings.samples > 1 || settings.resolution() != Resolution::Full || self.base.is_some();
        if settings.curves == Written::Steps && frames_only {
            let message = "--curves steps writes the moments of the solver: it goes with --resolution full and one sample a frame, and not with --base";
            return Err(Error::Usage(message.into()));
        }
        Ok(Scene { groom, anim, groom_file, anim_file, reading, only, out })
    }

    /// Begins the bake of `shot`, or of all frames, or goes on with it.
    ///
    /// # Errors
    /// As [`SceneArguments::load`]; those of `fits`, which is asked before anything is written.
    pub fn job(
        &self,
        shot: Option<(i32, i32)>,
        fits: impl FnOnce(&scene::Anim) -> Result<()>,
    ) -> Result<Job> {
        let scene = self.load(shot)?;
        fits(&scene.anim)?;
        let out = scene.out.clone();
        let job = scene.begin(&out)?;
        if !out.join(MANIFEST).exists() {
            summary::remove_old(&out)?;
        }
        Ok(job)
    }

    /// Groom, animation and output folder as absolute paths.
    ///
    /// # Errors
    /// [`Error::Io`] where there is no current folder; [`Error::Usage`] for a path that is no Unicode.
    pub fn absolute(&self) -> Result<[String; 3]> {
        let absolute = |path: &Path| {
            let path = std::path::absolute(path).map_err(|e| Error::io(path, e))?;
            let text = path.to_str().map(String::from);
            text.ok_or_else(|| Error::Usage(format!("{} is not Unicode", path.display())))
        };
        Ok([absolute(&self.groom)?, absolute(&self.anim)?, absolute(&self.output)?])
    }

    /// The settings that options give; empty for what takes no value.
    fn given(&self) -> [(&'static str, Option<String>); 12] {
        [
            ("substeps", self.substeps.map(|n| n.to_string())),
            ("preroll", self.preroll.map(|s| s.to_string())),
            ("nodes", self.nodes.map(|n| n.to_string())),
            ("scheme", self.scheme.map(|s| scheme(s).to_string())),
            ("contact", self.contact.map(|c| contact(c).to_string())),
            ("resolution", self.resolution.map(|r| resolution(r).to_string())),
            ("parting", self.parting.map(|p| p.to_string())),
            ("curves", self.curves.map(|c| curves(c).to_string())),
            ("keep", self.keep.map(|share| share.to_string())),
            ("samples", self.samples.map(|n| n.to_string())),
            ("shutter", self.shutter.map(|frames| frames.to_string())),
            ("accelerations", self.accelerations.then(String::new)),
        ]
    }

    /// Every setting of a scene, with its value and where that comes from: an option, a value put in place, the file, or the default.
    ///
    /// # Errors
    /// [`Error::Io`] where the animation is there no more.
    pub fn settings_explained(&self, of: &Scene) -> Result<Vec<(String, String, String)>> {
        let bytes = crate::file::read_file(&of.anim_file).map_err(|e| Error::io(&of.anim_file, e))?;
        let file: serde_json::Value = serde_json::from_slice(&bytes).unwrap_or_default();
        let settings = &of.anim.settings;
        let resolved = [
            ("substeps", settings.substeps.to_string()),
            ("preroll_s", settings.preroll.to_string()),
            ("nodes", settings.nodes.to_string()),
            ("scheme", scheme(settings.scheme).to_string()),
            ("contact", contact(settings.contact).to_string()),
            ("resolution", resolution(settings.resolution()).to_string()),
            ("parting", settings.parting.to_string()),
            ("curves", curves(settings.curves).to_string()),
            ("keep", settings.keep.to_string()),
            ("samples", settings.samples.to_string()),
            ("shutter", settings.shutter.to_string()),
            ("accelerations", settings.accelerations.to_string()),
        ];
        let mut rows: Vec<_> = resolved
            .into_iter()
            .zip(self.given())
            .map(|((key, value), (option, given))| {
                let set = self.set.iter().any(|o| o.name() == format!("anim.settings.{key}"));
                let origin = match () {
                    () if given.is_some() => format!("--{option}"),
                    () if set => "--set".into(),
                    () if file["settings"].get(key).is_some() => of.anim_file.display().to_string(),
                    () => "default".into(),
                };
                (option.to_string(), value, origin)
            })
            .collect();
        let others = self.set.iter().filter(|o| !o.name().starts_with("anim.settings."));
        rows.extend(others.map(|o| (o.name(), o.value.to_string(), "--set".into())));
        if let Some(only) = &of.only {
            rows.push(("groups".into(), only.groups.join(", "), "--groups".into()));
            rows.push(("base".into(), only.base.display().to_string(), "--base".into()));
        }
        Ok(rows)
    }

    /// The options that say the same settings again.
    pub fn settings(&self) -> Vec<String> {
        let base = self.base.iter().map(|base| ["--base".to_string(), base.display().to_string()]);
        let groups =
            Some(["--groups".to_string(), self.groups.join(",")]).filter(|_| !self.groups.is_empty());
        let options =
            self.given().into_iter().filter_map(|(name, value)| Some((format!("--{name}"), value?)));
        let options = options.flat_map(|(name, value)| [Some(name), Some(value).filter(|v| !v.is_empty())]);
        let set = self.set.iter().map(|o| ["--set".to_string(), format!("{}={}", o.name(), o.value)]);
        let map = self.path_map.iter().map(|(from, to)| ["--path-map".to_string(), format!("{from}={to}")]);
        options.flatten().chain(groups.into_iter().chain(base).chain(set).chain(map).flatten()).collect()
    }

    /// Name of the shot, for the report.
    pub fn title(&self) -> String {
        self.anim.file_stem().unwrap_or_default().to_string_lossy().into_owned()
    }
}

/// A scene that was read, and where from.
pub struct Scene {
    /// The groom.
    pub groom: scene::Groom,
    /// The animation, with the settings of the bake.
    pub anim: scene::Anim,
    groom_file: PathBuf,
    anim_file: PathBuf,
    reading: Reading,
    only: Option<Only>,
    out: PathBuf,
}

impl Scene {
    /// Begins the bake in a folder, or goes on with it.
    ///
    /// # Errors
    /// [`Error::Io`].
    pub fn begin(self, out: &Path) -> Result<Job> {
        let Scene { groom, anim, groom_file, anim_file, reading, only, .. } = self;
        let inputs = bake::inputs(&groom_file, &anim_file, &reading)?;
        Job::begin(groom, anim, inputs, &reading.set, only.as_ref(), out)
    }
}

/// Whether two paths are of one folder that is there.
fn same_folder(a: &Path, b: &Path) -> bool {
    a.canonicalize().is_ok_and(|a| b.canonicalize().is_ok_and(|b| a == b))
}

fn check_frames(file: &Path, (first, last): (i32, i32), shot: (i32, i32)) -> Result<()> {
    if first >= shot.0 && last <= shot.1 {
        return Ok(());
    }
    Err(Error::BadInput(vec![Diagnostic {
        file: file.into(),
        span: None,
        key: "frames".into(),
        message: format!("--frames asks for {first} to {last}"),
        allowed: format!("{} to {}, the frames of the animation", shot.0, shot.1),
        help: "ask for fewer frames, or widen \"frames\" in the file if its track goes further".into(),
    }]))
}

/// When a stage saves, and when it stops by itself.
#[derive(Debug, Args)]
pub struct RunArguments {
    /// Save and stop after this time with exit code 85: seconds, or 90m, 1h30m
    #[arg(long, value_name = "TIME", value_parser = values::duration, env = "HAIRBAKE_MAX_RUNTIME", help_heading = "Farm")]
    max_runtime: Option<Duration>,
    /// Time between checkpoints, s: what is lost at most if the process is killed; 0 for none
    #[arg(long, value_name = "S", value_parser = values::not_negative, default_value_t = 30.0, env = "HAIRBAKE_CHECKPOINT_SECONDS", help_heading = "Farm")]
    checkpoint_seconds: f64,
    /// A checkpoint at every frame that is a multiple of this too
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..), help_heading = "Farm")]
    checkpoint_frames: Option<u32>,
}

impl RunArguments {
    /// What is asked of the stage, the system's signals from now on included.
    ///
    /// # Errors
    /// [`Error::Config`] where the system lets no signals be caught.
    pub fn control(&self) -> Result<Control> {
        let every = Some(self.checkpoint_seconds).filter(|s| *s > 0.0);
        let control = Control {
            until: self.max_runtime.map(|time| Instant::now() + time),
            every: every.and_then(|s| Duration::try_from_secs_f64(s).ok()),
            every_frames: self.checkpoint_frames,
            ..Control::default()
        };
        super::signals::listen(&control.stop, &control.save)?;
        Ok(control)
    }
}
