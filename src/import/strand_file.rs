//! Strand files, read to metres, Y up, and cleaned: unusable strands are dropped and counted.

use super::formats;
use super::plain::{DrawnCurves, PlainGroup, PlainStrands, Rest, StrandAttributes};
use super::source::Source;
use super::units::{HAIR_SIZE, convention};
use crate::scene::{Convention, Curves};
use crate::{Diagnostic, Error, Result};
use nalgebra::Vector3;
use std::collections::{BTreeMap, HashMap, HashSet};
use std::fmt;
use std::path::{Path, PathBuf};

/// Shorter strands are dropped, m.
pub const MIN_STRAND_LENGTH: f64 = 1e-3;
/// Consecutive vertices closer than this are merged, m: single-precision files cannot tell them apart.
const MERGE_DISTANCE: f64 = 1e-6;
/// Largest extent of the strands of a file, m: that of the guides of a groom that a bake reads.
const MAX_EXTENT: f64 = 100.0;
/// Most strands out of range that are reported one by one.
const MAX_REPORTED: usize = 8;

/// Attributes of strands, by whether the strand is a guide and by its id.
pub(super) type AttributeMap = BTreeMap<(bool, i32), StrandAttributes>;

/// The usable strands of a file, m, Y up.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct CleanStrands {
    /// Strands that are not guides, or all strands if the file does not mark guides; may be empty.
    pub(super) curves: Curves,
    /// Strands that the file marks as guides; may be empty.
    pub(super) guides: Curves,
    /// As [`PlainStrands::holds_guides`].
    pub(super) holds_guides: bool,
    /// Attributes of both; empty where the file has none.
    pub(super) attributes: AttributeMap,
    /// The groups of both; at least one.
    pub(super) groups: Vec<PlainGroup>,
    pub(super) rest: Rest,
    /// The curves as they are drawn, of a format that draws curves over control points.
    pub(super) drawn: Option<CleanDrawn>,
    pub(super) report: StrandFileReport,
}

/// Curves over control points, with matrices to metres, Y up.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct CleanDrawn {
    pub(super) curves: DrawnCurves,
    /// Factor by which each curve was lengthened; `None` for 1.
    pub(super) length: Option<Vec<f64>>,
    /// The curve of each strand, by whether it is a guide and by its id.
    pub(super) index: HashMap<(bool, i32), u32>,
}

impl CleanDrawn {
    /// The curves of the strands with these ids.
    pub(super) fn indices(&self, marked: bool, ids: &[i32]) -> Vec<Option<u32>> {
        ids.iter().map(|id| self.index.get(&(marked, *id)).copied()).collect()
    }
}

/// What a strand file contains and what was dropped.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct StrandFileReport {
    /// The file.
    pub path: PathBuf,
    /// Strands in the file.
    pub read: usize,
    /// Strands kept.
    pub kept: usize,
    /// Kept strands that the file marks as guides.
    pub guides: usize,
    /// Strands dropped because a coordinate is not finite.
    pub not_finite: usize,
    /// Strands dropped because they are shorter than [`MIN_STRAND_LENGTH`].
    pub too_short: usize,
    /// Strands dropped because an earlier strand has the same vertices.
    pub duplicates: usize,
    /// Vertices merged with their predecessor because both coincide.
    pub merged_vertices: usize,
    /// Length of the kept strands, m: shortest, mean, longest.
    pub length: [f64; 3],
    /// Largest ratio of the longest to the shortest segment within a strand.
    pub segment_ratio: f64,
    /// Unit and up axis used.
    pub convention: Convention,
    /// Guesses and remarks for the artist.
    pub notes: Vec<String>,
}

/// Reads a strand file and scales every strand by `length_scale` about its root.
///
/// # Errors
/// An unreadable or damaged file, an unknown extension, no usable strand, strands far from the others, a unit
/// that cannot be guessed.
pub(super) fn read_strands(source: &Source, length_scale: f64) -> Result<CleanStrands> {
    let mut plain = parse(source)?;
    let mut notes = std::mem::take(&mut plain.notes);
    let convention = convention(source, plain.declared, &plain.curves.points, HAIR_SIZE, &mut notes)?;
    let mut report = StrandFileReport {
        path: source.path.clone(),
        read: plain.curves.len(),
        convention,
        notes,
        ..Default::default()
    };
    convert(&mut plain, source, convention, length_scale);
    let PlainStrands { curves, guide, holds_guides, mut groups, attributes, rest, drawn, .. } = plain;
    if groups.is_empty() {
        groups.push(PlainGroup { name: "hair".into(), width: None });
    }
    let is_guide = |c: usize| guide.get(c).copied().unwrap_or(false);
    let drawn = drawn.map(|curves_drawn| {
        let factors: Vec<f64> = (0..curves.len())
            .map(|c| length_scale * attributes.get(c).map_or(1.0, |own| own.length))
            .collect();
        CleanDrawn {
            curves: curves_drawn,
            length: factors.iter().any(|f| *f != 1.0).then_some(factors),
            index: (0..curves.len()).map(|c| ((is_guide(c), curves.id[c]), c as u32)).collect(),
        }
    });
    let attributes =
        attributes.iter().enumerate().map(|(c, own)| ((is_guide(c), curves.id[c]), *own)).collect();
    let all = 0..curves.len();
    let guides = clean(&curves, all.clone().filter(|&c| is_guide(c)), &mut report);
    let curves = clean(&curves, all.filter(|&c| !is_guide(c)), &mut report);
    if curves.is_empty() && guides.is_empty() {
        return Err(no_usable_strand(&report).into());
    }
    check_extent(&source.path, [("guide", &guides), ("strand", &curves)])?;
    report.guides = guides.len();
    report.length[1] /= report.kept as f64;
    Ok(CleanStrands { curves, guides, holds_guides, attributes, groups, rest, drawn, report })
}

/// Reads a strand file with the reader that its extension selects.
fn parse(source: &Source) -> Result<PlainStrands> {
    source.check()?;
    match source.extension().as_deref() {
        _ if source.is_usd() => formats::usd::strands::read(source),
        Some("tfx") => formats::tfx::parse(&source.path, &source.read()?),
        Some("hair") => formats::hair::parse(&source.path, &source.read()?),
        _ => Err(Diagnostic::new(
            &source.path,
            "",
            "unknown file extension",
            ".usd, .usda, .usdc, .usdz, .tfx or .hair",
            "export to one of these formats, or rename the file",
        )
        .into()),
    }
}

/// Converts positions and widths to metres, Y up, and scales each strand about its root.
fn convert(plain: &mut PlainStrands, source: &Source, convention: Convention, length_scale: f64) {
    let curves = &mut plain.curves;
    for p in &mut curves.points {
        *p = convention.length_in(*p) + source.offset;
    }
    for (c, ends) in curves.offsets.windows(2).enumerate() {
        let own = plain.attributes.get(c).map_or(1.0, |own| own.length);
        scale_about_root(&mut curves.points[ends[0]..ends[1]], length_scale * own);
    }
    for prim in plain.drawn.iter_mut().flat_map(|drawn| &mut drawn.prims) {
        prim.to_rest = convention.matrix_in() * prim.to_rest;
        prim.to_rest.append_translation_mut(&source.offset);
    }
    for width in plain.groups.iter_mut().filter_map(|group| group.width.as_mut()) {
        *width = width.map(|w| w * convention.metres_per_unit);
    }
}

fn scale_about_root(points: &mut [Vector3<f64>], factor: f64) {
    if let Some(&root) = points.first().filter(|_| factor != 1.0) {
        points.iter_mut().for_each(|p| *p = root + (*p - root) * factor);
    }
}

/// Copies the usable strands among `which` (curves in metres), with coincident vertices merged. Updates the
/// counts in `report`; `report.length[1]` holds the sum of lengths until the caller divides it. Strands keep
/// the ids of the file, so that they can be traced back.
fn clean(curves: &Curves, which: impl Iterator<Item = usize>, report: &mut StrandFileReport) -> Curves {
    let mut kept = Curves { offsets: vec![0], ..Curves::default() };
    let mut seen = HashSet::new();
    for c in which {
        let points = curves.curve(c);
        if points.iter().any(|p| p.iter().any(|x| !x.is_finite())) {
            report.not_finite += 1;
            continue;
        }
        let mut distinct: Vec<Vector3<f64>> = Vec::with_capacity(points.len());
        for p in points {
            if distinct.last().is_none_or(|last| (p - last).norm() > MERGE_DISTANCE) {
                distinct.push(*p);
            }
        }
        let segments: Vec<f64> = distinct.windows(2).map(|p| (p[1] - p[0]).norm()).collect();
        let length: f64 = segments.iter().sum();
        if segments.is_empty() || length < MIN_STRAND_LENGTH {
            report.too_short += 1;
            continue;
        }
        let bits: Vec<[u64; 3]> = distinct.iter().map(|p| [p.x, p.y, p.z].map(f64::to_bits)).collect();
        if !seen.insert(bits) {
            report.duplicates += 1;
            continue;
        }
        report.merged_vertices += points.len() - distinct.len();
        report.add_kept(&segments, length);
        kept.points.extend(distinct);
        kept.offsets.push(kept.points.len());
        kept.id.push(curves.id[c]);
        kept.group.push(curves.group[c]);
        kept.root_uv.push(curves.root_uv[c]);
    }
    kept
}

/// Checks that the usable strands, by what they are called, lie within [`MAX_EXTENT`] of each other.
///
/// # Errors
/// Those far from the middle of all vertices, by their ids; at least the farthest.
fn check_extent(file: &Path, all: [(&'static str, &Curves); 2]) -> Result<()> {
    let points = || all.iter().flat_map(|(_, curves)| &curves.points);
    let low = points().fold(Vector3::repeat(f64::INFINITY), |low, p| low.inf(p));
    let high = points().fold(Vector3::repeat(f64::NEG_INFINITY), |high, p| high.sup(p));
    if (high - low).norm() <= MAX_EXTENT {
        return Ok(());
    }
    // Of most vertices, wherever the others are.
    let middle = Vector3::from_fn(|axis, _| {
        let mut places: Vec<f64> = points().map(|p| p[axis]).collect();
        let half = places.len() / 2;
        *places.select_nth_unstable_by(half, f64::total_cmp).1
    });
    let distance = |p: &Vector3<f64>| (p - middle).norm();
    let farthest = |points: &[Vector3<f64>]| {
        points.iter().copied().max_by(|a, b| distance(a).total_cmp(&distance(b))).unwrap_or(middle)
    };
    let of_kind = |(kind, curves): (&'static str, &Curves)| {
        let far = |c: usize| (kind, curves.id[c], farthest(curves.curve(c)));
        (0..curves.len()).map(far).collect::<Vec<_>>()
    };
    let mut far: Vec<_> = all.into_iter().flat_map(of_kind).collect();
    far.sort_by(|a, b| distance(&b.2).total_cmp(&distance(&a.2)));
    let count = far.iter().filter(|(.., p)| distance(p) > MAX_EXTENT).count();
    let report = |(kind, id, p): &(&str, i32, Vector3<f64>)| {
        Diagnostic::new(
            file,
            "strands",
            format!("{kind} {id} goes to ({:.3e}, {:.3e}, {:.3e}) m", p.x, p.y, p.z),
            format!("strands that are {MAX_EXTENT} m across or less, all together"),
            "remove the strand, or correct the unit (--units)",
        )
    };
    Err(Error::BadInput(far.iter().take(count.clamp(1, MAX_REPORTED)).map(report).collect()))
}

fn no_usable_strand(report: &StrandFileReport) -> Diagnostic {
    Diagnostic::new(
        &report.path,
        "strands",
        format!(
            "none of {} is usable: {} not finite, {} shorter than {} mm",
            report.read,
            report.not_finite,
            report.too_short,
            MIN_STRAND_LENGTH * 1e3
        ),
        "at least one usable strand",
        "check the unit (--units): a groom in metres that is read as millimetres is too short",
    )
}

impl StrandFileReport {
    /// Counts a kept strand.
    fn add_kept(&mut self, segments: &[f64], length: f64) {
        let longest_segment = segments.iter().copied().fold(0.0, f64::max);
        let ratio = longest_segment / segments.iter().copied().fold(f64::INFINITY, f64::min);
        self.segment_ratio = self.segment_ratio.max(ratio);
        let [shortest, sum, longest] = self.length;
        self.length =
            [if self.kept == 0 { length } else { shortest.min(length) }, sum + length, longest.max(length)];
        self.kept += 1;
    }
}

impl fmt::Display for StrandFileReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [shortest, mean, longest] = self.length.map(|l| l * 100.0);
        write!(f, "{}: {} strands, {} kept", self.path.display(), self.read, self.kept)?;
        if self.guides > 0 {
            write!(f, ", {} of them marked as guides", self.guides)?;
        }
        for (count, why) in [
            (self.too_short, "shorter than 1 mm"),
            (self.not_finite, "NaN or infinite"),
            (self.duplicates, "duplicates"),
        ] {
            if count > 0 {
                write!(f, ", {count} dropped ({why})")?;
            }
        }
        writeln!(f)?;
        writeln!(
            f,
            "  length {shortest:.1} to {longest:.1} cm, mean {mean:.1} cm; \
             longest to shortest segment of a strand: up to {:.1}",
            self.segment_ratio
        )?;
        writeln!(f, "  1 unit = {} m, {:?} up", self.convention.metres_per_unit, self.convention.up)?;
        if self.merged_vertices > 0 {
            writeln!(f, "  {} coincident vertices merged", self.merged_vertices)?;
        }
        self.notes.iter().try_for_each(|note| writeln!(f, "  {note}"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn curves(strands: &[&[[f64; 3]]]) -> Curves {
        let mut out = Curves { offsets: vec![0], ..Curves::default() };
        for (i, strand) in strands.iter().enumerate() {
            out.points.extend(strand.iter().map(|&p| Vector3::from(p)));
            out.offsets.push(out.points.len());
            out.id.push(i as i32);
            out.group.push(0);
            out.root_uv.push([0.0; 2]);
        }
        out
    }

    #[test]
    fn unusable_strands_are_counted_by_reason() {
        let good: &[[f64; 3]] = &[[0.0, 0.0, 0.0], [0.0, 0.0, 0.0], [0.0, -0.1, 0.0], [0.0, -0.15, 0.0]];
        let point: &[[f64; 3]] = &[[1.0, 0.0, 0.0], [1.0, 0.0, 0.0]];
        let short: &[[f64; 3]] = &[[1.0, 0.0, 0.0], [1.0, 0.0005, 0.0]];
        let nan: &[[f64; 3]] = &[[0.0, 0.0, 0.0], [f64::NAN, 0.0, 0.0]];
        let mut report = StrandFileReport::default();
        let kept = clean(&curves(&[point, good, short, nan, good]), 0..5, &mut report);
        assert_eq!(kept.id, [1]);
        assert_eq!(kept.offsets, [0, 3]);
        assert_eq!(
            (report.too_short, report.not_finite, report.duplicates, report.merged_vertices),
            (2, 1, 1, 1)
        );
        assert!((report.segment_ratio - 2.0).abs() < 1e-12);
        assert_eq!(report.kept, 1);
    }

    #[test]
    fn strands_far_from_the_others_are_named_by_their_ids() {
        let near = |x: f64| [[x, 0.0, 0.0], [x, -0.1, 0.0]];
        let far = |x: f64| [[0.0, 0.0, 0.0], [x, 0.0, 0.0]];
        let named = |strands: &[&[[f64; 3]]]| match check_extent(
            Path::new("a.tfx"),
            [("guide", &curves(&[])), ("strand", &curves(strands))],
        ) {
            Ok(()) => Vec::new(),
            Err(Error::BadInput(found)) => found.into_iter().map(|found| found.message).collect(),
            Err(other) => panic!("{other}"),
        };
        let [a, b, c] = [0.0, 0.1, 0.2].map(near);
        assert!(named(&[&a, &b, &c]).is_empty());
        // Its square is no number.
        let found = named(&[&a, &far(1e300), &b, &far(-101.0), &c]);
        assert_eq!(
            found,
            [
                "strand 1 goes to (1.000e300, 0.000e0, 0.000e0) m",
                "strand 3 goes to (-1.010e2, 0.000e0, 0.000e0) m"
            ]
        );
        // A groom far from the origin is right.
        assert!(named(&[&near(1e5), &near(1e5 + 99.0)]).is_empty());
        assert_eq!(named(&[&near(1e5), &near(1e5), &near(1e5 + 101.0)]).len(), 1);
    }

    #[test]
    fn a_prim_of_a_file_that_is_not_usd_is_a_usage_error() {
        let source = Source { prim: Some("/a".into()), ..Source::new("a.tfx") };
        assert!(matches!(read_strands(&source, 1.0), Err(crate::Error::Usage(_))));
    }
}
