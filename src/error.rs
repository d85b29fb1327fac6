//! The library's error type, its exit codes, and diagnostics of input files.

mod diagnostic;
mod render;

pub use diagnostic::Diagnostic;
pub use render::render;

use std::path::{Path, PathBuf};

/// Why a command failed.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// The command line is wrong.
    #[error("{0}")]
    Usage(String),
    /// One or more inputs are wrong. Holds every error found; nothing was written.
    #[error("{} in the input", plural(.0.len(), "error"))]
    BadInput(Vec<Diagnostic>),
    /// Reading or writing failed.
    #[error("{}: {source}", path.display())]
    Io {
        /// The file or folder.
        path: PathBuf,
        /// The error of the operating system.
        source: std::io::Error,
    },
    /// A file of a cache is corrupt.
    #[error("{}: {what}", path.display())]
    Damaged {
        /// The file.
        path: PathBuf,
        /// What is wrong with it.
        what: String,
    },
    /// The output of an earlier stage is missing; the same command may succeed later.
    #[error("{0}")]
    NotYet(String),
    /// The environment is not set up: an environment variable, a path map, a missing program.
    #[error("{0}")]
    Config(String),
    /// Stopped on request; the same command resumes.
    #[error("{0}")]
    Stopped(String),
    /// The bake is written but breaks a guarantee (`--strict`).
    #[error("{0}")]
    Broken(String),
    /// The simulation failed (a solve does not converge at any step size), or a bug.
    #[error("{0}")]
    Internal(String),
}

/// Result with the library's [`Error`].
pub type Result<T> = std::result::Result<T, Error>;

impl Error {
    /// An I/O error at `path`.
    pub fn io(path: impl AsRef<Path>, source: std::io::Error) -> Self {
        Error::Io { path: path.as_ref().to_path_buf(), source }
    }

    /// The error of a file to be read: a path that leads to no file is bad input, and trying again does not
    /// help; any other failure is one of I/O.
    pub fn reading(path: impl AsRef<Path>, source: std::io::Error) -> Self {
        use std::io::ErrorKind::{InvalidFilename, IsADirectory, NotADirectory, NotFound};
        match source.kind() {
            NotFound | NotADirectory | IsADirectory | InvalidFilename => {
                let path = path.as_ref();
                let what =
                    if path.is_dir() { "this is a folder, not a file" } else { "no such file or folder" };
                Diagnostic::new(path, "", what, "a path that exists", "correct the path").into()
            }
            _ => Error::io(path, source),
        }
    }

    /// `Ok` if `diagnostics` is empty.
    ///
    /// # Errors
    /// [`Error::BadInput`] with all of them.
    pub fn if_any(diagnostics: Vec<Diagnostic>) -> Result<()> {
        if diagnostics.is_empty() { Ok(()) } else { Err(Error::BadInput(diagnostics)) }
    }

    /// The process exit code: 1 broken guarantee, then as in `sysexits.h`: 64 usage, 65 bad input, 70
    /// internal, 74 I/O, 75 try again later, 78 configuration; 85 stopped, run again to resume.
    pub fn exit_code(&self) -> u8 {
        match self {
            Error::Broken(_) => 1,
            Error::Usage(_) => 64,
            Error::BadInput(_) | Error::Damaged { .. } => 65,
            Error::Internal(_) => 70,
            Error::Io { .. } => 74,
            Error::NotYet(_) => 75,
            Error::Config(_) => 78,
            Error::Stopped(_) => 85,
        }
    }
}

impl From<Diagnostic> for Error {
    fn from(diagnostic: Diagnostic) -> Self {
        Error::BadInput(vec![diagnostic])
    }
}

fn plural(n: usize, word: &str) -> String {
    if n == 1 { format!("1 {word}") } else { format!("{n} {word}s") }
}
