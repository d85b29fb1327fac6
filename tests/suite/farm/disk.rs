//! Full disks and read-only folders.

use super::shot::{Shot, workplace};
use crate::common::{entries, here};
use std::path::Path;
use std::process::Command;

/// A small file system in memory, mounted until it is dropped.
struct SmallDisk<'a>(&'a Path);

impl<'a> SmallDisk<'a> {
    /// Mounts the file system; `None` without the rights of root.
    fn mount(at: &'a Path, kib: u32) -> Option<Self> {
        let size = format!("size={kib}k");
        let mounted = Command::new("mount").args(["-t", "tmpfs", "-o", &size, "tmpfs"]).arg(at).output();
        mounted.is_ok_and(|output| output.status.success()).then_some(SmallDisk(at))
    }
}

impl Drop for SmallDisk<'_> {
    fn drop(&mut self) {
        let _ = Command::new("umount").arg("-l").arg(self.0).status();
    }
}

#[test]
fn a_bake_resumes_after_a_full_disk() {
    let shot = Shot::get();
    let folder = workplace();
    let Some(disk) = SmallDisk::mount(folder.path(), 700) else {
        println!("skipped: only root may mount a small file system to fill");
        return;
    };
    let out = disk.0.join("out");
    let output = shot.bake(&out, &[]).stderr(std::process::Stdio::piped()).output().unwrap();
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(74), "{said}");
    assert!(said.contains("No space left"), "{said}");
    let frames = entries(&out).iter().filter(|name| name.starts_with("hair.10")).count();
    assert!((1..13).contains(&frames), "{frames} frames");
    assert!(!entries(&out).iter().any(|name| name.ends_with(".tmp")));
    let before = here(&out.join("hair.1000.usdc"));
    let more = Command::new("mount").args(["-o", "remount,size=64m"]).arg(disk.0).status().unwrap();
    assert!(more.success());
    assert!(shot.bake(&out, &[]).status().unwrap().success());
    assert_eq!(here(&out.join("hair.1000.usdc")), before);
    shot.assert_same(&out);
}

#[test]
fn a_read_only_folder_exits_with_74() {
    let shot = Shot::get();
    let folder = workplace();
    let Some(disk) = SmallDisk::mount(folder.path(), 700) else {
        println!("skipped: only root may mount a file system that cannot be written");
        return;
    };
    let out = disk.0.join("out");
    assert_eq!(shot.stage("simulate", &out, &["--frames", "1000-1002"]), Some(0));
    assert!(Command::new("mount").args(["-o", "remount,ro"]).arg(disk.0).status().unwrap().success());
    for stage in ["simulate", "interpolate"] {
        assert_eq!(shot.stage(stage, &out, &[]), Some(74), "{stage}");
    }
    assert_eq!(shot.bake(&disk.0.join("other"), &[]).status().unwrap().code(), Some(74));
}
