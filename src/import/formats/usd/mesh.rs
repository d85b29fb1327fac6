//! Meshes of a USD stage.

use super::exchange::{Exchange, points, required};
use crate::Result;
use crate::geometry::TriMesh;
use crate::import::plain::{Field, Paint, PlainMesh, SampleTimes};
use crate::import::source::Source;
use crate::scene::RestSpace;
use nalgebra::Vector3;
use serde::Deserialize;

#[derive(Debug, Deserialize)]
struct Header {
    space: RestSpace,
    /// Name and size of each field that was found.
    fields: Vec<(String, usize)>,
    /// Names of the parts.
    parts: Vec<String>,
    /// Names of all fields that the meshes have.
    known: Vec<String>,
}

/// Reads the meshes at and below a prim as one mesh, in its rest pose and, if it deforms, at `times`; with
/// texture coordinates, parts and the primvars `fields` if these are given.
///
/// # Errors
/// As [`Exchange::read`].
pub(crate) fn read(
    source: &Source,
    times: Option<&SampleTimes>,
    fields: Option<&[String]>,
) -> Result<PlainMesh> {
    let mut options: Vec<String> =
        fields.iter().map(|fields| format!("--fields={}", fields.join(","))).collect();
    if let Some(SampleTimes { start, step, count, carrier, from_world, .. }) = times {
        options.push(format!("--times={start},{step},{count}"));
        options.extend(carrier.iter().map(|prim| format!("--carrier={prim}")));
        options.extend(from_world.iter().map(|matrix| {
            let rows: Vec<String> = matrix.transpose().iter().map(f64::to_string).collect();
            format!("--from-world={}", rows.join(","))
        }));
    }
    let read = Exchange::<Header>::read("mesh", source, &options)?;
    let vertices = points(&required(read.f64s("vertices"), "vertices")?);
    let triangles = required(read.u32s("triangles"), "triangles")?.as_chunks().0.to_vec();
    let moving = read.f64s("moving").unwrap_or_default();
    let paint = paint(&read)?;
    Ok(PlainMesh {
        paint,
        space: read.header.more.space,
        samples: points(&moving).chunks(vertices.len().max(1)).map(<[_]>::to_vec).collect(),
        mesh: TriMesh { vertices, triangles },
        declared: read.header.declared(),
        notes: read.header.notes,
    })
}

/// What is painted on the meshes.
///
/// # Errors
/// The package left out an array.
fn paint(read: &Exchange<Header>) -> Result<Paint> {
    let Header { fields, parts, known, .. } = &read.header.more;
    let field = |(k, (name, size)): (usize, &(String, usize))| {
        let key = format!("field:{k}");
        let numbers = required(read.f64s(&key), &key)?;
        let vector = |at: &[f64]| Vector3::from_fn(|axis, _| at.get(axis).copied().unwrap_or(0.0));
        let at_corners: Vec<_> = numbers.chunks(*size).map(vector).collect();
        Ok(Field { name: name.clone(), size: *size, corners: at_corners.as_chunks().0.to_vec() })
    };
    let part = |(k, name): (usize, &String)| {
        let key = format!("part:{k}");
        Ok((name.clone(), required(read.u32s(&key), &key)?))
    };
    Ok(Paint {
        fields: fields.iter().enumerate().map(field).collect::<Result<_>>()?,
        parts: parts.iter().enumerate().map(part).collect::<Result<_>>()?,
        known: known.clone(),
    })
}
