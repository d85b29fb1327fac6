//! The program as a black box: output, files and exit codes.

mod check;
mod free;
mod groups;
mod grow;
mod motion;

use crate::common::{Scene, bake, entries, hairbake, here};
use hairbake::cache::Reader;
use predicates::prelude::*;
use predicates::str::contains;
use serde_json::{Value, json};
use std::path::Path;

#[test]
fn help_and_version_go_to_standard_output() {
    hairbake().arg("--help").assert().success().stdout(contains("Exit codes").and(contains("--threads <N>")));
    hairbake().args(["bake", "--help"]).assert().success().stdout(contains("--substeps <N>"));
    hairbake().arg("--version").assert().success().stdout(contains(env!("CARGO_PKG_VERSION")));
    for command in [
        "check",
        "schema",
        "sample",
        "grow",
        "estimate",
        "bake",
        "plan",
        "status",
        "simulate",
        "interpolate",
        "assemble",
        "preview",
        "view",
        "read",
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
    hairbake().args(["man", "import", "groom"]).assert().success().stdout(contains("sag\\-free"));
    hairbake().args(["man", "shave"]).assert().code(64);
    hairbake().args(["-q", "import", "groom", "--help"]).assert().success();
}

#[test]
fn strict_refuses_penalty_contact() {
    let scene = Scene::import();
    let out = scene.folder.path().join("out");
    let mut bake = bake(&scene.groom, &scene.anim, &out);
    bake.args(["--contact", "penalty", "--strict"]);
    bake.assert().code(64).stdout("").stderr(contains("guarantees nothing"));
    assert!(!out.exists());
}

#[test]
fn sub_steps_are_halved_until_contacts_converge() {
    let sample = Path::new(env!("CARGO_MANIFEST_DIR")).join("samples/short");
    let folder = tempfile::tempdir().unwrap();
    // Round bodies: in the hollows of an ear some hair does not come to rest at one sub-step per frame.
    let bodies = r#"anim.colliders=[
        {"name": "skull", "body": "head",
         "shape": {"type": "sphere", "centre": [0, 0.158, -0.004], "radius": 0.076}},
        {"name": "face", "body": "head",
         "shape": {"type": "capsule", "ends": [[0, 0.15, 0.02], [0, 0.06, 0.04]], "radius": 0.058}}]"#;
    let totals = |wind: u32| {
        let (out, wind) = (
            folder.path().join(wind.to_string()),
            format!("anim.wind=[{{\"velocity_m_s\":[{wind},0,-{wind}]}}]"),
        );
        let mut bake = bake(&sample.join("groom.json"), &sample.join("turn.json"), &out);
        bake.args(["--frames", "1001-1004", "--substeps", "1", "--preroll", "0", "--curves", "guides"]);
        bake.args(["--strict", "--no-pictures", "--set", bodies, "--set", &wind]);
        let done = bake.assert().success();
        let warned = String::from_utf8_lossy(&done.get_output().stderr)
            .contains("contacts with bodies were not at rest");
        let totals = Reader::open(&out).unwrap().read_manifest().unwrap().totals;
        let residual = totals["contact_residual"].as_f64().unwrap();
        assert!(!warned && totals["unsettled"] == 0 && residual < 1e-3, "{totals:?}");
        totals["halvings"].as_u64().unwrap()
    };
    assert_eq!(totals(0), 0);
    // Storms press the hair into the head, at one sub-step per frame.
    assert!([60, 80, 90, 100].into_iter().all(|wind| totals(wind) > 0));
}

#[test]
fn strict_exits_with_1_if_a_guarantee_is_broken() {
    let sample = Path::new(env!("CARGO_MANIFEST_DIR")).join("samples/short");
    let folder = tempfile::tempdir().unwrap();
    let mut anim: Value =
        serde_json::from_str(&std::fs::read_to_string(sample.join("shake.json")).unwrap()).unwrap();
    // A ball in the hair beside the head: above it in one frame and below it in the next.
    let places = [[0.0, 0.3, 0.0], [0.0, 0.3, 0.0], [0.0, -0.3, 0.0], [0.0, -0.3, 0.0]];
    let track = json!({ "fps": 24.0, "first_frame": 1000, "translation": places, "pops": "keep" });
    anim["frames"] = json!([1001, 1002]);
    anim["bodies"].as_array_mut().unwrap().push(json!({ "name": "ball", "track": track }));
    let shape = json!({ "type": "sphere", "centre": [0.07, 0.12, 0.0], "radius": 0.02 });
    let ball = json!({ "name": "ball", "body": "ball", "shape": shape, "thickness_m": 0.0005 });
    anim["colliders"][0]["shape"]["file"] = json!(sample.join("head.obj"));
    anim["colliders"][1]["shape"]["file"] = json!(sample.join("bust.obj"));
    anim["colliders"].as_array_mut().unwrap().push(ball);
    let file = folder.path().join("anim.json");
    std::fs::write(&file, anim.to_string()).unwrap();
    let run = |strict: bool, out: &Path| {
        let mut bake = bake(&sample.join("groom.json"), &file, out);
        bake.args(["--substeps", "1", "--preroll", "0", "--curves", "guides"]);
        bake.args(if strict { &["--no-pictures", "--strict"][..] } else { &["--no-pictures"] });
        bake.assert()
    };
    let [strict, lax] = ["strict", "lax"].map(|name| folder.path().join(name));
    run(true, &strict)
        .code(1)
        .stderr(contains("crossings of a surface").and(contains("guarantees are broken")));
    run(false, &lax).success().stderr(contains("guides were stopped at a surface"));
    // The cache is the same without --strict.
    let [strict, lax] = [strict, lax].map(|out| Reader::open(&out).unwrap().read_manifest().unwrap());
    assert!(strict.totals["crossings"].as_u64() > Some(0) && strict.frames.len() == lax.frames.len());
}

#[test]
fn wrong_usage_exits_with_64() {
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
fn a_line_without_a_command_prints_the_help_and_exits_with_64() {
    let help = || contains("Render farm:").and(contains("Examples:"));
    hairbake().assert().code(64).stdout("").stderr(help());
    // A variable of the environment is not an argument.
    hairbake().env("HAIRBAKE_THREADS", "4").assert().code(64).stdout("").stderr(help());
}

#[test]
fn mistyped_commands_are_corrected() {
    let lines =
        [(["chek", "a.json"], "check"), (["previw", "out"], "preview"), (["import", "grom"], "groom")];
    for (line, similar) in lines {
        let message = format!("did you mean `{similar}`?");
        hairbake().args(line).assert().code(64).stdout("").stderr(contains(message));
    }
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

/// Runs a line in a shell, with the program as $0 and `arguments` from $1 on. A failure in a pipe fails the
/// line.
fn shell(line: &str, arguments: &[&Path]) -> std::process::Output {
    let mut command = std::process::Command::new("bash");
    command.args(["-c", &format!("set -o pipefail; {line}")]).arg(assert_cmd::cargo::cargo_bin!("hairbake"));
    command.args(arguments).output().unwrap()
}

#[test]
fn a_closed_output_is_not_an_error() {
    let scene = Scene::import();
    let out = scene.folder.path().join("out");
    for line in [
        "$0 schema anim | true",
        "$0 man | true",
        "$0 plan $1 $2 -o $3 --chunk 1 --segment 1 | head -1 | grep -q {",
        "$0 $1 $2 -o $3 --frames 1001-1002 --no-pictures 2>&1 | true",
        "$0 $1 $2 -o $3 --frames 1001-1003 --no-pictures --log-format json 2>&1 | true",
        "$0 $1 $2 -o $3 --frames 1001-1004 --no-pictures --progress alf 2>&1 | head -1",
        "$0 $1 $2 -o $3 --frames 1001-1005 --no-pictures 2>&- >&-",
        "$0 status $3 | true",
        "$0 read $3 | true",
        "$0 read $3 guides.points | head -c 1 >/dev/null",
    ] {
        let output = shell(line, &[&scene.groom, &scene.anim, &out]);
        assert_eq!(output.status.code(), Some(0), "{line}: {}", String::from_utf8_lossy(&output.stderr));
    }
}

#[test]
fn an_array_of_a_cache_is_written_whole_or_not_at_all() {
    let scene = Scene::import();
    let out = scene.folder.path().join("out");
    messages(&scene, &[]);
    let [first, second] = ["new/points.npy", "all.npy"].map(|name| scene.folder.path().join(name));
    let read = |arguments: &[&str], file: &Path| {
        hairbake().arg("read").arg(&out).args(arguments).arg("-o").arg(file).assert()
    };
    read(&["guides.points", "--frames", "1001,1002"], &first).success();
    read(&["guides.points"], &second).success();
    let [two, four] = [&first, &second].map(|file| std::fs::metadata(file).unwrap().len());
    let header = 128;
    assert_eq!((four - header) / 2, two - header);
    // A frame that is missing is found before anything is written.
    let before = std::fs::read(&first).unwrap();
    read(&["guides.points", "--frames", "1001,1009"], &first).code(64).stderr(contains("no frame 1009"));
    read(&["guides.widths", "--frames", "1001"], &first).code(64).stderr(contains("does not move"));
    read(&["guides.colour"], &first).code(64).stderr(contains("guides.counts"));
    std::fs::remove_file(out.join("hair.1002.usdc")).unwrap();
    read(&["guides.points", "--frames", "1001,1002"], &first).code(64);
    assert_eq!(std::fs::read(&first).unwrap(), before);
    hairbake().args(["read", "no-cache"]).assert().code(65);
}

/// The lines on standard error of a bake of four frames.
fn messages(scene: &Scene, options: &[&str]) -> Vec<String> {
    let out = scene.folder.path().join("out");
    let mut command = bake(&scene.groom, &scene.anim, &out);
    command.args(["--frames", "1001-1002", "--preroll", "0.1", "--no-pictures"]).args(options);
    let output = command.assert().success().stdout("").get_output().stderr.clone();
    String::from_utf8(output).unwrap().lines().map(String::from).collect()
}

#[test]
fn progress_has_the_format_of_each_queue() {
    let scene = Scene::import();
    let percent = |lines: &[String], before: &str, after: &str| -> Vec<f64> {
        let number = |line: &String| line.strip_prefix(before)?.strip_suffix(after)?.parse().ok();
        lines.iter().filter_map(number).collect()
    };
    let alf = percent(&messages(&scene, &["--progress", "alf"]), "ALF_PROGRESS ", "%");
    assert_eq!((alf[0], alf[alf.len() - 1]), (25.0, 100.0));
    let openjd = percent(&messages(&scene, &["--progress", "openjd"]), "openjd_progress: ", "");
    assert_eq!((openjd[0], openjd[openjd.len() - 1]), (25.0, 100.0));
    let none = messages(&scene, &["--progress", "none"]);
    assert!(none.iter().all(|line| !line.contains("of 4")), "{none:?}");
    assert!(
        messages(&scene, &["--progress", "lines"]).iter().any(|line| line.starts_with("frame 1003 (4 of 4)"))
    );
}

#[test]
fn json_logs_have_one_object_per_line() {
    let scene = Scene::import();
    let objects = |lines: Vec<String>| -> Vec<serde_json::Value> {
        lines
            .iter()
            .map(|line| serde_json::from_str(line).unwrap_or_else(|e| panic!("{line}: {e}")))
            .collect()
    };
    let lines = objects(messages(&scene, &["--log-format", "json"]));
    let has = |line: &serde_json::Value, name: &str| line[name].is_string();
    assert!(lines.iter().all(|line| ["timestamp", "level", "message"].iter().all(|name| has(line, name))));
    assert!(lines.iter().any(|line| line["level"] == "WARN"), "the ball has triangles of no area");
    let last = lines.iter().rfind(|line| line["done"] == 4).unwrap();
    assert_eq!((&last["frame"], &last["total"]), (&1003.into(), &4.into()));
    assert!(lines.iter().any(|line| line["message"].as_str().unwrap().contains("look at")));

    std::fs::write(
        &scene.anim,
        "{ \"format\": \"hairbake-anim\", \"version\": 1, \"fps\": 0, \"frames\": [1, 2] }",
    )
    .unwrap();
    let mut command = hairbake();
    command.arg("check").arg(&scene.anim).env("HAIRBAKE_LOG_FORMAT", "json");
    let output = String::from_utf8(command.assert().code(65).get_output().stderr.clone()).unwrap();
    let lines = objects(output.lines().map(String::from).collect());
    assert_eq!((&lines[0]["level"], &lines[0]["key"]), (&"ERROR".into(), &"fps".into()));
    assert_eq!(lines[lines.len() - 1]["exit_code"], 65);
}

#[test]
fn paths_are_mapped_in_files_and_on_the_command_line() {
    let scene = Scene::import();
    let folder = scene.folder.path();
    let frame = |name: &str, groom: &Path, anim: &Path, options: &[&str]| {
        let out = folder.join(name);
        let mut command = bake(groom, anim, &out);
        command.args(["--frames", "1001-1001", "--preroll", "0.1", "--no-pictures"]).args(options);
        (command.assert(), out)
    };
    let read = |out: &Path| here(&out.join("hair.1001.usdc"));
    let (done, plain) = frame("plain", &scene.groom, &scene.anim, &[]);
    done.success();
    let text = String::from_utf8(here(&scene.anim)).unwrap();
    assert!(text.contains("\"../ball.obj\""), "{text}");
    std::fs::write(&scene.anim, text.replace("\"../ball.obj\"", "\"Z:\\\\show\\\\ball.obj\"")).unwrap();
    frame("unmapped", &scene.groom, &scene.anim, &[]).0.code(65).stderr(contains("ball.obj"));

    let here = folder.to_str().unwrap();
    let option = ["--path-map", &format!("Z:\\show={here}")];
    let (done, mapped) = frame("mapped", &scene.groom, &scene.anim, &option);
    done.success();
    assert_eq!(read(&mapped), read(&plain));
    let rule = |from: &str| serde_json::json!({ "source_path_format": "POSIX", "source_path": from, "destination_path": here });
    let rules = serde_json::json!({ "version": "pathmapping-1.0", "path_mapping_rules": [rule("Z:\\show"), rule("/far")] });
    std::fs::write(folder.join("rules.json"), rules.to_string()).unwrap();
    let option = ["--path-map-file", &format!("{here}/rules.json")];
    let far = ["/far/shot/groom.json", "/far/shot/anim.json"].map(Path::new);
    let (done, mapped) = frame("file", far[0], far[1], &option);
    done.success();
    assert_eq!(read(&mapped), read(&plain));
    frame("none", far[0], far[1], &["--path-map-file", "no-such.json"]).0.code(78);
}

#[test]
fn an_imported_scene_bakes_to_a_cache_with_pictures() {
    let scene = Scene::import();
    hairbake()
        .arg("check")
        .args([&scene.groom, &scene.anim])
        .assert()
        .success()
        .stderr(contains("no errors"));
    let out = scene.folder.path().join("cache");
    bake(&scene.groom, &scene.anim, &out)
        .args(["--frames", "1002-1004", "--preroll", "0.1", "--figures"])
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
    let turn = manifest["totals"]["segment_turn_rad"].as_f64().unwrap();
    assert!(1e-3 < turn && turn < 3.0, "{turn}");
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
    films(scene.folder.path(), &out);

    // A second bake without pictures removes those of the first.
    bake(&scene.groom, &scene.anim, &out)
        .args(["--frames", "1002-1002", "--preroll", "0", "--no-pictures", "--quiet", "--overwrite"])
        .assert()
        .success()
        .stderr("");
    assert!(!out.join("sheet.png").exists() && out.join("report.html").exists());
    assert!(!out.join("hair.1004.usdc").exists());
}

/// A film of `cache` is the work of ffmpeg, here a script; without it nothing is written.
#[cfg(unix)]
fn films(folder: &Path, cache: &Path) {
    use std::os::unix::fs::PermissionsExt;
    let (film, path) = (folder.join("film.mp4"), folder.join("bin"));
    let make = || {
        let mut preview = hairbake();
        preview.env("PATH", format!("{}:/usr/bin:/bin", path.display()));
        preview.arg("preview").arg(cache).args(["--size", "33x20", "-o"]).arg(&film);
        preview.assert()
    };
    std::fs::create_dir(&path).unwrap();
    let fake = |script: &str| {
        std::fs::write(path.join("ffmpeg"), format!("#!/bin/sh\n{script}\n")).unwrap();
        std::fs::set_permissions(path.join("ffmpeg"), PermissionsExt::from_mode(0o755)).unwrap();
    };
    fake("for made; do :; done; cat >\"$made\"");
    make().success().stderr(contains("film.mp4"));
    assert_eq!(here(&film).len(), 3 * 33 * 20 * 3, "frames without handles");
    fake("echo no such codec >&2; exit 1");
    make().code(78).stderr(contains("film.mp4: no such codec"));
    let mut preview = hairbake();
    preview.env("PATH", "").arg("preview").arg(cache).args(["--size", "33x20", "-o"]).arg(&film);
    std::fs::write(folder.join("film.gif"), "another").unwrap();
    preview
        .assert()
        .code(78)
        .stderr(contains("there is no ffmpeg on the path, which ").and(contains("film.mp4")));
    assert_eq!(here(&folder.join("film.gif")), b"another");
    assert_eq!(here(&film).len(), 3 * 33 * 20 * 3, "the film of before");
}

#[cfg(not(unix))]
fn films(_: &Path, _: &Path) {}

#[test]
fn results_do_not_depend_on_the_number_of_threads() {
    let scene = Scene::import();
    let mut caches = Vec::new();
    for threads in ["1", "2"] {
        let out = scene.folder.path().join(threads);
        bake(&scene.groom, &scene.anim, &out)
            .args(["--frames", "1001-1004", "--preroll", "0.1", "--no-pictures", "--threads", threads])
            .assert()
            .success();
        let mut files = entries(&out);
        // The reports contain timings; the tests of the farm compare the work files.
        files.retain(|name| !name.starts_with("report.") && name != ".hairbake");
        let bytes: Vec<_> =
            files.iter().map(|name| hairbake::cache::sha256(&here(&out.join(name)))).collect();
        caches.push((files, bytes));
    }
    assert_eq!(caches[0].0.len(), 6 + 4);
    assert_eq!(caches[0], caches[1]);
}

#[test]
fn groom_and_head_may_have_different_units() {
    let scene = Scene::import();
    let groom = hairbake::scene::load_groom(&scene.groom).unwrap();
    let anim = hairbake::scene::load_anim(&scene.anim).unwrap();
    assert_eq!(groom.convention.metres_per_unit, 0.01);
    assert!((groom.guides.curves.points[0].norm() - 0.1).abs() < 1e-6);
    let hairbake::geometry::Shape::Mesh(ball) = &anim.colliders[0].shape else { panic!("no mesh") };
    assert!((ball.vertices[0].norm() - 0.1).abs() < 1e-6);
    let head = anim.head_pose(anim.time(1001.0)).translation.vector;
    assert!((head - nalgebra::Vector3::new(0.0, 1.5, 0.0)).norm() < 1e-6, "{head}");
}

#[test]
fn samples_are_written() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("all");
    hairbake()
        .args(["sample", "all", "--wisps", "8", "--strands", "8", "--head-subdivisions", "1", "-o"])
        .arg(&out)
        .assert()
        .success();
    let styles = ["bob", "braid", "buzz", "coils", "long", "long-curly", "ponytail", "short", "short-curly"];
    assert_eq!(entries(&out), styles);
    let (meshes, motions) =
        (["bust.obj", "groom.bin", "groom.json", "head.obj"], ["jump", "look", "nod", "shake", "turn"]);
    let files: Vec<String> =
        meshes.map(String::from).into_iter().chain(motions.map(|m| format!("{m}.json"))).collect();
    assert_eq!(entries(&out.join("long")), files);
}

#[test]
fn a_python_without_usd_is_reported() {
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
fn validate_reports_damage_and_exits_with_its_code() {
    let Some(python) = crate::common::python_with_usd() else { return };
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

#[test]
fn a_dry_run_prints_the_origin_of_each_value_and_writes_nothing() {
    let scene = Scene::import();
    let mut anim: serde_json::Value = serde_json::from_slice(&here(&scene.anim)).unwrap();
    anim["settings"] = serde_json::json!({ "nodes": 6, "preroll_s": 0.1 });
    std::fs::write(&scene.anim, anim.to_string()).unwrap();
    let out = scene.folder.path().join("out");
    let mut command = bake(&scene.groom, &scene.anim, &out);
    command.args(["--substeps", "3", "--set", "anim.settings.scheme=backward-euler", "--dry-run"]);
    command.env("HAIRBAKE_CHECKPOINT_SECONDS", "7").env("SLURM_CPUS_PER_TASK", "1");
    let output = command.assert().success().get_output().stdout.clone();
    let text = String::from_utf8(output).unwrap();
    let file = scene.anim.display().to_string();
    for (name, value, origin) in [
        ("substeps", "3", "--substeps"),
        ("preroll", "0.1", file.as_str()),
        ("nodes", "6", &file),
        ("scheme", "backward-euler", "--set"),
        ("contact", "volume", "default"),
        ("checkpoint-seconds", "7", "HAIRBAKE_CHECKPOINT_SECONDS"),
        ("threads", "1", "SLURM_CPUS_PER_TASK"),
        ("max-runtime", "none", "default"),
    ] {
        let row =
            text.lines().find(|line| line.starts_with(name)).unwrap_or_else(|| panic!("no {name}:\n{text}"));
        let words: Vec<_> = row.split_whitespace().collect();
        assert_eq!(words[1..], [value, origin], "{text}");
    }
    assert!(!out.exists());
}

#[test]
fn an_estimate_matches_the_bake() {
    let scene = Scene::import();
    let out = scene.folder.path().join("out");
    let mut command = hairbake();
    command.arg("estimate").args([&scene.groom, &scene.anim]).arg("-o").arg(&out);
    let output = command.assert().success().get_output().stdout.clone();
    let text = String::from_utf8(output).unwrap();
    assert!(!out.exists());
    let number = |name: &str| -> f64 {
        let row = text.lines().find(|line| line.starts_with(name)).unwrap();
        row.split_whitespace().nth(1).unwrap().parse().unwrap()
    };
    bake(&scene.groom, &scene.anim, &out).arg("--no-pictures").assert().success();
    let bytes = |name: &String| std::fs::metadata(out.join(name)).unwrap().len();
    let layers: u64 = entries(&out).iter().filter(|name| name.contains(".usd")).map(bytes).sum();
    assert!((number("disk") - layers as f64 * 1e-6).abs() < 0.051, "{text} {layers}");
    assert!(number("memory") > 1.0 && number("time") < 600.0, "{text}");
}
