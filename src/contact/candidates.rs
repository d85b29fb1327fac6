//! Discrete contacts: where a polyline, at the end of a step, is near a body or in it.
//!
//! A contact is a local minimum of the distance over both the segment and the surface. Outside, that is a pair whose
//! direction lies in the normal cone of the surface's feature. Vertices of the polyline are always tried, so that a long
//! segment at rest is held at both its ends; inner points of segments add contacts at convex edges and vertices of a mesh
//! and at the closest point of a convex shape.
//!
//! Inside, the side matters more than the distance: behind a thin part the closest surface is the wrong one. A contact is
//! taken where the start of the step was on the outer side of its plane; failing that, if the start was itself inside,
//! at the closest surface. Behind a mesh this holds to a depth of reach + |clearance|; what went deeper, or right through,
//! is left to [`ccd`](super::ccd).

use super::bodies::{Bodies, BodyMotion, Contact, ContactCache, Found, MovingPolyline};
use crate::geometry::{Bounds, SolidMesh};
use crate::geometry::{Convex, Feature, MovingSurface, SurfacePoint};
use crate::geometry::{closest_on_triangle, segment_segment};
use nalgebra::Vector3;

/// Inner points nearer to an end of their segment than this, as a fraction, are left to the vertex there.
const END: f64 = 1e-6;

impl Bodies {
    /// Appends to `out` the contacts of `line` at the end of the step whose gap is below `reach` (m, positive), body by
    /// body, root to tip.
    pub fn candidates(
        &self,
        motions: &[BodyMotion],
        line: &MovingPolyline,
        reach: f64,
        work: &mut ContactCache,
        out: &mut Vec<Contact>,
    ) {
        let segments = line.x0.len().saturating_sub(1);
        work.size(self.len(), segments);
        for (b, (body, motion)) in self.bodies.iter().zip(motions).enumerate() {
            let clearances = line.clearances(b);
            work.enter(line, motion);
            for k in 0..segments {
                let clearance = clearances[k];
                if is_exempt(&clearance) {
                    continue;
                }
                let near = reach + clearance[0].abs().max(clearance[1].abs());
                let [x0, x1] = [&work.local[0], &work.local[1]].map(|x| [x[k], x[k + 1]]);
                if work.surely_far(&body.solid, b * segments + k, &[(motion.times[1], x1)], near) {
                    continue;
                }
                let travel = body.solid.max_travel(motion.times[1]) - body.solid.max_travel(motion.times[0]);
                let first = k == 0 || is_exempt(&clearances[k - 1]);
                let finder = Finder { clearance, segment: k, first, x0, x1, near, reach, travel };
                let emit = |found: Found| out.push(found.into_world(b, body.friction, motion, line));
                match body.solid.surface_over(motion.times) {
                    MovingSurface::Convex(convex) => finder.on_convex(convex, emit),
                    MovingSurface::Mesh(meshes) => {
                        work.triangles.clear();
                        meshes[1].triangles_in(&Bounds::around(&x1, near), &mut work.triangles);
                        finder.on_mesh(meshes, &work.triangles, emit);
                    }
                }
            }
        }
    }
}

/// Whether the segment with these clearances at its ends is exempt from contact.
pub(super) fn is_exempt(clearance: &[f64; 2]) -> bool {
    clearance.contains(&f64::NEG_INFINITY)
}

/// One segment in the frame of one body.
struct Finder {
    /// At both ends, m.
    clearance: [f64; 2],
    segment: usize,
    /// Whether no segment before it speaks for the vertex between them.
    first: bool,
    x0: [Vector3<f64>; 2],
    x1: [Vector3<f64>; 2],
    /// Distance from the surface, m, within which every triangle is at hand; nothing farther is a contact with a mesh.
    near: f64,
    reach: f64,
    /// Way that no point of the surface exceeds in the step, body frame, m.
    travel: f64,
}

impl Finder {
    /// Vertices that this segment speaks for: its far end, and its near one where it is the first.
    fn vertices(&self) -> impl Iterator<Item = f64> {
        (if self.first { 0 } else { 1 }..2).map(f64::from)
    }

    fn clearance(&self, u: f64) -> f64 {
        let [from, to] = self.clearance;
        from + (to - from) * u
    }

    fn start(&self, u: f64) -> Vector3<f64> {
        self.x0[0].lerp(&self.x0[1], u)
    }

    fn end(&self, u: f64) -> Vector3<f64> {
        self.x1[0].lerp(&self.x1[1], u)
    }

    /// The contact at surface point `s`, whose material was at `before` at the start of the step.
    fn found(&self, u: f64, s: &SurfacePoint, before: Vector3<f64>) -> Found {
        Found { segment: self.segment, u, feature: s.feature, normal: s.normal, point: [before, s.point] }
    }

    fn within_reach(&self, u: f64, s: &SurfacePoint) -> bool {
        s.distance - self.clearance(u) < self.reach
    }

    /// Whether the start of the step was on the outer side of the contact's plane, which went through `before` then.
    fn came_from_outside(&self, u: f64, s: &SurfacePoint, before: &Vector3<f64>) -> bool {
        s.normal.dot(&(self.start(u) - before)) >= 0.0
    }

    /// Whether the step began inside the mesh, which was as in `start` then; the end is near its surface.
    fn started_inside(&self, start: &SolidMesh, u: f64) -> bool {
        let from = self.start(u);
        let enough = 2.0 * ((self.end(u) - from).norm() + self.near + self.travel);
        start.closest(&from, enough).is_some_and(|s| s.distance < 0.0)
    }

    fn on_convex(&self, shape: &Convex, mut emit: impl FnMut(Found)) {
        let right_side = |u: f64, s: &SurfacePoint| {
            s.distance >= 0.0
                || self.came_from_outside(u, s, &s.point)
                || shape.closest(&self.start(u)).distance < 0.0
        };
        let (u, inner) = shape.closest_to_segment(&self.x1[0], &self.x1[1]);
        if (END..1.0 - END).contains(&u) && self.within_reach(u, &inner) && right_side(u, &inner) {
            emit(self.found(u, &inner, inner.point));
        }
        for u in self.vertices() {
            let s = shape.closest(&self.end(u));
            if self.within_reach(u, &s) && right_side(u, &s) {
                emit(self.found(u, &s, s.point));
            }
        }
    }

    /// Contacts with a mesh, given as it was at the start and as it is at the end of the step.
    fn on_mesh(&self, meshes: [&SolidMesh; 2], triangles: &[u32], mut emit: impl FnMut(Found)) {
        if triangles.is_empty() {
            return;
        }
        self.inner_points_on_mesh(meshes, triangles, &mut emit);
        for u in self.vertices() {
            self.vertex_on_mesh(meshes, triangles, u, &mut emit);
        }
    }

    fn inner_points_on_mesh(&self, meshes: [&SolidMesh; 2], triangles: &[u32], emit: &mut impl FnMut(Found)) {
        let [start, mesh] = meshes;
        for &t in triangles {
            for e in mesh.edges_owned_by(t) {
                let edge = mesh.edge(e);
                let (u, v) = segment_segment([&self.x1[0], &self.x1[1]], edge);
                if !(END..1.0 - END).contains(&u) {
                    continue;
                }
                let x = self.end(u);
                let feature = match v {
                    0.0 | 1.0 => match mesh.vertex_owned_by(e, v == 1.0) {
                        Some(vertex) => Feature::Vertex(vertex),
                        None => continue,
                    },
                    _ => Feature::Edge(e),
                };
                let s = mesh.signed(&x, &edge[0].lerp(edge[1], v), feature);
                let before = mesh.carried(&s.point, feature, start);
                let accepted = self.within_reach(u, &s)
                    && s.distance > -self.near
                    && mesh.supports(feature, &s.normal)
                    && (s.distance >= 0.0
                        || (mesh.closest(&x, 2.0 * self.near).is_some_and(|c| c.distance < 0.0)
                            && (self.came_from_outside(u, &s, &before) || self.started_inside(start, u))));
                if accepted {
                    emit(self.found(u, &s, before));
                }
            }
        }
    }

    fn vertex_on_mesh(
        &self,
        [start, mesh]: [&SolidMesh; 2],
        triangles: &[u32],
        u: f64,
        emit: &mut impl FnMut(Found),
    ) {
        let x = self.end(u);
        let before = |s: &SurfacePoint| mesh.carried(&s.point, s.feature, start);
        let closest_on = |t: u32| {
            let (point, part) = closest_on_triangle(&x, mesh.triangle(t));
            (part, mesh.signed(&x, &point, mesh.feature(t, part)))
        };
        let mut closest: Option<SurfacePoint> = None;
        let mut shallowest: Option<SurfacePoint> = None;
        let shallower = |s: &SurfacePoint, than: &Option<SurfacePoint>| {
            than.is_none_or(|other| s.distance.abs() < other.distance.abs())
        };
        for &t in triangles {
            let (part, s) = closest_on(t);
            let local_minimum = mesh.owns(t, part) && mesh.supports(s.feature, &s.normal);
            if s.distance >= 0.0 && local_minimum && self.within_reach(u, &s) {
                emit(self.found(u, &s, before(&s)));
            }
            if s.distance < 0.0
                && local_minimum
                && self.came_from_outside(u, &s, &before(&s))
                && shallower(&s, &shallowest)
            {
                shallowest = Some(s);
            }
            if shallower(&s, &closest) {
                closest = Some(s);
            }
        }
        let Some(closest) = closest.filter(|s| s.distance < 0.0 && s.distance > -self.near) else { return };
        let taken = if self.came_from_outside(u, &closest, &before(&closest)) || self.started_inside(start, u)
        {
            Some(closest)
        } else {
            shallowest
        };
        if let Some(s) = taken.filter(|s| s.distance > -self.near && self.within_reach(u, s)) {
            emit(self.found(u, &s, before(&s)));
        }
    }
}
