//! Cem Yuksel's strands (`.hair`; cemyuksel.com/research/hairmodels).
//!
//! Layout: a 128-byte header ("HAIR", u32 strands, u32 points, u32 flags, u32 default segments, f32 defaults,
//! 88 bytes of text), then the arrays that the flags select, in order: segments (u16 per strand), points (3
//! f32), thickness, transparency (f32 per point), colour (3 f32).

use super::bytes::{point_at, u16_at, u32_at};
use crate::import::plain::PlainStrands;
use crate::scene::Curves;
use crate::{Diagnostic, Error, Result};
use std::path::Path;

const HEADER: usize = 128;
const HAS_SEGMENTS: u32 = 1;
const HAS_POINTS: u32 = 2;

/// Counts and byte offsets, checked against the file's size.
struct Header {
    strands: usize,
    points: usize,
    points_at: usize,
    /// Whether the file lists the segments of each strand.
    listed: bool,
    /// Segments of each strand where they are not listed.
    default_segments: usize,
}

/// Reads the strands in the bytes of a .hair file; thickness, transparency and colour are ignored.
///
/// # Errors
/// Every error in the header and sizes, at once.
pub(crate) fn parse(file: &Path, bytes: &[u8]) -> Result<PlainStrands> {
    let header = header(file, bytes)?;
    let offsets = offsets(file, bytes, &header)?;
    let Header { strands, points, points_at, .. } = header;
    Ok(PlainStrands {
        curves: Curves {
            offsets,
            points: (0..points).map(|i| point_at(bytes, points_at + 12 * i)).collect(),
            id: (0..strands as i32).collect(),
            group: vec![0; strands],
            root_uv: vec![[0.0; 2]; strands],
            skin: Vec::new(),
        },
        notes: vec!["no root texture coordinates".into()],
        ..PlainStrands::default()
    })
}

/// Reads the header and checks that the points lie within the file.
///
/// # Errors
/// As [`parse`].
fn header(file: &Path, bytes: &[u8]) -> Result<Header> {
    if bytes.len() < HEADER || &bytes[0..4] != b"HAIR" {
        return Err(Diagnostic::new(
            file,
            "header",
            format!("the file of {} bytes does not start with a .hair header", bytes.len()),
            format!("\"HAIR\" and at least {HEADER} bytes of header"),
            "check that this is a complete file in Cem Yuksel's .hair format",
        )
        .into());
    }
    let mut diagnostics = Vec::new();
    let [strands, points, flags, default_segments] = [4, 8, 12, 16].map(|at| u32_at(bytes, at));
    let (strands, points) = (strands as usize, points as usize);
    if strands == 0 {
        diagnostics.push(Diagnostic::new(
            file,
            "header.strands",
            "0",
            "1 or more",
            "select the hair and export again",
        ));
    }
    if flags & HAS_POINTS == 0 {
        diagnostics.push(Diagnostic::new(
            file,
            "header.flags",
            format!("{flags:#x}"),
            "bit 1 set (the file has points)",
            "export with points",
        ));
    }
    let listed = flags & HAS_SEGMENTS != 0;
    let points_at = HEADER + if listed { strands.saturating_mul(2) } else { 0 };
    let end = points.checked_mul(12).and_then(|n| n.checked_add(points_at));
    if end.is_none_or(|end| end > bytes.len()) {
        diagnostics.push(Diagnostic::new(
            file,
            "points",
            format!("{strands} strands with {points} points do not fit in a file of {} bytes", bytes.len()),
            end.map_or("a size that fits in memory".into(), |end| format!("at least {end} bytes")),
            "the file is incomplete or its header is damaged: copy or export it again",
        ));
    }
    if strands > points {
        diagnostics.push(Diagnostic::new(
            file,
            "header.points",
            format!("{points} points for {strands} strands"),
            "at least one point per strand",
            "the header is damaged: export again",
        ));
    }
    Error::if_any(diagnostics)?;
    Ok(Header { strands, points, points_at, listed, default_segments: default_segments as usize })
}

/// Index of the first point of each strand, and the number of points.
///
/// # Errors
/// Segments that do not add up to the number of points.
fn offsets(file: &Path, bytes: &[u8], header: &Header) -> Result<Vec<usize>> {
    let &Header { strands, points, listed, default_segments, .. } = header;
    let segments = |s: usize| if listed { u16_at(bytes, HEADER + 2 * s) as usize } else { default_segments };
    let sum = (0..strands).try_fold(0usize, |sum, s| sum.checked_add(segments(s).checked_add(1)?));
    if sum != Some(points) {
        return Err(Diagnostic::new(
            file,
            if listed { "segments" } else { "header.default_segments" },
            sum.map_or("too many points to count".into(), |n| {
                format!("the strands have {n} points in total")
            }),
            format!("{points} points, as in the header"),
            "the header is damaged: export again",
        )
        .into());
    }
    let mut offsets = Vec::with_capacity(strands + 1);
    offsets.push(0);
    for s in 0..strands {
        offsets.push(offsets[s] + segments(s) + 1);
    }
    Ok(offsets)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn file(segments: &[u16], listed: bool) -> Vec<u8> {
        let points: u32 = segments.iter().map(|&s| u32::from(s) + 1).sum();
        let mut out = vec![0; HEADER];
        out[0..4].copy_from_slice(b"HAIR");
        out[4..8].copy_from_slice(&(segments.len() as u32).to_le_bytes());
        out[8..12].copy_from_slice(&points.to_le_bytes());
        out[12..16].copy_from_slice(&(if listed { 3u32 } else { 2 }).to_le_bytes());
        out[16..20].copy_from_slice(&u32::from(segments[0]).to_le_bytes());
        if listed {
            segments.iter().for_each(|s| out.extend(s.to_le_bytes()));
        }
        for i in 0..points {
            [i as f32, 0.5, -1.0].iter().for_each(|x| out.extend(x.to_le_bytes()));
        }
        out
    }

    #[test]
    fn reads_listed_and_default_segments() {
        let read = parse(Path::new("a.hair"), &file(&[3, 1, 2], true)).unwrap();
        assert_eq!(read.curves.offsets, [0, 4, 6, 9]);
        assert_eq!(read.curves.curve(1)[0].x, 4.0);
        let read = parse(Path::new("a.hair"), &file(&[2, 2], false)).unwrap();
        assert_eq!(read.curves.offsets, [0, 3, 6]);
    }

    #[test]
    fn inconsistent_counts_are_an_error() {
        let mut bytes = file(&[3, 1], true);
        bytes[HEADER] = 9;
        let Err(Error::BadInput(diagnostics)) = parse(Path::new("a.hair"), &bytes) else {
            panic!("accepted")
        };
        assert_eq!(diagnostics[0].key, "segments");
        assert!(diagnostics[0].message.contains("12 points"));
    }

    proptest! {
        #[test]
        fn mutated_files_never_panic(
            edits in prop::collection::vec((0usize..300, any::<u8>()), 0..12), cut in 0usize..400, listed: bool,
        ) {
            let mut bytes = file(&[3, 3, 3], listed);
            for (at, value) in edits {
                let at = at % bytes.len();
                bytes[at] = value;
            }
            bytes.truncate(cut);
            if let Ok(read) = parse(Path::new("a.hair"), &bytes) {
                prop_assert_eq!(read.curves.points.len(), *read.curves.offsets.last().unwrap());
            }
        }
    }
}
