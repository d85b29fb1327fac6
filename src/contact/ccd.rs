//! Continuous detection: the first time at which a moving segment comes too close to a body.
//!
//! Conservative advancement with a minimum separation ξ (M. Li et al., "Codimensional incremental potential contact",
//! 2021, section 4), made directional (B. Mirtich, "Timewarp rigid body simulation", 2000): a segment and a convex obstacle
//! (a triangle, or a convex shape) at distance D with unit direction n between their closest points stay apart along n at
//! least until one of the segment's ends, moving linearly, comes within ξ of the obstacle's extent along n. That time is
//! exact for a flat approach and costs nothing when sliding along a surface; time never passes an impact, because
//! separation along any fixed direction bounds the distance from below.
//!
//! The corners of a triangle may move too, linearly: then the time is that at which an end of the segment comes within ξ of the
//! height of a corner, both moving along n.
//!
//! ξ is a fraction of the smaller of the clearance and the distance at the start, so a segment that is outside at the
//! start of a step is outside at its end, however often it is stopped.

use super::bodies::{Bodies, BodyMotion, Contact, ContactCache, Found, MovingPolyline};
use super::candidates::is_exempt;
use crate::geometry::{Bounds, SolidMesh, barycentric_point};
use crate::geometry::{ClosestPoints, barycentric, segment_triangle};
use crate::geometry::{Convex, Feature, MovingSurface};
use crate::math::frame::transport;
use nalgebra::Vector3;

/// Minimum separation ξ, as a fraction of min(clearance, distance at the start).
pub(super) const SEPARATION: f64 = 0.2;
/// How much farther than ξ a segment counts as stopped, as the same kind of fraction.
pub(super) const TOLERANCE: f64 = 0.05;
/// Nearer than this, m, the side of a surface is rounding: what starts so is overlapping.
pub(super) const TOUCHING: f64 = 1e-12;
/// Steps of the advancement; a few suffice, and one that is cut short is stopped early, never late.
pub(super) const STEPS: usize = 100;

impl Bodies {
    /// Appends to `out` the first impact of every segment of `line` with every body over the step, normals taken just
    /// before the impact, and returns the earliest time of all as a fraction of the step, 1 where there is none.
    ///
    /// Only stretches with positive clearance are watched, and only what is outside a body at the start can hit it.
    pub fn impacts(
        &self,
        motions: &[BodyMotion],
        line: &MovingPolyline,
        work: &mut ContactCache,
        out: &mut Vec<Contact>,
    ) -> f64 {
        let mut first: f64 = 1.0;
        let segments = line.x0.len().saturating_sub(1);
        work.size(self.len(), segments);
        for (b, (body, motion)) in self.bodies.iter().zip(motions).enumerate() {
            work.enter(line, motion);
            for (k, clearance) in line.clearances(b).iter().enumerate() {
                let Some(watched) = Watched::new(clearance) else { continue };
                let [x0, x1] = [&work.local[0], &work.local[1]].map(|x| [x[k], x[k + 1]]);
                let (places, slot) = ([(motion.times[1], x1), (motion.times[0], x0)], b * segments + k);
                if work.surely_far(&body.solid, slot, &places, watched.clearance) {
                    continue;
                }
                let path = Path { start: watched.of(x0), end: watched.of(x1) };
                let impact = match body.solid.surface_over(motion.times) {
                    MovingSurface::Convex(convex) => path.first_on_convex(convex, watched.clearance),
                    MovingSurface::Mesh(meshes) => {
                        work.triangles.clear();
                        let travel =
                            body.solid.max_travel(motion.times[1]) - body.solid.max_travel(motion.times[0]);
                        let margin = (SEPARATION + TOLERANCE) * watched.clearance + travel;
                        meshes[1].triangles_in(&path.bounds(margin), &mut work.triangles);
                        path.first_on_mesh(meshes, &work.triangles, watched.clearance)
                    }
                };
                if let Some(Impact { time, u, normal, point, feature }) = impact {
                    let u = watched.from + u * (watched.to - watched.from);
                    first = first.min(time);
                    let found = Found { segment: k, u, feature, normal, point };
                    out.push(found.into_world(b, body.friction, motion, line));
                }
            }
        }
        first
    }
}

/// The stretch of a segment that has a positive clearance, and its largest clearance.
struct Watched {
    from: f64,
    to: f64,
    clearance: f64,
}

impl Watched {
    fn new(clearance: &[f64; 2]) -> Option<Self> {
        let [a, b] = *clearance;
        if is_exempt(clearance) || a.max(b) <= 0.0 {
            return None;
        }
        let from = if a < 0.0 { a / (a - b) } else { 0.0 };
        let to = if b < 0.0 { a / (a - b) } else { 1.0 };
        Some(Watched { from, to, clearance: a.max(b) })
    }

    fn of(&self, ends: [Vector3<f64>; 2]) -> [Vector3<f64>; 2] {
        let at = |u: f64| match u {
            0.0 => ends[0],
            1.0 => ends[1],
            _ => ends[0].lerp(&ends[1], u),
        };
        [at(self.from), at(self.to)]
    }
}

/// How a convex obstacle lies to a segment at some time.
struct Apart<const N: usize> {
    /// Unit direction from the obstacle to the segment, at their closest points.
    normal: Vector3<f64>,
    /// Height n·y of points of the obstacle, the highest among them, and how fast it grows: whatever moves on its own.
    heights: [[f64; 2]; N],
}

struct Impact {
    time: f64,
    u: f64,
    /// As the surface is at the end of the motion.
    normal: Vector3<f64>,
    /// The obstacle's material point at the start and at the end of the motion.
    point: [Vector3<f64>; 2],
    feature: Feature,
}

/// A segment whose ends move linearly, body frame.
struct Path {
    start: [Vector3<f64>; 2],
    end: [Vector3<f64>; 2],
}

impl Path {
    fn at(&self, t: f64) -> [Vector3<f64>; 2] {
        [self.start[0].lerp(&self.end[0], t), self.start[1].lerp(&self.end[1], t)]
    }

    fn bounds(&self, margin: f64) -> Bounds {
        Bounds::around(self.start.iter().chain(&self.end), margin)
    }

    /// First time before `until` at which a convex obstacle is too close; `None` too where it overlaps at the start.
    fn advance<const N: usize>(
        &self,
        clearance: f64,
        until: f64,
        look: impl Fn(&[Vector3<f64>; 2], f64) -> Apart<N>,
    ) -> Option<f64> {
        let velocity = [self.end[0] - self.start[0], self.end[1] - self.start[1]];
        let mut ends = self.start;
        let mut apart = look(&ends, 0.0);
        let gap = |apart: &Apart<N>, ends: &[Vector3<f64>; 2]| {
            let highest = apart.heights.iter().map(|h| h[0]).fold(f64::NEG_INFINITY, f64::max);
            let gaps = ends.map(|x| apart.normal.dot(&x) - highest);
            gaps[0].min(gaps[1])
        };
        let scale = clearance.min(gap(&apart, &ends));
        if scale <= TOUCHING {
            return None;
        }
        let (separation, stop) = (SEPARATION * scale, (SEPARATION + TOLERANCE) * scale);
        let mut t = 0.0;
        for _ in 0..STEPS {
            let mut free = f64::INFINITY;
            for (x, v) in ends.iter().zip(&velocity) {
                let (height, speed) = (apart.normal.dot(x), apart.normal.dot(v));
                for h in apart.heights {
                    let approach = h[1] - speed;
                    if approach > 0.0 {
                        free = free.min((height - h[0] - separation) / approach);
                    }
                }
            }
            t += free;
            if t >= until {
                return None;
            }
            ends = self.at(t);
            apart = look(&ends, t);
            if gap(&apart, &ends) <= stop {
                break;
            }
        }
        Some(t)
    }

    fn first_on_convex(&self, shape: &Convex, clearance: f64) -> Option<Impact> {
        let closest = |ends: &[Vector3<f64>; 2]| shape.closest_to_segment(&ends[0], &ends[1]);
        let time = self.advance(clearance, 1.0, |ends, _| {
            let (_, s) = closest(ends);
            Apart { normal: s.normal, heights: [[s.normal.dot(&s.point), 0.0]] }
        })?;
        let (u, s) = closest(&self.at(time));
        Some(Impact { time, u, normal: s.normal, point: [s.point; 2], feature: s.feature })
    }

    fn first_on_mesh(&self, meshes: [&SolidMesh; 2], triangles: &[u32], clearance: f64) -> Option<Impact> {
        let margin = (SEPARATION + TOLERANCE) * clearance;
        let mut first: Option<Impact> = None;
        for &t in triangles {
            let obstacle = Triangle { meshes, index: t, corners: meshes.map(|mesh| mesh.triangle(t)) };
            if self.stays_beside(&obstacle, margin) {
                continue;
            }
            let until = first.as_ref().map_or(1.0, |impact| impact.time);
            let time = if obstacle.moves() {
                self.advance(clearance, until, |ends, time| obstacle.apart_moving(ends, time))
            } else {
                self.advance(clearance, until, |ends, _| obstacle.apart(ends))
            };
            let impact = time.map(|time| obstacle.impact(&self.at(time), time));
            // Only what was outside can hit; asked of hits alone, for they are few.
            first = impact.filter(|hit| self.starts_outside(meshes[0], hit)).or(first);
        }
        first
    }

    /// Whether the whole motion keeps to one side of a triangle, along its normal.
    fn stays_beside(&self, obstacle: &Triangle, margin: f64) -> bool {
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
        // The triangle hit is itself this near, so a closest point exists.
        let enough = 2.0 * (x - hit.point[0]).norm() + TOUCHING;
        mesh.closest(&x, enough).is_none_or(|s| s.distance > 0.0)
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

    fn apart(&self, ends: &[Vector3<f64>; 2]) -> Apart<1> {
        let (_, normal) = closest(ends, self.corners[0]);
        let highest = self.corners[0].iter().map(|y| normal.dot(y)).fold(f64::NEG_INFINITY, f64::max);
        Apart { normal, heights: [[highest, 0.0]] }
    }

    fn apart_moving(&self, ends: &[Vector3<f64>; 2], time: f64) -> Apart<3> {
        let now = self.at(time);
        let (_, normal) = closest(ends, now.each_ref());
        let [from, to] = &self.corners;
        Apart { normal, heights: [0, 1, 2].map(|i| [normal.dot(&now[i]), normal.dot(&(to[i] - from[i]))]) }
    }

    /// The impact of a segment that has come too close, with its `ends` where they are at `time`.
    fn impact(&self, ends: &[Vector3<f64>; 2], time: f64) -> Impact {
        let now = self.at(time);
        let (pair, normal) = closest(ends, now.each_ref());
        let feature = self.meshes[0].feature(self.index, pair.part);
        if !self.moves() {
            return Impact { time, u: pair.u, normal, point: [pair.point; 2], feature };
        }
        let w = barycentric(pair.part, &pair.point, now.each_ref());
        // The normal turns with the surface, as seen by the pseudonormal of what was hit.
        let [before, after] = self.meshes.map(|mesh| mesh.pseudonormal(feature));
        let turned = match before.lerp(&after, time).try_normalize(0.0) {
            Some(then) if after != Vector3::zeros() => transport(&then, &after) * normal,
            _ => normal,
        };
        Impact {
            time,
            u: pair.u,
            normal: turned,
            point: self.corners.map(|c| barycentric_point(c, &w)),
            feature,
        }
    }
}

/// Closest points of a segment and a triangle, and the unit direction from the triangle to the segment; zero where they meet.
fn closest(ends: &[Vector3<f64>; 2], corners: [&Vector3<f64>; 3]) -> (ClosestPoints, Vector3<f64>) {
    let pair = segment_triangle(&ends[0], &ends[1], corners);
    let offset = ends[0].lerp(&ends[1], pair.u) - pair.point;
    (pair, offset.try_normalize(0.0).unwrap_or_else(Vector3::zeros))
}
