//! Head motions from files: the same motion as BVH in centimetres and as glTF in metres.

use crate::common::{Scene, bake, entries, hairbake, here};
use hairbake::cache::Reader;
use serde_json::{Value, json};
use std::fmt::Write;
use std::path::{Path, PathBuf};

/// Number of samples, 24 per second. Per sample the hips move by 1 cm along x, and the head, half a metre
/// above them, turns by 2° about y.
const SAMPLES: usize = 25;

fn bvh(folder: &Path) -> PathBuf {
    let mut text = String::from(
        "HIERARCHY\nROOT Hips\n{\n OFFSET 0 0 0\n CHANNELS 6 Xposition Yposition Zposition Zrotation Xrotation Yrotation\n \
         JOINT Head\n {\n  OFFSET 0 50 0\n  CHANNELS 3 Zrotation Xrotation Yrotation\n  End Site\n  {\n   OFFSET 0 20 0\n  }\n }\n}\n",
    );
    write!(text, "MOTION\nFrames: {SAMPLES}\nFrame Time: 0.0416666667\n").unwrap();
    (0..SAMPLES).for_each(|k| writeln!(text, "{k} 0 0 0 0 0 0 0 {}", 2 * k).unwrap());
    let path = folder.join("walk.bvh");
    std::fs::write(&path, text).unwrap();
    path
}

fn gltf(folder: &Path) -> PathBuf {
    let times = (0..SAMPLES).map(|k| k as f32 / 24.0);
    let places = (0..SAMPLES).flat_map(|k| [0.01 * k as f32, 0.0, 0.0]);
    let turns =
        (0..SAMPLES).map(|k| (k as f32).to_radians()).flat_map(|half| [0.0, half.sin(), 0.0, half.cos()]);
    let bytes: Vec<u8> = times.chain(places).chain(turns).flat_map(f32::to_le_bytes).collect();
    let n = SAMPLES * 4;
    let accessor = |view: usize, kind: &str| json!({ "bufferView": view, "componentType": 5126, "count": SAMPLES, "type": kind });
    let mut input = accessor(0, "SCALAR");
    (input["min"], input["max"]) = (json!([0.0]), json!([1.0]));
    let file = json!({
        "asset": { "version": "2.0" },
        "buffers": [{ "byteLength": bytes.len(), "uri": "walk.bin" }],
        "bufferViews": [
            { "buffer": 0, "byteLength": n },
            { "buffer": 0, "byteOffset": n, "byteLength": 3 * n },
            { "buffer": 0, "byteOffset": 4 * n, "byteLength": 4 * n },
        ],
        "accessors": [input, accessor(1, "VEC3"), accessor(2, "VEC4")],
        "nodes": [{ "name": "Hips", "children": [1] }, { "name": "Head", "translation": [0, 0.5, 0] }],
        "animations": [{
            "samplers": [{ "input": 0, "output": 1 }, { "input": 0, "output": 2 }],
            "channels": [
                { "sampler": 0, "target": { "node": 0, "path": "translation" } },
                { "sampler": 1, "target": { "node": 1, "path": "rotation" } },
            ],
        }],
    });
    std::fs::write(folder.join("walk.bin"), bytes).unwrap();
    let path = folder.join("walk.gltf");
    std::fs::write(&path, file.to_string()).unwrap();
    path
}

#[test]
fn the_head_follows_its_joint_in_bvh_and_gltf() {
    let scene = Scene::import();
    for motion in [bvh(scene.folder.path()), gltf(scene.folder.path())] {
        let anim = motion.with_extension("anim.json");
        let mut import = hairbake();
        import.args(["-q", "import", "track"]).arg(&motion).args(["--joint", "Head", "--cutoff", "0", "-o"]);
        import.arg(&anim).assert().success().stderr("");
        let out = scene.folder.path().join(format!("{}.out", motion.file_name().unwrap().display()));
        let options = ["--frames", "1011-1012", "--preroll", "0", "--substeps", "1", "--no-pictures", "-q"];
        bake(&scene.groom, &anim, &out).args(options).assert().success();
        let reader = Reader::open(&out).unwrap();
        let (head, unit) = (reader.read_frame(1011).unwrap().head, reader.header().metres_per_unit);
        // The rest position of the joint, and a point 10 cm from it.
        let goes = |p: [f64; 3]| -> Vec<f64> {
            let p = [p[0] / unit, p[1] / unit, p[2] / unit, 1.0];
            head.iter().map(|row| row.iter().zip(p).map(|(m, p)| m * p).sum::<f64>() * unit).collect()
        };
        let angle = 20f64.to_radians();
        for (p, wanted) in [
            ([0.0, 0.5, 0.0], [0.1, 0.5, 0.0]),
            ([0.1, 0.5, 0.0], [0.1 + 0.1 * angle.cos(), 0.5, -0.1 * angle.sin()]),
        ] {
            let found = goes(p);
            let off = (0..3).map(|i| (found[i] - wanted[i]).abs()).fold(0.0, f64::max);
            assert!(off < 2e-4, "{}: {found:?}, not {wanted:?}", motion.display());
        }
    }
}

/// A glTF file `face.gltf` in a new folder `name`, of one triangle of this size, m.
fn face(folder: &Path, name: &str, size: f32) -> PathBuf {
    let folder = folder.join(name);
    std::fs::create_dir(&folder).unwrap();
    let points = [[0.0, 0.0, 0.0], [size, 0.0, 0.0], [0.0, size, 0.0]];
    let bytes: Vec<u8> = points.into_iter().flatten().flat_map(f32::to_le_bytes).collect();
    let file = json!({
        "asset": { "version": "2.0" },
        "buffers": [{ "byteLength": bytes.len(), "uri": "face.bin" }],
        "bufferViews": [{ "buffer": 0, "byteLength": bytes.len() }],
        "accessors": [{
            "bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3",
            "min": [0.0, 0.0, 0.0], "max": [size, size, 0.0],
        }],
        "meshes": [{ "primitives": [{ "attributes": { "POSITION": 0 } }] }],
        "nodes": [{ "name": "face", "mesh": 0 }],
    });
    std::fs::write(folder.join("face.bin"), bytes).unwrap();
    let path = folder.join("face.gltf");
    std::fs::write(&path, file.to_string()).unwrap();
    path
}

#[test]
fn shots_in_one_folder_keep_their_own_meshes() {
    let folder = tempfile::tempdir().unwrap();
    let (motion, shots) = (bvh(folder.path()), folder.path().join("shots"));
    let import = |name: &str, meshes: &[&Path]| {
        let mut import = hairbake();
        import.args(["-q", "import", "track"]).arg(&motion).args(["--joint", "Head", "-o"]);
        import.arg(shots.join(name));
        meshes.iter().for_each(|mesh| _ = import.arg("--collider").arg(mesh));
        import.assert().success();
    };
    // The files that the colliders of an animation name.
    let meshes = |name: &str| -> Vec<(String, String)> {
        let anim: Value = serde_json::from_slice(&here(&shots.join(name))).unwrap();
        let files =
            anim["colliders"].as_array().unwrap().iter().map(|c| c["shape"]["file"].as_str().unwrap());
        files.map(|file| (file.into(), String::from_utf8(here(&shots.join(file))).unwrap())).collect()
    };
    let [small, large, third] =
        [("a", 0.2), ("b", 0.3), ("c", 0.4)].map(|(name, size)| face(folder.path(), name, size));
    import("A.json", &[&small]);
    let first = meshes("A.json");
    assert!(first[0].0 == "A.face.obj" && first[0].1.contains("0.2"), "{first:?}");
    // The name has another part, a character of patterns, and two meshes of one name.
    for name in ["B.json", "A.v2.json", "A.v3", "A#.json"] {
        import(name, &[&large, &third]);
        assert_eq!(meshes("A.json"), first, "{name}");
        let [one, other] = &meshes(name)[..] else { panic!("{name}") };
        assert!(one.1.contains("0.3") && other.1.contains("0.4"), "{name}: {one:?}, {other:?}");
    }
    let names: Vec<String> = meshes("B.json").into_iter().map(|(name, _)| name).collect();
    assert_eq!(names, ["B.face.obj", "B.face_2.obj"]);
    let all = entries(&shots).into_iter().filter(|name| name.ends_with(".obj"));
    assert_eq!(all.count(), 9);
}

#[test]
fn a_missing_joint_is_bad_input() {
    let folder = tempfile::tempdir().unwrap();
    for motion in [bvh(folder.path()), gltf(folder.path())] {
        let out = folder.path().join("anim.json");
        let mut import = hairbake();
        import.args(["import", "track"]).arg(&motion).args(["--joint", "Nose", "-o"]).arg(&out);
        let output = import.assert().code(65).get_output().stderr.clone();
        let said = String::from_utf8(output).unwrap();
        assert!(said.contains("Nose") && said.contains("Hips") && said.contains("Head"), "{said}");
        assert!(!out.exists());
    }
}
