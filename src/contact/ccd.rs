//! Continuous detection: the first time at which a moving segment comes too close to a body.
//!
//! Conservative advancement with a minimum separation ξ (M. Li et al., "Codimensional incremental potential contact",
//! 2021, section 4), made directional (B. Mirtich, "Timewarp rigid body simulation", 2000): a segment and a convex obstacle
//! (a triangle, or a convex shape) at distance D with unit direction n between their closest points stay apart along n at
//! least until one of the segment's ends, moving linearly, comes within ξ of the obstacle's extent along n. That time is
//! exact for a flat approach and costs nothing when sliding along a surface; time never passes an impact, because
//! separation along any fixed direction bounds the distance from below.
//!
//! ξ is a fraction of the smaller of the clearance and the distance at the start, so a segment that is outside at the
//! start of a step is outside at its end, however often it is stopped.

use super::bodies::{Bodies, Contact, Found, Motion, Polyline, Workspace};
use super::candidates::largest;
use super::distance::segment_triangle;
use super::mesh::{Bounds, Mesh};
use super::shape::{Feature, Shape};
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
        motions: &[Motion],
        line: &Polyline,
        work: &mut Workspace,
        out: &mut Vec<Contact>,
    ) -> f64 {
        let mut first: f64 = 1.0;
        let n = line.x0.len();
        let segments = n.saturating_sub(1);
        work.size(self.len(), segments);
        for (b, (body, motion)) in self.bodies.iter().zip(motions).enumerate() {
            let d = &line.clearance[b * n..(b + 1) * n];
            work.enter(line, motion);
            for k in 0..segments {
                let Some(watched) = Watched::new(d, k) else { continue };
                let [x0, x1] = [&work.local[0], &work.local[1]].map(|x| [x[k], x[k + 1]]);
                if work.surely_far(&body.shape, b * segments + k, &[x1, x0], watched.clearance) {
                    continue;
                }
                let path = Path { start: watched.of(x0), end: watched.of(x1) };
                let impact = match &body.shape {
                    Shape::Convex(convex) => path.advance(watched.clearance, 1.0, |ends| {
                        let (u, s) = convex.closest_to_segment(&ends[0], &ends[1]);
                        let extent = s.normal.dot(&s.point);
                        Closest { u, normal: s.normal, point: s.point, extent, feature: s.feature }
                    }),
                    Shape::Mesh(mesh) => {
                        work.triangles.clear();
                        let margin = (SEPARATION + TOLERANCE) * watched.clearance;
                        mesh.triangles_in(&path.bounds(margin), &mut work.triangles);
                        path.first_on_mesh(mesh, &work.triangles, watched.clearance)
                    }
                };
                if let Some(Impact { time, closest }) = impact {
                    let u = watched.from + closest.u * (watched.to - watched.from);
                    let found = Found {
                        segment: k,
                        u,
                        feature: closest.feature,
                        normal: closest.normal,
                        point: closest.point,
                    };
                    first = first.min(time);
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
    fn new(d: &[f64], k: usize) -> Option<Self> {
        let (a, b) = (d[k], d[k + 1]);
        if !(a.is_finite() && b.is_finite()) || a.max(b) <= 0.0 {
            return None;
        }
        let from = if a < 0.0 { a / (a - b) } else { 0.0 };
        let to = if b < 0.0 { a / (a - b) } else { 1.0 };
        Some(Watched { from, to, clearance: largest(a.max(0.0), b.max(0.0))? })
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

/// Closest points of a segment and a convex obstacle.
struct Closest {
    u: f64,
    /// Unit direction from the obstacle to the segment.
    normal: Vector3<f64>,
    point: Vector3<f64>,
    /// Largest n·y over the obstacle.
    extent: f64,
    feature: Feature,
}

struct Impact {
    time: f64,
    closest: Closest,
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

    /// First impact with a convex obstacle before time `until`; `None` too where it overlaps at the start.
    fn advance(
        &self,
        clearance: f64,
        until: f64,
        closest: impl Fn(&[Vector3<f64>; 2]) -> Closest,
    ) -> Option<Impact> {
        let velocity = [self.end[0] - self.start[0], self.end[1] - self.start[1]];
        let mut near = closest(&self.start);
        let mut ends = self.start;
        let mut t = 0.0;
        let apart =
            |near: &Closest, ends: &[Vector3<f64>; 2]| ends.map(|x| near.normal.dot(&x) - near.extent);
        let mut gaps = apart(&near, &ends);
        let scale = clearance.min(gaps[0].min(gaps[1]));
        if scale <= TOUCHING {
            return None;
        }
        let (separation, stop) = (SEPARATION * scale, (SEPARATION + TOLERANCE) * scale);
        for _ in 0..STEPS {
            let free = (0..2)
                .filter_map(|i| {
                    let approach = -near.normal.dot(&velocity[i]);
                    (approach > 0.0).then(|| (gaps[i] - separation) / approach)
                })
                .fold(f64::INFINITY, f64::min);
            t += free;
            if t >= until {
                return None;
            }
            ends = self.at(t);
            near = closest(&ends);
            gaps = apart(&near, &ends);
            if gaps[0].min(gaps[1]) <= stop {
                break;
            }
        }
        Some(Impact { time: t, closest: near })
    }

    fn first_on_mesh(&self, mesh: &Mesh, triangles: &[u32], clearance: f64) -> Option<Impact> {
        let margin = (SEPARATION + TOLERANCE) * clearance;
        let mut first: Option<Impact> = None;
        for &t in triangles {
            let corners = mesh.triangle(t);
            if self.stays_beside(&mesh.pseudonormal(Feature::Face(t)), corners[0], margin) {
                continue;
            }
            let until = first.as_ref().map_or(1.0, |impact| impact.time);
            let impact = self.advance(clearance, until, |ends| {
                let pair = segment_triangle(&ends[0], &ends[1], corners);
                let offset = ends[0].lerp(&ends[1], pair.u) - pair.point;
                let normal = offset.try_normalize(0.0).unwrap_or_else(Vector3::zeros);
                let extent = corners.iter().map(|v| normal.dot(v)).fold(f64::NEG_INFINITY, f64::max);
                Closest { u: pair.u, normal, point: pair.point, extent, feature: mesh.feature(t, pair.part) }
            });
            // Only what was outside can hit; asked of hits alone, for they are few.
            first = impact.filter(|hit| self.starts_outside(mesh, hit)).or(first);
        }
        first
    }

    /// Whether the whole motion keeps to one side of a triangle's plane.
    fn stays_beside(&self, normal: &Vector3<f64>, corner: &Vector3<f64>, margin: f64) -> bool {
        let heights =
            [&self.start, &self.end].map(|x| [normal.dot(&(x[0] - corner)), normal.dot(&(x[1] - corner))]);
        let all = |test: fn(f64, f64) -> bool| heights.iter().flatten().all(|&h| test(h, margin));
        all(|h, margin| h > margin) || all(|h, margin| h < -margin)
    }

    fn starts_outside(&self, mesh: &Mesh, hit: &Impact) -> bool {
        let x = self.start[0].lerp(&self.start[1], hit.closest.u);
        // The triangle hit is itself this near, so a closest point exists.
        let enough = 2.0 * (x - hit.closest.point).norm() + TOUCHING;
        mesh.closest(&x, enough).is_none_or(|s| s.distance > 0.0)
    }
}
