//! `hairbake sample`.

use super::console;
use crate::error::Result;
use crate::sample::{self, Size, Style};
use clap::Args;
use std::path::PathBuf;

const EXAMPLES: &str = "\
Examples:
  hairbake sample long-curly -o long-curly
  hairbake long-curly/groom.json long-curly/turn.json -o out
  hairbake sample all -o samples --wisps 64 --strands 512     # all four styles, small";

#[derive(Debug, Args)]
#[command(after_help = EXAMPLES)]
pub struct SampleArguments {
    /// short, short-curly, long or long-curly; or all, each in a folder of its own
    #[arg(value_parser = styles)]
    style: Styles,
    /// Folder for groom.json, groom.bin, head.obj, shake.json and turn.json
    #[arg(long, short, value_name = "DIR")]
    output: PathBuf,
    /// Leaf wisps, one simulated guide each: more is finer and slower [default: as in the paper's table, 491 to 821]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=100_000))]
    wisps: Option<u32>,
    /// Render strands: more is denser and larger on disk [default: 8000]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(0..=10_000_000))]
    strands: Option<u32>,
    /// Rounds of division of the head mesh, each with four times the triangles [default: 4]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u8).range(0..=7))]
    head_rounds: Option<u8>,
}

/// The styles asked for, and whether each gets a folder of its own.
#[derive(Debug, Clone)]
struct Styles(Vec<Style>, bool);

fn styles(name: &str) -> Result<Styles> {
    Ok(if name == "all" { Styles(Style::ALL.to_vec(), true) } else { Styles(vec![name.parse()?], false) })
}

/// Writes the samples asked for.
pub fn run(arguments: &SampleArguments) -> Result<()> {
    let usual = Size::default();
    let size = Size {
        wisps: arguments.wisps.map(|n| n as usize),
        strands: arguments.strands.map_or(usual.strands, |n| n as usize),
        head_subdivisions: arguments.head_rounds.map_or(usual.head_subdivisions, usize::from),
    };
    let Styles(styles, apart) = &arguments.style;
    for style in styles {
        let folder = if *apart { arguments.output.join(style.to_string()) } else { arguments.output.clone() };
        let report = sample::write(*style, size, &folder)?;
        console::say(&format!("{}\nwritten: {}", report.to_string().trim_end(), folder.display()));
    }
    Ok(())
}
