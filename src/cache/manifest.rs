//! `manifest.json`: what a cache was made from and what it should hold. Nothing in it depends on the time, the folder, or how the
//! work was divided; only [`Manifest::machines`] on what it ran on.

use super::{CurveSet, FileRecord, Header};
use crate::{Error, Result};
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};

/// The whole manifest; keys stand in this order.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Manifest {
    /// Always `hairbake-cache`.
    pub format: String,
    /// Version of this format.
    pub version: u32,
    /// Version of the program that wrote the cache.
    pub hairbake: String,
    /// Which build of it: a hash of its sources.
    #[serde(default)]
    pub build: String,
    /// What the bytes of the cache follow from: a hash of inputs, settings, first frame, version and build.
    #[serde(default)]
    pub key: String,
    /// Instruction sets that the frames were simulated with, each once, in order.
    #[serde(default)]
    pub machines: Vec<String>,
    /// Files that the bake read.
    pub inputs: Vec<InputRecord>,
    /// Settings of the bake, all resolved.
    pub settings: Value,
    /// What the cache holds.
    pub summary: Summary,
    /// Root, topology and clip manifest.
    pub layers: Vec<FileRecord>,
    /// Frame files, handles included, in order.
    pub frames: Vec<FrameRecord>,
    /// Figures over all frames, such as the deepest penetration.
    pub totals: Map<String, Value>,
    /// Figures of the scene as such, such as how well the wisps represent the strands.
    pub scene_figures: Map<String, Value>,
}

/// A file that the bake read.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct InputRecord {
    /// What it is to the bake, such as `groom`, `anim`, `collider`.
    pub role: String,
    /// File name without its folder.
    pub file: String,
    /// SHA-256 of its bytes, lower-case hexadecimal.
    pub sha256: String,
}

/// One frame file.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct FrameRecord {
    /// Frame number.
    pub frame: i32,
    /// Its file.
    #[serde(flatten)]
    pub file: FileRecord,
    /// Figures of the simulation at this frame, such as contacts and stretch.
    pub figures: Map<String, Value>,
}

/// The header in short.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Summary {
    /// Metres in one scene unit.
    pub metres_per_unit: f64,
    /// `Y` or `Z`.
    pub up_axis: String,
    /// Frames a second.
    pub fps: f64,
    /// First and last frame of the shot; the handle frames lie one before and one after.
    pub frames: (i32, i32),
    /// Number of render strands, and of their points.
    pub hair: (usize, usize),
    /// Number of guides, and of their points.
    pub guides: (usize, usize),
    /// Names of the colliders' prims.
    pub colliders: Vec<String>,
}

impl Manifest {
    /// A manifest for a cache of that header, with no inputs, settings, frames or figures yet.
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
                up_axis: super::layout::up_axis(header).into(),
                fps: header.fps,
                frames: header.frames,
                hair: header.hair.as_ref().map(size).unwrap_or_default(),
                guides: size(&header.guides),
                colliders: super::layout::collider_prim_names(header),
            },
            layers: Vec::new(),
            frames: Vec::new(),
            totals: Map::new(),
            scene_figures: Map::new(),
        }
    }
    /// As the file holds it.
    pub(super) fn to_json(&self) -> Result<Vec<u8>> {
        let mut json = serde_json::to_vec_pretty(self).map_err(|e| Error::Internal(e.to_string()))?;
        json.push(b'\n');
        Ok(json)
    }
}
