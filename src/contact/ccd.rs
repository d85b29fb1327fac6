//! Continuous collision detection: the first time at which a moving segment comes too close to a body.
//!
//! Conservative advancement with a minimum separation ξ (M. Li et al., "Codimensional incremental potential
//! contact", 2021, section 4), in its directional form (B. Mirtich, "Timewarp rigid body simulation", 2000).
//! Consider a segment and a convex obstacle (a triangle or a convex shape) whose closest points are separated
//! in direction n. They stay separated along n at least until an end of the segment, moving linearly, comes
//! within ξ of the obstacle's support in direction n. This bound is exact for a flat approach and costs
//! nothing for sliding along a surface. Time never passes an impact, because the separation along any fixed
//! direction is a lower bound on the distance.
//!
//! The corners of a triangle may move linearly, too. The bound is then the time at which an end of the
//! segment comes within ξ of a corner, both moving along n.
//!
//! ξ is a fraction of the smaller of the clearance and the initial distance: a segment that starts a step
//! outside ends it outside, however often it is stopped.

use super::bodies::Bodies;
use super::cache::ContactCache;
use super::polyline::{BodyMotion, Contact, LocalContact, MovingPolyline, is_exempt, least_in_front};
use crate::geometry::{
    Bounds, ClosestPoints, Convex, Feature, MovingSurface, SolidMesh, barycentric, barycentric_point,
    segment_triangle,
};
use crate::math::frame::transport;
use nalgebra::Vector3;

/// Minimum separation ξ, as a fraction of min(clearance, initial distance).
pub(super) const SEPARATION: f64 = 0.2;
/// A segment within ξ plus this fraction of min(clearance, initial distance) counts as stopped.
pub(super) const TOLERANCE: f64 = 0.05;
/// Distance, m, below which the side of a surface is rounding: such a start is an overlap.
pub(super) const OVERLAP: f64 = 1e-12;
/// Maximum number of steps of the advancement. A few suffice; stopping short is early, never late.
pub(super) const STEPS: usize = 100;

impl Bodies {
    /// Appends to `out` the first impact of each segment of `line` with each body over the step, with the
    /// normal just before the impact. Returns the earliest time of impact as a fraction of the step, 1 if
    /// there is none.
    ///
    /// Only parts that stay in front of a body are tested, and only from outside a body.
    pub fn impacts(
        &self,
        motions: &[BodyMotion],
        line: &MovingPolyline,
        cache: &mut ContactCache,
        out: &mut Vec<Contact>,
    ) -> f64 {
        let mut first: f64 = 1.0;
        let segments = line.x0.len().saturating_sub(1);
        cache.resize(self.len(), segments);
        for (b, motion) in motions.iter().enumerate() {
            cache.enter(line, motion);
            for k in 0..segments {
                if let Some(time) = self.impact_of([b, k], motion, line, cache, out) {
                    first = first.min(time);
                }
            }
        }
        first
    }

    /// [`Bodies::impacts`] of segment k with body b, of \[b, k\]; `cache` holds the polyline in its frame.
    pub(super) fn impact_of(
        &self,
        [b, k]: [usize; 2],
        motion: &BodyMotion,
        line: &MovingPolyline,
        cache: &mut ContactCache,
        out: &mut Vec<Contact>,
    ) -> Option<f64> {
        let (body, clearances) = (&self.bodies[b], line.clearances(b));
        let span = TestedSpan::new(&clearances[k])?;
        let [x0, x1] = cache.segment(k);
        let (places, slot) = ([(motion.times[1], x1), (motion.times[0], x0)], b * clearances.len() + k);
        if cache.is_beyond(&body.solid, slot, &places, span.clearance) {
            return None;
        }
        let path = MovingSegment { start: span.of(x0), end: span.of(x1) };
        let impact = match body.solid.surface_over(motion.times) {
            MovingSurface::Convex(convex) => path.first_on_convex(convex, span.clearance),
            MovingSurface::Mesh(meshes) => {
                cache.triangles.clear();
                let travel = body.solid.max_travel(motion.times[1]) - body.solid.max_travel(motion.times[0]);
                let margin = (SEPARATION + TOLERANCE) * span.clearance + travel;
                meshes[1].triangles_in(&path.bounds(margin), &mut cache.triangles);
                path.first_on_mesh(meshes, &cache.triangles, span.clearance)
            }
        };
        let Impact { time, u, normal, point, feature } = impact?;
        let u = span.from + u * (span.to - span.from);
        let found = LocalContact { segment: k, u, feature, normal, point };
        out.push(found.into_world(b, body.friction, motion, line));
        Some(time)
    }
}

/// The part of a segment that stays in front of a body, as parameters on it, and its largest clearance, m.
struct TestedSpan {
    from: f64,
    to: f64,
    clearance: f64,
}

impl TestedSpan {
    fn new(clearance: &[f64; 2]) -> Option<Self> {
        let [a, b] = *clearance;
        let least = least_in_front(clearance);
        if is_exempt(clearance) || a.max(b) <= least {
            return None;
        }
        let at_least = (least - a) / (b - a);
        let from = if a < least { at_least } else { 0.0 };
        let to = if b < least { at_least } else { 1.0 };
        Some(TestedSpan { from, to, clearance: a.max(b) })
    }

    /// Ends of the part, of a segment with these `ends`.
    fn of(&self, ends: [Vector3<f64>; 2]) -> [Vector3<f64>; 2] {
        let at = |u: f64| match u {
            0.0 => ends[0],
            1.0 => ends[1],
            _ => ends[0].lerp(&ends[1], u),
        };
        [at(self.from), at(self.to)]
    }
}

/// A separating direction between an obstacle and a segment.
struct Separation<const N: usize> {
    /// Unit direction from the obstacle to the segment, between their closest points.
    normal: Vector3<f64>,
    /// Height n·y, m, of points y of the obstacle, the highest among them, and its rate. Points with their
    /// own motion are listed separately.
    heights: [[f64; 2]; N],
}

/// An impact of a segment with a body, body frame.
struct Impact {
    /// Fraction of the step.
    time: f64,
    /// Parameter on the segment.
    u: f64,
    /// Unit normal in the configuration at the end of the motion.
    normal: Vector3<f64>,
    /// Material point of the obstacle at the start and at the end of the motion, m.
    point: [Vector3<f64>; 2],
    feature: Feature,
}

/// A segment whose ends move linearly, m, body frame.
struct MovingSegment {
    start: [Vector3<f64>; 2],
    end: [Vector3<f64>; 2],
}

impl MovingSegment {
    fn at(&self, t: f64) -> [Vector3<f64>; 2] {
        [self.start[0].lerp(&self.end[0], t), self.start[1].lerp(&self.end[1], t)]
    }

    /// Bounding box of the motion.
    fn bounds(&self, margin: f64) -> Bounds {
        Bounds::around(self.start.iter().chain(&self.end), margin)
    }

    /// First time before `until` at which the segment is too close to a convex obstacle; `None` also if they
    /// overlap at the start. `separation` gives the separating direction for the ends of the segment at a
    /// time.
    fn advance<const N: usize>(
        &self,
        clearance: f64,
        until: f64,
        separation: impl Fn(&[Vector3<f64>; 2], f64) -> Separation<N>,
    ) -> Option<f64> {
        let velocity = [self.end[0] - self.start[0], self.end[1] - self.start[1]];
        let mut ends = self.start;
        let mut current = separation(&ends, 0.0);
        let gap = |separation: &Separation<N>, ends: &[Vector3<f64>; 2]| {
            let highest = separation.heights.iter().map(|h| h[0]).fold(f64::NEG_INFINITY, f64::max);
            let gaps = ends.map(|x| separation.normal.dot(&x) - highest);
            gaps[0].min(gaps[1])
        };
        let scale = clearance.min(gap(&current, &ends));
        if scale <= OVERLAP {
            return None;
        }
        let (minimum, stop) = (SEPARATION * scale, (SEPARATION + TOLERANCE) * scale);
        let mut t = 0.0;
        for _ in 0..STEPS {
            let mut safe = f64::INFINITY;
            for (x, v) in ends.iter().zip(&velocity) {
                let (height, speed) = (current.normal.dot(x), current.normal.dot(v));
                for h in current.heights {
                    let approach = h[1] - speed;
                    if approach > 0.0 {
                        safe = safe.min((height - h[0] - minimum) / approach);
                    }
                }
            }
            t += safe;
            if t >= until {
                return None;
            }
            ends = self.at(t);
            current = separation(&ends, t);
            if gap(&current, &ends) <= stop {
                break;
            }
        }
        Some(t)
    }

    fn first_on_convex(&self, shape: &Convex, clearance: f64) -> Option<Impact> {
        let closest = |ends: &[Vector3<f64>; 2]| shape.closest_to_segment(&ends[0], &ends[1]);
        let time = self.advance(clearance, 1.0, |ends, _| {
            let (_, s) = closest(ends);
            Separation { normal: s.normal, heights: [[s.normal.dot(&s.point), 0.0]] }
        })?;
        let (u, s) = closest(&self.at(time));
        Some(Impact { time, u, normal: s.normal, point: [s.point; 2], feature: s.feature })
    }

    fn first_on_mesh(&self, meshes: [&SolidMesh; 2], triangles: &[u32], clearance: f64) -> Option<Impact> {
        let margin = (SEPARATION + TOLERANCE) * clearance;
        let mut first: Option<Impact> = None;
        for &t in triangles {
            let obstacle = Triangle { meshes, index: t, corners: meshes.map(|mesh| mesh.triangle(t)) };
            if self.stays_on_one_side(&obstacle, margin) {
                continue;
            }
            let until = first.as_ref().map_or(1.0, |impact| impact.time);
            let time = if obstacle.moves() {
                self.advance(clearance, until, |ends, time| obstacle.separation_moving(ends, time))
            } else {
                self.advance(clearance, until, |ends, _| obstacle.separation(ends))
            };
            let impact = time.map(|time| obstacle.impact(&self.at(time), time));
            // Only a start outside can have an impact. Impacts are few, so this is tested last.
            first = impact.filter(|hit| self.starts_outside(meshes[0], hit)).or(first);
        }
        first
    }

    /// Whether the whole motion stays on one side of a triangle's plane.
    fn stays_on_one_side(&self, obstacle: &Triangle, margin: f64) -> bool {
        let normal = obstacle.meshes[1].pseudonormal(Feature::Face(obstacle.index));
        let corner = obstacle.corners[1][0];
        let height = |x: &Vector3<f64>| normal.dot(&(x - corner));
        let (mut low, mut high) = (0.0, 0.0);
        if obstacle.moves() {
            for h in obstacle.corners.as_flattened().iter().map(|y| height(y)) {
                (low, high) = (f64::min(low, h), f64::max(high, h));
            }
        }
        let mut ends = self.start.iter().chain(&self.end);
        ends.clone().all(|x| height(x) > high + margin) || ends.all(|x| height(x) < low - margin)
    }

    fn starts_outside(&self, mesh: &SolidMesh, hit: &Impact) -> bool {
        let x = self.start[0].lerp(&self.start[1], hit.u);
        // The triangle of the impact is within this distance, so a closest point exists.
        let horizon = 2.0 * (x - hit.point[0]).norm() + OVERLAP;
        mesh.closest(&x, horizon).is_none_or(|s| s.distance > 0.0)
    }
}

/// A triangle of a mesh, at the start and at the end of the motion.
struct Triangle<'a> {
    meshes: [&'a SolidMesh; 2],
    index: u32,
    corners: [[&'a Vector3<f64>; 3]; 2],
}

impl Triangle<'_> {
    fn moves(&self) -> bool {
        !std::ptr::eq(self.meshes[0], self.meshes[1])
    }

    fn at(&self, time: f64) -> [Vector3<f64>; 3] {
        let [from, to] = &self.corners;
        if self.moves() { [0, 1, 2].map(|i| from[i].lerp(to[i], time)) } else { from.map(|y| *y) }
    }

    fn separation(&self, ends: &[Vector3<f64>; 2]) -> Separation<1> {
        let (_, normal) = closest(ends, self.corners[0]);
        let highest = self.corners[0].iter().map(|y| normal.dot(y)).fold(f64::NEG_INFINITY, f64::max);
        Separation { normal, heights: [[highest, 0.0]] }
    }

    fn separation_moving(&self, ends: &[Vector3<f64>; 2], time: f64) -> Separation<3> {
        let now = self.at(time);
        let (_, normal) = closest(ends, now.each_ref());
        let [from, to] = &self.corners;
        let heights = [0, 1, 2].map(|i| [normal.dot(&now[i]), normal.dot(&(to[i] - from[i]))]);
        Separation { normal, heights }
    }

    /// The impact of a segment with these `ends` at `time`.
    fn impact(&self, ends: &[Vector3<f64>; 2], time: f64) -> Impact {
        let now = self.at(time);
        let (pair, normal) = closest(ends, now.each_ref());
        let feature = self.meshes[0].feature(self.index, pair.feature);
        if !self.moves() {
            return Impact { time, u: pair.u, normal, point: [pair.point; 2], feature };
        }
        let w = barycentric(pair.feature, &pair.point, now.each_ref());
        // The normal rotates with the surface, as the pseudonormal of the feature does.
        let [before, after] = self.meshes.map(|mesh| mesh.pseudonormal(feature));
        let rotated = match before.lerp(&after, time).try_normalize(0.0) {
            Some(then) if after != Vector3::zeros() => transport(&then, &after) * normal,
            _ => normal,
        };
        let point = self.corners.map(|c| barycentric_point(c, &w));
        Impact { time, u: pair.u, normal: rotated, point, feature }
    }
}

/// Closest points of a segment and a triangle, and the unit direction from the triangle to the segment; zero
/// if they intersect.
fn closest(ends: &[Vector3<f64>; 2], corners: [&Vector3<f64>; 3]) -> (ClosestPoints, Vector3<f64>) {
    let pair = segment_triangle(&ends[0], &ends[1], corners);
    let offset = ends[0].lerp(&ends[1], pair.u) - pair.point;
    (pair, offset.try_normalize(0.0).unwrap_or_else(Vector3::zeros))
}
