//! Clearance of a guide from each body.
//!
//! Strands grow out of the head, so their first segments are in it or on it. Production grooms also have
//! strands partly inside a body or drawn through an ear. The rule for one body, with the signed distance g in
//! the groom's pose and the body's thickness d:
//!
//! - A point outside (g > 0) keeps min(d, g/2), where g is the least distance along the adjacent segments. A
//!   point drawn nearer than d stays as near, with some margin.
//! - The segments of points inside, up to the strand's first exit, are exempt for good.
//! - A segment drawn through the body is exempt for good, because it has no side; its ends have one. So is a
//!   run of points inside, with the segments that lead in and out, if the nearest surfaces of two successive
//!   points face away from each other, as on the two sides of an ear. A segment that only cuts the surface,
//!   such as a chord of a curl, or clips an edge less than 2 d deep, is not exempt.
//! - A point inside after the first exit, or a segment that cuts the surface, is pushed out to min(d, s/4)
//!   during the pre-roll, where s is its arc length from the root. Segments still in the body afterwards are
//!   exempt.
//!
//! Next to its root a hair is stiffer than skin, which gives way to it: there it meets no body at all
//! ([`Clearance::hold`]).
//!
//! A loose strand, whose root nothing holds, does not grow out of a body: all that is inside is pushed out, to d,
//! unless it is drawn through the body.

use crate::contact::{Bodies, BodyMotion, Contact, ContactCache, MovingPolyline, pinch};
use nalgebra::{Isometry3, Vector3};
use serde::{Deserialize, Serialize};

#[cfg(test)]
mod tests;

/// Distance up to which bodies are searched in the groom's pose, m; deeper points count as this deep.
const SEARCH_RADIUS: f64 = 0.3;

/// Distance up to which other parts of a root's own skin are searched, m.
const FOLD_RADIUS: f64 = 0.1;

/// Largest requested clearance over arc length from the root: a strand drawn flat in the surface cannot rise
/// steeply.
const MAX_SLOPE: f64 = 0.25;

/// Clearance of an exempt segment.
const EXEMPT: [f64; 2] = [f64::NEG_INFINITY; 2];

/// Clearances of the segments of one guide from the bodies.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct Clearance {
    /// Clearance from body b at both ends of segment k, at `b * segments + k`, m, in the groom's pose; −∞ if
    /// exempt.
    from: Vec<[f64; 2]>,
    /// The same after all points are pushed out.
    to: Vec<[f64; 2]>,
    /// Signed distance of the root from each body in the groom's pose, m, at most [`SEARCH_RADIUS`].
    root_distance: Vec<f64>,
    /// Distance of the root from the part of each body that faces the one it is on, m, as it is drawn; empty
    /// unless [`Clearance::measure_folds`] is called.
    fold_distance: Vec<f64>,
    /// Segments next to the root that meet no body.
    held: usize,
}

/// A point of the groom's pose relative to one body.
#[derive(Debug, Clone, Copy)]
struct Point {
    /// Clearance after the push-out, m.
    keep: f64,
    /// Depth inside the body in the groom's pose, m; 0 outside.
    depth: f64,
    /// Outward normal of the nearest surface, body frame; zero if none is near.
    normal: Vector3<f64>,
}

/// Passage of a segment of the groom's pose past a body.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Passage {
    /// Inside, before the strand's first exit.
    Rooted,
    /// In on one side and out on another.
    Through,
    /// Outside, or to be pushed out.
    Beside,
}

/// A guide in the groom's pose among bodies.
#[derive(Clone, Copy)]
pub struct GroomPose<'a> {
    /// The bodies.
    pub bodies: &'a Bodies,
    /// Their time, s.
    pub t: f64,
    /// Body poses, rest space to world.
    pub poses: &'a [Isometry3<f64>],
    /// Thickness of each body, m.
    pub thickness: &'a [f64],
    /// The guide's polyline, m, world.
    pub x: &'a [Vector3<f64>],
    /// True if its root is held.
    pub rooted: bool,
}

/// Points and segments of a guide in the groom's pose, relative to all bodies, body by body.
struct Scan {
    points: Vec<Point>,
    passages: Vec<Passage>,
    /// Signed distance of the root from each body, m, at most [`SEARCH_RADIUS`].
    root_distance: Vec<f64>,
}

impl GroomPose<'_> {
    /// The points relative to body `b`; `local` are the points in its frame.
    fn points(&self, b: usize, local: &[Vector3<f64>]) -> Vec<Point> {
        let d = self.thickness[b];
        let (mut s, mut known) = (0.0, None);
        let point = |k: usize| {
            let nearest = self.bodies.closest(b, self.t, &local[k], SEARCH_RADIUS);
            let far = nearest.map_or(SEARCH_RADIUS, |s| s.distance.abs());
            let normal = nearest.map_or_else(Vector3::zeros, |s| s.normal);
            let length = (self.x[k] - self.x[k.saturating_sub(1)]).norm();
            s += length;
            // The winding number is reliable on open and dirty meshes, unlike the side of the nearest
            // triangle. One result also serves the next point if no surface is as near as that point.
            let inside = known.take().filter(|_| length < far);
            let inside = inside.unwrap_or_else(|| *known.insert(self.bodies.contains(b, self.t, &local[k])));
            match inside {
                true if self.rooted => Point { keep: d.min(MAX_SLOPE * s), depth: far, normal },
                true => Point { keep: d, depth: far, normal },
                false => Point { keep: d.min(0.5 * far), depth: 0.0, normal },
            }
        };
        (0..self.x.len()).map(point).collect()
    }

    /// The passage of each segment past body `b`; `local` are the points in its frame.
    fn passages(&self, b: usize, local: &[Vector3<f64>], points: &[Point]) -> Vec<Passage> {
        let rooted = points.iter().take_while(|point| self.rooted && point.depth > 0.0).count();
        let inside = |k: usize| points[k].depth > 0.0;
        let facing_away = |k: usize| points[k].normal.dot(&points[k + 1].normal) < 0.0;
        let segments = self.x.len() - 1;
        let mut passages: Vec<_> = (0..segments)
            .map(|k| match k < rooted {
                true => Passage::Rooted,
                false if inside(k) || inside(k + 1) => Passage::Beside,
                false if passes_through(self.bodies, b, self.t, &[local[k], local[k + 1]]) => {
                    Passage::Through
                }
                false => Passage::Beside,
            })
            .collect();
        // The whole run is exempt: which part of it lies between the two sides is unknown.
        let free: Vec<usize> = (rooted..segments).collect();
        for run in free.chunk_by(|_, k| inside(*k)) {
            if run.iter().any(|&k| (inside(k) || inside(k + 1)) && facing_away(k)) {
                passages[run[0]..][..run.len()].fill(Passage::Through);
            }
        }
        passages
    }

    /// Points and passages relative to all bodies.
    fn scan(&self) -> Scan {
        let (mut points, mut passages, mut root_distance) = (Vec::new(), Vec::new(), Vec::new());
        for (b, (pose, _)) in self.poses.iter().zip(self.thickness).enumerate() {
            let local = self.local(pose);
            let of_body = self.points(b, &local);
            passages.extend(self.passages(b, &local, &of_body));
            points.extend(of_body);
            let root = self.bodies.closest(b, self.t, &local[0], SEARCH_RADIUS);
            root_distance.push(root.map_or(SEARCH_RADIUS, |root| root.distance));
        }
        let clips = |c: &&Contact| c.gap < 0.0 && -c.gap < 2.0 * self.thickness[c.body];
        for clip in self.contacts(&points, &passages, Passage::Through).iter().filter(clips) {
            passages[self.segment_index(clip)] = Passage::Beside;
        }
        Scan { points, passages, root_distance }
    }

    /// True if the guide lies in body `b` in `pose`, or runs through it, beyond where it grows out of it.
    pub fn lies_in(&self, b: usize, pose: &Isometry3<f64>) -> bool {
        let local = self.local(pose);
        let points = self.points(b, &local);
        let rooted = points.iter().take_while(|point| self.rooted && point.depth > 0.0).count();
        points[rooted..].iter().any(|point| point.depth > 0.0)
            || self.passages(b, &local, &points).contains(&Passage::Through)
    }

    /// Depth in body `b` in `pose` of each point of the guide, m, at most [`SEARCH_RADIUS`].
    pub fn depths(&self, b: usize, pose: &Isometry3<f64>) -> Vec<f64> {
        self.points(b, &self.local(pose)).iter().map(|point| point.depth).collect()
    }

    /// Its points in the frame with this `pose`.
    fn local(&self, pose: &Isometry3<f64>) -> Vec<Vector3<f64>> {
        self.x.iter().map(|p| pose.inverse_transform_point(&(*p).into()).coords).collect()
    }

    /// Sum of the outward normals, body frame, of body `b` in `pose` at the points of the guide that lie in it beyond
    /// where it grows out of it.
    pub fn way_out(&self, b: usize, pose: &Isometry3<f64>) -> Vector3<f64> {
        let points = self.points(b, &self.local(pose));
        let beyond = points.iter().skip_while(|point| self.rooted && point.depth > 0.0);
        beyond.filter(|point| point.depth > 0.0).map(|point| point.normal).sum()
    }

    /// How far each segment of a scan cuts the surface, m, at most 0. Lowers the distances that points keep
    /// to those along their segments.
    fn cuts(&self, Scan { points, passages, .. }: &mut Scan) -> Vec<f64> {
        let mut cut = vec![0.0_f64; passages.len()];
        for c in self.contacts(points, passages, Passage::Beside) {
            if c.gap < 0.0 {
                let cut = &mut cut[self.segment_index(&c)];
                *cut = cut.min(c.gap);
            } else {
                // The distance may be less along a segment than at its ends.
                let ends = self.ends(c.body, c.segment);
                points[ends].iter_mut().for_each(|p| p.keep = p.keep.min(0.5 * c.gap));
            }
        }
        cut
    }

    /// The values at both ends of each segment, of those at the points.
    fn segment_ends(&self, of_points: &[f64]) -> impl Iterator<Item = [f64; 2]> {
        self.segments().map(move |(b, k)| [0, 1].map(|end| of_points[b * self.x.len() + k + end]))
    }

    /// Body and segment of each entry, body by body.
    fn segments(&self) -> impl Iterator<Item = (usize, usize)> + use<> {
        let (bodies, segments) = (self.poses.len(), self.x.len() - 1);
        (0..bodies).flat_map(move |b| (0..segments).map(move |k| (b, k)))
    }

    /// Entry of the segment of a contact.
    fn segment_index(&self, c: &Contact) -> usize {
        c.body * (self.x.len() - 1) + c.segment
    }

    /// Entries of both ends of segment `k` relative to `body`.
    fn ends(&self, body: usize, k: usize) -> std::ops::Range<usize> {
        body * self.x.len() + k..body * self.x.len() + k + 2
    }

    /// Contacts of the segments of passage `wanted` with both ends outside.
    fn contacts(&self, points: &[Point], passages: &[Passage], wanted: Passage) -> Vec<Contact> {
        let touching: Vec<[f64; 2]> = self
            .segments()
            .zip(passages)
            .map(|((b, k), passage)| match points[self.ends(b, k)].iter().any(|p| p.depth > 0.0) {
                false if *passage == wanted => [0.0; 2],
                _ => EXEMPT,
            })
            .collect();
        let line = MovingPolyline { x0: self.x, x1: self.x, clearance: &touching, by_part: false };
        static_contacts(self.bodies, self.t, self.poses, self.thickness, &line)
    }

    /// Clearance of each segment by the `distance` of its ends; exempt unless it passes beside the body.
    fn clearances(
        &self,
        points: &[Point],
        passages: &[Passage],
        distance: fn(&Point) -> f64,
    ) -> Vec<[f64; 2]> {
        let of_ends =
            |((b, k), passage): ((usize, usize), &Passage)| match (passage, &points[self.ends(b, k)]) {
                (Passage::Beside, [one, two]) => [distance(one), distance(two)],
                _ => EXEMPT,
            };
        self.segments().zip(passages).map(of_ends).collect()
    }
}

impl Clearance {
    /// Applies the rule to the groom's pose, in which the guide starts.
    pub fn new(start: &GroomPose) -> Self {
        Clearance::of(start, start.scan())
    }

    /// Applies the rule to the groom's pose as it is `drawn`; the guide and the bodies start elsewhere. If
    /// the guide is `led`, it starts in another pose than it is drawn in: a segment that starts beside a body
    /// is then not exempt from it, and one that starts in it is so only if it is drawn there.
    pub fn carried(start: &GroomPose, drawn: &GroomPose, led: bool) -> Self {
        let mut as_drawn = drawn.scan();
        drawn.cuts(&mut as_drawn);
        let kept: Vec<f64> = as_drawn.points.iter().map(|point| point.keep).collect();
        let at_start = start.scan();
        if led {
            for (passage, at_start) in as_drawn.passages.iter_mut().zip(at_start.passages) {
                if at_start == Passage::Beside {
                    *passage = Passage::Beside;
                }
            }
        }
        let mut carried = Clearance::of(start, Scan { points: at_start.points, ..as_drawn });
        for (end, keep) in carried.to.iter_mut().zip(drawn.segment_ends(&kept)) {
            *end = if *end == EXEMPT { EXEMPT } else { keep };
        }
        for (from, to) in carried.from.iter_mut().zip(&carried.to) {
            *from = [0, 1].map(|end| from[end].min(to[end]));
        }
        carried
    }

    /// The clearances of a guide that starts in the groom's pose `start`, for its `scan`.
    fn of(start: &GroomPose, mut scan: Scan) -> Self {
        let cut = start.cuts(&mut scan);
        let Scan { points, passages, root_distance } = scan;
        let initial = |point: &Point| if point.depth > 0.0 { -point.depth } else { point.keep };
        let mut from = start.clearances(&points, &passages, initial);
        for (ends, cut) in from.iter_mut().zip(cut).filter(|(_, cut)| *cut < 0.0) {
            *ends = ends.map(|from| from.min(cut));
        }
        let to = start.clearances(&points, &passages, |point| point.keep);
        Clearance { from, to, root_distance, fold_distance: Vec::new(), held: 0 }
    }

    /// Measures how far the root is from other parts of the skin that it is on, in the pose `drawn`.
    pub fn measure_folds(&mut self, drawn: &GroomPose) {
        let GroomPose { bodies, t, poses, x, .. } = *drawn;
        let distance = |(b, pose): (usize, &Isometry3<f64>)| {
            let root = pose.inverse_transform_point(&x[0].into()).coords;
            let on = bodies.closest(b, t, &root, SEARCH_RADIUS)?;
            let part = bodies.mesh(b, t)?.facing_or_around(&root, &on, -pinch::FACING, FOLD_RADIUS);
            Some(part?.distance)
        };
        let far = |found: Option<f64>| found.unwrap_or(SEARCH_RADIUS);
        self.fold_distance = poses.iter().enumerate().map(distance).map(far).collect();
    }

    /// Takes the first `held` segments out of contact with all bodies.
    pub fn hold(&mut self, held: usize) {
        self.held = held;
        let segments = self.segments();
        for ends in [&mut self.from, &mut self.to] {
            ends.chunks_exact_mut(segments).for_each(|of_body| of_body[..held].fill(EXEMPT));
        }
    }

    /// Number of segments of the guide; at least 1.
    fn segments(&self) -> usize {
        (self.to.len() / self.root_distance.len().max(1)).max(1)
    }

    /// Distances to keep after the push-out, body by body, without those of the held segments.
    fn free(&self) -> impl Iterator<Item = &[[f64; 2]]> {
        self.to.chunks_exact(self.segments()).map(|of_body| &of_body[self.held..])
    }

    /// The greatest distance to keep from `body`, m; −∞ if none is.
    pub(super) fn greatest(&self, body: usize) -> f64 {
        let segments = self.segments();
        self.to[body * segments..][..segments]
            .as_flattened()
            .iter()
            .copied()
            .fold(f64::NEG_INFINITY, f64::max)
    }

    /// True if the guide starts in `body`, or runs through it, beyond where it grows out of it.
    pub(super) fn starts_in(&self, body: usize) -> bool {
        let segments = self.segments();
        let of_body = &self.from[body * segments..][..segments];
        of_body.iter().skip_while(|ends| **ends == EXEMPT).any(|ends| ends[0].min(ends[1]) < 0.0)
    }

    /// Signed distance of the root from each body in the groom's pose, m, at most [`SEARCH_RADIUS`].
    pub(super) fn root_distance(&self) -> &[f64] {
        &self.root_distance
    }

    /// Distance of the root from the part of `body` that faces the one it is on, m, as it is drawn.
    pub(super) fn fold_distance(&self, body: usize) -> f64 {
        self.fold_distance.get(body).copied().unwrap_or(SEARCH_RADIUS)
    }

    /// Clearances at `share` (0..=1) of the push-out.
    pub fn at(&self, share: f64, out: &mut Vec<[f64; 2]>) {
        let between = |a: f64, b: f64| if a == b { a } else { a + share * (b - a) };
        out.clear();
        out.extend(self.from.iter().zip(&self.to).map(|(a, b)| [between(a[0], b[0]), between(a[1], b[1])]));
    }

    /// Number of segments, over all bodies.
    pub(super) fn len(&self) -> usize {
        self.to.len()
    }

    /// Number of exempt segments, without those next to the root, and of segments with an end that is still
    /// pushed out.
    pub fn counts(&self) -> (usize, usize) {
        let exempt = self.free().flatten().filter(|ends| **ends == EXEMPT).count();
        (exempt, self.from.iter().zip(&self.to).filter(|(a, b)| a != b).count())
    }

    /// Exempt segments, and all, of each body, without those next to the root.
    pub fn by_body(&self) -> impl Iterator<Item = [usize; 2]> {
        let exempt = |ends: &&[f64; 2]| **ends == EXEMPT;
        self.free().map(move |of_body| [of_body.iter().filter(exempt).count(), of_body.len()])
    }

    /// Depth of the deepest point of an exempt segment in its body, m, without the root; 0 if none is inside.
    /// The guide's points are at `x`, m, world, the bodies at time `t`, s, at `pose`.
    pub fn exempt_depth(&self, bodies: &Bodies, t: f64, pose: &[Isometry3<f64>], x: &[Vector3<f64>]) -> f64 {
        let segments = x.len() - 1;
        let exempt = self.to.iter().enumerate().filter(|(_, ends)| **ends == EXEMPT);
        exempt.fold(0.0, |deepest, (i, _)| {
            let (b, tip) = (i / segments, i % segments + 1);
            let y = pose[b].inverse_transform_point(&x[tip].into()).coords;
            let depth = bodies.closest(b, t, &y, SEARCH_RADIUS).map_or(0.0, |s| s.distance.abs());
            // Only for a deeper point does it matter whether it is inside, which is expensive to tell.
            if depth > deepest && bodies.contains(b, t, &y) { depth } else { deepest }
        })
    }

    /// Ends the push-out with the points at `x`, m, world, and the bodies at time `t`, s, at `pose`. Segments
    /// still in a rigid body are drawn through it, and become exempt. A body that deforms may have closed on
    /// them since. Returns whether there are any of these.
    pub fn end_push_out(
        &mut self,
        bodies: &Bodies,
        t: f64,
        pose: &[Isometry3<f64>],
        x: &[Vector3<f64>],
    ) -> bool {
        let segments = x.len() - 1;
        let mut closed_on = false;
        for (i, (from, to)) in self.from.iter_mut().zip(&mut self.to).enumerate() {
            if from == to {
                continue;
            }
            let (b, k) = (i / segments, i % segments);
            let ends = [x[k], x[k + 1]].map(|x| pose[b].inverse_transform_point(&x.into()).coords);
            if ends.iter().any(|y| bodies.contains(b, t, y)) || passes_through(bodies, b, t, &ends) {
                match bodies.bodies[b].solid.deforms() {
                    true => closed_on = true,
                    false => *to = EXEMPT,
                }
            }
            *from = *to;
        }
        closed_on
    }
}

/// True if the segment between two points outside a body, in its frame, enters on one side and leaves on
/// another.
fn passes_through(bodies: &Bodies, body: usize, t: f64, [from, to]: &[Vector3<f64>; 2]) -> bool {
    let sides =
        bodies.first_intersection(body, t, from, to).zip(bodies.first_intersection(body, t, to, from));
    sides.is_some_and(|((_, entry), (_, exit))| entry.dot(&exit) < 0.0)
}

/// Contacts of a polyline at rest in the groom's pose, nearer than twice the thickness.
fn static_contacts(
    bodies: &Bodies,
    t: f64,
    pose: &[Isometry3<f64>],
    thickness: &[f64],
    line: &MovingPolyline,
) -> Vec<Contact> {
    let motions: Vec<BodyMotion> =
        pose.iter().map(|p| BodyMotion { times: [t, t], start: *p, end: *p }).collect();
    let reach = 2.0 * thickness.iter().copied().fold(0.0, f64::max);
    let mut found = Vec::new();
    bodies.candidates(&motions, line, reach, &mut ContactCache::default(), &mut found);
    found
}
