//! TressFX 4 strands (`.tfx`), as defined by AMD's `TressFXAsset.h`.
//!
//! Layout: a 160-byte header (f32 version, u32 strands, u32 vertices per strand, u32 offset of the positions,
//! u32 offset of the root texture coordinates, unused words); strands × vertices × (x, y, z, w) f32, root
//! first; two f32 texture coordinates per strand.

use super::bytes::{f32_at, point_at, u32_at};
use crate::import::plain::PlainStrands;
use crate::scene::Curves;
use crate::{Diagnostic, Error, Result};
use std::path::Path;

const HEADER: usize = 160;
const VERSION: f32 = 4.0;

/// Counts and byte offsets, checked against the file's size.
struct Header {
    strands: usize,
    vertices: usize,
    position_offset: usize,
    uv_offset: usize,
}

/// Reads the strands in the bytes of a .tfx file. Missing root texture coordinates are (0, 0) and noted.
///
/// # Errors
/// Every error in the header, at once.
pub(crate) fn parse(file: &Path, bytes: &[u8]) -> Result<PlainStrands> {
    let Header { strands, vertices, position_offset, uv_offset } = header(file, bytes)?;
    let count = strands * vertices;
    let points = (0..count).map(|i| point_at(bytes, position_offset + 16 * i)).collect();
    let mut notes = Vec::new();
    let complete = bytes.len().saturating_sub(uv_offset) / 8;
    let with_uv = if uv_offset < HEADER { 0 } else { complete.min(strands) };
    if with_uv == 0 {
        notes.push("no root texture coordinates".into());
    } else if with_uv < strands {
        notes.push(format!("no root texture coordinates for the last {} strands", strands - with_uv));
    }
    let mut root_uv: Vec<[f32; 2]> =
        (0..with_uv).map(|i| [0, 4].map(|k| f32_at(bytes, uv_offset + 8 * i + k))).collect();
    root_uv.resize(strands, [0.0; 2]);
    Ok(PlainStrands {
        curves: Curves {
            offsets: (0..=strands).map(|i| i * vertices).collect(),
            points,
            id: (0..strands as i32).collect(),
            group: vec![0; strands],
            root_uv,
        },
        holds_guides: true,
        notes,
        ..PlainStrands::default()
    })
}

/// Reads the header.
///
/// # Errors
/// As [`parse`].
fn header(file: &Path, bytes: &[u8]) -> Result<Header> {
    if bytes.len() < HEADER {
        return Err(Diagnostic::new(
            file,
            "header",
            format!("the file has only {} bytes", bytes.len()),
            format!("at least {HEADER} bytes"),
            "export the strands again; the copy may be incomplete",
        )
        .into());
    }
    let mut diagnostics = Vec::new();
    let mut report = |key: &str, what: String, allowed: String, remedy: &str| {
        diagnostics.push(Diagnostic::new(file, key, what, allowed, remedy))
    };
    let version = f32_at(bytes, 0);
    if version != VERSION {
        report(
            "header.version",
            version.to_string(),
            "4.0 (f32, little endian)".into(),
            "export with a TressFX 4 exporter, or check that this is a .tfx file",
        );
    }
    let [strands, vertices, position_offset, uv_offset] = [4, 8, 12, 16].map(|at| u32_at(bytes, at) as usize);
    if strands == 0 {
        report("header.strands", "0".into(), "1 or more".into(), "select the hair and export again");
    }
    if vertices < 2 {
        report(
            "header.vertices_per_strand",
            vertices.to_string(),
            "2 or more".into(),
            "export with 16 or 32 vertices per strand",
        );
    }
    if position_offset < HEADER {
        report(
            "header.position_offset",
            position_offset.to_string(),
            format!("{HEADER} or more"),
            "the header is damaged: export again",
        );
    }
    let size = strands.checked_mul(vertices).and_then(|n| n.checked_mul(16));
    let end = size.and_then(|n| n.checked_add(position_offset));
    if end.is_none_or(|end| end > bytes.len()) {
        report(
            "positions",
            format!("{strands} strands of {vertices} vertices do not fit in a file of {} bytes", bytes.len()),
            end.map_or("a size that fits in memory".into(), |end| format!("at least {end} bytes")),
            "the file is incomplete or its header is damaged: copy or export it again",
        );
    }
    Error::if_any(diagnostics)?;
    Ok(Header { strands, vertices, position_offset, uv_offset })
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// A valid file of straight strands that hang from a row of roots.
    fn file(strands: u32, vertices: u32, uv: Option<usize>) -> Vec<u8> {
        let mut out = vec![0; HEADER];
        out[0..4].copy_from_slice(&VERSION.to_le_bytes());
        out[4..8].copy_from_slice(&strands.to_le_bytes());
        out[8..12].copy_from_slice(&vertices.to_le_bytes());
        out[12..16].copy_from_slice(&160u32.to_le_bytes());
        for s in 0..strands {
            for v in 0..vertices {
                for x in [0.01 * s as f32, -0.02 * v as f32, 0.0, 1.0] {
                    out.extend(x.to_le_bytes());
                }
            }
        }
        if let Some(count) = uv {
            let offset = out.len() as u32;
            out[16..20].copy_from_slice(&offset.to_le_bytes());
            (0..count).for_each(|i| {
                out.extend((i as f32 / 8.0).to_le_bytes());
                out.extend(0.25f32.to_le_bytes());
            });
        }
        out
    }

    #[test]
    fn reads_points_and_root_uv() {
        let read = parse(Path::new("a.tfx"), &file(3, 4, Some(3))).unwrap();
        assert_eq!(read.curves.offsets, [0, 4, 8, 12]);
        assert!((read.curves.curve(1)[2].y + 0.04).abs() < 1e-8);
        assert_eq!(read.curves.root_uv[2], [0.25, 0.25]);
        assert!(read.notes.is_empty());
    }

    #[test]
    fn root_uv_may_be_absent_or_incomplete() {
        let absent = parse(Path::new("a.tfx"), &file(3, 4, None)).unwrap();
        assert_eq!(absent.curves.root_uv, [[0.0; 2]; 3]);
        let cut = parse(Path::new("a.tfx"), &file(3, 4, Some(2))).unwrap();
        assert_eq!(cut.curves.root_uv[1], [0.125, 0.25]);
        assert_eq!(cut.curves.root_uv[2], [0.0; 2]);
        assert!(cut.notes[0].contains("last 1 strands"));
    }

    #[test]
    fn all_header_errors_are_reported_at_once() {
        let mut bytes = file(3, 4, None);
        bytes[0..4].copy_from_slice(&3.0f32.to_le_bytes());
        bytes[8..12].copy_from_slice(&1u32.to_le_bytes());
        bytes[12..16].copy_from_slice(&9999u32.to_le_bytes());
        let Err(Error::BadInput(diagnostics)) = parse(Path::new("a.tfx"), &bytes) else { panic!("accepted") };
        let keys: Vec<_> = diagnostics.iter().map(|p| p.key.as_str()).collect();
        assert_eq!(keys, ["header.version", "header.vertices_per_strand", "positions"]);
        assert!(diagnostics.iter().all(|p| !p.help.is_empty() && !p.allowed.is_empty()));
    }

    #[test]
    fn huge_counts_allocate_no_memory() {
        let mut bytes = file(1, 2, None);
        bytes[4..12].fill(0xff);
        assert!(matches!(parse(Path::new("a.tfx"), &bytes), Err(Error::BadInput(_))));
    }

    proptest! {
        #[test]
        fn mutated_files_never_panic(
            edits in prop::collection::vec((0usize..300, any::<u8>()), 0..12), cut in 0usize..400,
        ) {
            let mut bytes = file(3, 3, Some(3));
            for (at, value) in edits {
                let at = at % bytes.len();
                bytes[at] = value;
            }
            bytes.truncate(cut);
            if let Ok(read) = parse(Path::new("a.tfx"), &bytes) {
                prop_assert_eq!(read.curves.points.len(), *read.curves.offsets.last().unwrap());
            }
        }
    }
}
