//! Moving strands, and closest pairs of points between their segments.

use crate::contact::ccd::OVERLAP;
use crate::geometry::{Bounds, segment_segment};
use nalgebra::Vector3;

/// Strands that move over a sub-step: the vertices of all strands, one strand after another, root first.
#[derive(Debug, Clone, Copy)]
pub struct MovingStrands<'a> {
    /// Vertices at the start, m.
    pub x0: &'a [Vector3<f64>],
    /// Vertices at the end, m.
    pub x1: &'a [Vector3<f64>],
    /// Strand of each vertex, ascending.
    pub strand: &'a [u32],
    /// Arc length of each vertex along its strand, over the length within which a strand does not meet itself.
    pub arc: &'a [f64],
}

/// Two segments that may meet, by their first vertices, the lower first.
pub type SegmentPair = (u32, u32);

/// The closest points of two segments at the start of the sub-step.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ClosestPair {
    /// The segments.
    pub pair: SegmentPair,
    /// Parameters of the closest points on them, 0..=1.
    pub u: [f64; 2],
    /// Unit direction from the second segment to the first; NaN if they intersect.
    pub normal: Vector3<f64>,
    /// Distance of the closest points, m.
    pub distance: f64,
}

/// A place where two strands must keep their distance.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SegmentContact {
    /// The segments.
    pub pair: SegmentPair,
    /// Parameters of the points on them, 0..=1.
    pub u: [f64; 2],
    /// Unit direction from the second segment to the first.
    pub normal: Vector3<f64>,
    /// `normal · (x(u) − y(v))` at the end of the sub-step, m.
    pub distance: f64,
}

/// Most segments that lie between a pair and the one that its closest points belong to.
const MAX_NEIGHBOURS: usize = 4;

impl MovingStrands<'_> {
    /// Whether a segment starts at vertex `k`.
    pub(super) fn is_segment(&self, k: usize) -> bool {
        self.strand.get(k + 1) == Some(&self.strand[k])
    }

    /// Whether segments `k` < `l` may meet: those of different strands, and those far enough apart along one.
    pub(super) fn may_meet(&self, k: u32, l: u32) -> bool {
        let (k, l) = (k as usize, l as usize);
        self.strand[k] != self.strand[l] || self.arc[l] - self.arc[k + 1] >= 1.0
    }

    /// Ends of segment `k` of the vertices `x`.
    pub(super) fn ends(x: &[Vector3<f64>], k: u32) -> [Vector3<f64>; 2] {
        [x[k as usize], x[k as usize + 1]]
    }

    /// Bounding box of the motion of segment `k`, grown by `margin`, m.
    pub(super) fn bounds(&self, k: usize, margin: f64) -> Bounds {
        Bounds::around(self.x0[k..=k + 1].iter().chain(&self.x1[k..=k + 1]), margin)
    }

    /// The closest points of a pair at the start of the sub-step.
    pub fn closest_pair(&self, pair: SegmentPair) -> ClosestPair {
        Self::closest(pair, [Self::ends(self.x0, pair.0), Self::ends(self.x0, pair.1)])
    }

    /// Distance of a pair at the end of the sub-step, m.
    pub fn end_distance(&self, pair: SegmentPair) -> f64 {
        Self::closest(pair, [Self::ends(self.x1, pair.0), Self::ends(self.x1, pair.1)]).distance
    }

    /// The closest points of two segments with these ends.
    pub(super) fn closest(pair: SegmentPair, [p, q]: [[Vector3<f64>; 2]; 2]) -> ClosestPair {
        let (u, v) = segment_segment([&p[0], &p[1]], [&q[0], &q[1]]);
        let offset = p[0].lerp(&p[1], u) - q[0].lerp(&q[1], v);
        let distance = offset.norm();
        ClosestPair { pair, u: [u, v], normal: offset / distance, distance }
    }

    /// Lower bound on the distance of a pair over the sub-step, m: the initial distance less the largest
    /// relative displacement of their ends.
    pub fn distance_lower_bound(&self, closest: &ClosestPair) -> f64 {
        let [p, q] = [closest.pair.0, closest.pair.1].map(|k| {
            let (start, end) = (Self::ends(self.x0, k), Self::ends(self.x1, k));
            [end[0] - start[0], end[1] - start[1]]
        });
        let most = p.iter().flat_map(|p| q.map(|q| (p - q).norm_squared())).fold(0.0, f64::max);
        closest.distance - most.sqrt()
    }

    /// The contact at the closest points at the start of the sub-step. `None` if they are at a vertex and
    /// belong to the segment next to it, or if the segments intersect, so that there is no direction.
    pub fn contact_candidate(&self, closest: &ClosestPair) -> Option<SegmentContact> {
        (closest.distance > OVERLAP && !self.belongs_to_neighbours(closest, 0.0))
            .then(|| self.contact(closest))
    }

    /// Whether one of the closest points of a pair at time `t`, a fraction of the sub-step, is at a vertex and belongs to
    /// the segment next to it.
    pub(super) fn belongs_to_neighbours(&self, closest: &ClosestPair, t: f64) -> bool {
        let ClosestPair { pair, u, normal, .. } = closest;
        self.neighbour(pair.0, u[0], normal, t).is_some()
            || self.neighbour(pair.1, u[1], &-normal, t).is_some()
    }

    /// Distance of two strands around a pair at the start of the sub-step, m: that of the pair or, where its closest
    /// points belong to segments next to it, theirs.
    pub fn distance_around(&self, closest: &ClosestPair) -> f64 {
        let mut closest = *closest;
        for _ in 0..MAX_NEIGHBOURS {
            let ClosestPair { pair, u, normal, .. } = closest;
            let next = [
                self.neighbour(pair.0, u[0], &normal, 0.0).map(|k| (k, pair.1)),
                self.neighbour(pair.1, u[1], &-normal, 0.0).map(|l| (pair.0, l)),
            ];
            let may_meet = next.into_iter().flatten().filter(|(k, l)| self.may_meet(*k, *l));
            let nearer = may_meet.map(|pair| self.closest_pair(pair));
            match nearer.filter(|next| next.distance < closest.distance).reduce(nearest) {
                Some(next) => closest = next,
                None => break,
            }
        }
        closest.distance
    }

    /// The contact at the closest points of a pair, for the current vertices at the end of the sub-step.
    pub fn contact(&self, closest: &ClosestPair) -> SegmentContact {
        let ClosestPair { pair, u, normal, .. } = *closest;
        let contact = SegmentContact { pair, u, normal, distance: 0.0 };
        SegmentContact { distance: self.distance(&contact), ..contact }
    }

    /// The segment next to `k` that a closest point at `u` on it, in direction `normal` from the other strand, belongs to
    /// at time `t`: a vertex belongs to the segment on its root side, unless the one on its tip side is still closer.
    fn neighbour(&self, k: u32, u: f64, normal: &Vector3<f64>, t: f64) -> Option<u32> {
        let first = k as usize;
        if u == 0.0 {
            return (first > 0 && self.strand[first - 1] == self.strand[first]).then(|| k - 1);
        }
        let at = |k: usize| self.x0[k].lerp(&self.x1[k], t);
        let is_closer = || normal.dot(&(at(first + 2) - at(first + 1))) < 0.0;
        (u == 1.0 && self.is_segment(first + 1) && is_closer()).then(|| k + 1)
    }

    /// Distance at a contact along its normal, for the current vertices at the end of the sub-step, m.
    pub fn distance(&self, contact: &SegmentContact) -> f64 {
        contact.normal.dot(&self.offset(self.x1, contact))
    }

    /// Displacement of the contact's point on the first strand relative to that on the second over the
    /// sub-step, m.
    pub fn slip(&self, contact: &SegmentContact) -> Vector3<f64> {
        self.offset(self.x1, contact) - self.offset(self.x0, contact)
    }

    fn offset(&self, x: &[Vector3<f64>], contact: &SegmentContact) -> Vector3<f64> {
        let (p, q) = (Self::ends(x, contact.pair.0), Self::ends(x, contact.pair.1));
        p[0].lerp(&p[1], contact.u[0]) - q[0].lerp(&q[1], contact.u[1])
    }

    /// Unit directions of the segments of a pair at the start of the sub-step; zero for segments of zero
    /// length.
    pub fn directions(&self, pair: SegmentPair) -> [Vector3<f64>; 2] {
        [pair.0, pair.1].map(|k| {
            let [a, b] = Self::ends(self.x0, k);
            (b - a).try_normalize(0.0).unwrap_or_else(Vector3::zeros)
        })
    }

    /// Mean length of the segments of a pair at the start of the sub-step, m.
    pub fn mean_length(&self, pair: SegmentPair) -> f64 {
        let [a, b] = [pair.0, pair.1].map(|k| {
            let [a, b] = Self::ends(self.x0, k);
            (b - a).norm()
        });
        0.5 * (a + b)
    }
}

/// The nearer of two.
fn nearest(a: ClosestPair, b: ClosestPair) -> ClosestPair {
    if b.distance < a.distance { b } else { a }
}
