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
    /// Upper bound on the distance of its midpoint, m; infinite if unknown.
    middle: f64,
    /// [`Solid::max_travel`] at that time, m.
    travel: f64,
}

impl Default for SegmentBound {
    fn default() -> Self {
        SegmentBound { ends: [Vector3::zeros(); 2], distance: 0.0, middle: f64::INFINITY, travel: 0.0 }
    }
}

impl SegmentBound {
    /// The bound for a segment with these `ends` at time `t`, s, from the distance of its midpoint, which is at
    /// most `farthest`, m.
    fn search(solid: &Solid, t: f64, ends: [Vector3<f64>; 2], reach: f64, farthest: f64) -> Self {
        let half = 0.5 * (ends[1] - ends[0]).norm();
        // A search beyond the motion of a few steps has no use, and its cost grows with the distance.
        let horizon = (half + 8.0 * reach).min(farthest * (1.0 + 1e-9) + 1e-12);
        let middle = 0.5 * (ends[0] + ends[1]);
        let found = match solid.surface_over([t, t]) {
            // Contacts with a convex shape exist at any depth: only outside is the distance a bound.
            MovingSurface::Convex(convex) => Some(convex.closest(&middle).distance),
            MovingSurface::Mesh([mesh, _]) => mesh.closest(&middle, horizon).map(|s| s.distance.abs()),
        };
        // The margins cover rounding.
        let distance = (found.unwrap_or(horizon) - half) * (1.0 - 1e-9) - 1e-12;
        SegmentBound { ends, distance, middle: found.unwrap_or(f64::INFINITY), travel: solid.max_travel(t) }
    }

    /// Upper bound on the distance of the midpoint of the segment with these `ends` at time `t`, s, from the
    /// surface, m: it has come no farther from it than it and the surface have moved.
    fn farthest(&self, solid: &Solid, t: f64, ends: &[Vector3<f64>; 2]) -> f64 {
        let moved = 0.5 * (ends[0] + ends[1] - self.ends[0] - self.ends[1]).norm();
        self.middle + moved + (solid.max_travel(t) - self.travel).abs()
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

    /// Whether segment `k`, in `slot`, is certainly farther than `reach`, m, from the surface on all of its way
    /// between `times`, s, by its cached bound.
    pub(super) fn stays_beyond(
        &self,
        solid: &Solid,
        slot: usize,
        k: usize,
        times: [f64; 2],
        reach: f64,
    ) -> bool {
        let [x0, x1] = self.segment(k);
        self.bounds[slot].exceeds(solid, &[(times[1], x1), (times[0], x0)], reach)
    }

    /// Whether the segment in `slot` is certainly farther than `reach`, m, from the surface at all of
    /// `places` (time, s, and ends, body frame) and between them: by its cached bound, or by that of one new
    /// search, unless that is known to find it near.
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
        let farthest = bound.farthest(solid, t, &ends);
        // A search would certainly find it near.
        if farthest < reach + 0.5 * (ends[1] - ends[0]).norm() {
            return false;
        }
        *bound = SegmentBound::search(solid, t, ends, reach, farthest);
        bound.exceeds(solid, places, reach)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Shape;
    use proptest::prelude::*;

    /// Ends near a ball of 5 cm.
    fn ends() -> impl Strategy<Value = [[f64; 3]; 2]> {
        prop::array::uniform2(prop::array::uniform3(-0.06..0.06_f64))
    }

    proptest! {
        #[test]
        fn bounds_from_before_hold(
            before in ends(), by in ends(), share in 0.0..0.1_f64, reach in 1e-4..0.01_f64
        ) {
            let ball = Shape::Sphere { centre: Vector3::zeros(), radius: 0.05 };
            let before = before.map(Vector3::from);
            let after = [0, 1].map(|i| before[i] + Vector3::from(by[i]) * share);
            for shape in [Shape::Mesh(ball.tessellate()), ball] {
                let solid = Solid::new(&shape, None);
                let bound = SegmentBound::search(&solid, 0.0, before, reach, f64::INFINITY);
                let farthest = bound.farthest(&solid, 0.0, &after);
                let found = SegmentBound::search(&solid, 0.0, after, reach, f64::INFINITY);
                prop_assert_eq!(found, SegmentBound::search(&solid, 0.0, after, reach, farthest));
                let near = farthest < reach + 0.5 * (after[1] - after[0]).norm();
                prop_assert!(!near || !found.exceeds(&solid, &[(0.0, after)], reach));
            }
        }
    }
}
