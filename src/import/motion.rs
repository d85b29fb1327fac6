//! The motion of a joint, as read from a file.

use super::plain::Rest;
use super::source::Source;
use crate::scene::anim::file::PoseFile;
use crate::scene::track::MAX_DISTANCE;
use crate::scene::{Convention, UpAxis};
use crate::{Diagnostic, Error, Result};
use nalgebra::{Isometry3, Quaternion, UnitQuaternion, Vector3};
use std::path::{Path, PathBuf};

/// Most joints that an error message lists.
const MAX_LISTED: usize = 60;
/// Most samples out of range that are reported one by one.
const MAX_REPORTED: usize = 8;

/// Evenly sampled poses of a joint in the world.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Motion {
    /// Samples per second.
    pub(super) rate: f64,
    /// Frame numbers, where the file has them.
    pub(super) numbering: Option<FrameNumbers>,
    /// Unit and up axis of the poses.
    pub(super) convention: Convention,
    /// The poses.
    pub(super) poses: Vec<PoseFile>,
    /// Pose of the joint in which the character was modelled, where the file has it.
    pub(super) bind: Option<PoseFile>,
    /// What only USD has.
    pub(super) stage: Option<StageMotion>,
    /// Remarks for the artist.
    pub(super) notes: Vec<String>,
    /// What the artist should check.
    pub(super) warnings: Vec<String>,
}

/// What a USD stage tells of a motion.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct StageMotion {
    /// Path of the prim whose motion this is, or of the skeleton.
    pub(super) prim: String,
    /// First and last time code of the shot; there may be samples before and after it.
    pub(super) shot: [f64; 2],
    /// The rest space of [`Motion::bind`].
    pub(super) rest: Rest,
    /// Paths of the groom's curves in the stage; empty where nothing can be put over them.
    pub(super) over: Vec<String>,
}

/// The USD curves that a groom was imported from.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct GroomCurves {
    /// The stage.
    pub(super) stage: PathBuf,
    /// Their paths.
    pub(super) prims: Vec<String>,
}

/// How a file numbers its frames.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct FrameNumbers {
    /// Number of the first sample.
    pub(super) first: f64,
    /// Numbers per second.
    pub(super) rate: f64,
}

impl Motion {
    /// The poses in metres, Y up.
    pub(super) fn in_metres(&self) -> Vec<Isometry3<f64>> {
        let pose = |p: &PoseFile| self.convention.pose_in(p.translation.into(), rotation(p.rotation_wxyz));
        self.poses.iter().map(pose).collect()
    }

    /// Checks the places of the samples, read from `file`.
    ///
    /// # Errors
    /// Samples beyond [`MAX_DISTANCE`], by their numbers from 0.
    pub(super) fn check_places(&self, file: &Path) -> Result<()> {
        let places =
            self.poses.iter().map(|pose| self.convention.length_in(pose.translation.into())).enumerate();
        // Not a number is as far.
        let far = places.filter(|(_, x)| !(..=MAX_DISTANCE).contains(&x.norm()));
        let report = |(i, x): (usize, Vector3<f64>)| {
            Diagnostic::new(
                file,
                "motion",
                format!("sample {i} is at ({:.3e}, {:.3e}, {:.3e}) m", x.x, x.y, x.z),
                format!("up to {MAX_DISTANCE:e} m from the origin"),
                "correct the sample, or the unit (--units)",
            )
        };
        Error::if_any(far.take(MAX_REPORTED).map(report).collect())
    }
}

/// A rotation from the components of a nonzero quaternion.
pub(super) fn rotation([w, x, y, z]: [f64; 4]) -> UnitQuaternion<f64> {
    UnitQuaternion::from_quaternion(Quaternion::new(w, x, y, z))
}

/// The error for a missing or unknown name of a joint or node (`kind`); `names` are those in the file.
pub(super) fn unknown_joint(source: &Source, name: Option<&str>, names: &[&str], kind: &str) -> Error {
    let what = match name {
        Some(name) => format!("no {kind} is named \"{name}\""),
        None => format!("the file has {} {kind}s, and none is selected", names.len()),
    };
    let more = if names.len() > MAX_LISTED { ", …" } else { "" };
    let listed: Vec<&str> = names.iter().take(MAX_LISTED).copied().collect();
    Diagnostic::new(
        &source.path,
        kind,
        what,
        format!("one of: {}{more}", listed.join(", ")),
        "select one with --joint, for example the head",
    )
    .into()
}

/// Rounds a sampling rate to a whole number if it is within a thousandth of one: files round the frame time.
pub(super) fn snap_rate(rate: f64) -> f64 {
    if (rate - rate.round()).abs() < 1e-3 * rate { rate.round() } else { rate }
}

/// Unit and up axis: as given in `source`, else those of the format.
pub(super) fn convention(source: &Source, metres_per_unit: f64, up: UpAxis) -> Convention {
    Convention {
        metres_per_unit: source.metres_per_unit.unwrap_or(metres_per_unit),
        up: source.up.unwrap_or(up),
    }
}
