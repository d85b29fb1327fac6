//! Bakes of some groups over a base cache.

use crate::common::{Scene, bake, entries};
use hairbake::cache::{CurveFrame, CurveSet, Frame, Reader};
use hairbake::scene;
use predicates::prelude::PredicateBooleanExt;
use predicates::str::contains;
use serde_json::{Value, json};
use std::path::{Path, PathBuf};

/// Writes the groom of the scene in two groups, the second with a material `stiffer` times as stiff.
fn in_groups(scene: &Scene, name: &str, stiffer: f64) -> PathBuf {
    let mut groom: Value = serde_json::from_slice(&std::fs::read(&scene.groom).unwrap()).unwrap();
    let sizes = scene::load_groom(&scene.groom).unwrap();
    for (curves, count) in [("guides", sizes.guides.curves.len()), ("strands", sizes.strands.curves.len())] {
        groom[curves]["group"] = (0..count).map(|c| c * 2 / count).collect();
    }
    let mut material = groom["materials"][0].clone();
    material["name"] = json!("stiff");
    let young = material["young_modulus_pa"].as_f64().unwrap_or(3.89e9);
    material["young_modulus_pa"] = json!(young * stiffer);
    groom["materials"].as_array_mut().unwrap().push(material);
    let width = groom["groups"][0]["width_m"].clone();
    groom["groups"] = json!([
        { "name": "fringe", "material": 0, "width_m": width },
        { "name": "back", "material": 1, "width_m": width },
    ]);
    let path = scene.groom.with_file_name(name);
    std::fs::write(&path, groom.to_string()).unwrap();
    path
}

fn baked(groom: &Path, scene: &Scene, out: &str, options: &[&str]) -> PathBuf {
    let out = scene.folder.path().join(out);
    let settings = ["--frames", "1001-1004", "--substeps", "2", "--no-pictures", "--samples", "2"];
    bake(groom, &scene.anim, &out).args(settings).args(options).assert().success();
    out
}

/// Points, velocities and accelerations of the curves of one group at all samples of all frames.
fn of_group(cache: &Path, group: i32) -> Vec<[f32; 3]> {
    let reader = Reader::open(cache).unwrap();
    let curves = |set: &CurveSet, frame: &CurveFrame| {
        let mut all = Vec::new();
        let mut start = 0;
        for (count, of) in set.counts.iter().zip(&set.group) {
            let range = start..start + *count as usize;
            start = range.end;
            if *of == group {
                all.extend_from_slice(&frame.points[range.clone()]);
                all.extend_from_slice(&frame.velocities[range.clone()]);
                all.extend_from_slice(frame.accelerations.as_ref().map_or(&[][..], |a| &a[range]));
            }
        }
        all
    };
    let header = reader.header();
    let moment = |frame: Frame| {
        [
            curves(header.hair.as_ref().unwrap(), frame.hair.as_ref().unwrap()),
            curves(&header.guides, &frame.guides),
        ]
        .concat()
    };
    let moments = |frame: &i32| reader.read_samples(*frame, [0.0, 0.5]).unwrap();
    reader.frames().iter().flat_map(moments).flat_map(moment).collect()
}

#[test]
fn groups_are_baked_over_a_base_cache() {
    let scene = Scene::import();
    let (soft, stiff) = (in_groups(&scene, "soft.json", 1.0), in_groups(&scene, "stiff.json", 50.0));
    // So low that guides split in these few frames.
    let options = ["--accelerations", "--split-tolerance", "0.005"];
    let before = baked(&soft, &scene, "before", &options);
    let whole = baked(&stiff, &scene, "whole", &options);
    let base = before.to_str().unwrap();
    let some = [&options[..], &["--groups", "back", "--base", base]].concat();
    let after = baked(&stiff, &scene, "after", &some);
    assert!(!of_group(&after, 0).is_empty() && of_group(&after, 0) == of_group(&before, 0));
    assert!(!of_group(&after, 1).is_empty() && of_group(&after, 1) == of_group(&whole, 1));
    assert_ne!(of_group(&before, 1), of_group(&whole, 1));
    let manifest = Reader::open(&after).unwrap().read_manifest().unwrap();
    assert_eq!(manifest.settings["groups"], json!(["back"]));
    assert!(manifest.inputs.iter().any(|input| input.role == "base"));
    // Guides of the other group are not simulated.
    let nodes = |cache: &Path| {
        let manifest = Reader::open(cache).unwrap().read_manifest().unwrap();
        manifest.frames[2].figures["active_nodes"].as_u64().unwrap()
    };
    assert!(nodes(&after) < nodes(&whole), "{} of {}", nodes(&after), nodes(&whole));
}

#[test]
fn a_mismatched_base_is_rejected_before_anything_is_written() {
    let scene = Scene::import();
    let groom = in_groups(&scene, "grouped.json", 1.0);
    let base = baked(&groom, &scene, "base", &[]);
    let text = base.to_str().unwrap();
    let out = scene.folder.path().join("out");
    let with = |options: &[&str]| {
        let mut command = bake(&groom, &scene.anim, &out);
        command.args(["--substeps", "2", "--samples", "2"]).args(options);
        command.assert()
    };
    let range = ["--frames", "1001-1004"];
    with(&[&range[..], &["--groups", "fringe"]].concat()).code(64);
    with(&[&range[..], &["--groups", "beard", "--base", text]].concat())
        .code(64)
        .stderr(contains("beard").and(contains("fringe, back")));
    with(&["--frames", "1001-1006", "--groups", "fringe", "--base", text, "--shutter", "0.25"])
        .code(65)
        .stderr(contains("frame 1006 and 1 more").and(contains("shutter")));
    let kept = [&range[..], &["--groups", "fringe", "--base", text]].concat();
    with(&[&kept[..], &["--set", "groom.metres_per_unit=0.1"]].concat())
        .code(65)
        .stderr(contains("metres_per_unit"));
    // A kept guide with another rest shape.
    let other = in_groups(&scene, "other.json", 1.0);
    let mut text_of: Value = serde_json::from_slice(&std::fs::read(&other).unwrap()).unwrap();
    let count = text_of["guides"]["group"].as_array().unwrap().len();
    text_of["guides"]["id"] = (0..count).map(|id| id + 7).collect();
    std::fs::write(&other, text_of.to_string()).unwrap();
    bake(&other, &scene.anim, &out)
        .args(["--substeps", "2", "--samples", "2"])
        .args(&kept)
        .assert()
        .code(65)
        .stderr(contains("of group \"back\""));
    bake(&groom, &scene.anim, &base).args(["--groups", "fringe", "--base", text]).assert().code(64);
    assert!(!out.exists());
    assert!(entries(&base).contains(&"manifest.json".into()), "the base is intact");

    // A corrupt frame of the base.
    let frame = base.join("hair.1002.usdc");
    let mut bytes = std::fs::read(&frame).unwrap();
    let middle = bytes.len() / 2;
    bytes[middle] ^= 1;
    std::fs::write(&frame, bytes).unwrap();
    with(&kept).code(65).stderr(contains("hair.1002.usdc").and(contains("checksum")));
}
