//! `hairbake validate`: runs the Python validator, which is part of the program.

use super::values::{self, FrameList};
use crate::error::{Error, Result};
use clap::{Args, ValueEnum};
use std::io;
use std::path::{Path, PathBuf};
use std::process::{Command, ExitCode, Stdio};

const EXAMPLES: &str = "\
Examples:
  hairbake validate out
  hairbake validate out --quick --json report.json

Python: HAIRBAKE_PYTHON names the interpreter; else .venv/bin/python of this folder or one above it is taken, else python3. It
needs usd-core and numpy: python3 -m venv .venv && .venv/bin/python -m pip install usd-core numpy

Exit code: 0 all checks passed, 1 a check failed, 65 no readable cache, 78 no Python with usd-core.";

#[derive(Debug, Args)]
#[command(after_help = EXAMPLES)]
pub struct ValidateArguments {
    /// Folder of the cache
    cache: PathBuf,
    /// Write the report as JSON: status, worst value, tolerance, frame, prim and curve of every check
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
    /// Look at the curves of these frames only, such as 1001-1010 or 1001-1100x5; files, metadata and checksums are checked in full
    #[arg(long, value_name = "LIST", value_parser = values::frame_list, allow_hyphen_values = true)]
    frames: Option<FrameList>,
    /// Do one part of the checks only, so that a farm can divide the frames and do the rest once
    #[arg(long, value_enum)]
    only: Option<Part>,
    /// Look at the curves of five frames at the start, middle and end, and at no checksum
    #[arg(long)]
    quick: bool,
}

/// A part of the checks.
#[derive(Debug, Clone, Copy, ValueEnum)]
enum Part {
    /// Files, metadata, topology and checksums
    Static,
    /// The curves of frames
    Moving,
}

/// The validator, file by file.
macro_rules! modules {
    ($($name:literal),+ $(,)?) => {
        [$(($name, include_str!(concat!("../../validation/hairbake_validate/", $name)))),+]
    };
}

const MODULES: [(&str, &str); 14] = modules![
    "__init__.py",
    "__main__.py",
    "cache.py",
    "checks_frame.py",
    "checks_motion.py",
    "checks_static.py",
    "collider.py",
    "crossing_check.py",
    "crossings.py",
    "geometry.py",
    "report.py",
    "run.py",
    "tolerances.py",
    "window.py",
];

/// Runs the validator; its own exit code says how it went.
pub fn run(arguments: &ValidateArguments) -> Result<ExitCode> {
    let python = interpreter()?;
    need_usd(&python)?;
    let folder = unpack()?;
    let mut command = Command::new(&python);
    command.args(["-m", "hairbake_validate"]).arg(&arguments.cache);
    command.env("PYTHONPATH", folder.path()).env("PYTHONDONTWRITEBYTECODE", "1");
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
    if arguments.quick {
        command.arg("--quick");
    }
    command.arg("--jobs").arg(rayon::current_num_threads().to_string());
    let status = command.status().map_err(|e| Error::io(&python, e))?;
    match status.code() {
        Some(code @ (0 | 1)) => Ok(ExitCode::from(code as u8)),
        // It has said which file it could not read.
        Some(2) => Ok(ExitCode::from(Error::BadInput(Vec::new()).exit_code())),
        _ => Err(Error::Internal(format!("the validator ended with {status}"))),
    }
}

/// The Python to run.
fn interpreter() -> Result<PathBuf> {
    if let Some(named) = std::env::var_os("HAIRBAKE_PYTHON") {
        return Ok(named.into());
    }
    let here = std::env::current_dir().map_err(|e| Error::io(".", e))?;
    let found =
        here.ancestors().map(|folder| folder.join(".venv/bin/python")).find(|python| python.is_file());
    Ok(found.unwrap_or_else(|| "python3".into()))
}

/// Makes sure that the packages are there, for a clear word if they are not.
fn need_usd(python: &Path) -> Result<()> {
    let mut probe = Command::new(python);
    probe.args(["-c", "import pxr.Usd, numpy"]).stdout(Stdio::null()).stderr(Stdio::null());
    let fault = match probe.status() {
        Ok(status) if status.success() => return Ok(()),
        Ok(_) => "has no usd-core and numpy".to_string(),
        Err(e) => format!("cannot be run ({e})"),
    };
    Err(Error::Config(format!(
        "{} {fault}; they check a cache. Either run\n    python3 -m venv .venv && .venv/bin/python -m pip install usd-core \
         numpy\nin this folder, or name a Python that has them in HAIRBAKE_PYTHON",
        python.display()
    )))
}

/// The validator as a package in a folder that goes when dropped.
fn unpack() -> Result<tempfile::TempDir> {
    let fail = |e: io::Error| Error::io(std::env::temp_dir(), e);
    let folder = tempfile::tempdir().map_err(fail)?;
    let package = folder.path().join("hairbake_validate");
    std::fs::create_dir(&package).map_err(fail)?;
    for (name, text) in MODULES {
        std::fs::write(package.join(name), text).map_err(fail)?;
    }
    Ok(folder)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_module_of_the_validator_is_missing() {
        let source = Path::new(env!("CARGO_MANIFEST_DIR")).join("validation/hairbake_validate");
        let names = std::fs::read_dir(source).unwrap().map(|entry| entry.unwrap().file_name());
        let mut names: Vec<_> = names.map(|name| name.into_string().unwrap()).collect();
        names.retain(|name| name.ends_with(".py"));
        names.sort();
        assert_eq!(names, MODULES.map(|(name, _)| name));
    }
}
