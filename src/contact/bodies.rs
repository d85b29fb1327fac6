//! The bodies of a scene, the polylines that meet them, and the memory that spares repeated searches.

use crate::geometry::{Deformation, Feature, Friction, MovingSurface, Shape, Solid, SurfacePoint};
use nalgebra::{Isometry3, Vector3};
use std::sync::Arc;

/// One body.
#[derive(Debug)]
pub struct Body {
    /// Its surface, in its own frame.
    pub solid: Solid,
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

/// BodyMotion of a body over a step or a part of one.
#[derive(Debug, Clone, Copy)]
pub struct BodyMotion {
    /// Start and end, s, within the step that the bodies are prepared for: when a body that deforms has its shape.
    pub times: [f64; 2],
    /// Body frame to world at the start.
    pub start: Isometry3<f64>,
    /// The same at the end.
    pub end: Isometry3<f64>,
}

/// A polyline that moves over a sub-step; `n` vertices, root first, world frame, m.
#[derive(Debug, Clone, Copy)]
pub struct MovingPolyline<'a> {
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
pub struct ContactCache {
    /// Vertices at start and end in the frame of the body at hand.
    pub(super) local: [Vec<Vector3<f64>>; 2],
    /// Triangles near the segment at hand.
    pub(super) triangles: Vec<u32>,
    /// One per body and segment.
    pub(super) remembered: Vec<Remembered>,
}

/// Points of a polyline, and middles behind them, that are asked about at once: where they are all far from a body, one answer does.
const BUNCH: usize = 4;

/// What spares searches for the points of one [`Bodies::each_point_within`].
#[derive(Debug, Clone, Default)]
pub struct ProximityCache {
    /// Of each point beside each body.
    points: Vec<Outside>,
    /// Of the middle of each bunch beside each body.
    bunches: Vec<Outside>,
    /// Balls around the bunches as they are: middle, m, world, and radius, m.
    balls: Vec<(Vector3<f64>, f64)>,
    /// Which of them are near the body at hand.
    near: Vec<bool>,
}

impl ProximityCache {
    /// Puts balls around bunches of `x`, and makes room for so many bodies.
    fn gather(&mut self, x: &[Vector3<f64>], bodies: usize) {
        let (points, middles) = x.split_at(x.len().div_ceil(2));
        self.balls.clear();
        self.balls.extend((0..points.len()).step_by(BUNCH).map(|first| {
            let bunch = [points, middles].map(|x| &x[first..x.len().min(first + BUNCH)]);
            let middle = bunch[0][bunch[0].len() / 2];
            let square = bunch.into_iter().flatten().map(|x| (x - middle).norm_squared()).fold(0.0, f64::max);
            // With a margin for rounding.
            (middle, square.sqrt() * (1.0 + 1e-9) + 1e-12)
        }));
        self.points.resize(bodies * x.len(), Outside::default());
        self.bunches.resize(bodies * self.balls.len(), Outside::default());
    }
}

/// Where a point was when it was last seen outside of a body, body frame.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Outside {
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

impl Outside {
    /// Whether the point, which is `at` now, body frame, and the surface has gone `travel`, m, is surely farther away than `reach`, m: as far as is
    /// remembered, or known without a search.
    fn surely_beyond(&mut self, reach: f64, solid: &Solid, travel: f64, at: &Vector3<f64>) -> bool {
        let spare = self.distance - (travel - self.travel).abs() - reach;
        if spare > 0.0 && (at - self.at).norm_squared() < spare * spare {
            return true;
        }
        let least = solid.distance_lower_bound(at);
        if least > reach {
            // The foot is as old as it was.
            (self.at, self.distance) = (*at, least);
        }
        least > reach
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
    fn look(solid: &Solid, t: f64, ends: [Vector3<f64>; 2], farther_than: f64) -> Self {
        let half = 0.5 * (ends[1] - ends[0]).norm();
        // A search has no use beyond a few steps' motion, and costs more the farther it goes.
        let horizon = half + 8.0 * farther_than;
        let middle = 0.5 * (ends[0] + ends[1]);
        let distance = match solid.surface_over([t, t]) {
            // Contacts with a convex shape are found at any depth: only outside is far.
            MovingSurface::Convex(convex) => convex.closest(&middle).distance,
            MovingSurface::Mesh([mesh, _]) => {
                mesh.closest(&middle, horizon).map_or(horizon, |s| s.distance.abs())
            }
        };
        // The margin keeps the bound a bound under rounding.
        Remembered { ends, distance: (distance - half) * (1.0 - 1e-9) - 1e-12, travel: solid.max_travel(t) }
    }

    /// Whether the segment is surely `reach` or more away at all of `places`, and anywhere between them: no point of it
    /// can have come closer than the farther-moved end has moved, and the surface.
    fn far(&self, solid: &Solid, places: &[(f64, [Vector3<f64>; 2])], reach: f64) -> bool {
        let moved = places
            .iter()
            .flat_map(|(_, x)| [(x[0] - self.ends[0]).norm_squared(), (x[1] - self.ends[1]).norm_squared()])
            .fold(0.0, f64::max);
        let met = places.iter().map(|(t, _)| (solid.max_travel(*t) - self.travel).abs()).fold(0.0, f64::max);
        let spare = self.distance - reach - met;
        spare > 0.0 && moved < spare * spare
    }
}

impl ContactCache {
    /// Moves the polyline into the frame of a body.
    pub(super) fn enter(&mut self, line: &MovingPolyline, motion: &BodyMotion) {
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

    /// Whether the segment in `slot` surely keeps `reach` from the surface of `solid` at all of `places` (time, s, and ends in the
    /// body's frame) and between them: from memory, or by one new look.
    pub(super) fn surely_far(
        &mut self,
        solid: &Solid,
        slot: usize,
        places: &[(f64, [Vector3<f64>; 2])],
        reach: f64,
    ) -> bool {
        let memory = &mut self.remembered[slot];
        if memory.far(solid, places, reach) {
            return true;
        }
        let (t, ends) = places[0];
        *memory = Remembered::look(solid, t, ends, reach);
        memory.far(solid, places, reach)
    }
}

impl Body {
    /// Of a shape in the body's own frame, whose vertices `deformation` moves there.
    pub fn new(shape: &Shape, deformation: Option<&Arc<Deformation>>, friction: Option<Friction>) -> Self {
        Body { solid: Solid::new(shape, deformation), friction }
    }
}

impl Bodies {
    /// Of these bodies, in this order.
    pub fn new(bodies: impl IntoIterator<Item = Body>) -> Self {
        Bodies { bodies: bodies.into_iter().collect() }
    }

    /// Makes the bodies that deform ready for the step between two times, s: once for all that meets them.
    pub fn prepare(&mut self, times: [f64; 2]) {
        for body in &mut self.bodies {
            if let Solid::Deforming(deforming) = &mut body.solid {
                deforming.prepare(times);
            }
        }
    }

    /// From shapes alone, friction left to the strands.
    pub fn from_shapes(shapes: &[Shape]) -> Self {
        Bodies::new(shapes.iter().map(|shape| Body::new(shape, None, None)))
    }

    /// Number of bodies.
    pub fn len(&self) -> usize {
        self.bodies.len()
    }

    /// Tells `found` of each of the places `x` of a polyline, its points, then the middles between any two, m, world, that is nearer to a body than `within`
    /// says, m, at body b and place k at `b * x.len() + k`, in order: that index, the distance, m, and the body's outward normal, world. The bodies are at
    /// time `t`, s, at `poses`. `memory` is that of the same places before; it changes no answer but beside an open border of a mesh, where a place comes to
    /// the other side without going through the surface.
    pub fn each_point_within(
        &self,
        (t, poses): (f64, &[Isometry3<f64>]),
        x: &[Vector3<f64>],
        within: &[f64],
        memory: &mut ProximityCache,
        mut found: impl FnMut(usize, f64, Vector3<f64>),
    ) {
        memory.gather(x, self.len());
        let ProximityCache { points: seen, bunches, balls, near } = memory;
        let (bunches, points) = (bunches.chunks_mut(balls.len().max(1)), x.len().div_ceil(2));
        for (b, ((body, pose), bunches)) in self.bodies.iter().zip(poses).zip(bunches).enumerate() {
            let travel = body.solid.max_travel(t);
            let (turn, origin) = (pose.rotation.inverse().to_rotation_matrix(), pose.translation.vector);
            let of_body = b * x.len()..(b + 1) * x.len();
            let (within, seen) = (&within[of_body.clone()], &mut seen[of_body]);
            let most = within.iter().copied().fold(0.0, f64::max);
            near.clear();
            near.extend(balls.iter().zip(bunches).map(|((middle, radius), seen)| {
                !seen.surely_beyond(radius + most, &body.solid, travel, &(turn * (middle - origin)))
            }));
            for half in [0..points, points..x.len()] {
                let first = half.start;
                for k in half.filter(|k| near[(k - first) / BUNCH] && within[*k] > f64::NEG_INFINITY) {
                    let (at, seen) = (turn * (x[k] - origin), &mut seen[k]);
                    if seen.surely_beyond(within[k].max(0.0), &body.solid, travel, &at) {
                        continue;
                    }
                    // The surface is no farther than where it was seen last; with a margin for rounding.
                    let gone = (travel - seen.travel).abs();
                    let horizon = ((at - seen.foot).norm() + gone) * (1.0 + 1e-9) + 1e-9;
                    let surface = body.solid.closest(t, &at, horizon);
                    let distance = surface.map_or(horizon, |s| s.distance);
                    let foot = surface.map_or(Outside::default().foot, |s| s.point);
                    *seen = Outside { at, distance: distance * (1.0 - 1e-9) - 1e-12, foot, travel };
                    if let Some(surface) = surface.filter(|s| s.distance < within[k]) {
                        found(b * x.len() + k, surface.distance, pose.rotation * surface.normal);
                    }
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
        self.bodies[body].solid.closest(t, p, max_distance)
    }

    /// What the signed distance of `p` from a body, body frame, is not below, and its magnitude not above, m, as far as it is known without a search.
    pub fn distance_bounds(&self, body: usize, p: &Vector3<f64>) -> [f64; 2] {
        self.bodies[body].solid.distance_bounds(p)
    }

    /// Where the way from `a` to `b` first goes through the surface of a body at time `t`, s, from either side: share of the way, and the
    /// outward normal there, all in the body's own frame.
    pub fn first_intersection(
        &self,
        body: usize,
        t: f64,
        a: &Vector3<f64>,
        b: &Vector3<f64>,
    ) -> Option<(f64, Vector3<f64>)> {
        self.bodies[body].solid.first_intersection(t, a, b)
    }

    /// Whether a point, in the body's own frame, is inside it at time `t`, s. For a mesh this is dear: for set-up only.
    pub fn contains(&self, body: usize, t: f64, p: &Vector3<f64>) -> bool {
        self.bodies[body].solid.contains(t, p)
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
        motion: &BodyMotion,
        line: &MovingPolyline,
    ) -> Contact {
        let Found { segment: k, u, feature, normal, point } = self;
        let to_world = |pose: &Isometry3<f64>, y: &Vector3<f64>| pose.rotation * y + pose.translation.vector;
        let point = [to_world(&motion.start, &point[0]), to_world(&motion.end, &point[1])];
        let normal = motion.end.rotation * normal;
        let contact = Contact { segment: k, u, body, feature, normal, point, gap: 0.0, friction };
        Contact { gap: line.gap(&contact), ..contact }
    }
}

impl MovingPolyline<'_> {
    /// Clearances from a body of all segments.
    pub(super) fn clearances(&self, body: usize) -> &[[f64; 2]] {
        let segments = self.x0.len().saturating_sub(1);
        &self.clearance[body * segments..][..segments]
    }

    /// Gap of `contact` with the vertices as they are now at the end of the step, m.
    pub fn gap(&self, contact: &Contact) -> f64 {
        let k = contact.segment;
        let x = self.x1[k] + (self.x1[k + 1] - self.x1[k]) * contact.u;
        contact.normal.dot(&(x - contact.point[1])) - self.clearance_at(contact)
    }

    /// How far the place of `contact` has moved along its plane from where that touches the surface, m.
    pub fn tangential_offset(&self, contact: &Contact) -> f64 {
        let k = contact.segment;
        let x = self.x1[k] + (self.x1[k + 1] - self.x1[k]) * contact.u - contact.point[1];
        (x - contact.normal * contact.normal.dot(&x)).norm()
    }

    /// Clearance at the place of `contact`, m.
    pub fn clearance_at(&self, contact: &Contact) -> f64 {
        let [from, to] = self.clearances(contact.body)[contact.segment];
        from + (to - from) * contact.u
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_far_inside_is_told_of() {
        let ball = Shape::Sphere { centre: Vector3::zeros(), radius: 0.3 }.tessellate();
        let bodies = Bodies::from_shapes(&[Shape::Mesh(ball)]);
        let x = [Vector3::x() * 0.5, Vector3::x() * 0.1, Vector3::x() * 0.3];
        let (mut memory, mut told) = (ProximityCache::default(), Vec::new());
        // Twice: what is remembered is as right as what is found.
        for _ in 0..2 {
            bodies.each_point_within(
                (0.0, &[Isometry3::identity()]),
                &x,
                &[5e-4; 3],
                &mut memory,
                |k, distance, _| told.push((k, (distance * 100.0).round() as i32)),
            );
        }
        assert_eq!(told, [(1, -20), (2, 0)].repeat(2));
    }
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn what_is_known_of_places_outside_never_changes_the_answer(
            places in prop::collection::vec(prop::array::uniform3(-0.03..0.03_f64), 10),
            steps in prop::collection::vec(prop::array::uniform6(-0.004..0.004_f64), 60),
        ) {
            let (a, b, radius) = (Vector3::new(0.12, 0.02, 0.0), Vector3::new(0.13, 0.0, 0.01), 0.01);
            let bodies = Bodies::from_shapes(&[
                Shape::Sphere { centre: Vector3::zeros(), radius },
                Shape::Capsule { ends: [a, b], radius },
            ]);
            let mut poses = [Isometry3::identity(); 2];
            // The first bunch is about the first body, the last and smaller one about the second; each is far from the other.
            let along = |k: usize| Vector3::x() * (0.06 * (k / BUNCH) as f64);
            let mut points: Vec<_> = (0..).zip(&places).map(|(k, p)| along(k) + Vector3::from(*p)).collect();
            // Some may be a little inside; of some nothing is asked.
            let count = 2 * points.len() - 1;
            let within: Vec<_> = [-1e-3, 5e-4, 5e-3, f64::NEG_INFINITY, 0.0].into_iter().cycle().take(2 * count).collect();
            let mut memory = ProximityCache::default();
            for step in steps {
                let [one, other] = [0, 3].map(|i| Vector3::from_column_slice(&step[i..i + 3]));
                points.iter_mut().step_by(2).for_each(|x| *x += one);
                points.iter_mut().skip(1).step_by(2).for_each(|x| *x += other);
                poses[1].translation.vector += one - other;
                let mut x = points.clone();
                x.extend(points.windows(2).map(|x| 0.5 * (x[0] + x[1])));
                let distance = |i: usize| {
                    let at = poses[i / count].inverse_transform_point(&x[i % count].into()).coords;
                    let axis = |i: usize| if i < count { [Vector3::zeros(); 2] } else { [a, b] };
                    crate::math::polyline::distance(&at, &axis(i)) - radius
                };
                let nearer: Vec<_> = (0..2 * count).filter(|i| distance(*i) < within[*i]).collect();
                let mut found = Vec::new();
                bodies.each_point_within((0.0, &poses), &x, &within, &mut memory, |i, at, _| found.push((i, at)));
                prop_assert_eq!(found.iter().map(|f| f.0).collect::<Vec<_>>(), nearer);
                prop_assert!(found.iter().all(|(i, at)| (at - distance(*i)).abs() < 1e-12));
            }
        }
    }
}
