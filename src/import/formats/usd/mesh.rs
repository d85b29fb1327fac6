//! Meshes of a USD stage.

use super::exchange::{Exchange, points, required};
use crate::Result;
use crate::geometry::TriMesh;
use crate::import::plain::{PlainMesh, SampleTimes};
use crate::import::source::Source;
use serde::Deserialize;

#[derive(Debug, Deserialize)]
struct Header {}

/// Reads the meshes at and below a prim as one mesh, in its rest pose and, if it deforms, at `times`.
///
/// # Errors
/// As [`Exchange::read`].
pub(crate) fn read(source: &Source, times: Option<&SampleTimes>) -> Result<PlainMesh> {
    let mut options = Vec::new();
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
    Ok(PlainMesh {
        samples: points(&moving).chunks(vertices.len().max(1)).map(<[_]>::to_vec).collect(),
        mesh: TriMesh { vertices, triangles },
        declared: read.header.declared(),
        notes: read.header.notes,
    })
}
