//! Tests of the two formats: round trips, real data, diagnostics.

mod anim;
mod diagnostics;
mod fuzz;
mod groom;
mod obj;
mod schemas;

use std::path::PathBuf;

/// A file with this text in a folder of its own.
fn file(name: &str, text: &str) -> (tempfile::TempDir, PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join(name);
    std::fs::write(&path, text).unwrap();
    (folder, path)
}
