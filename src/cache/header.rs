//! The constant part of a cache. Arrays are in the unit and axes of the cache.

use std::ops::Range;

/// The constant part of a cache: everything that does not change over a bake.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Header {
    /// Metres per scene unit.
    pub metres_per_unit: f64,
    /// Up axis: Z if `true`, else Y.
    pub z_up: bool,
    /// Frames per second.
    pub fps: f64,
    /// First and last frame of the shot, without the handle frames.
    pub frames: (i32, i32),
    /// Basis of all curves.
    pub basis: Basis,
    /// Render strands; `None` if only guides are written.
    pub hair: Option<CurveSet>,
    /// Guides; empty if only render strands are written.
    pub guides: CurveSet,
    /// Colliders, for the validator and the preview.
    pub colliders: Vec<ColliderMesh>,
    /// Whether frames include the levels of curves.
    pub levels: bool,
    /// Whether frames include the moments that the solver reached before the next frame.
    pub steps: bool,
    /// Whether frames include accelerations.
    pub accelerations: bool,
    /// Whether frames include the normals of guides.
    pub normals: bool,
    /// What holds the guides, if frames include its reactions.
    pub reactions: Option<HeldGuides>,
}

/// The ties of the guides, one entry for each guide that a tie holds. The clamps are those of the guides.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct HeldGuides {
    /// Id of the guide.
    pub guide: Vec<i32>,
    /// Number of the tie in the animation, from 0.
    pub number: Vec<i32>,
}

/// Basis of the cubic curves, which are pinned at both ends.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Basis {
    /// Interpolates the points.
    #[default]
    CatmullRom,
    /// Approximates the points: smoother, within their convex hull.
    Bspline,
}

/// The constant part of a set of curves: `n` curves with `N` points in total.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct CurveSet {
    /// Number of points of each curve; `n`.
    pub counts: Vec<i32>,
    /// Points in rest space, scene units; `N`.
    pub rest: Vec<[f32; 3]>,
    /// Arc length from the root to each point, scene units, the same at all times; `N`. Empty for strands.
    pub arc: Vec<f32>,
    /// Diameter at each point, scene units; `N`.
    pub widths: Vec<f32>,
    /// Unique id of each curve; `n`.
    pub id: Vec<i32>,
    /// Group of each curve; `n`.
    pub group: Vec<i32>,
    /// Name of the group of each curve; `n`.
    pub group_name: Vec<String>,
    /// 1 for a simulated guide, 0 for an interpolated strand; `n`.
    pub guide: Vec<i32>,
    /// Texture coordinate of each root; `n`.
    pub root_uv: Vec<[f32; 2]>,
    /// 1 for a curve whose root nothing holds, 0 for another; `n`, or empty if all are held.
    pub loose: Vec<i32>,
    /// Guides that each curve follows; empty for guides.
    pub closest: ClosestGuides,
}

impl CurveSet {
    /// The points of each curve.
    pub fn ranges(&self) -> impl Iterator<Item = Range<usize>> {
        ranges(self.counts.iter().map(|n| u32::try_from(*n).unwrap_or(0)))
    }
}

/// The items of each of several lists of these lengths, one after the other.
pub fn ranges(lengths: impl Iterator<Item = u32>) -> impl Iterator<Item = Range<usize>> {
    lengths.scan(0, |end, n| {
        let start = *end;
        *end += n as usize;
        Some(start..*end)
    })
}

/// The guides that strands follow, [`ClosestGuides::PER_STRAND`] per strand, strand after strand.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct ClosestGuides {
    /// Their ids.
    pub guides: Vec<i32>,
    /// Their weights, of sum 1 per strand.
    pub weights: Vec<f32>,
}

impl ClosestGuides {
    /// Guides per strand, as in Unreal. Missing ones have weight 0.
    pub const PER_STRAND: usize = 3;
}

/// A collider as triangles in the rest space of its body. Analytic shapes are tessellated on the outside.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct ColliderMesh {
    /// Prim name. In the files it is changed into an identifier; see
    /// [`Writer::create`](super::Writer::create).
    pub name: String,
    /// Vertices, scene units; at rest if it deforms.
    pub points: Vec<[f32; 3]>,
    /// Vertex indices of each triangle.
    pub triangles: Vec<[i32; 3]>,
    /// Triangles that close its holes: hair keeps out of them as of the others.
    pub caps: Vec<[i32; 3]>,
    /// Whether its vertices move in rest space.
    pub deforms: bool,
    /// Whether the roots ride on it.
    pub is_skin: bool,
    /// Whether it is a square that stands for the unbounded plane through it.
    pub is_plane: bool,
}
