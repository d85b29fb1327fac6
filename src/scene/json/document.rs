//! A JSON file being read.

use super::diagnostics::Diagnostics;
use super::key::Key;
use super::schema::schema_of;
use super::{former_names, locate, parse, schema_check};
use crate::error::{Diagnostic, Error, Result};
use crate::file::read_file;
use schemars::JsonSchema;
use serde::Deserialize;
use serde::de::DeserializeOwned;
use serde_json::Value;
use std::path::{Path, PathBuf};

/// Largest file that is read, bytes: the parsed value takes many times the memory.
const MAX_BYTES: u64 = 1 << 28;

/// A JSON file being read: its text, its value, and the errors found so far.
pub struct Document {
    path: PathBuf,
    text: Vec<u8>,
    value: Value,
    /// Keys found under a former name: current key, key in the file.
    renamed: Vec<(Key, Key)>,
    /// Sections from which [`Document::deserialize`] removed a value of a wrong type.
    incomplete: Vec<String>,
    /// Number of `diagnostics` up to the end of the schema check.
    schema_errors: usize,
    /// Errors found so far.
    pub diagnostics: Diagnostics,
}

impl Document {
    /// Reads and parses `path`.
    ///
    /// # Errors
    /// [`Error::BadInput`] if there is no such file or it is not JSON, [`Error::Io`].
    pub fn open(path: &Path) -> Result<Self> {
        let io = |e| Error::reading(path, e);
        let length = std::fs::metadata(path).map_err(io)?.len();
        if length > MAX_BYTES {
            let message = format!("file is too large: {length} bytes");
            let allowed = format!("up to {MAX_BYTES} bytes");
            let help = "move long arrays to a binary buffer";
            return Err(Diagnostic::new(path, "", message, allowed, help).into());
        }
        let text = read_file(path).map_err(io)?;
        let (mut value, duplicates) = parse::parse(&text).map_err(|e| {
            let span = (locate::offset(&text, e.line(), e.column()), 1);
            let diagnostic = Diagnostic::new(
                path,
                "",
                format!("invalid JSON: {e}"),
                "strict JSON: no comments, no trailing commas, no NaN or Infinity",
                "correct the text shown, or write the file with a JSON library",
            );
            Error::from(Diagnostic { span: Some(span), ..diagnostic })
        })?;
        let mut diagnostics = Diagnostics::default();
        for key in &duplicates {
            diagnostics.add(key, "duplicate key", "each key of an object once", "remove all but one");
        }
        let renamed = former_names::update(&mut value, &mut diagnostics);
        let path = path.into();
        Ok(Document { path, text, value, renamed, incomplete: Vec::new(), schema_errors: 0, diagnostics })
    }

    /// The folder that relative file names start from.
    pub fn folder(&self) -> PathBuf {
        self.path.parent().unwrap_or(Path::new("")).to_path_buf()
    }

    /// The value read, for changes before [`Document::deserialize`].
    pub fn value_mut(&mut self) -> &mut Value {
        &mut self.value
    }

    /// The string property `name` of the root.
    pub fn string(&self, name: &str) -> Option<&str> {
        self.value.get(name)?.as_str()
    }

    /// The number at the JSON pointer `pointer`.
    pub fn number(&self, pointer: &str) -> Option<f64> {
        self.value.pointer(pointer)?.as_f64()
    }

    /// The two integers of the array property `name` of the root.
    pub fn integer_pair(&self, name: &str) -> Option<(i32, i32)> {
        <[i32; 2]>::deserialize(self.value.get(name)?).ok().map(<(i32, i32)>::from)
    }

    /// The strings at the JSON pointer `pointer` of each element of the array property `list` of the root.
    pub fn strings(&self, list: &str, pointer: &str) -> impl Iterator<Item = &str> {
        let elements = self.value.get(list).and_then(Value::as_array).into_iter().flatten();
        elements.filter_map(move |e| e.pointer(pointer)?.as_str())
    }

    /// Checks the value against the schema of `T` and deserialises it. Reports all schema errors. Removes
    /// optional values of a wrong type, so that the caller can continue and find further errors. Returns
    /// `None` if a required value is wrong or missing.
    pub fn deserialize<T: DeserializeOwned + JsonSchema>(&mut self) -> Option<T> {
        let schema = schema_of::<T>();
        for key in schema_check::check(&self.value, &schema, &mut self.diagnostics) {
            schema_check::remove(&mut self.value, &key);
            self.incomplete.push(key.section().into());
        }
        self.schema_errors = self.diagnostics.len();
        match serde_path_to_error::deserialize(std::mem::take(&mut self.value)) {
            Ok(file) => Some(file),
            Err(e) => {
                if self.diagnostics.len() == 0 {
                    let message = e.inner().to_string();
                    let allowed = "the schema: see `hairbake schema`";
                    self.diagnostics.add(&locate::key(e.path()), message, allowed, "correct the value");
                }
                None
            }
        }
    }

    /// The result `value`, if there are no errors.
    ///
    /// `dependencies` lists pairs (section, section that it depends on). A section from which a value was
    /// removed may give false errors, and so may the sections that depend on it: only their schema errors are
    /// reported.
    ///
    /// # Errors
    /// [`Error::BadInput`] with every error and its place in the text.
    pub fn finish<T>(mut self, value: Option<T>, dependencies: &[(&str, &str)]) -> Result<T> {
        let unreliable = |section: &str| {
            self.incomplete.iter().any(|i| i == section || dependencies.contains(&(section, i.as_str())))
        };
        let mut reported = std::mem::take(&mut self.diagnostics.own);
        let later = reported.split_off(self.schema_errors.min(reported.len()));
        reported.extend(later.into_iter().filter(|d| !unreliable(d.key.section())));
        for diagnostic in &mut reported {
            if let Some((_, in_file)) = self.renamed.iter().find(|(current, _)| *current == diagnostic.key) {
                diagnostic.key = in_file.clone();
            }
        }
        let mut diagnostics = locate::place(&self.path, &self.text, reported);
        diagnostics.extend(self.diagnostics.elsewhere);
        match value {
            Some(value) if diagnostics.is_empty() => Ok(value),
            _ => Err(Error::BadInput(diagnostics)),
        }
    }
}
