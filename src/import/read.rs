//! A strand file made into clean strands in metres, Y up: format by its ending, unit and axes given or guessed, strands
//! that are none left out and counted.

use super::{hair, tfx, usd};
use crate::scene::{Convention, Curves, Factors, TriMesh, UpAxis};
use crate::{Diagnostic, Error, Result};
use nalgebra::Vector3;
use std::collections::{BTreeMap, HashSet};
use std::fmt;
use std::path::{Path, PathBuf};

/// Shortest strand that is kept, m.
pub const SHORTEST: f64 = 1e-3;
/// Neighbouring vertices closer than this are one, m: single-precision files cannot tell them apart.
const SAME_POINT: f64 = 1e-6;
/// Sizes (diagonal of the bounding box) that a head of hair may have, m.
const HEAD_OF_HAIR: [f64; 2] = [0.1, 2.0];

/// A file of an import and how to bring it into groom space (metres, Y up, where the head was modelled).
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Source {
    /// The file.
    pub path: PathBuf,
    /// Metres in one unit of the file; `None` for what the file says, else to guess.
    pub metres_per_unit: Option<f64>,
    /// Its up axis; `None` for what the file says, else the format's own (Z for .hair, Y for all others).
    pub up: Option<UpAxis>,
    /// Of a USD file: path of the prim at and below which to read; `None` for the whole stage.
    pub prim: Option<String>,
    /// Of a USD file: time code at which to read; `None` for the rest pose, else the earliest.
    pub time: Option<f64>,
    /// Added to every point after conversion, m, Y up.
    pub offset: Vector3<f64>,
}

impl Source {
    /// A file whose unit is to be guessed, not moved.
    pub fn new(path: impl Into<PathBuf>) -> Self {
        Source { path: path.into(), ..Source::default() }
    }

    /// # Errors
    /// [`Error::Usage`] where a prim or a time is named of a file that has none.
    pub(super) fn check(&self) -> Result<()> {
        if usd::is_usd(&self.path) || (self.prim.is_none() && self.time.is_none()) {
            return Ok(());
        }
        Err(Error::Usage(format!("{}: only USD files have prims and time codes", self.path.display())))
    }
}

/// Sizes (diagonal of the bounding box) that the mesh of a head or a body may have, m.
const BODY: [f64; 2] = [0.15, 3.0];

/// A mesh that was read.
#[derive(Debug, Clone, PartialEq)]
pub struct ReadMesh {
    /// The mesh, m, Y up, with the offset of its source applied.
    pub mesh: TriMesh,
    /// Its vertices at the times asked for, likewise; none where it does not move by itself.
    pub moving: Vec<Vec<Vector3<f64>>>,
    /// Unit and up axis of the file.
    pub convention: Convention,
    /// Guesses made and oddities met.
    pub notes: Vec<String>,
}

/// Reads a mesh (Wavefront OBJ or USD) for a scalp or a collider; its unit, if not given, is guessed from its size.
///
/// # Errors
/// A file that cannot be read or holds no triangle, a unit that cannot be guessed.
pub fn mesh(source: &Source) -> Result<ReadMesh> {
    moving_mesh(source, None)
}

/// As [`mesh`], and, of a USD mesh that moves by itself, where its vertices are at some times.
///
/// # Errors
/// As [`mesh`].
pub(super) fn moving_mesh(source: &Source, times: Option<&usd::Times>) -> Result<ReadMesh> {
    source.check()?;
    let fault = |what: String| {
        Error::from(Diagnostic::new(
            &source.path,
            "",
            what,
            "a Wavefront OBJ file with triangles",
            "export the mesh again, or correct the path",
        ))
    };
    let plain = if usd::is_usd(&source.path) {
        usd::mesh(source, times)?
    } else {
        let mesh = TriMesh::load_obj_as_it_is(&source.path, &Convention::default()).map_err(fault)?;
        PlainMesh { mesh, ..PlainMesh::default() }
    };
    let PlainMesh { mut mesh, mut moving, metres_per_unit, up, mut notes } = plain;
    let degenerate = mesh.drop_degenerate().map_err(fault)?;
    if degenerate > 0 {
        notes.push(format!("{degenerate} triangles of no area left out"));
    }
    let said = Source {
        metres_per_unit: source.metres_per_unit.or(metres_per_unit),
        up: source.up.or(up),
        ..source.clone()
    };
    let convention = convention(&said, &mesh.vertices, BODY, &mut notes)?;
    for x in mesh.vertices.iter_mut().chain(moving.iter_mut().flatten()) {
        *x = convention.length_in(*x) + source.offset;
    }
    Ok(ReadMesh { mesh, moving, convention, notes })
}

/// A mesh as a file has it, in its unit and axes.
#[derive(Debug, Clone, PartialEq, Default)]
pub(super) struct PlainMesh {
    pub(super) mesh: TriMesh,
    /// Where its vertices are at the times asked for, if it moves by itself.
    pub(super) moving: Vec<Vec<Vector3<f64>>>,
    /// Unit and up axis where the file says them.
    pub(super) metres_per_unit: Option<f64>,
    pub(super) up: Option<UpAxis>,
    pub(super) notes: Vec<String>,
}

/// Strands as a file has them, in its unit and axes.
#[derive(Debug, Clone, PartialEq, Default)]
pub(super) struct PlainStrands {
    pub(super) curves: Curves,
    /// Which curves are guides; empty where the format does not tell.
    pub(super) guide: Vec<bool>,
    /// The groups that the curves are of; empty where the format has none.
    pub(super) groups: Vec<PlainGroup>,
    /// What single curves have of their own; empty where the file has none.
    pub(super) own: Vec<Own>,
    /// Unit and up axis where the file says them.
    pub(super) metres_per_unit: Option<f64>,
    pub(super) up: Option<UpAxis>,
    /// What an artist should know about the file.
    pub(super) notes: Vec<String>,
}

/// What a curve has of its own.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Own {
    /// Factor on its length; its shape stays.
    pub(super) length: f64,
    /// Factors on its material, in the order of [`Factors::NAMES`].
    pub(super) factors: [f64; Factors::NAMES.len()],
    /// The clump that it is of.
    pub(super) clump: Option<i32>,
}

impl Own {
    /// Nothing.
    pub(super) const NONE: Own = Own { length: 1.0, factors: [1.0; Factors::NAMES.len()], clump: None };
}

/// What curves have of their own, by whether they are guides and by their ids.
pub(super) type Owned = BTreeMap<(bool, i32), Own>;

/// A group of strands.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct PlainGroup {
    pub(super) name: String,
    /// Drawn width at root and tip where the file has it.
    pub(super) width: Option<[f64; 2]>,
}

/// The strands of a file, cleaned, m, Y up.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct CleanStrands {
    /// Those that are no guides, or all where the file does not name guides; may be empty.
    pub(super) curves: Curves,
    /// Those that the file names as guides; may be empty.
    pub(super) guides: Curves,
    /// What single ones have of their own; empty where the file has nothing of the kind.
    pub(super) own: Owned,
    /// The groups of both; at least one.
    pub(super) groups: Vec<PlainGroup>,
    pub(super) report: SourceReport,
}

/// What was found in a strand file.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct SourceReport {
    /// The file.
    pub path: PathBuf,
    /// Strands in it.
    pub read: usize,
    /// Strands kept.
    pub kept: usize,
    /// Those of them that the file names as guides.
    pub guides: usize,
    /// Left out: a coordinate that is not a finite number.
    pub not_finite: usize,
    /// Left out: shorter than [`SHORTEST`] or without two distinct vertices.
    pub degenerate: usize,
    /// Left out: every vertex equal to an earlier strand's.
    pub copies: usize,
    /// Vertices left out because they coincide with the one before.
    pub merged_vertices: usize,
    /// Length of the kept strands, m: shortest, mean, longest.
    pub length: [f64; 3],
    /// Largest ratio of the longest to the shortest segment of one strand.
    pub segment_ratio: f64,
    /// Unit and up axis used.
    pub convention: Convention,
    /// Guesses made and oddities met.
    pub notes: Vec<String>,
}

/// Reads a strand file; all strands are made `length` times as long.
///
/// # Errors
/// Unreadable file, unknown ending, damaged file, no usable strand, unit that cannot be guessed.
pub(super) fn strands(source: &Source, length: f64) -> Result<CleanStrands> {
    source.check()?;
    let path = &source.path;
    let plain = match path.extension().and_then(|e| e.to_str()).map(str::to_ascii_lowercase).as_deref() {
        _ if usd::is_usd(path) => usd::strands(source)?,
        Some("tfx") => tfx::parse(path, &bytes_of(path)?)?,
        Some("hair") => hair::parse(path, &bytes_of(path)?)?,
        _ => {
            return Err(Diagnostic::new(
                path,
                "",
                "a name of unknown ending",
                ".usd, .usda, .usdc, .usdz, .tfx or .hair",
                "rename the file or export one of these formats",
            )
            .into());
        }
    };
    let PlainStrands { mut curves, guide, mut groups, own, metres_per_unit, up, mut notes } = plain;
    let said = Source {
        metres_per_unit: source.metres_per_unit.or(metres_per_unit),
        up: source.up.or(up),
        ..source.clone()
    };
    let convention = convention(&said, &curves.points, HEAD_OF_HAIR, &mut notes)?;
    let mut report =
        SourceReport { path: path.clone(), read: curves.len(), convention, notes, ..Default::default() };
    for p in &mut curves.points {
        *p = convention.length_in(*p) + source.offset;
    }
    for (c, ends) in curves.offsets.windows(2).enumerate() {
        scale(&mut curves.points[ends[0]..ends[1]], length * own.get(c).map_or(1.0, |own| own.length));
    }
    for width in groups.iter_mut().filter_map(|group| group.width.as_mut()) {
        *width = width.map(|w| w * convention.metres_per_unit);
    }
    if groups.is_empty() {
        groups.push(PlainGroup { name: "hair".into(), width: None });
    }
    let is_guide = |c: usize| guide.get(c).copied().unwrap_or(false);
    let all = 0..curves.len();
    let own = own.iter().enumerate().map(|(c, own)| ((is_guide(c), curves.id[c]), *own)).collect();
    let guides = clean(&curves, all.clone().filter(|&c| is_guide(c)), &mut report);
    let curves = clean(&curves, all.filter(|&c| !is_guide(c)), &mut report);
    if curves.is_empty() && guides.is_empty() {
        return Err(Diagnostic::new(
            path,
            "strands",
            format!(
                "{} strands: {} not finite, {} shorter than {} mm",
                report.read,
                report.not_finite,
                report.degenerate,
                SHORTEST * 1e3
            ),
            "one usable strand or more",
            "check the unit (--units): a groom in metres read as millimetres is all too short",
        )
        .into());
    }
    report.guides = guides.len();
    report.length[1] /= report.kept as f64;
    Ok(CleanStrands { curves, guides, own, groups, report })
}

/// Makes a strand `factor` times as long, its root and its shape as they are.
fn scale(points: &mut [Vector3<f64>], factor: f64) {
    if let Some(&root) = points.first().filter(|_| factor != 1.0) {
        points.iter_mut().for_each(|p| *p = root + (*p - root) * factor);
    }
}

fn bytes_of(path: &Path) -> Result<Vec<u8>> {
    crate::file::read_file(path).map_err(|e| Error::io(path, e))
}

/// Unit and up axis of a file: as given, else guessed from the size of what it holds, which may be `sizes` m across,
/// and the guess noted.
fn convention(
    source: &Source,
    points: &[Vector3<f64>],
    sizes: [f64; 2],
    notes: &mut Vec<String>,
) -> Result<Convention> {
    let z_up_format = has_ending(&source.path, "hair");
    let up = source.up.unwrap_or(if z_up_format { UpAxis::Z } else { UpAxis::Y });
    if let Some(metres_per_unit) = source.metres_per_unit {
        if !(metres_per_unit > 0.0 && metres_per_unit.is_finite()) {
            return Err(Diagnostic::new(
                &source.path,
                "units",
                format!("{metres_per_unit} m"),
                "a positive length",
                "give --units as m, cm, mm, in, ft or metres in a unit",
            )
            .into());
        }
        return Ok(Convention { metres_per_unit, up });
    }
    let finite = || points.iter().filter(|p| p.iter().all(|x| x.is_finite()));
    let low = finite().fold(Vector3::repeat(f64::INFINITY), |a, p| a.inf(p));
    let high = finite().fold(Vector3::repeat(f64::NEG_INFINITY), |a, p| a.sup(p));
    let size = (high - low).norm();
    for (name, metres_per_unit) in [("metres", 1.0), ("centimetres", 0.01), ("millimetres", 0.001)] {
        let metres = size * metres_per_unit;
        if (sizes[0]..=sizes[1]).contains(&metres) {
            notes.push(format!(
                "unit guessed: {name}, which make it {metres:.2} m across (give --units to overrule)"
            ));
            return Ok(Convention { metres_per_unit, up });
        }
    }
    Err(Diagnostic::new(
        &source.path,
        "units",
        format!(
            "hair {size:.3} units across: not {} to {} m in m, cm or mm",
            HEAD_OF_HAIR[0], HEAD_OF_HAIR[1]
        ),
        "a unit given, or a size from which it can be guessed",
        "give --units (m, cm, mm, in, ft, or metres in a unit)",
    )
    .into())
}

fn has_ending(path: &Path, ending: &str) -> bool {
    path.extension().is_some_and(|e| e.eq_ignore_ascii_case(ending))
}

/// The usable ones of some of `curves` (metres), without coincident neighbours; the others counted in `report`, which has the sum of
/// lengths in place of the mean until all are in. Ids stay those of the file, so that a strand can be traced back.
fn clean(curves: &Curves, which: impl Iterator<Item = usize>, report: &mut SourceReport) -> Curves {
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
            if distinct.last().is_none_or(|last| (p - last).norm() > SAME_POINT) {
                distinct.push(*p);
            }
        }
        let segments: Vec<f64> = distinct.windows(2).map(|p| (p[1] - p[0]).norm()).collect();
        let length: f64 = segments.iter().sum();
        if segments.is_empty() || length < SHORTEST {
            report.degenerate += 1;
            continue;
        }
        let bits: Vec<[u64; 3]> = distinct.iter().map(|p| [p.x, p.y, p.z].map(f64::to_bits)).collect();
        if !seen.insert(bits) {
            report.copies += 1;
            continue;
        }
        report.merged_vertices += points.len() - distinct.len();
        let longest_segment = segments.iter().copied().fold(0.0, f64::max);
        let ratio = longest_segment / segments.iter().copied().fold(f64::INFINITY, f64::min);
        report.segment_ratio = report.segment_ratio.max(ratio);
        let [shortest, sum, longest] = report.length;
        report.length =
            [if report.kept == 0 { length } else { shortest.min(length) }, sum + length, longest.max(length)];
        report.kept += 1;
        kept.points.extend(distinct);
        kept.offsets.push(kept.points.len());
        kept.id.push(curves.id[c]);
        kept.group.push(curves.group[c]);
        kept.root_uv.push(curves.root_uv[c]);
    }
    kept
}

impl fmt::Display for SourceReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [shortest, mean, longest] = self.length.map(|l| l * 100.0);
        write!(f, "{}: {} strands, {} kept", self.path.display(), self.read, self.kept)?;
        if self.guides > 0 {
            write!(f, ", {} of them named as guides", self.guides)?;
        }
        for (count, why) in [
            (self.degenerate, "shorter than 1 mm"),
            (self.not_finite, "with NaN or infinity"),
            (self.copies, "copies of another"),
        ] {
            if count > 0 {
                write!(f, ", {count} left out ({why})")?;
            }
        }
        writeln!(f)?;
        writeln!(
            f,
            "  length {shortest:.1} to {longest:.1} cm, mean {mean:.1}; longest/shortest segment in a strand up to {:.1}",
            self.segment_ratio
        )?;
        if self.merged_vertices > 0 {
            writeln!(f, "  {} vertices on top of the one before left out", self.merged_vertices)?;
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
    fn strands_that_are_none_are_counted_by_reason() {
        let good: &[[f64; 3]] = &[[0.0, 0.0, 0.0], [0.0, 0.0, 0.0], [0.0, -0.1, 0.0], [0.0, -0.15, 0.0]];
        let point: &[[f64; 3]] = &[[1.0, 0.0, 0.0], [1.0, 0.0, 0.0]];
        let short: &[[f64; 3]] = &[[1.0, 0.0, 0.0], [1.0, 0.0005, 0.0]];
        let nan: &[[f64; 3]] = &[[0.0, 0.0, 0.0], [f64::NAN, 0.0, 0.0]];
        let mut report = SourceReport::default();
        let kept = clean(&curves(&[point, good, short, nan, good]), 0..5, &mut report);
        assert_eq!(kept.id, [1]);
        assert_eq!(kept.offsets, [0, 3]);
        assert_eq!(
            (report.degenerate, report.not_finite, report.copies, report.merged_vertices),
            (2, 1, 1, 1)
        );
        assert!((report.segment_ratio - 2.0).abs() < 1e-12);
        assert_eq!(report.kept, 1);
    }

    #[test]
    fn unit_is_guessed_from_size_and_said() {
        let across = |size: f64| {
            let mut notes = Vec::new();
            let points = [Vector3::zeros(), Vector3::new(0.0, size, 0.0)];
            convention(&Source::new("a.tfx"), &points, HEAD_OF_HAIR, &mut notes)
                .map(|c| (c.metres_per_unit, notes))
        };
        let (metres, notes) = across(40.0).unwrap();
        assert_eq!(metres, 0.01);
        assert!(notes[0].contains("centimetres") && notes[0].contains("0.40 m"));
        assert_eq!(across(0.4).unwrap().0, 1.0);
        assert_eq!(across(400.0).unwrap().0, 0.001);
        assert!(matches!(across(1e6), Err(Error::BadInput(_))));
    }

    #[test]
    fn prims_are_of_usd_alone() {
        let of = |name: &str| Source { prim: Some("/a".into()), ..Source::new(name) };
        assert!(of("a.usdc").check().is_ok() && Source::new("a.tfx").check().is_ok());
        assert!(matches!(strands(&of("a.tfx"), 1.0), Err(Error::Usage(_))));
        assert!(matches!(mesh(&of("a.obj")), Err(Error::Usage(_))));
    }

    #[test]
    fn hair_files_are_z_up_unless_told() {
        let points = [Vector3::zeros(), Vector3::x()];
        let up = |source: &Source| convention(source, &points, HEAD_OF_HAIR, &mut Vec::new()).unwrap().up;
        assert_eq!(up(&Source::new("a.hair")), UpAxis::Z);
        assert_eq!(up(&Source { up: Some(UpAxis::Y), ..Source::new("a.hair") }), UpAxis::Y);
        assert_eq!(up(&Source::new("a.tfx")), UpAxis::Y);
    }
}
