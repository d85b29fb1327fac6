//! Files that tell by themselves what they are, of which bake, and whether they are whole.
//!
//! One line of text, `hairbake KIND VERSION KEY SHA256`, then the value in postcard's encoding, of which the hash is.

use crate::file::{read_file, sha256, write_file, write_file_unsynced};
use crate::{Error, Result};
use serde::Serialize;
use serde::de::DeserializeOwned;
use std::io::ErrorKind;
use std::path::Path;

/// A kind of sealed file. Whoever changes what is in it raises its version.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Kind {
    /// One word.
    pub name: &'static str,
    /// Version of the format.
    pub version: u32,
    /// Whether it has to outlive a crash of the machine; else it is made again.
    pub lasting: bool,
}

/// Why a sealed file is of no use.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum Flaw {
    /// There is none.
    #[error("it is not there")]
    Missing,
    /// It is of other inputs or settings, or of another build of hairbake.
    #[error("it is of another bake")]
    Stale,
    /// It is not as it was written.
    #[error("it is damaged: {0}")]
    Damaged(String),
}

/// Writes `value` of the bake `key`.
///
/// # Errors
/// [`Error::Io`].
pub fn write(path: &Path, kind: Kind, key: &str, value: &impl Serialize) -> Result<()> {
    let body = postcard::to_stdvec(value).map_err(|e| Error::Internal(e.to_string()))?;
    let head = format!("hairbake {} {} {key} {}\n", kind.name, kind.version, sha256(&body));
    let parts = [head.into_bytes(), body];
    if kind.lasting { write_file(path, &parts) } else { write_file_unsynced(path, &parts) }.map(drop)
}

/// Reads a value of the bake `key`.
///
/// # Errors
/// [`Flaw`]; one that the system cannot read counts as damaged.
pub fn read<T: DeserializeOwned>(path: &Path, kind: Kind, key: &str) -> std::result::Result<T, Flaw> {
    let bytes = read_file(path).map_err(|e| match e.kind() {
        ErrorKind::NotFound => Flaw::Missing,
        _ => Flaw::Damaged(e.to_string()),
    })?;
    let damaged = |what: &str| Flaw::Damaged(what.into());
    let end = bytes.iter().position(|b| *b == b'\n').ok_or_else(|| damaged("it has no first line"))?;
    let (head, body) = (&bytes[..end], &bytes[end + 1..]);
    let head = std::str::from_utf8(head).map_err(|_| damaged("its first line is no text"))?;
    let words: Vec<&str> = head.split(' ').collect();
    match words[..] {
        ["hairbake", name, _, _, hash] if name == kind.name && hash == sha256(body) => {}
        ["hairbake", name, _, _, _] if name == kind.name => return Err(damaged("its checksum differs")),
        _ => return Err(damaged(&format!("it is no {}", kind.name))),
    }
    if words[2] != kind.version.to_string() || words[3] != key {
        return Err(Flaw::Stale);
    }
    postcard::from_bytes(body).map_err(|e| Flaw::Damaged(e.to_string()))
}

#[cfg(test)]
mod tests {
    use super::*;

    const KIND: Kind = Kind { name: "state", version: 3, lasting: false };

    #[test]
    fn every_flipped_bit_and_every_cut_is_seen() {
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
            assert!(matches!(back(), Err(Flaw::Damaged(_))), "cut at {i}");
        }
        std::fs::remove_file(&path).unwrap();
        assert_eq!(back(), Err(Flaw::Missing));
    }

    #[test]
    fn another_bake_or_version_is_stale() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a");
        write(&path, KIND, "key", &7u8).unwrap();
        assert_eq!(read::<u8>(&path, KIND, "other"), Err(Flaw::Stale));
        assert_eq!(read::<u8>(&path, Kind { version: 4, ..KIND }, "key"), Err(Flaw::Stale));
        assert!(matches!(read::<u8>(&path, Kind { name: "mark", ..KIND }, "key"), Err(Flaw::Damaged(_))));
    }
}
