//! The library's one error type and its exit codes.

mod render;

pub use render::render;

use std::path::{Path, PathBuf};

/// One fault found in an input, with all a person needs to mend it.
#[derive(Debug, Clone, PartialEq)]
pub struct Problem {
    /// The file at fault.
    pub file: PathBuf,
    /// Byte offset and length of the offending place in `file`, where it has one (text files).
    pub span: Option<(usize, usize)>,
    /// Path of the key, such as `bodies[0].track.rotation_wxyz[17]`; empty for the file as a whole.
    pub key: String,
    /// What is wrong, naming the value found.
    pub what: String,
    /// What is allowed, with units.
    pub allowed: String,
    /// What to do about it.
    pub remedy: String,
}

impl Problem {
    /// A problem of `file` with no place in a text.
    pub fn new(
        file: &Path,
        key: impl Into<String>,
        what: impl Into<String>,
        allowed: impl Into<String>,
        remedy: impl Into<String>,
    ) -> Self {
        Problem {
            file: file.to_path_buf(),
            span: None,
            key: key.into(),
            what: what.into(),
            allowed: allowed.into(),
            remedy: remedy.into(),
        }
    }
}

/// Why a command failed.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// The command line does not make sense.
    #[error("{0}")]
    Usage(String),
    /// One or more inputs are wrong; all faults found, none written.
    #[error("{} in the input", plural(.0.len(), "error"))]
    BadInput(Vec<Problem>),
    /// Reading or writing failed.
    #[error("{}: {source}", path.display())]
    Io {
        /// The file or folder.
        path: PathBuf,
        /// The system's own word.
        source: std::io::Error,
    },
    /// A cache is there but its bytes are not what they should be.
    #[error("{}: {what}", path.display())]
    Damaged {
        /// The file.
        path: PathBuf,
        /// What is wrong with it.
        what: String,
    },
    /// What an earlier stage makes is not there yet; the same command may succeed later.
    #[error("{0}")]
    NotYet(String),
    /// The surroundings are not set up for this: an environment variable, a path map, a missing program.
    #[error("{0}")]
    Config(String),
    /// Asked to stop, it stopped where the same command goes on.
    #[error("{0}")]
    Stopped(String),
    /// A bake is written, but a guarantee was broken (`--strict`).
    #[error("{0}")]
    Broken(String),
    /// The simulation could not go on (a solve that does not converge at any step size), or a bug.
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

    /// `Ok` if there are no `problems`.
    ///
    /// # Errors
    /// [`Error::BadInput`] with all of them.
    pub fn unless_none(problems: Vec<Problem>) -> Result<()> {
        if problems.is_empty() { Ok(()) } else { Err(Error::BadInput(problems)) }
    }

    /// The process exit code: 1 broken guarantee, 64 usage, 65 bad input, 70 internal, 74 I/O, 75 try again later,
    /// 78 configuration, 85 stopped, run again to go on.
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

impl From<Problem> for Error {
    fn from(problem: Problem) -> Self {
        Error::BadInput(vec![problem])
    }
}

fn plural(n: usize, word: &str) -> String {
    if n == 1 { format!("1 {word}") } else { format!("{n} {word}s") }
}
