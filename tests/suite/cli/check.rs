//! `hairbake check`: errors and warnings of what a bake with the same options bakes.

use crate::common::{bake, hairbake, here, write_curves};
use nalgebra::Vector3;
use predicates::prelude::*;
use predicates::str::contains;
use serde_json::{Value, json};
use std::path::PathBuf;
use tempfile::TempDir;

/// Length of the guides, m.
const LENGTH: f64 = 0.1;

/// Four guides that hang from a head at rest, in the frames 1001 to 1008.
struct Scene {
    folder: TempDir,
    groom: PathBuf,
    anim: PathBuf,
}

impl Scene {
    /// With what `change` makes of the animation.
    fn new(change: impl FnOnce(&mut Value)) -> Self {
        let folder = tempfile::tempdir().unwrap();
        let guide = |g: u32| {
            (0..5).map(move |k| Vector3::new(0.01 * f64::from(g), -LENGTH * f64::from(k) / 4.0, 0.0))
        };
        let points: Vec<[f64; 3]> = (0..4).flat_map(guide).map(Into::into).collect();
        for frame in 1001..=1008 {
            write_curves(&folder.path().join(format!("curl.{frame}.obj")), (0..4).map(guide));
        }
        let groom = json!({
            "format": "hairbake-groom", "version": 1, "groups": [{ "name": "hair", "material": 0 }],
            "guides": { "vertices": 5, "points": points },
        });
        let mut anim = json!({
            "format": "hairbake-anim", "version": 1, "fps": 24, "frames": [1001, 1008],
            "bodies": [{ "name": "head" }], "settings": { "preroll_s": 0, "substeps": 1, "contact": "bodies" },
        });
        change(&mut anim);
        let [groom, anim] = [("groom.json", groom), ("anim.json", anim)].map(|(name, value)| {
            let path = folder.path().join(name);
            std::fs::write(&path, value.to_string()).unwrap();
            path
        });
        Scene { folder, groom, anim }
    }

    fn check(&self, options: &[&str]) -> assert_cmd::assert::Assert {
        hairbake().arg("check").args([&self.groom, &self.anim]).args(options).assert()
    }
}

/// A tie, a load and a goal that act from one frame to another.
fn driven(anim: &mut Value, frames: [i32; 2]) {
    let force = json!({ "frames": frames, "values": [[0, 0, 0], [1e-5, 0, 0]] });
    anim["ties"] = json!([{ "name": "clip", "ids": [0], "arc_m": 0.05, "frames": frames }]);
    anim["loads"] = json!([{ "name": "gust", "ids": [1], "arc_share": 1, "force_n": force }]);
    let weight = json!({ "frames": frames, "values": [0, 1] });
    anim["goals"] = json!([{ "name": "curl", "sequence": "curl.####.obj", "weight": weight }]);
}

#[test]
fn what_does_nothing_in_the_shot_is_warned_of_and_breaks_a_guarantee() {
    let idle = [
        "the tie \"clip\" does nothing: its frames are 2000 to 2010, those of the shot 1001 to 1008; correct ties[0]",
        "the load \"gust\" does nothing",
        "the goal \"curl\" does nothing",
    ];
    let scene = Scene::new(|anim| driven(anim, [2000, 2010]));
    let run = |out: &str, options: &[&str]| {
        let out = scene.folder.path().join(out);
        let done = bake(&scene.groom, &scene.anim, &out).arg("--no-pictures").args(options).assert();
        (out, done)
    };
    for what in idle {
        scene.check(&[]).success().stderr(contains(what));
        run("dry", &["--dry-run"]).1.success().stderr(contains(what));
        // Frames of which only some are baked are no reason.
        scene.check(&["--frames", "1002-1003"]).success().stderr(contains(what));
    }
    let (out, done) = run("out", &[]);
    let done = done.success();
    let text = String::from_utf8_lossy(&done.get_output().stderr);
    assert!(idle.iter().all(|what| text.contains(what)), "{text}");
    let report: Value = serde_json::from_slice(&here(&out.join("report.json"))).unwrap();
    assert!(report["warnings"].to_string().contains("does nothing"), "{}", report["warnings"]);
    let broken = contains("guarantees are broken: the tie \"clip\" does nothing");
    run("strict", &["--strict"]).1.code(1).stderr(broken);
    let acts = Scene::new(|anim| driven(anim, [1002, 1004]));
    acts.check(&[]).success().stderr(contains("warning").not());
    acts.check(&["--frames", "1007-1008"]).success().stderr(contains("warning").not());
}

#[test]
fn ties_that_hair_is_too_short_to_reach_are_warned_of() {
    let scene = Scene::new(|anim| {
        // From frame 1005 on it is a metre away.
        let places: Vec<[f64; 3]> =
            (1000..=1010).map(|frame| [if frame < 1005 { 0.0 } else { 1.0 }, 0.0, 0.0]).collect();
        let track = json!({ "first_frame": 1000, "translation": places, "pops": "keep", "smoothing_hz": 0 });
        anim["bodies"].as_array_mut().unwrap().push(json!({ "name": "hand", "track": track }));
        anim["ties"] = json!([
            { "name": "near", "arc_m": 0.03 },
            { "name": "grip", "body": "hand", "arc_m": 0.08, "at": [0.0, -0.05, 0.0] },
        ]);
    });
    let named = "the tie \"grip\" is out of reach of 4 of its 4 guides in 4 frames: 1005 (9";
    scene.check(&[]).success().stderr(contains(named).and(contains("\"near\"").not()));
    scene.check(&["--frames", "1001-1004"]).success().stderr(contains("warning").not());
}

#[test]
fn colliders_that_are_thick_beside_the_hair_are_warned_of() {
    let scene = Scene::new(|anim| {
        let shape = json!({ "type": "sphere", "centre": [0, 1, 0], "radius": 0.1 });
        anim["colliders"] = json!([{ "name": "skin", "shape": shape, "thickness_m": 0.011 }]);
    });
    let named =
        "the collider \"skin\" keeps hair 11 mm away, more than a tenth of its median length of 100 mm";
    scene.check(&[]).success().stderr(contains(named).and(contains("colliders[0].thickness_m")));
    let less = ["--set", "anim.colliders[0].thickness_m=0.009"];
    scene.check(&less).success().stderr(contains("warning").not());
}

#[test]
fn the_options_of_a_bake_change_what_is_checked() {
    let scene = Scene::new(|anim| anim["roots"] = json!([{ "name": "pins", "ids": [0], "hold": "pinned" }]));
    scene.check(&[]).success();
    for (options, found) in [
        (["--set", "anim.fps=-1"], "fps"),
        (["--set", "groom.guides.vertices=3"], "points"),
        (["--resolution", "coarse"], "settings.resolution"),
        (["--frames", "1-2"], "--frames selects 1 to 2"),
    ] {
        scene.check(&options).code(65).stderr(contains(found));
    }
    scene.check(&["--set", "anim.fps.rate=1"]).code(64).stderr(contains("no such key"));
    let set = ["--set", "groom.name=x"];
    hairbake()
        .arg("check")
        .arg(&scene.anim)
        .args(set)
        .assert()
        .code(64)
        .stderr(contains("no file of this kind"));
    let map = format!("/nowhere={}", scene.folder.path().display());
    let mapped = ["check", "/nowhere/groom.json", "/nowhere/anim.json", "--path-map", &map];
    hairbake().args(mapped).assert().success();
}
