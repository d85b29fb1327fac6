//! TressFX strands (`.tfx`) of version 4, as defined by AMD's `TressFXFileFormat.h` of TressFX 4, and of
//! version 3, as defined by that of TressFX 3.1.
//!
//! Both begin with a header of f32 version, u32 strands, u32 vertices per strand, and byte offsets of the
//! arrays; the positions follow, strands × vertices, root first; then two f32 texture coordinates per strand.
//!
//! | | version 3 | version 4 |
//! |---|---|---|
//! | header, bytes | 296 | 160 |
//! | follow strands per guide, both ends fixed (u32 each) at byte | 12, 16 | |
//! | offset of the positions, of the texture coordinates at byte | 144, 152 | 12, 16 |
//! | a position | x, y, z | x, y, z, w (0 if fixed) |

use super::bytes::{f32_at, point_at, u32_at};
use crate::import::plain::PlainStrands;
use crate::scene::Curves;
use crate::{Diagnostic, Error, Result};
use std::path::Path;

/// Where a version has its data, bytes.
struct Layout {
    header: usize,
    /// Offset of the positions, and of the texture coordinates, in the header.
    offsets: [usize; 2],
    /// Size of a position.
    position: usize,
    /// Follow strands per guide, and whether both ends are fixed, in the header.
    follow: Option<[usize; 2]>,
}

const VERSION_3: Layout = Layout { header: 296, offsets: [144, 152], position: 12, follow: Some([12, 16]) };
const VERSION_4: Layout = Layout { header: 160, offsets: [12, 16], position: 16, follow: None };

/// First bytes of the text files of TressFX 1 and 2.
const TEXT: &[u8] = b"version";

/// Counts and byte offsets, checked against the file's size.
struct Header {
    layout: Layout,
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
    let Header { layout, strands, vertices, position_offset, uv_offset } = header(file, bytes)?;
    let count = strands * vertices;
    let points = (0..count).map(|i| point_at(bytes, position_offset + layout.position * i)).collect();
    let mut notes = Vec::new();
    if let Some([follow, both_ends]) = layout.follow.map(|at| at.map(|at| u32_at(bytes, at))) {
        if follow > 0 {
            notes.push(format!("the file asks for {follow} strands around each guide (--strands-per-guide)"));
        }
        if both_ends != 0 {
            notes.push("the file fixes both ends of its strands; only their roots are fixed here".into());
        }
    }
    let complete = bytes.len().saturating_sub(uv_offset) / 8;
    let with_uv = if uv_offset < layout.header { 0 } else { complete.min(strands) };
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
            skin: Vec::new(),
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
    if bytes.starts_with(TEXT) {
        return Err(Diagnostic::new(
            file,
            "header.version",
            "the file is text, as those of TressFX 1 and 2 are",
            "a binary file of TressFX 3 or 4",
            "export the strands with an exporter of TressFX 3 or 4",
        )
        .into());
    }
    let version = if bytes.len() < 4 { 0.0 } else { f32_at(bytes, 0) };
    let layout = if (3.0..4.0).contains(&version) { VERSION_3 } else { VERSION_4 };
    if bytes.len() < layout.header {
        return Err(Diagnostic::new(
            file,
            "header",
            format!("the file has only {} bytes", bytes.len()),
            format!("at least {} bytes", layout.header),
            "export the strands again; the copy may be incomplete",
        )
        .into());
    }
    let mut diagnostics = Vec::new();
    let mut report = |key: &str, what: String, allowed: String, remedy: &str| {
        diagnostics.push(Diagnostic::new(file, key, what, allowed, remedy))
    };
    if !(3.0..4.0).contains(&version) && version != 4.0 {
        report(
            "header.version",
            version.to_string(),
            "3.0 to 4.0 (f32, little endian)".into(),
            "export with a TressFX 4 exporter, or check that this is a .tfx file",
        );
    }
    let [strands, vertices] = [4, 8].map(|at| u32_at(bytes, at) as usize);
    let [position_offset, uv_offset] = layout.offsets.map(|at| u32_at(bytes, at) as usize);
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
    if position_offset < layout.header {
        report(
            "header.position_offset",
            position_offset.to_string(),
            format!("{} or more", layout.header),
            "the header is damaged: export again",
        );
    }
    let size = strands.checked_mul(vertices).and_then(|n| n.checked_mul(layout.position));
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
    Ok(Header { layout, strands, vertices, position_offset, uv_offset })
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn put(out: &mut [u8], at: usize, word: u32) {
        out[at..at + 4].copy_from_slice(&word.to_le_bytes());
    }

    /// A valid file of straight strands that hang from a row of roots.
    fn file_of(version: f32, strands: u32, vertices: u32, uv: Option<usize>) -> Vec<u8> {
        let layout = if version < 4.0 { VERSION_3 } else { VERSION_4 };
        let mut out = vec![0; layout.header];
        put(&mut out, 0, version.to_bits());
        put(&mut out, 4, strands);
        put(&mut out, 8, vertices);
        put(&mut out, layout.offsets[0], layout.header as u32);
        for s in 0..strands {
            for v in 0..vertices {
                let place = [0.01 * s as f32, -0.02 * v as f32, 0.0, 1.0];
                place[..layout.position / 4].iter().for_each(|x| out.extend(x.to_le_bytes()));
            }
        }
        if let Some(count) = uv {
            let offset = out.len() as u32;
            put(&mut out, layout.offsets[1], offset);
            (0..count).for_each(|i| {
                out.extend((i as f32 / 8.0).to_le_bytes());
                out.extend(0.25f32.to_le_bytes());
            });
        }
        out
    }

    fn file(strands: u32, vertices: u32, uv: Option<usize>) -> Vec<u8> {
        file_of(4.0, strands, vertices, uv)
    }

    #[test]
    fn version_3_reads_as_version_4() {
        for uv in [None, Some(2), Some(3)] {
            let [old, new] = [3.0, 4.0].map(|v| parse(Path::new("a.tfx"), &file_of(v, 3, 4, uv)).unwrap());
            assert_eq!(old, new);
        }
        let mut bytes = file_of(3.0, 3, 4, None);
        put(&mut bytes, 12, 5);
        put(&mut bytes, 16, 1);
        let notes = parse(Path::new("a.tfx"), &bytes).unwrap().notes;
        assert!(
            notes[0].contains("5 strands around each guide") && notes[1].contains("both ends"),
            "{notes:?}"
        );
    }

    #[test]
    fn errors_of_version_3_are_reported_at_once() {
        let mut bytes = file_of(3.0, 3, 4, None);
        put(&mut bytes, 8, 1);
        put(&mut bytes, 144, 295);
        let Err(Error::BadInput(diagnostics)) = parse(Path::new("a.tfx"), &bytes) else { panic!("accepted") };
        let keys: Vec<_> = diagnostics.iter().map(|p| p.key.as_str()).collect();
        assert_eq!(keys, ["header.vertices_per_strand", "header.position_offset"]);
        let whole = file_of(3.0, 3, 4, None);
        for (length, key) in [(whole.len() - 1, "positions"), (295, "header"), (3, "header")] {
            let Err(Error::BadInput(found)) = parse(Path::new("a.tfx"), &whole[..length]) else {
                panic!("accepted")
            };
            assert_eq!(found[0].key, key);
        }
        let Err(Error::BadInput(found)) = parse(Path::new("a.tfx"), b"version 2.0\nscale 1.0\n") else {
            panic!("accepted")
        };
        assert!(found[0].message.contains("TressFX 1 and 2"));
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
        bytes[0..4].copy_from_slice(&5.0f32.to_le_bytes());
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
            edits in prop::collection::vec((0usize..300, any::<u8>()), 0..12), cut in 0usize..500,
            version in 3u8..=4,
        ) {
            let mut bytes = file_of(f32::from(version), 3, 3, Some(3));
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
