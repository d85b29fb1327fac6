//! The commands and the general options.

use super::bake::BakeArguments;
use super::check::CheckArguments;
use super::console::LogFormat;
use super::estimate::EstimateArguments;
use super::grow::GrowArguments;
use super::import::Import;
use super::plan::PlanArguments;
use super::preview::PreviewArguments;
use super::progress::ProgressStyle;
use super::read::ReadArguments;
use super::sample::SampleArguments;
use super::schema::SchemaFormat;
use super::stages::{AssembleArguments, InterpolateArguments, SimulateArguments};
use super::status::StatusArguments;
use super::validate::ValidateArguments;
use super::view::ViewArguments;
use clap::{Args, Parser, Subcommand};

/// Bake hair: turn a groom and a moving head into a USD curve cache
///
/// Simulates the guides of a groom as elastic rods on a moving head, keeps them out of the body, interpolates
/// the render strands, and writes one USD file per frame with a root layer, a manifest, a report and a
/// contact sheet.
#[derive(Debug, Parser)]
#[command(name = "hairbake", version)]
pub struct Arguments {
    #[command(subcommand)]
    pub command: Command,
    #[command(flatten)]
    pub general: GeneralArguments,
}

/// The options that every command accepts.
#[derive(Debug, Args)]
pub struct GeneralArguments {
    /// Number of worker threads; changes speed, never results [default: CUE_THREADS, SLURM_CPUS_PER_TASK, or
    /// one per core]
    #[arg(long, global = true, value_name = "N", env = "HAIRBAKE_THREADS", value_parser = threads)]
    pub threads: Option<usize>,
    /// How to report progress on standard error
    #[arg(long, global = true, value_enum, value_name = "STYLE", default_value_t, env = "HAIRBAKE_PROGRESS")]
    pub progress: ProgressStyle,
    /// Format of the messages on standard error
    #[arg(
        long,
        global = true,
        value_enum,
        value_name = "FORMAT",
        default_value_t,
        env = "HAIRBAKE_LOG_FORMAT"
    )]
    pub log_format: LogFormat,
    /// Print nothing but errors on standard error
    #[arg(long, short, global = true)]
    pub quiet: bool,
}

/// The commands, in the order of the help.
#[derive(Debug, Subcommand)]
pub enum Command {
    /// Write a sample: groom, head mesh and two motions
    Sample(SampleArguments),
    /// Convert strands to groom.json, or a head motion to anim.json
    #[command(disable_help_subcommand = true)]
    Import {
        #[command(subcommand)]
        what: Import,
    },
    /// Grow fur on a mesh and write it as groom.json
    Grow(Box<GrowArguments>),
    /// Report every error in groom.json and anim.json files
    Check(Box<CheckArguments>),
    /// Print the JSON Schema of groom.json or anim.json
    Schema {
        /// The file format
        format: SchemaFormat,
    },
    /// Predict the time, disk space and memory of a bake
    Estimate(Box<EstimateArguments>),
    /// Bake a shot; this is the default, and `bake` may be omitted
    Bake(Box<BakeArguments>),
    /// Draw a contact sheet or an animation of a cache
    Preview(PreviewArguments),
    /// Open the report of a cache in a browser, where it plays
    View(ViewArguments),
    /// Print what a cache holds, or write one of its arrays for NumPy
    Read(ReadArguments),
    /// List which frames of a bake are done, missing, stale or damaged
    Status(StatusArguments),
    /// Check a cache with Pixar's USD library
    Validate(ValidateArguments),
    /// Print a bake as a job for OpenJD, Slurm or another scheduler
    Plan(Box<PlanArguments>),
    /// Simulate the guides, all frames or one segment
    Simulate(Box<SimulateArguments>),
    /// Write the files of simulated frames, in any order
    Interpolate(Box<InterpolateArguments>),
    /// Finish a cache: root layer, manifest and report
    Assemble(Box<AssembleArguments>),
    /// Print a completion script for a shell
    Completions {
        /// The shell
        shell: clap_complete::Shell,
    },
    /// Print a manual page in roff format
    Man {
        /// Command to print the page of, such as import groom [default: the program]
        command: Vec<String>,
    },
}

fn threads(text: &str) -> Result<usize, String> {
    text.parse().ok().filter(|n| (1..=4096).contains(n)).ok_or_else(|| "expected 1 to 4096".into())
}
