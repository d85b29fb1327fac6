//! A snapshot of every fault that reading strands, meshes and motions names. The text of a snapshot is what a person sees.

use super::read::{self, Source};
use super::{TrackOptions, track};
use crate::Error;
use crate::error::render;
use std::path::{Path, PathBuf};

/// What is told of a file of these bytes, read by `read`.
fn told<T>(name: &str, bytes: &[u8], read: impl Fn(PathBuf) -> crate::Result<T>) -> String {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join(name), bytes).unwrap();
    match read(folder.path().join(name)) {
        Err(Error::BadInput(problems)) => {
            render(&problems, false).replace(&format!("{}/", folder.path().display()), "")
        }
        Err(other) => panic!("{other}"),
        Ok(_) => panic!("{name} is taken"),
    }
}

fn strands(name: &str, bytes: &[u8]) -> String {
    told(name, bytes, |path| read::strands(&Source { metres_per_unit: Some(0.01), ..Source::new(path) }, 1.0))
}

/// Words of 32 bits, filled up with zeros to so many bytes.
fn words(words: &[u32], bytes: usize) -> Vec<u8> {
    let mut all: Vec<u8> = words.iter().flat_map(|word| word.to_le_bytes()).collect();
    all.resize(bytes.max(all.len()), 0);
    all
}

#[test]
fn tressfx() {
    let file = |start: &[u32]| strands("a.tfx", &words(start, 512));
    let four = 4.0f32.to_bits();
    insta::assert_snapshot!("tfx_short", strands("a.tfx", b"short"));
    insta::assert_snapshot!("tfx_header", file(&[3, 0, 1, 8]));
    insta::assert_snapshot!("tfx_cut", file(&[four, 100, 16, 160]));
    insta::assert_snapshot!("tfx_too_large_to_count", file(&[four, u32::MAX, u32::MAX, 160]));
}

#[test]
fn cem_yuksel() {
    let file = |start: &[u32]| strands("a.hair", &[b"HAIR".to_vec(), words(start, 508)].concat());
    insta::assert_snapshot!("hair_header", strands("a.hair", b"HAIRY"));
    insta::assert_snapshot!("hair_counts", file(&[0, 2, 1]));
    insta::assert_snapshot!("hair_cut", file(&[2, 100, 2, 49]));
    insta::assert_snapshot!("hair_more_strands_than_points", file(&[3, 2, 2, 1]));
    insta::assert_snapshot!("hair_default_segments", file(&[2, 4, 2, 5]));
    insta::assert_snapshot!("hair_segments", file(&[2, 4, 3]));
}

#[test]
fn any_strands() {
    insta::assert_snapshot!("unknown_ending", strands("a.abc", b""));
    let one = |points: &[f32]| {
        let points = points.iter().flat_map(|x| x.to_le_bytes());
        [b"HAIR".to_vec(), words(&[1, 2, 2, 1], 124), points.collect()].concat()
    };
    insta::assert_snapshot!("no_usable_strand", strands("a.hair", &one(&[0.0; 6])));
    let sound = one(&[0.0, 0.0, 0.0, 1e7, 0.0, 0.0]);
    insta::assert_snapshot!(
        "unit_not_guessed",
        told("a.hair", &sound, |path| read::strands(&Source::new(path), 1.0))
    );
    let unit = |path| read::strands(&Source { metres_per_unit: Some(-1.0), ..Source::new(path) }, 1.0);
    insta::assert_snapshot!("unit_of_no_length", told("a.hair", &sound, unit));
}

#[test]
fn meshes() {
    let mesh = |text: &str| told("a.obj", text.as_bytes(), |path| read::mesh(&Source::new(path)));
    insta::assert_snapshot!("mesh_empty", mesh("# nothing\n"));
    insta::assert_snapshot!("mesh_face", mesh("v 0 0 0\nf 1 2 3\n"));
}

#[test]
fn motions() {
    let pose = r#"{ "translation": [0, 0, 0], "rotation_quat_wxyz": [1, 0, 0, 0] }"#;
    let text = |fps: &str| {
        format!(r#"{{ "fps": {fps}, "units": "m", "up_axis": "Y", "frames": [{pose}, {pose}, {pose}] }}"#)
    };
    let frames = |frames| {
        move |path| track(&TrackOptions { frames, ..TrackOptions::new(Source::new(path), Path::new("")) })
    };
    insta::assert_snapshot!("motion_rate", told("a.json", text("0").as_bytes(), frames(None)));
    insta::assert_snapshot!("motion_too_short", told("a.json", text("24").as_bytes(), frames(Some([1, 9]))));
}
