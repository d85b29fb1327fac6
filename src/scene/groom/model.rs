//! The groom: strand materials, guides, render strands, and the hierarchy of wisps (generalised cylinders).
//! Lengths are in metres, Y up, in rest space, the space in which the head was modelled.

use super::source::SourceCurves;
use crate::geometry::Friction;
use crate::math::polyline;
use crate::scene::convention::Convention;
use crate::scene::origin::Origin;
use crate::scene::root_binding::RootBinding;
use nalgebra::{UnitQuaternion, Vector3};

/// A validated groom: every index is in range, every number finite.
#[derive(Debug, Clone, PartialEq)]
pub struct Groom {
    /// Name for reports.
    pub name: String,
    /// Remarks of the importer for reports, one per line.
    pub notes: Vec<String>,
    /// Where guides and strands come from.
    pub origin: Option<Origin>,
    /// Unit and up axis of the file and of the cache.
    pub convention: Convention,
    /// Strand materials; at least one.
    pub materials: Vec<Material>,
    /// Named groups of strands; at least one.
    pub groups: Vec<Group>,
    /// The simulated strands.
    pub guides: Guides,
    /// The hierarchy of wisps, one tree per coarse wisp. Every guide belongs to exactly one leaf.
    pub trees: Vec<Tree>,
    /// The render strands; if there are none, only guides are written.
    pub strands: Strands,
    /// The USD curves that guides and strands were read from.
    pub source: Option<SourceCurves>,
}

/// Physical properties of a strand. Properties that change from root to tip change linearly with arc length.
#[derive(Debug, Clone, PartialEq)]
pub struct Material {
    /// Name for reports.
    pub name: String,
    /// Young's modulus E, Pa.
    pub young_modulus: f64,
    /// Shear modulus G, Pa.
    pub shear_modulus: f64,
    /// Density ρ, kg/m³.
    pub density: f64,
    /// Cross-section at the root.
    pub section: RodSection,
    /// Natural strain (κ1, κ2, τ) in the material frame, 1/m, constant along the strand; `None` for the
    /// strain of the groom's own shape.
    pub natural: Option<Vector3<f64>>,
    /// Share (0..=1) of gravity that the natural shape balances in the groom's pose. Strands for which that
    /// pose would be unstable are made stiffer (`docs/theory.md` §6). 0: the natural shape is used as it is
    /// given.
    pub sag_free: f64,
    /// Stiffness of bending and twist at the tip relative to the root.
    pub stiffness_at_tip: f64,
    /// Radius at the tip relative to the root.
    pub radius_at_tip: f64,
    /// Pull to the groom's pose, carried by the head, at root and tip: the frequency at which a strand would
    /// oscillate about that pose under this pull alone, Hz; 0: none.
    pub goal: [f64; 2],
    /// Weight (0..=1) of animated goals.
    pub goal_weight: f64,
    /// Internal damping: Kelvin-Voigt relaxation time η/E, s (stress = time × modulus × strain rate).
    pub damping: f64,
    /// Internal damping at the tip relative to the root.
    pub damping_at_tip: f64,
    /// Friction with colliders and other strands, for slip along the strand.
    pub friction: Friction,
    /// Friction at the tip relative to the root.
    pub friction_at_tip: f64,
    /// Friction across the strand relative to friction along it: the friction cone is elliptic, and slip
    /// follows the direction of maximal dissipation.
    pub friction_across: f64,
    /// Friction between parallel strands relative to strands that cross at right angles, for slip along them.
    pub friction_parallel: f64,
    /// Cohesion: force per length between parallel strands that touch, N/m.
    pub cohesion: f64,
    /// How closely render strands follow the guides of their own leaf wisp (0..=1): 1 those alone, 0 no more
    /// than others.
    pub clumping: f64,
    /// Rate at which the velocity of a strand relative to the mean of its coarse wisp decays, 1/s; 0: none.
    pub wisp_friction: f64,
    /// Factor on the air drag of an isolated strand; 1 is physical.
    pub drag: f64,
    /// Share (0..=1) of the drag that strands inside dense hair lose at most.
    pub shielding: f64,
}

/// Cross-section of a strand; semi-axes along the material directors d1 and d2, m.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RodSection {
    /// Semi-axis along d1, m.
    pub a1: f64,
    /// Semi-axis along d2, m.
    pub a2: f64,
}

/// A named set of strands.
#[derive(Debug, Clone, PartialEq)]
pub struct Group {
    /// Name for reports.
    pub name: String,
    /// Index into [`Groom::materials`].
    pub material: u32,
    /// Rendered width (diameter) at root and tip, m.
    pub width: [f64; 2],
}

/// Curves as flat arrays: curve `c` has the points `points[offsets[c]..offsets[c + 1]]`, root first, at least
/// two.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Curves {
    /// Start of each curve in `points`, then the number of points.
    pub offsets: Vec<usize>,
    /// Vertices, m, rest space.
    pub points: Vec<Vector3<f64>>,
    /// Id of each curve, unique.
    pub id: Vec<i32>,
    /// Group of each curve, index into [`Groom::groups`].
    pub group: Vec<u32>,
    /// Texture coordinates of each root on the scalp.
    pub root_uv: Vec<[f32; 2]>,
    /// The place of a skin that carries each root; empty if the head carries all.
    pub skin: Vec<RootBinding>,
}

/// The simulated strands.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Guides {
    /// Their curves.
    pub curves: Curves,
    /// Root frame of each guide (columns d1, d2, d3; d3 is the tangent); `None` to derive it from the curve.
    pub root_frame: Option<Vec<UnitQuaternion<f64>>>,
    /// Factors on properties of the material.
    pub factors: Factors,
}

/// Factors on properties of the material, one per guide; `None` for 1.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Factors {
    /// On Young's modulus and the shear modulus.
    pub stiffness: Option<Vec<f64>>,
    /// On internal damping.
    pub damping: Option<Vec<f64>>,
    /// On friction.
    pub friction: Option<Vec<f64>>,
    /// On air drag.
    pub drag: Option<Vec<f64>>,
    /// On the frequencies [`Material::goal`].
    pub goal: Option<Vec<f64>>,
    /// On the weight of animated goals, [`Material::goal_weight`].
    pub goal_weight: Option<Vec<f64>>,
}

impl Factors {
    /// The names of the properties in files.
    pub const NAMES: [&str; 6] = ["stiffness", "damping", "friction", "drag", "goal", "goal_weight"];

    /// The properties in the order of [`Factors::NAMES`].
    pub fn each(&self) -> [&Option<Vec<f64>>; 6] {
        [&self.stiffness, &self.damping, &self.friction, &self.drag, &self.goal, &self.goal_weight]
    }

    /// From the properties in the order of [`Factors::NAMES`].
    pub fn of([stiffness, damping, friction, drag, goal, goal_weight]: [Option<Vec<f64>>; 6]) -> Self {
        Factors { stiffness, damping, friction, drag, goal, goal_weight }
    }
}

/// The render strands.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Strands {
    /// Their curves.
    pub curves: Curves,
    /// Leaf wisp of each strand: (tree, wisp in that tree); (guide, 0) if the groom has no trees.
    pub leaf: Vec<(u32, u32)>,
}

/// The hierarchy of wisps below one coarse wisp. All its wisps have their sections at the same arc-length
/// fractions.
#[derive(Debug, Clone, PartialEq)]
pub struct Tree {
    /// Arc-length fractions of the sections, increasing from 0 to 1; also those of the strain nodes.
    pub arc: Vec<f64>,
    /// The wisps: the coarse one first, parents before children.
    pub wisps: Vec<Wisp>,
}

/// A wisp: a generalised cylinder around a bundle of strands.
#[derive(Debug, Clone, PartialEq)]
pub struct Wisp {
    /// Parent in the same tree; `None` for the coarse wisp (index 0) alone.
    pub parent: Option<u32>,
    /// Arc length of its centre line, m.
    pub length: f64,
    /// Number of hairs that it represents.
    pub strand_count: u32,
    /// One section per entry of [`Tree::arc`].
    pub sections: Vec<Section>,
    /// Its guides if it is a leaf; otherwise empty.
    pub guides: Vec<u32>,
}

/// A cross-section of a wisp.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Section {
    /// Centre, m, rest space.
    pub centre: Vector3<f64>,
    /// Frame (columns d1, d2, d3; d3 is the tangent), rotation-minimising along the wisp.
    pub frame: UnitQuaternion<f64>,
    /// Radius of the disc that contains its strands, m.
    pub radius: f64,
}

impl Curves {
    /// Number of curves.
    pub fn len(&self) -> usize {
        self.offsets.len().saturating_sub(1)
    }

    /// True if there are no curves.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The first vertex of every curve.
    pub fn roots(&self) -> impl Iterator<Item = Vector3<f64>> + '_ {
        self.offsets.iter().take(self.len()).map(|&start| self.points[start])
    }

    /// Vertices of curve `c`.
    pub fn curve(&self, c: usize) -> &[Vector3<f64>] {
        &self.points[self.offsets[c]..self.offsets[c + 1]]
    }

    /// The curves `which`, by index, in that order.
    pub fn select(&self, which: impl IntoIterator<Item = usize>) -> Curves {
        let mut out = Curves { offsets: vec![0], ..Curves::default() };
        for c in which {
            out.points.extend_from_slice(self.curve(c));
            out.offsets.push(out.points.len());
            out.id.push(self.id[c]);
            out.group.push(self.group[c]);
            out.root_uv.push(self.root_uv[c]);
            out.skin.extend(self.skin.get(c).cloned());
        }
        out
    }
}

impl Strands {
    /// The strands `which`, by index, in that order.
    pub fn select(&self, which: &[usize]) -> Strands {
        Strands {
            curves: self.curves.select(which.iter().copied()),
            leaf: which.iter().map(|&c| self.leaf[c]).collect(),
        }
    }
}

impl Groom {
    /// The longest strand, m.
    pub fn reach(&self) -> f64 {
        let curves = [&self.guides.curves, &self.strands.curves];
        let lengths =
            curves.into_iter().flat_map(|all| (0..all.len()).map(|c| polyline::length(all.curve(c))));
        lengths.fold(0.0, f64::max)
    }

    /// The material of guide `g`: that of its group, times its own factors.
    pub fn material_of(&self, g: usize) -> Material {
        let group = &self.groups[self.guides.curves.group[g] as usize];
        let mut m = self.materials[group.material as usize].clone();
        let [stiffness, damping, friction, drag, goal, goal_weight] =
            self.guides.factors.each().map(|factors| factors.as_ref().map_or(1.0, |factors| factors[g]));
        m.young_modulus *= stiffness;
        m.shear_modulus *= stiffness;
        m.damping *= damping;
        m.friction = m.friction.scaled(friction);
        m.drag *= drag;
        m.goal = m.goal.map(|hz| hz * goal);
        m.goal_weight *= goal_weight;
        m
    }
}

impl RodSection {
    /// Area S = π a1 a2, m².
    pub fn area(&self) -> f64 {
        std::f64::consts::PI * self.a1 * self.a2
    }

    /// Second moments of area (I1 about d1, I2 about d2) and torsion constant J of an ellipse, m⁴
    /// (Timoshenko & Goodier 1970, §108).
    pub fn moments(&self) -> [f64; 3] {
        let (a, b) = (self.a1, self.a2);
        let q = std::f64::consts::FRAC_PI_4;
        [q * a * b.powi(3), q * a.powi(3) * b, 4.0 * q * (a * b).powi(3) / (a * a + b * b)]
    }
}

impl Default for Material {
    /// Human scalp hair, radius 40 µm. Moduli: Robbins 1994, appendix.
    fn default() -> Self {
        Material {
            name: "hair".into(),
            young_modulus: 3.89e9,
            shear_modulus: 0.89e9,
            density: 1320.0,
            section: RodSection { a1: 4e-5, a2: 4e-5 },
            natural: None,
            sag_free: 0.0,
            stiffness_at_tip: 1.0,
            radius_at_tip: 1.0,
            goal: [0.0; 2],
            goal_weight: 1.0,
            damping: 0.005,
            damping_at_tip: 1.0,
            friction: 0.3.into(),
            friction_at_tip: 1.0,
            friction_across: 1.0,
            friction_parallel: 0.5,
            cohesion: 0.0,
            clumping: 0.0,
            wisp_friction: 0.0,
            drag: 1.0,
            shielding: 0.9,
        }
    }
}
