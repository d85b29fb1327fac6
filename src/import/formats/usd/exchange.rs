//! Runs the Python package that reads USD and parses what it returns.

use crate::import::plain::Declared;
use crate::import::source::Source;
use crate::python::{Package, python_package};
use crate::scene::{StageLayer, UpAxis};
use crate::{Diagnostic, Error, Result};
use nalgebra::{Matrix4, Vector3};
use serde::Deserialize;
use serde::de::DeserializeOwned;
use std::path::{Path, PathBuf};
use std::process::Output;

const PACKAGE: Package = python_package!(
    "pipeline",
    "hairbake_usd",
    [
        "__init__.py",
        "__main__.py",
        "curves.py",
        "errors.py",
        "exchange.py",
        "goal.py",
        "groom.py",
        "mesh.py",
        "motion.py",
        "over.py",
        "primvars.py",
        "rest.py",
        "roles.py",
        "stage.py"
    ]
);

/// File of the header.
const HEADER: &str = "header.json";
/// File of the layers that were read.
const LAYERS: &str = "layers.json";

/// Exit code of the package for errors in the file.
const BAD_INPUT: i32 = 2;

/// The header: unit, up axis, notes, a list of arrays in data order, and what is specific to the kind of
/// read.
#[derive(Debug, Deserialize)]
pub(super) struct Header<T> {
    metres_per_unit: Option<f64>,
    up: Option<UpAxis>,
    pub(super) notes: Vec<String>,
    arrays: Vec<ArrayHeader>,
    #[serde(flatten)]
    pub(super) more: T,
}

impl<T> Header<T> {
    /// Unit and up axis that the stage declares.
    pub(super) fn declared(&self) -> Declared {
        Declared { metres_per_unit: self.metres_per_unit, up: self.up }
    }
}

#[derive(Debug, Deserialize)]
struct ArrayHeader {
    name: String,
    #[serde(rename = "type")]
    kind: Kind,
    count: usize,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
enum Kind {
    F32,
    F64,
    I32,
    U32,
}

impl Kind {
    fn bytes(self) -> usize {
        if self == Kind::F64 { 8 } else { 4 }
    }
}

/// What the package writes instead of a header if the file has errors.
#[derive(Debug, Deserialize)]
struct Failure {
    errors: Vec<FileError>,
}

#[derive(Debug, Deserialize)]
struct FileError {
    key: String,
    message: String,
    allowed: String,
    help: String,
    /// The layer that holds it; `None` for the file that is read.
    file: Option<PathBuf>,
    /// Line of its text, from 1.
    line: Option<usize>,
    /// Column, from 1.
    column: usize,
}

impl FileError {
    /// The error as one of `path`, unless it is in another file.
    fn diagnostic(self, path: &Path) -> Diagnostic {
        let file = self.file.as_deref().unwrap_or(path);
        let span = self.line.and_then(|line| Some((offset(file, line, self.column)?, 1)));
        Diagnostic { span, ..Diagnostic::new(file, self.key, self.message, self.allowed, self.help) }
    }
}

/// Byte offset of a place in a text file; `None` if it has no such place.
fn offset(file: &Path, line: usize, column: usize) -> Option<usize> {
    let text = crate::file::read_file(file).ok()?;
    let before: usize =
        text.split_inclusive(|b| *b == b'\n').take(line.checked_sub(1)?).map(<[u8]>::len).sum();
    Some(before + column.checked_sub(1)?).filter(|at| *at < text.len())
}

/// The result of one read.
pub(super) struct Exchange<T> {
    pub(super) header: Header<T>,
    /// Layers that were read.
    pub(super) layers: Vec<StageLayer>,
    /// The header as the package wrote it.
    text: Vec<u8>,
    data: Vec<u8>,
}

impl<T: DeserializeOwned> Exchange<T> {
    /// Runs the package's subcommand `what` on a file, with `options` specific to it.
    ///
    /// # Errors
    /// Every error in the file; [`Error::Config`] without a Python that has usd-core.
    pub(super) fn read(what: &str, source: &Source, options: &[String]) -> Result<Self> {
        let path = &source.path;
        // The system's message for a missing file is clearer than that of the USD library.
        std::fs::File::open(path).map_err(|e| Error::reading(path, e))?;
        let folder = tempfile::tempdir().map_err(|e| Error::io(std::env::temp_dir(), e))?;
        let mut run = PACKAGE.prepare()?;
        run.command.arg(what).arg(path).arg("--out").arg(folder.path()).args(options);
        if let Some(prim) = &source.prim {
            run.command.arg(format!("--prim={prim}"));
        }
        if let Some(time) = source.time {
            run.command.arg(format!("--time={time}"));
        }
        let output = run.command.output().map_err(|e| Error::io(&run.python, e))?;
        match output.status.code() {
            Some(0) => {
                let data = folder.path().join("data.bin");
                let data = crate::file::read_file(&data).map_err(|e| Error::io(&data, e))?;
                let [text, layers] = [HEADER, LAYERS].map(|name| json_text(folder.path(), name));
                let (text, layers) = (text?, parse(&layers?)?);
                Ok(Exchange { header: parse(&text)?, layers, text, data })
            }
            Some(BAD_INPUT) => {
                let Failure { errors } = parse(&json_text(folder.path(), HEADER)?)?;
                Err(Error::BadInput(errors.into_iter().map(|error| error.diagnostic(path)).collect()))
            }
            _ => Err(crash(path, &output)),
        }
    }

    /// Checksum of all that was read.
    pub(super) fn sha256(&self) -> String {
        crate::file::sha256(&[&self.text[..], &self.data].concat())
    }

    /// The numbers of an array, `N` bytes each; `None` if there is no such array.
    fn array<const N: usize, X>(&self, name: &str, kind: Kind, number: fn([u8; N]) -> X) -> Option<Vec<X>> {
        let arrays = &self.header.arrays;
        let index = arrays.iter().position(|a| a.name == name && a.kind == kind)?;
        let start: usize = arrays[..index].iter().map(|a| a.count * a.kind.bytes()).sum();
        let bytes = self.data.get(start..start + arrays[index].count * kind.bytes())?;
        Some(bytes.as_chunks::<N>().0.iter().map(|b| number(*b)).collect())
    }

    pub(super) fn f64s(&self, name: &str) -> Option<Vec<f64>> {
        self.array(name, Kind::F64, f64::from_le_bytes)
    }

    pub(super) fn f32s(&self, name: &str) -> Option<Vec<f32>> {
        self.array(name, Kind::F32, f32::from_le_bytes)
    }

    pub(super) fn u32s(&self, name: &str) -> Option<Vec<u32>> {
        self.array(name, Kind::U32, u32::from_le_bytes)
    }

    pub(super) fn i32s(&self, name: &str) -> Option<Vec<i32>> {
        self.array(name, Kind::I32, i32::from_le_bytes)
    }
}

/// Unwraps an array that the package always writes.
pub(super) fn required<X>(array: Option<X>, name: &str) -> Result<X> {
    array.ok_or_else(|| Error::Internal(format!("the USD reader wrote no array \"{name}\"")))
}

/// Groups numbers by threes.
pub(super) fn points(numbers: &[f64]) -> Vec<Vector3<f64>> {
    numbers.as_chunks().0.iter().map(|&p: &[f64; 3]| p.into()).collect()
}

/// Matrices from rows of numbers.
pub(super) fn matrices(numbers: &[f64]) -> Vec<Matrix4<f64>> {
    numbers.as_chunks::<16>().0.iter().map(|rows| Matrix4::from_row_slice(rows)).collect()
}

fn json_text(folder: &Path, name: &str) -> Result<Vec<u8>> {
    let path = folder.join(name);
    crate::file::read_file(&path).map_err(|e| Error::io(&path, e))
}

fn parse<H: DeserializeOwned>(text: &[u8]) -> Result<H> {
    serde_json::from_slice(text)
        .map_err(|e| Error::Internal(format!("the USD reader wrote invalid JSON: {e}")))
}

fn crash(path: &Path, output: &Output) -> Error {
    let stderr = String::from_utf8_lossy(&output.stderr);
    let last = stderr.trim_end().lines().last().unwrap_or_default();
    Error::Internal(format!("{}: the USD reader failed with {}: {last}", path.display(), output.status))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_package_includes_every_module() {
        crate::python::assert_complete("pipeline", &PACKAGE);
    }
}
