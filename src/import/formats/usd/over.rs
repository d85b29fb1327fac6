//! Curves of a USD stage that a bake overrides.

use super::exchange::{self, Exchange, matrices, required};
use crate::import::source::Source;
use crate::math::basis_curve::{Basis, CurveType, Wrap};
use crate::scene::{Convention, OverNormals, OverPrim, OverTarget, StageMetadata};
use crate::{Diagnostic, Result};
use serde::Deserialize;

#[derive(Debug, Deserialize)]
struct Header {
    prims: Vec<PrimHeader>,
    time_codes_per_second: f64,
    frames_per_second: f64,
    range: Option<[f64; 2]>,
    default_prim: Option<String>,
}

#[derive(Debug, Deserialize)]
struct PrimHeader {
    path: String,
    points_name: String,
    time: Option<f64>,
    shows_rest: bool,
    basis: Basis,
    wrap: Wrap,
    curves: usize,
    points: usize,
    normals: usize,
    normals_name: String,
    width: f64,
    accelerations: bool,
    skinned: bool,
}

/// Reads the curves at and below the `prims` of `source`, or all of them if none is given, and where the
/// stage places them at `offsets` after each frame `first` to `last`.
///
/// # Errors
/// As [`Exchange::read`]; a stage of unknown unit; closed curves, and curves inside instances.
pub(crate) fn read(
    source: &Source,
    prims: &[String],
    [first, last]: [i32; 2],
    offsets: &[f64],
) -> Result<OverTarget> {
    let frames = last.abs_diff(first) as usize + 1;
    let offsets_text: Vec<String> = offsets.iter().map(f64::to_string).collect();
    let mut options = vec![format!("--moments={first},{frames},{}", offsets_text.join(","))];
    options.extend((!prims.is_empty()).then(|| format!("--prims={}", prims.join(","))));
    let mut read = Exchange::<Header>::read("over", source, &options)?;
    let layers = std::mem::take(&mut read.layers);
    let sha256 = read.sha256();
    let mut vertices = required(read.u32s("controls"), "controls")?.into_iter();
    let mut points = exchange::points(&required(read.f64s("points"), "points")?).into_iter();
    let mut normals = exchange::points(&required(read.f64s("normals"), "normals")?).into_iter();
    let mut controls = required(read.u32s("normal_controls"), "normal_controls")?.into_iter();
    let to_world = matrices(&required(read.f64s("to_world"), "to_world")?);
    let mut to_world = to_world.as_chunks::<3>().0.iter().copied();
    let sides = required(read.f64s("sides"), "sides")?;
    let declared = read.header.declared();
    // Not USD's default: the groom's unit may have been guessed or given.
    let metres_per_unit = source.metres_per_unit.or(declared.metres_per_unit).ok_or_else(|| {
        Diagnostic::new(
            &source.path,
            "metersPerUnit",
            "the stage does not declare its unit",
            "a declared unit, or the one that `import track` noted",
            "declare metersPerUnit in the stage, or import the track from it with --units",
        )
    })?;
    let Header { prims, time_codes_per_second, frames_per_second, range, default_prim } = read.header.more;
    let prim = |prim: PrimHeader| OverPrim {
        path: prim.path,
        points_name: prim.points_name,
        time: prim.time,
        curve: CurveType { basis: prim.basis, wrap: prim.wrap },
        shows_rest: prim.shows_rest,
        vertices: vertices.by_ref().take(prim.curves).collect(),
        points: points.by_ref().take(prim.points).collect(),
        width: prim.width,
        normals: (prim.normals > 0).then(|| OverNormals {
            name: prim.normals_name,
            normals: normals.by_ref().take(prim.normals).collect(),
            controls: controls.by_ref().take(prim.normals).map(|control| control as usize).collect(),
        }),
        accelerations: prim.accelerations,
        skinned: prim.skinned,
        to_world: to_world.by_ref().take(frames * offsets.len()).collect(),
    };
    Ok(OverTarget {
        file: source.path.clone(),
        sha256,
        convention: Convention { metres_per_unit, up: source.up.or(declared.up).unwrap_or_default() },
        stage: StageMetadata {
            metres_per_unit: declared.metres_per_unit,
            up: declared.up,
            time_codes_per_second,
            frames_per_second,
            range,
            default_prim,
        },
        prims: prims.into_iter().map(prim).collect(),
        layers,
        first_frame: first,
        sides,
    })
}
