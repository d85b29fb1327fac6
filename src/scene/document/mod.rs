//! A JSON input: its value, and every fault found in it with its place in the text.
//!
//! The `serde` structs of a format are its one description. Their JSON Schema (schemars) checks the
//! shape of a file here ([`conform`]), serde then reads it, and the reader of the format adds the faults
//! that only meaning shows. Places in the text are worked out at the end, and only if there is a fault
//! ([`locate`]).

pub mod array;
mod conform;
mod describe;
mod locate;
mod pretty;
mod value;

use super::reading::Reading;
use crate::error::{Diagnostic, Error, Result};
use crate::file::{read_file, write_file};
use nalgebra::{Quaternion, UnitQuaternion};
use schemars::JsonSchema;
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use serde_json::Value;
use std::fmt;
use std::path::{Path, PathBuf};

pub use pretty::pretty;

/// Faults of one kind at one place that are reported one by one.
pub const MAX_NAMED: usize = 8;

/// Longest text that is read, bytes: its value takes many times the memory.
const MAX_TEXT: u64 = 1 << 28;

/// One step of a [`Key`].
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Step {
    /// Property of an object.
    Name(String),
    /// Element of an array.
    Index(usize),
}

/// Where in a file: the way from its root to a value.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Key(pub Vec<Step>);

impl Key {
    /// A path of property names joined by dots.
    pub fn at(path: &str) -> Self {
        Key(path.split('.').map(|name| Step::Name(name.into())).collect())
    }

    /// The property `name` of this place.
    pub fn name(&self, name: &str) -> Self {
        self.with(Step::Name(name.into()))
    }

    /// Element `i` of this place.
    pub fn index(&self, i: usize) -> Self {
        self.with(Step::Index(i))
    }

    fn with(&self, step: Step) -> Self {
        let mut key = self.clone();
        key.0.push(step);
        key
    }

    /// Name of the section of the file it lies in; empty for the root.
    fn section(&self) -> &str {
        match self.0.first() {
            Some(Step::Name(name)) => name,
            _ => "",
        }
    }
}

impl fmt::Display for Key {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (i, step) in self.0.iter().enumerate() {
            match step {
                Step::Name(name) if i == 0 => write!(f, "{name}")?,
                Step::Name(name) => write!(f, ".{name}")?,
                Step::Index(i) => write!(f, "[{i}]")?,
            }
        }
        Ok(())
    }
}

/// A [`Diagnostic`] before its place in the text is known.
#[derive(Debug, Clone, PartialEq)]
struct Fault {
    key: Key,
    what: String,
    allowed: String,
    remedy: String,
}

/// Faults found so far in a file, and problems of the files it names.
#[derive(Debug, Default)]
pub struct Faults {
    list: Vec<Fault>,
    elsewhere: Vec<Diagnostic>,
}

impl Faults {
    /// Adds a fault: where, what is wrong (with the value found), what is allowed, what to do.
    pub fn add(
        &mut self,
        key: &Key,
        what: impl Into<String>,
        allowed: impl Into<String>,
        remedy: impl Into<String>,
    ) {
        self.list.push(Fault {
            key: key.clone(),
            what: what.into(),
            allowed: allowed.into(),
            remedy: remedy.into(),
        });
    }

    /// Adds a fault unless `found` elements are what the place must hold; says whether they are.
    pub fn expect_len(&mut self, key: &Key, found: usize, wanted: usize, one_per: &str) -> bool {
        if found != wanted {
            self.add(
                key,
                format!("holds {found} where {wanted} belong"),
                format!("one per {one_per}: {wanted}"),
                "make the lengths agree",
            );
        }
        found == wanted
    }

    /// The quaternions (w, x, y, z) of the array at `key`, of about unit length, normalised; `None`, with the faults added,
    /// where some are not.
    pub fn unit_quaternions(&mut self, key: &Key, wxyz: &[[f64; 4]]) -> Option<Vec<UnitQuaternion<f64>>> {
        let norm = |q: &[f64; 4]| q.iter().map(|x| x * x).sum::<f64>().sqrt();
        let bad = || wxyz.iter().enumerate().filter(|(_, q)| !(0.9..=1.1).contains(&norm(q)));
        for (i, q) in bad().take(MAX_NAMED) {
            let what = format!("is {q:?}, of length {:.3}", norm(q));
            let allowed = "unit quaternions (w, x, y, z), length 0.9 to 1.1";
            self.add(&key.index(i), what, allowed, "write unit quaternions, w first");
        }
        let unit = |&[w, x, y, z]: &[f64; 4]| UnitQuaternion::from_quaternion(Quaternion::new(w, x, y, z));
        bad().next().is_none().then(|| wxyz.iter().map(unit).collect())
    }

    /// Adds the problems of another file.
    pub fn add_elsewhere(&mut self, problems: Vec<Diagnostic>) {
        self.elsewhere.extend(problems);
    }

    /// Number of faults so far.
    pub fn len(&self) -> usize {
        self.list.len() + self.elsewhere.len()
    }
}

/// A JSON file being read.
pub struct Document {
    path: PathBuf,
    text: Vec<u8>,
    value: Value,
    /// Sections from which a value of a wrong type was left out, to read on.
    mended: Vec<String>,
    /// How many of the faults are about shape.
    shape_faults: usize,
    /// Faults found so far.
    pub faults: Faults,
}

impl Document {
    /// Reads and parses `path`.
    ///
    /// # Errors
    /// [`Error::Io`], or [`Error::BadInput`] where it is not JSON.
    pub fn open(path: &Path) -> Result<Self> {
        let io = |e| Error::io(path, e);
        let length = std::fs::metadata(path).map_err(io)?.len();
        if length > MAX_TEXT {
            let what = format!("holds {length} bytes");
            let remedy = "keep large arrays in a buffer beside it";
            return Err(Diagnostic::new(path, "", what, format!("up to {MAX_TEXT} bytes"), remedy).into());
        }
        let text = read_file(path).map_err(io)?;
        let (value, repeated) = value::parse(&text).map_err(|e| {
            let place = (locate::offset(&text, e.line(), e.column()), 1);
            let problem = Diagnostic::new(
                path,
                "",
                format!("is not JSON: {e}"),
                "strict JSON: no comments, no trailing commas, no NaN or Infinity",
                "mend the place shown, or write the file with a JSON library",
            );
            Error::from(Diagnostic { span: Some(place), ..problem })
        })?;
        let mut faults = Faults::default();
        for key in &repeated {
            faults.add(key, "is given twice", "each key of an object once", "keep one of the two");
        }
        Ok(Document { path: path.into(), text, value, mended: Vec::new(), shape_faults: 0, faults })
    }

    /// Reads and parses a file of a scene, `groom` or `anim`, with what `reading` changes in it. Places in the text are the file's own.
    ///
    /// # Errors
    /// As [`Document::open`], and [`Error::Usage`] where a value has no place in it.
    pub fn open_as(file: &str, path: &Path, reading: &Reading) -> Result<Self> {
        let mut doc = Document::open(path)?;
        reading.change(file, &mut doc.value)?;
        Ok(doc)
    }

    /// The folder that relative file names start from.
    pub fn folder(&self) -> PathBuf {
        self.path.parent().unwrap_or(Path::new("")).to_path_buf()
    }

    /// The value of a string property at the root.
    pub fn text_at(&self, name: &str) -> Option<&str> {
        self.value.get(name)?.as_str()
    }

    /// The two integers of an array at the root.
    pub fn range_at(&self, name: &str) -> Option<(i32, i32)> {
        <[i32; 2]>::deserialize(self.value.get(name)?).ok().map(<(i32, i32)>::from)
    }

    /// The strings that the elements of the root's array `list` have at `place`, a JSON pointer.
    pub fn named(&self, list: &str, place: &str) -> impl Iterator<Item = &str> {
        let elements = self.value.get(list).and_then(Value::as_array).into_iter().flatten();
        elements.filter_map(move |e| e.pointer(place)?.as_str())
    }

    /// Checks the file against the schema of `T` and reads it. All faults of shape are noted; optional
    /// values of a wrong type are left out, so that the reader can go on and find faults of meaning too.
    /// `None` if a required value is wrong or missing.
    pub fn parse<T: DeserializeOwned + JsonSchema>(&mut self) -> Option<T> {
        let schema = schemars::schema_for!(T).to_value();
        for key in conform::check(&self.value, &schema, &mut self.faults) {
            conform::remove(&mut self.value, &key);
            self.mended.push(key.section().into());
        }
        self.shape_faults = self.faults.len();
        match serde_path_to_error::deserialize(std::mem::take(&mut self.value)) {
            Ok(file) => Some(file),
            Err(e) => {
                if self.faults.len() == 0 {
                    let what = e.inner().to_string();
                    self.faults.add(&locate::key(e.path()), what, "see the schema", "correct the value");
                }
                None
            }
        }
    }

    /// The value read, or every fault with its place in the text. Where a value of a wrong type was left
    /// out to read on, what else seems wrong in that section may not be, and is not told; the same holds
    /// for the sections that build on it: `depends` lists `(section, section that it builds on)`.
    pub fn finish<T>(mut self, value: Option<T>, depends: &[(&str, &str)]) -> Result<T> {
        let hidden = |section: &str| {
            self.mended.iter().any(|m| m == section || depends.contains(&(section, m.as_str())))
        };
        let mut faults = std::mem::take(&mut self.faults.list);
        let meaning = faults.split_off(self.shape_faults.min(faults.len()));
        faults.extend(meaning.into_iter().filter(|f| !hidden(f.key.section())));
        let mut problems = locate::problems(&self.path, &self.text, faults);
        problems.extend(self.faults.elsewhere);
        match value {
            Some(value) if problems.is_empty() => Ok(value),
            _ => Err(Error::BadInput(problems)),
        }
    }
}

/// Writes `value` as JSON for people at `path`, whole or not at all.
///
/// # Errors
/// [`Error::Io`].
pub fn write(path: &Path, value: &impl Serialize) -> Result<()> {
    let value = serde_json::to_value(value).map_err(|e| Error::Internal(e.to_string()))?;
    write_file(path, &[pretty(&value)]).map(drop)
}
