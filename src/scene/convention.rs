//! Units and axes of files, and their conversion to and from the internal convention: metres, Y up.

use nalgebra::{Isometry3, Matrix4, UnitQuaternion, Vector3};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// The axis of a file that points up.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum UpAxis {
    /// Y up, right-handed (USD, Maya, glTF).
    #[default]
    Y,
    /// Z up, right-handed (Blender, Houdini exports, survey data).
    Z,
}

/// Length unit and up axis of a file.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Convention {
    /// Metres per scene unit (0.01 for centimetres).
    pub metres_per_unit: f64,
    /// Up axis.
    pub up: UpAxis,
}

impl Default for Convention {
    fn default() -> Self {
        Convention { metres_per_unit: 1.0, up: UpAxis::Y }
    }
}

impl Convention {
    /// Rotation from the file's axes to Y up (−90° about x for Z up).
    pub fn to_y_up(&self) -> UnitQuaternion<f64> {
        match self.up {
            UpAxis::Y => UnitQuaternion::identity(),
            UpAxis::Z => UnitQuaternion::from_axis_angle(&Vector3::x_axis(), -std::f64::consts::FRAC_PI_2),
        }
    }

    /// A position or displacement of the file, converted to metres, Y up.
    pub fn length_in(&self, v: Vector3<f64>) -> Vector3<f64> {
        self.to_y_up() * v * self.metres_per_unit
    }

    /// [`Self::length_in`] as a matrix.
    pub fn matrix_in(&self) -> Matrix4<f64> {
        self.to_y_up().to_homogeneous().prepend_scaling(self.metres_per_unit)
    }

    /// The inverse of [`Self::length_in`].
    pub fn length_out(&self, v: Vector3<f64>) -> Vector3<f64> {
        self.to_y_up().inverse() * v / self.metres_per_unit
    }

    /// A direction, or a vector in SI units, in the file's axes, turned to Y up.
    pub fn direction_in(&self, v: Vector3<f64>) -> Vector3<f64> {
        self.to_y_up() * v
    }

    /// A rotation of the file, turned to Y up (conjugation by [`Self::to_y_up`]).
    pub fn rotation_in(&self, q: UnitQuaternion<f64>) -> UnitQuaternion<f64> {
        let a = self.to_y_up();
        a * q * a.inverse()
    }

    /// A pose of the file, converted to metres, Y up.
    pub fn pose_in(&self, translation: Vector3<f64>, rotation: UnitQuaternion<f64>) -> Isometry3<f64> {
        Isometry3::from_parts(self.length_in(translation).into(), self.rotation_in(rotation))
    }

    /// A frame whose columns are directions in the file's axes, turned to Y up: each column turns.
    pub fn frame_in(&self, q: UnitQuaternion<f64>) -> UnitQuaternion<f64> {
        self.to_y_up() * q
    }

    /// The inverse of [`Self::frame_in`].
    pub fn frame_out(&self, q: UnitQuaternion<f64>) -> UnitQuaternion<f64> {
        self.to_y_up().inverse() * q
    }
}
