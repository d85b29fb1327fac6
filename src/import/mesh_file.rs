//! Mesh files, read to metres, Y up.

use super::formats;
use super::plain::{Paint, PlainMesh, SampleTimes};
use super::source::Source;
use super::units::{BODY_SIZE, convention};
use crate::geometry::TriMesh;
use crate::scene::{Convention, RestSpace};
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
    Ok(read(source, times, None)?.mesh)
}

/// A mesh at rest with what is painted on it.
pub(super) struct PaintedMesh {
    pub(super) mesh: ImportedMesh,
    /// Vectors are turned to Y up.
    pub(super) paint: Paint,
    pub(super) space: RestSpace,
}

/// Reads a mesh as [`read_mesh`] does, with what is painted on it: of USD the texture coordinates and the
/// primvars `fields`.
///
/// # Errors
/// As [`read_mesh`].
pub(super) fn read_painted_mesh(source: &Source, fields: &[String]) -> Result<PaintedMesh> {
    read(source, None, Some(fields))
}

fn read(source: &Source, times: Option<&SampleTimes>, fields: Option<&[String]>) -> Result<PaintedMesh> {
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
        formats::usd::mesh::read(source, times, fields)?
    } else if source.is_gltf() {
        formats::gltf::mesh::read(source, times)?
    } else {
        let mesh = TriMesh::load_obj_with_degenerate(&source.path, &Convention::default()).map_err(error)?;
        let paint = fields.map(|_| formats::obj::paint(&source.path)).transpose().map_err(error)?;
        PlainMesh { mesh, paint: paint.unwrap_or_default(), ..PlainMesh::default() }
    };
    let PlainMesh { mut mesh, mut samples, mut paint, declared, space, mut notes } = plain;
    paint.retain(&mesh.have_area());
    let degenerate = mesh.drop_degenerate().map_err(error)?;
    if degenerate > 0 {
        notes.push(format!("{degenerate} triangles without area dropped"));
    }
    let convention = convention(source, declared, &mesh.vertices, BODY_SIZE, &mut notes)?;
    for x in mesh.vertices.iter_mut().chain(samples.iter_mut().flatten()) {
        *x = convention.length_in(*x) + source.offset;
    }
    for numbers in paint.fields.iter_mut().filter(|field| field.size == 3) {
        numbers.corners.iter_mut().flatten().for_each(|x| *x = convention.direction_in(*x));
    }
    Ok(PaintedMesh { mesh: ImportedMesh { mesh, samples, convention, notes }, paint, space })
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
