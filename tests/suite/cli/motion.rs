//! Head motions from files: the same motion as BVH in centimetres and as glTF in metres.

use crate::common::{Scene, bake, hairbake};
use hairbake::cache::Reader;
use serde_json::json;
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
