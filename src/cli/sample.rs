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
  hairbake sample all -o samples --wisps 64 --strands 512    # all four styles, small";

/// `hairbake sample` as it is typed.
#[derive(Debug, Args)]
#[command(after_help = EXAMPLES)]
pub struct SampleArguments {
    /// Hair style: short, short-curly, long or long-curly; or all, each in its own folder
    #[arg(value_parser = styles)]
    style: Styles,
    /// Folder for groom.json, groom.bin, head.obj, shake.json and turn.json
    #[arg(long, short, value_name = "DIR")]
    output: PathBuf,
    /// Number of leaf wisps, with one simulated guide each [default: 491 to 821, depending on the style]
    ///
    /// More wisps are finer and slower to bake.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=100_000))]
    wisps: Option<u32>,
    /// Number of render strands [default: 8000]
    ///
    /// More strands are denser and make the cache larger.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(0..=10_000_000))]
    strands: Option<u32>,
    /// Subdivisions of the head mesh, 0 to 7 [default: 4]
    ///
    /// Each multiplies the number of triangles by four.
    #[arg(long, value_name = "N", alias = "head-rounds", value_parser = clap::value_parser!(u8).range(0..=7))]
    head_subdivisions: Option<u8>,
}

/// The styles to write.
#[derive(Debug, Clone)]
struct Styles {
    styles: Vec<Style>,
    /// Whether each style gets a folder of its own.
    in_folders: bool,
}

fn styles(name: &str) -> Result<Styles> {
    Ok(match name {
        "all" => Styles { styles: Style::ALL.to_vec(), in_folders: true },
        _ => Styles { styles: vec![name.parse()?], in_folders: false },
    })
}

/// Writes the samples.
pub fn run(arguments: &SampleArguments) -> Result<()> {
    let default = Size::default();
    let size = Size {
        wisps: arguments.wisps.map(|n| n as usize),
        strands: arguments.strands.map_or(default.strands, |n| n as usize),
        head_subdivisions: arguments.head_subdivisions.map_or(default.head_subdivisions, usize::from),
    };
    let Styles { styles, in_folders } = &arguments.style;
    for style in styles {
        let output = &arguments.output;
        let folder = if *in_folders { output.join(style.to_string()) } else { output.clone() };
        let report = sample::write(*style, size, &folder)?;
        console::say(report.to_string().trim_end());
        console::wrote(&folder);
    }
    Ok(())
}
