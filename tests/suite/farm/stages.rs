//! Stages, divided in many ways.

use super::shot::{FRAMES, Shot, workplace};
use crate::common::{entries, hairbake, here};
use std::path::Path;

const DONE: Option<i32> = Some(0);
const NOT_YET: Option<i32> = Some(75);

/// Bakes the shot in segments of the simulation and chunks of frames of these sizes.
fn divided(shot: &Shot, out: &Path, threads: &str, segment: usize, chunk: usize) {
    let frames: Vec<i32> = (FRAMES[0]..=FRAMES[1]).collect();
    // The strands of a frame depend on guides three frames ahead.
    let simulated: Vec<i32> = (FRAMES[0]..=FRAMES[1] + 3).collect();
    let range = |part: &[i32]| format!("{}-{}", part[0], part[part.len() - 1]);
    for part in simulated.chunks(segment) {
        assert_eq!(shot.stage("simulate", out, &["--frames", &range(part), "--threads", threads]), DONE);
    }
    // In reverse order: the chunks are independent.
    for part in frames.chunks(chunk).rev() {
        assert_eq!(shot.stage("interpolate", out, &["--frames", &range(part), "--threads", threads]), DONE);
    }
    assert_eq!(shot.stage("assemble", out, &["--no-pictures", "--threads", threads]), DONE);
}

#[test]
fn results_do_not_depend_on_threads_chunks_or_segments() {
    let shot = Shot::get();
    for (threads, segment, chunk) in
        [("1", 99, 1), ("2", 99, 8), ("7", 99, 99), ("7", 1, 8), ("1", 5, 99), ("2", 4, 1), ("7", 7, 5)]
    {
        let folder = workplace();
        divided(shot, folder.path(), threads, segment, chunk);
        shot.assert_same(folder.path());
    }
}

#[test]
fn bake_and_stages_resume_each_others_work() {
    let shot = Shot::get();
    let folder = workplace();
    let out = folder.path();
    assert_eq!(shot.stage("simulate", out, &["--frames", "1000-1007"]), DONE);
    assert_eq!(shot.stage("interpolate", out, &["--frames", "1002-1004x2,1001"]), DONE);
    assert!(shot.bake(out, &["--threads", "2"]).status().unwrap().success());
    shot.assert_same(out);
    // Everything is done; no stage changes anything.
    for stage in ["simulate", "interpolate", "assemble"] {
        let options: &[&str] = if stage == "assemble" { &["--no-pictures"] } else { &[] };
        assert_eq!(shot.stage(stage, out, options), DONE, "{stage}");
        shot.assert_same(out);
    }
    let output = shot.bake(out, &[]).stderr(std::process::Stdio::piped()).output().unwrap();
    assert!(String::from_utf8_lossy(&output.stderr).contains("up to date, 13 frames"));
}

#[test]
fn missing_input_of_a_stage_exits_with_75() {
    let shot = Shot::get();
    let folder = workplace();
    let out = folder.path();
    assert_eq!(shot.stage("simulate", out, &["--frames", "1005-1014"]), NOT_YET);
    assert_eq!(shot.stage("interpolate", out, &["--frames", "1000-1001"]), NOT_YET);
    assert_eq!(shot.stage("simulate", out, &["--frames", "1000-1004"]), DONE);
    assert_eq!(shot.stage("interpolate", out, &["--frames", "1004-1005"]), NOT_YET);
    assert_eq!(shot.stage("assemble", out, &[]), NOT_YET);
    assert!(!out.join("manifest.json").exists() && !out.join("hair.usda").exists());
    assert_eq!(shot.stage("simulate", out, &["--frames", "990-1004"]), Some(64));
    assert_eq!(shot.stage("interpolate", out, &["--frames", "1013"]), Some(64));
}

#[test]
fn a_list_with_a_step_writes_only_its_frames() {
    let shot = Shot::get();
    let folder = workplace();
    let out = folder.path();
    let mut some = shot.command("", out, &["--frames", "1001-1011x4"]);
    assert!(some.status().unwrap().success());
    let frames = |name: &String| name.starts_with("hair.10");
    let made: Vec<String> = entries(out).into_iter().filter(frames).collect();
    assert_eq!(made, ["hair.1001.usdc", "hair.1005.usdc", "hair.1009.usdc"]);
    assert!(!out.join("manifest.json").exists());
    assert!(shot.bake(out, &[]).status().unwrap().success());
    shot.assert_same(out);
}

#[test]
fn damaged_files_are_reported_and_repaired() {
    let shot = Shot::get();
    let folder = workplace();
    let out = folder.path();
    assert_eq!(shot.stage("simulate", out, &["--frames", "1000-1008"]), DONE);
    assert!(shot.bake(out, &[]).status().unwrap().success());
    let flip = |name: &str| {
        let path = out.join(name);
        let mut bytes = here(&path);
        let middle = bytes.len() / 2;
        bytes[middle] ^= 4;
        std::fs::write(path, bytes).unwrap();
    };
    for name in [
        "hair.1003.usdc",
        "hair.usda",
        "hair.topology.usdc",
        "manifest.json",
        ".hairbake/states/1011",
        ".hairbake/frames/1005.json",
    ] {
        flip(name);
        let output = shot.bake(out, &[]).stderr(std::process::Stdio::piped()).output().unwrap();
        assert!(output.status.success());
        if name.contains("states") {
            let said = String::from_utf8_lossy(&output.stderr).into_owned();
            assert!(said.contains("the state of frame 1011 is damaged (the checksum differs)"), "{said}");
        }
        shot.assert_same(out);
    }
}

#[test]
fn a_damaged_checkpoint_falls_back_to_the_one_before() {
    let shot = Shot::get();
    let folder = workplace();
    let out = folder.path();
    assert_eq!(shot.stage("simulate", out, &["--frames", "1000-1005"]), DONE);
    let checkpoints = out.join(".hairbake/checkpoints");
    let mut kept: Vec<i64> = entries(&checkpoints).iter().map(|name| name.parse().unwrap()).collect();
    kept.sort();
    assert_eq!(kept.len(), 2, "{kept:?}");
    let newest = checkpoints.join(kept[1].to_string());
    let mut bytes = here(&newest);
    bytes.truncate(bytes.len() / 2);
    std::fs::write(&newest, bytes).unwrap();
    let output = shot.bake(out, &[]).stderr(std::process::Stdio::piped()).output().unwrap();
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(
        output.status.success() && said.contains(&*newest.to_string_lossy()) && said.contains("damaged"),
        "{said}"
    );
    shot.assert_same(out);
}

#[test]
fn other_settings_restart_and_a_longer_shot_resumes() {
    let shot = Shot::get();
    let folder = workplace();
    let out = folder.path();
    let shorter = |options: &[&str]| {
        let mut command = shot.command("", out, &["--frames", "1001-1004", "--no-pictures"]);
        command.args(options).status().unwrap()
    };
    assert!(shorter(&["--substeps", "2"]).success());
    let other = here(&out.join("hair.1003.usdc"));
    assert!(shorter(&["--overwrite"]).success());
    let this = here(&out.join("hair.1003.usdc"));
    assert_ne!(other, this);
    // A longer shot keeps these frames.
    let made = std::fs::metadata(out.join("hair.1003.usdc")).unwrap().modified().unwrap();
    assert!(shot.bake(out, &[]).status().unwrap().success());
    assert_eq!(std::fs::metadata(out.join("hair.1003.usdc")).unwrap().modified().unwrap(), made);
    shot.assert_same(out);
    assert!(shorter(&["--overwrite"]).success());
    assert!(!out.join("hair.1006.usdc").exists() && out.join("hair.1005.usdc").exists());
}

#[test]
fn a_finished_cache_is_replaced_only_if_asked() {
    let shot = Shot::get();
    let folder = workplace();
    let out = folder.path();
    assert!(shot.bake(out, &[]).status().unwrap().success());
    let refused = |stage: &str, options: &[&str]| {
        let mut command = shot.command(stage, out, options);
        let output = command.stderr(std::process::Stdio::piped()).output().unwrap();
        assert_eq!(output.status.code(), Some(65), "{stage} {options:?}");
        shot.assert_same(out);
        let said = String::from_utf8(output.stderr).unwrap();
        let words: Vec<&str> = said.split_whitespace().filter(|word| !"│╰─▶".contains(word)).collect();
        words.join(" ")
    };
    let other = refused("", &["--frames", "1001-1011", "--substeps", "2"]);
    for part in [
        "holds a finished cache of groom.json and shake.json, frames 1001 to 1011, written 20",
        "this bake differs in: substeps",
        "--overwrite",
        "nothing written",
    ] {
        assert!(other.contains(part), "{part}: {other}");
    }
    // The same bake, but of fewer frames: those of the others would be lost.
    let fewer = refused("", &["--frames", "1001-1004"]);
    assert!(fewer.contains("this bake has only frames 1001 to 1004"), "{fewer}");
    refused("simulate", &["--shot", "1001-1011", "--substeps", "2"]);
    refused("interpolate", &["--shot", "1001-1004"]);
    refused("assemble", &["--shot", "1002-1011"]);
    // Also without the work folder.
    std::fs::rename(out.join(".hairbake"), folder.path().join("moved")).unwrap();
    let mut command = shot.command("", out, &["--frames", "1001-1011", "--substeps", "2"]);
    assert_eq!(command.status().unwrap().code(), Some(65));
    std::fs::write(out.join("manifest.json"), "{}").unwrap();
    assert_eq!(shot.bake(out, &[]).status().unwrap().code(), Some(65));
    assert!(out.join("hair.usda").exists() && !out.join(".hairbake").exists());
    let mut command = shot.bake(out, &["--overwrite"]);
    assert!(command.status().unwrap().success());
}

#[test]
fn invalid_frame_lists_exit_with_64() {
    let shot = Shot::get();
    for frames in ["1001-", "5-1", "1001-1010x0", "0-2000000000", "1001;1002"] {
        let mut command = hairbake();
        command.arg("interpolate").args([shot.path("groom.json"), shot.path("shake.json")]);
        command.args(["-o", "out", "--frames", frames]).assert().code(64);
    }
}
