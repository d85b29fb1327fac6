//! `hairbake sample`.

use super::console;
use crate::error::Result;
use crate::sample::{self, FurSize, Size, Style};
use clap::Args;
use std::path::PathBuf;

const EXAMPLES: &str = "\
Examples:
  hairbake sample long-curly -o long-curly
  hairbake long-curly/groom.json long-curly/turn.json -o out
  hairbake sample all -o samples --wisps 64 --strands 512    # all styles, small
  hairbake sample creature -o creature
  hairbake creature/groom.json creature/walk.json -o out";

/// `hairbake sample` as it is typed.
#[derive(Debug, Args)]
#[command(after_help = EXAMPLES)]
pub struct SampleArguments {
    /// Hair style: short, short-curly, long, long-curly, bob, ponytail, braid, coils or buzz; all, each in its own
    /// folder; or creature, a furry quadruped that walks
    #[arg(value_parser = subject)]
    style: Subject,
    /// Folder for groom.json, groom.bin, head.obj, bust.obj, and the motions shake.json, turn.json,
    /// look.json, nod.json and jump.json; of a creature for its meshes and walk.json
    #[arg(long, short, value_name = "DIR")]
    output: PathBuf,
    /// Number of leaf wisps, with one simulated guide each [default: 491 to 821, by the style; 600 guides of
    /// a creature]
    ///
    /// More wisps are finer and slower to bake.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=100_000))]
    wisps: Option<u32>,
    /// Number of render strands [default: 8000; buzz 40000; 30000 of a creature]
    ///
    /// More strands are denser and make the cache larger.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(0..=10_000_000))]
    strands: Option<u32>,
    /// Subdivisions of the meshes of head and bust, 0 to 6 [default: 4]
    ///
    /// Each multiplies the number of triangles by four; 4 gives the head 12,000.
    #[arg(long, value_name = "N", alias = "head-rounds", value_parser = clap::value_parser!(u8).range(0..=6))]
    head_subdivisions: Option<u8>,
}

/// What to write.
#[derive(Debug, Clone, Copy)]
enum Subject {
    Style(Style),
    /// All styles, each in a folder of its own.
    AllStyles,
    Creature,
}

fn subject(name: &str) -> Result<Subject> {
    Ok(match name {
        "all" => Subject::AllStyles,
        "creature" => Subject::Creature,
        _ => Subject::Style(name.parse()?),
    })
}

/// Writes the samples.
pub fn run(arguments: &SampleArguments) -> Result<()> {
    let default = Size::default();
    let size = Size {
        wisps: arguments.wisps.map(|n| n as usize),
        strands: arguments.strands.map(|n| n as usize),
        head_subdivisions: arguments.head_subdivisions.map_or(default.head_subdivisions, usize::from),
    };
    let output = &arguments.output;
    let write = |style: Style, folder: PathBuf| {
        let report = sample::write(style, size, &folder)?;
        console::say(report.to_string().trim_end());
        console::wrote(&folder);
        Ok(())
    };
    match arguments.style {
        Subject::Style(style) => write(style, output.clone()),
        Subject::AllStyles => {
            Style::ALL.into_iter().try_for_each(|style| write(style, output.join(style.to_string())))
        }
        Subject::Creature => {
            let default = FurSize::default();
            let size = FurSize {
                guides: arguments.wisps.map_or(default.guides, |n| n as usize),
                strands: arguments.strands.map_or(default.strands, |n| n as usize),
            };
            let report = sample::write_creature(size, output)?;
            console::say(report.to_string().trim_end());
            console::wrote(output);
            Ok(())
        }
    }
}
