//! How fur is grown.

use crate::import::groom::build::BuildOptions;
use crate::import::groom::generate::Generation;
use crate::import::groom::hierarchy::HierarchyShape;
use crate::import::groom::resample::Resample;
use crate::import::source::Source;
use crate::scene::{Group, Material};
use crate::{Error, Result};
use nalgebra::Vector3;
use std::path::PathBuf;

/// Default number of guides.
pub const GROWN_GUIDES: usize = 2000;
/// Default number of strands for each guide.
pub const STRANDS_PER_GUIDE: usize = 25;
/// Default length, as a share of the diagonal of the mesh's bounding box.
pub const LENGTH_SHARE: f64 = 0.03;
/// Clumps of the finer scale for each of the coarser.
const FINE_PER_COARSE: usize = 6;

/// What [`grow`](super::convert::grow) grows.
#[derive(Debug, Clone, PartialEq)]
pub struct GrowOptions {
    /// Name of the groom and of its group.
    pub name: String,
    /// Folder in which the groom will be written; the path of its origin is relative to it.
    pub folder: PathBuf,
    /// The mesh.
    pub mesh: Source,
    /// Parts of the mesh that bear fur; empty for all.
    pub parts: Vec<String>,
    /// Field that the density of the strands is multiplied by, 0 to 1; where it is 0 there are no guides.
    pub density_field: Option<String>,
    /// Number of guides.
    pub guides: usize,
    /// Number of strands.
    pub strands: StrandCount,
    /// Vertices of a strand, and of a guide; `None` for 8, or as many as its curls need.
    pub vertices: Option<usize>,
    /// Seed of all random numbers.
    pub seed: u64,
    /// How the strands are shaped.
    pub shape: FurShape,
    /// How strands are drawn together, at the coarser and the finer scale.
    pub clumps: [Clumps; 2],
    /// Levels of the wisp hierarchy.
    pub levels: usize,
    /// Sections per wisp, which are the strain nodes of its guides; 2 to 64.
    pub sections: usize,
    /// Material of the strands.
    pub material: Material,
    /// Drawn width at root and tip, m; `None` for strands that cover the skin.
    pub width: Option<[f64; 2]>,
}

/// How many strands grow.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum StrandCount {
    /// This number in all; 0 for guides alone.
    Number(usize),
    /// This number on each m² where the density is 1.
    PerArea(f64),
}

/// The shape of single strands.
#[derive(Debug, Clone, PartialEq)]
pub struct FurShape {
    /// Length, m; `None` for [`LENGTH_SHARE`].
    pub length: Option<f64>,
    /// Largest relative shortening at random, 0 to 1.
    pub length_variation: f64,
    /// Field that the length is multiplied by.
    pub length_field: Option<String>,
    /// Which way the fur lies.
    pub direction: Direction,
    /// How much of its own weight turns the fur down: 0 none, 1 as much as the direction itself.
    pub gravity: f64,
    /// Rounds of smoothing of the directions over the mesh.
    pub smoothing: usize,
    /// Angle between surface and strand at the root, rad.
    pub lift: f64,
    /// Share of that angle that is left at the tip.
    pub lift_at_tip: f64,
    /// Radius of the curls at the tip, as a share of the length, and turns along it.
    pub curl: [f64; 2],
    /// Displacement at random that grows towards the tip, as a share of the length.
    pub frizz: f64,
}

/// Which way fur lies on a surface.
#[derive(Debug, Clone, PartialEq)]
pub enum Direction {
    /// Away from a place, along the surface: from `None`, the head end of the longest axis of the mesh.
    Flow(Option<Vector3<f64>>),
    /// Along a vector, Y up.
    Vector(Vector3<f64>),
    /// Along texture coordinates.
    Texture {
        /// Which coordinate, 0 or 1.
        axis: usize,
        /// Towards falling values instead of rising ones.
        falls: bool,
    },
    /// Along a field of vectors.
    Field(String),
    /// Straight out.
    Normal,
}

/// Strands that are drawn together.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Clumps {
    /// Number of clumps; `None` for one per guide at the coarser scale, and six for each of these at the
    /// finer.
    pub count: Option<usize>,
    /// Share by which the tips of a clump come together, 0 to 1.
    pub strength: f64,
}

/// The field that `name` names, and which of its numbers: the first, or as `color.g` says.
pub(super) fn channel(name: &str) -> (&str, usize) {
    let of = |(field, channel): (_, &str)| Some((field, ["r", "g", "b"].iter().position(|c| *c == channel)?));
    name.rsplit_once('.').and_then(of).unwrap_or((name, 0))
}

impl GrowOptions {
    /// The defaults for a mesh; the groom is named after it.
    pub fn new(mesh: Source) -> Self {
        let name = mesh.path.file_stem().map_or_else(String::new, |s| s.to_string_lossy().into_owned());
        GrowOptions {
            name,
            folder: PathBuf::new(),
            mesh,
            parts: Vec::new(),
            density_field: None,
            guides: GROWN_GUIDES,
            strands: StrandCount::Number(GROWN_GUIDES * STRANDS_PER_GUIDE),
            vertices: None,
            seed: 0,
            shape: FurShape::default(),
            clumps: [0.5, 0.5].map(|strength| Clumps { count: None, strength }),
            levels: 2,
            sections: 5,
            material: Material { name: "fur".into(), sag_free: 1.0, goal: [8.0, 3.0], ..Material::default() },
            width: None,
        }
    }

    /// Names of the fields that are read.
    pub(super) fn fields(&self) -> Vec<String> {
        let direction = match &self.shape.direction {
            Direction::Field(name) => Some(name),
            _ => None,
        };
        let numbers = [&self.density_field, &self.shape.length_field].into_iter().flatten();
        numbers.map(|name| channel(name).0).chain(direction.map(String::as_str)).map(String::from).collect()
    }

    /// Number of clumps of both scales.
    pub(super) fn clump_counts(&self) -> [usize; 2] {
        let coarse = self.clumps[0].count.unwrap_or(self.guides);
        [coarse, self.clumps[1].count.unwrap_or(FINE_PER_COARSE * coarse)]
    }

    /// How the groom is built over guides and strands.
    pub(super) fn build(&self) -> BuildOptions {
        BuildOptions {
            guide_vertices: Resample::Keep,
            // Strands grow on the mesh, and not around guides.
            generation: Generation { per_guide: 0, ..Generation::default() },
            hierarchy: HierarchyShape { levels: self.levels, coarse: None, leaves: None },
            sections: self.sections,
            material: self.material.clone(),
            width: self.width,
            ..BuildOptions::default()
        }
    }

    /// Checks the ranges of all options.
    ///
    /// # Errors
    /// [`Error::Usage`] with every option that is out of range.
    pub(super) fn check(&self) -> Result<()> {
        let mut errors = Vec::new();
        let mut require = |ok: bool, what: &str| {
            if !ok {
                errors.push(what.to_string());
            }
        };
        let share = |x: f64| (0.0..=1.0).contains(&x);
        let shape = &self.shape;
        require((1..=MOST).contains(&self.guides), "the number of guides must be 1 to 10,000,000");
        require(self.vertices.is_none_or(|n| (3..=256).contains(&n)), "strands need 3 to 256 vertices");
        require((0.0..1.0).contains(&shape.length_variation), "the variation of the length must be 0 to 1");
        require((0.0..=10.0).contains(&shape.gravity), "gravity must be 0 to 10");
        require(shape.smoothing <= 10_000, "the rounds of smoothing must be 0 to 10,000");
        require(
            (0.0..=std::f64::consts::FRAC_PI_2).contains(&shape.lift) && share(shape.lift_at_tip),
            "the lift must be 0 to 90 degrees",
        );
        require(share(shape.curl[0]) && (0.0..=100.0).contains(&shape.curl[1]), "curls are out of range");
        require(share(shape.frizz), "the frizz must be 0 to 1");
        for Clumps { count, strength } in self.clumps {
            require(share(strength), "the strength of clumps must be 0 to 1");
            require(count.is_none_or(|n| (1..=MOST).contains(&n)), "the number of clumps must be at least 1");
        }
        if errors.is_empty() { self.build().check() } else { Err(Error::Usage(errors.join("; "))) }
    }

    /// The groups of the groom, of which there is one.
    pub(super) fn group(&self, width: [f64; 2]) -> Group {
        Group { name: self.name.clone(), material: 0, width }
    }
}

/// Most guides, strands or clumps.
pub(super) const MOST: usize = 10_000_000;

impl Default for FurShape {
    fn default() -> Self {
        FurShape {
            length: None,
            length_variation: 0.25,
            length_field: None,
            direction: Direction::Flow(None),
            gravity: 0.4,
            smoothing: 10,
            lift: 40f64.to_radians(),
            lift_at_tip: 0.3,
            curl: [0.0, 2.0],
            frizz: 0.04,
        }
    }
}
