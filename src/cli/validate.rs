//! `hairbake validate`: runs the Python validator, which is built into the program.

use super::frame_list::{FrameList, frame_list};
use crate::error::{Error, Result};
use crate::python::{Package, python_package};
use clap::{Args, ValueEnum};
use std::path::PathBuf;
use std::process::ExitCode;

const EXAMPLES: &str = "\
Examples:
  hairbake validate out
  hairbake validate out --quick --json report.json

Python:
  The validator needs Python with usd-core and numpy:
    python3 -m venv .venv && .venv/bin/python -m pip install usd-core numpy
  hairbake runs the Python in HAIRBAKE_PYTHON; else that of the virtual environment in
  which it is installed; else .venv/bin/python in this folder
  or one above it; else python3.

Exit codes:
   0  all checks passed
   1  a check failed
  65  not a readable cache
  78  no Python with usd-core and numpy";

/// `hairbake validate` as it is typed.
#[derive(Debug, Args)]
#[command(after_help = EXAMPLES)]
pub struct ValidateArguments {
    /// Folder of the cache
    cache: PathBuf,
    /// Write the report as JSON: status, worst value, tolerance, frame, prim and curve of each check
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
    /// Check the curves of these frames only, such as 1001-1010 or 1001-1100x5 [default: all]
    ///
    /// Files, metadata and checksums are checked in full.
    #[arg(long, value_name = "LIST", value_parser = frame_list, allow_hyphen_values = true)]
    frames: Option<FrameList>,
    /// Run one part of the checks only [default: both]
    ///
    /// On a farm, run static once and moving for each range of frames.
    #[arg(long, value_enum, value_name = "PART")]
    only: Option<Part>,
    /// Compare guides with the goals of the animation that the cache was baked from
    #[arg(long, value_name = "ANIM")]
    goals: Option<PathBuf>,
    /// Check the curves of five frames only, and no checksums
    #[arg(long)]
    quick: bool,
}

/// A part of the checks.
#[derive(Debug, Clone, Copy, ValueEnum)]
enum Part {
    /// Files, metadata, topology and checksums
    Static,
    /// Curves of the frames
    Moving,
}

const VALIDATOR: Package = python_package!(
    "validation",
    "hairbake_validate",
    [
        "__init__.py",
        "__main__.py",
        "cache.py",
        "checks_clips.py",
        "checks_deform.py",
        "checks_files.py",
        "checks_frame.py",
        "checks_goals.py",
        "checks_motion.py",
        "checks_normals.py",
        "checks_over.py",
        "checks_placement.py",
        "checks_stage.py",
        "checks_topology.py",
        "collider.py",
        "crossing_check.py",
        "crossings.py",
        "deforms.py",
        "geometry.py",
        "overs.py",
        "pinches.py",
        "report.py",
        "run.py",
        "skins.py",
        "tolerances.py",
        "window.py"
    ]
);

/// Runs the validator and returns its result as exit code.
pub fn run(arguments: &ValidateArguments) -> Result<ExitCode> {
    let mut run = VALIDATOR.prepare()?;
    let command = &mut run.command;
    command.arg(&arguments.cache);
    if let Some(file) = &arguments.json {
        command.arg("--json").arg(file);
    }
    if let Some(list) = &arguments.frames {
        command.arg(format!("--frames={}", list.text));
    }
    if let Some(part) = arguments.only {
        command.arg(match part {
            Part::Static => "--only=static",
            Part::Moving => "--only=moving",
        });
    }
    if let Some(anim) = &arguments.goals {
        command.arg("--goals").arg(anim);
    }
    if arguments.quick {
        command.arg("--quick");
    }
    command.arg("--jobs").arg(rayon::current_num_threads().to_string());
    let status = command.status().map_err(|e| Error::io(&run.python, e))?;
    match status.code() {
        Some(code @ (0 | 1)) => Ok(ExitCode::from(code as u8)),
        // The validator has printed the reason.
        Some(2) => Ok(ExitCode::from(Error::BadInput(Vec::new()).exit_code())),
        _ => Err(Error::Internal(format!("the validator failed with {status}"))),
    }
}

#[cfg(test)]
mod tests {
    #[test]
    fn every_module_of_the_validator_is_built_in() {
        crate::python::assert_complete("validation", &super::VALIDATOR);
    }
}
