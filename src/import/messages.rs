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
    assert_snapshot!(strands("a.tfx", b"short"), @"");
    assert_snapshot!(file(&[3, 0, 1, 8]), @"");
    assert_snapshot!(file(&[four, 100, 16, 160]), @"");
    assert_snapshot!(file(&[four, u32::MAX, u32::MAX, 160]), @"");
}

#[test]
fn cem_yuksel_hair() {
    let file = |start: &[u32]| strands("a.hair", &[b"HAIR".to_vec(), words(start, 508)].concat());
    assert_snapshot!(strands("a.hair", b"HAIRY"), @"");
    assert_snapshot!(file(&[0, 2, 1]), @"");
    assert_snapshot!(file(&[2, 100, 2, 49]), @"");
    assert_snapshot!(file(&[3, 2, 2, 1]), @"");
    assert_snapshot!(file(&[2, 4, 2, 5]), @"");
    assert_snapshot!(file(&[2, 4, 3]), @"");
}

/// A .hair file of one strand of two points.
fn one_strand(points: [f32; 6]) -> Vec<u8> {
    let points = points.iter().flat_map(|x| x.to_le_bytes());
    [b"HAIR".to_vec(), words(&[1, 2, 2, 1], 124), points.collect()].concat()
}

#[test]
fn strands_of_any_format() {
    assert_snapshot!(strands("a.abc", b""), @"");
    assert_snapshot!(strands("a.hair", &one_strand([0.0; 6])), @"");
    let huge = one_strand([0.0, 0.0, 0.0, 1e7, 0.0, 0.0]);
    let read = |unit| move |path| read_strands(&Source { metres_per_unit: unit, ..Source::new(path) }, 1.0);
    assert_snapshot!(message("a.hair", &huge, read(None)), @"");
    assert_snapshot!(message("a.hair", &huge, read(Some(-1.0))), @"");
}

#[test]
fn meshes() {
    let mesh = |text: &str| message("a.obj", text.as_bytes(), |path| read_mesh(&Source::new(path)));
    assert_snapshot!(mesh("# nothing\n"), @"");
    assert_snapshot!(mesh("v 0 0 0\nf 1 2 3\n"), @"");
    assert_snapshot!(mesh("v 0 0 0\nv 0.1 0 0\nv 0 0.1 0\nf 1 2 3\n"), @"");
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
    assert_snapshot!(message("a.json", text("0").as_bytes(), frames(None)), @"");
    assert_snapshot!(message("a.json", text("24").as_bytes(), frames(Some([1, 9]))), @"");
}
