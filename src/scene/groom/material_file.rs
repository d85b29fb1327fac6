//! Strand materials in `groom.json`.

use super::model::{Material, RodSection};
use crate::geometry::Friction;
use nalgebra::Vector3;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Physical properties of strands, in SI units whatever the scene unit. Properties that change from root to
/// tip change linearly with arc length.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
#[schemars(deny_unknown_fields)]
pub struct MaterialFile {
    /// Name by which groups refer to it.
    pub name: String,
    /// Young's modulus E, Pa: resistance to bending. Higher is stiffer. Default: human hair.
    #[schemars(range(min = 1e3, max = 1e14))]
    pub young_modulus_pa: f64,
    /// Shear modulus G, Pa: resistance to twist. Higher is stiffer. Default: human hair.
    #[schemars(range(min = 1e3, max = 1e14))]
    pub shear_modulus_pa: f64,
    /// Density, kg/m³. Higher is heavier and sags more. Default: human hair.
    #[schemars(range(min = 1.0, max = 1e5))]
    pub density_kg_m3: f64,
    /// Cross-section at the root. A thicker strand is heavier with the square and stiffer with the fourth
    /// power of its radius.
    pub section: SectionFile,
    /// Natural (unstressed) curvatures about the two section axes and twist, 1/m, constant along the strand.
    /// Higher is curlier. Default: the curvature of each guide in the groom.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(inner(range(min = -1e5, max = 1e5)))]
    pub natural_curvature_per_m: Option<[f64; 3]>,
    /// Share of gravity that the natural shape compensates where no body carries the hair: with 1 the groom
    /// keeps its pose while the head is still, with 0 it sags. Strands whose pose would be unstable are made
    /// up to 100 times stiffer near the root; the report counts them.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub sag_free: f64,
    /// Stiffness at the tip relative to the root. Below 1 tips are softer. Default 1.
    #[serde(skip_serializing_if = "is_one")]
    #[schemars(range(min = 0.01, max = 100.0))]
    pub stiffness_at_tip: f64,
    /// Radius at the tip relative to the root. Below 1 tips are thinner: lighter with the square and softer
    /// with the fourth power of the radius. Default 1.
    #[serde(skip_serializing_if = "is_one")]
    #[schemars(range(min = 0.1, max = 10.0))]
    pub radius_at_tip: f64,
    /// Pull to the groom's pose, carried along by the head, at root and tip: the frequency at which a strand
    /// would oscillate about that pose, Hz. Higher holds the style more firmly. Under gravity g, a strand of
    /// frequency f hangs g/(2πf)² below the pose: 1 cm at 5 Hz. Default 0: no pull.
    #[serde(skip_serializing_if = "are_zero")]
    #[schemars(inner(range(min = 0.0, max = 100.0)))]
    pub goal_hz: [f64; 2],
    /// Weight of animated goals (`goals` of the animation), 0 to 1. Lower follows the animation less.
    /// Default 1.
    #[serde(skip_serializing_if = "is_one")]
    #[schemars(range(min = 0.0, max = 1.0))]
    pub goal_weight: f64,
    /// Internal damping of bending and twist: Kelvin-Voigt relaxation time η/E, s. Higher makes strands
    /// oscillate less.
    #[schemars(range(min = 0.0, max = 10.0))]
    pub damping_s: f64,
    /// Internal damping at the tip relative to the root. Above 1 tips oscillate less. Default 1.
    #[serde(skip_serializing_if = "is_one")]
    #[schemars(range(min = 0.0, max = 100.0))]
    pub damping_at_tip: f64,
    /// Coefficient of kinetic (sliding) Coulomb friction with colliders and other strands, for slip along the
    /// strand. Higher slides less.
    #[schemars(range(min = 0.0, max = 10.0))]
    pub friction: f64,
    /// Coefficient of static friction, not below `friction`. Higher sticks longer. Default: `friction`.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 0.0, max = 10.0))]
    pub static_friction: Option<f64>,
    /// Friction at the tip relative to the root. Above 1 tips slide less. Default 1.
    #[serde(skip_serializing_if = "is_one")]
    #[schemars(range(min = 0.0, max = 100.0))]
    pub friction_at_tip: f64,
    /// Friction for slip across the strand relative to slip along it. Above 1 strands roll less easily than
    /// they slip lengthwise. Default 1.
    #[serde(skip_serializing_if = "is_one")]
    #[schemars(range(min = 0.1, max = 10.0))]
    pub friction_across: f64,
    /// Friction between parallel strands relative to strands that cross at right angles, for slip along them.
    /// Below 1 strands of a bundle slide past each other more easily. Default 0.5.
    #[serde(skip_serializing_if = "is_half")]
    #[schemars(range(min = 0.01, max = 1.0))]
    pub friction_parallel: f64,
    /// Cohesion: force per length between parallel strands that touch, N/m. Higher keeps them together: above
    /// about 1e-4, the weight of a hair, they cling; wet hair has about 1e-2. With `contact` "volume" it adds
    /// to the load of friction only. Default 0: none.
    #[serde(skip_serializing_if = "is_zero")]
    #[schemars(range(min = 0.0, max = 1.0))]
    pub cohesion_n_m: f64,
    /// How closely render strands follow the guides of their own wisp. With 0 they blend smoothly between the
    /// guides of neighbouring wisps; higher gathers them in locks; with 1 they follow their own wisp only,
    /// and wisps may separate. Default 0. `hairbake import groom` sets 1 for strands with clumps.
    #[serde(skip_serializing_if = "is_zero")]
    #[schemars(range(min = 0.0, max = 1.0))]
    pub clumping: f64,
    /// Friction inside a wisp: the rate at which the velocity of a guide relative to the mean of its coarse
    /// wisp decays, 1/s. The mean motion is not damped. Higher keeps wisps together: 10 is dense hair, 100 a
    /// lock. Default 0: none.
    #[serde(skip_serializing_if = "is_zero")]
    #[schemars(range(min = 0.0, max = 1e4))]
    pub wisp_friction_per_s: f64,
    /// Factor on the air drag of an isolated strand. Higher moves more with the wind and slows down sooner; 1
    /// is physical, 0 is a vacuum.
    #[schemars(range(min = 0.0, max = 1e3))]
    pub drag: f64,
    /// How much dense hair shields its inside from the air: the share of drag that it loses at most. Higher
    /// moves less with the wind inside; 0 treats every strand as isolated.
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
        /// Radius, m. Human hair has 2e-5 to 6e-5.
        #[schemars(range(min = 1e-7, max = 0.05))]
        radius_m: f64,
    },
    /// Elliptic.
    Elliptic {
        /// Semi-axes along the first and the second section axis, m.
        #[schemars(inner(range(min = 1e-7, max = 0.05)))]
        semi_axes_m: [f64; 2],
    },
}

impl Default for MaterialFile {
    fn default() -> Self {
        MaterialFile::from(&Material::default())
    }
}

impl From<&MaterialFile> for Material {
    fn from(file: &MaterialFile) -> Self {
        Material {
            name: file.name.clone(),
            young_modulus: file.young_modulus_pa,
            shear_modulus: file.shear_modulus_pa,
            density: file.density_kg_m3,
            section: match file.section {
                SectionFile::Round { radius_m } => RodSection { a1: radius_m, a2: radius_m },
                SectionFile::Elliptic { semi_axes_m: [a1, a2] } => RodSection { a1, a2 },
            },
            natural: file.natural_curvature_per_m.map(Vector3::from),
            sag_free: file.sag_free,
            stiffness_at_tip: file.stiffness_at_tip,
            radius_at_tip: file.radius_at_tip,
            goal: file.goal_hz,
            goal_weight: file.goal_weight,
            damping: file.damping_s,
            damping_at_tip: file.damping_at_tip,
            friction: Friction::new(file.friction, file.static_friction),
            friction_at_tip: file.friction_at_tip,
            friction_across: file.friction_across,
            friction_parallel: file.friction_parallel,
            cohesion: file.cohesion_n_m,
            clumping: file.clumping,
            wisp_friction: file.wisp_friction_per_s,
            drag: file.drag,
            shielding: file.shielding,
        }
    }
}

impl From<&Material> for MaterialFile {
    fn from(m: &Material) -> Self {
        let RodSection { a1, a2 } = m.section;
        MaterialFile {
            name: m.name.clone(),
            young_modulus_pa: m.young_modulus,
            shear_modulus_pa: m.shear_modulus,
            density_kg_m3: m.density,
            section: if a1 == a2 {
                SectionFile::Round { radius_m: a1 }
            } else {
                SectionFile::Elliptic { semi_axes_m: [a1, a2] }
            },
            natural_curvature_per_m: m.natural.map(Into::into),
            sag_free: m.sag_free,
            stiffness_at_tip: m.stiffness_at_tip,
            radius_at_tip: m.radius_at_tip,
            goal_hz: m.goal,
            goal_weight: m.goal_weight,
            damping_s: m.damping,
            damping_at_tip: m.damping_at_tip,
            friction: m.friction.mu_k,
            static_friction: (m.friction.mu_s != m.friction.mu_k).then_some(m.friction.mu_s),
            friction_at_tip: m.friction_at_tip,
            friction_across: m.friction_across,
            friction_parallel: m.friction_parallel,
            cohesion_n_m: m.cohesion,
            clumping: m.clumping,
            wisp_friction_per_s: m.wisp_friction,
            drag: m.drag,
            shielding: m.shielding,
        }
    }
}

fn are_zero(goal: &[f64; 2]) -> bool {
    *goal == [0.0; 2]
}

// serde passes a reference.
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
