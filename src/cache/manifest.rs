//! `manifest.json`: provenance and contents of a cache. It does not depend on the time, the folder, or the
//! division of the work; only [`Manifest::machines`] depends on the machines.

use super::header::{CurveSet, Header};
use super::names::{collider_prim_names, up_axis};
use crate::file::FileRecord;
use crate::{Error, Result};
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};

/// The manifest; keys are written in this order.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Manifest {
    /// Always `hairbake-cache`.
    pub format: String,
    /// Version of this format.
    pub version: u32,
    /// Version of the program that wrote the cache.
    pub hairbake: String,
    /// Build of the program: a hash of its sources.
    #[serde(default)]
    pub build: String,
    /// Hash of everything that determines the bytes of the cache: inputs, settings, first frame, version and
    /// build.
    #[serde(default)]
    pub key: String,
    /// Instruction sets with which the frames were simulated, each once, sorted.
    #[serde(default)]
    pub machines: Vec<String>,
    /// Files that the bake read.
    pub inputs: Vec<InputRecord>,
    /// Resolved settings of the bake.
    pub settings: Value,
    /// Contents of the cache.
    pub summary: Summary,
    /// What over mode puts the motion over.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub over: Option<OverRecord>,
    /// The curves that Houdini deforms by the guides.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub deform: Option<DeformRecord>,
    /// Root, topology and clip manifest; in over mode also overs and their clip manifest.
    pub layers: Vec<FileRecord>,
    /// Frame files, handles included, in order.
    pub frames: Vec<FrameEntry>,
    /// Figures over all frames, such as the largest penetration.
    pub totals: Map<String, Value>,
    /// Figures of the scene itself, such as how well the wisps represent the strands.
    pub scene_figures: Map<String, Value>,
}

/// A file that the bake read.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct InputRecord {
    /// Its role, such as `groom`, `anim`, `collider`.
    pub role: String,
    /// File name without folder.
    pub file: String,
    /// SHA-256 of its bytes, lower-case hexadecimal.
    pub sha256: String,
}

/// One frame file.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct FrameEntry {
    /// Frame number.
    pub frame: i32,
    /// Its file.
    #[serde(flatten)]
    pub file: FileRecord,
    /// In over mode, its file of overs.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub over: Option<FileRecord>,
    /// Figures of the simulation at this frame, such as contacts and stretch.
    pub figures: Map<String, Value>,
}

/// What over mode puts the motion over.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct OverRecord {
    /// File name of the stage without folder.
    pub stage: String,
    /// Metres per unit of the stage that the motion was put over it with.
    pub metres_per_unit: f64,
    /// `Y` or `Z`, the up axis that it was put over it with.
    pub up_axis: String,
    /// The curves.
    pub prims: Vec<OverPrimRecord>,
}

/// Curves of the stage.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct OverPrimRecord {
    /// Path of the prim.
    pub path: String,
    /// The attribute that holds the points at rest.
    pub points: String,
    /// The time code at which they are; none for the default time.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub time: Option<f64>,
    /// The attribute of the normals that turn with the curves.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub normals: Option<String>,
    /// Matrix from the space of the prim to rest space in metres, Y up, for column vectors.
    pub to_rest_m: [[f64; 4]; 4],
    /// Whether the importer changed the length of the curves.
    pub lengthened: bool,
    /// What the curves move as; those of no run ride with the head, or on skins with the nearest root.
    pub baked: Vec<OverRun>,
}

/// Curves that follow each other in the stage and in the cache.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct OverRun {
    /// Path of the curves in the cache.
    pub prim: String,
    /// The first curve of the stage's prim.
    pub first: usize,
    /// The first curve of the cache's prim.
    pub baked: usize,
    /// Number of curves.
    pub count: usize,
}

/// The curves of a stage that Houdini deforms by the guides.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct DeformRecord {
    /// File name of the stage without folder.
    pub stage: String,
    /// Metres per unit of the stage that the layer was written with.
    pub metres_per_unit: f64,
    /// `Y` or `Z`, the up axis that it was written with.
    pub up_axis: String,
    /// The curves.
    pub prims: Vec<DeformPrimRecord>,
}

/// Curves of the stage.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct DeformPrimRecord {
    /// Path of the prim.
    pub path: String,
    /// The attribute that holds the points at rest.
    pub points: String,
    /// The time code at which they are; none for the default time.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub time: Option<f64>,
    /// Matrix from the space of the prim to rest space in metres, Y up, for column vectors.
    pub to_rest_m: [[f64; 4]; 4],
    /// How guides move it: `guideweights` or `guideshapeinterpolation`.
    pub method: String,
    /// Path of the guides.
    pub guides: String,
    /// Path of the mesh that carries the roots.
    pub skin: String,
}

impl FrameEntry {
    /// Length of its files, bytes.
    pub fn bytes(&self) -> u64 {
        self.file.bytes + self.over.as_ref().map_or(0, |over| over.bytes)
    }
}

/// Summary of a [`Header`].
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Summary {
    /// Metres per scene unit.
    pub metres_per_unit: f64,
    /// `Y` or `Z`.
    pub up_axis: String,
    /// Frames per second.
    pub fps: f64,
    /// First and last frame of the shot, without the handle frames.
    pub frames: (i32, i32),
    /// Numbers of render strands and of their points.
    pub hair: (usize, usize),
    /// Numbers of guides and of their points.
    pub guides: (usize, usize),
    /// Prim names of the colliders.
    pub colliders: Vec<String>,
}

impl Manifest {
    /// The manifest of a cache with that header, without inputs, settings, frames and figures.
    pub fn new(header: &Header) -> Self {
        let size = |curves: &CurveSet| (curves.counts.len(), curves.rest.len());
        Manifest {
            format: "hairbake-cache".into(),
            version: 1,
            hairbake: env!("CARGO_PKG_VERSION").into(),
            build: crate::BUILD.into(),
            key: String::new(),
            machines: Vec::new(),
            inputs: Vec::new(),
            settings: Value::Null,
            summary: Summary {
                metres_per_unit: header.metres_per_unit,
                up_axis: up_axis(header).into(),
                fps: header.fps,
                frames: header.frames,
                hair: header.hair.as_ref().map(size).unwrap_or_default(),
                guides: size(&header.guides),
                colliders: collider_prim_names(header),
            },
            over: None,
            deform: None,
            layers: Vec::new(),
            frames: Vec::new(),
            totals: Map::new(),
            scene_figures: Map::new(),
        }
    }

    /// The content of the file.
    pub(super) fn to_json(&self) -> Result<Vec<u8>> {
        let mut json = serde_json::to_vec_pretty(self).map_err(|e| Error::Internal(e.to_string()))?;
        json.push(b'\n');
        Ok(json)
    }
}
