//! The public file formats.

use std::fmt;

/// A public file format.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Format {
    /// `groom.json`.
    Groom,
    /// `anim.json`.
    Anim,
}

impl fmt::Display for Format {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Format::Groom => "groom",
            Format::Anim => "anim",
        })
    }
}
