//! The diagnostics of invalid files. Each folder `diagnostics/GROUP/CASE` holds the files and, in
//! `expected.txt`, what a user sees. To write all `expected.txt` again, run the test with the environment
//! variable `UPDATE_EXPECTED` set.

use super::super::*;
use crate::error::{Diagnostic, Error, render};
use std::path::{Path, PathBuf};

/// The cases, relative to the folder in which cargo runs tests: the wrapping of lines depends on the length
/// of the path.
const CASES: &str = "src/scene/tests/diagnostics";

fn subfolders(folder: &Path) -> Vec<PathBuf> {
    let mut folders: Vec<PathBuf> = std::fs::read_dir(folder).unwrap().map(|e| e.unwrap().path()).collect();
    folders.retain(|path| path.is_dir());
    folders.sort();
    folders
}

/// The diagnostics of a case: of its scene, or of its only file.
fn diagnose(case: &Path) -> Vec<Diagnostic> {
    let [groom, anim, any] = ["groom.json", "anim.json", "any.json"].map(|name| case.join(name));
    match (groom.exists(), anim.exists()) {
        (true, true) => match load(&groom, &anim) {
            Ok(_) => Vec::new(),
            Err(Error::BadInput(diagnostics)) => diagnostics,
            Err(e) => panic!("{}: {e}", case.display()),
        },
        (true, false) => check(&[&groom]).unwrap(),
        (false, true) => check(&[&anim]).unwrap(),
        (false, false) => check(&[&any]).unwrap(),
    }
}

#[test]
fn each_case_gives_its_expected_diagnostics() {
    let update = std::env::var_os("UPDATE_EXPECTED").is_some();
    let (mut cases, mut wrong) = (0, String::new());
    for case in subfolders(Path::new(CASES)).iter().flat_map(|group| subfolders(group)) {
        let found = render(&diagnose(&case), false).replace(&format!("{}/", case.display()), "");
        let path = case.join("expected.txt");
        if update {
            std::fs::write(&path, &found).unwrap();
        }
        let expected = std::fs::read_to_string(&path).unwrap_or_default();
        if found != expected {
            wrong += &format!("{}\n--- expected\n{expected}--- found\n{found}\n", case.display());
        }
        cases += 1;
    }
    assert!(cases > 80, "{cases}");
    assert!(wrong.is_empty(), "{wrong}");
}

#[test]
fn a_file_that_is_too_large_is_not_read() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("groom.json");
    // A sparse file takes no space on disk.
    std::fs::File::create(&path).unwrap().set_len(1 << 40).unwrap();
    let diagnostics = check(&[&path]).unwrap();
    let expected = Diagnostic::new(
        &path,
        "",
        "file is too large: 1099511627776 bytes",
        "up to 268435456 bytes",
        "move long arrays to a binary buffer",
    );
    assert_eq!(diagnostics, [expected]);
}
