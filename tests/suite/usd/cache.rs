//! Whole caches.

use super::{python, sample};
use hairbake::cache::{Basis, FrameEntry, Header, Manifest, Reader, Writer, sha256};
use serde_json::{Value, json};
use std::path::Path;

/// Writes a whole cache and returns its manifest.
fn write_cache(dir: &Path, header: &Header) -> Manifest {
    let writer = Writer::create(dir, header).unwrap();
    let mut manifest = Manifest::new(header);
    manifest.settings = json!({"substeps": 8});
    manifest.totals.insert("contacts".into(), 12.into());
    for frame in header.frames.0 - 1..=header.frames.1 + 1 {
        let file = writer.write_frame(&[sample::frame(header, frame)]).unwrap();
        manifest.frames.push(FrameEntry { frame, file, over: None, figures: Default::default() });
    }
    writer.finish(manifest).unwrap()
}

#[test]
fn cache_round_trips() {
    for (hair, basis, frames) in [(true, Basis::CatmullRom, (1001, 1003)), (false, Basis::Bspline, (0, 1))] {
        let dir = tempfile::tempdir().unwrap();
        let mut header = Header { basis, frames, ..sample::header(hair) };
        header.colliders[0].is_plane = hair;
        let manifest = write_cache(dir.path(), &header);

        let reader = Reader::open(dir.path()).unwrap();
        assert_eq!(reader.header(), &header);
        assert_eq!(reader.read_manifest().unwrap(), manifest);
        let range: Vec<i32> = (frames.0 - 1..=frames.1 + 1).collect();
        assert_eq!(reader.frames(), range);
        for frame in range {
            assert_eq!(reader.read_frame(frame).unwrap(), sample::frame(&header, frame));
        }
        for file in manifest.layers.iter().chain(manifest.frames.iter().map(|f| &f.file)) {
            let bytes = std::fs::read(dir.path().join(&file.file)).unwrap();
            assert_eq!((file.bytes, &file.sha256), (bytes.len() as u64, &sha256(&bytes)), "{}", file.file);
        }
    }
}

#[test]
fn usd_core_resolves_every_value_at_every_frame() {
    let cases = [
        ("shot", Header { frames: (1001, 1004), ..sample::header(true) }),
        ("bspline_z_up", Header { basis: Basis::Bspline, z_up: true, ..sample::header(false) }),
        ("from_frame_0", Header { frames: (0, 2), ..sample::header(true) }),
        ("negative_frames", Header { frames: (-12, -9), ..sample::header(true) }),
        ("five_digits", Header { frames: (9998, 10001), ..sample::header(true) }),
    ];
    let dir = python::folder("caches");
    let mut expected = Vec::new();
    for (name, header) in cases {
        write_cache(&dir.join(name), &header);
        expected
            .push(json!({"folder": name, "header": header_json(&header), "frames": frames_json(&header)}));
    }
    std::fs::write(dir.join("expected.json"), serde_json::to_vec(&expected).unwrap()).unwrap();
    python::run("check_caches.py", &[&dir]);
}

fn header_json(header: &Header) -> Value {
    let curves = |prim: &str, c: &hairbake::cache::CurveSet| {
        json!({"prim": prim, "counts": c.counts, "rest": c.rest, "arc": c.arc, "widths": c.widths, "id": c.id,
               "group": c.group, "group_name": c.group_name, "guide": c.guide, "root_uv": c.root_uv})
    };
    let sets: Vec<Value> = (header.hair.iter().map(|c| curves("/groom/hair", c)))
        .chain([curves("/groom/guides", &header.guides)])
        .collect();
    let colliders: Vec<Value> = (header.colliders.iter())
        .map(|c| json!({"prim": format!("/groom/colliders/{}", c.name), "points": c.points, "triangles": c.triangles, "deforms": c.deforms}))
        .collect();
    json!({
        "metres_per_unit": header.metres_per_unit,
        "up_axis": if header.z_up { "Z" } else { "Y" },
        "fps": header.fps,
        "frames": header.frames,
        "basis": if header.basis == Basis::Bspline { "bspline" } else { "catmullRom" },
        "curves": sets,
        "colliders": colliders,
    })
}

fn frames_json(header: &Header) -> Vec<Value> {
    let curves = |c: &hairbake::cache::CurveFrame| json!({"points": c.points, "velocities": c.velocities, "extent": c.extent});
    (header.frames.0 - 1..=header.frames.1 + 1)
        .map(|number| {
            let frame = sample::frame(header, number);
            let sets: Vec<Value> = frame.hair.iter().chain([&frame.guides]).map(curves).collect();
            let colliders: Vec<Value> = frame
                .colliders
                .iter()
                .map(|c| json!({"transform": c.transform, "points": c.points}))
                .collect();
            json!({"frame": number, "curves": sets, "head": frame.head, "colliders": colliders})
        })
        .collect()
}
