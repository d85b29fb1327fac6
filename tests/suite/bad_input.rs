//! Bad input: every error in one report, exit code 65, nothing written.

use crate::common::{Scene, bake, entries};
use assert_cmd::assert::Assert;
use predicates::str::contains;
use serde_json::{Value, json};
use std::path::Path;

/// Bakes the scene after `change` of its groom and animation. The bake must not make an output folder.
fn baked(change: impl FnOnce(&mut Value, &mut Value)) -> Assert {
    let scene = Scene::import();
    let read = |path: &Path| serde_json::from_slice::<Value>(&crate::common::here(path)).unwrap();
    let (mut groom, mut anim) = (read(&scene.groom), read(&scene.anim));
    change(&mut groom, &mut anim);
    std::fs::write(&scene.groom, groom.to_string()).unwrap();
    std::fs::write(&scene.anim, anim.to_string()).unwrap();
    let out = scene.folder.path().join("out");
    let assert = bake(&scene.groom, &scene.anim, &out).assert();
    assert!(!out.exists(), "an output folder was made");
    assert
}

/// The report of a bake that is refused as bad input, without its line breaks.
fn refused(change: impl FnOnce(&mut Value, &mut Value)) -> String {
    let text = joined(&baked(change).code(65).stdout(""));
    assert!(text.contains("nothing written") && text.contains("allowed:"), "{text}");
    text
}

/// What a command said on standard error, without its line breaks.
fn joined(said: &Assert) -> String {
    let text = String::from_utf8_lossy(&said.get_output().stderr);
    text.split_whitespace().filter(|word| !matches!(*word, "│" | "╰─▶")).collect::<Vec<_>>().join(" ")
}

#[track_caller]
fn says(text: &str, words: &[&str]) {
    for word in words {
        assert!(text.contains(word), "{word:?} is not in:\n{text}");
    }
}

#[test]
fn errors_in_both_files_are_in_one_report() {
    let text = refused(|groom, anim| {
        groom["materials"][0]["density_kg_m3"] = json!(-5.0);
        groom["version"] = json!(9);
        anim["fps"] = json!("fast");
        anim["colour"] = json!("red");
        anim.as_object_mut().unwrap().remove("frames");
    });
    says(&text, &["5 errors", "density_kg_m3", "-5", "version", "9", "fps", "fast", "colour", "frames"]);
    says(&text, &["groom.json", "anim.json"]);
}

#[test]
fn nan_is_rejected() {
    // JSON has no NaN, but some exporters write it.
    let scene = Scene::import();
    let text = String::from_utf8(crate::common::here(&scene.anim)).unwrap();
    std::fs::write(&scene.anim, text.replacen("\"fps\": 24", "\"fps\": NaN", 1)).unwrap();
    let out = scene.folder.path().join("out");
    let assert = bake(&scene.groom, &scene.anim, &out).assert().code(65);
    let text = String::from_utf8_lossy(&assert.get_output().stderr).into_owned();
    says(&text, &["anim.json", "invalid JSON", "NaN"]);
    assert!(!out.exists());
}

#[test]
fn tracks_with_gaps_pops_or_missing_frames_are_rejected() {
    let track = |anim: &mut Value| anim["bodies"][0]["track"].clone();
    let text = refused(|_, anim| {
        let mut gap = track(anim);
        gap["frames"] = json!([0, 1, 2, 3, 5, 6, 7, 8]);
        anim["bodies"][0]["track"] = gap;
    });
    says(&text, &["bodies[0].track.frames", "bridge"]);
    let text = refused(|_, anim| {
        let mut unordered = track(anim);
        unordered["frames"] = json!([0, 1, 2, 4, 3, 5, 6, 7]);
        anim["bodies"][0]["track"] = unordered;
    });
    says(&text, &["bodies[0].track.frames", "increas"]);
    let text = refused(|_, anim| anim["bodies"][0]["track"]["translation"][4] = json!([0.4, 1.5, 0.0]));
    says(&text, &["jumps there and back", "0.4000 m", "1005"]);
    let text = refused(|_, anim| anim["frames"] = json!([1001, 1040]));
    says(&text, &["covers frames", "1040", "shorten \"frames\""]);
    let text = refused(|_, anim| anim["frames"] = json!([1008, 1001]));
    says(&text, &["frames", "1008"]);
}

#[test]
fn samples_far_from_the_origin_are_rejected_by_their_value() {
    // The squares of the first are infinite; the last is far by its unit.
    for (x, unit, shown) in [
        (1e300, 1.0, "1.000e300"),
        (-1e100, 1.0, "-1.000e100"),
        (2e6, 1.0, "2.000e6"),
        (2e8, 0.01, "2.000e6"),
    ] {
        let text = refused(|_, anim| {
            anim["metres_per_unit"] = json!(unit);
            anim["bodies"][0]["track"]["translation"][3] = json!([x, 1.5, 0.0]);
            // A track may follow jumps, but to no other place.
            anim["bodies"][0]["track"]["pops"] = json!("keep");
        });
        says(&text, &["1 error", "bodies[0].track.translation[3]", &format!("is at ({shown},")]);
        says(&text, &["allowed: up to 1e6 m from the origin"]);
    }
}

#[test]
fn a_wrong_rate_gives_no_errors_of_times() {
    for fps in [-24.0, 0.0, 1e300] {
        let text = refused(|_, anim| anim["fps"] = json!(fps));
        says(&text, &["1 error", "fps", "is out of range", "allowed: 1 to 1000"]);
        let text = refused(|_, anim| anim["bodies"][0]["track"]["fps"] = json!(fps));
        says(&text, &["1 error", "bodies[0].track.fps", "is out of range"]);
    }
    // What does not depend on it is reported as well.
    let text = refused(|_, anim| {
        anim["fps"] = json!(-24);
        anim["bodies"][0]["track"]["frames"] = json!([0, 1, 2, 3, 5, 6, 7, 8]);
    });
    says(&text, &["2 errors", "fps: -24 is out of range", "bodies[0].track.frames"]);
}

#[test]
fn frames_outside_the_shot_are_rejected() {
    let scene = Scene::import();
    let out = scene.folder.path().join("out");
    let assert = bake(&scene.groom, &scene.anim, &out).args(["--frames", "990-1003"]).assert().code(65);
    says(&String::from_utf8_lossy(&assert.get_output().stderr), &["990 to 1003", "1001 to 1008"]);
    assert!(!out.exists());
}

#[test]
fn pinned_and_free_roots_follow_no_wisp() {
    let scene = Scene::import();
    let read = |path: &Path| serde_json::from_slice::<Value>(&crate::common::here(path)).unwrap();
    let mut anim = read(&scene.anim);
    for (hold, resolution) in [("pinned", "coarse"), ("free", "adaptive")] {
        anim["roots"] = json!([{ "name": "roots", "hold": hold }]);
        std::fs::write(&scene.anim, anim.to_string()).unwrap();
        let out = scene.folder.path().join(hold);
        let assert =
            bake(&scene.groom, &scene.anim, &out).args(["--resolution", resolution]).assert().code(65);
        let text = String::from_utf8_lossy(&assert.get_output().stderr).into_owned();
        says(&text, &["settings.resolution", resolution, "roots are pinned or free", "full, or auto"]);
        assert!(!out.exists());
        bake(&scene.groom, &scene.anim, &out).args(["--frames", "1001-1001"]).assert().success();
    }
}

#[test]
fn empty_wisps_and_zero_length_strands_are_rejected() {
    let one_guide = |points: Value| json!({ "format": "hairbake-groom", "version": 1, "guides": { "points": points, "vertices": [3] } });
    let text = refused(|groom, _| *groom = one_guide(json!([[0, 0, 0], [0, 0, 0], [0, 0, 0]])));
    says(&text, &["guides.points", "length"]);
    let text = refused(|groom, _| {
        let leaves = groom["wisps"]["guide_count"].as_array().map_or(0, Vec::len);
        groom["wisps"]["guide_count"] = json!(vec![0; leaves]);
    });
    says(&text, &["wisps", "guide"]);
}

#[test]
fn missing_and_empty_meshes_are_rejected() {
    let mesh = |file: &str| json!({ "type": "mesh", "file": file });
    let text = refused(|_, anim| anim["colliders"][0]["shape"] = mesh("no-such.obj"));
    says(&text, &["colliders[0].shape.file", "no-such.obj"]);
    let scene = Scene::import();
    std::fs::write(scene.folder.path().join("ball.obj"), "v 0 0 0\nv 1 0 0\n").unwrap();
    let out = scene.folder.path().join("out");
    let assert = bake(&scene.groom, &scene.anim, &out).assert().code(65);
    says(&String::from_utf8_lossy(&assert.get_output().stderr), &["ball.obj", "has no triangles"]);
    assert!(!out.exists());
}

/// A scene of one straight guide of 30 cm that goes through the middle of a ball of `radius`, m.
fn through_a_ball(radius: f64) -> Scene {
    let scene = Scene::import();
    let points: Vec<Value> = (0..=30).map(|i| json!([0.0, 0.0, -0.01 * f64::from(i)])).collect();
    let groom = json!({
        "format": "hairbake-groom", "version": 1,
        // A bristle, which keeps its shape.
        "materials": [{ "name": "bristle", "section": { "radius_m": 0.0005 } }],
        "guides": { "points": points, "vertices": [31] }
    });
    let mut anim: Value = serde_json::from_slice(&crate::common::here(&scene.anim)).unwrap();
    anim["gravity_m_s2"] = json!([0.0, 0.0, 0.0]);
    anim["colliders"] = json!([{
        "name": "ball", "body": anim["colliders"][0]["body"],
        "shape": { "type": "sphere", "centre": [0.0, 0.0, -0.15], "radius": radius }
    }]);
    std::fs::write(&scene.groom, groom.to_string()).unwrap();
    std::fs::write(&scene.anim, anim.to_string()).unwrap();
    scene
}

#[test]
fn a_groom_that_is_mostly_inside_a_body_is_refused() {
    let scene = through_a_ball(0.12);
    let out = scene.folder.path().join("out");
    let assert = bake(&scene.groom, &scene.anim, &out).assert().code(65);
    let text = String::from_utf8_lossy(&assert.get_output().stderr).into_owned();
    says(&text, &["colliders[0]", "guide segments are inside \"ball\"", "at most half of them"]);
    says(&text, &["nothing written"]);
    assert!(!out.exists());
    let files = [&scene.groom, &scene.anim];
    let run = |words: &[&str]| {
        let mut command = crate::common::hairbake();
        command.args(words).args(files);
        command
    };
    let text = joined(&run(&["check"]).assert().code(65).stdout(""));
    says(&text, &["anim.json: colliders[0]", "inside \"ball\""]);
    for words in
        [&["bake", "--dry-run"][..], &["simulate"], &["simulate", "--frames", "1000-1001"], &["estimate"]]
    {
        let text = joined(&run(words).arg("-o").arg(&out).assert().code(65).stdout(""));
        says(&text, &["inside \"ball\"", "nothing written"]);
        assert!(!out.exists(), "{words:?}");
    }
}

#[test]
fn a_refused_bake_keeps_the_cache_that_it_would_overwrite() {
    let scene = through_a_ball(0.03);
    let out = scene.folder.path().join("out");
    let usual = ["--preroll", "0", "--substeps", "2", "--overwrite"];
    let run = |stage: &str, options: &[&str]| {
        let mut command = crate::common::hairbake();
        command.arg(stage).args([&scene.groom, &scene.anim]).arg("-o").arg(&out).args(usual).args(options);
        command.assert()
    };
    run("bake", &["--frames", "1001-1002", "--no-pictures"]).success();
    let contents = || -> Vec<(String, Vec<u8>)> {
        let files = entries(&out).into_iter().filter(|name| out.join(name).is_file());
        files.map(|name| (name.clone(), crate::common::here(&out.join(name)))).collect()
    };
    let (whole, work) = (contents(), entries(&out.join(".hairbake/states")));
    // Frames that the shot does not have, of other settings than those of the cache.
    let outside = "is outside the frames of this stage";
    run("simulate", &["--frames", "900-1004", "--nodes", "5"]).code(64).stderr(contains(outside));
    run("interpolate", &["--frames", "900", "--nodes", "5"]).code(64).stderr(contains(outside));
    assert!(contents() == whole && entries(&out.join(".hairbake/states")) == work);
    // The hair is inside of a larger ball.
    let text = String::from_utf8(crate::common::here(&scene.anim)).unwrap();
    std::fs::write(&scene.anim, text.replacen("\"radius\":0.03", "\"radius\":0.12", 1)).unwrap();
    for (stage, options) in [
        ("bake", &["--frames", "1001-1002"][..]),
        ("simulate", &["--shot", "1001-1002", "--frames", "1000-1002"]),
        ("interpolate", &["--shot", "1001-1002"]),
        ("assemble", &["--shot", "1001-1002"]),
    ] {
        says(&joined(&run(stage, options).code(65)), &["inside \"ball\"", "nothing written"]);
        assert!(contents() == whole && entries(&out.join(".hairbake/states")) == work, "{stage}");
    }
}

#[test]
fn hair_that_is_partly_inside_a_body_is_recorded_and_warned_of() {
    let scene = through_a_ball(0.03);
    let out = scene.folder.path().join("out");
    let assert = bake(&scene.groom, &scene.anim, &out).assert().success();
    says(
        &String::from_utf8_lossy(&assert.get_output().stderr),
        &["the groom has", "of its guides inside a body"],
    );
    let manifest: Value = serde_json::from_slice(&crate::common::here(&out.join("manifest.json"))).unwrap();
    let figures = &manifest["frames"][1]["figures"];
    assert!(figures["exempt_segments"].as_u64() > Some(0), "{figures}");
    assert!(figures["exempt_penetration_m"].as_f64() > Some(0.02), "{figures}");
    assert!(figures["penetration_m"].as_f64() < Some(1e-3), "{figures}");
}

#[test]
fn implausible_units_are_rejected() {
    let scene = Scene::import();
    let groom = scene.folder.path().join("inches.json");
    let strands = scene.folder.path().join("strands.tfx");
    let mut import = crate::common::hairbake();
    import.args(["import", "groom"]).arg(strands).args(["--units", "0.00001", "-o"]).arg(&groom);
    let assert = import.assert().code(65);
    says(&String::from_utf8_lossy(&assert.get_output().stderr), &["strands.tfx", "--units"]);
    assert!(!groom.exists());
}

#[test]
fn coordinates_that_no_groom_and_no_head_has_are_rejected_on_import() {
    let scene = Scene::import();
    let at = |name: &str| scene.folder.path().join(name);
    let import = |words: &[&str], file: &str| {
        let out = at("far.json");
        let mut import = crate::common::hairbake();
        import.arg("import").args(words).arg(at(file)).arg("-o").arg(&out);
        let text = joined(&import.assert().code(65));
        assert!(!out.exists());
        text
    };
    // A vertex of a strand of six, after the header, sixteen bytes each.
    let sound = crate::common::here(&at("strands.tfx"));
    for (strand, x, value) in [(2, 1e30f32, "1.000e28"), (5, -2e4, "-2.000e2")] {
        let (mut bytes, vertex) = (sound.clone(), 160 + 16 * (6 * strand + 3));
        bytes[vertex..vertex + 4].copy_from_slice(&x.to_le_bytes());
        std::fs::write(at("far.tfx"), bytes).unwrap();
        let text = import(&["groom", "--units", "cm"], "far.tfx");
        let strand = format!("strand {strand} goes to ({value},");
        says(
            &text,
            &["1 error", "far.tfx: strands", &strand, "allowed: strands that are 100 m across or less"],
        );
    }
    let mut motion: Value = serde_json::from_slice(&crate::common::here(&at("turn.json"))).unwrap();
    motion["frames"][3]["translation"][1] = json!(1e300);
    std::fs::write(at("turn.json"), motion.to_string()).unwrap();
    let text = import(&["track"], "turn.json");
    says(&text, &["1 error", "turn.json: motion", "sample 3 is at (0.000e0, 1.000e300, 0.000e0) m"]);
    says(&text, &["allowed: up to 1e6 m from the origin"]);
}

#[test]
fn check_reports_the_errors_of_all_files() {
    let scene = Scene::import();
    std::fs::write(&scene.groom, "{ \"format\": \"hairbake-groom\", \"version\": 1 ").unwrap();
    std::fs::write(
        &scene.anim,
        "{ \"format\": \"hairbake-anim\", \"version\": 1, \"fps\": 0, \"frames\": [1] }",
    )
    .unwrap();
    let assert = crate::common::hairbake().arg("check").args([&scene.groom, &scene.anim]).assert().code(65);
    let text = String::from_utf8_lossy(&assert.get_output().stderr).into_owned();
    says(&text, &["groom.json:1", "anim.json:1", "fps", "frames"]);
}

#[test]
fn unwritable_folders_exit_with_74() {
    let scene = Scene::import();
    let in_the_way = scene.folder.path().join("file");
    std::fs::write(&in_the_way, "").unwrap();
    for out in [in_the_way.clone(), in_the_way.join("out")] {
        let assert = bake(&scene.groom, &scene.anim, &out).assert().code(74);
        says(&String::from_utf8_lossy(&assert.get_output().stderr), &["file"]);
    }
    assert_eq!(entries(scene.folder.path()), ["ball.obj", "file", "shot", "strands.tfx", "turn.json"]);
}

#[test]
fn paths_that_lead_to_no_file_are_bad_input_and_named_at_once() {
    let scene = Scene::import();
    let out = scene.folder.path().join("new/out");
    let refused = |arguments: &[&str], named: &[&str]| {
        let mut command = crate::common::hairbake();
        command.args(arguments).arg("-o").arg(&out);
        let output = command.assert().code(65).get_output().clone();
        says(&String::from_utf8_lossy(&output.stderr), named);
        assert!(!out.parent().unwrap().exists());
    };
    let [groom, anim] = [&scene.groom, &scene.anim].map(|path| path.to_str().unwrap());
    let folder = scene.folder.path().to_str().unwrap();
    refused(&["no-groom.json", anim], &["no-groom.json: no such file"]);
    refused(&["bake", "no-groom.json", "no-anim.json"], &["2 errors", "no-groom.json", "no-anim.json"]);
    refused(&["bake", folder, anim], &["this is a folder, not a file"]);
    refused(&["bake", groom, anim, "--groups", "hair", "--base", "no-cache"], &["no-cache/hair.topology"]);
    refused(&["preview", "no-cache"], &["no-cache/hair.topology.usdc: no such file"]);
    let import = ["import", "groom", "no.tfx", "--strands", "no.usd:/a", "--head", "no.obj:cm"];
    refused(&import, &["3 errors", "no.tfx", "no.usd", "no.obj"]);
    let import = ["import", "track", "no.json", "--groom", "no-groom.json", "--collider", "no.obj"];
    refused(&import, &["3 errors", "no.json", "no-groom.json", "no.obj"]);
    refused(&["import", "track", "no.usda", "--collider", "no.####.obj"], &["no.usda"]);
    let mut check = crate::common::hairbake();
    let output =
        check.args(["check", "no-a.json", groom, "no-b.json"]).assert().code(65).get_output().clone();
    says(&String::from_utf8_lossy(&output.stderr), &["2 errors", "no-a.json", "no-b.json"]);
    crate::common::hairbake().args(["status", "no-cache"]).assert().code(65);
}
