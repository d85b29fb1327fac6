//! Discrete detection: contacts of a polyline, as it is at the end of a step, with bodies.
//!
//! A contact is a local minimum of the distance over both the segment and the surface. Outside, that is a
//! pair of closest points whose direction lies in the normal cone of the surface's feature. Vertices of the
//! polyline are always tested, so that a long segment at rest is held at both ends. Inner points of segments
//! add contacts at convex edges and vertices of a mesh, and at the closest point of a convex shape.
//!
//! Inside, the side matters more than the distance: behind a thin part the closest surface is the wrong one.
//! A contact is accepted if the start of the step was on the outer side of its plane. Otherwise, if the start
//! was itself inside, the closest surface is taken. Behind a mesh this works to a depth of reach +
//! |clearance|; deeper penetration, and passing right through, is left to [`ccd`](super::ccd).

use super::bodies::Bodies;
use super::cache::ContactCache;
use super::polyline::{BodyMotion, Contact, LocalContact, MovingPolyline, is_exempt};
use crate::geometry::{
    Bounds, Convex, Feature, MovingSurface, SolidMesh, SurfacePoint, closest_on_triangle, segment_segment,
};
use nalgebra::Vector3;

/// Inner points of a segment closer to an end than this fraction are left to the vertex there.
const END: f64 = 1e-6;

/// Depth in a part of a mesh, m, to which contact finds it where another part of the mesh is nearer.
const PART_DEPTH: f64 = 0.01;

impl Bodies {
    /// Appends to `out` the contacts of `line` at the end of the step with a gap below `reach`, m, positive;
    /// by body, then from root to tip.
    pub fn candidates(
        &self,
        motions: &[BodyMotion],
        line: &MovingPolyline,
        reach: f64,
        cache: &mut ContactCache,
        out: &mut Vec<Contact>,
    ) {
        let segments = line.x0.len().saturating_sub(1);
        cache.resize(self.len(), segments);
        for (b, motion) in motions.iter().enumerate() {
            cache.enter(line, motion);
            for k in 0..segments {
                self.candidates_of([b, k], motion, line, reach, cache, out);
            }
        }
    }

    /// [`Bodies::candidates`] of segment k with body b, of \[b, k\]; `cache` holds the polyline in its frame.
    pub(super) fn candidates_of(
        &self,
        [b, k]: [usize; 2],
        motion: &BodyMotion,
        line: &MovingPolyline,
        reach: f64,
        cache: &mut ContactCache,
        out: &mut Vec<Contact>,
    ) {
        let (body, clearances) = (&self.bodies[b], line.clearances(b));
        let clearance = clearances[k];
        if is_exempt(&clearance) {
            return;
        }
        let near = near(&clearance, reach, line.by_part);
        let [x0, x1] = cache.segment(k);
        if cache.is_beyond(&body.solid, b * clearances.len() + k, &[(motion.times[1], x1)], near) {
            return;
        }
        let travel = body.solid.max_travel(motion.times[1]) - body.solid.max_travel(motion.times[0]);
        let first = k == 0 || is_exempt(&clearances[k - 1]);
        let by_part = line.by_part;
        let search = Search { clearance, segment: k, first, x0, x1, near, reach, travel, by_part };
        let emit = |found: LocalContact| out.push(found.into_world(b, body.friction, motion, line));
        match body.solid.surface_over(motion.times) {
            MovingSurface::Convex(convex) => search.on_convex(convex, emit),
            MovingSurface::Mesh(meshes) => {
                cache.triangles.clear();
                meshes[1].triangles_in(&Bounds::around(&x1, near), &mut cache.triangles);
                search.on_mesh(meshes, &cache.triangles, emit);
            }
        }
    }
}

/// Distance from a segment with this clearance, m, within which its candidates lie.
pub(super) fn near(clearance: &[f64; 2], reach: f64, by_part: bool) -> f64 {
    reach + clearance[0].abs().max(clearance[1].abs()) + if by_part { PART_DEPTH } else { 0.0 }
}

/// The search for contacts of one segment with one body, in the frame of the body.
struct Search {
    /// Clearance at both ends, m.
    clearance: [f64; 2],
    segment: usize,
    /// Whether no earlier segment tests the vertex between them.
    first: bool,
    /// Ends at the start of the step, m.
    x0: [Vector3<f64>; 2],
    /// Ends at the end of the step, m.
    x1: [Vector3<f64>; 2],
    /// Distance from the segment, m, within which all triangles are known; beyond it a mesh has no contact.
    near: f64,
    reach: f64,
    /// Upper bound on the displacement of any surface point in the step, body frame, m.
    travel: f64,
    /// [`MovingPolyline::by_part`].
    by_part: bool,
}

impl Search {
    /// Vertices that this segment tests: its far end, and its near end if it is the first.
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
    fn contact(&self, u: f64, s: &SurfacePoint, before: Vector3<f64>) -> LocalContact {
        LocalContact {
            segment: self.segment,
            u,
            feature: s.feature,
            normal: s.normal,
            point: [before, s.point],
        }
    }

    fn within_reach(&self, u: f64, s: &SurfacePoint) -> bool {
        s.distance - self.clearance(u) < self.reach
    }

    /// Whether the start of the step was on the outer side of the contact's plane, which then passed through
    /// `before`.
    fn started_outside_plane(&self, u: f64, s: &SurfacePoint, before: &Vector3<f64>) -> bool {
        s.normal.dot(&(self.start(u) - before)) >= 0.0
    }

    /// Whether the start of the step was inside the mesh in its configuration `start`; the end is near its
    /// surface.
    fn started_inside(&self, start: &SolidMesh, u: f64) -> bool {
        let from = self.start(u);
        let horizon = 2.0 * ((self.end(u) - from).norm() + self.near + self.travel);
        start.closest(&from, horizon).is_some_and(|s| s.distance < 0.0)
    }

    fn on_convex(&self, shape: &Convex, mut emit: impl FnMut(LocalContact)) {
        let right_side = |u: f64, s: &SurfacePoint| {
            s.distance >= 0.0
                || self.started_outside_plane(u, s, &s.point)
                || shape.closest(&self.start(u)).distance < 0.0
        };
        let (u, inner) = shape.closest_to_segment(&self.x1[0], &self.x1[1]);
        if (END..1.0 - END).contains(&u) && self.within_reach(u, &inner) && right_side(u, &inner) {
            emit(self.contact(u, &inner, inner.point));
        }
        for u in self.vertices() {
            let s = shape.closest(&self.end(u));
            if self.within_reach(u, &s) && right_side(u, &s) {
                emit(self.contact(u, &s, s.point));
            }
        }
    }

    /// Contacts with a mesh, given in its configurations at the start and at the end of the step.
    fn on_mesh(&self, meshes: [&SolidMesh; 2], triangles: &[u32], mut emit: impl FnMut(LocalContact)) {
        if triangles.is_empty() {
            return;
        }
        self.inner_points_on_mesh(meshes, triangles, &mut emit);
        for u in self.vertices() {
            if self.by_part {
                self.vertex_on_parts(meshes, triangles, u, &mut emit);
            } else {
                self.vertex_on_mesh(meshes, triangles, u, &mut emit);
            }
        }
    }

    /// The contacts of a vertex with the parts of a mesh that overlap: with all in front of which it is, and,
    /// if it is inside the mesh, with that behind which it is least deep. Outside, it is behind a part as well
    /// where that is thin.
    fn vertex_on_parts(
        &self,
        [start, mesh]: [&SolidMesh; 2],
        triangles: &[u32],
        u: f64,
        emit: &mut impl FnMut(LocalContact),
    ) {
        let x = self.end(u);
        let mut shallowest: Option<SurfacePoint> = None;
        let mut touch = |s: &SurfacePoint| {
            if self.within_reach(u, s) {
                emit(self.contact(u, s, mesh.material_point(&s.point, s.feature, start)));
            }
        };
        for (s, is_minimum) in triangles.iter().filter_map(|&t| self.closest_of(mesh, t, &x)) {
            if is_minimum && s.distance >= 0.0 {
                touch(&s);
            } else if is_minimum
                && s.distance > -self.near
                && shallowest.is_none_or(|other| s.distance > other.distance)
            {
                shallowest = Some(s);
            }
        }
        shallowest.filter(|_| mesh.winding_number(&x) > 0.5).iter().for_each(touch);
    }

    fn inner_points_on_mesh(
        &self,
        meshes: [&SolidMesh; 2],
        triangles: &[u32],
        emit: &mut impl FnMut(LocalContact),
    ) {
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
                let Some(s) = self.near_point(mesh, &x, &edge[0].lerp(edge[1], v), feature) else { continue };
                let before = mesh.material_point(&s.point, feature, start);
                let accepted = self.within_reach(u, &s)
                    && s.distance > -self.near
                    && mesh.in_normal_cone(feature, &s.normal)
                    && (s.distance >= 0.0
                        || (mesh.closest(&x, 2.0 * self.near).is_some_and(|c| c.distance < 0.0)
                            && (self.started_outside_plane(u, &s, &before)
                                || self.started_inside(start, u))));
                if accepted {
                    emit(self.contact(u, &s, before));
                }
            }
        }
    }

    fn vertex_on_mesh(
        &self,
        [start, mesh]: [&SolidMesh; 2],
        triangles: &[u32],
        u: f64,
        emit: &mut impl FnMut(LocalContact),
    ) {
        let x = self.end(u);
        let before = |s: &SurfacePoint| mesh.material_point(&s.point, s.feature, start);
        let mut closest: Option<SurfacePoint> = None;
        let mut shallowest: Option<SurfacePoint> = None;
        let shallower = |s: &SurfacePoint, than: &Option<SurfacePoint>| {
            than.is_none_or(|other| s.distance.abs() < other.distance.abs())
        };
        for (s, is_minimum) in triangles.iter().filter_map(|&t| self.closest_of(mesh, t, &x)) {
            if s.distance >= 0.0 && is_minimum && self.within_reach(u, &s) {
                emit(self.contact(u, &s, before(&s)));
            }
            if s.distance < 0.0
                && is_minimum
                && self.started_outside_plane(u, &s, &before(&s))
                && shallower(&s, &shallowest)
            {
                shallowest = Some(s);
            }
            if shallower(&s, &closest) {
                closest = Some(s);
            }
        }
        let Some(closest) = closest.filter(|s| s.distance < 0.0 && s.distance > -self.near) else { return };
        let taken =
            if self.started_outside_plane(u, &closest, &before(&closest)) || self.started_inside(start, u) {
                Some(closest)
            } else {
                shallowest
            };
        if let Some(s) = taken.filter(|s| s.distance > -self.near && self.within_reach(u, s)) {
            emit(self.contact(u, &s, before(&s)));
        }
    }

    /// The point of a triangle of a mesh nearest to `x`, body frame, m, and whether the distance from the mesh
    /// has a minimum there that counts for this triangle; `None` if it is too far away for a contact.
    fn closest_of(&self, mesh: &SolidMesh, triangle: u32, x: &Vector3<f64>) -> Option<(SurfacePoint, bool)> {
        let (point, local) = closest_on_triangle(x, mesh.triangle(triangle));
        let s = self.near_point(mesh, x, &point, mesh.feature(triangle, local))?;
        Some((s, mesh.owns(triangle, local) && mesh.in_normal_cone(s.feature, &s.normal)))
    }

    /// [`SolidMesh::surface_point`], unless it is too far away for a contact.
    fn near_point(
        &self,
        mesh: &SolidMesh,
        x: &Vector3<f64>,
        point: &Vector3<f64>,
        feature: Feature,
    ) -> Option<SurfacePoint> {
        // The margin covers rounding.
        let near = self.near * (1.0 + 1e-9);
        ((x - point).norm_squared() < near * near).then(|| mesh.surface_point(x, point, feature))
    }
}
