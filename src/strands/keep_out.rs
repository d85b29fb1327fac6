//! Keeping render strands out of the bodies that their guides are kept out of.
//!
//! A strand repeats what its guides deviate, from a root of its own and with a shape of its own, so it may run into a body that
//! its guides clear. From the first vertex that does, or that has to retreat towards its guide, the strand *leans*: beside the free
//! chain, which goes on as if there were no body, a second chain of the same edges is laid outside, along the free chain moved by its
//! retreats. An edge whose end would still come too close is turned about its start; what follows is not turned with it, or a tip
//! would swing by ten times what its root is pushed. Lengths stay exact.

use crate::contact::Bodies;
use nalgebra::{Isometry3, Vector3};

/// How far a search for a surface reaches beyond the next edge, m.
pub(super) const REACH: f64 = 0.02;

/// Turns of one edge, at most: the surface turns away under it as it goes.
const TURNS: usize = 10;

/// How much farther than it must an edge is turned, m: for rounding.
const MARGIN: f64 = 1e-6;

/// How far an edge is bent towards where it should be, at most, as a share of its length.
const HOMING: f64 = 0.5;

/// The bodies at one moment.
#[derive(Debug, Clone, Copy)]
pub struct Obstacles<'a> {
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
    at: Vec<f32>,
    most: f64,
}

impl Kept {
    /// For a strand drawn at `points` (m, rest space of bodies at their rest, which are not prepared for any step).
    pub fn new(bodies: &Bodies, thickness: &[f64], points: &[Vector3<f64>]) -> Self {
        let mut kept = Vec::with_capacity(bodies.len() * points.len());
        for (b, &d) in thickness.iter().enumerate() {
            let mut rooted = true;
            for p in points {
                let far = REACH.max(2.0 * d);
                let [least, _] = bodies.distance_bounds(b, p);
                let closest = || bodies.closest(b, 0.0, p, far).map_or(far, |s| s.distance);
                let g = if least > 2.0 * d { least } else { closest() };
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
        let most = kept.iter().copied().fold(0.0, f32::max);
        Kept { at: kept, most: f64::from(most) }
    }
}

impl Kept {
    /// The largest of them, m, or 0.
    pub fn most(&self) -> f64 {
        self.most
    }
}

/// Lower bounds of the distance of a chain's last vertex from each body, m: they spare searches that would find nothing.
pub(super) type Spare = Vec<f64>;

/// Which vertex of how many.
pub(super) type Vertex = (usize, usize);

impl Obstacles<'_> {
    /// The bodies that the vertex at `place` has to keep a distance from and may be near to, `moved`, m, from a place that was
    /// `spare` away: index and distance to keep.
    fn near<'a>(
        &self,
        kept: &'a Kept,
        (vertex, vertices): Vertex,
        moved: f64,
        spare: &'a mut Spare,
    ) -> impl Iterator<Item = (usize, f64, &'a mut f64)> {
        spare.iter_mut().enumerate().filter_map(move |(b, spare)| {
            let keep = f64::from(kept.at[b * vertices + vertex]);
            *spare -= moved;
            (keep > f64::NEG_INFINITY && *spare <= keep).then_some((b, keep, spare))
        })
    }

    /// How much too near to a body `x` is, the vertex at `place`, m, and the outward normal of the body that it is too near to most; 0 where it
    /// is to none. It lies `moved`, m, from where `spare` was.
    pub(super) fn violation(
        &self,
        kept: &Kept,
        place: Vertex,
        x: &Vector3<f64>,
        moved: f64,
        spare: &mut Spare,
    ) -> (f64, Vector3<f64>) {
        let mut worst = (0.0, Vector3::zeros());
        for (b, keep, spare) in self.near(kept, place, moved, spare) {
            let pose = &self.poses[b];
            let local = pose.inverse_transform_point(&(*x).into()).coords;
            let [least, most] = self.bodies.distance_bounds(b, &local);
            if least > keep {
                *spare = least;
                continue;
            }
            let horizon = most.min(moved + REACH);
            let Some(surface) = self.bodies.closest(b, self.time, &local, horizon) else {
                *spare = horizon;
                continue;
            };
            *spare = surface.distance;
            if keep - surface.distance > worst.0 {
                worst = (keep - surface.distance, pose.rotation * surface.normal);
            }
        }
        worst
    }

    /// The vertex at `place`, which is at `x`, moved to where it is no more than `allowed`, m, too near to any body.
    pub(super) fn pushed_out(
        &self,
        kept: &Kept,
        (vertex, vertices): Vertex,
        x: &Vector3<f64>,
        allowed: f64,
    ) -> Vector3<f64> {
        self.poses.iter().enumerate().fold(*x, |x, (b, pose)| {
            let keep = f64::from(kept.at[b * vertices + vertex]) - allowed;
            let local = pose.inverse_transform_point(&x.into()).coords;
            match self.bodies.closest(b, self.time, &local, REACH) {
                Some(s) if s.distance < keep => x + pose.rotation * s.normal * (keep - s.distance),
                _ => x,
            }
        })
    }

    /// Distance of `x` from all bodies, m, not above `reach`; negative inside one.
    pub(super) fn room(&self, x: &Vector3<f64>, reach: f64) -> f64 {
        let distance = |(b, pose): (usize, &Isometry3<f64>)| {
            let local = pose.inverse_transform_point(&(*x).into()).coords;
            self.bodies.closest(b, self.time, &local, reach).map_or(reach, |s| s.distance)
        };
        self.poses.iter().enumerate().map(distance).fold(reach, f64::min)
    }

    /// The direction nearest to `direction`, more or less, in which an edge of `length` from `x` ends far enough from all bodies, and how much
    /// too near to one it ends, m.
    fn turn(
        &self,
        kept: &Kept,
        place: Vertex,
        x: &Vector3<f64>,
        length: f64,
        mut direction: Vector3<f64>,
        spare: &mut Spare,
    ) -> (Vector3<f64>, f64) {
        // Between two surfaces no turn may do: the best one counts.
        let mut best = (f64::INFINITY, direction);
        let mut end = *x;
        for _ in 0..TURNS {
            let next = x + direction * length;
            let (missing, normal) = self.violation(kept, place, &next, (next - end).norm(), spare);
            end = next;
            if missing < best.0 {
                best = (missing, direction);
            }
            if missing == 0.0 {
                break;
            }
            let Some(turned) = risen(&direction, &normal, (missing + MARGIN) / length) else { break };
            direction = turned;
        }
        let back = (x + best.1 * length - end).norm();
        spare.iter_mut().for_each(|spare| *spare -= back);
        (best.1, best.0)
    }
}

/// The unit vector `direction` turned towards the unit vector `normal` until it has risen along it by `more`, or as far as it can: the
/// end of an edge is then where it should be above a flat surface, and no lower above one that curves away.
fn risen(direction: &Vector3<f64>, normal: &Vector3<f64>, more: f64) -> Option<Vector3<f64>> {
    let height = direction.dot(normal);
    let along = (direction - normal * height).try_normalize(1e-12)?;
    let height = (height + more).min(1.0);
    Some(normal * height + along * (1.0 - height * height).sqrt())
}

/// A strand that leans on a body: the end of the chain outside, m, world.
#[derive(Debug)]
pub(super) struct Lean(pub Vector3<f64>);

impl Lean {
    /// Lays the next edge, of `length`, m, in the direction `way` and towards `aim`, m; returns by how much its end, the vertex at `place`,
    /// is too near to a body, m. It is not where `clear` says so.
    pub fn advance(
        &mut self,
        obstacles: &Obstacles,
        kept: &Kept,
        (place, length): (Vertex, f64),
        (aim, way): (&Vector3<f64>, &Vector3<f64>),
        clear: impl Fn(&Vector3<f64>) -> bool,
        spare: &mut Spare,
    ) -> f64 {
        let offset = aim - self.0;
        // Straight to it, not to a place along it: either may be ahead.
        let home = (offset - way * way.dot(&offset)).cap_magnitude(HOMING * length);
        let direction = (way * length + home).try_normalize(1e-12).unwrap_or(*way);
        let end = self.0 + direction * length;
        if clear(&end) {
            self.0 = end;
            // It was not looked how far the bodies are.
            spare.fill(0.0);
            return 0.0;
        }
        let (direction, missing) = obstacles.turn(kept, place, &self.0, length, direction, spare);
        self.0 += direction * length;
        missing
    }
}
