//! What is painted on a mesh of a Wavefront OBJ file.

use crate::import::plain::{Field, Paint, UV};
use crate::scene::obj::read_models;
use nalgebra::Vector3;
use std::path::Path;

/// The name of the field of vertex colours.
const COLOUR: &str = "color";

/// Texture coordinates, vertex colours and groups of the file at `path`, for the triangles of its mesh.
///
/// # Errors
/// As for the mesh.
pub(crate) fn paint(path: &Path) -> Result<Paint, String> {
    let models = read_models(path)?;
    let mut paint = Paint::default();
    let numbers = |values: &[f32], index: u32, size: usize| {
        let at = index as usize * size;
        Vector3::from_fn(|axis, _| if axis < size { f64::from(values[at + axis]) } else { 0.0 })
    };
    if models.iter().all(|model| model.mesh.texcoord_indices.len() == model.mesh.indices.len()) {
        let corners = models.iter().flat_map(|model| {
            let corners = model.mesh.texcoord_indices.as_chunks::<3>().0;
            corners.iter().map(|t| t.map(|i| numbers(&model.mesh.texcoords, i, 2)))
        });
        paint.fields.push(Field { name: UV.into(), size: 2, corners: corners.collect() });
    }
    if models.iter().all(|model| model.mesh.vertex_color.len() == model.mesh.positions.len()) {
        let corners = models.iter().flat_map(|model| {
            let corners = model.mesh.indices.as_chunks::<3>().0;
            corners.iter().map(move |t| t.map(|i| numbers(&model.mesh.vertex_color, i, 3)))
        });
        paint.fields.push(Field { name: COLOUR.into(), size: 3, corners: corners.collect() });
    }
    paint.known = paint.fields.iter().map(|field| field.name.clone()).collect();
    let mut first = 0;
    for model in models {
        let own = first..first + (model.mesh.indices.len() / 3) as u32;
        first = own.end;
        match paint.parts.iter_mut().find(|(name, _)| *name == model.name) {
            Some((_, triangles)) => triangles.extend(own),
            None => paint.parts.push((model.name, own.collect())),
        }
    }
    Ok(paint)
}
