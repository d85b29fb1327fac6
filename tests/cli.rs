//! The program as a black box: what it prints, what it writes, and how it ends.

mod common;

use common::{Scene, bake, entries, hairbake, here};
use predicates::prelude::*;
use predicates::str::contains;

#[test]
fn help_and_version_are_data() {
    hairbake()
        .arg("--help")
        .assert()
        .success()
        .stdout(contains("Exit codes").and(contains("--substeps <N>")));
    hairbake().arg("--version").assert().success().stdout(contains(env!("CARGO_PKG_VERSION")));
    for command in [
        "check",
        "schema",
        "sample",
        "simulate",
        "interpolate",
        "assemble",
        "preview",
        "validate",
        "completions",
        "man",
    ] {
        hairbake().args([command, "--help"]).assert().success().stdout(contains("Usage"));
    }
    for what in ["groom", "track"] {
        hairbake().args(["import", what, "--help"]).assert().success().stdout(contains("Examples"));
    }
    hairbake().args(["completions", "bash"]).assert().success().stdout(contains("_hairbake"));
    hairbake().arg("man").assert().success().stdout(contains(".TH hairbake"));
}

#[test]
fn wrong_usage_is_64() {
    let wrong: [&[&str]; 10] = [
        &[],
        &["groom.json"],
        &["groom.json", "anim.json"],
        &["groom.json", "anim.json", "-o", "out", "--substeps", "0"],
        &["groom.json", "anim.json", "-o", "out", "--frames", "9-3"],
        &["groom.json", "anim.json", "-o", "out", "--preroll", "nan"],
        &["schema", "hair"],
        &["sample", "bald", "-o", "out"],
        &["preview", "out"],
        &["import", "groom", "a.tfx", "-o", "b.json", "--units", "furlong"],
    ];
    for arguments in wrong {
        hairbake().args(arguments).assert().code(64).stdout("").stderr(contains("--help"));
    }
    hairbake().env("HAIRBAKE_THREADS", "many").args(["schema", "groom"]).assert().code(64);
}

#[test]
fn schemas_are_json_schema() {
    for format in ["groom", "anim"] {
        let output = hairbake().args(["schema", format]).assert().success().get_output().stdout.clone();
        let schema: serde_json::Value = serde_json::from_slice(&output).unwrap();
        assert_eq!(schema["type"], "object");
        assert!(schema["$schema"].as_str().unwrap().contains("json-schema.org"));
        assert!(schema["properties"]["version"].is_object());
    }
}

#[test]
fn a_closed_output_is_no_failure() {
    let mut child = std::process::Command::new(assert_cmd::cargo::cargo_bin!("hairbake"))
        .args(["schema", "anim"])
        .stdout(std::process::Stdio::piped())
        .spawn()
        .unwrap();
    drop(child.stdout.take());
    assert!(child.wait().unwrap().success());
}

#[test]
fn strands_and_a_track_become_a_cache_with_pictures() {
    let scene = Scene::import();
    hairbake().arg("check").args([&scene.groom, &scene.anim]).assert().success().stderr(contains("no fault"));
    let out = scene.folder.path().join("cache");
    bake(&scene.groom, &scene.anim, &out)
        .args(["--frames", "1002-1004", "--preroll", "0.1"])
        .assert()
        .success()
        .stdout("")
        .stderr(contains("s/frame").and(contains("sheet.png")).and(contains("penetration")));

    let manifest = here(&out.join("manifest.json"));
    let manifest: serde_json::Value = serde_json::from_slice(&manifest).unwrap();
    assert_eq!(manifest["summary"]["frames"], serde_json::json!([1002, 1004]));
    assert_eq!(manifest["summary"]["hair"][0], 32);
    assert_eq!(manifest["settings"]["preroll_s"], 0.1);
    assert_eq!(manifest["frames"].as_array().unwrap().len(), 5);
    let notes = manifest["scene_figures"]["groom_notes"].to_string();
    let folder = scene.folder.path().to_string_lossy();
    assert!(notes.contains("8 kept") && !notes.contains(&*folder), "{notes}");
    assert!(manifest["totals"]["length_drift"].as_f64().unwrap() < 1.0);
    let inputs: Vec<_> = manifest["inputs"].as_array().unwrap().iter().collect();
    let roles: Vec<_> = inputs.iter().map(|i| i["role"].as_str().unwrap()).collect();
    assert_eq!(roles, ["groom", "buffer", "anim", "collider"]);
    assert_eq!(inputs[0]["sha256"], hairbake::cache::sha256(&here(&scene.groom)));
    assert_eq!(inputs[3]["file"], "ball.obj");

    assert!(here(&out.join("sheet.png")).len() > 10_000);
    assert!(String::from_utf8(here(&out.join("report.html"))).unwrap().contains("data:image/png"));
    let report: serde_json::Value = serde_json::from_slice(&here(&out.join("report.json"))).unwrap();
    assert_eq!(report["frames"], serde_json::json!([1001, 1002, 1003, 1004, 1005]));

    let sheet = scene.folder.path().join("sheet.png");
    let moving = scene.folder.path().join("moving.gif");
    hairbake()
        .arg("preview")
        .arg(&out)
        .arg("-o")
        .arg(&sheet)
        .arg("--animate")
        .arg(&moving)
        .args(["--size", "80", "--pictures", "2", "--curves", "both"])
        .assert()
        .success();
    let picture = png::Decoder::new(std::io::Cursor::new(here(&sheet))).read_info().unwrap().info().clone();
    assert_eq!((picture.width, picture.height), (2 * 84 + 4, 84 + 4));
    assert!(here(&moving).starts_with(b"GIF89a"));
    hairbake().arg("preview").arg(&out).args(["-o", "x.png", "--frames", "1-2"]).assert().code(64);

    // A second bake without pictures leaves none of the first's.
    bake(&scene.groom, &scene.anim, &out)
        .args(["--frames", "1002-1002", "--preroll", "0", "--no-pictures", "--quiet"])
        .assert()
        .success()
        .stderr("");
    assert!(!out.join("sheet.png").exists() && out.join("report.html").exists());
    assert!(!out.join("hair.1004.usdc").exists());
}

#[test]
fn threads_do_not_change_a_bit() {
    let scene = Scene::import();
    let mut caches = Vec::new();
    for threads in ["1", "2"] {
        let out = scene.folder.path().join(threads);
        bake(&scene.groom, &scene.anim, &out)
            .args(["--frames", "1001-1004", "--preroll", "0.1", "--no-pictures", "--threads", threads])
            .assert()
            .success();
        let mut files = entries(&out);
        // The reports hold timings; what the bake goes on from is held to its bytes by the tests of the farm.
        files.retain(|name| !name.starts_with("report.") && name != ".hairbake");
        let bytes: Vec<_> =
            files.iter().map(|name| hairbake::cache::sha256(&here(&out.join(name)))).collect();
        caches.push((files, bytes));
    }
    assert_eq!(caches[0].0.len(), 6 + 4);
    assert_eq!(caches[0], caches[1]);
}

#[test]
fn centimetres_and_metres_mix() {
    let scene = Scene::import();
    let groom = hairbake::scene::load_groom(&scene.groom).unwrap();
    let anim = hairbake::scene::load_anim(&scene.anim).unwrap();
    assert_eq!(groom.convention.metres_per_unit, 0.01);
    assert!((groom.guides.curves.points[0].norm() - 0.1).abs() < 1e-6);
    let hairbake::scene::Shape::Mesh(ball) = &anim.colliders[0].shape else { panic!("no mesh") };
    assert!((ball.vertices[0].norm() - 0.1).abs() < 1e-6);
    let head = anim.head_pose(anim.time(1001.0)).translation.vector;
    assert!((head - nalgebra::Vector3::new(0.0, 1.5, 0.0)).norm() < 1e-6, "{head}");
}

#[test]
fn samples_are_written() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("all");
    hairbake()
        .args(["sample", "all", "--wisps", "8", "--strands", "8", "--head-rounds", "1", "-o"])
        .arg(&out)
        .assert()
        .success();
    assert_eq!(entries(&out), ["long", "long-curly", "short", "short-curly"]);
    let files = entries(&out.join("long"));
    assert_eq!(files, ["groom.bin", "groom.json", "head.obj", "shake.json", "turn.json"]);
}

#[test]
fn a_python_without_usd_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let asked = |python: &str| {
        let mut command = hairbake();
        command.env("HAIRBAKE_PYTHON", python).arg("validate").arg(folder.path());
        command.assert().code(78).stderr(contains(python.to_string()).and(contains("pip install usd-core")))
    };
    asked("/no/such/python");
    asked("false");
}

#[test]
fn validation_says_what_is_wrong_and_how_it_ended() {
    let Some(python) = common::python_with_usd() else { return };
    let scene = Scene::import();
    let out = scene.folder.path().join("cache");
    bake(&scene.groom, &scene.anim, &out)
        .args(["--frames", "1001-1003", "--preroll", "0.1", "--no-pictures"])
        .assert()
        .success();
    let json = scene.folder.path().join("report.json");
    let validate = || {
        let mut command = hairbake();
        command.env("HAIRBAKE_PYTHON", &python).arg("validate").arg(&out).arg("--json").arg(&json);
        command
    };
    std::fs::write(out.join("hair.1002.usdc"), b"PXR-USDC, cut short").unwrap();
    validate().assert().code(1).stdout(contains("hair.1002.usdc"));
    let report: serde_json::Value = serde_json::from_slice(&here(&json)).unwrap();
    assert!(report.to_string().contains("1002"));
    std::fs::remove_dir_all(&out).unwrap();
    validate().assert().code(65);
}
