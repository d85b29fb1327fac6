//! The curves of a USD stage that a bake overrides.

use super::convention::{Convention, UpAxis};
use crate::math::basis_curve::CurveType;
use nalgebra::{Matrix4, Vector3};
use serde::Deserialize;
use std::path::PathBuf;

/// Curves of a stage that a bake is to override.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct OverSource {
    /// The stage.
    pub file: PathBuf,
    /// Paths of the curves, or of prims above them; none for the whole stage.
    pub prims: Vec<String>,
    /// Metres per unit of the stage; `None` for what it declares.
    pub metres_per_unit: Option<f64>,
    /// Its up axis; `None` for what it declares, or Y.
    pub up: Option<UpAxis>,
}

/// The curves of a stage that a bake overrides, and where the stage places them.
#[derive(Debug, Clone, PartialEq)]
pub struct OverTarget {
    /// The stage.
    pub file: PathBuf,
    /// Checksum of all that was read from it.
    pub sha256: String,
    /// Unit and axis in which the motion is put over it.
    pub convention: Convention,
    /// Its metadata.
    pub stage: StageMetadata,
    /// The prims, in the order of the stage.
    pub prims: Vec<OverPrim>,
    /// Its layers. They are no part of the checksum: it does not depend on where files lie.
    pub layers: Vec<StageLayer>,
    /// The frame of the first moment.
    pub first_frame: i32,
    /// For each moment of a frame, the frames from one matrix of [`OverPrim::to_world`] to the next.
    pub sides: Vec<f64>,
}

/// A layer of a stage.
#[derive(Debug, Clone, PartialEq, Deserialize)]
pub struct StageLayer {
    /// Its file.
    pub file: PathBuf,
    /// What it does to the stage, if an earlier bake put it over it: the curves are read without.
    pub kind: Option<OverKind>,
    /// Paths of those of the prims that it changes, if an earlier bake put it over the stage.
    pub prims: Vec<String>,
}

/// What a bake does to the curves of a stage.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum OverKind {
    /// Moves them.
    Over,
    /// Lets Houdini deform them.
    Deform,
}

/// Metadata of a stage that a layer over it repeats.
#[derive(Debug, Clone, PartialEq)]
pub struct StageMetadata {
    /// Metres per unit, if the stage declares it.
    pub metres_per_unit: Option<f64>,
    /// Up axis, if the stage declares it.
    pub up: Option<UpAxis>,
    /// Time codes per second.
    pub time_codes_per_second: f64,
    /// Frames per second.
    pub frames_per_second: f64,
    /// First and last time code.
    pub range: Option<[f64; 2]>,
    /// The default prim.
    pub default_prim: Option<String>,
}

/// A prim of an [`OverTarget`].
#[derive(Debug, Clone, PartialEq)]
pub struct OverPrim {
    /// Its path.
    pub path: String,
    /// The attribute that holds its points at rest.
    pub points_name: String,
    /// The time code at which they are at rest; `None` for the default time.
    pub time: Option<f64>,
    /// Type of its curves.
    pub curve: CurveType,
    /// Number of control points of each curve.
    pub vertices: Vec<u32>,
    /// Whether the stage shows its points at rest at all times.
    pub shows_rest: bool,
    /// Control points at rest, in the space of the prim.
    pub points: Vec<Vector3<f64>>,
    /// The largest diameter, in the space of the prim.
    pub width: f64,
    /// Normals that turn with the curves.
    pub normals: Option<OverNormals>,
    /// Whether the stage has accelerations of the curves.
    pub accelerations: bool,
    /// Whether a skeleton deforms the curves.
    pub skinned: bool,
    /// Matrices to the world of the stage, in its unit and axes, for each moment: at it, and at two places
    /// after it.
    pub to_world: Vec<[Matrix4<f64>; 3]>,
}

/// Normals of curves.
#[derive(Debug, Clone, PartialEq)]
pub struct OverNormals {
    /// The attribute.
    pub name: String,
    /// The normals at rest, in the space of the prim.
    pub normals: Vec<Vector3<f64>>,
    /// The control point whose tangent turns each normal.
    pub controls: Vec<usize>,
}
