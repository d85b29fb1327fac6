//! Programs in Python that are part of this one: Pixar's USD is at hand there, composition and all.

use crate::error::{Error, Result};
use std::io;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::OnceLock;
use tempfile::TempDir;

/// A Python package that is built into the program.
#[derive(Debug, Clone, Copy)]
pub struct Package {
    /// Its name.
    pub name: &'static str,
    /// Its modules: file name and text.
    pub modules: &'static [(&'static str, &'static str)],
}

/// The package in a folder of the repository, with the modules that are named.
macro_rules! python_package {
    ($folder:literal, $package:literal, [$($module:literal),+ $(,)?]) => {
        $crate::python::Package {
            name: $package,
            modules: &[$((
                $module,
                include_str!(concat!(env!("CARGO_MANIFEST_DIR"), "/", $folder, "/", $package, "/", $module)),
            )),+],
        }
    };
}

pub(crate) use python_package;

/// A package that is about to run. Its files are gone when this is dropped.
#[derive(Debug)]
pub struct Prepared {
    /// Runs it; the arguments are still to be given.
    pub command: Command,
    /// The interpreter, for messages.
    pub python: PathBuf,
    _folder: TempDir,
}

impl Package {
    /// Unpacks the package for the interpreter that [`interpreter`] finds.
    ///
    /// # Errors
    /// As [`interpreter`]; [`Error::Io`] where there is no room for temporary files.
    pub fn prepare(&self) -> Result<Prepared> {
        let python = interpreter()?;
        let fail = |e: io::Error| Error::io(std::env::temp_dir(), e);
        let folder = tempfile::tempdir().map_err(fail)?;
        let package = folder.path().join(self.name);
        std::fs::create_dir(&package).map_err(fail)?;
        for (name, text) in self.modules {
            std::fs::write(package.join(name), text).map_err(fail)?;
        }
        let mut command = Command::new(&python);
        command.args(["-m", self.name]);
        command.env("PYTHONPATH", folder.path()).env("PYTHONDONTWRITEBYTECODE", "1");
        Ok(Prepared { command, python, _folder: folder })
    }
}

/// The Python to run: `HAIRBAKE_PYTHON`; else `.venv/bin/python` of the current folder or one above it; else `python3`. It is tried
/// once.
///
/// # Errors
/// [`Error::Config`] where it cannot be run or lacks a package.
pub fn interpreter() -> Result<PathBuf> {
    static SOUND: OnceLock<PathBuf> = OnceLock::new();
    if let Some(python) = SOUND.get() {
        return Ok(python.clone());
    }
    let python = named_or_found()?;
    need_usd(&python)?;
    Ok(SOUND.get_or_init(|| python).clone())
}

fn named_or_found() -> Result<PathBuf> {
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
    // To look for them is much quicker than to import them.
    probe.args(["-c", "from importlib.util import find_spec as f; exit(not (f('pxr') and f('numpy')))"]);
    probe.stdout(Stdio::null()).stderr(Stdio::null());
    let fault = match probe.status() {
        Ok(status) if status.success() => return Ok(()),
        Ok(_) => "has no usd-core and numpy".to_string(),
        Err(e) => format!("cannot be run ({e})"),
    };
    Err(Error::Config(format!(
        "{} {fault}; they read USD files. Either run\n    python3 -m venv .venv && .venv/bin/python -m pip install usd-core \
         numpy\nin this folder, or name a Python that has them in HAIRBAKE_PYTHON",
        python.display()
    )))
}

/// Holds, for tests, that `package` has every module of its `folder`.
#[cfg(test)]
pub(crate) fn assert_whole(folder: &str, package: &Package) {
    let source = Path::new(env!("CARGO_MANIFEST_DIR")).join(folder).join(package.name);
    let names = std::fs::read_dir(source).unwrap().map(|entry| entry.unwrap().file_name());
    let mut names: Vec<_> = names.map(|name| name.into_string().unwrap()).collect();
    names.retain(|name| name.ends_with(".py"));
    names.sort();
    assert_eq!(names, package.modules.iter().map(|(name, _)| *name).collect::<Vec<_>>());
}
