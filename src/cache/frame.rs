//! The time-varying part of a cache. Arrays are in the unit and axes of the cache.

/// A collider at one frame.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct ColliderFrame {
    /// Rest space of its body to world, column-vector convention.
    pub transform: [[f64; 4]; 4],
    /// Vertices in the rest space of its body, scene units, if it deforms.
    pub points: Option<Vec<[f32; 3]>>,
}

/// The time-varying part of a cache, at one time sample.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Frame {
    /// Frame number.
    pub frame: i32,
    /// Time since the frame, frames (0..1).
    pub offset: f64,
    /// Render strands, if the header has them.
    pub hair: Option<CurveFrame>,
    /// Guides.
    pub guides: CurveFrame,
    /// Head: rest space to world, column-vector convention.
    pub head: [[f64; 4]; 4],
    /// The colliders of the header.
    pub colliders: Vec<ColliderFrame>,
}

/// A set of curves at one time sample.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct CurveFrame {
    /// Points, world space, scene units.
    pub points: Vec<[f32; 3]>,
    /// Velocities, scene units per second.
    pub velocities: Vec<[f32; 3]>,
    /// Accelerations, scene units per second squared, if the header includes them.
    pub accelerations: Option<Vec<[f32; 3]>>,
    /// Lowest and highest corner of the points, padded by half the widths.
    pub extent: [[f32; 3]; 2],
    /// Level of the wisp with which each curve moves, 0 for the coarsest, if the header includes levels.
    pub level: Option<Vec<i32>>,
    /// 1 for a guide that the solver brought to this moment, 0 for one that moves evenly over a longer step, if they
    /// are guides and the header includes steps.
    pub arrived: Option<Vec<i32>>,
    /// First axis of the section at each point, if they are guides and the header includes it.
    pub normals: Option<Vec<[f32; 3]>>,
    /// What holds the curves, if they are guides and the header includes it.
    pub reactions: Option<Reactions>,
}

/// What holds the guides at one time sample, world axes of the cache.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Reactions {
    /// Force of the clamp on each guide, N.
    pub clamp_force: Vec<[f32; 3]>,
    /// Moment of the clamp on each guide about its root, N·m.
    pub clamp_moment: Vec<[f32; 3]>,
    /// Force of each tie of the header on its guide, N.
    pub tie_force: Vec<[f32; 3]>,
    /// Moment of each of these about the place that it holds, N·m.
    pub tie_moment: Vec<[f32; 3]>,
}
