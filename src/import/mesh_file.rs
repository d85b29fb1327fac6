//! Mesh files, read to metres, Y up.

use super::formats;
use super::plain::{Declared, PlainMesh, SampleTimes};
use super::source::Source;
use super::units::{BODY_SIZE, convention};
use crate::geometry::TriMesh;
use crate::scene::Convention;
use crate::{Diagnostic, Error, Result};
use nalgebra::Vector3;

/// A mesh read from a file.
#[derive(Debug, Clone, PartialEq)]
pub struct ImportedMesh {
    /// The mesh in rest space, m, Y up, without degenerate triangles.
    pub mesh: TriMesh,
    /// Vertices at the requested times, likewise; empty if the mesh does not deform.
    pub samples: Vec<Vec<Vector3<f64>>>,
    /// Unit and up axis of the file.
    pub convention: Convention,
    /// Guesses and remarks for the artist.
    pub notes: Vec<String>,
}

/// Reads a mesh (Wavefront OBJ, USD or glTF) for a scalp or a collider. A missing unit is guessed from the
/// mesh's size.
///
/// # Errors
/// An unreadable file, a mesh without triangles, a unit that cannot be guessed.
pub fn read_mesh(source: &Source) -> Result<ImportedMesh> {
    read_deforming_mesh(source, None)
}

/// Reads a mesh as [`read_mesh`] does and, if it is USD or glTF and deforms, its vertices at `times`.
///
/// # Errors
/// As [`read_mesh`].
pub(super) fn read_deforming_mesh(source: &Source, times: Option<&SampleTimes>) -> Result<ImportedMesh> {
    source.check()?;
    let error = |what: String| {
        Error::from(Diagnostic::new(
            &source.path,
            "",
            what,
            "a Wavefront OBJ, USD or glTF file with triangles",
            "export the mesh again, or correct the path",
        ))
    };
    let plain = if source.is_usd() {
        formats::usd::mesh::read(source, times)?
    } else if source.is_gltf() {
        formats::gltf::mesh::read(source, times)?
    } else {
        let mesh = TriMesh::load_obj_with_degenerate(&source.path, &Convention::default()).map_err(error)?;
        PlainMesh { mesh, samples: Vec::new(), declared: Declared::default(), notes: Vec::new() }
    };
    let PlainMesh { mut mesh, mut samples, declared, mut notes } = plain;
    let degenerate = mesh.drop_degenerate().map_err(error)?;
    if degenerate > 0 {
        notes.push(format!("{degenerate} triangles without area dropped"));
    }
    let convention = convention(source, declared, &mesh.vertices, BODY_SIZE, &mut notes)?;
    for x in mesh.vertices.iter_mut().chain(samples.iter_mut().flatten()) {
        *x = convention.length_in(*x) + source.offset;
    }
    Ok(ImportedMesh { mesh, samples, convention, notes })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_prim_of_a_file_that_is_not_usd_is_a_usage_error() {
        let source = Source { prim: Some("/a".into()), ..Source::new("a.obj") };
        assert!(matches!(read_mesh(&source), Err(Error::Usage(_))));
    }
}
