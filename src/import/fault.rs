//! All faults of one input, gathered before any is reported.

use crate::{Error, Problem, Result};
use std::path::{Path, PathBuf};

/// The faults found so far in one file.
pub(super) struct Faults {
    file: PathBuf,
    found: Vec<Problem>,
}

impl Faults {
    pub(super) fn of(file: &Path) -> Self {
        Faults { file: file.to_path_buf(), found: Vec::new() }
    }

    pub(super) fn push(
        &mut self,
        key: impl Into<String>,
        what: impl Into<String>,
        allowed: impl Into<String>,
        remedy: impl Into<String>,
    ) {
        self.found.push(Problem {
            file: self.file.clone(),
            span: None,
            key: key.into(),
            what: what.into(),
            allowed: allowed.into(),
            remedy: remedy.into(),
        });
    }

    /// `Ok` if there are none.
    pub(super) fn check(self) -> Result<()> {
        if self.found.is_empty() { Ok(()) } else { Err(self.into_error()) }
    }

    /// The faults as one error.
    pub(super) fn into_error(self) -> Error {
        Error::BadInput(self.found)
    }
}
