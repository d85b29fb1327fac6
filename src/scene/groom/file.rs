//! `groom.json` as it stands in the file: the one description of the format. Its JSON Schema is derived
//! from here; the doc comments are the schema's descriptions.

use crate::scene::convention::UpAxis;
use crate::scene::document::array::{Array, BufferFile};
use crate::scene::groom::Material;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A groom for hairbake: strand materials, guides, optional hierarchy of wisps, optional render strands.
/// Only `format`, `version` and `guides.points` are required.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[schemars(deny_unknown_fields)]
pub struct GroomFile {
    /// Always "hairbake-groom".
    pub format: GroomFormat,
    /// Version of the format: 1.
    #[schemars(range(min = 1, max = 1))]
    pub version: u32,
    /// Name, for reports; default: the name of the file.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub name: Option<String>,
    /// What whoever made the groom found, a line each; a bake's manifest and report repeat it.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub notes: Vec<String>,
    /// Metres in one unit of the lengths in this file that name no unit: 0.01 for centimetres; default 1.
    #[serde(default = "one")]
    #[schemars(range(min = 1e-6, max = 1e4))]
    pub metres_per_unit: f64,
    /// Axis that points up, "y" or "z", right-handed; default "y".
    #[serde(default)]
    pub up_axis: UpAxis,
    /// Binary files beside this one that hold long arrays.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub buffers: Vec<BufferFile>,
    /// Strand materials; default: one of human scalp hair.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub materials: Vec<MaterialFile>,
    /// Named sets of strands; default: one, of the first material.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub groups: Vec<GroupFile>,
    /// The simulated strands.
    pub guides: GuidesFile,
    /// The hierarchy of generalised cylinders; default: every guide is a wisp of its own.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub wisps: Option<WispsFile>,
    /// The render strands; default: none, only guides are written.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub strands: Option<StrandsFile>,
}

/// Marks the file as a groom.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub enum GroomFormat {
    /// A groom.
    #[serde(rename = "hairbake-groom")]
    Groom,
}

/// What a strand is made of. SI units whatever the unit of the file.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
#[schemars(deny_unknown_fields)]
pub struct MaterialFile {
    /// Name, by which groups refer to it.
    pub name: String,
    /// Young's modulus E, Pa: resistance to bending. Higher is stiffer.
    #[schemars(range(min = 1e3, max = 1e14))]
    pub young_modulus_pa: f64,
    /// Shear modulus G, Pa: resistance to twist. Higher is stiffer.
    #[schemars(range(min = 1e3, max = 1e14))]
    pub shear_modulus_pa: f64,
    /// Density, kg/m³. Higher hangs more.
    #[schemars(range(min = 1.0, max = 1e5))]
    pub density_kg_m3: f64,
    /// Cross-section of one strand.
    pub section: SectionFile,
    /// Curvatures about the two section axes and twist at rest, 1/m, the same all along; default: the
    /// groom's own shape is the rest shape.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(inner(range(min = -1e5, max = 1e5)))]
    pub natural_curvature_per_m: Option<[f64; 3]>,
    /// Share of gravity that the rest shape balances: 1 keeps the groom's pose with the head still, 0 lets it sag.
    /// Strands that would snap over in that pose are made stiffer, up to 100 times; the report tells how many.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub sag_free: f64,
    /// Stiffness at the tip over that at the root, changing evenly along the strand: below 1 the tips are softer. Default 1.
    #[serde(skip_serializing_if = "is_one")]
    #[schemars(range(min = 0.01, max = 100.0))]
    pub stiffness_at_tip: f64,
    /// Radius at the tip over that of the section, changing evenly along the strand: below 1 the tips are thinner, lighter with its square and softer with its
    /// fourth power. Default 1.
    #[serde(skip_serializing_if = "is_one")]
    #[schemars(range(min = 0.1, max = 10.0))]
    pub radius_at_tip: f64,
    /// Pull to the groom's pose as the head carries it, at root and tip and evenly between: the frequency at which a strand would swing
    /// about it, Hz. Higher holds the style more; what weighs g hangs g/(2πf)² off, 1 cm at 5 Hz. Default 0: none.
    #[serde(skip_serializing_if = "are_zero")]
    #[schemars(inner(range(min = 0.0, max = 100.0)))]
    pub goal_hz: [f64; 2],
    /// Internal damping: relaxation time η/E of bending and twist, s. Higher rings less.
    #[schemars(range(min = 0.0, max = 10.0))]
    pub damping_s: f64,
    /// Internal damping at the tip over that at the root, changing evenly along the strand: above 1 tips ring less. Default 1.
    #[serde(skip_serializing_if = "is_one")]
    #[schemars(range(min = 0.0, max = 100.0))]
    pub damping_at_tip: f64,
    /// Coulomb friction coefficient of strand on body and strand, of what slides along the strand.
    #[schemars(range(min = 0.0, max = 10.0))]
    pub friction: f64,
    /// The same of what sticks, not below `friction`; default: as `friction`.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 0.0, max = 10.0))]
    pub static_friction: Option<f64>,
    /// Friction at the tip over that at the root, changing evenly along the strand: above 1 tips hold on more. Default 1.
    #[serde(skip_serializing_if = "is_one")]
    #[schemars(range(min = 0.0, max = 100.0))]
    pub friction_at_tip: f64,
    /// Friction across a strand over friction along it: above 1 it rolls less easily than it slips through.
    #[serde(skip_serializing_if = "is_one")]
    #[schemars(range(min = 0.1, max = 10.0))]
    pub friction_across: f64,
    /// Friction between strands that lie along each other over that between strands that cross, for slip along them: below 1 strands that run together
    /// slide along each other more easily than they slide across. Default 0.5. It matters with `--contact full`.
    #[serde(skip_serializing_if = "is_half")]
    #[schemars(range(min = 0.01, max = 1.0))]
    pub friction_parallel: f64,
    /// Force per length with which strands that lie along each other and touch cling together, N/m: above some 1e-4, the weight of a hair, they keep
    /// together, wet ones at some 1e-2. Default 0: none. It matters with `--contact full`.
    #[serde(skip_serializing_if = "is_zero")]
    #[schemars(range(min = 0.0, max = 1.0))]
    pub cohesion_n_m: f64,
    /// How much render strands keep to the guides of their own leaf wisp. 0, the default: strands blend from guide to guide, smoothly over the borders of
    /// wisps; higher gathers them in locks, 1 lets them part between wisps. `hairbake import groom` sets 1 where strands have clumps.
    #[serde(skip_serializing_if = "is_zero")]
    #[schemars(range(min = 0.0, max = 1.0))]
    pub clumping: f64,
    /// Internal friction of a wisp: the rate at which a strand loses what it moves otherwise than the coarse wisp that it is in, 1/s; what they move
    /// together is as it was. Higher keeps wisps together: 10 is dense hair, 100 a lock. Default 0: none.
    #[serde(skip_serializing_if = "is_zero")]
    #[schemars(range(min = 0.0, max = 1e4))]
    pub wisp_friction_per_s: f64,
    /// Factor on the air drag of an isolated strand; 1 is physical, 0 is none.
    #[schemars(range(min = 0.0, max = 1e3))]
    pub drag: f64,
    /// Share by which the bulk of the hair shields its inside from the air.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub shielding: f64,
}

/// Cross-section of a strand: round or elliptic.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(untagged)]
#[schemars(deny_unknown_fields)]
pub enum SectionFile {
    /// Round.
    Round {
        /// Radius, m; human hair has 2e-5 to 6e-5.
        #[schemars(range(min = 1e-7, max = 0.05))]
        radius_m: f64,
    },
    /// Elliptic.
    Elliptic {
        /// Semi-axes along the first and second director of the section, m.
        #[schemars(inner(range(min = 1e-7, max = 0.05)))]
        semi_axes_m: [f64; 2],
    },
}

/// A named set of strands.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[schemars(deny_unknown_fields)]
pub struct GroupFile {
    /// Name, for reports.
    pub name: String,
    /// Material, by index or name; default 0.
    #[serde(default)]
    pub material: MaterialRef,
    /// Drawn diameter of the strands at root and tip, m; default: that of the material.
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

/// Number of points of each curve.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(untagged)]
pub enum Vertices {
    /// The same for all.
    All(u32),
    /// One for each.
    Each(Array<u32>),
}

/// The simulated strands, root first.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[schemars(deny_unknown_fields)]
pub struct GuidesFile {
    /// Points of each guide: one number for all, or one for each; at least 2; default: all points are one guide.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub vertices: Option<Vertices>,
    /// Positions in the space of the head's rest pose, scene units, guide after guide.
    pub points: Array<[f64; 3]>,
    /// Unique id of each; default: their order.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub id: Option<Array<i32>>,
    /// Group of each, index into `groups`; default 0.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub group: Option<Array<u32>>,
    /// Texture coordinate of each root; default (0, 0).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub root_uv: Option<Array<[f64; 2]>>,
    /// Frame of each root as a unit quaternion (w, x, y, z): its axes are the two section axes and the
    /// tangent; default: derived from the curve.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub root_frame_wxyz: Option<Array<[f64; 4]>>,
    /// Factors on what the material says, from 0 to 1000, one for each guide; default: none.
    #[serde(default, skip_serializing_if = "FactorsFile::is_empty")]
    pub factors: FactorsFile,
}

/// Factors of each guide on what its material says; default of each: 1.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[schemars(deny_unknown_fields)]
pub struct FactorsFile {
    /// On Young's modulus and the shear modulus; above 0.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub stiffness: Option<Array<f64>>,
    /// On internal damping.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub damping: Option<Array<f64>>,
    /// On friction.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub friction: Option<Array<f64>>,
    /// On the drag of the air.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub drag: Option<Array<f64>>,
    /// On the frequencies of `goal_hz`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub goal: Option<Array<f64>>,
}

impl FactorsFile {
    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        *self == FactorsFile::default()
    }
}

/// The render strands, root first.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[schemars(deny_unknown_fields)]
pub struct StrandsFile {
    /// Points of each strand: one number for all, or one for each; at least 2; default: all points are one strand.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub vertices: Option<Vertices>,
    /// Positions in the space of the head's rest pose, scene units, strand after strand.
    pub points: Array<[f64; 3]>,
    /// Unique id of each; default: their order.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub id: Option<Array<i32>>,
    /// Group of each, index into `groups`; default 0.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub group: Option<Array<u32>>,
    /// Texture coordinate of each root; default (0, 0).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub root_uv: Option<Array<[f64; 2]>>,
    /// Wisp of each: index of a wisp without children; the guide's index where the groom has no wisps.
    pub wisp: Array<u32>,
}

/// The hierarchy of generalised cylinders as a structure of arrays over all wisps: trees one after the
/// other, the coarse wisp of a tree first, parents before children. Sections of one tree lie at the same
/// arc-length fractions on all its levels.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[schemars(deny_unknown_fields)]
pub struct WispsFile {
    /// Parent of each wisp, index into all wisps; -1 for a coarse wisp, which starts a tree.
    pub parent: Array<i32>,
    /// Arc length of the centre line of each wisp, scene units.
    pub length: Array<f64>,
    /// Number of hairs that each wisp stands for; at least 1.
    pub strand_count: Array<u32>,
    /// Number of sections of each tree; at least 2.
    pub sections: Array<u32>,
    /// Arc-length fractions of the sections, tree after tree: from 0 to 1, increasing.
    pub arc: Array<f64>,
    /// Centres of the sections in the space of the head's rest pose, scene units, wisp after wisp.
    pub centre: Array<[f64; 3]>,
    /// Frames of the sections as unit quaternions (w, x, y, z): two section axes and the tangent.
    pub frame_wxyz: Array<[f64; 4]>,
    /// Radii of the sections, scene units.
    pub radius: Array<f64>,
    /// Number of guides of each wisp: at least 1 where it has no children, 0 where it has.
    pub guide_count: Array<u32>,
    /// The guides of each wisp, indices, wisp after wisp; every guide once.
    pub guides: Array<u32>,
}

impl Default for MaterialFile {
    fn default() -> Self {
        MaterialFile::from(&Material::default())
    }
}

impl Default for MaterialRef {
    fn default() -> Self {
        MaterialRef::Index(0)
    }
}

fn one() -> f64 {
    1.0
}

fn are_zero(goal: &[f64; 2]) -> bool {
    *goal == [0.0; 2]
}

// Serde hands over a reference.
#[allow(clippy::trivially_copy_pass_by_ref)]
fn is_one(x: &f64) -> bool {
    *x == 1.0
}

#[allow(clippy::trivially_copy_pass_by_ref)]
fn is_half(x: &f64) -> bool {
    *x == 0.5
}

#[allow(clippy::trivially_copy_pass_by_ref)]
fn is_zero(x: &f64) -> bool {
    *x == 0.0
}
