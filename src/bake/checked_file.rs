//! Binary files with a header that identifies their kind and bake, and a checksum.
//!
//! One line of text, `hairbake KIND VERSION KEY SHA256`, then the value in postcard's encoding; the hash is
//! of the value.

use crate::file::{read_file, sha256, write_file_unrecorded};
use crate::{Error, Result};
use serde::Serialize;
use serde::de::DeserializeOwned;
use std::io::ErrorKind;
use std::path::Path;

/// A kind of checked file. A change of its content raises its version.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Kind {
    /// Name in the header: one word.
    pub name: &'static str,
    /// Version of the format.
    pub version: u32,
    /// True if the file must survive a crash of the machine; other files are made again.
    pub durable: bool,
}

/// Why a checked file cannot be used.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum FileFault {
    /// The file does not exist.
    #[error("the file does not exist")]
    Missing,
    /// The file belongs to other inputs or settings, or to another build of hairbake.
    #[error("the file belongs to another bake")]
    Stale,
    /// The file is not as it was written.
    #[error("the file is damaged: {0}")]
    Damaged(String),
}

/// Writes `value` for the bake `key`.
///
/// # Errors
/// [`Error::Io`].
pub fn write(path: &Path, kind: Kind, key: &str, value: &impl Serialize) -> Result<()> {
    let body = postcard::to_stdvec(value).map_err(|e| Error::Internal(e.to_string()))?;
    let head = format!("hairbake {} {} {key} {}\n", kind.name, kind.version, sha256(&body));
    write_file_unrecorded(path, &[head.into_bytes(), body], kind.durable)
}

/// Reads a value of the bake `key`.
///
/// # Errors
/// [`FileFault`]; a file that the system cannot read counts as damaged.
pub fn read<T: DeserializeOwned>(path: &Path, kind: Kind, key: &str) -> std::result::Result<T, FileFault> {
    let bytes = read_file(path).map_err(|e| match e.kind() {
        ErrorKind::NotFound => FileFault::Missing,
        _ => FileFault::Damaged(e.to_string()),
    })?;
    let damaged = |what: &str| FileFault::Damaged(what.into());
    let end = bytes.iter().position(|b| *b == b'\n').ok_or_else(|| damaged("the header is missing"))?;
    let (head, body) = (&bytes[..end], &bytes[end + 1..]);
    let head = std::str::from_utf8(head).map_err(|_| damaged("the header is not text"))?;
    let words: Vec<&str> = head.split(' ').collect();
    match words[..] {
        ["hairbake", name, _, _, hash] if name == kind.name && hash == sha256(body) => {}
        ["hairbake", name, _, _, _] if name == kind.name => return Err(damaged("the checksum differs")),
        _ => return Err(damaged(&format!("it is not a {} file", kind.name))),
    }
    if words[2] != kind.version.to_string() || words[3] != key {
        return Err(FileFault::Stale);
    }
    postcard::from_bytes(body).map_err(|e| FileFault::Damaged(e.to_string()))
}

#[cfg(test)]
mod tests {
    use super::*;

    const KIND: Kind = Kind { name: "state", version: 3, durable: false };

    #[test]
    fn every_flipped_bit_and_truncation_is_detected() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a");
        let value = (vec![1.0, f64::NEG_INFINITY], "text".to_string());
        write(&path, KIND, "key", &value).unwrap();
        let back = || read::<(Vec<f64>, String)>(&path, KIND, "key");
        assert_eq!(back(), Ok(value));
        let sound = std::fs::read(&path).unwrap();
        for i in 0..sound.len() {
            for bit in 0..8 {
                let mut bytes = sound.clone();
                bytes[i] ^= 1 << bit;
                std::fs::write(&path, &bytes).unwrap();
                assert!(back().is_err(), "bit {bit} of byte {i}");
            }
            std::fs::write(&path, &sound[..i]).unwrap();
            assert!(matches!(back(), Err(FileFault::Damaged(_))), "cut at {i}");
        }
        std::fs::remove_file(&path).unwrap();
        assert_eq!(back(), Err(FileFault::Missing));
    }

    #[test]
    fn other_bakes_and_versions_are_stale() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a");
        write(&path, KIND, "key", &7u8).unwrap();
        assert_eq!(read::<u8>(&path, KIND, "other"), Err(FileFault::Stale));
        assert_eq!(read::<u8>(&path, Kind { version: 4, ..KIND }, "key"), Err(FileFault::Stale));
        assert!(matches!(
            read::<u8>(&path, Kind { name: "mark", ..KIND }, "key"),
            Err(FileFault::Damaged(_))
        ));
    }
}
