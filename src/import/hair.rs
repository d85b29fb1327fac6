//! Cem Yuksel's strands (`.hair`; cemyuksel.com/research/hairmodels).
//!
//! A 128-byte header ("HAIR", u32 strands, u32 points, u32 flags, u32 default segments, f32 defaults, 88 bytes of
//! text), then the arrays the flags name, in order: segments (u16 a strand), points (3 f32), thickness, transparency
//! (f32 a point), colour (3 f32).

use super::bytes::{point_at, u16_at, u32_at};
use super::read::PlainStrands;
use crate::scene::Curves;
use crate::{Diagnostic, Error, Result};
use std::path::Path;

const HEADER: usize = 128;
const HAS_SEGMENTS: u32 = 1;
const HAS_POINTS: u32 = 2;

/// Reads the strands in a .hair file's bytes, in the file's unit and axes; thickness, transparency and colour
/// are passed over.
///
/// # Errors
/// Every fault of the header and sizes, at once.
pub(super) fn parse(file: &Path, bytes: &[u8]) -> Result<PlainStrands> {
    if bytes.len() < HEADER || &bytes[0..4] != b"HAIR" {
        return Err(Diagnostic::new(
            file,
            "header",
            format!("{} bytes that do not start with a header", bytes.len()),
            format!("\"HAIR\" and {HEADER} bytes of header or more"),
            "check that this is a .hair file of Cem Yuksel's format, whole",
        )
        .into());
    }
    let mut faults = Vec::new();
    let [strands, points, flags, default_segments] = [4, 8, 12, 16].map(|at| u32_at(bytes, at));
    let (strands, points) = (strands as usize, points as usize);
    if strands == 0 {
        faults.push(Diagnostic::new(file, "header.strands", "0", "1 or more", "export again with strands"));
    }
    if flags & HAS_POINTS == 0 {
        faults.push(Diagnostic::new(
            file,
            "header.flags",
            format!("{flags:#x}"),
            "bit 1 set (the file has points)",
            "export with points",
        ));
    }
    let listed = flags & HAS_SEGMENTS != 0;
    let points_at = HEADER + if listed { strands.saturating_mul(2) } else { 0 };
    let need = points.checked_mul(12).and_then(|n| n.checked_add(points_at));
    if need.is_none_or(|need| need > bytes.len()) {
        faults.push(Diagnostic::new(
            file,
            "points",
            format!("{strands} strands with {points} points in a file of {} bytes", bytes.len()),
            need.map_or("a size that fits in memory".into(), |n| format!("at least {n} bytes")),
            "the file was cut short or its header is damaged: copy or export it again",
        ));
    }
    if strands > points {
        faults.push(Diagnostic::new(
            file,
            "header.points",
            format!("{points} points for {strands} strands"),
            "one point a strand or more",
            "the header is damaged: export again",
        ));
    }
    // The sizes fit in the file from here on, or the report is made before they are used.
    Error::if_any(faults)?;
    let segments =
        |s: usize| if listed { u16_at(bytes, HEADER + 2 * s) as usize } else { default_segments as usize };
    let sum = (0..strands).try_fold(0usize, |sum, s| sum.checked_add(segments(s).checked_add(1)?));
    if sum != Some(points) {
        return Err(Diagnostic::new(
            file,
            if listed { "segments" } else { "header.default_segments" },
            sum.map_or("more points than can be counted".into(), |n| format!("strands of {n} points in all")),
            format!("{points} points, as the header says"),
            "the header is damaged: export again",
        )
        .into());
    }

    let mut offsets = Vec::with_capacity(strands + 1);
    offsets.push(0);
    for s in 0..strands {
        offsets.push(offsets[s] + segments(s) + 1);
    }
    Ok(PlainStrands {
        curves: Curves {
            offsets,
            points: (0..points).map(|i| point_at(bytes, points_at + 12 * i)).collect(),
            id: (0..strands as i32).collect(),
            group: vec![0; strands],
            root_uv: vec![[0.0; 2]; strands],
        },
        notes: vec!["no root texture coordinates".into()],
        ..PlainStrands::default()
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Error;
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
    fn counts_that_disagree_are_named() {
        let mut bytes = file(&[3, 1], true);
        bytes[HEADER] = 9;
        let Err(Error::BadInput(problems)) = parse(Path::new("a.hair"), &bytes) else { panic!("accepted") };
        assert_eq!(problems[0].key, "segments");
        assert!(problems[0].message.contains("12 points"));
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
