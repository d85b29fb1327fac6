//! Python packages that are built into the program, and the interpreter that runs them.
//!
//! They use Pixar's USD library, with all of its composition.

use crate::error::{Error, Result};
use std::io;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::OnceLock;
use tempfile::TempDir;

/// A Python package built into the program.
#[derive(Debug, Clone, Copy)]
pub struct Package {
    /// Name of the package.
    pub name: &'static str,
    /// The modules: file name and source text.
    pub modules: &'static [(&'static str, &'static str)],
}

/// A [`Package`] from a folder of the repository: folder, package, modules.
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

/// A package ready to run. Dropping it removes the unpacked files.
#[derive(Debug)]
pub struct Prepared {
    /// The command that runs the package, without arguments.
    pub command: Command,
    /// The interpreter.
    pub python: PathBuf,
    _folder: TempDir,
}

impl Package {
    /// Unpacks the package into a temporary folder, to run with [`interpreter`].
    ///
    /// # Errors
    /// As [`interpreter`]; [`Error::Io`] if temporary files cannot be written.
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

/// The Python to run: `HAIRBAKE_PYTHON`; else that of the virtual environment in which the program is
/// installed; else `.venv/bin/python` in the current folder or one above it; else `python3`. It is checked
/// once per process.
///
/// # Errors
/// [`Error::Config`] if it does not run or lacks a package.
pub fn interpreter() -> Result<PathBuf> {
    static CHECKED: OnceLock<PathBuf> = OnceLock::new();
    if let Some(python) = CHECKED.get() {
        return Ok(python.clone());
    }
    let python = find_interpreter()?;
    require_usd(&python)?;
    Ok(CHECKED.get_or_init(|| python).clone())
}

fn find_interpreter() -> Result<PathBuf> {
    if let Some(python) = std::env::var_os("HAIRBAKE_PYTHON") {
        return Ok(python.into());
    }
    if let Some(python) = std::env::current_exe().ok().and_then(|program| python_of(&program)) {
        return Ok(python);
    }
    let here = std::env::current_dir().map_err(|e| Error::io(".", e))?;
    let found =
        here.ancestors().map(|folder| folder.join(".venv/bin/python")).find(|python| python.is_file());
    Ok(found.unwrap_or_else(|| "python3".into()))
}

/// The Python of the virtual environment in which `program` is installed.
fn python_of(program: &Path) -> Option<PathBuf> {
    let folder = program.parent()?;
    let in_environment = folder.parent()?.join("pyvenv.cfg").is_file();
    Some(folder.join("python")).filter(|python| in_environment && python.is_file())
}

/// Checks that `python` has usd-core and numpy.
fn require_usd(python: &Path) -> Result<()> {
    let mut probe = Command::new(python);
    // Finding the packages is much faster than importing them.
    probe.args(["-c", "from importlib.util import find_spec as f; exit(not (f('pxr') and f('numpy')))"]);
    probe.stdout(Stdio::null()).stderr(Stdio::null());
    let error = match probe.status() {
        Ok(status) if status.success() => return Ok(()),
        Ok(_) => "does not have usd-core and numpy".to_string(),
        Err(e) => format!("does not run ({e})"),
    };
    Err(Error::Config(format!(
        "{} {error}; reading USD files needs them. Run\n    python3 -m venv .venv && .venv/bin/python -m pip install \
         usd-core numpy\nin this folder, or set HAIRBAKE_PYTHON to a Python that has them",
        python.display()
    )))
}

/// Asserts that `package` holds every module in its `folder`.
#[cfg(test)]
pub(crate) fn assert_complete(folder: &str, package: &Package) {
    let source = Path::new(env!("CARGO_MANIFEST_DIR")).join(folder).join(package.name);
    let names = std::fs::read_dir(source).unwrap().map(|entry| entry.unwrap().file_name());
    let mut names: Vec<_> = names.map(|name| name.into_string().unwrap()).collect();
    names.retain(|name| name.ends_with(".py"));
    names.sort();
    assert_eq!(names, package.modules.iter().map(|(name, _)| *name).collect::<Vec<_>>());
}
