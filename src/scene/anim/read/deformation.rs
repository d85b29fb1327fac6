//! Deforming meshes: a sequence of OBJ files with the triangles of the mesh at rest.

use super::context::Context;
use super::samples::{Samples, samples};
use crate::geometry::{Deformation, TriMesh};
use crate::scene::convention::Convention;
use crate::scene::json::key::Key;
use nalgebra::Vector3;
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
    let allowed = "the faces of the mesh at rest, vertices in the same order, finite numbers";
    let help = "export all frames from the mesh of \"file\"";
    let load = |path: &Path| load_frame(path, rest, convention);
    let Samples { first, samples } = samples(context, key, pattern, "cloth.####.obj", load, [allowed, help])?;
    Some(Deformation { start: f64::from(first) / context.fps, rate: context.fps, samples })
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
