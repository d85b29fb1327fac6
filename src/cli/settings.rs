//! The settings of a bake as options, which override those of the animation.

use super::values;
use crate::scene::anim::{ContactSetting, OutputCurves, Resolution, Scheme, Settings};
use crate::scene::{Anim, Override};
use clap::{Args, ValueEnum};

const HEADING: &str = "Settings (override those of ANIM)";

/// The settings as they are typed.
#[derive(Debug, Args)]
pub struct SettingsArguments {
    /// Solver steps per frame, 1 to 10000 [default: 8]
    ///
    /// More steps follow fast motion more accurately. The cost grows in proportion.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=10_000), help_heading = HEADING)]
    substeps: Option<u32>,
    /// Time simulated before the first frame, in seconds [default: 1]
    ///
    /// From 0 to 60. The hair settles and moves out of the bodies in this time. Raise it if hair still moves
    /// at the start. Frames of mesh sequences are read from there on; `import track` writes those of one
    /// second before the first frame.
    #[arg(long, value_name = "SECONDS", value_parser = values::preroll, help_heading = HEADING)]
    preroll: Option<f64>,
    /// Strain nodes per guide, for grooms without wisps [default: 8]
    ///
    /// From 2 to 256. More nodes resolve finer bends and cost more.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(2..=256), help_heading = HEADING)]
    nodes: Option<u32>,
    /// Time integration scheme [default: four-step]
    #[arg(long, value_name = "NAME", value_enum, help_heading = HEADING)]
    scheme: Option<Scheme>,
    /// What the hair collides with [default: volume]
    #[arg(long, value_name = "NAME", value_enum, help_heading = HEADING)]
    contact: Option<ContactSetting>,
    /// Which guides are simulated [default: auto]
    #[arg(long, value_name = "NAME", value_enum, help_heading = HEADING)]
    resolution: Option<Resolution>,
    /// Error at which a guide splits from its wisp, as a fraction of guide length [default: 0.01]
    ///
    /// The error is estimated. From 0 to 1, for adaptive resolution only. Raising it is faster and less
    /// accurate.
    #[arg(long, value_name = "FRACTION", alias = "parting", value_parser = values::fraction, help_heading = HEADING)]
    split_tolerance: Option<f64>,
    /// Curves to write [default: both]
    #[arg(long, value_name = "NAME", value_enum, help_heading = HEADING)]
    curves: Option<OutputCurves>,
    /// Fraction of the render strands to write, up to 1 [default: 1]
    ///
    /// Level of detail: lowering it makes the cache smaller. The remaining strands are widened to cover as
    /// much.
    #[arg(long, value_name = "FRACTION", value_parser = values::positive_fraction, help_heading = HEADING)]
    keep: Option<f64>,
    /// Motion-blur samples per frame, 1 to 64 [default: 1]
    ///
    /// The samples are spread evenly from the frame to the end of the shutter. More samples follow curved
    /// motion more closely and make the cache larger in proportion.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=64), help_heading = HEADING)]
    samples: Option<u32>,
    /// Shutter time after the frame, in frames, 0.001 to 0.999 [default: 0.5]
    ///
    /// Raising it blurs more.
    #[arg(long, value_name = "FRAMES", value_parser = values::shutter, help_heading = HEADING)]
    shutter: Option<f64>,
    /// Write accelerations as well
    ///
    /// Points, velocities and accelerations then give the motion up to the end of the shutter, for renderers
    /// that blur by them.
    #[arg(long, help_heading = HEADING)]
    accelerations: bool,
    /// Write the normals of the guides as well
    ///
    /// The first axis of the section at each point, which with the tangent gives the material frame. Not with
    /// --curves strands.
    #[arg(long, help_heading = HEADING)]
    normals: bool,
    /// Write the forces and moments that hold the guides as well
    ///
    /// The force and moment of the clamp of each guide, and the force of each tie, in newtons and newton
    /// metres. All guides are stepped for it, unless --resolution asks for less: those that follow a wisp
    /// have none. Not with --curves strands or --base.
    #[arg(long, help_heading = HEADING)]
    reactions: bool,
    /// Override a value of an input file; may be repeated
    ///
    /// FILE is groom or anim, as in groom.materials[0].friction=0.3.
    #[arg(long, value_name = "FILE.KEY=VALUE", value_parser = Override::parse, help_heading = HEADING)]
    set: Vec<Override>,
}

/// A setting by its names.
struct Setting {
    option: &'static str,
    /// Key in the `settings` of an animation.
    key: &'static str,
    /// The value that the option gives; empty for an option that takes none.
    given: Option<String>,
    /// The value of the bake.
    value: String,
}

/// A value of the bake and its origin: an option, a variable, a file or the default.
pub struct Explained {
    /// Name of the setting.
    pub name: String,
    /// Its value.
    pub value: String,
    /// Where the value comes from.
    pub origin: String,
}

impl SettingsArguments {
    /// The overrides of values in the input files.
    pub fn overrides(&self) -> &[Override] {
        &self.set
    }

    /// Values that the files of the scene are read with: those overrides, and the pre-roll, for which frames
    /// of meshes are read.
    pub fn overrides_for_reading(&self) -> Vec<Override> {
        let preroll =
            self.preroll.and_then(|s| Override::parse(&format!("anim.settings.preroll_s={s}")).ok());
        self.set.iter().cloned().chain(preroll).collect()
    }

    /// Puts the options over `settings`.
    pub fn apply(&self, settings: &mut Settings) {
        settings.substeps = self.substeps.unwrap_or(settings.substeps);
        settings.preroll = self.preroll.unwrap_or(settings.preroll);
        settings.nodes = self.nodes.unwrap_or(settings.nodes);
        settings.scheme = self.scheme.unwrap_or(settings.scheme);
        settings.contact = self.contact.unwrap_or(settings.contact);
        settings.resolution = self.resolution.unwrap_or(settings.resolution);
        settings.split_tolerance = self.split_tolerance.unwrap_or(settings.split_tolerance);
        settings.curves = self.curves.unwrap_or(settings.curves);
        settings.keep = self.keep.unwrap_or(settings.keep);
        settings.samples = self.samples.unwrap_or(settings.samples);
        settings.shutter = self.shutter.unwrap_or(settings.shutter);
        settings.accelerations |= self.accelerations;
        settings.normals |= self.normals;
        settings.reactions |= self.reactions;
    }

    /// Every setting, with its value in `settings`, where `resolution` comes of it.
    fn each(&self, settings: &Settings, resolution: Resolution) -> [Setting; 14] {
        fn of(
            option: &'static str,
            key: &'static str,
            given: Option<impl ToString>,
            value: impl ToString,
        ) -> Setting {
            Setting { option, key, given: given.map(|value| value.to_string()), value: value.to_string() }
        }
        fn named<T: ValueEnum>(option: &'static str, given: Option<&T>, value: &T) -> Setting {
            of(option, option, given.map(values::name), values::name(value))
        }
        [
            of("substeps", "substeps", self.substeps, settings.substeps),
            of("preroll", "preroll_s", self.preroll, settings.preroll),
            of("nodes", "nodes", self.nodes, settings.nodes),
            named("scheme", self.scheme.as_ref(), &settings.scheme),
            named("contact", self.contact.as_ref(), &settings.contact),
            named("resolution", self.resolution.as_ref(), &resolution),
            of("split-tolerance", "split_tolerance", self.split_tolerance, settings.split_tolerance),
            named("curves", self.curves.as_ref(), &settings.curves),
            of("keep", "keep", self.keep, settings.keep),
            of("samples", "samples", self.samples, settings.samples),
            of("shutter", "shutter", self.shutter, settings.shutter),
            of("accelerations", "accelerations", self.accelerations.then_some(""), settings.accelerations),
            of("normals", "normals", self.normals.then_some(""), settings.normals),
            of("reactions", "reactions", self.reactions.then_some(""), settings.reactions),
        ]
    }

    /// Every setting with its value in `anim` and its origin; `in_file` tells whether the animation
    /// `file` has a key.
    pub fn explained(&self, anim: &Anim, file: &str, in_file: impl Fn(&str) -> bool) -> Vec<Explained> {
        let overridden = |key: &str| self.set.iter().any(|o| o.name() == format!("anim.settings.{key}"));
        let setting = |setting: Setting| {
            let Setting { option, key, given, value } = setting;
            let origin = match given {
                Some(_) => format!("--{option}"),
                None if overridden(key) => "--set".into(),
                None if in_file(key) => file.into(),
                None => "default".into(),
            };
            Explained { name: option.into(), value, origin }
        };
        let others = self.set.iter().filter(|o| !o.name().starts_with("anim.settings."));
        let others =
            others.map(|o| Explained { name: o.name(), value: o.value.to_string(), origin: "--set".into() });
        self.each(&anim.settings, anim.resolution()).into_iter().map(setting).chain(others).collect()
    }

    /// The options that give the same settings again.
    pub fn to_words(&self) -> Vec<String> {
        let mut words = Vec::new();
        for Setting { option, given, .. } in self.each(&Settings::default(), Resolution::Auto) {
            let Some(value) = given else { continue };
            words.push(format!("--{option}"));
            words.extend(Some(value).filter(|value| !value.is_empty()));
        }
        for o in &self.set {
            words.extend(["--set".into(), format!("{}={}", o.name(), o.value)]);
        }
        words
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::Parser;

    #[derive(Parser)]
    struct Line {
        #[command(flatten)]
        settings: SettingsArguments,
    }

    fn parsed(words: &[&str]) -> SettingsArguments {
        Line::try_parse_from([&["hairbake"], words].concat()).unwrap().settings
    }

    #[test]
    fn settings_turn_into_the_options_they_came_from() {
        let words =
            ["--substeps", "3", "--scheme", "backward-euler", "--accelerations", "--reactions", "--set"];
        let words = [&words[..], &["groom.a=1"]].concat();
        assert_eq!(parsed(&words).to_words(), words);
    }

    #[test]
    fn the_former_name_of_the_split_tolerance_works() {
        let mut settings = Settings::default();
        parsed(&["--parting", "0.25"]).apply(&mut settings);
        assert_eq!(settings.split_tolerance, 0.25);
        assert_eq!(parsed(&["--parting", "0.25"]).to_words(), ["--split-tolerance", "0.25"]);
    }

    #[test]
    fn the_help_states_the_defaults() {
        use clap::CommandFactory;
        let command = Line::command();
        let each = parsed(&[]).each(&Settings::default(), Resolution::Auto);
        let flags = ["accelerations", "normals", "reactions"];
        for Setting { option, value, .. } in each.into_iter().filter(|s| !flags.contains(&s.option)) {
            let argument = command.get_arguments().find(|a| a.get_long() == Some(option)).unwrap();
            let help = argument.get_help().unwrap().to_string();
            assert!(help.ends_with(&format!("[default: {value}]")), "{option}: {help}");
        }
    }
}
