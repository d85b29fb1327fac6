//! Plans, run by their schedulers.

use super::shot::{Shot, workplace};
use crate::common::{entries, hairbake, here, python};
use serde_json::{Value, json};
use std::path::{Path, PathBuf};
use std::process::Command;

/// Runs the tasks of a plan in order, and returns the plan.
fn run_all(plan: &str) -> Value {
    let plan: Value = serde_json::from_str(plan).unwrap();
    for task in plan["steps"].as_array().unwrap().iter().flat_map(|step| step["tasks"].as_array().unwrap()) {
        let words: Vec<&str> = task.as_array().unwrap().iter().map(|w| w.as_str().unwrap()).collect();
        let done = Command::new(words[0]).args(&words[1..]).output().unwrap();
        assert!(done.status.success(), "{words:?}: {}", String::from_utf8_lossy(&done.stderr));
    }
    plan
}

/// The OpenJD command of the tests' Python environment. Without it, prints that the test is skipped.
fn openjd() -> Option<PathBuf> {
    let openjd = python().with_file_name("openjd");
    if openjd.is_file() {
        return Some(openjd);
    }
    println!("skipped: there is no {}; tests/run makes one", openjd.display());
    None
}

#[test]
fn openjd_runs_the_template_to_the_same_bytes() {
    let shot = Shot::get();
    let Some(openjd) = openjd() else { return };
    let folder = workplace();
    let out = folder.path().join("out");
    let options = ["--format", "openjd", "--segment", "6", "--chunk", "4", "--no-validate"];
    let template = folder.path().join("job.json");
    std::fs::write(&template, shot.plan(&out, &options)).unwrap();
    let checked = Command::new(&openjd).arg("check").arg(&template).output().unwrap();
    assert!(checked.status.success(), "{}", String::from_utf8_lossy(&checked.stdout));
    // The worker has the scene at another path than the author.
    let rules = folder.path().join("rules.json");
    let rule =
        json!({ "source_path_format": "POSIX", "source_path": "/show", "destination_path": shot.path("") });
    std::fs::write(&rules, json!({ "version": "pathmapping-1.0", "path_mapping_rules": [rule] }).to_string())
        .unwrap();
    let ran = Command::new(&openjd)
        .arg("run")
        .arg(&template)
        .args(["--step", "assemble", "--run-dependencies", "--path-mapping-rules"])
        .arg(format!("file://{}", rules.display()))
        .args(["-p", "Groom=/show/groom.json", "-p", "Anim=/show/shake.json"])
        .args(["-p", &format!("Output={}", out.display())])
        .output()
        .unwrap();
    let said = String::from_utf8_lossy(&ran.stdout).into_owned();
    assert!(ran.status.success(), "{said}\n{}", String::from_utf8_lossy(&ran.stderr));
    assert!(said.contains("openjd_progress: 100.0"), "{said}");
    std::fs::remove_file(out.join("sheet.png")).unwrap();
    shot.assert_same(&out);
}

#[test]
fn the_examples_are_the_output_of_plan() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let folder = workplace();
    // The examples name the sample at a path as in a studio.
    let rules = folder.path().join("rules.json");
    let rule = json!({ "source_path": "/show/shot", "destination_path": root.join("samples/short") });
    std::fs::write(&rules, json!({ "path_mapping_rules": [rule] }).to_string()).unwrap();
    let text = String::from_utf8(here(&root.join("pipeline/README.md"))).unwrap();
    let commands: Vec<&str> =
        text.lines().filter_map(|line| line.trim().strip_prefix("hairbake plan ")).collect();
    assert_eq!(commands.len(), 4);
    for line in commands {
        let (command, file) = line.split_once(" >").unwrap();
        let mut plan = hairbake();
        plan.arg("plan").args(command.split(' ')).env("HAIRBAKE_PATH_MAP_FILE", &rules);
        let printed = plan.assert().success().get_output().stdout.clone();
        let example = root.join("pipeline").join(file);
        if std::env::var_os("UPDATE_EXAMPLES").is_some() {
            std::fs::write(&example, &printed).unwrap();
        }
        assert!(here(&example) == printed, "{file} is out of date: UPDATE_EXAMPLES=1 writes it anew");
        if let Some(openjd) = openjd().filter(|_| file.ends_with(".json")) {
            assert!(
                Command::new(openjd).arg("check").arg(&example).output().unwrap().status.success(),
                "{file}"
            );
        }
    }
}

#[test]
fn the_tasks_of_a_plan_make_the_same_bytes() {
    let shot = Shot::get();
    let folder = workplace();
    let out = folder.path().join("out");
    run_all(&shot.plan(&out, &["--segment", "4", "--chunk", "3", "--no-validate"]));
    std::fs::remove_file(out.join("sheet.png")).unwrap();
    shot.assert_same(&out);
}

#[test]
fn wedges_bake_every_combination_and_one_sheet() {
    let shot = Shot::get();
    let folder = workplace();
    let out = folder.path().join("sweep");
    let options =
        ["--wedge", "substeps=2,4", "--wedge", "groom.materials[0].friction=0.1,0.4", "--no-validate"];
    let plan = run_all(&shot.plan(&out, &options));
    let steps = plan["steps"].as_array().unwrap();
    assert_eq!(steps.iter().filter(|s| s["name"].as_str().unwrap().ends_with("assemble")).count(), 4);
    assert_eq!(steps.last().unwrap()["needs"].as_array().unwrap().len(), 4);
    let names = entries(&out);
    assert_eq!(names[1], "002_substeps=2_friction=0.4");
    assert_eq!(names.len(), 5);
    assert!(here(&out.join("wedges.png")).len() > 10_000);
    let manifest: Value = serde_json::from_slice(&here(&out.join(&names[1]).join("manifest.json"))).unwrap();
    assert_eq!(manifest["settings"]["set"]["groom.materials[0].friction"], 0.4);
    assert_eq!(manifest["settings"]["substeps"], 2);
}

#[test]
fn status_lists_done_missing_stale_and_damaged_frames() {
    let shot = Shot::get();
    let folder = workplace();
    let out = folder.path();
    hairbake().arg("status").arg(out).assert().code(74);
    assert_eq!(shot.stage("simulate", out, &["--frames", "1000-1007"]), Some(0));
    assert_eq!(shot.stage("interpolate", out, &["--frames", "1001-1004"]), Some(0));
    std::fs::remove_file(out.join("hair.1002.usdc")).unwrap();
    std::fs::write(out.join("hair.1003.usdc"), "short").unwrap();
    let mark = out.join(".hairbake/frames/1004.json");
    let text = String::from_utf8(here(&mark)).unwrap();
    std::fs::write(&mark, text.replacen("\"key\":\"", "\"key\":\"0", 1)).unwrap();
    let output =
        hairbake().arg("status").arg(out).arg("--json").assert().code(75).get_output().stdout.clone();
    let status: Value = serde_json::from_slice(&output).unwrap();
    assert_eq!(status["states"]["done"], serde_json::json!((1000..=1007).collect::<Vec<i32>>()));
    let files = &status["files"];
    assert_eq!(files["done"], serde_json::json!([1001]));
    assert_eq!(files["damaged"], serde_json::json!([1003]));
    assert_eq!(files["stale"], serde_json::json!([1004]));
    assert_eq!(files["missing"].as_array().unwrap().len(), 10);
    assert!(shot.bake(out, &[]).status().unwrap().success());
    hairbake().arg("status").arg(out).arg("--checksums").assert().success();
    shot.assert_same(out);
}
