//! Guides between bodies that leave no room for them: the distances that are left, and where.

use super::clearance::Clearance;
use super::simulation::Simulation;
use crate::contact::{Bodies, BodyMotion, pinch};
use crate::geometry::SurfacePoint;
use crate::math::se3::Pose;
use nalgebra::{Isometry3, Vector3};

/// Distance up to which surfaces are searched, m: deeper places have no near side.
pub(super) const SEARCH_RADIUS: f64 = 0.1;

/// Distance from a body, m, beyond which a segment is not between it and another.
const NEAR: f64 = 0.03;

/// Places on a segment at which the room is looked at: an edge of a mesh may lie between its ends.
const PLACES: [f64; 5] = [0.0, 0.25, 0.5, 0.75, 1.0];

/// How much nearer than in the groom a root is to a body that swallows it, m: bodies that carry roots stay.
const APPROACH: f64 = 1e-3;

/// What may lack of a distance, m: contact removes this much by itself.
const SMALL: f64 = 2e-5;

/// Time constant in which a guide that a step has left inside a body comes out, s: half a frame. Sooner it is
/// thrown; later, it is still inside when the bodies have parted.
const RETURN: f64 = 0.02;

/// Whether a body at the signed distance `now`, m, from a root has come nearer to it than it is as `drawn`.
pub(super) fn approaches(now: f64, drawn: f64) -> bool {
    now <= drawn - APPROACH
}

/// A guide among bodies that move over a step.
pub(super) struct Pinch<'a> {
    pub bodies: &'a Bodies,
    pub motions: &'a [BodyMotion],
    /// Contact polyline at the start of the step, m, world.
    pub x0: &'a [Vector3<f64>],
    /// Root at the end of the step, world; `None` if nothing holds it.
    pub root: Option<&'a Pose>,
    /// Where the root is among the bodies in the groom's pose.
    pub at_rest: &'a Clearance,
}

/// What room bodies leave for a guide.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Room {
    /// Whether it is less than the distances to keep ask for.
    pub lacks: bool,
    /// Whether parts of one body bound it, or a part of the guide is in one of them.
    pub by_part: bool,
}

/// The surface nearest to a place.
#[derive(Debug, Clone, Copy)]
struct Surface {
    /// Signed distance, m.
    distance: f64,
    /// Outward normal, world.
    normal: Vector3<f64>,
    /// How the surface moves there with its body over the step, m.
    moved: Vector3<f64>,
}

/// Start or end of the step.
#[derive(Debug, Clone, Copy)]
enum Moment {
    Start,
    End,
}

impl Pinch<'_> {
    /// Lowers `clearance` ([`MovingPolyline::clearance`](crate::contact::MovingPolyline)), which starts as those
    /// that are `asked`, to the distances that the bodies leave room for at the end of the step.
    pub fn lower(&self, asked: &[[f64; 2]], clearance: &mut [[f64; 2]]) -> Room {
        let mut by_part = false;
        for b in 0..self.motions.len() {
            by_part |= self.lower_beside_root(b, clearance);
        }
        by_part |= self.lower_between(asked, clearance);
        Room { lacks: asked != clearance, by_part }
    }

    /// Lowers `clearance` where the guide is nearer to a body that deforms than that, or deeper in it; to any
    /// body if it is `pinched`. What is left is its distance at the start of the step, and of what lacks the
    /// step's share of [`RETURN`]. Returns whether any is lowered.
    pub fn lower_where_inside(&self, pinched: bool, by_part: bool, clearance: &mut [[f64; 2]]) -> bool {
        let segments = self.x0.len() - 1;
        let mut lowered = false;
        for (b, motion) in self.motions.iter().enumerate() {
            if !(pinched || self.bodies.bodies[b].solid.deforms()) {
                continue;
            }
            let share = ((motion.times[1] - motion.times[0]) / RETURN).min(1.0);
            let of_body = &mut clearance[b * segments..][..segments];
            for (i, x) in self.x0.iter().enumerate() {
                // The ends of the segments that meet there.
                let mut ends = of_body.as_flattened_mut();
                ends = &mut ends[(2 * i).saturating_sub(1)..(2 * i + 1).min(2 * segments)];
                let asked = ends.iter().copied().fold(f64::NEG_INFINITY, f64::max);
                if asked == f64::NEG_INFINITY {
                    continue;
                }
                let Some(on) = self.closest(b, Moment::Start, x) else { continue };
                let part = if by_part { self.other_part(b, Moment::Start, x, &on) } else { None };
                let distance = part.map_or(on.distance, |part| part.distance.min(on.distance));
                if distance < asked - SMALL {
                    lowered = true;
                    let keep = distance + share * (asked - distance);
                    ends.iter_mut().for_each(|end| *end = end.min(keep));
                }
            }
        }
        lowered
    }

    /// Lowers the distance from body `b` at the root to what that has, and those near a root that the body has
    /// swallowed. Returns whether a part of the skin that the root is on has done so.
    fn lower_beside_root(&self, b: usize, clearance: &mut [[f64; 2]]) -> bool {
        let Some(Pose { r, p: root }) = self.root else { return false };
        let direction = r.column(2).into();
        let Some(on) = self.closest(b, Moment::End, root) else { return false };
        let (mut own, mut other) =
            (self.surface(b, Moment::End, &on), self.other_part(b, Moment::End, root, &on));
        let at_rest = self.at_rest.root_distance()[b];
        let approached = |surface: &Surface| (surface.distance - at_rest).abs();
        if let Some(part) = &mut other
            && approached(part) < approached(&own)
        {
            // Another part may be nearer to the root than that which it is on.
            std::mem::swap(part, &mut own);
        }
        // No force moves the root: it keeps the distance to which it is carried.
        let at_root = &mut clearance[b * (self.x0.len() - 1)][0];
        *at_root = other.iter().map(|part| part.distance).fold(at_root.min(own.distance), f64::min);
        if approaches(own.distance, at_rest) {
            self.lower_along(b, &own, &direction, clearance);
        }
        let swallows = |part: &Surface| approaches(part.distance, self.at_rest.fold_distance(b));
        other.filter(swallows).is_some_and(|part| self.lower_along(b, &part, &direction, clearance))
    }

    /// Lowers the distances from body `b` to those of a hair that leaves the surface `from` at its root, in this
    /// unit `direction`. Returns whether any is lowered.
    fn lower_along(
        &self,
        b: usize,
        from: &Surface,
        direction: &Vector3<f64>,
        clearance: &mut [[f64; 2]],
    ) -> bool {
        let sine = from.normal.dot(direction);
        let segments = self.x0.len() - 1;
        let (mut s, mut lowered) = (0.0, false);
        for (ends, x) in clearance[b * segments..][..segments].iter_mut().zip(self.x0.windows(2)) {
            let places = [s, s + (x[1] - x[0]).norm()];
            for (keep, s) in ends.iter_mut().zip(places) {
                let left = pinch::leaving(from.distance, sine, s);
                lowered |= left < *keep;
                *keep = keep.min(left);
            }
            s = places[1];
        }
        lowered
    }

    /// Lowers the distances from surfaces that face each other across a segment from those that are `asked`.
    /// Returns whether parts of one body do, and lack room or have a place of the guide in them.
    fn lower_between(&self, asked: &[[f64; 2]], clearance: &mut [[f64; 2]]) -> bool {
        let segments = self.x0.len() - 1;
        let mut beyond = vec![0.0; self.motions.len()];
        let (mut near, mut last, mut by_part) = (Vec::new(), self.x0[0], false);
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
                match self.closest(b, Moment::Start, &middle) {
                    Some(found) if found.distance <= NEAR => {
                        let surface = self.surface(b, Moment::Start, &found);
                        near.push((b, surface));
                        let Some(part) = self.other_part(b, Moment::Start, &middle, &found) else { continue };
                        by_part |= surface.distance.min(part.distance) < 0.0;
                        let keep = asked[b * segments + k];
                        let yielded = self.yielded([(b, surface), (b, part)], [keep; 2], ends);
                        if yielded > 0.0 {
                            by_part = true;
                            let slots = b * segments..(b + 1) * segments;
                            lower_segment(&asked[slots.clone()], &mut clearance[slots], k, yielded);
                        }
                    }
                    found => *beyond = found.map_or(SEARCH_RADIUS, |found| found.distance),
                }
            }
            for (i, first) in near.iter().enumerate() {
                for second in &near[i + 1..] {
                    let pair = [*first, *second];
                    let yielded = self.yielded(pair, pair.map(|(b, _)| asked[b * segments + k]), ends);
                    for (b, _) in pair.iter().filter(|_| yielded > 0.0) {
                        let slots = b * segments..(b + 1) * segments;
                        lower_segment(&asked[slots.clone()], &mut clearance[slots], k, yielded);
                    }
                }
            }
        }
        by_part
    }

    /// [`pinch::yielded`] by two surfaces at the end of the step, the most along the segment with these
    /// `ends`, m, world, at its start. The surfaces, of two bodies or of one, are those near its middle then.
    fn yielded(&self, pair: [(usize, Surface); 2], keep: [[f64; 2]; 2], ends: [Vector3<f64>; 2]) -> f64 {
        let [(first, a), (second, b)] = pair;
        let slack = (a.moved - b.moved).norm() + (ends[1] - ends[0]).norm();
        let most = keep.iter().map(|ends| ends[0].max(ends[1])).sum::<f64>() + pinch::PLAY;
        if a.distance + b.distance > most + slack {
            return 0.0;
        }
        // What lies between two bodies moves as both do on average; the room is the same across the gap.
        let carried = 0.5 * (a.moved + b.moved);
        let along = ends[1] - ends[0];
        let at_end = |x: &Vector3<f64>| {
            let found = self.closest(first, Moment::End, x)?;
            let a = self.surface(first, Moment::End, &found);
            let b = match first == second {
                true => self.other_part(first, Moment::End, x, &found)?,
                false => self.surface(second, Moment::End, &self.closest(second, Moment::End, x)?),
            };
            Some([a, b])
        };
        let at = |u: f64| {
            let Some([a, b]) = at_end(&(ends[0].lerp(&ends[1], u) + carried)) else { return 0.0 };
            let keep = keep.map(|[from, to]| from + (to - from) * u);
            pinch::yielded(keep, [a.distance, b.distance], pinch::cosine(&along, [&a.normal, &b.normal]))
        };
        PLACES.map(at).into_iter().fold(0.0, f64::max)
    }

    /// Time, s, and pose of body `b` at a moment.
    fn body(&self, b: usize, moment: Moment) -> (f64, &Isometry3<f64>) {
        let motion = &self.motions[b];
        match moment {
            Moment::Start => (motion.times[0], &motion.start),
            Moment::End => (motion.times[1], &motion.end),
        }
    }

    /// The surface of body `b` nearest to `x`, m, world, in the frame of the body.
    fn closest(&self, b: usize, moment: Moment, x: &Vector3<f64>) -> Option<SurfacePoint> {
        let (t, pose) = self.body(b, moment);
        self.bodies.closest(b, t, &pose.inverse_transform_point(&(*x).into()).coords, SEARCH_RADIUS)
    }

    /// The part of a deforming body `b` near `x`, m, world, that faces `from`, the nearest surface there, or
    /// that `x` is inside. Between parts of a rigid one the groom has room.
    fn other_part(&self, b: usize, moment: Moment, x: &Vector3<f64>, from: &SurfacePoint) -> Option<Surface> {
        if !self.bodies.bodies[b].solid.deforms() {
            return None;
        }
        let (t, pose) = self.body(b, moment);
        let local = pose.inverse_transform_point(&(*x).into()).coords;
        let found = self.bodies.mesh(b, t)?.facing_or_around(&local, from, -pinch::FACING, NEAR)?;
        Some(self.surface(b, moment, &found))
    }

    /// A place on the surface of body `b`, found at a moment.
    fn surface(&self, b: usize, moment: Moment, found: &SurfacePoint) -> Surface {
        let motion = &self.motions[b];
        let (_, pose) = self.body(b, moment);
        let at = |pose: &Isometry3<f64>| pose.transform_point(&found.point.into());
        Surface {
            distance: found.distance,
            normal: pose.rotation * found.normal,
            moved: at(&motion.end) - at(&motion.start),
        }
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
            let model = &self.model.guides[i];
            let root = (!model.rod.is_free()).then(|| model.root(&self.env, t));
            let (x0, at_rest) = (&self.polyline(i), &guide.clearance);
            Pinch { bodies: &self.env.bodies, motions: &motions, x0, root: root.as_ref(), at_rest }
                .lower(&asked, &mut lowered);
            let inside = |(asked, lowered): &(&[f64; 2], &[f64; 2])| {
                asked != lowered && lowered[0].min(lowered[1]) < 0.0
            };
            asked.iter().zip(&lowered).filter(inside).count()
        };
        self.active().filter(|&i| self.state.guides[i].pinched).map(segments).sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::dynamics::clearance::GroomPose;
    use crate::geometry::Shape;

    #[test]
    fn a_guide_inside_keeps_the_depth_that_it_has_and_comes_out_in_time() {
        let bodies = Bodies::from_shapes(&[Shape::Plane { point: Vector3::zeros(), normal: Vector3::y() }]);
        let line = |heights: [f64; 5]| {
            let point = |(k, y): (usize, &f64)| Vector3::new(0.01 * k as f64, *y, 0.0);
            heights.iter().enumerate().map(point).collect::<Vec<_>>()
        };
        let (keep, poses) = (5e-4, &[Isometry3::identity()]);
        let drawn = GroomPose {
            bodies: &bodies,
            t: 0.0,
            poses,
            thickness: &[keep],
            x: &line([1e-3; 5]),
            rooted: true,
        };
        // Beside, at the distance to keep up to rounding, nearer, and inside.
        let x = line([1e-3, keep - 1e-9, 2e-4, -3e-3, 1e-3]);
        let asked = [[f64::NEG_INFINITY; 2], [keep; 2], [keep; 2], [keep; 2]];
        let lowered_if = |pinched: bool, x: &[Vector3<f64>], h: f64| {
            let motion =
                BodyMotion { times: [0.0, h], start: Isometry3::identity(), end: Isometry3::identity() };
            let root = Pose { r: nalgebra::Matrix3::identity(), p: x[0] };
            let at_rest = &Clearance::new(&drawn);
            let pinch = Pinch { bodies: &bodies, motions: &[motion], x0: x, root: Some(&root), at_rest };
            let mut clearance = asked;
            pinch.lower_where_inside(pinched, false, &mut clearance).then_some(clearance)
        };
        let lowered = |x: &[Vector3<f64>], h: f64| lowered_if(true, x, h);
        assert_eq!(lowered(&line([1e-3; 5]), 0.005), None);
        // A rigid body that does not pinch it is kept out of.
        assert_eq!(lowered_if(false, &x, 0.005), None);
        let found = lowered(&x, 0.1 * RETURN).unwrap();
        let (near, deep) = (2e-4 + 0.1 * 3e-4, -3e-3 + 0.1 * 3.5e-3);
        let expected = [asked[0], [keep, near], [near, deep], [deep, keep]];
        let off = |(a, b): (&f64, &f64)| if a == b { 0.0 } else { (a - b).abs() };
        let worst = found.as_flattened().iter().zip(expected.as_flattened()).map(off).fold(0.0, f64::max);
        assert!(worst < 1e-12, "{found:?}");
        assert_eq!(lowered(&x, 2.0 * RETURN), Some(asked));
    }

    #[test]
    fn a_root_keeps_the_distance_to_which_it_is_carried() {
        let bodies = Bodies::from_shapes(&[Shape::Plane { point: Vector3::zeros(), normal: Vector3::y() }]);
        let x = [0.0, 0.01, 0.02].map(|s| Vector3::new(s, 1e-3, 0.0));
        let poses = &[Isometry3::identity()];
        let drawn = GroomPose { bodies: &bodies, t: 0.0, poses, thickness: &[5e-4], x: &x, rooted: true };
        let at_rest = &Clearance::new(&drawn);
        let asked = [[5e-4; 2]; 2];
        // The plane rises to the distance `left` from the root, less far than to swallow it.
        let lowered = |left: f64| {
            let end = Isometry3::translation(0.0, 1e-3 - left, 0.0);
            let motion = BodyMotion { times: [0.0, 0.005], start: Isometry3::identity(), end };
            let root = Pose { r: nalgebra::Matrix3::identity(), p: x[0] };
            let pinch = Pinch { bodies: &bodies, motions: &[motion], x0: &x, root: Some(&root), at_rest };
            let mut clearance = asked;
            assert_eq!(pinch.lower(&asked, &mut clearance).lacks, asked != clearance);
            clearance
        };
        assert_eq!(lowered(8e-4), asked);
        for left in [2e-4, 1e-6] {
            let [[root, rest @ ..], others] = lowered(left);
            assert!((root - left).abs() < 1e-12 && (rest, others) == ([5e-4], [5e-4; 2]), "{root}");
        }
    }
}
