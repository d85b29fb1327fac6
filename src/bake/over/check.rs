//! Whether the curves of a stage are those that a groom was imported from.

use super::deform::deformed;
use super::matching::{is_deformed, matched};
use super::motion::linear;
use super::source::{Fits, Set, owners, ranges, rest_controls};
use crate::error::{Diagnostic, Error, Result};
use crate::scene::anim::{OutputCurves, Settings};
use crate::scene::{Anim, Groom, OverKind, OverPrim, OverTarget, SourceCurves, SourcePrim, StageLayer};
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
    if let Some(option) = left_out(&anim.settings) {
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
    found.extend(doubled(groom, anim, target));
    let matched = if is_deformed(groom, &anim.settings, target) {
        deformed(groom, anim, target).map(|(source, prims)| (source, prims.iter().map(|p| p.of).collect()))
    } else {
        matched(groom, target).map(|(source, prims)| (source, prims.into_iter().map(Some).collect()))
    };
    let (source, matched): (_, Vec<_>) = match matched {
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
        let Some(of) = of else { continue };
        found.extend(resized(&source.prims[of], prim, target));
        found.extend(moved(groom, source, of, prim, &owners[starts[of]..], &target.file));
    }
    Error::if_any(found)
}

/// Whether a bake with these settings can move all curves of the groom.
pub fn moves_all(settings: &Settings) -> bool {
    left_out(settings).is_none()
}

/// The option by which a bake leaves out curves of the groom.
fn left_out(settings: &Settings) -> Option<&'static str> {
    match settings.curves {
        _ if settings.keep < 1.0 => Some("--keep"),
        OutputCurves::Steps => Some("--curves"),
        _ => None,
    }
}

/// The errors of layers of earlier bakes that would move curves besides this one: the curves are read without
/// them, but shown with them.
fn doubled(groom: &Groom, anim: &Anim, target: &OverTarget) -> Vec<Diagnostic> {
    let deforms = is_deformed(groom, &anim.settings, target);
    let doubled = |layer: &StageLayer| {
        let (path, file) = (layer.prims.first()?, layer.file.display());
        let message = match layer.kind? {
            OverKind::Over if deforms => "holds the motion of a bake for these curves as well",
            OverKind::Deform if !deforms => "lets Houdini deform these curves as well",
            _ => return None,
        };
        Some(Diagnostic::new(
            &target.file,
            path,
            format!("{file} {message}"),
            "one bake that moves the curves",
            format!("take {file} out of the sublayers of the stage"),
        ))
    };
    target.layers.iter().filter_map(doubled).collect()
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
        let strand = set.of_groom(groom).curve(index);
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
