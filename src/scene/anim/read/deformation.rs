//! Deforming meshes: a sequence of OBJ files with the triangles of the mesh at rest.

use super::Reader;
use crate::geometry::{Deformation, TriMesh};
use crate::scene::Convention;
use crate::scene::document::{Key, MAX_NAMED};
use crate::scene::sequence::Sequence;
use nalgebra::Vector3;
use rayon::prelude::*;
use std::path::Path;

impl Reader<'_> {
    /// The motion of the vertices of `rest` that the files named by `pattern`, at `key`, give; `rest` has its file's own triangles.
    pub(super) fn deformation(
        &mut self,
        key: &Key,
        pattern: &str,
        rest: &TriMesh,
        convention: &Convention,
    ) -> Option<Deformation> {
        let Some(sequence) = Sequence::new(pattern) else {
            let allowed = "a file name with one # for each digit of the frame's number, all in one place";
            self.faults.add(key, format!("is \"{pattern}\""), allowed, "write such as \"cloth.####.obj\"");
            return None;
        };
        let (first, last) = sequence.reach(&self.folder, self.frames);
        let absent = |frame: &i32| !sequence.path(&self.folder, *frame).is_file();
        // A range may be wrong by billions; a few missing frames tell.
        let missing: Vec<i32> = (first..=last).filter(absent).take(MAX_NAMED + 1).collect();
        if !missing.is_empty() {
            let what = format!("\"{pattern}\" lacks {}", frames_in_words(&missing));
            let allowed = format!("a file for every frame from {} to {}", self.frames.0, self.frames.1);
            self.faults.add(key, what, allowed, "export the missing frames, or shorten \"frames\"");
            return None;
        }
        let frames: Vec<i32> = (first..=last).collect();
        let read: Vec<(i32, Result<_, String>)> = frames
            .into_par_iter()
            .map(|frame| (frame, sample(&sequence.path(&self.folder, frame), rest, convention)))
            .collect();
        let faulty: Vec<(i32, &String)> =
            read.iter().filter_map(|(frame, s)| Some((*frame, s.as_ref().err()?))).collect();
        let allowed = "the faces of the mesh at rest, vertices in the same order, finite numbers";
        for (frame, what) in faulty.iter().take(MAX_NAMED) {
            let file = sequence.path(Path::new(""), *frame);
            let what = format!("\"{}\" {what}", file.display());
            self.faults.add(key, what, allowed, "export all frames from the mesh that \"file\" names");
        }
        if faulty.len() > MAX_NAMED {
            let what = format!("has {} such frames in all", faulty.len());
            self.faults.add(key, what, allowed, "export the sequence anew");
        }
        let samples: Vec<_> = read.into_iter().map(|(_, sample)| sample.ok()).collect::<Option<_>>()?;
        (!samples.is_empty()).then(|| Deformation {
            start: f64::from(first) / self.fps,
            rate: self.fps,
            samples,
        })
    }
}

/// Vertices of the mesh in the file at `path`, which must have the triangles of `rest`.
///
/// # Errors
/// What is wrong, in words.
fn sample(path: &Path, rest: &TriMesh, convention: &Convention) -> Result<Vec<Vector3<f64>>, String> {
    let mesh = TriMesh::load_obj_as_it_is(path, convention)?;
    let (found, wanted) = (mesh.vertices.len(), rest.vertices.len());
    if found != wanted {
        return Err(format!("uses {found} vertices where the mesh at rest uses {wanted}"));
    }
    let (found, wanted) = (mesh.triangles.len(), rest.triangles.len());
    if found != wanted {
        return Err(format!("has {found} triangles where the mesh at rest has {wanted}"));
    }
    match mesh.triangles.iter().zip(&rest.triangles).position(|(a, b)| a != b) {
        Some(i) => Err(format!("joins other vertices than the mesh at rest, first in triangle {}", i + 1)),
        None => Ok(mesh.vertices),
    }
}

/// "frame 3", "frames 3, 4 and 9", and of more than can be named "frame 3 and 8 or more others".
fn frames_in_words(frames: &[i32]) -> String {
    match frames {
        [one] => format!("frame {one}"),
        [rest @ .., last] if rest.len() < MAX_NAMED => {
            let rest: Vec<String> = rest.iter().map(i32::to_string).collect();
            format!("frames {} and {last}", rest.join(", "))
        }
        _ => format!("frame {} and {MAX_NAMED} or more others", frames[0]),
    }
}
