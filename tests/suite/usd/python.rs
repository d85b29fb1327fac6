//! Runs the scripts in `tests/python` in a Python with usd-core.

use std::path::{Path, PathBuf};
use std::process::Command;

const ROOT: &str = env!("CARGO_MANIFEST_DIR");

/// Runs a script and fails with what it said if it does; skipped, with a line, where there is no such
/// Python. It is `HAIRBAKE_PYTHON`, or `.venv/bin/python`, which `tests/run` makes.
pub fn run(script: &str, arguments: &[&Path]) {
    let python = std::env::var_os("HAIRBAKE_PYTHON")
        .map_or_else(|| Path::new(ROOT).join(".venv/bin/python"), PathBuf::from);
    let has_usd = Command::new(&python).args(["-c", "import pxr"]).status();
    if !has_usd.is_ok_and(|status| status.success()) {
        println!("skipped: {} has no usd-core; tests/run makes one that has", python.display());
        return;
    }
    let script = Path::new(ROOT).join("tests/python").join(script);
    let output = Command::new(python).arg(script).args(arguments).output().unwrap();
    let said =
        [output.stdout, output.stderr].map(|text| String::from_utf8_lossy(&text).into_owned()).concat();
    assert!(output.status.success(), "{said}");
}

/// An empty folder under the target folder, kept after the test to look at.
pub fn folder(name: &str) -> PathBuf {
    let dir = Path::new(env!("CARGO_TARGET_TMPDIR")).join(name);
    let _ = std::fs::remove_dir_all(&dir);
    std::fs::create_dir_all(&dir).unwrap();
    dir
}
