//! `anim.json` as it stands in the file: the one description of the format. Its JSON Schema is derived
//! from here; the doc comments are the schema's descriptions.

use crate::error::Result;
use crate::scene::anim::{Contact, Resolution, Scheme, Settings, Written};
use crate::scene::convention::UpAxis;
use crate::scene::document;
use crate::scene::document::array::{Array, BufferFile};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::path::Path;

/// An animation for hairbake: bodies on tracks, colliders, wind, forces, settings.
/// Only `format`, `version`, `fps` and `frames` are required.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[schemars(deny_unknown_fields)]
pub struct AnimFile {
    /// Always "hairbake-anim".
    pub format: AnimFormat,
    /// Version of the format: 1.
    #[schemars(range(min = 1, max = 1))]
    pub version: u32,
    /// Metres in one unit of the lengths in this file that name no unit: 0.01 for centimetres; default 1.
    #[serde(default = "one")]
    #[schemars(range(min = 1e-6, max = 1e4))]
    pub metres_per_unit: f64,
    /// Axis that points up, "y" or "z", right-handed; default "y".
    #[serde(default)]
    pub up_axis: UpAxis,
    /// Frames a second of the bake.
    #[schemars(range(min = 1.0, max = 1000.0))]
    pub fps: f64,
    /// First and last frame of the bake, inclusive.
    pub frames: [i32; 2],
    /// Name of the body that carries the groom; default: the first body.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub head: Option<String>,
    /// Binary files beside this one that hold long arrays.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub buffers: Vec<BufferFile>,
    /// Rigid bodies; default: one named "head" that stands still.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub bodies: Vec<BodyFile>,
    /// What the hair collides with.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub colliders: Vec<ColliderFile>,
    /// What holds hair to bodies: ties, clips, braids.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub ties: Vec<TieFile>,
    /// Gravity, m/s², in the axes of this file; default 9.81 down.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(inner(range(min = -1e4, max = 1e4)))]
    pub gravity_m_s2: Option<[f64; 3]>,
    /// Wind fields; their velocities add.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub wind: Vec<WindFile>,
    /// Accelerations over time that act on all strands, added to gravity.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub forces: Vec<ForceFile>,
    /// Settings of the simulation.
    #[serde(default)]
    pub settings: SettingsFile,
}

/// Marks the file as an animation.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub enum AnimFormat {
    /// An animation.
    #[serde(rename = "hairbake-anim")]
    Anim,
}

/// A rigid body.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[schemars(deny_unknown_fields)]
pub struct BodyFile {
    /// Name, unique.
    pub name: String,
    /// Its motion; default: it stands still where the groom was modelled.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub track: Option<TrackFile>,
}

/// Motion of a joint, evenly sampled: from a file of its own, or given here as `translation` and
/// `rotation_wxyz`. A point p of the groom's rest space is at T(t) · rest⁻¹ · p in the world, T(t) the pose
/// of the joint.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
#[schemars(deny_unknown_fields)]
pub struct TrackFile {
    /// A motion file, beside this one or by a path relative to it: { "fps", "units": "m" | "cm" | "mm",
    /// "up_axis": "Y" | "Z", "frames": [{ "translation", "rotation_quat_wxyz" }] }.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub file: Option<String>,
    /// Samples a second; default: the fps of the bake. A motion file has its own.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 1.0, max = 10000.0))]
    pub fps: Option<f64>,
    /// Frame of the bake, may be fractional, at which the first sample lies; default: the first frame.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub first_frame: Option<f64>,
    /// Number of each sample, counted in samples, to mark gaps: increasing, by 1 where there is none. A gap
    /// is an error unless `pops` is "bridge".
    #[serde(skip_serializing_if = "Option::is_none")]
    pub frames: Option<Array<i32>>,
    /// Position of the joint in the world, scene units, one per sample; default: the origin.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub translation: Option<Array<[f64; 3]>>,
    /// Orientation of the joint in the world as a unit quaternion (w, x, y, z), one per sample; default: none turned.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub rotation_wxyz: Option<Array<[f64; 4]>>,
    /// Pose of the joint in the space that the groom and the head were modelled in; default: its origin.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub rest: Option<PoseFile>,
    /// Frequency above which motion is taken as noise and filtered out, Hz: half of the amplitude passes
    /// there. Lower is smoother and lags at sharp turns; a track whose own Nyquist frequency is not above
    /// it is left as it is; 0 turns the filter off.
    #[schemars(range(min = 0.0, max = 1000.0))]
    pub smoothing_hz: f64,
    /// What to do with a one-frame pop, a sample far from where its neighbours are.
    pub pops: Pops,
}

/// What to do with pops and gaps of a track.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Pops {
    /// They are errors.
    #[default]
    Error,
    /// One-frame pops and gaps are bridged from their neighbours.
    Bridge,
    /// Pops are followed.
    Keep,
}

/// A pose.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[schemars(deny_unknown_fields)]
pub struct PoseFile {
    /// Position, scene units; default: the origin.
    #[serde(default)]
    pub translation: [f64; 3],
    /// Orientation as a unit quaternion (w, x, y, z); default: none turned.
    #[serde(default = "unturned")]
    pub rotation_wxyz: [f64; 4],
}

/// Something the hair cannot enter.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[schemars(deny_unknown_fields)]
pub struct ColliderFile {
    /// Name, unique: letters, digits and _, no digit first.
    pub name: String,
    /// Name of the body that carries it; default: the head.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub body: Option<String>,
    /// Its shape, in the rest space of its body.
    pub shape: ShapeFile,
    /// Coulomb friction coefficient of what slides; default: that of the strand.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 0.0, max = 10.0))]
    pub friction: Option<f64>,
    /// The same of what sticks, not below `friction`, and only with it; default: as `friction`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 0.0, max = 10.0))]
    pub static_friction: Option<f64>,
    /// Distance kept between the shape and the strands, m; default 0.0005.
    #[serde(default = "thickness")]
    #[schemars(range(min = 0.0, max = 1.0))]
    pub thickness_m: f64,
}

/// Holds one place of each of some guides to a body: a hair tie, a clip, the end of a braid. Hair that is drawn elsewhere is
/// brought there at 0.5 m/s at most: give it time in the pre-roll. Without `ids`, `group` and `within` it holds all guides; with several
/// of them, those that fulfil all.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[schemars(deny_unknown_fields)]
pub struct TieFile {
    /// Name, unique.
    pub name: String,
    /// Name of the body that holds the hair; default: the head.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub body: Option<String>,
    /// Ids of the guides.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub ids: Option<Vec<i32>>,
    /// Group of the guides.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub group: Option<String>,
    /// The guides that come into a ball in the groom's pose.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub within: Option<BallFile>,
    /// Where the held places are gathered, scene units, in the rest space of the body, in a bundle of `radius`; default: each stays where
    /// it was drawn.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub at: Option<[f64; 3]>,
    /// Radius of the bundle, scene units; default 0: all in one point.
    #[serde(default)]
    #[schemars(range(min = 0.0))]
    pub radius: f64,
    /// The place of each guide that is held, by its arc length from the root, m. Shorter guides are not held.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 0.0))]
    pub arc_m: Option<f64>,
    /// The same as a multiple of the distance from the root to `at`: 1.3 leaves hair room to go round the head. Default without
    /// `arc_m`: the place drawn nearest to `at`, or to the centre of `within`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 1.0, max = 10.0))]
    pub arc_by_distance: Option<f64>,
    /// First and last frame, may be fractional, between which it holds; default: always.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub frames: Option<[f64; 2]>,
}

/// A ball in the rest space of the groom, scene units.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[schemars(deny_unknown_fields)]
pub struct BallFile {
    /// Centre.
    pub centre: [f64; 3],
    /// Radius.
    #[schemars(range(min = 1e-6))]
    pub radius: f64,
}

/// Shape of a collider, scene units.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(tag = "type", rename_all = "lowercase")]
#[schemars(deny_unknown_fields)]
pub enum ShapeFile {
    /// Triangles of a Wavefront OBJ file.
    Mesh {
        /// Path of the file, relative to this one. The mesh as it was when the groom was drawn.
        file: String,
        /// For a mesh that deforms: path of OBJ files with the faces of `file`, one for each frame of the bake, relative to this
        /// one, # for each digit of the frame's number (cloth.####.obj). Where they are there, two more frames before the first
        /// and after the last are read. Default: it is rigid.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        sequence: Option<String>,
        /// Metres in one unit of the mesh; default: as in this file.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        #[schemars(range(min = 1e-6, max = 1e4))]
        metres_per_unit: Option<f64>,
        /// Axis of the mesh that points up; default: as in this file.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        up_axis: Option<UpAxis>,
    },
    /// Ball.
    Sphere {
        /// Centre.
        centre: [f64; 3],
        /// Radius.
        #[schemars(range(min = 1e-6))]
        radius: f64,
    },
    /// Cylinder with round ends.
    Capsule {
        /// Ends of the axis.
        ends: [[f64; 3]; 2],
        /// Radius.
        #[schemars(range(min = 1e-6))]
        radius: f64,
    },
    /// Ellipsoid.
    Ellipsoid {
        /// Centre.
        centre: [f64; 3],
        /// Semi-axes.
        #[schemars(inner(range(min = 1e-6)))]
        radii: [f64; 3],
        /// Orientation of the axes as a unit quaternion (w, x, y, z); default: none turned.
        #[serde(default = "unturned")]
        rotation_wxyz: [f64; 4],
    },
    /// Half-space below a plane.
    Plane {
        /// A point of the plane.
        point: [f64; 3],
        /// Normal, away from the solid side; any length but zero.
        normal: [f64; 3],
    },
}

/// A vector over time.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(untagged)]
#[schemars(deny_unknown_fields)]
pub enum KeyedFile {
    /// Always the same.
    Constant([f64; 3]),
    /// Keys, interpolated smoothly without overshoot; held before the first and after the last.
    Keys {
        /// Frames of the bake at which the keys lie, may be fractional, increasing.
        frames: Vec<f64>,
        /// Value at each.
        values: Vec<[f64; 3]>,
    },
}

/// A wind field: a uniform velocity over time plus gusts.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[schemars(deny_unknown_fields)]
pub struct WindFile {
    /// Mean velocity, m/s, in the axes of this file.
    pub velocity_m_s: KeyedFile,
    /// Root-mean-square speed of the gusts, m/s; default 0: steady.
    #[serde(default)]
    #[schemars(range(min = 0.0, max = 100.0))]
    pub gust_speed_m_s: f64,
    /// Size of the gusts, m; default 0.5. Larger moves more of the hair at once.
    #[serde(default = "gust_length")]
    #[schemars(range(min = 1e-3, max = 1e3))]
    pub gust_length_m: f64,
    /// Seed of the gusts; default 0.
    #[serde(default)]
    pub seed: u32,
}

/// A uniform acceleration over time.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[schemars(deny_unknown_fields)]
pub struct ForceFile {
    /// Acceleration, m/s², in the axes of this file.
    pub acceleration_m_s2: KeyedFile,
}

/// Settings of the simulation; the command line may override them.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
#[schemars(deny_unknown_fields)]
pub struct SettingsFile {
    /// Steps of the solver in one frame. More is more accurate and slower.
    #[schemars(range(min = 1, max = 10000))]
    pub substeps: u32,
    /// Time simulated before the first frame, s, in which the groom settles and overlaps are worked out.
    #[schemars(range(min = 0.0, max = 60.0))]
    pub preroll_s: f64,
    /// Strain nodes on a guide where the groom has no wisps of its own. More is more accurate and slower.
    #[schemars(range(min = 2, max = 256))]
    pub nodes: u32,
    /// Time scheme of the solver.
    pub scheme: Scheme,
    /// What hair touches.
    pub contact: Contact,
    /// What moves by itself.
    pub resolution: Resolution,
    /// Where the resolution is adaptive: share of its length by which a guide may be off where those that lead it put it, as estimated by what they
    /// differ on, and bodies push it from there, before it comes away. Less is more accurate and slower.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub parting: f64,
    /// Which curves are written.
    pub curves: Written,
    /// Share of the render strands that is written; those are wider, so that they cover as much.
    #[schemars(range(min = 1e-6, max = 1.0))]
    pub keep: f64,
    /// Moments of a frame that are written, for motion blur: the frame itself, and the others evenly over the shutter.
    #[schemars(range(min = 1, max = 64))]
    pub samples: u32,
    /// How long the shutter is open from a frame on, frames; of no effect with one sample and no accelerations.
    #[schemars(range(min = 0.001, max = 0.999))]
    pub shutter: f64,
    /// Whether accelerations are written too, for renderers that blur motion by them: half as much disk again.
    pub accelerations: bool,
}

impl AnimFile {
    /// An animation of `frames` (first, last) at `fps`, metres, Y up, all else at its default.
    pub fn new(fps: f64, frames: [i32; 2]) -> Self {
        AnimFile {
            format: AnimFormat::Anim,
            version: 1,
            metres_per_unit: 1.0,
            up_axis: UpAxis::Y,
            fps,
            frames,
            head: None,
            buffers: Vec::new(),
            bodies: Vec::new(),
            colliders: Vec::new(),
            ties: Vec::new(),
            gravity_m_s2: None,
            wind: Vec::new(),
            forces: Vec::new(),
            settings: SettingsFile::default(),
        }
    }

    /// Writes the file as JSON, whole or not at all. Relative file names in it start from its folder.
    ///
    /// # Errors
    /// [`crate::Error::Io`].
    pub fn write(&self, path: &Path) -> Result<()> {
        document::write(path, self)
    }
}

impl Default for TrackFile {
    fn default() -> Self {
        TrackFile {
            file: None,
            fps: None,
            first_frame: None,
            frames: None,
            translation: None,
            rotation_wxyz: None,
            rest: None,
            smoothing_hz: 12.0,
            pops: Pops::Error,
        }
    }
}

impl Default for SettingsFile {
    fn default() -> Self {
        let Settings {
            substeps,
            preroll,
            nodes,
            scheme,
            contact,
            resolution,
            parting,
            curves,
            keep,
            samples,
            shutter,
            accelerations,
        } = Settings::default();
        SettingsFile {
            substeps,
            preroll_s: preroll,
            nodes,
            scheme,
            contact,
            resolution,
            parting,
            curves,
            keep,
            samples,
            shutter,
            accelerations,
        }
    }
}

/// A motion file, as head trackers and exporters write it. Keys it has beyond these are not read.
#[derive(Debug, Clone, PartialEq, Deserialize, JsonSchema)]
pub struct MotionFile {
    /// Samples a second.
    #[schemars(range(min = 1.0, max = 10000.0))]
    pub fps: f64,
    /// Unit of the translations; default "m".
    #[serde(default)]
    pub units: Unit,
    /// Axis that points up; default "Y".
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
    /// Metres in one.
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

fn one() -> f64 {
    1.0
}

fn unturned() -> [f64; 4] {
    [1.0, 0.0, 0.0, 0.0]
}

fn thickness() -> f64 {
    0.0005
}

fn gust_length() -> f64 {
    0.5
}
