//! Reads a [`Groom`] from the structure of its file: checks its meaning, converts units and axes.

mod context;
mod curves;
mod guides;
mod materials;
mod source;
mod strands;
mod wisps;

use super::file::GroomFile;
use super::model::{Groom, Strands};
use crate::scene::convention::Convention;
use crate::scene::json::buffers::Buffers;
use crate::scene::json::document::Document;
use context::Context;

/// Sections of the file, each with a section that it depends on; see [`Document::finish`].
pub const DEPENDENCIES: &[(&str, &str)] = &[
    ("groups", "materials"),
    ("guides", "buffers"),
    ("guides", "groups"),
    ("wisps", "buffers"),
    ("wisps", "guides"),
    ("strands", "buffers"),
    ("strands", "groups"),
    ("strands", "guides"),
    ("strands", "wisps"),
    ("source", "buffers"),
    ("source", "guides"),
    ("source", "strands"),
];

/// The groom that `file` describes; `default_name` is used if it has no name. Returns `None` only after
/// reporting an error.
pub fn groom(file: GroomFile, default_name: &str, doc: &mut Document) -> Option<Groom> {
    let folder = doc.folder();
    let diagnostics = &mut doc.diagnostics;
    let convention = Convention { metres_per_unit: file.metres_per_unit, up: file.up_axis };
    let buffers = Buffers::read(&file.buffers, &folder, diagnostics);
    let materials = materials::materials(&file.materials, diagnostics);
    let groups = materials::groups(&file.groups, &materials, diagnostics);
    let mut context = Context { convention, buffers, group_count: groups.len(), diagnostics };

    let (guides, guide_count) = guides::guides(&mut context, file.guides);
    let trees = match file.wisps {
        Some(wisps) => wisps::trees(&mut context, wisps, guide_count),
        None => Some(Vec::new()),
    };
    let strands = match file.strands {
        Some(strands) => strands::strands(&mut context, strands, trees.as_deref(), guide_count),
        None => Some(Strands::default()),
    };
    let source = match (file.source, &strands, &guides) {
        (Some(source), Some(strands), Some(guides)) => {
            let counts = [strands.curves.len(), guides.curves.len()];
            source::source(&mut context, source, counts).map(Some)
        }
        _ => Some(None),
    };
    Some(Groom {
        name: file.name.unwrap_or_else(|| default_name.into()),
        notes: file.notes,
        origin: file.origin,
        convention,
        materials,
        groups,
        guides: guides?,
        trees: trees?,
        strands: strands?,
        source: source?,
    })
}
