//! Which curves of a groom's source the curves of a stage are.

use super::motion::linear;
use super::source::{Fits, Set, owners, ranges, rest_controls};
use crate::error::{Diagnostic, Error, Result};
use crate::math::basis_curve::CurveFit;
use crate::scene::anim::{OutputCurves, Settings};
use crate::scene::{Anim, Groom, OverPrim, OverTarget, SourceCurves, SourcePrim};
use nalgebra::Matrix4;
use std::path::Path;

/// Largest distance between the ends of a curve of the stage and those of the strand imported from it, m:
/// files hold points in single precision.
const SAME_ENDS: f64 = 1e-4;

/// Smallest ratio of two sizes of the same curves that tells of a mistaken unit: centimetres and inches,
/// which differ least of the units in use, are a factor of 2.54 apart. A character may be scaled a little.
const OTHER_UNIT: f64 = 2.0;

/// Checks that a bake can override the curves of `target`.
///
/// # Errors
/// [`Error::BadInput`] with every difference between the groom and the curves of the stage;
/// [`Error::Usage`] for settings that leave strands out.
pub fn check(groom: &Groom, anim: &Anim, target: &OverTarget) -> Result<()> {
    if let Some(option) = left_out(groom, &anim.settings) {
        let message = format!("--over moves every curve of the groom: leave out {option}");
        return Err(Error::Usage(message));
    }
    let mut found = Vec::new();
    let rate = target.stage.time_codes_per_second;
    if (rate - anim.fps).abs() > 1e-6 * anim.fps {
        found.push(Diagnostic::new(
            &target.file,
            "timeCodesPerSecond",
            format!("{rate} time codes per second, where the animation has {} frames", anim.fps),
            "one time code per frame",
            "import the track from this stage",
        ));
    }
    let (source, matched) = match matched(groom, target) {
        Ok(matched) => matched,
        Err(Error::BadInput(others)) => {
            found.extend(others);
            return Err(Error::BadInput(found));
        }
        Err(e) => return Err(e),
    };
    let owners = owners(source);
    let starts = source.starts();
    for (prim, of) in target.prims.iter().zip(matched) {
        found.extend(resized(&source.prims[of], prim, target));
        found.extend(moved(groom, source, of, prim, &owners[starts[of]..], &target.file));
    }
    Error::if_any(found)
}

/// Whether a bake with these settings moves all curves of the groom.
pub fn moves_all(groom: &Groom, settings: &Settings) -> bool {
    left_out(groom, settings).is_none()
}

/// The option by which a bake leaves out curves of the groom.
fn left_out(groom: &Groom, settings: &Settings) -> Option<&'static str> {
    match settings.curves {
        _ if settings.keep < 1.0 => Some("--keep"),
        OutputCurves::Steps => Some("--curves"),
        OutputCurves::Guides if !groom.strands.curves.is_empty() => Some("--curves"),
        _ => None,
    }
}

/// The source of a groom, and the prim of it that each prim of a stage is.
///
/// # Errors
/// [`Error::BadInput`] with every prim that is none.
pub(super) fn matched<'a>(groom: &'a Groom, target: &OverTarget) -> Result<(&'a SourceCurves, Vec<usize>)> {
    let source = groom.source.as_ref().ok_or_else(|| {
        Diagnostic::new(
            &target.file,
            "--over",
            "the groom does not tell which curves it was imported from",
            "a groom that `hairbake import groom` made from USD curves",
            "import the groom again",
        )
    })?;
    let found: Vec<_> = target.prims.iter().map(|prim| find(source, prim, target)).collect();
    let mut diagnostics = Vec::new();
    let mut indices: Vec<usize> = Vec::new();
    for (found, prim) in found.into_iter().zip(&target.prims) {
        match found {
            Ok(index) if indices.contains(&index) => diagnostics.push(Diagnostic::new(
                &target.file,
                &prim.path,
                format!("the second prim with the curves of {}", source.prims[index].path),
                "the curves of one character",
                "name one character: --over FILE:/path/to/it",
            )),
            Ok(index) => indices.push(index),
            Err(Error::BadInput(found)) => diagnostics.extend(found),
            Err(e) => return Err(e),
        }
    }
    Error::if_any(diagnostics)?;
    Ok((source, indices))
}

/// The prim of `source` that `prim` is: the one whose path ends as its own does.
fn find(source: &SourceCurves, prim: &OverPrim, target: &OverTarget) -> Result<usize> {
    let shared = |of: &SourcePrim| {
        let [a, b] = [&of.path, &prim.path].map(|path| path.rsplit('/'));
        a.zip(b).take_while(|(a, b)| a == b).count()
    };
    let longest = source.prims.iter().map(shared).max().unwrap_or_default();
    let alone = source.prims.len() == 1 && target.prims.len() == 1;
    let candidates: Vec<usize> = (0..source.prims.len())
        .filter(|of| shared(&source.prims[*of]) == longest && (longest > 0 || alone))
        .collect();
    let diagnostic = |message: String, help: &str| {
        let paths: Vec<&str> = source.prims.iter().map(|prim| prim.path.as_str()).collect();
        let allowed = format!("curves that the groom was imported from: {}", paths.join(", "));
        Error::from(Diagnostic::new(&target.file, &prim.path, message, allowed, help))
    };
    let [index] = candidates[..] else {
        let message = match candidates.len() {
            0 => "the groom was not imported from curves of this name".to_string(),
            n => format!("{n} prims that the groom was imported from end like this"),
        };
        return Err(diagnostic(message, "name the prim of the groom, or one above it"));
    };
    let of = &source.prims[index];
    let start = source.starts()[index];
    let vertices = &source.vertices[start..start + of.curves];
    let again = "choose the variant that was imported, or import the groom again";
    if of.curve != prim.curve {
        let [found, expected] =
            [prim.curve, of.curve].map(|curve| format!("{:?} {:?}", curve.wrap, curve.basis));
        let message = format!("{found} curves, imported as {expected}").to_lowercase();
        return Err(diagnostic(message, again));
    }
    if vertices != prim.vertices {
        let size = |vertices: &[u32]| {
            format!(
                "{} curves of {} points",
                vertices.len(),
                vertices.iter().map(|n| *n as usize).sum::<usize>()
            )
        };
        let message = match (size(&prim.vertices), size(vertices)) {
            (found, expected) if found == expected => format!("{found} in another order than imported"),
            (found, expected) => format!("{found}, imported as {expected}"),
        };
        return Err(diagnostic(message, again));
    }
    match vertices.iter().find(|count| CurveFit::new(of.curve, **count as usize).is_none()) {
        Some(count) => {
            let message = format!("a curve of {count} control points has no segment, or is closed");
            Err(diagnostic(message, "remove it, and import the groom again"))
        }
        None => Ok(index),
    }
}

/// The error of a prim that the stage shows in another size than it was imported in: a unit is wrong.
fn resized(of: &SourcePrim, prim: &OverPrim, target: &OverTarget) -> Option<Diagnostic> {
    let size = |matrix: &Matrix4<f64>| linear(matrix).determinant().abs().cbrt();
    let shown = size(&(target.convention.matrix_in() * prim.to_world.first()?[0]));
    let ratio = shown / size(&of.to_rest);
    // A skeleton may scale what it deforms.
    if prim.skinned || (1.0 / OTHER_UNIT..=OTHER_UNIT).contains(&ratio) {
        return None;
    }
    Some(Diagnostic::new(
        &target.file,
        &prim.path,
        format!("the stage shows the curves {ratio:.3} times as large as they were imported"),
        "the size that was imported: the head carries curves as they are",
        "import groom and track with the same unit (--units, metersPerUnit of the stages)",
    ))
}

/// The error of a prim with a curve that is elsewhere than the strand imported from it.
fn moved(
    groom: &Groom,
    source: &SourceCurves,
    of: usize,
    prim: &OverPrim,
    owners: &[Option<(Set, usize)>],
    file: &Path,
) -> Option<Diagnostic> {
    let mut fits = Fits::default();
    let rest = rest_controls(source, of, prim, &mut fits);
    let distance = |(c, controls): (usize, std::ops::Range<usize>)| {
        let (set, index) = owners[c]?;
        let strand = match set {
            Set::Hair => groom.strands.curves.curve(index),
            Set::Guides => groom.guides.curves.curve(index),
        };
        let fit = fits.index(prim.curve, controls.len());
        let samples = &fits.all[fit].samples;
        let controls = &rest[controls];
        let ends = [(samples.first()?, strand.first()?), (samples.last()?, strand.last()?)];
        let distances = ends.map(|(row, end)| (row.of(controls) - end).norm());
        Some((c, distances[0].max(distances[1])))
    };
    let all = ranges(prim.vertices.iter().copied()).enumerate().filter_map(distance);
    let (c, far) = all.max_by(|a, b| a.1.total_cmp(&b.1)).filter(|(_, far)| *far > SAME_ENDS)?;
    Some(Diagnostic::new(
        file,
        &prim.path,
        format!("curve {c} is {far:.3} m from where the groom was imported"),
        format!("the points that were imported, to {SAME_ENDS} m"),
        "import the groom again",
    ))
}
