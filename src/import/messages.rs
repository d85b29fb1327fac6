//! Every error message for strand, mesh and motion files, as a user sees it.

use super::mesh_file::read_mesh;
use super::source::Source;
use super::strand_file::read_strands;
use super::track::convert::track;
use super::track::options::TrackOptions;
use crate::Error;
use crate::error::render;
use insta::assert_snapshot;
use std::path::{Path, PathBuf};

/// The message for a file of these bytes.
fn message<T>(name: &str, bytes: &[u8], read: impl Fn(PathBuf) -> crate::Result<T>) -> String {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join(name), bytes).unwrap();
    match read(folder.path().join(name)) {
        Err(Error::BadInput(diagnostics)) => {
            render(&diagnostics, false).replace(&format!("{}/", folder.path().display()), "")
        }
        Err(other) => panic!("{other}"),
        Ok(_) => panic!("{name} is accepted"),
    }
}

fn strands(name: &str, bytes: &[u8]) -> String {
    let read = |path| read_strands(&Source { metres_per_unit: Some(0.01), ..Source::new(path) }, 1.0);
    message(name, bytes, read)
}

/// 32-bit words, padded with zeros to a number of bytes.
fn words(words: &[u32], bytes: usize) -> Vec<u8> {
    let mut all: Vec<u8> = words.iter().flat_map(|word| word.to_le_bytes()).collect();
    all.resize(bytes.max(all.len()), 0);
    all
}

#[test]
fn tressfx() {
    let file = |start: &[u32]| strands("a.tfx", &words(start, 512));
    let four = 4.0f32.to_bits();
    assert_snapshot!(strands("a.tfx", b"short"), @r#"
    × a.tfx: header: the file has only 5 bytes
    help: export the strands again; the copy may be incomplete
          allowed: at least 160 bytes
    "#);
    assert_snapshot!(file(&[3, 0, 1, 8]), @r#"
    × a.tfx: header.version: 0.000000000000000000000000000000000000000000004
    help: export with a TressFX 4 exporter, or check that this is a .tfx file
          allowed: 3.0 to 4.0 (f32, little endian)
    × a.tfx: header.strands: 0
    help: select the hair and export again
          allowed: 1 or more
    × a.tfx: header.vertices_per_strand: 1
    help: export with 16 or 32 vertices per strand
          allowed: 2 or more
    × a.tfx: header.position_offset: 8
    help: the header is damaged: export again
          allowed: 160 or more
    "#);
    assert_snapshot!(file(&[four, 100, 16, 160]), @r#"
    × a.tfx: positions: 100 strands of 16 vertices do not fit in a file of 512 bytes
    help: the file is incomplete or its header is damaged: copy or export it again
          allowed: at least 25760 bytes
    "#);
    assert_snapshot!(file(&[four, u32::MAX, u32::MAX, 160]), @r#"
    × a.tfx: positions: 4294967295 strands of 4294967295 vertices do not fit in a file of 512
    │ bytes
    help: the file is incomplete or its header is damaged: copy or export it again
          allowed: a size that fits in memory
    "#);
}

#[test]
fn cem_yuksel_hair() {
    let file = |start: &[u32]| strands("a.hair", &[b"HAIR".to_vec(), words(start, 508)].concat());
    assert_snapshot!(strands("a.hair", b"HAIRY"), @r#"
    × a.hair: header: the file of 5 bytes does not start with a .hair header
    help: check that this is a complete file in Cem Yuksel's .hair format
          allowed: "HAIR" and at least 128 bytes of header
    "#);
    assert_snapshot!(file(&[0, 2, 1]), @r#"
    × a.hair: header.strands: 0
    help: select the hair and export again
          allowed: 1 or more
    × a.hair: header.flags: 0x1
    help: export with points
          allowed: bit 1 set (the file has points)
    "#);
    assert_snapshot!(file(&[2, 100, 2, 49]), @r#"
    × a.hair: points: 2 strands with 100 points do not fit in a file of 512 bytes
    help: the file is incomplete or its header is damaged: copy or export it again
          allowed: at least 1328 bytes
    "#);
    assert_snapshot!(file(&[3, 2, 2, 1]), @r#"
    × a.hair: header.points: 2 points for 3 strands
    help: the header is damaged: export again
          allowed: at least one point per strand
    "#);
    assert_snapshot!(file(&[2, 4, 2, 5]), @r#"
    × a.hair: header.default_segments: the strands have 12 points in total
    help: the header is damaged: export again
          allowed: 4 points, as in the header
    "#);
    assert_snapshot!(file(&[2, 4, 3]), @r#"
    × a.hair: segments: the strands have 2 points in total
    help: the header is damaged: export again
          allowed: 4 points, as in the header
    "#);
}

/// A .hair file of one strand of two points.
fn one_strand(points: [f32; 6]) -> Vec<u8> {
    let points = points.iter().flat_map(|x| x.to_le_bytes());
    [b"HAIR".to_vec(), words(&[1, 2, 2, 1], 124), points.collect()].concat()
}

#[test]
fn strands_of_any_format() {
    assert_snapshot!(strands("a.abc", b""), @r#"
    × a.abc: unknown file extension
    help: export to one of these formats, or rename the file
          allowed: .usd, .usda, .usdc, .usdz, .tfx or .hair
    "#);
    assert_snapshot!(strands("a.hair", &one_strand([0.0; 6])), @r#"
    × a.hair: strands: none of 1 is usable: 0 not finite, 1 shorter than 1 mm
    help: check the unit (--units): a groom in metres that is read as millimetres is too short
          allowed: at least one usable strand
    "#);
    let huge = one_strand([0.0, 0.0, 0.0, 1e7, 0.0, 0.0]);
    let read = |unit| move |path| read_strands(&Source { metres_per_unit: unit, ..Source::new(path) }, 1.0);
    assert_snapshot!(message("a.hair", &huge, read(None)), @r#"
    × a.hair: units: cannot be guessed: the size of 10000000.000 units is not 0.1 to 2 m in m,
    │ cm or mm
    help: set --units (FILE:UNITS for a mesh): m, cm, mm, in, ft or metres per unit
          allowed: a given unit, or a size from which it can be guessed
    "#);
    assert_snapshot!(message("a.hair", &huge, read(Some(-1.0))), @r#"
    × a.hair: units: -1 m
    help: give --units as m, cm, mm, in, ft or metres per unit
          allowed: a positive length
    "#);
}

#[test]
fn meshes() {
    let mesh = |text: &str| message("a.obj", text.as_bytes(), |path| read_mesh(&Source::new(path)));
    assert_snapshot!(mesh("# nothing\n"), @r#"
    × a.obj: has no triangles
    help: export the mesh again, or correct the path
          allowed: a Wavefront OBJ, USD or glTF file with triangles
    "#);
    assert_snapshot!(mesh("v 0 0 0\nf 1 2 3\n"), @r#"
    × a.obj: is not a valid OBJ file: face vertex index out of bounds
    help: export the mesh again, or correct the path
          allowed: a Wavefront OBJ, USD or glTF file with triangles
    "#);
    assert_snapshot!(mesh("v 0 0 0\nv 0.1 0 0\nv 0 0.1 0\nf 1 2 3\n"), @r#"
    × a.obj: units: cannot be guessed: the size of 0.141 units is not 0.15 to 3 m in m, cm or
    │ mm
    help: set --units (FILE:UNITS for a mesh): m, cm, mm, in, ft or metres per unit
          allowed: a given unit, or a size from which it can be guessed
    "#);
}

#[test]
fn motion() {
    let pose = r#"{ "translation": [0, 0, 0], "rotation_quat_wxyz": [1, 0, 0, 0] }"#;
    let text = |fps: &str| {
        format!(r#"{{ "fps": {fps}, "units": "m", "up_axis": "Y", "frames": [{pose}, {pose}, {pose}] }}"#)
    };
    let frames = |frames| {
        move |path| track(&TrackOptions { frames, ..TrackOptions::new(Source::new(path), Path::new("")) })
    };
    assert_snapshot!(message("a.json", text("0").as_bytes(), frames(None)), @r#"
     × fps: 0 is out of range
      ╭─[a.json:1:3]
    1 │ { "fps": 0, "units": "m", "up_axis": "Y", "frames": [{ "translation": [0, 0, 0], "rotati
      ·   ────────
      ╰────
     help: use a value in the allowed range
           allowed: 1 to 10000
    "#);
    let far = text("24").replacen("[0, 0, 0]", "[0, 1e300, 0]", 1);
    assert_snapshot!(message("a.json", far.as_bytes(), frames(None)), @r#"
    × a.json: motion: sample 0 is at (0.000e0, 1.000e300, 0.000e0) m
    help: correct the sample, or the unit (--units)
          allowed: up to 1e6 m from the origin
    "#);
    assert_snapshot!(message("a.json", text("24").as_bytes(), frames(Some([1, 9]))), @r#"
    × a.json: frames: 1 to 9 requested
    help: shorten the range with --frames, or export a longer motion
          allowed: a range within 1 to 3, which the motion covers
    "#);
}
