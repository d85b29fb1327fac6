//! Motion files: the motion of one joint.

use crate::error::Result;
use crate::scene::convention::{Convention, UpAxis};
use crate::scene::json::document::Document;
use crate::scene::json::key::Key;
use nalgebra::{Isometry3, UnitQuaternion};
use schemars::JsonSchema;
use serde::Deserialize;
use std::path::Path;

/// A motion file, as head trackers and exporters write it. Further keys are ignored.
#[derive(Debug, Clone, PartialEq, Deserialize, JsonSchema)]
pub struct MotionFile {
    /// Samples per second.
    #[schemars(range(min = 1.0, max = 10000.0))]
    pub fps: f64,
    /// Unit of the translations. Default "m".
    #[serde(default)]
    pub units: Unit,
    /// Axis that points up. Default "Y".
    #[serde(default)]
    pub up_axis: MotionUpAxis,
    /// The samples.
    #[schemars(length(min = 1))]
    pub frames: Vec<MotionFrame>,
}

/// One sample of a motion file.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize, JsonSchema)]
pub struct MotionFrame {
    /// Position of the joint in the world.
    pub translation: [f64; 3],
    /// Orientation of the joint in the world as a unit quaternion (w, x, y, z).
    pub rotation_quat_wxyz: [f64; 4],
}

/// Unit of length of a motion file.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Deserialize, JsonSchema)]
pub enum Unit {
    /// Metres.
    #[default]
    #[serde(rename = "m")]
    Metre,
    /// Centimetres.
    #[serde(rename = "cm")]
    Centimetre,
    /// Millimetres.
    #[serde(rename = "mm")]
    Millimetre,
}

impl Unit {
    /// Metres per unit.
    pub fn metres(self) -> f64 {
        match self {
            Unit::Metre => 1.0,
            Unit::Centimetre => 0.01,
            Unit::Millimetre => 0.001,
        }
    }
}

/// Up axis of a motion file.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Deserialize, JsonSchema)]
#[allow(missing_docs)]
pub enum MotionUpAxis {
    #[default]
    Y,
    Z,
}

impl From<MotionUpAxis> for UpAxis {
    fn from(up: MotionUpAxis) -> Self {
        match up {
            MotionUpAxis::Y => UpAxis::Y,
            MotionUpAxis::Z => UpAxis::Z,
        }
    }
}

/// Reads a motion file. Returns its structure, and its poses in metres, Y up.
///
/// # Errors
/// As `Document::open`, and [`crate::Error::BadInput`] with every error found.
pub fn load_motion(path: &Path) -> Result<(MotionFile, Vec<Isometry3<f64>>)> {
    let mut doc = Document::open(path)?;
    let read = doc.deserialize().and_then(|file: MotionFile| {
        let convention = Convention { metres_per_unit: file.units.metres(), up: file.up_axis.into() };
        let wxyz: Vec<_> = file.frames.iter().map(|f| f.rotation_quat_wxyz).collect();
        let rotation = doc.diagnostics.unit_quaternions(&Key::at("frames"), &wxyz)?;
        let pose = |(f, q): (&MotionFrame, UnitQuaternion<f64>)| convention.pose_in(f.translation.into(), q);
        let poses = file.frames.iter().zip(rotation).map(pose).collect();
        Some((file, poses))
    });
    doc.finish(read, &[])
}
