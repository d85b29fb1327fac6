//! A file to import and how to place it in rest space.

use crate::scene::UpAxis;
use crate::{Error, Result};
use nalgebra::Vector3;
use std::path::{Path, PathBuf};

/// A file to import and how to place it in rest space: metres, Y up, where the head was modelled.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Source {
    /// The file.
    pub path: PathBuf,
    /// Metres per unit of the file; `None` to take the file's own unit, or guess it.
    pub metres_per_unit: Option<f64>,
    /// Up axis; `None` to take the file's own, or the format's default (Z for .hair, else Y).
    pub up: Option<UpAxis>,
    /// USD only: path of the prim to read, with its descendants; `None` for the whole stage.
    pub prim: Option<String>,
    /// USD only: time code to read at; `None` for the rest pose, or the earliest time code without one.
    pub time: Option<f64>,
    /// Translation of every point after conversion, m, Y up.
    pub offset: Vector3<f64>,
}

impl Source {
    /// A file with its own or a guessed unit, not translated.
    pub fn new(path: impl Into<PathBuf>) -> Self {
        Source { path: path.into(), ..Source::default() }
    }

    /// The file name's extension in lower case.
    pub(super) fn extension(&self) -> Option<String> {
        self.path.extension()?.to_str().map(str::to_ascii_lowercase)
    }

    /// Whether the file is USD, by its extension.
    pub(super) fn is_usd(&self) -> bool {
        matches!(self.extension().as_deref(), Some("usd" | "usda" | "usdc" | "usdz"))
    }

    /// Whether the file is glTF, by its extension.
    pub(super) fn is_gltf(&self) -> bool {
        matches!(self.extension().as_deref(), Some("gltf" | "glb"))
    }

    /// Checks that `prim` and `time` are set for USD files only.
    ///
    /// # Errors
    /// [`Error::Usage`].
    pub(super) fn check(&self) -> Result<()> {
        if self.is_usd() || (self.prim.is_none() && self.time.is_none()) {
            return Ok(());
        }
        Err(Error::Usage(format!(
            "{}: a prim or time code needs a USD file (.usd, .usda, .usdc or .usdz)",
            self.path.display()
        )))
    }

    /// The folder that holds the file.
    pub(super) fn folder(&self) -> &Path {
        self.path.parent().unwrap_or(Path::new(""))
    }

    /// The file's bytes.
    ///
    /// # Errors
    /// [`Error::BadInput`] if there is no such file, [`Error::Io`].
    pub(super) fn read(&self) -> Result<Vec<u8>> {
        crate::file::read_file(&self.path).map_err(|e| Error::reading(&self.path, e))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn usd_is_recognised_by_extension() {
        for (name, is) in
            [("a.usd", true), ("a.USDA", true), ("a.usdc", true), ("a.usdz", true), ("usd", false)]
        {
            assert_eq!(Source::new(name).is_usd(), is, "{name}");
        }
    }

    #[test]
    fn prims_and_time_codes_need_usd() {
        let with_prim = |name: &str| Source { prim: Some("/a".into()), ..Source::new(name) };
        assert!(with_prim("a.usdc").check().is_ok() && Source::new("a.tfx").check().is_ok());
        assert!(matches!(with_prim("a.tfx").check(), Err(Error::Usage(_))));
        let with_time = Source { time: Some(1.0), ..Source::new("a.obj") };
        assert!(matches!(with_time.check(), Err(Error::Usage(_))));
    }
}
