//! Contents of a cache by option: guides, strands, a subset of strands, time samples, accelerations.

use crate::common::{Scene, bake, entries, hairbake, here};
use hairbake::cache::{CurveSet, Frame, Header, Manifest, Reader};
use hairbake::usd::crate_file;
use std::path::{Path, PathBuf};

/// Bakes two frames with `options`.
fn baked(scene: &Scene, name: &str, options: &[&str]) -> PathBuf {
    let out = scene.folder.path().join(name);
    let usual = ["--frames", "1003-1004", "--substeps", "2", "--no-pictures", "-q"];
    let preroll = if options.contains(&"--preroll") { &[][..] } else { &["--preroll", "0.1"] };
    bake(&scene.groom, &scene.anim, &out).args(usual).args(preroll).args(options).assert().success();
    out
}

fn read(out: &Path) -> (Header, Frame, Manifest) {
    let reader = Reader::open(out).unwrap();
    (reader.header().clone(), reader.read_frame(1003).unwrap(), reader.read_manifest().unwrap())
}

#[test]
fn guides_strands_or_both() {
    let scene = Scene::import();
    let (both, frame, _) = read(&baked(&scene, "both", &[]));
    let (guides, of_guides, manifest) = read(&baked(&scene, "guides", &["--curves", "guides"]));
    let (strands, of_strands, _) = read(&baked(&scene, "strands", &["--curves", "strands"]));
    assert!(both.hair.is_some() && !both.guides.counts.is_empty());
    assert_eq!((guides.hair, guides.guides), (None, both.guides));
    assert_eq!((of_guides.hair, of_guides.guides), (None, frame.guides));
    assert_eq!(manifest.summary.hair, (0, 0));
    assert_eq!((strands.hair, strands.guides.counts.len()), (both.hair, 0));
    assert_eq!((of_strands.hair, of_strands.guides.points.len()), (frame.hair, 0));

    let text = String::from_utf8(here(&scene.groom)).unwrap();
    let mut groom: serde_json::Value = serde_json::from_str(&text).unwrap();
    groom.as_object_mut().unwrap().remove("strands");
    std::fs::write(&scene.groom, groom.to_string()).unwrap();
    let out = scene.folder.path().join("none");
    let mut refused = bake(&scene.groom, &scene.anim, &out);
    refused.args(["--curves", "strands"]).assert().code(64);
    assert!(!out.exists());
}

#[test]
fn subset_of_strands_is_unchanged_and_conserves_cover() {
    let scene = Scene::import();
    let (whole, all, _) = read(&baked(&scene, "whole", &[]));
    let (part, some, _) = read(&baked(&scene, "part", &["--keep", "0.5"]));
    let (whole, part, all, some) =
        (whole.hair.unwrap(), part.hair.unwrap(), all.hair.unwrap(), some.hair.unwrap());
    assert_eq!((whole.id.len(), part.id.len()), (32, 16));
    let n = whole.counts[0] as usize;
    let mut wider = Vec::new();
    for (c, id) in part.id.iter().enumerate() {
        let from = whole.id.iter().position(|other| other == id).unwrap();
        assert_eq!(some.points[c * n..][..n], all.points[from * n..][..n]);
        wider.extend((0..n).map(|k| part.widths[c * n + k] / whole.widths[from * n + k]));
    }
    let length = |a: &[f32; 3], b: &[f32; 3]| (0..3).map(|i| (a[i] - b[i]).powi(2)).sum::<f32>().sqrt();
    let lengths = |set: &CurveSet| -> f32 {
        set.rest
            .chunks_exact(n)
            .flat_map(|curve| curve.windows(2))
            .map(|edge| length(&edge[0], &edge[1]))
            .sum()
    };
    let wanted = lengths(&whole) / lengths(&part);
    assert!(
        (1.9..2.1).contains(&wanted) && wider.iter().all(|w| (w / wanted - 1.0).abs() < 1e-4),
        "{wanted}"
    );
}

#[test]
fn time_samples_agree_with_velocities_and_with_a_bake_in_stages() {
    let scene = Scene::import();
    let options = ["--samples", "3", "--shutter", "0.4"];
    let out = baked(&scene, "blur", &options);
    let (_, at_frame, _) = read(&out);
    let (_, plain, _) = read(&baked(&scene, "plain", &[]));
    assert_eq!(at_frame, plain);

    let path = out.join("hair.1003.usdc");
    let mut layer = crate_file::decode(&path, &here(&path)).unwrap();
    for prim in ["/groom/hair", "/groom/guides"] {
        let mut take = |name: &str| {
            let samples = &layer.prim_mut(prim).unwrap().attribute_mut(name).unwrap().samples;
            let values = samples.iter().map(|(time, value)| match value {
                hairbake::usd::Value::Float3s(v) => (*time, v.to_vec()),
                other => panic!("{other:?}"),
            });
            values.collect::<Vec<_>>()
        };
        let (points, velocities) = (take("points"), take("velocities"));
        assert_eq!(points.iter().map(|p| p.0).collect::<Vec<_>>(), [1003.0, 1003.2, 1003.4]);
        let (mut off, mut way) = (0.0_f32, 0.0_f32);
        for i in 0..2 {
            let seconds = (points[i + 1].0 - points[i].0) as f32 / 24.0;
            for k in 0..points[0].1.len() {
                for axis in 0..3 {
                    let moved = points[i + 1].1[k][axis] - points[i].1[k][axis];
                    let mean = (velocities[i].1[k][axis] + velocities[i + 1].1[k][axis]) / 2.0;
                    off = off.max((moved - mean * seconds).abs());
                    way = way.max(moved.abs());
                }
            }
        }
        assert!(way > 0.05 && off < 0.01 * way, "{prim}: {off} of {way}");
    }

    same_in_stages(&scene, &out, &options);
}

/// Compares a bake with `options` to one in stages.
fn same_in_stages(scene: &Scene, out: &Path, options: &[&str]) {
    let again = scene.folder.path().join("again");
    for (stage, more) in [
        ("simulate", &["--frames", "1002-1004", "--preroll", "0.1"][..]),
        ("simulate", &["--frames", "1005-1008", "--preroll", "0.1"]),
        ("interpolate", &["--frames", "1004-1005", "--preroll", "0.1"]),
        ("interpolate", &["--frames", "1002-1003", "--preroll", "0.1"]),
        ("assemble", &["--preroll", "0.1", "--no-pictures"]),
    ] {
        let mut command = hairbake();
        command.arg("-q").arg(stage).args([&scene.groom, &scene.anim]).arg("-o").arg(&again);
        command.args(["--shot", "1003-1004", "--substeps", "2"]).args(options).args(more).assert().success();
    }
    for name in entries(out).iter().filter(|name| name.starts_with("hair.") || *name == "manifest.json") {
        assert!(here(&out.join(name)) == here(&again.join(name)), "{name}");
    }
}

#[test]
fn step_samples_are_the_states_of_the_solver() {
    let scene = Scene::import();
    for contact in ["bodies", "full"] {
        let options = ["--curves", "steps", "--contact", contact];
        let out = baked(&scene, contact, &options);
        let (header, mut at_frame, _) = read(&out);
        assert_eq!(at_frame.guides.arrived.take(), Some(vec![1; header.guides.counts.len()]));
        let plain = ["--curves", "guides", "--contact", contact, "--resolution", "full"];
        let (_, of_guides, _) = read(&baked(&scene, "guides", &plain));
        assert_eq!((header.hair, &at_frame), (None, &of_guides));
        let moments = Reader::open(&out).unwrap().read_samples(1003, [0.0, 0.5]).unwrap();
        assert!(moments[0].guides.points != moments[1].guides.points && moments[0].head != moments[1].head);
        assert!(moments.iter().all(|m| m.guides.arrived == Some(vec![1; header.guides.counts.len()])));
        let path = out.join("hair.1003.usdc");
        let mut layer = crate_file::decode(&path, &here(&path)).unwrap();
        let samples = &layer.prim_mut("/groom/guides").unwrap().attribute_mut("points").unwrap().samples;
        assert_eq!(samples.iter().map(|(time, _)| *time).collect::<Vec<_>>(), [1003.0, 1003.5]);
        same_in_stages(&scene, &out, &options);
        std::fs::remove_dir_all(scene.folder.path().join("again")).unwrap();
        std::fs::remove_dir_all(scene.folder.path().join("guides")).unwrap();
    }
    for more in [&["--samples", "3"][..], &["--resolution", "coarse"]] {
        let mut refused = bake(&scene.groom, &scene.anim, &scene.folder.path().join("none"));
        refused.args(["--curves", "steps"]).args(more).assert().code(64);
    }
}

#[test]
fn accelerations_reproduce_the_next_time_sample() {
    let scene = Scene::import();
    let blur = |name: &str, more: &[&str]| baked(&scene, name, &[&["--shutter", "0.4"], more].concat());
    let moments = |out: &Path, offsets: &[f64]| {
        Reader::open(out).unwrap().read_samples(1003, offsets.iter().copied()).unwrap()
    };
    let single = moments(&blur("single", &["--accelerations"]), &[0.0]).remove(0);
    let several = moments(&blur("several", &["--accelerations", "--samples", "3"]), &[0.0, 0.2, 0.4]);
    let plain = moments(&blur("plain", &["--samples", "3"]), &[0.0, 0.2, 0.4]);
    // Accelerations do not change points and velocities.
    for (with, without) in several.iter().zip(&plain) {
        let (with, without) = (with.hair.as_ref().unwrap(), without.hair.as_ref().unwrap());
        assert_eq!((&with.points, &with.velocities), (&without.points, &without.velocities));
        assert!(with.accelerations.is_some() && without.accelerations.is_none());
    }
    let [first, second, last] = &several[..] else { panic!("{}", several.len()) };
    for (now, then) in [(first, second), (second, last), (last, second), (&single, last)] {
        let after = ((then.offset - now.offset) / 24.0) as f32;
        for [now, then] in
            [[&now.guides, &then.guides], [now.hair.as_ref().unwrap(), then.hair.as_ref().unwrap()]]
        {
            let a = now.accelerations.as_ref().unwrap().as_flattened();
            let [x, next, v] = [&now.points, &then.points, &now.velocities].map(|array| array.as_flattened());
            let (mut off, mut way) = (0.0_f32, 0.0_f32);
            for k in 0..x.len() {
                way = way.max((next[k] - x[k] - v[k] * after).abs());
                off = off.max((next[k] - x[k] - (v[k] + 0.5 * a[k] * after) * after).abs());
            }
            assert!(way > 1e-3 && off < 1e-5, "{off} of {way}");
        }
    }
}

#[test]
fn goals_and_stiffer_tips_hold_the_style() {
    let scene = Scene::import();
    let material = |key: &str, value: &str| format!("groom.materials[0].{key}={value}");
    let departs = |name: &str, set: &[String]| {
        let set: Vec<&str> = set.iter().flat_map(|value| ["--set", value]).collect();
        let out = baked(&scene, name, &[&["--preroll", "1"], &set[..]].concat());
        read(&out).2.scene_figures["first_frame_from_groom"]["mean"].as_f64().unwrap()
    };
    let sags = material("sag_free", "0");
    let bare = departs("bare", std::slice::from_ref(&sags));
    let held = departs("held", &[sags.clone(), material("goal_hz", "[8, 8]")]);
    let tips = departs("tips", &[sags.clone(), material("goal_hz", "[0, 8]")]);
    let stiff = departs("stiff", &[sags.clone(), material("stiffness_at_tip", "20")]);
    assert!(bare > 0.05 && held < 0.25 * bare && held < tips && tips < bare && stiff < 0.9 * bare);
    // Without sag a goal acts only on the motion of the head.
    assert!(departs("both", &[material("goal_hz", "[8, 8]")]) < held.min(0.2 * departs("free", &[])));
}
