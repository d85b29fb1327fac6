//! The structure of `groom.json`. These structs are the only description of the format: its JSON Schema is
//! derived from them, and their doc comments are the descriptions in the schema.

use super::material_file::MaterialFile;
use crate::math::basis_curve::{Basis, Wrap};
use crate::scene::convention::UpAxis;
use crate::scene::json::array::{Array, BufferFile};
use crate::scene::origin::Origin;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A groom for hairbake: strand materials, guides, optionally a hierarchy of wisps and render strands.
/// Required are `format`, `version` and `guides.points`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[schemars(deny_unknown_fields)]
pub struct GroomFile {
    /// Always "hairbake-groom".
    pub format: GroomFormat,
    /// Version of the format: 1.
    #[schemars(range(min = 1, max = 1))]
    pub version: u32,
    /// Name for reports. Default: the name of the file.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub name: Option<String>,
    /// Remarks of the importer, one per line. The manifest and the report of a bake repeat them.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub notes: Vec<String>,
    /// Where guides and strands come from.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub origin: Option<Origin>,
    /// Metres per scene unit, the unit of all lengths in this file without a unit in their key: 0.01 for
    /// centimetres. Default 1.
    #[serde(default = "one")]
    #[schemars(range(min = 1e-6, max = 1e4))]
    pub metres_per_unit: f64,
    /// Axis that points up, "y" or "z"; axes are right-handed. Default "y".
    #[serde(default)]
    pub up_axis: UpAxis,
    /// Binary files next to this one that hold long arrays.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub buffers: Vec<BufferFile>,
    /// Strand materials. Default: one, human scalp hair.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub materials: Vec<MaterialFile>,
    /// Named sets of strands, each with a material and a width. Default: one set, of the first material.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub groups: Vec<GroupFile>,
    /// The simulated strands.
    pub guides: GuidesFile,
    /// The hierarchy of wisps (generalised cylinders). Default: every guide is a wisp of its own.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub wisps: Option<WispsFile>,
    /// The render strands. Default: none; then only guides are written.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub strands: Option<StrandsFile>,
    /// The USD curves that guides and strands were read from. `import groom` writes it; a bake in over mode
    /// needs it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub source: Option<SourceFile>,
}

/// Marks the file as a groom.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub enum GroomFormat {
    /// A groom.
    #[serde(rename = "hairbake-groom")]
    Groom,
}

/// A named set of strands.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[schemars(deny_unknown_fields)]
pub struct GroupFile {
    /// Name for reports, ties and partial bakes.
    pub name: String,
    /// Its material, by index or name. Default 0.
    #[serde(default)]
    pub material: MaterialRef,
    /// Rendered width (diameter) of the strands at root and tip, m. Higher covers more. Default: the diameter
    /// of the material.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(inner(range(min = 0.0, max = 0.1)))]
    pub width_m: Option<[f64; 2]>,
}

/// A material, by index or name.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(untagged)]
pub enum MaterialRef {
    /// Index into `materials`.
    Index(u32),
    /// Name of a material.
    Name(String),
}

/// Number of points per curve.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(untagged)]
pub enum Vertices {
    /// One number for all curves.
    All(u32),
    /// One number for each curve.
    Each(Array<u32>),
}

/// The simulated strands.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[schemars(deny_unknown_fields)]
pub struct GuidesFile {
    /// Points per guide, at least 2: one number for all, or one for each. Default: all points are one guide.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub vertices: Option<Vertices>,
    /// Points in the rest space of the head, scene units, guide after guide, root first.
    pub points: Array<[f64; 3]>,
    /// Unique id of each guide. Default: its index.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub id: Option<Array<i32>>,
    /// Group of each guide: index into `groups`. Default 0.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub group: Option<Array<u32>>,
    /// Texture coordinates of each root. Default (0, 0).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub root_uv: Option<Array<[f64; 2]>>,
    /// Frame of each root as a unit quaternion (w, x, y, z). Its axes are the two section axes and the
    /// tangent. Default: derived from the curve.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub root_frame_wxyz: Option<Array<[f64; 4]>>,
    /// Factors on properties of the material, one per guide, 0 to 1000. Default: none.
    #[serde(default, skip_serializing_if = "FactorsFile::is_empty")]
    pub factors: FactorsFile,
}

/// Factors on properties of the material, one per guide. Default: 1.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[schemars(deny_unknown_fields)]
pub struct FactorsFile {
    /// Factor on Young's modulus and the shear modulus, 0.001 to 1000. Higher is stiffer.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub stiffness: Option<Array<f64>>,
    /// Factor on internal damping. Higher oscillates less.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub damping: Option<Array<f64>>,
    /// Factor on friction. Higher slides less.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub friction: Option<Array<f64>>,
    /// Factor on air drag. Higher moves more with the wind.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub drag: Option<Array<f64>>,
    /// Factor on the frequencies `goal_hz`. Higher holds the style more firmly.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub goal: Option<Array<f64>>,
    /// Factor on the weight of animated goals, 0 to 1. Lower follows the animation less.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub goal_weight: Option<Array<f64>>,
}

impl FactorsFile {
    /// True if no property has factors.
    pub fn is_empty(&self) -> bool {
        *self == FactorsFile::default()
    }
}

/// The render strands.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[schemars(deny_unknown_fields)]
pub struct StrandsFile {
    /// Points per strand, at least 2: one number for all, or one for each. Default: all points are one
    /// strand.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub vertices: Option<Vertices>,
    /// Points in the rest space of the head, scene units, strand after strand, root first.
    pub points: Array<[f64; 3]>,
    /// Unique id of each strand. Default: its index.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub id: Option<Array<i32>>,
    /// Group of each strand: index into `groups`. Default 0.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub group: Option<Array<u32>>,
    /// Texture coordinates of each root. Default (0, 0).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub root_uv: Option<Array<[f64; 2]>>,
    /// Wisp of each strand: index of a leaf wisp (one without children), or of a guide if the groom has no
    /// wisps.
    pub wisp: Array<u32>,
}

/// The hierarchy of wisps (generalised cylinders), as arrays over all wisps: tree after tree, the coarse wisp
/// of a tree first, parents before children. All wisps of a tree have their sections at the same arc-length
/// fractions.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[schemars(deny_unknown_fields)]
pub struct WispsFile {
    /// Parent of each wisp: index of a wisp, or -1 for a coarse wisp, which starts a tree.
    pub parent: Array<i32>,
    /// Arc length of the centre line of each wisp, scene units.
    pub length: Array<f64>,
    /// Number of hairs that each wisp represents, at least 1.
    pub strand_count: Array<u32>,
    /// Number of sections of each tree, at least 2.
    pub sections: Array<u32>,
    /// Arc-length fractions of the sections, tree after tree, increasing from 0 to 1.
    pub arc: Array<f64>,
    /// Centres of the sections in the rest space of the head, scene units, wisp after wisp.
    pub centre: Array<[f64; 3]>,
    /// Frames of the sections as unit quaternions (w, x, y, z). The axes are the two section axes and the
    /// tangent.
    pub frame_wxyz: Array<[f64; 4]>,
    /// Radii of the sections, scene units.
    pub radius: Array<f64>,
    /// Number of guides of each wisp: at least 1 for a leaf wisp, 0 for a wisp with children.
    pub guide_count: Array<u32>,
    /// The guides of each wisp, wisp after wisp: indices of guides, every guide once.
    pub guides: Array<u32>,
}

/// The USD curves that guides and strands were read from, as they are drawn.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[schemars(deny_unknown_fields)]
pub struct SourceFile {
    /// Where they were read.
    pub origin: Origin,
    /// The prims, in the order of the stage.
    pub prims: Vec<SourcePrimFile>,
    /// Number of control points of each curve, prim after prim.
    pub vertices: Array<u32>,
    /// Factor by which each curve was lengthened about its root. Default: 1.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub length: Option<Array<f64>>,
    /// The curve that each render strand was read from, counted through all prims; -1 for none. Default:
    /// none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub strands: Option<Array<i32>>,
    /// The curve that each guide was read from; -1 for none. Default: none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub guides: Option<Array<i32>>,
}

/// A prim of [`SourceFile`].
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[schemars(deny_unknown_fields)]
pub struct SourcePrimFile {
    /// Path of the prim.
    pub path: String,
    /// Basis of its curves.
    pub basis: Basis,
    /// How they end.
    pub wrap: Wrap,
    /// Number of curves.
    pub curves: u32,
    /// Matrix from the space of the prim to rest space in metres, Y up: four rows, for column vectors.
    pub to_rest_m: [[f64; 4]; 4],
}

impl Default for MaterialRef {
    fn default() -> Self {
        MaterialRef::Index(0)
    }
}

fn one() -> f64 {
    1.0
}
