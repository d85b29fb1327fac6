//! The contents of strand and mesh files, in the file's unit and axes. Readers return these types.

use super::joint_selector::JointSelector;
use crate::geometry::TriMesh;
use crate::scene::{Curves, Factors, RestSpace, SourcePrim, UpAxis};
use nalgebra::{Matrix4, Vector3};

/// The unit and up axis that a file declares.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) struct Declared {
    /// Metres per unit.
    pub(super) metres_per_unit: Option<f64>,
    /// Up axis.
    pub(super) up: Option<UpAxis>,
}

/// The rest space in which a file was read.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) struct Rest {
    pub(super) space: RestSpace,
    /// USD only: matrix from the world of the stage at rest to rest space, in the stage's unit and axes.
    pub(super) from_world: Option<Matrix4<f64>>,
}

/// The strands of a file.
#[derive(Debug, Clone, PartialEq, Default)]
pub(super) struct PlainStrands {
    pub(super) curves: Curves,
    /// Whether each curve is a guide; empty where the format does not mark guides.
    pub(super) guide: Vec<bool>,
    /// Whether the format holds guides, around which a renderer grows the strands; a dense file may hold the
    /// strands themselves nevertheless.
    pub(super) holds_guides: bool,
    /// The groups that `curves.group` refers to; empty where the format has none.
    pub(super) groups: Vec<PlainGroup>,
    /// Attributes per curve; empty where the file has none.
    pub(super) attributes: Vec<StrandAttributes>,
    pub(super) declared: Declared,
    pub(super) rest: Rest,
    /// The curves as they are drawn, where the format draws curves over control points.
    pub(super) drawn: Option<DrawnCurves>,
    /// Remarks for the artist.
    pub(super) notes: Vec<String>,
}

/// Curves over control points, in the order of the file.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct DrawnCurves {
    /// The prims, with matrices to rest space in the file's unit and axes.
    pub(super) prims: Vec<SourcePrim>,
    /// Number of control points of each curve.
    pub(super) vertices: Vec<u32>,
}

/// A group of strands.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct PlainGroup {
    pub(super) name: String,
    /// Drawn width at root and tip where the file has one.
    pub(super) width: Option<[f64; 2]>,
}

/// Attributes of one strand.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct StrandAttributes {
    /// Factor on the length; the shape is scaled about the root.
    pub(super) length: f64,
    /// Factors on the material, in the order of [`Factors::NAMES`].
    pub(super) factors: [f64; Factors::NAMES.len()],
    /// Clump of the strand.
    pub(super) clump: Option<i32>,
}

impl StrandAttributes {
    /// Factors of 1, no clump.
    pub(super) const DEFAULT: StrandAttributes =
        StrandAttributes { length: 1.0, factors: [1.0; Factors::NAMES.len()], clump: None };
}

/// The mesh of a file.
#[derive(Debug, Clone, PartialEq, Default)]
pub(super) struct PlainMesh {
    pub(super) mesh: TriMesh,
    /// Vertices at the requested times; empty if the mesh does not deform.
    pub(super) samples: Vec<Vec<Vector3<f64>>>,
    /// What is painted on it; for USD what was asked for.
    pub(super) paint: Paint,
    pub(super) declared: Declared,
    pub(super) space: RestSpace,
    /// Remarks for the artist.
    pub(super) notes: Vec<String>,
}

/// What is painted on a mesh.
#[derive(Debug, Clone, PartialEq, Default)]
pub(super) struct Paint {
    pub(super) fields: Vec<Field>,
    /// Named sets of triangles, which may overlap.
    pub(super) parts: Vec<(String, Vec<u32>)>,
    /// Names of the fields that the file holds.
    pub(super) known: Vec<String>,
}

/// Name of the field of texture coordinates, whatever they are called in a file.
pub(super) const UV: &str = "uv";

/// Numbers at the corners of triangles.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Field {
    pub(super) name: String,
    /// How many numbers there are at a corner, 1 to 3; the others are 0.
    pub(super) size: usize,
    /// For each triangle the numbers at its corners. Vectors are in the axes of the file.
    pub(super) corners: Vec<[Vector3<f64>; 3]>,
}

impl Paint {
    /// Leaves out triangles that are not `kept`.
    pub(super) fn retain(&mut self, kept: &[bool]) {
        for field in &mut self.fields {
            let mut kept = kept.iter();
            field.corners.retain(|_| *kept.next().unwrap_or(&false));
        }
        let mut next = 0;
        let index: Vec<Option<u32>> = kept
            .iter()
            .map(|kept| {
                let at = next;
                next += u32::from(*kept);
                kept.then_some(at)
            })
            .collect();
        for (_, triangles) in &mut self.parts {
            *triangles = triangles.iter().filter_map(|t| index[*t as usize]).collect();
        }
    }
}

/// Time codes at which to sample a deforming mesh.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct SampleTimes {
    /// First time code.
    pub(super) start: f64,
    /// Step between time codes.
    pub(super) step: f64,
    /// Number of time codes.
    pub(super) count: usize,
    /// Time code of the first sample of the motion, and time codes per second: those of a glTF file are
    /// seconds.
    pub(super) origin: f64,
    pub(super) rate: f64,
    /// glTF only: the joint that the motion follows, and the animation.
    pub(super) joint: JointSelector,
    /// Path of a prim in the same file: a mesh that moves rigidly with it does not count as deforming.
    pub(super) carrier: Option<String>,
    /// Matrix from the world of the stage at rest to the rest space of the head, if the motion is of the same
    /// stage.
    pub(super) from_world: Option<Matrix4<f64>>,
}
