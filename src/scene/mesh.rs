//! Triangle meshes from Wavefront OBJ files.

use super::{Convention, TriMesh};
use crate::file::read_file;
use nalgebra::Vector3;
use std::path::Path;

impl TriMesh {
    /// Reads an OBJ file whose lengths and axes follow `convention`; polygons are split into triangles, and
    /// triangles of no area are dropped and counted. Returns the mesh and that count.
    ///
    /// # Errors
    /// What is wrong, in words.
    pub fn load_obj(path: &Path, convention: &Convention) -> Result<(TriMesh, usize), String> {
        let bytes = read_file(path).map_err(|e| format!("cannot be read: {e}"))?;
        let options = tobj::LoadOptions {
            triangulate: true,
            ignore_points: true,
            ignore_lines: true,
            ..Default::default()
        };
        // Materials do not matter to a collider; a missing material file is no fault.
        let no_materials = |_: &Path| Err(tobj::LoadError::OpenFileFailed);
        let (models, _) = tobj::load_obj_buf(&mut bytes.as_slice(), &options, no_materials)
            .map_err(|e| format!("is not a sound OBJ file: {e}"))?;
        let mut mesh = TriMesh { file: path.into(), ..Default::default() };
        let mut degenerate = 0;
        for model in &models {
            let first = mesh.vertices.len();
            let vertex =
                |p: &[f32]| convention.length_in(Vector3::new(p[0].into(), p[1].into(), p[2].into()));
            mesh.vertices.extend(model.mesh.positions.chunks_exact(3).map(vertex));
            for corners in model.mesh.indices.chunks_exact(3) {
                let corner = |i: usize| first + corners[i] as usize;
                let vertices = [corner(0), corner(1), corner(2)].map(|i| mesh.vertices.get(i));
                let [Some(a), Some(b), Some(c)] = vertices else {
                    return Err(format!(
                        "has a face with vertex {}, of {} vertices",
                        corner(0),
                        mesh.vertices.len()
                    ));
                };
                // Relative to the sides: a small triangle is no fault, a needle of no area has no normal.
                let (u, v) = (b - a, c - a);
                if u.cross(&v).norm() > 1e-12 * u.norm_squared().max(v.norm_squared()) {
                    mesh.triangles.push([0, 1, 2].map(|i| corner(i) as u32));
                } else {
                    degenerate += 1;
                }
            }
        }
        if let Some(i) = mesh.vertices.iter().position(|p| !p.iter().all(|x| x.is_finite())) {
            return Err(format!("has a vertex that is not finite: number {} of those used", i + 1));
        }
        if mesh.triangles.is_empty() {
            return Err(match degenerate {
                0 => "holds no triangle".into(),
                n => format!("holds no triangle of any area (without area: {n})"),
            });
        }
        Ok((mesh, degenerate))
    }
}
