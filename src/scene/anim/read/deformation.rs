//! Deforming meshes: a sequence of OBJ files with the triangles of the mesh at rest.

use super::context::Context;
use crate::geometry::{Deformation, TriMesh};
use crate::scene::convention::Convention;
use crate::scene::file_sequence::FileSequence;
use crate::scene::json::diagnostics::MAX_REPORTED;
use crate::scene::json::key::Key;
use nalgebra::Vector3;
use rayon::prelude::*;
use std::path::Path;

/// The deformation that the files `pattern`, the value of `key`, give to the mesh `rest`. `rest` has all
/// triangles of its file, also those without area.
pub fn deformation(
    context: &mut Context,
    key: &Key,
    pattern: &str,
    rest: &TriMesh,
    convention: &Convention,
) -> Option<Deformation> {
    let Some(sequence) = FileSequence::new(pattern) else {
        let message = format!("\"{pattern}\" is not a numbered file name");
        let allowed = "a file name with one run of #, a # per digit of the frame number";
        context.diagnostics.add(key, message, allowed, "use a name such as \"cloth.####.obj\"");
        return None;
    };
    let (first, last) = sequence.available_frames(&context.folder, context.frames, context.lead);
    let absent = |frame: &i32| !sequence.path(&context.folder, *frame).is_file();
    // The range may be wrong by billions of frames: stop at the first few that are missing.
    let missing: Vec<i32> = (first..=last).filter(absent).take(MAX_REPORTED + 1).collect();
    if !missing.is_empty() {
        let message = format!("\"{pattern}\" has no file for {}", frames_in_words(&missing));
        let (first, last) = context.frames;
        let allowed = format!("a file for every frame from {first} to {last}");
        let help = "export the missing frames, or shorten \"frames\"";
        context.diagnostics.add(key, message, allowed, help);
        return None;
    }
    let frames: Vec<i32> = (first..=last).collect();
    let folder = &context.folder;
    let loaded: Vec<(i32, Result<_, String>)> = frames
        .into_par_iter()
        .map(|frame| (frame, load_frame(&sequence.path(folder, frame), rest, convention)))
        .collect();
    let bad: Vec<(i32, &String)> =
        loaded.iter().filter_map(|(frame, s)| Some((*frame, s.as_ref().err()?))).collect();
    let allowed = "the faces of the mesh at rest, vertices in the same order, finite numbers";
    for (frame, what) in bad.iter().take(MAX_REPORTED) {
        let file = sequence.path(Path::new(""), *frame);
        let message = format!("\"{}\" {what}", file.display());
        let help = "export all frames from the mesh of \"file\"";
        context.diagnostics.add(key, message, allowed, help);
    }
    if bad.len() > MAX_REPORTED {
        let message = format!("{} files of the sequence are invalid", bad.len());
        context.diagnostics.add(key, message, allowed, "export the sequence again");
    }
    let samples: Vec<_> = loaded.into_iter().map(|(_, sample)| sample.ok()).collect::<Option<_>>()?;
    (!samples.is_empty()).then(|| Deformation {
        start: f64::from(first) / context.fps,
        rate: context.fps,
        samples,
    })
}

/// The vertices of the mesh at `path`, which must have the triangles of `rest`.
///
/// # Errors
/// What is wrong, in words.
fn load_frame(path: &Path, rest: &TriMesh, convention: &Convention) -> Result<Vec<Vector3<f64>>, String> {
    let mesh = TriMesh::load_obj_with_degenerate(path, convention)?;
    let (found, expected) = (mesh.vertices.len(), rest.vertices.len());
    if found != expected {
        return Err(format!("uses {found} vertices, the mesh at rest {expected}"));
    }
    let (found, expected) = (mesh.triangles.len(), rest.triangles.len());
    if found != expected {
        return Err(format!("has {found} triangles, the mesh at rest {expected}"));
    }
    match mesh.triangles.iter().zip(&rest.triangles).position(|(a, b)| a != b) {
        Some(i) => Err(format!("connects other vertices than the mesh at rest, first in triangle {}", i + 1)),
        None => Ok(mesh.vertices),
    }
}

/// "frame 3", "frames 3, 4 and 9"; if there are more than can be listed, "frame 3 and 8 or more others".
fn frames_in_words(frames: &[i32]) -> String {
    match frames {
        [one] => format!("frame {one}"),
        [others @ .., last] if others.len() < MAX_REPORTED => {
            let others: Vec<String> = others.iter().map(i32::to_string).collect();
            format!("frames {} and {last}", others.join(", "))
        }
        _ => format!("frame {} and {MAX_REPORTED} or more others", frames[0]),
    }
}
