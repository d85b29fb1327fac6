//! Narrow phase in time: crossings of segments and their time of impact.

use super::strands::{ClosestPair, MovingStrands, SegmentContact, SegmentPair};
use crate::contact::ccd::{OVERLAP, STEPS, TOLERANCE};
use nalgebra::Vector3;

/// Distance, m, at which segments count as intersecting: above rounding, far below any clearance between
/// strands.
const INTERSECTING: f64 = 1e-9;

/// Iterations of a bisection in time.
const BISECTIONS: usize = 60;

/// Samples of the time that is left once a pair is too close at a place that belongs to a segment beside it.
const SAMPLES: u32 = 8;

/// Bisections of the time between two samples.
const REFINEMENTS: usize = 10;

/// Share of the distance at the start below which a pair ends that gets a contact of its own, where a segment beside it is
/// in contact in its place. Lower, what is lost in each sub-step adds up; 1 adds a contact at every vertex that is passed.
pub(super) const NEIGHBOUR_SHARE: f64 = 0.99;

/// Share of its distance at the start at which a pair that is in contact there meets anew: segments that turn a lot in a
/// sub-step slip past their contacts, which keep the distance along their normals alone.
pub const TOUCHING_SHARE: f64 = 0.55;

impl MovingStrands<'_> {
    /// Whether the segments of a pair pass through each other during the sub-step: whether their ends become
    /// coplanar, at a root of a cubic in time (Provot 1997), while the segments intersect. Coming arbitrarily
    /// close is no crossing. Neither is rotating past the other's direction, where the ends are coplanar,
    /// too, but the segments apart.
    pub fn crosses(&self, pair: SegmentPair) -> bool {
        let ends = |x| [Self::ends(x, pair.0), Self::ends(x, pair.1)];
        let (start, end) = (ends(self.x0), ends(self.x1));
        let at = |t: f64| [0, 1].map(|s: usize| [0, 1].map(|i: usize| start[s][i].lerp(&end[s][i], t)));
        let volume = |t: f64| {
            let [p, q] = at(t);
            (p[1] - p[0]).cross(&(q[1] - q[0])).dot(&(q[0] - p[0]))
        };
        let intersect = |t: f64| Self::closest(pair, at(t)).distance < INTERSECTING;
        let [low, high] = extrema(volume);
        let knots = [0.0, low, high, 1.0];
        knots.windows(2).any(|k| {
            let (mut lo, mut hi) = (k[0], k[1]);
            let before = volume(lo) > 0.0;
            if before == (volume(hi) > 0.0) {
                return false;
            }
            for _ in 0..BISECTIONS {
                let middle = 0.5 * (lo + hi);
                if before == (volume(middle) > 0.0) { lo = middle } else { hi = middle }
            }
            intersect(hi)
        })
    }

    /// The first time at which a pair meets, as a fraction of the sub-step, and the contact then: at which it is too
    /// close, at a place that belongs to no segment beside it. A strand that slides along another meets it with the
    /// segments before it, not with the vertices that come its way, which are as near as those, but at an angle.
    ///
    /// Too close is nearer than `clearance`, m, or, where the strands are so from the start, a share of their initial
    /// distance: what is apart stays apart, however often it is stopped.
    ///
    /// Conservative advancement along the direction between the closest points, as for bodies
    /// (`contact::ccd`): each end of one segment against each end of the other. Where the place belongs to a segment
    /// beside, samples of the time that is left.
    pub fn impact(&self, closest: &ClosestPair, clearance: f64) -> Option<(SegmentContact, f64)> {
        if self.distance_lower_bound(closest) > clearance {
            return None;
        }
        let pair = closest.pair;
        let start = [Self::ends(self.x0, pair.0), Self::ends(self.x0, pair.1)];
        let end = [Self::ends(self.x1, pair.0), Self::ends(self.x1, pair.1)];
        let velocity = [0, 1].map(|s| [0, 1].map(|i| end[s][i] - start[s][i]));
        let around = self.distance_around(closest);
        if closest.distance <= OVERLAP {
            return None;
        }
        let scale = clearance.min(around).max(OVERLAP);
        let share = match around > clearance {
            true => 1.0,
            false if self.belongs_to_neighbours(closest, 0.0) => NEIGHBOUR_SHARE,
            false => TOUCHING_SHARE,
        };
        let (minimum, stop) = (share * scale, (share + TOLERANCE) * scale);
        // Where they are in contact, what counts is how near they end.
        if around <= clearance && self.end_distance(pair) >= minimum && !self.crosses(pair) {
            return None;
        }
        let ends = |t: f64| [0, 1].map(|s: usize| [0, 1].map(|i: usize| start[s][i] + velocity[s][i] * t));
        let at = |t: f64| Self::closest(pair, ends(t));
        let (mut first, mut t) = (*closest, 0.0);
        for _ in 0..STEPS {
            t += safe_time(&first.normal, &ends(t), &velocity, minimum);
            if t >= 1.0 {
                return None;
            }
            first = at(t);
            if first.distance <= stop {
                break;
            }
        }
        if !self.belongs_to_neighbours(&first, t) {
            return Some((self.contact(&first), t));
        }
        let meets = |t: f64| {
            let closest = at(t);
            closest.distance <= stop && !self.belongs_to_neighbours(&closest, t)
        };
        let mut samples = (1..=SAMPLES).map(|i| t + (1.0 - t) * f64::from(i) / f64::from(SAMPLES));
        let Some(mut met) = samples.find(|&t| meets(t)) else {
            return self.crosses(pair).then(|| (self.contact(&first), t));
        };
        for _ in 0..REFINEMENTS {
            let middle = 0.5 * (t + met);
            if meets(middle) { met = middle } else { t = middle }
        }
        Some((self.contact(&at(met)), met))
    }
}

/// Time in which no end of one segment comes within `minimum`, m, of an end of the other along `normal`.
fn safe_time(
    normal: &Vector3<f64>,
    ends: &[[Vector3<f64>; 2]; 2],
    velocity: &[[Vector3<f64>; 2]; 2],
    minimum: f64,
) -> f64 {
    let mut safe = f64::INFINITY;
    for i in 0..2 {
        for j in 0..2 {
            let approach = -normal.dot(&(velocity[0][i] - velocity[1][j]));
            if approach > 0.0 {
                let gap = normal.dot(&(ends[0][i] - ends[1][j]));
                safe = safe.min((gap - minimum) / approach);
            }
        }
    }
    safe
}

/// Extrema of a cubic, ascending; those outside (0, 1) are replaced by 0. Between them it is monotonic.
fn extrema(cubic: impl Fn(f64) -> f64) -> [f64; 2] {
    // Coefficients from the values at thirds.
    let [a, b, c, d] = [0.0, 1.0, 2.0, 3.0].map(|k| cubic(k / 3.0));
    let cubic = 4.5 * (d - a - 3.0 * (c - b));
    let square = 4.5 * (2.0 * a - 5.0 * b + 4.0 * c - d);
    let linear = d - a - square - cubic;
    let root = (square * square - 3.0 * cubic * linear).max(0.0).sqrt();
    let sum = -(square + root.copysign(square));
    let mut extrema = [sum / (3.0 * cubic), linear / sum].map(|t| if t > 0.0 && t < 1.0 { t } else { 0.0 });
    extrema.sort_by(f64::total_cmp);
    extrema
}
