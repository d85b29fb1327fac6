//! Tests of the two formats: round trips, real data, and a snapshot of every fault they name.
#![allow(clippy::print_stderr)] // A skipped test says so.

mod anim;
mod faults;
mod fuzz;
mod groom;
mod mesh;
mod schemas;

use std::path::{Path, PathBuf};

/// Real inputs, where this machine has them.
fn shared_data() -> Option<PathBuf> {
    let beside = Path::new(env!("CARGO_MANIFEST_DIR")).join("../shared/data");
    let folder = std::env::var_os("HAIRBAKE_DATA").map_or(beside, PathBuf::from);
    if !folder.is_dir() {
        eprintln!("skipped: no shared data at {}", folder.display());
        return None;
    }
    Some(folder)
}

/// A file of this text in a folder of its own.
fn file(name: &str, text: &str) -> (tempfile::TempDir, PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join(name);
    std::fs::write(&path, text).unwrap();
    (folder, path)
}
