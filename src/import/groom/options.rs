//! What to import as a groom.

use super::build::BuildOptions;
use crate::geometry::TriMesh;
use crate::import::source::Source;
use crate::{Error, Result};
use std::path::PathBuf;

/// By default all strands become guides if the file has at most this many.
pub const ALL_GUIDES_UP_TO: usize = 1000;
/// Default number of guides chosen from a larger file.
pub const DEFAULT_GUIDES: usize = 500;

/// What [`groom`](super::convert::groom) imports.
#[derive(Debug, Clone, PartialEq)]
pub struct GroomOptions {
    /// Name of the groom.
    pub name: String,
    /// Folder in which the groom will be written; the path of its origin is relative to it.
    pub folder: PathBuf,
    /// The strands from which guides are chosen. They become render strands unless they are guides only.
    pub guides: Source,
    /// A separate file of render strands.
    pub strands: Option<Source>,
    /// The scalp, m, rest space: used to report root positions and to place the roots of generated strands.
    pub scalp: Option<TriMesh>,
    /// Factor on the length of all strands; their shape is scaled about the root.
    pub length_scale: f64,
    /// Number of guides to choose; `None` for the guides that the file marks, else all of up to
    /// [`ALL_GUIDES_UP_TO`] strands, or [`DEFAULT_GUIDES`] of more.
    pub guide_count: Option<usize>,
    /// Render strands to grow around each guide, in place of any in the files; `None` to grow
    /// `build.generation.per_guide` if the files hold guides only.
    pub strands_per_guide: Option<usize>,
    /// How the groom is built.
    pub build: BuildOptions,
}

impl GroomOptions {
    /// The defaults for a strand file; the groom is named after it.
    pub fn new(guides: Source) -> Self {
        let name = guides.path.file_stem().map_or_else(String::new, |s| s.to_string_lossy().into_owned());
        GroomOptions {
            name,
            folder: PathBuf::new(),
            guides,
            strands: None,
            scalp: None,
            length_scale: 1.0,
            guide_count: None,
            strands_per_guide: None,
            build: BuildOptions::default(),
        }
    }

    /// Whether strands are to be grown even if the files hold some.
    pub(super) fn grows(&self) -> bool {
        self.strands_per_guide.is_some_and(|n| n > 0)
    }

    /// Checks the ranges of all options.
    ///
    /// # Errors
    /// [`Error::Usage`].
    pub(super) fn check(&self) -> Result<()> {
        self.build.check()?;
        if self.grows() && self.strands.is_some() {
            return Err(Error::Usage(
                "--strands-per-guide grows strands, and --strands names a file that holds them; use one of the two"
                    .into(),
            ));
        }
        if self.guide_count == Some(0) {
            return Err(Error::Usage("the number of guides must be at least 1".into()));
        }
        if !(1e-3..=1e3).contains(&self.length_scale) {
            return Err(Error::Usage("the length scale must be 0.001 to 1000".into()));
        }
        Ok(())
    }
}
