//! Keeping render strands out of the bodies that their guides are kept out of.
//!
//! A strand repeats what its guides deviate, from a root of its own and with a shape of its own, so it may run into a body that
//! its guides clear. From the first vertex that does, the strand *leans*: beside the free chain, which goes on as if there
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
pub(super) struct Kept(Vec<f32>);

impl Kept {
    /// For a strand drawn at `points` (m, rest space of bodies at their rest, which are not prepared for any step).
    pub fn new(bodies: &Bodies, thickness: &[f64], points: &[Vector3<f64>]) -> Self {
        let mut kept = Vec::with_capacity(bodies.len() * points.len());
        for (b, &d) in thickness.iter().enumerate() {
            let mut rooted = true;
            for p in points {
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
                kept.push(keep as f32);
            }
        }
        Kept(kept)
    }
}

/// Lower bounds of the distance of a chain's last vertex from each body, m: they spare searches that would find nothing.
pub(super) type Spare = Vec<f64>;

/// Which vertex of how many.
pub(super) type Place = (usize, usize);

impl KeepOut<'_> {
    /// The bodies that the vertex at `place` has to keep a distance from and may be near to, `length` after a vertex that was
    /// `spare` away: index and distance to keep.
    fn near<'a>(
        &self,
        kept: &'a Kept,
        (vertex, vertices): Place,
        length: f64,
        spare: &'a mut Spare,
    ) -> impl Iterator<Item = (usize, f64, &'a mut f64)> {
        spare.iter_mut().enumerate().filter_map(move |(b, spare)| {
            let keep = f64::from(kept.0[b * vertices + vertex]);
            *spare -= length;
            (keep > f64::NEG_INFINITY && *spare <= keep).then_some((b, keep, spare))
        })
    }

    /// How much too near to a body `x` is, the vertex at `place`, m; 0 where it is not. The edge to it has `length`.
    pub(super) fn violation(
        &self,
        kept: &Kept,
        place: Place,
        x: &Vector3<f64>,
        length: f64,
        spare: &mut Spare,
    ) -> f64 {
        let mut worst = 0.0_f64;
        for (b, keep, spare) in self.near(kept, place, length, spare) {
            let local = self.poses[b].inverse_transform_point(&(*x).into()).coords;
            let horizon = length + REACH;
            *spare = self.bodies.closest(b, self.time, &local, horizon).map_or(horizon, |s| s.distance);
            worst = worst.max(keep - *spare);
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
        spare: &mut Spare,
    ) -> Vector3<f64> {
        for (b, keep, spare) in self.near(kept, place, length, spare) {
            let (pose, horizon) = (&self.poses[b], length + REACH);
            // Between two surfaces no turn may do: the best one counts.
            let mut best = (f64::NEG_INFINITY, direction);
            for _ in 0..TURNS {
                let end = x + direction * length;
                let local = pose.inverse_transform_point(&end.into()).coords;
                let Some(surface) = self.bodies.closest(b, self.time, &local, horizon) else {
                    best = (horizon, direction);
                    break;
                };
                if surface.distance > best.0 {
                    best = (surface.distance, direction);
                }
                let missing = keep - surface.distance;
                if missing <= 0.0 {
                    break;
                }
                let wanted = end + pose.rotation * surface.normal * missing - x;
                let Some(turned) = wanted.try_normalize(1e-12) else { break };
                direction = turned;
            }
            (*spare, direction) = best;
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
        spare: &mut Spare,
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
        self.x += keep_out.turn(kept, place, &self.x, length, direction, spare) * length;
        self.x
    }
}
