//! `hairbake status`: which frames of a bake are done.

use super::console;
use crate::bake::checked_file::FileFault;
use crate::bake::work_dir::WorkDir;
use crate::cache::MANIFEST;
use crate::error::{Error, Result};
use clap::Args;
use rayon::prelude::*;
use serde_json::{Value, json};
use std::path::PathBuf;

const EXAMPLES: &str = "\
Examples:
  hairbake status out
  hairbake status out --checksums --json

Exit codes:
   0  the bake is complete
  75  the bake is incomplete";

/// `hairbake status` as it is typed.
#[derive(Debug, Args)]
#[command(after_help = EXAMPLES)]
pub struct StatusArguments {
    /// Folder of the cache
    cache: PathBuf,
    /// Read every frame file and compare its checksum
    ///
    /// Without this option only the length of a file is compared.
    #[arg(long)]
    checksums: bool,
    /// Print JSON: lists of the frames that are done, missing, stale or damaged
    #[arg(long)]
    json: bool,
}

/// The kinds of frames, in the order of [`kind`].
const KINDS: [&str; 4] = ["done", "missing", "stale", "damaged"];

/// Prints which frames are done, missing, stale or damaged.
///
/// # Errors
/// [`Error::NotYet`] if the bake is incomplete.
pub fn run(arguments: &StatusArguments) -> Result<()> {
    std::fs::metadata(&arguments.cache).map_err(|e| Error::reading(&arguments.cache, e))?;
    let (work, description) = WorkDir::open(&arguments.cache)?;
    let (first, last) = description.frames;
    let frames: Vec<i32> = (first..=last).collect();
    let state = |frame: i32| work.state(frame).map(drop);
    let file = |frame: i32| match arguments.checksums {
        true => work.done(frame).map(drop),
        false => work.marked(frame).map(drop),
    };
    let assembled = arguments.cache.join(MANIFEST).exists();
    let (states, files) = (Frames::sort(&frames, state), Frames::sort(&frames, file));
    if arguments.json {
        let status = json!({
            "key": description.key, "frames": description.frames, "states": states.to_json(), "files": files.to_json(),
            "assembled": assembled,
        });
        console::data(format!("{status:#}\n").as_bytes())?;
    } else {
        let end = if assembled { "assembled" } else { "not assembled" };
        let rows = [("simulated", states.to_string()), ("written", files.to_string()), ("cache", end.into())];
        let text = rows.map(|(name, value)| format!("{name:<12}{value}\n"));
        console::data(text.concat().as_bytes())?;
    }
    match assembled && files.0[0].len() == frames.len() {
        true => Ok(()),
        false => Err(Error::NotYet(format!("{}: the bake is incomplete", arguments.cache.display()))),
    }
}

/// Frames by kind.
struct Frames([Vec<i32>; KINDS.len()]);

impl Frames {
    /// Sorts `frames` by what `check` finds.
    fn sort(frames: &[i32], check: impl Fn(i32) -> std::result::Result<(), FileFault> + Sync) -> Self {
        let kinds: Vec<usize> = frames.par_iter().map(|frame| kind(&check(*frame))).collect();
        let of =
            |k: usize| frames.iter().zip(&kinds).filter(|(_, kind)| **kind == k).map(|(f, _)| *f).collect();
        Frames(std::array::from_fn(of))
    }

    fn to_json(&self) -> Value {
        KINDS.iter().zip(&self.0).map(|(kind, frames)| ((*kind).to_string(), json!(frames))).collect()
    }
}

impl std::fmt::Display for Frames {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let kinds = KINDS.iter().zip(&self.0).filter(|(_, frames)| !frames.is_empty());
        let kinds = kinds.map(|(kind, frames)| format!("{} {kind} ({})", frames.len(), ranges(frames)));
        f.write_str(&kinds.collect::<Vec<_>>().join(", "))
    }
}

/// Index into [`KINDS`].
fn kind(found: &std::result::Result<(), FileFault>) -> usize {
    match found {
        Ok(()) => 0,
        Err(FileFault::Missing) => 1,
        Err(FileFault::Stale) => 2,
        Err(FileFault::Damaged(_)) => 3,
    }
}

/// Formats frames in ascending order as ranges: `1001-1010,1015`.
fn ranges(frames: &[i32]) -> String {
    let parts = frames.chunk_by(|a, b| a + 1 == *b).map(|run| match run {
        [one] => one.to_string(),
        _ => format!("{}-{}", run[0], run[run.len() - 1]),
    });
    parts.collect::<Vec<_>>().join(",")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_are_listed_as_ranges() {
        assert_eq!(ranges(&[1, 2, 3, 7, 9, 10]), "1-3,7,9-10");
        assert_eq!(ranges(&[-2, -1, 5]), "-2--1,5");
        assert_eq!(ranges(&[]), "");
    }
}
