//! The groom: strand materials, the hierarchy of generalised cylinders (GC, "wisps"), guides and
//! render strands. All lengths in metres, Y up, in rest space (the space the head mesh was modelled in).

mod default_trees;
pub mod file;
pub(super) mod read;
mod write;

use super::Convention;
use crate::geometry::Friction;
use nalgebra::{UnitQuaternion, Vector3};

/// A groom, validated: every index in range, every number finite.
#[derive(Debug, Clone, PartialEq)]
pub struct Groom {
    /// Name, for reports.
    pub name: String,
    /// What whoever made it found, for reports: a line each.
    pub notes: Vec<String>,
    /// Unit and up axis of the file; the cache is written in them.
    pub convention: Convention,
    /// Strand materials; at least one.
    pub materials: Vec<Material>,
    /// Named groups of strands; at least one.
    pub groups: Vec<Group>,
    /// The simulated strands.
    pub guides: Guides,
    /// The GC hierarchy, one tree per coarse wisp. Every guide belongs to exactly one leaf.
    pub trees: Vec<Tree>,
    /// The render strands; empty where the groom has none (then only guides are written).
    pub strands: Strands,
}

/// What a strand is made of.
#[derive(Debug, Clone, PartialEq)]
pub struct Material {
    /// Name, for reports.
    pub name: String,
    /// Young's modulus E, Pa.
    pub young_modulus: f64,
    /// Shear modulus G, Pa.
    pub shear_modulus: f64,
    /// Density ρ, kg/m³.
    pub density: f64,
    /// Cross-section.
    pub section: RodSection,
    /// Natural strain: `None` takes the groom's own shape as natural; `Some` is a constant
    /// (κ1, κ2, τ) in the material frame, 1/m.
    pub natural: Option<Vector3<f64>>,
    /// Share (0..=1) of the load of gravity that the natural shape balances in the groom's pose, the strand made stiffer where that pose
    /// would not be stable (`docs/theory.md` §6); 0 = the natural shape is as it is given.
    pub sag_free: f64,
    /// Stiffness of bending and twist at the tip over that at the root, changing evenly between them along the strand.
    pub stiffness_at_tip: f64,
    /// Radius at the tip over that of `section`, which is the root's, changing evenly between them along the strand.
    pub radius_at_tip: f64,
    /// Frequencies, Hz, at root and tip and evenly between them, at which the strand would swing about the groom's pose as the head carries
    /// it were this pull all that moves it; 0 = none.
    pub goal: [f64; 2],
    /// Internal damping: Kelvin-Voigt relaxation time η/E, s (strain-rate stress = time × modulus).
    pub damping: f64,
    /// Internal damping at the tip over that at the root, changing evenly between them along the strand.
    pub damping_at_tip: f64,
    /// Friction of strand against body and strand, along the strand.
    pub friction: Friction,
    /// Friction at the tip over that at the root, changing evenly between them along the strand.
    pub friction_at_tip: f64,
    /// Friction across the strand over that along it: the cone of friction is elliptic, and what slides takes the way that
    /// dissipates most.
    pub friction_across: f64,
    /// Friction between strands that lie along each other over that between strands that cross at right angles, for slip along them.
    pub friction_parallel: f64,
    /// Force per length with which strands that lie along each other and touch cling together, N/m.
    pub cohesion: f64,
    /// How much render strands keep to the guides of their own leaf wisp: 1 to them alone, 0 no more than to others (0..=1).
    pub clumping: f64,
    /// Rate at which a strand loses what it moves otherwise than its coarse wisp, 1/s; 0 = none.
    pub wisp_friction: f64,
    /// Multiplier on the air drag of an isolated strand; 1 = physical.
    pub drag: f64,
    /// Share (0..=1) by which the bulk of the hair shields its inside from the air.
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
    /// Name, for reports.
    pub name: String,
    /// Index into [`Groom::materials`].
    pub material: u32,
    /// Drawn width (diameter) at root and tip, m.
    pub width: [f64; 2],
}

/// Curves as flat arrays: curve `c` owns `points[offsets[c]..offsets[c + 1]]`, root first, two points or more.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Curves {
    /// One more than there are curves; starts at 0.
    pub offsets: Vec<usize>,
    /// Vertices, m, rest space.
    pub points: Vec<Vector3<f64>>,
    /// Id of each curve, unique.
    pub id: Vec<i32>,
    /// Group of each curve, index into [`Groom::groups`].
    pub group: Vec<u32>,
    /// Texture coordinate of each root on the scalp.
    pub root_uv: Vec<[f32; 2]>,
}

/// The simulated strands.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Guides {
    /// Their curves.
    pub curves: Curves,
    /// Root frame of each (columns d1, d2, d3; d3 the tangent), or `None` to derive it.
    pub root_frame: Option<Vec<UnitQuaternion<f64>>>,
    /// What each has of its own.
    pub factors: Factors,
}

/// Factors of each guide on what its material says; of a property without any, none.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Factors {
    /// On Young's and the shear modulus.
    pub stiffness: Option<Vec<f64>>,
    /// On internal damping.
    pub damping: Option<Vec<f64>>,
    /// On friction.
    pub friction: Option<Vec<f64>>,
    /// On the drag of the air.
    pub drag: Option<Vec<f64>>,
    /// On the frequencies of the pull to the groom's pose.
    pub goal: Option<Vec<f64>>,
}

impl Factors {
    /// The properties by the names that they have in files.
    pub const NAMES: [&str; 5] = ["stiffness", "damping", "friction", "drag", "goal"];

    /// In the order of [`Factors::NAMES`].
    pub fn each(&self) -> [&Option<Vec<f64>>; 5] {
        [&self.stiffness, &self.damping, &self.friction, &self.drag, &self.goal]
    }

    /// From the order of [`Factors::NAMES`].
    pub fn of([stiffness, damping, friction, drag, goal]: [Option<Vec<f64>>; 5]) -> Self {
        Factors { stiffness, damping, friction, drag, goal }
    }
}

/// The render strands.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Strands {
    /// Their curves.
    pub curves: Curves,
    /// Leaf wisp of each: (tree, wisp in that tree).
    pub leaf: Vec<(u32, u32)>,
}

/// The GC hierarchy of one coarse wisp. Sections sit at the same arc-length fractions on all levels.
#[derive(Debug, Clone, PartialEq)]
pub struct Tree {
    /// Arc-length fractions of the sections, from 0 to 1, increasing; a strain node sits on every one.
    pub arc: Vec<f64>,
    /// The wisps: the coarse one first, parents before children.
    pub wisps: Vec<Wisp>,
}

/// One generalised cylinder.
#[derive(Debug, Clone, PartialEq)]
pub struct Wisp {
    /// Parent in the same tree; `None` for the coarse wisp (index 0) alone.
    pub parent: Option<u32>,
    /// Arc length of its centre line, m.
    pub length: f64,
    /// How many hairs it stands for.
    pub strand_count: u32,
    /// One section per entry of [`Tree::arc`].
    pub sections: Vec<Section>,
    /// The guides it holds, if it is a leaf; empty otherwise.
    pub guides: Vec<u32>,
}

/// A cross-section of a generalised cylinder.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Section {
    /// Centre, m, rest space.
    pub centre: Vector3<f64>,
    /// Frame (columns d1, d2, d3; d3 the tangent), rotation-minimising along the wisp.
    pub frame: UnitQuaternion<f64>,
    /// Radius of the disc that holds its strands, m.
    pub radius: f64,
}

impl Curves {
    /// Number of curves.
    pub fn len(&self) -> usize {
        self.offsets.len().saturating_sub(1)
    }

    /// Whether there is none.
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

    /// Some of the curves, by index, in that order.
    pub fn select(&self, which: impl IntoIterator<Item = usize>) -> Curves {
        let mut out = Curves { offsets: vec![0], ..Curves::default() };
        for c in which {
            out.points.extend_from_slice(self.curve(c));
            out.offsets.push(out.points.len());
            out.id.push(self.id[c]);
            out.group.push(self.group[c]);
            out.root_uv.push(self.root_uv[c]);
        }
        out
    }
}

impl Strands {
    /// Some of the strands, by index, in that order.
    pub fn select(&self, which: &[usize]) -> Strands {
        Strands {
            curves: self.curves.select(which.iter().copied()),
            leaf: which.iter().map(|&c| self.leaf[c]).collect(),
        }
    }
}

impl Groom {
    /// What guide `g` is made of: the material of its group, with its own factors.
    pub fn material_of(&self, g: usize) -> Material {
        let group = &self.groups[self.guides.curves.group[g] as usize];
        let mut m = self.materials[group.material as usize].clone();
        let [stiffness, damping, friction, drag, goal] =
            self.guides.factors.each().map(|factors| factors.as_ref().map_or(1.0, |factors| factors[g]));
        m.young_modulus *= stiffness;
        m.shear_modulus *= stiffness;
        m.damping *= damping;
        m.friction = m.friction.scaled(friction);
        m.drag *= drag;
        m.goal = m.goal.map(|hz| hz * goal);
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
    /// Human scalp hair (r = 40 µm).
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
