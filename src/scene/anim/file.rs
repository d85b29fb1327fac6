//! The structure of `anim.json`. These structs are the only description of the format: its JSON Schema is
//! derived from them, and their doc comments are the descriptions in the schema.

use super::ends_file::{BallFile, RootsFile, TieFile};
use super::settings_file::SettingsFile;
use crate::error::Result;
use crate::scene::convention::UpAxis;
use crate::scene::json::array::{Array, BufferFile};
use crate::scene::json::pretty::write_json;
use crate::scene::origin::Origin;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::path::Path;

/// An animation for hairbake: bodies on tracks, colliders, ties, wind, forces, settings. Required are
/// `format`, `version`, `fps` and `frames`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[schemars(deny_unknown_fields)]
pub struct AnimFile {
    /// Always "hairbake-anim".
    pub format: AnimFormat,
    /// Version of the format: 1.
    #[schemars(range(min = 1, max = 1))]
    pub version: u32,
    /// Metres per scene unit, the unit of all lengths in this file without a unit in their key: 0.01 for
    /// centimetres. Default 1.
    #[serde(default = "one")]
    #[schemars(range(min = 1e-6, max = 1e4))]
    pub metres_per_unit: f64,
    /// Axis that points up, "y" or "z"; axes are right-handed. Default "y".
    #[serde(default)]
    pub up_axis: UpAxis,
    /// Frames per second of the bake.
    #[schemars(range(min = 1.0, max = 1000.0))]
    pub fps: f64,
    /// First and last frame of the bake, inclusive.
    pub frames: [i32; 2],
    /// Name of the body that carries the groom. Default: the first body.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub head: Option<String>,
    /// Binary files next to this one that hold long arrays.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub buffers: Vec<BufferFile>,
    /// Rigid bodies. Default: one, named "head", that does not move.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub bodies: Vec<BodyFile>,
    /// Shapes that the hair collides with.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub colliders: Vec<ColliderFile>,
    /// Names of colliders, meshes, that the roots grow on: each root rides on the nearest place of them, in
    /// the shapes of the meshes for which the groom was drawn. Default: the head carries all roots.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub skins: Vec<String>,
    /// How the roots of some guides are held. Default: clamped.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub roots: Vec<RootsFile>,
    /// Ties that hold hair to bodies: hair ties, clips, ends of braids.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub ties: Vec<TieFile>,
    /// Forces and moments on guides.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub loads: Vec<LoadFile>,
    /// Animated curves that guides are pulled to.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub goals: Vec<GoalFile>,
    /// Gravity, m/s², in the axes of this file. Default: 9.81 downwards.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(inner(range(min = -1e4, max = 1e4)))]
    pub gravity_m_s2: Option<[f64; 3]>,
    /// Wind fields; their velocities add.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub wind: Vec<WindFile>,
    /// Uniform accelerations over time, added to gravity.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub forces: Vec<ForceFile>,
    /// The curves that a bake puts the motion over, besides writing its cache. `import track` writes them if
    /// the groom comes from curves that are in the stage of the motion. Default: none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub over: Option<OverFile>,
    /// Settings of the simulation and of its output.
    #[serde(default)]
    pub settings: SettingsFile,
}

/// Curves of a USD stage that a bake puts the motion over.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[schemars(deny_unknown_fields)]
pub struct OverFile {
    /// Path of the stage, relative to the folder of this file.
    pub file: String,
    /// Paths of the curves, or of prims above them.
    pub prims: Vec<String>,
    /// Metres per unit of the stage, whatever it declares. Default: what it declares.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 1e-6, max = 1e4))]
    pub metres_per_unit: Option<f64>,
    /// Axis of the stage that points up, whatever it declares. Default: what it declares, or "y".
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub up_axis: Option<UpAxis>,
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
    /// Its motion. Default: it does not move from where the groom was modelled.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub track: Option<TrackFile>,
}

/// Motion of a joint, evenly sampled, from a motion file or from `translation` and `rotation_wxyz`. A point p
/// of the groom's rest space is at T(t) · rest⁻¹ · p in the world, where T(t) is the pose of the joint.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
#[schemars(deny_unknown_fields)]
pub struct TrackFile {
    /// Path of a motion file, relative to the folder of this file: { "fps", "units": "m" | "cm" | "mm",
    /// "up_axis": "Y" | "Z", "frames": [{ "translation", "rotation_quat_wxyz" }] }.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub file: Option<String>,
    /// Samples per second. Default: the fps of the bake. Not with `file`, which has its own.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 1.0, max = 10000.0))]
    pub fps: Option<f64>,
    /// Frame of the first sample; may be fractional. Default: the first frame of the bake.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub first_frame: Option<f64>,
    /// Number of each sample, increasing; an increase of more than 1 marks a gap. A gap is an error unless
    /// `pops` is "bridge".
    #[serde(skip_serializing_if = "Option::is_none")]
    pub frames: Option<Array<i32>>,
    /// Position of the joint in the world, scene units, one per sample. Default: the origin.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub translation: Option<Array<[f64; 3]>>,
    /// Orientation of the joint in the world as a unit quaternion (w, x, y, z), one per sample. Default: no
    /// rotation.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub rotation_wxyz: Option<Array<[f64; 4]>>,
    /// Pose of the joint in the rest space, in which groom and head were modelled. Default: its origin.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub rest: Option<PoseFile>,
    /// Where the rest pose comes from.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub origin: Option<Origin>,
    /// Cutoff of the low-pass filter against tracker noise, Hz: half of the amplitude passes at this
    /// frequency. Lower is smoother and rounds sharp turns. Default 12, which keeps head motion and removes
    /// the jitter of motion capture. 0, or a cutoff not below half the sample rate, turns the filter off; one
    /// below 1/292 of the sample rate counts as that.
    #[schemars(range(min = 0.0, max = 1000.0))]
    pub smoothing_hz: f64,
    /// What to do with pops: samples that jump as no head can move, for up to a quarter of a second or for
    /// good.
    pub pops: Pops,
}

/// What to do with pops and gaps of a track.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Pops {
    /// Pops and gaps are errors.
    #[default]
    Error,
    /// Samples that are off, and gaps, are replaced by interpolation; at an end of the track by its own
    /// motion, which comes to rest. Jumps that last are errors.
    Bridge,
    /// Pops are kept as they are; gaps are errors.
    Keep,
}

/// A pose.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[schemars(deny_unknown_fields)]
pub struct PoseFile {
    /// Position, scene units. Default: the origin.
    #[serde(default)]
    pub translation: [f64; 3],
    /// Orientation as a unit quaternion (w, x, y, z). Default: no rotation.
    #[serde(default = "no_rotation")]
    pub rotation_wxyz: [f64; 4],
}

/// A shape that the hair cannot enter.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[schemars(deny_unknown_fields)]
pub struct ColliderFile {
    /// Unique name: letters, digits and _, not starting with a digit.
    pub name: String,
    /// Name of the body that carries it. Default: the head.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub body: Option<String>,
    /// Shape, in the rest space of its body.
    pub shape: ShapeFile,
    /// Coefficient of kinetic (sliding) Coulomb friction. Higher slides less. Default: that of the strand.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 0.0, max = 10.0))]
    pub friction: Option<f64>,
    /// Coefficient of static friction, not below `friction`, and only together with it. Higher sticks longer.
    /// Default: `friction`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 0.0, max = 10.0))]
    pub static_friction: Option<f64>,
    /// Distance kept between the shape and the axes of the strands, m, at least the radius of the strand. Higher hides
    /// gaps of a coarse mesh. Default 0.0005, half a millimetre.
    #[serde(default = "thickness")]
    #[schemars(range(min = 0.0, max = 1.0))]
    pub thickness_m: f64,
}

/// A force and a moment on each of some guides, at a place or spread over a part of the length. Selects the
/// guides that match all of `ids`, `group` and `within` that are given; all guides if none is. They act on a
/// guide as a single hair. A guide with a load moves by itself and follows no wisp.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[schemars(deny_unknown_fields)]
pub struct LoadFile {
    /// Unique name.
    pub name: String,
    /// Selects guides by their ids.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub ids: Option<Vec<i32>>,
    /// Selects the guides of a group, by its name.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub group: Option<String>,
    /// Selects the guides that enter a ball in the groom's pose.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub within: Option<BallFile>,
    /// Where a point load acts: arc length from the root, m. Shorter guides bear none. Default, without the
    /// other places: the tip.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 0.0))]
    pub arc_m: Option<f64>,
    /// The same place as a share of the length from the root; 1 is the tip.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 0.0, max = 1.0))]
    pub arc_share: Option<f64>,
    /// Where a spread load acts: from one arc length to another, m. Ends at the tip of shorter guides.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(inner(range(min = 0.0)))]
    pub span_m: Option<[f64; 2]>,
    /// The same part as shares of the length.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(inner(range(min = 0.0, max = 1.0)))]
    pub span_share: Option<[f64; 2]>,
    /// Force, N; of a spread load, N/m. Linear between the keys. Default 0.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub force_n: Option<KeyframesFile>,
    /// Moment, N m; of a spread load, N m per m. Linear between the keys. Default 0.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub moment_n_m: Option<KeyframesFile>,
    /// Axes of force and moment. Default "world".
    #[serde(default)]
    pub axes: LoadAxes,
}

/// Axes of a load.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum LoadAxes {
    /// Those of this file, which do not turn with the hair.
    #[default]
    World,
    /// The two axes of the section and the tangent, at the place of the load: it turns with the hair.
    Material,
}

/// Animated curves that guides are pulled to: those of an animator, or the guides of an earlier bake. A guide
/// has one goal at most. How firmly it is pulled is a weight from 0 to 1: the product of `weight`, of the
/// larger of `along` and what `hard_to` holds, and of `goal_weight` of the guide's material and of the guide.
/// With 0 it moves freely, with 1 it is the animation.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[schemars(deny_unknown_fields)]
pub struct GoalFile {
    /// Unique name.
    pub name: String,
    /// Path of OBJ files with the curves, one per frame of the bake, with # for each digit of the frame
    /// number (tail.####.obj), relative to the folder of this file. Each curve is an element `l`, root first,
    /// with any number of points; all files have the same. The frames of the pre-roll and two after the last
    /// are read too, as far as there are files for them; beyond the files the pose is held.
    pub sequence: String,
    /// Metres per unit of the curves. Default: as in this file.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 1e-6, max = 1e4))]
    pub metres_per_unit: Option<f64>,
    /// Axis of the curves that points up. Default: as in this file.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub up_axis: Option<UpAxis>,
    /// The space of the curves. Default "world".
    #[serde(default)]
    pub space: GoalSpace,
    /// Names of the groups whose guides are pulled. Default: all groups.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub groups: Option<Vec<String>>,
    /// Id of the guide of each curve. Default: the guides of `groups`, in the order of the groom.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub ids: Option<Array<i32>>,
    /// Weight over time, 0 to 1. Default 1.
    #[serde(default = "full_weight")]
    pub weight: NumberKeyframesFile,
    /// Weight along the strand, 0 to 1. Default: 1 without `hard_to`, else 0.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub along: Option<RampFile>,
    /// Share of the length of the strand, from the root, over which the weight along it is 1, over time:
    /// there the strand is the animation. Beyond, the weight falls within 15 % of the length. Default 0.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub hard_to: Option<NumberKeyframesFile>,
    /// Frequency of the springs on the points of a strand of weight ½, and at which one that comes to weight 1
    /// reaches the goal, Hz. Higher pulls harder. Default 4.
    #[serde(default = "goal_hz")]
    #[schemars(range(min = 0.1, max = 100.0))]
    pub hz: f64,
    /// Damping of motion relative to the goal, as a share of what lets it die away without oscillation.
    /// Default 1.
    #[serde(default = "one")]
    #[schemars(range(min = 0.0, max = 10.0))]
    pub damping: f64,
}

/// The space of the curves of a goal.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum GoalSpace {
    /// The world.
    #[default]
    World,
    /// The rest space of the groom: each curve is carried as the root of its guide is, by the head or a skin.
    Rest,
}

/// A number over time.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(untagged)]
#[schemars(deny_unknown_fields)]
pub enum NumberKeyframesFile {
    /// A constant.
    Constant(f64),
    /// Keyframes, interpolated smoothly without overshoot; constant before the first and after the last.
    Keys {
        /// Frames of the keys, increasing; may be fractional.
        frames: Vec<f64>,
        /// Value at each key.
        values: Vec<f64>,
    },
}

/// A number along a strand, interpolated smoothly without overshoot.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[schemars(deny_unknown_fields)]
pub struct RampFile {
    /// Places of the keys as shares of the length from the root, 0 to 1, increasing.
    pub arc: Vec<f64>,
    /// Value at each key.
    pub values: Vec<f64>,
}

/// Shape of a collider, scene units.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(tag = "type", rename_all = "lowercase")]
#[schemars(deny_unknown_fields)]
pub enum ShapeFile {
    /// Triangles of a Wavefront OBJ file.
    Mesh {
        /// Path of the file, relative to the folder of this file: the mesh for which the groom was drawn.
        file: String,
        /// For a deforming mesh: path of OBJ files with the faces of `file`, one per frame of the bake, with
        /// # for each digit of the frame number (cloth.####.obj), relative to the folder of this file. The
        /// frames of the pre-roll and two after the last are read too, as far as there are files for them.
        /// Default: the mesh is rigid.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        sequence: Option<String>,
        /// Metres per unit of the mesh. Default: as in this file.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        #[schemars(range(min = 1e-6, max = 1e4))]
        metres_per_unit: Option<f64>,
        /// Axis of the mesh that points up. Default: as in this file.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        up_axis: Option<UpAxis>,
    },
    /// A ball.
    Sphere {
        /// Centre.
        centre: [f64; 3],
        /// Radius.
        #[schemars(range(min = 1e-6))]
        radius: f64,
    },
    /// A cylinder with hemispherical ends.
    Capsule {
        /// Ends of the axis.
        ends: [[f64; 3]; 2],
        /// Radius.
        #[schemars(range(min = 1e-6))]
        radius: f64,
    },
    /// An ellipsoid.
    Ellipsoid {
        /// Centre.
        centre: [f64; 3],
        /// Semi-axes.
        #[schemars(inner(range(min = 1e-6)))]
        radii: [f64; 3],
        /// Orientation of the axes as a unit quaternion (w, x, y, z). Default: no rotation.
        #[serde(default = "no_rotation")]
        rotation_wxyz: [f64; 4],
    },
    /// The half-space below a plane.
    Plane {
        /// A point of the plane.
        point: [f64; 3],
        /// Normal that points away from the solid side, of any length above 0.
        normal: [f64; 3],
    },
}

/// A vector over time.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(untagged)]
#[schemars(deny_unknown_fields)]
pub enum KeyframesFile {
    /// A constant.
    Constant([f64; 3]),
    /// Keyframes: wind and gravity are smooth between them, without overshoot, forces and moments linear; constant before
    /// the first and after the last.
    Keys {
        /// Frames of the keys, increasing; may be fractional.
        frames: Vec<f64>,
        /// Value at each key.
        values: Vec<[f64; 3]>,
    },
}

/// A wind field: a uniform velocity over time plus gusts.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[schemars(deny_unknown_fields)]
pub struct WindFile {
    /// Mean velocity, m/s, in the axes of this file.
    pub velocity_m_s: KeyframesFile,
    /// Root-mean-square speed of the gusts, m/s. Higher is more turbulent. Default 0: steady wind.
    #[serde(default)]
    #[schemars(range(min = 0.0, max = 100.0))]
    pub gust_speed_m_s: f64,
    /// Size of the gusts, m. Higher moves more of the hair together. Default 0.5, about the size of a head of
    /// hair.
    #[serde(default = "gust_length")]
    #[schemars(range(min = 1e-3, max = 1e3))]
    pub gust_length_m: f64,
    /// Random seed of the gusts: fields with different seeds are independent. Default 0.
    #[serde(default)]
    pub seed: u32,
}

/// A uniform acceleration over time.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[schemars(deny_unknown_fields)]
pub struct ForceFile {
    /// Acceleration, m/s², in the axes of this file.
    pub acceleration_m_s2: KeyframesFile,
}

impl AnimFile {
    /// An animation of `frames` (first, last) at `fps`, in metres, Y up, with defaults for everything else.
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
            skins: Vec::new(),
            roots: Vec::new(),
            ties: Vec::new(),
            loads: Vec::new(),
            goals: Vec::new(),
            gravity_m_s2: None,
            wind: Vec::new(),
            forces: Vec::new(),
            over: None,
            settings: SettingsFile::default(),
        }
    }

    /// Writes the file as JSON, whole or not at all. Relative file names in it start from its folder.
    ///
    /// # Errors
    /// [`crate::Error::Io`].
    pub fn write(&self, path: &Path) -> Result<()> {
        write_json(path, self)
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
            origin: None,
            smoothing_hz: 12.0,
            pops: Pops::Error,
        }
    }
}

fn one() -> f64 {
    1.0
}

fn no_rotation() -> [f64; 4] {
    [1.0, 0.0, 0.0, 0.0]
}

fn thickness() -> f64 {
    0.0005
}

fn goal_hz() -> f64 {
    4.0
}

fn full_weight() -> NumberKeyframesFile {
    NumberKeyframesFile::Constant(1.0)
}

fn gust_length() -> f64 {
    0.5
}
