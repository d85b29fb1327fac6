//! The hair cache: how a bake is laid out as USD files, and how it is read back.
//!
//! `hair.usda` (root), `hair.topology.usdc` (all that does not move), `hair.manifest.usda` (clip
//! manifest), `hair.1001.usdc` … (one file a frame) and `manifest.json`. Arrays here are in the
//! cache's own unit and axes, as they stand in the files.
//!
//! [`Writer`] writes a cache and [`Reader`] reads it back. `manifest.json` is written last, so a folder
//! without it holds an unfinished bake.

mod check;
mod layout;
mod manifest;
mod material;
mod reader;
mod writer;

pub use crate::file::{FileRecord, sha256, write_file};
pub use layout::{CLIP_MANIFEST, MANIFEST, ROOT, TOPOLOGY, frame_file_name};
pub use manifest::{FrameRecord, InputRecord, Manifest, Summary};
pub use reader::Reader;
pub use writer::{Writer, unfinish};

/// What does not change over a bake.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Header {
    /// Metres in one scene unit.
    pub metres_per_unit: f64,
    /// `true` for Z up, `false` for Y up.
    pub z_up: bool,
    /// Frames a second.
    pub fps: f64,
    /// First and last frame of the shot; a handle frame lies before and after.
    pub frames: (i32, i32),
    /// How the curves run between their points.
    pub basis: Basis,
    /// Render strands; `None` where only guides are written.
    pub hair: Option<CurveSet>,
    /// Guides; no curves where only render strands are written.
    pub guides: CurveSet,
    /// Colliders, for the validator and the preview.
    pub colliders: Vec<ColliderMesh>,
    /// Whether the frames tell the levels of curves.
    pub levels: bool,
    /// Whether the frames tell accelerations.
    pub accelerations: bool,
}

/// Basis of the cubic curves, both pinned at their ends.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Basis {
    /// Through the points.
    #[default]
    CatmullRom,
    /// Smoother, within the hull of the points.
    Bspline,
}

/// Curves that do not change over a bake. `n` curves, `N` points in all.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct CurveSet {
    /// Points of each curve; `n`.
    pub counts: Vec<i32>,
    /// Points in rest space; `N`.
    pub rest: Vec<[f32; 3]>,
    /// Diameter at each point; `N`.
    pub widths: Vec<f32>,
    /// Unique id of each curve; `n`.
    pub id: Vec<i32>,
    /// Group of each curve; `n`.
    pub group: Vec<i32>,
    /// Name of that; `n`.
    pub group_name: Vec<String>,
    /// 1 for a simulated guide, 0 for an interpolated strand; `n`.
    pub guide: Vec<i32>,
    /// Texture coordinate of each root; `n`.
    pub root_uv: Vec<[f32; 2]>,
    /// What each curve follows; nothing for guides.
    pub closest: Closest,
}

/// The guides that strands follow, [`Closest::EACH`] a strand, one strand after the other.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Closest {
    /// Their ids.
    pub guides: Vec<i32>,
    /// Their weights, whose sum is 1 for each strand.
    pub weights: Vec<f32>,
}

impl Closest {
    /// Guides of each strand, as Unreal knows them; one that there is not has the weight 0.
    pub const EACH: usize = 3;
}

/// A collider as triangles in the rest space of its body (analytic shapes tessellated on the outside).
#[derive(Debug, Clone, PartialEq, Default)]
pub struct ColliderMesh {
    /// Prim name. What is no identifier is turned into one in the files; see [`Writer::create`].
    pub name: String,
    /// Vertices; at rest, where it deforms.
    pub points: Vec<[f32; 3]>,
    /// Vertex indices, three a triangle.
    pub triangles: Vec<[i32; 3]>,
    /// Whether its vertices move in that space.
    pub deforms: bool,
}

/// A collider at one frame.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct ColliderFrame {
    /// Rest space of its body to world, column-vector convention.
    pub transform: [[f64; 4]; 4],
    /// Vertices in the rest space of its body, if it deforms.
    pub points: Option<Vec<[f32; 3]>>,
}

/// What changes over time, at one moment.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Frame {
    /// Frame number.
    pub frame: i32,
    /// When it is within the frame's interval, frames (0..1).
    pub offset: f64,
    /// Render strands, where the header has them.
    pub hair: Option<CurveFrame>,
    /// Guides.
    pub guides: CurveFrame,
    /// Rest space to world on the head, column-vector convention: `world = head · rest`.
    pub head: [[f64; 4]; 4],
    /// The colliders of the header.
    pub colliders: Vec<ColliderFrame>,
}

/// Curves at one frame.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct CurveFrame {
    /// Points, world space.
    pub points: Vec<[f32; 3]>,
    /// Velocities, scene units per second.
    pub velocities: Vec<[f32; 3]>,
    /// Accelerations, scene units per second squared; where the header says so.
    pub accelerations: Option<Vec<[f32; 3]>>,
    /// Lowest and highest corner of the points grown by half the widths.
    pub extent: [[f32; 3]; 2],
    /// Level of the wisp that each curve moves with, 0 for a coarse one; where the header says so.
    pub level: Option<Vec<i32>>,
}
