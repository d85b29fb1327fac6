//! Errors found while a file is read, before their places in its text are known.

use super::key::Key;
use crate::error::Diagnostic;
use nalgebra::{Quaternion, UnitQuaternion};

/// Most errors of one kind at one place that are reported one by one.
pub const MAX_REPORTED: usize = 8;

/// A [`Diagnostic`] before its place in the text is known.
#[derive(Debug, Clone, PartialEq)]
pub struct Unplaced {
    /// The value that is wrong.
    pub key: Key,
    /// What is wrong, with the value found.
    pub message: String,
    /// The values allowed.
    pub allowed: String,
    /// What to do about it.
    pub help: String,
}

/// The errors found so far in a file, and those of the files that it names.
#[derive(Debug, Default)]
pub struct Diagnostics {
    /// Errors in the file itself.
    pub own: Vec<Unplaced>,
    /// Errors in other files.
    pub elsewhere: Vec<Diagnostic>,
}

impl Diagnostics {
    /// Adds an error: its place, what is wrong (with the value found), the values allowed, what to do.
    pub fn add(
        &mut self,
        key: &Key,
        message: impl Into<String>,
        allowed: impl Into<String>,
        help: impl Into<String>,
    ) {
        self.own.push(Unplaced {
            key: key.clone(),
            message: message.into(),
            allowed: allowed.into(),
            help: help.into(),
        });
    }

    /// Checks that an array of length `found` has one element per `item`, `expected` in all. Adds an error
    /// and returns false if it has not.
    pub fn expect_len(&mut self, key: &Key, found: usize, expected: usize, item: &str) -> bool {
        if found != expected {
            self.add(
                key,
                format!("length is {found}, expected {expected}"),
                format!("one element per {item}: {expected}"),
                "make the lengths agree",
            );
        }
        found == expected
    }

    /// Normalises the quaternions (w, x, y, z) of the array at `key`. Adds errors and returns `None` if one
    /// is not of about unit length.
    pub fn unit_quaternions(&mut self, key: &Key, wxyz: &[[f64; 4]]) -> Option<Vec<UnitQuaternion<f64>>> {
        let norm = |q: &[f64; 4]| q.iter().map(|x| x * x).sum::<f64>().sqrt();
        let bad = || wxyz.iter().enumerate().filter(|(_, q)| !(0.9..=1.1).contains(&norm(q)));
        for (i, q) in bad().take(MAX_REPORTED) {
            let message = format!("{q:?} has length {:.3}", norm(q));
            let allowed = "unit quaternions (w, x, y, z), length 0.9 to 1.1";
            self.add(&key.index(i), message, allowed, "write unit quaternions, w first");
        }
        let unit = |&[w, x, y, z]: &[f64; 4]| UnitQuaternion::from_quaternion(Quaternion::new(w, x, y, z));
        bad().next().is_none().then(|| wxyz.iter().map(unit).collect())
    }

    /// Adds the errors of another file.
    pub fn add_elsewhere(&mut self, diagnostics: Vec<Diagnostic>) {
        self.elsewhere.extend(diagnostics);
    }

    /// Whether there is an error at this place in the file.
    pub fn reports(&self, key: &Key) -> bool {
        self.own.iter().any(|error| error.key == *key)
    }

    /// Number of errors so far.
    pub fn len(&self) -> usize {
        self.own.len() + self.elsewhere.len()
    }
}
