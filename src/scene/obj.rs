//! Triangle meshes in Wavefront OBJ files.

use super::convention::Convention;
use crate::file::read_file;
use crate::geometry::TriMesh;
use nalgebra::Vector3;
use std::fmt::Write;
use std::path::Path;

/// The objects and groups of an OBJ file, in triangles.
///
/// # Errors
/// What is wrong, in words that follow the name of the file.
pub(crate) fn read_models(path: &Path) -> Result<Vec<tobj::Model>, String> {
    let bytes = read_file(path).map_err(|e| format!("cannot be read: {e}"))?;
    let options = tobj::LoadOptions {
        triangulate: true,
        ignore_points: true,
        ignore_lines: true,
        ..Default::default()
    };
    // A collider has no use for materials, so a missing material file is not an error.
    let no_materials = |_: &Path| Err(tobj::LoadError::OpenFileFailed);
    let (models, _) = tobj::load_obj_buf(&mut bytes.as_slice(), &options, no_materials)
        .map_err(|e| format!("is not a valid OBJ file: {e}"))?;
    Ok(models)
}

impl TriMesh {
    /// Reads an OBJ file whose lengths and axes follow `convention`. Splits polygons into triangles and drops
    /// triangles without area. Returns the mesh and the number of triangles dropped.
    ///
    /// # Errors
    /// What is wrong, in words that follow the name of the file.
    pub fn load_obj(path: &Path, convention: &Convention) -> Result<(TriMesh, usize), String> {
        let mut mesh = TriMesh::load_obj_with_degenerate(path, convention)?;
        let degenerate = mesh.drop_degenerate()?;
        Ok((mesh, degenerate))
    }

    /// As [`TriMesh::load_obj`], but keeps all triangles: two files with the same faces give the same
    /// triangles.
    ///
    /// # Errors
    /// As [`TriMesh::load_obj`].
    pub(crate) fn load_obj_with_degenerate(path: &Path, convention: &Convention) -> Result<TriMesh, String> {
        let models = read_models(path)?;
        let mut mesh = TriMesh::default();
        for model in &models {
            let first = mesh.vertices.len();
            let vertex =
                |p: &[f32]| convention.length_in(Vector3::new(p[0].into(), p[1].into(), p[2].into()));
            mesh.vertices.extend(model.mesh.positions.chunks_exact(3).map(vertex));
            for corners in model.mesh.indices.chunks_exact(3) {
                let triangle = [corners[0], corners[1], corners[2]].map(|i| first + i as usize);
                if let Some(outside) = triangle.iter().find(|&&i| i >= mesh.vertices.len()) {
                    return Err(format!(
                        "has a face with vertex {outside}, but only {} vertices",
                        mesh.vertices.len()
                    ));
                }
                mesh.triangles.push(triangle.map(|i| i as u32));
            }
        }
        if let Some(i) = mesh.vertices.iter().position(|p| !p.iter().all(|x| x.is_finite())) {
            return Err(format!("has a vertex that is not finite: number {} of those used", i + 1));
        }
        Ok(mesh)
    }

    /// The mesh as Wavefront OBJ in the unit of its vertices, with `digits` decimal places.
    pub(crate) fn to_obj(&self, digits: usize) -> String {
        let mut out = String::new();
        // Writing to a string does not fail.
        for v in &self.vertices {
            let _ = writeln!(out, "v {:.digits$} {:.digits$} {:.digits$}", v.x, v.y, v.z);
        }
        for t in &self.triangles {
            let _ = writeln!(out, "f {} {} {}", t[0] + 1, t[1] + 1, t[2] + 1);
        }
        out
    }
}
