//! The bodies that strands stay out of, at one moment.

use super::chain::Vertex;
use super::clearances::{Clearances, DistanceBounds, SEARCH_RADIUS};
use crate::contact::{Bodies, pinch};
use crate::geometry::{SolidMesh, SurfacePoint};
use nalgebra::{Isometry3, Vector3};
use std::collections::BTreeSet;

/// Distance up to which a part of a body is searched that faces another, m.
const PART_RADIUS: f64 = 0.1;

/// The bodies at one moment.
#[derive(Debug, Clone, Copy)]
pub struct Obstacles<'a> {
    /// The bodies, prepared for `time`.
    pub bodies: &'a Bodies,
    /// The moment, s.
    pub time: f64,
    /// Rest space to world, one pose per body.
    pub poses: &'a [Isometry3<f64>],
}

/// A point of a guide, or a vertex of a strand, inside a body.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct InsidePoint {
    /// Index along the curve.
    pub vertex: usize,
    /// Depth, m.
    pub depth: f64,
    /// Bodies that leave no room for it outside; empty if there is room.
    pub pinched_by: BTreeSet<u32>,
}

/// How a strand leaves another part of the deforming body that it is on, which has swallowed its root.
#[derive(Debug, Clone)]
pub(super) struct Leaving {
    /// The body.
    pub body: usize,
    /// Distance from the part that each vertex need not fall below, m.
    pub least: Vec<f64>,
}

/// Distances that the vertices of a strand keep from bodies at one moment.
#[derive(Debug, Clone, Copy)]
pub(super) struct Keep<'a> {
    /// Those of the groom.
    pub clearances: &'a Clearances,
    /// The parts that have swallowed its root, at most one of each body.
    pub leaving: &'a [Leaving],
}

/// A violation of the distance to keep from a body.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Violation {
    /// What is missing of the distance, m; 0 if nothing is.
    pub depth: f64,
    /// Outward normal of the body, world.
    pub normal: Vector3<f64>,
    /// The body.
    pub body: usize,
}

impl Keep<'_> {
    /// How the strand leaves another part of `body`.
    fn leaving(&self, body: usize) -> Option<&Leaving> {
        self.leaving.iter().find(|leaving| leaving.body == body)
    }

    /// Distance that `vertex` keeps from `body`, m.
    fn distance(&self, body: usize, vertex: usize) -> f64 {
        let least = self.leaving(body).map_or(f64::INFINITY, |leaving| leaving.least[vertex]);
        self.clearances.get(body, vertex).min(least)
    }
}

impl Obstacles<'_> {
    /// Largest violation by `vertex` at `x`, m, world, of the distances to `keep`, m. `x` lies `moved`, m,
    /// from the place that `bounds` are for; they are updated to `x`.
    pub(super) fn violation(
        &self,
        keep: &Keep,
        vertex: usize,
        x: &Vector3<f64>,
        moved: f64,
        bounds: &mut DistanceBounds,
    ) -> Violation {
        let by_part = |body| keep.leaving(body).is_some();
        self.violation_of(|body| keep.distance(body, vertex), by_part, x, moved, bounds)
    }

    /// The same of the distance to `keep` from each body. Of those of which `by_part` holds, another part that
    /// `x` is deeper in counts than the surface nearest to it.
    fn violation_of(
        &self,
        keep: impl Fn(usize) -> f64,
        by_part: impl Fn(usize) -> bool,
        x: &Vector3<f64>,
        moved: f64,
        bounds: &mut DistanceBounds,
    ) -> Violation {
        let mut worst = Violation::default();
        for (b, bound) in bounds.iter_mut().enumerate() {
            let keep = keep(b);
            *bound -= moved;
            if keep == f64::NEG_INFINITY || *bound > keep {
                continue;
            }
            let pose = &self.poses[b];
            let local = pose.inverse_transform_point(&(*x).into()).coords;
            let [least, most] = self.bodies.distance_bounds(b, &local);
            if least > keep {
                *bound = least;
                continue;
            }
            let closest = |radius| self.bodies.closest(b, self.time, &local, radius);
            let radius = most.min(moved + SEARCH_RADIUS);
            // Farther from the surface than that, only a full search tells whether it is outside.
            let Some(mut surface) = closest(radius).or_else(|| closest(f64::INFINITY)) else { continue };
            if by_part(b) {
                let mesh = self.bodies.mesh(b, self.time);
                let part = mesh
                    .and_then(|mesh| mesh.facing_or_around(&local, &surface, -pinch::FACING, PART_RADIUS));
                surface = part.filter(|part| part.distance < surface.distance).unwrap_or(surface);
            }
            *bound = surface.distance;
            if keep - surface.distance > worst.depth {
                let normal = pose.rotation * surface.normal;
                worst = Violation { depth: keep - surface.distance, normal, body: b };
            }
        }
        worst
    }

    /// The vertices at `points`, m, world, root first, that the groom places outside the bodies and that are
    /// inside. Vertices of which `is_clear` holds need no search.
    pub(super) fn inside(
        &self,
        clearances: &Clearances,
        points: impl Iterator<Item = Vector3<f64>>,
        is_clear: impl Fn(usize, &Vector3<f64>) -> bool,
        bounds: &mut DistanceBounds,
    ) -> Vec<InsidePoint> {
        bounds.reset(self.poses.len());
        let (mut last, mut s, mut found) = (None, 0.0, Vec::new());
        let mut hidden = false;
        let mut swallowed: Option<Swallowed> = None;
        let (mut first, mut by_part): ([Vector3<f64>; 2], Vec<Option<Vec<Swallowed>>>) = Default::default();
        for (vertex, x) in points.enumerate() {
            let along = last.replace(x).map_or(Vector3::zeros(), |last: Vector3<f64>| x - last);
            let moved = along.norm();
            s += moved;
            if vertex < 2 {
                first[vertex] = x;
            }
            if vertex == 0 {
                hidden = (0..self.poses.len()).any(|body| self.is_in_other_part(body, &x));
            }
            if hidden {
                // Between two parts the side changes without a surface.
                bounds.forget();
            }
            let violation = if is_clear(vertex, &x) {
                bounds.move_by(moved);
                Violation::default()
            } else {
                self.violation_of(|body| clearances.surface(body, vertex), |_| false, &x, moved, bounds)
            };
            if violation.depth == 0.0 {
                swallowed = None;
                continue;
            }
            if vertex == 0 {
                swallowed = Some(Swallowed { violation, sine: 0.0 });
            }
            let rooted = swallowed.as_mut().is_some_and(|root| {
                if vertex == 1 {
                    root.leave_along(&(x - first[0]));
                }
                root.holds(&violation, s)
            });
            let mut rooted_by_part = || {
                by_part.resize_with(self.poses.len(), || None);
                let known = &mut by_part[violation.body];
                let known = known.get_or_insert_with(|| self.swallowed_by_parts(violation.body, &first));
                known.iter().any(|part| part.holds(&violation, s))
            };
            let pinched_by = match violation.depth > pinch::MIN_DEPTH {
                true if rooted || self.faced_by_part(&violation, &x) || vertex > 0 && rooted_by_part() => {
                    BTreeSet::from([violation.body as u32])
                }
                true => {
                    let pair = |other: usize| BTreeSet::from([other, violation.body].map(|b| b as u32));
                    self.faced(&violation, &x, &along).map(pair).unwrap_or_default()
                }
                false => BTreeSet::new(),
            };
            found.push(InsidePoint { vertex, depth: violation.depth, pinched_by });
        }
        found
    }

    /// Another body that faces the way out of a body from `x`, m, world, for a strand in the direction `along`.
    fn faced(&self, inside: &Violation, x: &Vector3<f64>, along: &Vector3<f64>) -> Option<usize> {
        let out = x + inside.normal * inside.depth;
        let mut others = self.poses.iter().enumerate().filter(|(b, _)| *b != inside.body);
        let faces = |(b, pose): &(usize, &Isometry3<f64>)| {
            let b = *b;
            let local = pose.inverse_transform_point(&out.into()).coords;
            let [least, _] = self.bodies.distance_bounds(b, &local);
            let near = || self.bodies.closest(b, self.time, &local, f64::INFINITY);
            least <= pinch::ROOM
                && near().is_some_and(|surface| {
                    let normals = [&inside.normal, &(pose.rotation * surface.normal)];
                    surface.distance <= pinch::ROOM && pinch::cosine(along, normals) < -pinch::FACING
                })
        };
        others.find(faces).map(|(b, _)| b)
    }

    /// Whether another part of a deforming body faces the way out of it from `x`, m, world. It is looked for just
    /// in front: on the surface, rounding would decide of how many parts the place is inside.
    fn faced_by_part(&self, inside: &Violation, x: &Vector3<f64>) -> bool {
        let out = x + inside.normal * (inside.depth + pinch::MIN_DEPTH);
        let Some((mesh, local, on)) = self.on_deforming(inside.body, &out) else { return false };
        let part = mesh.facing(&local, &on, -pinch::FACING, PART_RADIUS);
        part.is_some_and(|part| part.distance <= pinch::ROOM)
    }

    /// How a strand with these vertices leaves the parts of deforming bodies that have swallowed its root.
    pub(super) fn leaving(&self, vertices: &[Vertex]) -> Vec<Leaving> {
        let [root, next, ..] = vertices else { return Vec::new() };
        let first = [root.x, next.x];
        let of_body = |body| {
            if !self.is_in_other_part(body, &root.x) {
                return None;
            }
            let parts = self.swallowed_by_parts(body, &first);
            let swallowed = parts.iter().find(|part| part.violation.depth > 0.0)?;
            let arc = vertices.windows(2).scan(0.0, |s, edge| {
                *s += (edge[1].x - edge[0].x).norm();
                Some(*s)
            });
            let least = std::iter::once(0.0).chain(arc).map(|s| swallowed.least(s)).collect();
            Some(Leaving { body, least })
        };
        (0..self.poses.len()).filter_map(of_body).collect()
    }

    /// Whether `x`, m, world, which is on or near the deforming body `body`, is inside another part of it.
    fn is_in_other_part(&self, body: usize, x: &Vector3<f64>) -> bool {
        let on = self.on_deforming(body, x);
        on.is_some_and(|(mesh, local, on)| mesh.in_other_part(&local, &on))
    }

    /// How the root of a strand with this first edge, m, world, is inside another part of the deforming body
    /// that it is on, or has none of [`pinch::ROOM`] before it: a part that faces its own, and the nearest at
    /// any angle that it is inside of.
    fn swallowed_by_parts(&self, body: usize, [root, next]: &[Vector3<f64>; 2]) -> Vec<Swallowed> {
        let Some((mesh, local, on)) = self.on_deforming(body, root) else { return Vec::new() };
        let facing = mesh.facing(&local, &on, -pinch::FACING, PART_RADIUS);
        let around = mesh.around(&local, &on, PART_RADIUS);
        let parts = [facing, around].into_iter().flatten().filter(|part| part.distance <= pinch::ROOM);
        let swallowed = |part: SurfacePoint| {
            let normal = self.poses[body].rotation * part.normal;
            let violation = Violation { depth: -part.distance, normal, body };
            let mut swallowed = Swallowed { violation, sine: 0.0 };
            swallowed.leave_along(&(next - root));
            swallowed
        };
        parts.map(swallowed).collect()
    }

    /// The mesh of a body that deforms, and `x`, m, world, in its frame.
    fn deforming(&self, body: usize, x: &Vector3<f64>) -> Option<(&SolidMesh, Vector3<f64>)> {
        let mesh = self.bodies.mesh(body, self.time)?;
        let deforms = self.bodies.bodies[body].solid.deforms();
        deforms.then(|| (mesh, self.poses[body].inverse_transform_point(&(*x).into()).coords))
    }

    /// The same, and the point of its surface that is nearest.
    fn on_deforming(
        &self,
        body: usize,
        x: &Vector3<f64>,
    ) -> Option<(&SolidMesh, Vector3<f64>, SurfacePoint)> {
        let (mesh, local) = self.deforming(body, x)?;
        Some((mesh, local, mesh.closest(&local, SEARCH_RADIUS)?))
    }

    /// `x` (m, world) moved out of one body after the other until `vertex` violates the distances to `keep` by
    /// at most `allowed`, m.
    pub(super) fn push_out(
        &self,
        keep: &Keep,
        vertex: usize,
        x: &Vector3<f64>,
        allowed: f64,
    ) -> Vector3<f64> {
        self.poses.iter().enumerate().fold(*x, |x, (b, pose)| {
            let keep = keep.distance(b, vertex) - allowed;
            let local = pose.inverse_transform_point(&x.into()).coords;
            match self.bodies.closest(b, self.time, &local, SEARCH_RADIUS) {
                Some(s) if s.distance < keep => x + pose.rotation * s.normal * (keep - s.distance),
                _ => x,
            }
        })
    }

    /// Distance of `x` (m, world) from the closest body, m, at most `radius`; negative inside a body, and inside
    /// a part of a deforming one.
    pub(super) fn distance(&self, x: &Vector3<f64>, radius: f64) -> f64 {
        let distance = |(b, pose): (usize, &Isometry3<f64>)| {
            let local = pose.inverse_transform_point(&(*x).into()).coords;
            let closest = |radius| self.bodies.closest(b, self.time, &local, radius);
            // Deep inside a body no surface is near either. Deforming bodies have no bounds: contact keeps
            // guides out of them.
            let [least, _] = self.bodies.distance_bounds(b, &local);
            let may_be_deep = least.is_finite() && least <= -radius;
            let deep = || if may_be_deep { closest(f64::INFINITY) } else { None };
            let Some(surface) = closest(radius).or_else(deep) else { return radius };
            let mesh = self.deforming(b, x).map(|(mesh, _)| mesh);
            match mesh.is_some_and(|mesh| mesh.in_other_part(&local, &surface)) {
                true => -surface.distance.abs(),
                false => surface.distance.min(radius),
            }
        };
        self.poses.iter().enumerate().map(distance).fold(radius, f64::min)
    }
}

/// A root inside a body that the groom places outside.
#[derive(Debug, Clone, Copy)]
struct Swallowed {
    /// How it is inside.
    violation: Violation,
    /// Sine of the angle between the body's surface and the strand at its root.
    sine: f64,
}

impl Swallowed {
    /// Sets the first edge of the strand, m, world.
    fn leave_along(&mut self, edge: &Vector3<f64>) {
        self.sine = self.violation.normal.dot(edge) / edge.norm().max(f64::MIN_POSITIVE);
    }

    /// Whether a strand from this root, which is `inside` a body at the arc length `s`, m, cannot have left
    /// the body yet.
    fn holds(&self, inside: &Violation, s: f64) -> bool {
        let least = self.least(s) - pinch::ROOM;
        inside.body == self.violation.body && -inside.depth >= least
    }

    /// Distance that the strand need not fall below at the arc length `s`, m.
    fn least(&self, s: f64) -> f64 {
        pinch::leaving(-self.violation.depth, self.sine, s)
    }
}
