//! What layers over a stage, and the manifest, repeat of the stage.

use crate::Result;
use crate::cache::ShotStage;
use crate::file::relative;
use crate::scene::{Convention, OverTarget, UpAxis};
use nalgebra::Matrix4;
use std::path::Path;

/// The stage of `target`, for layers in the folder `out`.
pub(super) fn shot_stage(target: &OverTarget, out: &Path) -> Result<ShotStage> {
    let path = relative(&target.file, out)?;
    Ok(ShotStage {
        // Without a dot, USD would search for it.
        path: if path.starts_with("../") { path } else { format!("./{path}") },
        metres_per_unit: target.stage.metres_per_unit,
        z_up: target.stage.up.map(|up| up == UpAxis::Z),
        time_codes_per_second: target.stage.time_codes_per_second,
        frames_per_second: target.stage.frames_per_second,
        range: target.stage.range,
        default_prim: target.stage.default_prim.clone(),
    })
}

/// File name of the stage of `target`, and unit and axis in which the motion is put over it.
pub(super) fn stage_record(target: &OverTarget) -> (String, f64, String) {
    let stage = target.file.file_name().unwrap_or_default().to_string_lossy().into_owned();
    let Convention { metres_per_unit, up } = target.convention;
    (stage, metres_per_unit, if up == UpAxis::Z { "Z" } else { "Y" }.into())
}

/// The rows of a matrix.
pub(super) fn rows(matrix: &Matrix4<f64>) -> [[f64; 4]; 4] {
    std::array::from_fn(|row| std::array::from_fn(|column| matrix[(row, column)]))
}
