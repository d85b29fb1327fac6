//! One error in an input file, for people to correct.

use std::path::{Path, PathBuf};

/// One error in an input: where it is, what is wrong, and how to correct it.
#[derive(Debug, Clone, PartialEq)]
pub struct Diagnostic {
    /// The file that holds the error.
    pub file: PathBuf,
    /// Byte offset and length of the wrong text in `file`; `None` for a binary file or the file as a whole.
    pub span: Option<(usize, usize)>,
    /// Path of the key, such as `bodies[0].track.rotation_wxyz[17]`; empty for the file as a whole.
    pub key: String,
    /// What is wrong, with the value found.
    pub message: String,
    /// The values allowed, with their unit.
    pub allowed: String,
    /// What to do about it, in the imperative.
    pub help: String,
}

impl Diagnostic {
    /// A diagnostic of `file` without a place in its text.
    pub fn new(
        file: &Path,
        key: impl Into<String>,
        message: impl Into<String>,
        allowed: impl Into<String>,
        help: impl Into<String>,
    ) -> Self {
        Diagnostic {
            file: file.to_path_buf(),
            span: None,
            key: key.into(),
            message: message.into(),
            allowed: allowed.into(),
            help: help.into(),
        }
    }
}
