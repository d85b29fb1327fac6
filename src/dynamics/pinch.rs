//! Guides between bodies that leave no room for them: the distances that are left, and where.

use super::simulation::Simulation;
use crate::contact::{Bodies, BodyMotion, pinch};
use crate::geometry::SurfacePoint;
use crate::math::se3::Pose;
use nalgebra::{Isometry3, Vector3};

/// Distance up to which surfaces are searched, m: deeper places have no near side.
const SEARCH_RADIUS: f64 = 0.1;

/// Distance from a body, m, beyond which a segment is not between it and another.
const NEAR: f64 = 0.03;

/// Places on a segment at which the room is looked at: an edge of a mesh may lie between its ends.
const PLACES: [f64; 5] = [0.0, 0.25, 0.5, 0.75, 1.0];

/// How much nearer than in the groom a root is to a body that swallows it, m: bodies that carry roots stay.
const APPROACH: f64 = 1e-3;

/// A guide among bodies that move over a step.
pub(super) struct Pinch<'a> {
    pub bodies: &'a Bodies,
    pub motions: &'a [BodyMotion],
    /// Contact polyline at the start of the step, m, world.
    pub x0: &'a [Vector3<f64>],
    /// Root at the end of the step, world.
    pub root: &'a Pose,
    /// Signed distance of the root from each body in the groom's pose, m.
    pub root_distance: &'a [f64],
}

/// The surface nearest to a place.
#[derive(Debug, Clone, Copy)]
struct Surface {
    /// Signed distance, m.
    distance: f64,
    /// Outward normal, world.
    normal: Vector3<f64>,
    /// How the body moves there over the step, m.
    moved: Vector3<f64>,
}

impl Pinch<'_> {
    /// Lowers `clearance` ([`MovingPolyline::clearance`](crate::contact::MovingPolyline)) to the distances
    /// that the bodies leave room for at the end of the step. Returns whether any is lowered.
    pub fn lower(&self, clearance: &mut [[f64; 2]]) -> bool {
        let asked = clearance.to_vec();
        for b in 0..self.motions.len() {
            self.lower_beside_root(b, clearance);
        }
        self.lower_between(&asked, clearance);
        asked != clearance
    }

    /// Lowers the distances from body `b` near a root that the body has swallowed.
    fn lower_beside_root(&self, b: usize, clearance: &mut [[f64; 2]]) {
        let motion = &self.motions[b];
        let Some(at) = self.surface(b, motion.times[1], &motion.end, &self.root.p) else { return };
        if at.distance > self.root_distance[b] - APPROACH {
            return;
        }
        let sine = at.normal.dot(&self.root.r.column(2));
        let segments = self.x0.len() - 1;
        let mut s = 0.0;
        for (ends, x) in clearance[b * segments..][..segments].iter_mut().zip(self.x0.windows(2)) {
            let places = [s, s + (x[1] - x[0]).norm()];
            for (keep, s) in ends.iter_mut().zip(places) {
                *keep = keep.min(pinch::leaving(at.distance, sine, s));
            }
            s = places[1];
        }
    }

    /// Lowers the distances from bodies that face each other across a segment from those that are `asked`.
    fn lower_between(&self, asked: &[[f64; 2]], clearance: &mut [[f64; 2]]) {
        let segments = self.x0.len() - 1;
        let mut beyond = vec![0.0; self.motions.len()];
        let (mut near, mut last) = (Vec::new(), self.x0[0]);
        for k in 0..segments {
            let ends = [self.x0[k], self.x0[k + 1]];
            let middle = 0.5 * (ends[0] + ends[1]);
            let moved = (middle - std::mem::replace(&mut last, middle)).norm();
            near.clear();
            for (b, beyond) in beyond.iter_mut().enumerate() {
                *beyond -= moved;
                let exempt = asked[b * segments + k].contains(&f64::NEG_INFINITY);
                if *beyond > NEAR || exempt {
                    continue;
                }
                let motion = &self.motions[b];
                match self.surface(b, motion.times[0], &motion.start, &middle) {
                    Some(surface) if surface.distance <= NEAR => near.push((b, surface)),
                    found => *beyond = found.map_or(SEARCH_RADIUS, |surface| surface.distance),
                }
            }
            for (i, first) in near.iter().enumerate() {
                for second in &near[i + 1..] {
                    let pair = [first, second];
                    let yielded = self.yielded(pair, pair.map(|(b, _)| asked[b * segments + k]), ends);
                    for (b, _) in pair.iter().filter(|_| yielded > 0.0) {
                        let slots = b * segments..(b + 1) * segments;
                        lower_segment(&asked[slots.clone()], &mut clearance[slots], k, yielded);
                    }
                }
            }
        }
    }

    /// [`pinch::yielded`] by two bodies at the end of the step, the most along the segment with these `ends`,
    /// m, world, at its start. The surfaces are those near its middle then.
    fn yielded(&self, pair: [&(usize, Surface); 2], keep: [[f64; 2]; 2], ends: [Vector3<f64>; 2]) -> f64 {
        let [(_, a), (_, b)] = pair;
        let slack = (a.moved - b.moved).norm() + (ends[1] - ends[0]).norm();
        let most = keep.iter().map(|ends| ends[0].max(ends[1])).sum::<f64>() + pinch::PLAY;
        if a.distance + b.distance > most + slack {
            return 0.0;
        }
        // What lies between two bodies moves as both do on average; the room is the same across the gap.
        let carried = 0.5 * (a.moved + b.moved);
        let at = |u: f64| {
            let x = ends[0].lerp(&ends[1], u) + carried;
            let end =
                pair.map(|(b, _)| self.surface(*b, self.motions[*b].times[1], &self.motions[*b].end, &x));
            let [Some(a), Some(b)] = end else { return 0.0 };
            let keep = keep.map(|[from, to]| from + (to - from) * u);
            pinch::yielded(keep, [a.distance, b.distance], a.normal.dot(&b.normal))
        };
        PLACES.map(at).into_iter().fold(0.0, f64::max)
    }

    /// The surface of body `b` nearest to `x`, m, world, at time `t`, s, with the body at `pose`.
    fn surface(&self, b: usize, t: f64, pose: &Isometry3<f64>, x: &Vector3<f64>) -> Option<Surface> {
        let motion = &self.motions[b];
        let found: SurfacePoint =
            self.bodies.closest(b, t, &pose.inverse_transform_point(&(*x).into()).coords, SEARCH_RADIUS)?;
        let at = |pose: &Isometry3<f64>| pose.transform_point(&found.point.into());
        Some(Surface {
            distance: found.distance,
            normal: pose.rotation * found.normal,
            moved: at(&motion.end) - at(&motion.start),
        })
    }
}

/// Lowers both ends of segment `k`, and the ends of its neighbours there, by `yielded`, m, from `asked`.
fn lower_segment(asked: &[[f64; 2]], clearance: &mut [[f64; 2]], k: usize, yielded: f64) {
    let mut lower = |k: usize, end: usize| {
        let kept = &mut clearance[k][end];
        *kept = kept.min(asked[k][end] - yielded);
    };
    (0..2).for_each(|end| lower(k, end));
    if k > 0 {
        lower(k - 1, 1);
    }
    if k + 1 < asked.len() {
        lower(k + 1, 0);
    }
}

impl Simulation<'_> {
    /// Segments of the active guides' contact polylines that bodies leave no room for outside, counted once
    /// per body.
    pub fn pinched_segments(&self) -> usize {
        let t = self.time();
        let motion = |pose: &Isometry3<f64>| BodyMotion { times: [t, t], start: *pose, end: *pose };
        let motions: Vec<BodyMotion> = self.env.body_poses(t).iter().map(motion).collect();
        let (mut asked, mut lowered) = (Vec::new(), Vec::new());
        let segments = |i: usize| {
            let guide = &self.state.guides[i];
            guide.clearance.at((self.env.push_out)(t), &mut asked);
            lowered.clone_from(&asked);
            let root = self.model.guides[i].root(&self.env, t);
            let root_distance = guide.clearance.root_distance();
            let x0 = &self.polyline(i);
            Pinch { bodies: &self.env.bodies, motions: &motions, x0, root: &root, root_distance }
                .lower(&mut lowered);
            let inside = |(asked, lowered): &(&[f64; 2], &[f64; 2])| {
                asked != lowered && lowered[0].min(lowered[1]) < 0.0
            };
            asked.iter().zip(&lowered).filter(inside).count()
        };
        self.active().filter(|&i| self.state.guides[i].pinched).map(segments).sum()
    }
}
