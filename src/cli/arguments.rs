//! The command line as it is typed.

use super::bake::{AssembleArguments, BakeArguments, InterpolateArguments, SimulateArguments};
use super::console::LogFormat;
use super::estimate::EstimateArguments;
use super::import::Import;
use super::plan::PlanArguments;
use super::preview::PreviewArguments;
use super::progress::ProgressStyle;
use super::sample::SampleArguments;
use super::scene::SceneArguments;
use super::status::StatusArguments;
use super::validate::ValidateArguments;
use clap::builder::styling::{AnsiColor, Styles};
use clap::{CommandFactory, Parser, Subcommand, ValueEnum};
use std::ffi::OsString;
use std::path::PathBuf;

const STYLES: Styles = Styles::styled()
    .header(AnsiColor::Green.on_default().bold())
    .usage(AnsiColor::Green.on_default().bold())
    .literal(AnsiColor::Cyan.on_default().bold())
    .placeholder(AnsiColor::Cyan.on_default());

const EXAMPLES: &str = "\
Examples:
  Make a sample, bake it and look at it:
      hairbake sample short -o short
      hairbake short/groom.json short/shake.json -o out
      xdg-open out/sheet.png
  Bring in a groom, its head and a head track, then bake:
      hairbake import groom hair.tfx --units cm --head bust.obj:cm -o shot/groom.json
      hairbake import track walk.json --groom shot/groom.json --collider bust.obj:cm -o shot/anim.json
      hairbake check shot/groom.json shot/anim.json
      hairbake shot/groom.json shot/anim.json -o shot/cache
  Bring in both from USD, and see what the bake will take:
      hairbake import groom asset.usd --prim /char/groom --head asset.usd:/char/body -o shot/groom.json
      hairbake import track shot.usd --prim /char/head --collider shot.usd:/char/body -o shot/anim.json
      hairbake estimate shot/groom.json shot/anim.json -o shot/cache
  Try a few frames first, with half of the steps:
      hairbake shot/groom.json shot/anim.json -o /tmp/try --frames 1001-1012 --substeps 4

Exit codes:
  0 done or up to date   1 a guarantee was broken (--strict)   64 wrong usage   65 bad input   70 internal error
  74 reading or writing failed   75 what an earlier stage makes is not there yet, try again   78 surroundings not set up
  85 stopped as asked (TERM, INT, USR1, --max-runtime), the same command goes on from there";

/// Bakes hair: a groom on a moving head becomes a USD curve cache
///
/// Simulates the guides of a groom as elastic rods on a moving head, keeps them out of the body, interpolates the render strands,
/// and writes one USD file a frame with a root layer, a manifest, a report and a contact sheet.
#[derive(Debug, Parser)]
#[command(
    name = "hairbake",
    version,
    styles = STYLES,
    after_help = EXAMPLES,
    args_conflicts_with_subcommands = true,
    subcommand_negates_reqs = true,
    subcommand_help_heading = "Other commands",
    disable_help_subcommand = true
)]
pub struct Arguments {
    #[command(flatten)]
    pub scene: Option<SceneArguments>,
    #[command(flatten)]
    pub bake: BakeArguments,
    #[command(subcommand)]
    pub command: Option<Command>,
    /// Worker threads; they steer the speed, never the result [default: CUE_THREADS, SLURM_CPUS_PER_TASK, or one a core]
    #[arg(long, global = true, value_name = "N", env = "HAIRBAKE_THREADS", value_parser = threads, help_heading = "General")]
    pub threads: Option<usize>,
    /// How progress is shown: a bar on a terminal, else lines; openjd and alf are what OpenJD and Tractor read
    #[arg(
        long,
        global = true,
        value_enum,
        default_value_t,
        env = "HAIRBAKE_PROGRESS",
        help_heading = "General"
    )]
    pub progress: ProgressStyle,
    /// How messages are written on standard error
    #[arg(
        long,
        global = true,
        value_enum,
        default_value_t,
        env = "HAIRBAKE_LOG_FORMAT",
        help_heading = "General"
    )]
    pub log_format: LogFormat,
    /// Say nothing on standard error but errors
    #[arg(long, short, global = true, help_heading = "General")]
    pub quiet: bool,
}

#[derive(Debug, Subcommand)]
pub enum Command {
    /// Report every fault of grooms and animations, with the place underlined
    Check {
        /// groom.json and anim.json files, in any order
        #[arg(required = true)]
        files: Vec<PathBuf>,
    },
    /// Print the JSON Schema of a file format
    Schema { format: SchemaFormat },
    /// Make groom.json of strands, or anim.json of a head track
    Import {
        #[command(subcommand)]
        what: Import,
    },
    /// Write a sample: a groom on a simple head, with a head-shake and a turn
    Sample(SampleArguments),
    /// Say how long a bake will take, how much disk and memory, and where each setting comes from
    Estimate(Box<EstimateArguments>),
    /// Simulate the guides of a bake, or of a segment of its frames
    Simulate(Box<SimulateArguments>),
    /// Make frames of simulated guides, any of them in any order
    Interpolate(Box<InterpolateArguments>),
    /// End a cache whose frames are all made: root layer, manifest, report
    Assemble(Box<AssembleArguments>),
    /// Print a bake as a job of a render farm, sweeps of parameters included
    Plan(Box<PlanArguments>),
    /// Say what of a bake is done, missing, stale or damaged
    Status(StatusArguments),
    /// Draw pictures of a cache: a contact sheet, an animation
    Preview(PreviewArguments),
    /// Check a cache with Pixar's own USD: files, curves, penetration, motion
    Validate(ValidateArguments),
    /// Print a completion script for a shell
    Completions { shell: clap_complete::Shell },
    /// Print the manual page (roff)
    Man {
        /// Command whose page it is, such as import groom [default: the page of the program]
        command: Vec<String>,
    },
}

#[derive(Debug, Clone, Copy, ValueEnum)]
pub enum SchemaFormat {
    /// groom.json
    Groom,
    /// anim.json
    Anim,
}

/// `words` of a command line with general options that stand before a command put behind its name: what stands before it, clap takes for a
/// part of the one command's own line, which has none.
pub fn general_last(mut words: Vec<OsString>) -> Vec<OsString> {
    let command = Arguments::command();
    let general = |word: &str| {
        let long = word.strip_prefix("--").map(|long| long.split_once('=').map_or(long, |(name, _)| name));
        command.get_arguments().filter(|option| option.is_global_set()).find(|option| match long {
            Some(long) => option.get_long() == Some(long),
            None => {
                option.get_short().is_some_and(|short| word.strip_prefix('-') == Some(&short.to_string()))
            }
        })
    };
    let mut at = 1;
    while let Some(word) = words.get(at).and_then(|word| word.to_str()) {
        let Some(option) = general(word) else { break };
        at += if option.get_action().takes_values() && !word.contains('=') { 2 } else { 1 };
    }
    let name = words.get(at).and_then(|word| word.to_str());
    if name.is_some_and(|name| command.find_subcommand(name).is_some()) {
        words[1..=at].rotate_right(1);
    }
    words
}

fn threads(text: &str) -> Result<usize, String> {
    text.parse().ok().filter(|n| (1..=4096).contains(n)).ok_or_else(|| "a number from 1 to 4096".into())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn general_options_may_stand_before_a_command() {
        let moved = |line: &str| {
            let words = general_last(line.split(' ').map(OsString::from).collect());
            words.join(std::ffi::OsStr::new(" ")).into_string().unwrap()
        };
        for (typed, read) in [
            ("hairbake -q import track a", "hairbake import -q track a"),
            ("hairbake --threads 2 --progress=bar check a", "hairbake check --threads 2 --progress=bar a"),
            ("hairbake check -q a", "hairbake check -q a"),
            ("hairbake -q a.json check -o out", "hairbake -q a.json check -o out"),
            ("hairbake --threads check", "hairbake --threads check"),
            ("hairbake -q", "hairbake -q"),
            ("hairbake --substeps 3 check", "hairbake --substeps 3 check"),
        ] {
            assert_eq!(moved(typed), read);
        }
        assert!(Arguments::try_parse_from(general_last(vec!["".into(), "-q".into(), "man".into()])).is_ok());
    }

    #[test]
    fn the_command_line_is_consistent() {
        Arguments::command().debug_assert();
    }
}
