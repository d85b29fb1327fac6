//! What a bake does to the curves of a stage, if these are those that the groom was imported from.

use super::deformable::{Deformed, Undeformable, deformed};
use super::matching::{is_deformed, match_prims, not_imported};
use super::motion::linear;
use super::source::{Fits, Owners, Set, rest_controls};
use crate::cache::ranges;
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

/// What a bake does to the curves of a stage.
#[derive(Debug)]
pub struct OverPlan {
    /// The stage and its curves.
    pub target: OverTarget,
    pub(super) owners: Owners,
    pub(super) curves: PlannedCurves,
}

/// How the curves of a stage are moved.
#[derive(Debug)]
pub(super) enum PlannedCurves {
    /// By the bake. For each prim of the stage, that of the groom's source which it is.
    Moved(Vec<usize>),
    /// By Houdini, which deforms them by the guides.
    Deformed(Vec<Deformed>),
}

impl OverPlan {
    /// The plan for a bake of `groom`; without one if the bake leaves the curves to Houdini, which cannot
    /// deform them.
    ///
    /// # Errors
    /// [`Error::BadInput`] with every difference between the groom and the curves of the stage;
    /// [`Error::Usage`] for settings that leave strands out.
    pub fn new(
        groom: &Groom,
        anim: &Anim,
        target: OverTarget,
    ) -> Result<std::result::Result<Self, Undeformable>> {
        if let Some(option) = left_out(&anim.settings) {
            let message = format!("--over moves every curve of the groom: leave out {option}");
            return Err(Error::Usage(message));
        }
        let deforms = is_deformed(groom, &anim.settings, &target);
        let mut found = doubled(deforms, &target);
        found.extend(other_rate(anim, &target));
        let (source, matched) = match match_prims(groom, &target) {
            Ok(matched) => matched,
            Err(Error::BadInput(others)) => {
                found.extend(others);
                return Err(Error::BadInput(found));
            }
            Err(e) => return Err(e),
        };
        let owners = Owners::new(source);
        for (prim, of) in target.prims.iter().zip(&matched) {
            match of {
                Some(of) => {
                    found.extend(resized(&source.prims[*of], prim, &target));
                    found.extend(moved(groom, source, *of, prim, owners.of_prim(*of), &target.file));
                }
                None if deforms && !source.has_strands() => {}
                None => found.push(not_imported(source, prim, &target)),
            }
        }
        let curves = if deforms {
            deformed(groom, anim, source, &owners, &matched, &target).map(PlannedCurves::Deformed)
        } else {
            Ok(PlannedCurves::Moved(matched.into_iter().flatten().collect()))
        };
        match curves {
            Ok(curves) => Error::if_any(found).map(|()| Ok(OverPlan { target, owners, curves })),
            Err(undeformable) if found.is_empty() => Ok(Err(undeformable)),
            Err(undeformable) => {
                found.extend(undeformable);
                Err(Error::BadInput(found))
            }
        }
    }
}

/// The error of a stage whose time codes are no frames.
fn other_rate(anim: &Anim, target: &OverTarget) -> Option<Diagnostic> {
    let rate = target.stage.time_codes_per_second;
    ((rate - anim.fps).abs() > 1e-6 * anim.fps).then(|| {
        Diagnostic::new(
            &target.file,
            "timeCodesPerSecond",
            format!("{rate} time codes per second, where the animation has {} frames", anim.fps),
            "one time code per frame",
            "import the track from this stage",
        )
    })
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
fn doubled(deforms: bool, target: &OverTarget) -> Vec<Diagnostic> {
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
