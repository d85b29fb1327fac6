//! The bodies of a scene, the polylines that meet them, and the memory that spares repeated searches.

use super::shape::{Feature, Shape, Surface, SurfacePoint};
use crate::scene::{Collider, Friction, Shape as SceneShape};
use nalgebra::{Isometry3, Vector3};

/// One body.
#[derive(Debug)]
pub struct Body {
    /// Its surface, in its own frame.
    pub shape: Shape,
    /// Its friction, or `None` to take the strand's own.
    pub friction: Option<Friction>,
}

/// All bodies; queries take `&self` and may run on many threads. Those that deform answer for the step that [`Bodies::prepare`] was
/// told, and for the mesh at rest before that.
#[derive(Debug, Default)]
pub struct Bodies {
    /// The bodies, in the scene's order.
    pub bodies: Vec<Body>,
}

/// Motion of a body over a step or a part of one.
#[derive(Debug, Clone, Copy)]
pub struct Motion {
    /// Start and end, s, within the step that the bodies are prepared for: when a body that deforms has its shape.
    pub times: [f64; 2],
    /// Body frame to world at the start.
    pub start: Isometry3<f64>,
    /// The same at the end.
    pub end: Isometry3<f64>,
}

/// A polyline that moves over a sub-step; `n` vertices, root first, world frame, m.
#[derive(Debug, Clone, Copy)]
pub struct Polyline<'a> {
    /// Vertices at the start.
    pub x0: &'a [Vector3<f64>],
    /// Candidate vertices at the end.
    pub x1: &'a [Vector3<f64>],
    /// Distance to keep from the surface of body b at the two ends of segment k, m, at `b * (n - 1) + k`; linear in between.
    /// Negative where something is being brought out of the body; a segment with an end at −∞ is exempt from contact with it.
    pub clearance: &'a [[f64; 2]],
}

/// A place where a polyline must keep its distance from a body.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Contact {
    /// Segment of the polyline, from vertex `segment` to the next.
    pub segment: usize,
    /// Place on the segment, 0..=1.
    pub u: f64,
    /// Index of the body.
    pub body: usize,
    /// Where on the body.
    pub feature: Feature,
    /// Unit normal, out of the body, world, at the end of the sub-step.
    pub normal: Vector3<f64>,
    /// The body's material point, world, at the start and at the end of the sub-step; their difference over the sub-step
    /// is its velocity.
    pub point: [Vector3<f64>; 2],
    /// `n·(x1(u) − point[1]) − d(u)`, m; negative where the clearance is violated.
    pub gap: f64,
    /// Friction of the body, or `None` to take the strand's own.
    pub friction: Option<Friction>,
}

/// Buffers and memory of one polyline, reused from step to step. Its memory never changes a result: it only spares
/// searches whose answer it proves to be "nothing near".
#[derive(Debug, Clone, Default)]
pub struct Workspace {
    /// Vertices at start and end in the frame of the body at hand.
    pub(super) local: [Vec<Vector3<f64>>; 2],
    /// Triangles near the segment at hand.
    pub(super) triangles: Vec<u32>,
    /// One per body and segment.
    pub(super) remembered: Vec<Remembered>,
}

/// How far surfaces are looked for around a single point, m.
const HORIZON: f64 = 0.1;

/// Where a point was when it was last seen outside of a body, body frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Outside {
    at: Vector3<f64>,
    /// Lower bound of its distance, m; 0 when nothing is known.
    distance: f64,
    /// A place of the surface, m, body frame; infinitely far where none is known.
    foot: Vector3<f64>,
    /// Way that the surface had gone then, m.
    travel: f64,
}

impl Default for Outside {
    fn default() -> Self {
        Outside { at: Vector3::zeros(), distance: 0.0, foot: Vector3::repeat(f64::INFINITY), travel: 0.0 }
    }
}

/// Where a segment was when it was last seen far from a body, body frame, and how far.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Remembered {
    ends: [Vector3<f64>; 2],
    /// Lower bound of the distance of every point of the segment to the surface, m; 0 when nothing is known.
    distance: f64,
    /// Way that the surface had gone then, m.
    travel: f64,
}

impl Default for Remembered {
    fn default() -> Self {
        Remembered { ends: [Vector3::zeros(); 2], distance: 0.0, travel: 0.0 }
    }
}

impl Remembered {
    /// The segment at `ends` at time `t` and its least distance, bounded by that of its middle.
    fn look(shape: &Shape, t: f64, ends: [Vector3<f64>; 2], farther_than: f64) -> Self {
        let half = 0.5 * (ends[1] - ends[0]).norm();
        // A search has no use beyond a few steps' motion, and costs more the farther it goes.
        let horizon = half + 8.0 * farther_than;
        let middle = 0.5 * (ends[0] + ends[1]);
        let distance = match shape.over([t, t]) {
            // Contacts with a convex shape are found at any depth: only outside is far.
            Surface::Convex(convex) => convex.closest(&middle).distance,
            Surface::Mesh([mesh, _]) => mesh.closest(&middle, horizon).map_or(horizon, |s| s.distance.abs()),
        };
        // The margin keeps the bound a bound under rounding.
        Remembered { ends, distance: (distance - half) * (1.0 - 1e-9) - 1e-12, travel: shape.travel(t) }
    }

    /// Whether the segment is surely `reach` or more away at all of `places`, and anywhere between them: no point of it
    /// can have come closer than the farther-moved end has moved, and the surface.
    fn far(&self, shape: &Shape, places: &[(f64, [Vector3<f64>; 2])], reach: f64) -> bool {
        let moved = places
            .iter()
            .flat_map(|(_, x)| [(x[0] - self.ends[0]).norm_squared(), (x[1] - self.ends[1]).norm_squared()])
            .fold(0.0, f64::max);
        let met = places.iter().map(|(t, _)| (shape.travel(*t) - self.travel).abs()).fold(0.0, f64::max);
        let spare = self.distance - reach - met;
        spare > 0.0 && moved < spare * spare
    }
}

impl Workspace {
    /// Moves the polyline into the frame of a body.
    pub(super) fn enter(&mut self, line: &Polyline, motion: &Motion) {
        let poses = [motion.start.inverse(), motion.end.inverse()];
        for ((local, world), pose) in self.local.iter_mut().zip([line.x0, line.x1]).zip(poses) {
            local.clear();
            local.extend(world.iter().map(|x| pose.rotation * x + pose.translation.vector));
        }
    }

    /// Makes room for `bodies` times `segments`; forgets all if the numbers changed.
    pub(super) fn size(&mut self, bodies: usize, segments: usize) {
        if self.remembered.len() != bodies * segments {
            self.remembered.clear();
            self.remembered.resize(bodies * segments, Remembered::default());
        }
    }

    /// Whether the segment in `slot` surely keeps `reach` from the surface of `shape` at all of `places` (time, s, and ends in the
    /// body's frame) and between them: from memory, or by one new look.
    pub(super) fn surely_far(
        &mut self,
        shape: &Shape,
        slot: usize,
        places: &[(f64, [Vector3<f64>; 2])],
        reach: f64,
    ) -> bool {
        let memory = &mut self.remembered[slot];
        if memory.far(shape, places, reach) {
            return true;
        }
        let (t, ends) = places[0];
        *memory = Remembered::look(shape, t, ends, reach);
        memory.far(shape, places, reach)
    }
}

impl Bodies {
    /// The colliders' shapes, each in its rest space.
    pub fn new(colliders: &[Collider]) -> Self {
        let body =
            |c: &Collider| Body { shape: Shape::new(&c.shape, c.deformation.as_ref()), friction: c.friction };
        Bodies { bodies: colliders.iter().map(body).collect() }
    }

    /// Makes the bodies that deform ready for the step between two times, s: once for all that meets them.
    pub fn prepare(&mut self, times: [f64; 2]) {
        for body in &mut self.bodies {
            if let Shape::Deforming(deforming) = &mut body.shape {
                deforming.prepare(times);
            }
        }
    }

    /// From shapes alone, friction left to the strands.
    pub fn from_shapes(shapes: &[SceneShape]) -> Self {
        let body = |shape| Body { shape: Shape::new(shape, None), friction: None };
        Bodies { bodies: shapes.iter().map(body).collect() }
    }

    /// Number of bodies.
    pub fn len(&self) -> usize {
        self.bodies.len()
    }

    /// Tells `found` of each of the points `x`, m, world, that is nearer to a body than `within` says, m, at body b and point k at
    /// `b * x.len() + k`: that index, the distance, m, and the body's outward normal, world. The bodies are at time `t`, s, at `poses`. `memory` is
    /// that of the same points before; it never changes the answer.
    pub fn each_nearer(
        &self,
        (t, poses): (f64, &[Isometry3<f64>]),
        x: &[Vector3<f64>],
        within: &[f64],
        memory: &mut Vec<Outside>,
        mut found: impl FnMut(usize, f64, Vector3<f64>),
    ) {
        let points = x.len();
        memory.resize(within.len(), Outside::default());
        for (b, (body, pose)) in self.bodies.iter().zip(poses).enumerate() {
            let travel = body.shape.travel(t);
            let (turn, origin) = (pose.rotation.inverse().to_rotation_matrix(), pose.translation.vector);
            for (k, x) in x.iter().enumerate() {
                let i = b * points + k;
                let (within, seen) = (within[i], &mut memory[i]);
                let at = turn * (x - origin);
                let gone = (travel - seen.travel).abs();
                let spare = seen.distance - gone - within.max(0.0);
                if within == f64::NEG_INFINITY || spare > 0.0 && (at - seen.at).norm_squared() < spare * spare
                {
                    continue;
                }
                let [least, _] = body.shape.distance_bounds(&at);
                if least > within.max(0.0) {
                    (seen.at, seen.distance) = (at, least);
                    // The foot is as old as it was.
                    continue;
                }
                // The surface is no farther than where it was seen last; with a margin for rounding.
                let horizon = HORIZON.min(((at - seen.foot).norm() + gone) * (1.0 + 1e-9) + 1e-9);
                let surface = body.shape.closest(t, &at, horizon);
                let distance = surface.map_or(horizon, |s| s.distance);
                let foot = surface.map_or(Outside::default().foot, |s| s.point);
                *seen = Outside { at, distance: distance * (1.0 - 1e-9) - 1e-12, foot, travel };
                if let Some(surface) = surface.filter(|s| s.distance < within) {
                    found(i, surface.distance, pose.rotation * surface.normal);
                }
            }
        }
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.bodies.is_empty()
    }

    /// Closest point of a body at time `t`, s, all in its own frame; `None` beyond `max_distance`.
    pub fn closest(&self, body: usize, t: f64, p: &Vector3<f64>, max_distance: f64) -> Option<SurfacePoint> {
        self.bodies[body].shape.closest(t, p, max_distance)
    }

    /// What the signed distance of `p` from a body, body frame, is not below, and its magnitude not above, m, as far as it is known without a search.
    pub fn distance_bounds(&self, body: usize, p: &Vector3<f64>) -> [f64; 2] {
        self.bodies[body].shape.distance_bounds(p)
    }

    /// Where the way from `a` to `b` first goes through the surface of a body at time `t`, s, from either side: share of the way, and the
    /// outward normal there, all in the body's own frame.
    pub fn first_hit(
        &self,
        body: usize,
        t: f64,
        a: &Vector3<f64>,
        b: &Vector3<f64>,
    ) -> Option<(f64, Vector3<f64>)> {
        self.bodies[body].shape.first_hit(t, a, b)
    }

    /// Whether a point, in the body's own frame, is inside it at time `t`, s. For a mesh this costs O(triangles): for set-up only.
    pub fn inside(&self, body: usize, t: f64, p: &Vector3<f64>) -> bool {
        self.bodies[body].shape.inside(t, p)
    }
}

/// A contact found in the frame of a body.
#[derive(Debug, Clone, Copy)]
pub(super) struct Found {
    pub segment: usize,
    pub u: f64,
    pub feature: Feature,
    /// As the surface is at the end.
    pub normal: Vector3<f64>,
    /// The material point at the start and at the end.
    pub point: [Vector3<f64>; 2],
}

impl Found {
    /// The contact in the world, its gap measured at the end of the step.
    pub fn into_world(
        self,
        body: usize,
        friction: Option<Friction>,
        motion: &Motion,
        line: &Polyline,
    ) -> Contact {
        let Found { segment: k, u, feature, normal, point } = self;
        let to_world = |pose: &Isometry3<f64>, y: &Vector3<f64>| pose.rotation * y + pose.translation.vector;
        let point = [to_world(&motion.start, &point[0]), to_world(&motion.end, &point[1])];
        let normal = motion.end.rotation * normal;
        let contact = Contact { segment: k, u, body, feature, normal, point, gap: 0.0, friction };
        Contact { gap: line.gap(&contact), ..contact }
    }
}

impl Polyline<'_> {
    /// Clearances from a body of all segments.
    pub(super) fn beside(&self, body: usize) -> &[[f64; 2]] {
        let segments = self.x0.len().saturating_sub(1);
        &self.clearance[body * segments..][..segments]
    }

    /// Gap of `contact` with the vertices as they are now at the end of the step, m.
    pub fn gap(&self, contact: &Contact) -> f64 {
        let k = contact.segment;
        let x = self.x1[k] + (self.x1[k + 1] - self.x1[k]) * contact.u;
        contact.normal.dot(&(x - contact.point[1])) - self.kept_at(contact)
    }

    /// How far the place of `contact` has moved along its plane from where that touches the surface, m.
    pub fn beside_plane(&self, contact: &Contact) -> f64 {
        let k = contact.segment;
        let x = self.x1[k] + (self.x1[k + 1] - self.x1[k]) * contact.u - contact.point[1];
        (x - contact.normal * contact.normal.dot(&x)).norm()
    }

    /// Clearance at the place of `contact`, m.
    pub fn kept_at(&self, contact: &Contact) -> f64 {
        let [from, to] = self.beside(contact.body)[contact.segment];
        from + (to - from) * contact.u
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::Shape;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn what_is_known_of_points_outside_never_changes_the_answer(
            steps in prop::collection::vec(prop::array::uniform6(-0.004..0.004_f64), 60)
        ) {
            let centre = Vector3::new(0.0, 0.02, 0.0);
            let bodies = Bodies::from_shapes(&[
                Shape::Sphere { centre: Vector3::zeros(), radius: 0.01 },
                Shape::Sphere { centre, radius: 0.005 },
            ]);
            let mut poses = [Isometry3::identity(); 2];
            // Of the second point and the second body nothing is asked; of the first, that it may be a little inside.
            let kept = [-1e-3, 5e-4, 1e-3, f64::NEG_INFINITY];
            let mut x = [Vector3::new(0.013, 0.0, 0.0), Vector3::new(-0.013, 0.0, 0.0)];
            let mut memory = Vec::new();
            for step in steps {
                let (a, b) = step.split_at(3);
                x[0] += Vector3::from_column_slice(a);
                x[1] += Vector3::from_column_slice(b);
                poses[1].translation.vector += Vector3::from_column_slice(a) - Vector3::from_column_slice(b);
                let distance = |b: usize, x: &Vector3<f64>| {
                    let at = poses[b].inverse_transform_point(&(*x).into()).coords;
                    if b == 0 { at.norm() - 0.01 } else { (at - centre).norm() - 0.005 }
                };
                let nearer: Vec<usize> = (0..4).filter(|i| distance(i / 2, &x[i % 2]) < kept[*i]).collect();
                let mut found = Vec::new();
                bodies.each_nearer((0.0, &poses), &x, &kept, &mut memory, |i, at, _| found.push((i, at)));
                prop_assert_eq!(found.iter().map(|f| f.0).collect::<Vec<_>>(), nearer);
                prop_assert!(found.iter().all(|(i, at)| (at - distance(i / 2, &x[i % 2])).abs() < 1e-12));
            }
        }
    }
}
