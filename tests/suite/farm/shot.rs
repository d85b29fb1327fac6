//! A small shot and its reference bake.

use crate::common::{hairbake, here};
use hairbake::cache::sha256;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::OnceLock;
use std::time::{Duration, Instant};
use tempfile::TempDir;

/// First and last frame, including handle frames.
pub const FRAMES: [i32; 2] = [1000, 1012];

/// A shaken head of short hair.
pub struct Shot {
    folder: TempDir,
    tree: String,
}

impl Shot {
    /// The shot of these tests, baked once in one process.
    pub fn get() -> &'static Shot {
        static SHOT: OnceLock<Shot> = OnceLock::new();
        SHOT.get_or_init(|| {
            let folder = workplace();
            hairbake()
                .args([
                    "sample",
                    "short",
                    "--wisps",
                    "16",
                    "--strands",
                    "64",
                    "--head-subdivisions",
                    "2",
                    "-o",
                ])
                .arg(folder.path())
                .assert()
                .success();
            let mut shot = Shot { folder, tree: String::new() };
            let out = shot.folder.path().join("whole");
            assert!(
                shot.command("", &out, &["--frames", "1001-1011", "--no-pictures"])
                    .status()
                    .unwrap()
                    .success()
            );
            shot.tree = tree(&out);
            shot
        })
    }

    /// The command of a stage; `bake` for "".
    pub fn command(&self, stage: &str, out: &Path, options: &[&str]) -> Command {
        let mut command = Command::new(assert_cmd::cargo::cargo_bin!("hairbake"));
        command.args(Some(stage).filter(|s| !s.is_empty()));
        command.args([self.path("groom.json"), self.path("shake.json")]).arg("-o").arg(out);
        command.args(["--preroll", "0.2", "--contact", "full", "--accelerations"]).args(options);
        command.stdout(Stdio::null()).stderr(Stdio::null());
        command
    }

    /// The command that bakes frames 1001 to 1011 without pictures.
    pub fn bake(&self, out: &Path, options: &[&str]) -> Command {
        let mut command = self.command("", out, &["--frames", "1001-1011", "--no-pictures"]);
        command.args(options);
        command
    }

    /// Runs a stage of the bake of frames 1001 to 1011 and returns its exit code.
    pub fn stage(&self, stage: &str, out: &Path, options: &[&str]) -> Option<i32> {
        self.command(stage, out, &["--shot", "1001-1011"]).args(options).status().unwrap().code()
    }

    /// The output of `hairbake plan` for frames 1001 to 1011.
    pub fn plan(&self, out: &Path, options: &[&str]) -> String {
        let mut command = self.command("plan", out, &["--frames", "1001-1011", "--program"]);
        command.arg(assert_cmd::cargo::cargo_bin!("hairbake")).args(options).stdout(Stdio::piped());
        let output = command.output().unwrap();
        assert!(output.status.success());
        String::from_utf8(output.stdout).unwrap()
    }

    /// A file of the scene.
    pub fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    /// Asserts that all files in `out` equal those of the reference bake, byte by byte.
    #[track_caller]
    pub fn assert_same(&self, out: &Path) {
        assert_like(&self.tree, out);
    }
}

/// Asserts that the files of two bakes are equal.
#[track_caller]
pub fn assert_same(one: &Path, other: &Path) {
    assert_like(&tree(one), other);
}

#[track_caller]
fn assert_like(tree: &str, out: &Path) {
    let found = self::tree(out);
    let missing: Vec<&str> = tree.lines().filter(|line| !found.contains(line)).collect();
    let others: Vec<&str> = found.lines().filter(|line| !tree.contains(line)).collect();
    assert!(found == tree, "other files: {others:#?}\nin place of: {missing:#?}");
}

/// Waits until `seen`, at most ten minutes, for a busy machine.
#[track_caller]
pub fn wait_until(what: &str, mut seen: impl FnMut() -> bool) {
    let begun = Instant::now();
    while !seen() {
        assert!(begun.elapsed() < Duration::from_secs(600), "no {what} in ten minutes");
        std::thread::sleep(Duration::from_millis(5));
    }
}

/// A temporary folder, in memory if possible: syncing to disk is slow.
pub fn workplace() -> TempDir {
    let memory = Path::new("/dev/shm");
    if memory.is_dir() { tempfile::tempdir_in(memory).unwrap() } else { tempfile::tempdir().unwrap() }
}

/// Name and checksum of every file below `folder`, including work files; without the reports, which contain
/// timings.
fn tree(folder: &Path) -> String {
    let mut lines = Vec::new();
    let mut folders = vec![folder.to_path_buf()];
    while let Some(next) = folders.pop() {
        for entry in std::fs::read_dir(&next).unwrap() {
            let path = entry.unwrap().path();
            let name = path.strip_prefix(folder).unwrap().display().to_string();
            if path.is_dir() {
                folders.push(path);
            } else if !name.starts_with("report.") {
                lines.push(format!("{name} {}\n", sha256(&here(&path))));
            }
        }
    }
    lines.sort();
    lines.concat()
}
