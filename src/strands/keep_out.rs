//! Keeping render strands out of the bodies that their guides are kept out of.
//!
//! A strand repeats what its guides deviate, from a root of its own and with a shape of its own, so it may run into a body that
//! its guides clear, or through what is thinner than an edge, such as an ear. From the first edge that does, the strand *leans*: beside the free chain, which goes on as if there
//! were no body, a second chain of the same edges is laid outside. Each of its edges heads for the free chain, the less so
//! the deeper that is inside: then it goes along the guide and towards it, which contact has kept outside and which, unlike the
//! nearest surface, does not change from one side of an ear to the other between two frames. An edge whose
//! end would still come too close is turned about its start; what follows is not turned with it, or a tip would swing by
//! ten times what its root is pushed. Lengths stay exact, and every moment stands for itself.

use crate::contact::Bodies;
use nalgebra::{Isometry3, Vector3};

/// How far a search for a surface reaches beyond the next edge, m.
const REACH: f64 = 0.02;

/// Turns of one edge, at most: the surface turns away under it as it goes.
const TURNS: usize = 6;

/// Cosine of the angle up to which two normals are those of one side of a body.
const LIKE: f64 = 0.5;

/// Cosine of the angle from which on they are those of two sides that face apart.
const OPPOSITE: f64 = -0.5;

/// Depth of the free chain at which a leaning strand has wholly taken to its guide, m. Less makes it take to it at a
/// touch, so that strands change their mind from frame to frame; more lets them dive until they zigzag on the surface.
const DEEP: f64 = 0.015;

/// Distance from the free chain at which a leaning strand has wholly taken to its guide, m.
const ASTRAY: f64 = 0.03;

/// How far an edge is bent towards the free chain or the guide, at most, as a share of its length.
const HOMING: f64 = 0.5;

/// Share of its distance from its guide that a strand wholly on it makes up in an edge, up to what may be bent. Less leaves strands beside
/// the guide where a body may still be; more gathers them visibly.
const GATHERING: f64 = 0.5;

/// The bodies at one moment.
#[derive(Debug, Clone, Copy)]
pub struct KeepOut<'a> {
    /// The bodies, prepared for `time`.
    pub bodies: &'a Bodies,
    /// The moment, s.
    pub time: f64,
    /// Rest space to world, one per body.
    pub poses: &'a [Isometry3<f64>],
}

/// Distances that one strand keeps, at body b and vertex k at `b * vertices + k`, m: as the groom was drawn, but no more than the
/// body's thickness. −∞ along the first stretch where that is drawn inside; deeper down negative where it is drawn inside.
#[derive(Debug, Clone)]
pub(super) struct Kept {
    distance: Vec<f32>,
    /// Whether the edge that ends there was drawn through the body.
    through: Vec<bool>,
}

impl Kept {
    /// For a strand drawn at `points` (m, rest space of bodies at their rest, which are not prepared for any step).
    pub fn new(bodies: &Bodies, thickness: &[f64], points: &[Vector3<f64>]) -> Self {
        let room = bodies.len() * points.len();
        let mut kept = Kept { distance: Vec::with_capacity(room), through: Vec::with_capacity(room) };
        for (b, &d) in thickness.iter().enumerate() {
            let mut rooted = true;
            for (k, p) in points.iter().enumerate() {
                let far = REACH.max(2.0 * d);
                let g = bodies.closest(b, 0.0, p, far).map_or(far, |s| s.distance);
                rooted &= g <= 0.0;
                let keep = if rooted {
                    f64::NEG_INFINITY
                } else if g > 0.0 {
                    d.min(0.5 * g)
                } else {
                    g
                };
                kept.distance.push(keep as f32);
                kept.through.push(k > 0 && g < far && bodies.pierced(b, 0.0, &points[k - 1], p));
            }
        }
        kept
    }
}

/// Where a chain's last vertex is beside a body: this spares searches that would find nothing.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Beside {
    /// Lower bound of its distance, m.
    distance: f64,
    /// Outward normal of the body there, in the body's frame, where it is known.
    normal: Option<Vector3<f64>>,
}

/// Which vertex of how many.
pub(super) type Place = (usize, usize);

/// A body seen from the start of an edge that may come too near to it.
struct Near<'a> {
    bodies: &'a Bodies,
    body: usize,
    time: f64,
    pose: &'a Isometry3<f64>,
    /// Where the edge starts, m, body frame.
    start: Vector3<f64>,
    /// Length of the edge, m.
    length: f64,
    /// Distance to keep, m.
    keep: f64,
    /// Whether it was drawn through the body.
    through: bool,
    beside: &'a mut Beside,
}

/// The end of an edge as a body sees it.
struct End {
    at: Beside,
    /// By how much it is too near, m. An end on the far side of what the edge went through is too near by its distance, too.
    violation: f64,
}

impl Near<'_> {
    /// Looks at an edge that ends at `end`, body frame.
    fn look(&self, end: &Vector3<f64>) -> End {
        let horizon = self.length + REACH;
        let found = self.bodies.closest(self.body, self.time, end, horizon);
        let at = found.map_or(Beside { distance: horizon, normal: None }, |s| Beside {
            distance: s.distance,
            normal: Some(s.normal),
        });
        let beyond = at.distance > 0.0 && self.straddles(&at, end);
        let violation = if beyond { self.keep + at.distance } else { self.keep - at.distance };
        End { at, violation }
    }

    /// Whether the edge to `end`, which is outside, goes through the body: an ear is thinner than an edge is long. The chord over
    /// a swelling between two places of like normals does not count.
    fn straddles(&self, at: &Beside, end: &Vector3<f64>) -> bool {
        let turned = match (&self.beside.normal, &at.normal) {
            (Some(a), Some(b)) => a.dot(b) < LIKE,
            _ => true,
        };
        turned
            && !self.through
            && self.beside.distance >= 0.0
            && self.beside.distance + at.distance < self.length
            && self.bodies.pierced(self.body, self.time, &self.start, end)
    }

    /// A direction near to `wanted`, body frame, in which the edge ends far enough away, and its end; where there is none, the
    /// best found.
    fn turn(&self, wanted: &Vector3<f64>) -> (Vector3<f64>, Beside) {
        let mut best: Option<(f64, Vector3<f64>, Beside)> = None;
        let mut try_direction = |direction: Vector3<f64>| {
            let end = self.start + direction * self.length;
            let End { at, violation } = self.look(&end);
            if best.is_none_or(|b| violation < b.0) {
                best = Some((violation, direction, at));
            }
            (end, at, violation)
        };
        let outward = self.beside.normal.or_else(|| {
            self.bodies.closest(self.body, self.time, &self.start, self.length + REACH).map(|s| s.normal)
        });
        let mut direction = *wanted;
        for _ in 0..TURNS {
            let (end, at, violation) = try_direction(direction);
            if violation <= 0.0 {
                return (direction, at);
            }
            let Some(normal) = at.normal else { break };
            // A surface that faces the other way is the far side: it would draw the edge through.
            let normal = outward.filter(|o| o.dot(&normal) < OPPOSITE).unwrap_or(normal);
            let Some(turned) = (end + normal * violation - self.start).try_normalize(1e-12) else { break };
            direction = turned;
        }
        best.map_or((*wanted, Beside::default()), |(_, direction, at)| (direction, at))
    }
}

impl KeepOut<'_> {
    /// The bodies that the vertex at `place`, at the end of an edge of `length` from `x`, has to keep a distance from and may be
    /// near to.
    fn near<'a>(
        &'a self,
        kept: &'a Kept,
        (vertex, vertices): Place,
        x: &'a Vector3<f64>,
        length: f64,
        beside: &'a mut [Beside],
    ) -> impl Iterator<Item = Near<'a>> {
        beside.iter_mut().enumerate().filter_map(move |(body, beside)| {
            let entry = body * vertices + vertex;
            let (keep, through) = (f64::from(kept.distance[entry]), kept.through[entry]);
            if keep == f64::NEG_INFINITY || beside.distance - length > keep {
                *beside = Beside { distance: beside.distance - length, normal: None };
                return None;
            }
            let pose = &self.poses[body];
            let start = pose.inverse_transform_point(&(*x).into()).coords;
            Some(Near {
                bodies: self.bodies,
                body,
                time: self.time,
                pose,
                start,
                length,
                keep,
                through,
                beside,
            })
        })
    }

    /// How much too near to a body the vertex at `place` is, at the end of `edge` from `x`, m; 0 where it is not.
    pub(super) fn violation(
        &self,
        kept: &Kept,
        place: Place,
        x: &Vector3<f64>,
        edge: &Vector3<f64>,
        beside: &mut [Beside],
    ) -> f64 {
        let mut worst = 0.0_f64;
        for near in self.near(kept, place, x, edge.norm(), beside) {
            let end = near.look(&(near.start + near.pose.inverse_transform_vector(edge)));
            *near.beside = end.at;
            worst = worst.max(end.violation);
        }
        worst
    }

    /// The direction nearest to `direction`, more or less, in which an edge of `length` from `x` ends far enough from all bodies.
    fn turn(
        &self,
        kept: &Kept,
        place: Place,
        x: &Vector3<f64>,
        length: f64,
        mut direction: Vector3<f64>,
        beside: &mut [Beside],
    ) -> Vector3<f64> {
        for near in self.near(kept, place, x, length, beside) {
            let (turned, at) = near.turn(&near.pose.inverse_transform_vector(&direction));
            direction = near.pose * turned;
            *near.beside = at;
        }
        direction
    }
}

/// A strand that leans on a body: the end of the chain outside.
#[derive(Debug)]
pub(super) struct Lean {
    x: Vector3<f64>,
    /// Share of the guide in the direction of the edges; never falls towards the tip.
    share: f64,
}

/// An edge of the free chain, world.
pub(super) struct FreeEdge {
    /// Where it starts, m.
    pub start: Vector3<f64>,
    /// From there to its end, m.
    pub edge: Vector3<f64>,
    /// By how much its end is too near to a body, m.
    pub violation: f64,
    /// Point of the guide beside it, m, and the guide's direction there.
    pub guide: (Vector3<f64>, Vector3<f64>),
}

impl Lean {
    /// A strand that leans from vertex `x` of its free chain on.
    pub fn from(x: Vector3<f64>) -> Self {
        Lean { x, share: 0.0 }
    }

    /// Whether the free chain matters no more.
    pub fn on_guide(&self) -> bool {
        self.share >= 1.0
    }

    /// Lays the next edge, of `length`, and returns its end, the vertex at `place`.
    pub fn advance(
        &mut self,
        keep_out: &KeepOut,
        kept: &Kept,
        place: Place,
        length: f64,
        free: &FreeEdge,
        beside: &mut [Beside],
    ) -> Vector3<f64> {
        let most = HOMING * length;
        let home = free.start - self.x;
        let u = (free.violation / DEEP).max(home.norm() / ASTRAY).min(1.0);
        self.share = self.share.max(u * u * (3.0 - 2.0 * u));
        let alone = free.edge + home.cap_magnitude(most);
        // Straight to the guide, not to a place along it: the strand may be the longer.
        let (point, along) = free.guide;
        let offset = point - self.x;
        let to_guide = (offset - along * along.dot(&offset)) * GATHERING;
        let with_guide = along * length + to_guide.cap_magnitude(most);
        let direction = alone.lerp(&with_guide, self.share).try_normalize(1e-12).unwrap_or(along);
        self.x += keep_out.turn(kept, place, &self.x, length, direction, beside) * length;
        self.x
    }
}
