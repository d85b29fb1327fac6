//! `hairbake status`: what of a bake is done.

use super::console;
use crate::bake::checked_file::Flaw;
use crate::bake::work_dir::Work;
use crate::cache::MANIFEST;
use crate::error::{Error, Result};
use clap::Args;
use rayon::prelude::*;
use serde_json::json;
use std::path::PathBuf;

/// The question as it is typed.
#[derive(Debug, Args)]
pub struct StatusArguments {
    /// Folder of the cache
    cache: PathBuf,
    /// Read every frame and hold its checksum against its mark; else its mark is believed
    #[arg(long)]
    checksums: bool,
    /// Print JSON: for states and files the frames that are done, missing, stale or damaged
    #[arg(long)]
    json: bool,
}

/// Says what is done, missing, stale or damaged. Done is all but one thing: it ends with an error that says to try again.
pub fn run(arguments: &StatusArguments) -> Result<()> {
    let (work, description) = Work::open(&arguments.cache)?;
    let (first, last) = description.frames;
    let frames: Vec<i32> = (first..=last).collect();
    let state = |frame: &i32| work.state(*frame).map(drop);
    let file = |frame: &i32| match arguments.checksums {
        true => work.done(*frame).map(drop),
        false => work.marked(*frame).map(drop),
    };
    let finished = arguments.cache.join(MANIFEST).exists();
    let states: Vec<_> = frames.par_iter().map(state).collect();
    let files: Vec<_> = frames.par_iter().map(file).collect();
    let kinds = ["done", "missing", "stale", "damaged"];
    let sorted = |found: &[std::result::Result<(), Flaw>]| {
        let of = |kind: &str| -> Vec<i32> {
            let is = |found: &std::result::Result<(), Flaw>| match found {
                Ok(()) => "done",
                Err(Flaw::Missing) => "missing",
                Err(Flaw::Stale) => "stale",
                Err(Flaw::Damaged(_)) => "damaged",
            };
            frames.iter().zip(found).filter(|(_, found)| is(found) == kind).map(|(frame, _)| *frame).collect()
        };
        kinds.map(|kind| (kind, of(kind)))
    };
    let (states, files) = (sorted(&states), sorted(&files));
    if arguments.json {
        let object = |sorted: &[(&str, Vec<i32>)]| -> serde_json::Value {
            sorted.iter().map(|(kind, frames)| ((*kind).to_string(), json!(frames))).collect()
        };
        let status = json!({
            "key": description.key, "frames": description.frames, "states": object(&states), "files": object(&files),
            "assembled": finished,
        });
        console::data(format!("{status:#}\n").as_bytes())?;
    } else {
        let line = |name: &str, sorted: &[(&str, Vec<i32>)]| {
            let parts = sorted.iter().filter(|(_, frames)| !frames.is_empty());
            let parts: Vec<String> =
                parts.map(|(kind, frames)| format!("{} {kind} ({})", frames.len(), ranges(frames))).collect();
            format!("{name:<12}{}\n", parts.join(", "))
        };
        let end = if finished { "assembled" } else { "not assembled" };
        let text = [line("simulated", &states), line("frames", &files), format!("{:<12}{end}\n", "cache")];
        console::data(text.concat().as_bytes())?;
    }
    let whole = finished && files[0].1.len() == frames.len();
    if whole { Ok(()) } else { Err(Error::NotYet(format!("{}: not done", arguments.cache.display()))) }
}

/// Frames in ascending order as ranges: `1001-1010,1015`.
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
    fn frames_are_told_in_ranges() {
        assert_eq!(ranges(&[1, 2, 3, 7, 9, 10]), "1-3,7,9-10");
        assert_eq!(ranges(&[-2, -1, 5]), "-2--1,5");
        assert_eq!(ranges(&[]), "");
    }
}
