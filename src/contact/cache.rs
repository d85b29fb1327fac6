//! Buffers and cached distance bounds of one polyline.

use super::polyline::{BodyMotion, MovingPolyline};
use crate::geometry::{MovingSurface, Solid};
use nalgebra::Vector3;

/// Buffers and cached distance bounds of one polyline, reused from step to step. The bounds never change a
/// result: they only skip searches that are proven to find nothing.
#[derive(Debug, Clone, Default)]
pub struct ContactCache {
    /// Vertices at the start and at the end, in the frame of the current body.
    pub(super) local: [Vec<Vector3<f64>>; 2],
    /// Triangles near the current segment.
    pub(super) triangles: Vec<u32>,
    /// One per body and segment.
    pub(super) bounds: Vec<SegmentBound>,
}

/// A lower bound on the distance of a segment from a body.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct SegmentBound {
    /// Ends of the segment, m, body frame.
    ends: [Vector3<f64>; 2],
    /// Lower bound on the distance of every point of the segment, m; 0 if unknown.
    distance: f64,
    /// [`Solid::max_travel`] at that time, m.
    travel: f64,
}

impl Default for SegmentBound {
    fn default() -> Self {
        SegmentBound { ends: [Vector3::zeros(); 2], distance: 0.0, travel: 0.0 }
    }
}

impl SegmentBound {
    /// The bound for a segment with these `ends` at time `t`, s, from the distance of its midpoint.
    fn search(solid: &Solid, t: f64, ends: [Vector3<f64>; 2], reach: f64) -> Self {
        let half = 0.5 * (ends[1] - ends[0]).norm();
        // A search beyond the motion of a few steps has no use, and its cost grows with the distance.
        let horizon = half + 8.0 * reach;
        let middle = 0.5 * (ends[0] + ends[1]);
        let distance = match solid.surface_over([t, t]) {
            // Contacts with a convex shape exist at any depth: only outside is the distance a bound.
            MovingSurface::Convex(convex) => convex.closest(&middle).distance,
            MovingSurface::Mesh([mesh, _]) => {
                mesh.closest(&middle, horizon).map_or(horizon, |s| s.distance.abs())
            }
        };
        // The margins cover rounding.
        let distance = (distance - half) * (1.0 - 1e-9) - 1e-12;
        SegmentBound { ends, distance, travel: solid.max_travel(t) }
    }

    /// Whether the segment is certainly farther than `reach`, m, at all of `places` and on linear motions
    /// between them: no point of it approaches by more than its farther-moving end and the surface have
    /// moved.
    fn exceeds(&self, solid: &Solid, places: &[(f64, [Vector3<f64>; 2])], reach: f64) -> bool {
        let moved = places
            .iter()
            .flat_map(|(_, x)| [(x[0] - self.ends[0]).norm_squared(), (x[1] - self.ends[1]).norm_squared()])
            .fold(0.0, f64::max);
        let surface =
            places.iter().map(|(t, _)| (solid.max_travel(*t) - self.travel).abs()).fold(0.0, f64::max);
        let slack = self.distance - reach - surface;
        slack > 0.0 && moved < slack * slack
    }
}

impl ContactCache {
    /// Transforms the polyline into the frame of a body.
    pub(super) fn enter(&mut self, line: &MovingPolyline, motion: &BodyMotion) {
        let poses = [motion.start.inverse(), motion.end.inverse()];
        for ((local, world), pose) in self.local.iter_mut().zip([line.x0, line.x1]).zip(poses) {
            local.clear();
            local.extend(world.iter().map(|x| pose.rotation * x + pose.translation.vector));
        }
    }

    /// Ends of segment `k` at the start and at the end, in the frame of the current body.
    pub(super) fn segment(&self, k: usize) -> [[Vector3<f64>; 2]; 2] {
        [&self.local[0], &self.local[1]].map(|x| [x[k], x[k + 1]])
    }

    /// Allocates bounds for `bodies` times `segments`; discards them if the numbers changed.
    pub(super) fn resize(&mut self, bodies: usize, segments: usize) {
        if self.bounds.len() != bodies * segments {
            self.bounds.clear();
            self.bounds.resize(bodies * segments, SegmentBound::default());
        }
    }

    /// Whether the segment in `slot` is certainly farther than `reach`, m, from the surface at all of
    /// `places` (time, s, and ends, body frame) and between them: by its cached bound, or by that of one new
    /// search.
    pub(super) fn is_beyond(
        &mut self,
        solid: &Solid,
        slot: usize,
        places: &[(f64, [Vector3<f64>; 2])],
        reach: f64,
    ) -> bool {
        let bound = &mut self.bounds[slot];
        if bound.exceeds(solid, places, reach) {
            return true;
        }
        let (t, ends) = places[0];
        *bound = SegmentBound::search(solid, t, ends, reach);
        bound.exceeds(solid, places, reach)
    }
}
