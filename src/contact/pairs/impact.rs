//! Narrow phase in time: crossings of segments and their time of impact.

use super::strands::{ClosestPair, MovingStrands, SegmentContact, SegmentPair};
use crate::contact::ccd::{OVERLAP, SEPARATION, STEPS, TOLERANCE};
use nalgebra::Vector3;

/// Distance, m, at which segments count as intersecting: above rounding, far below any clearance between
/// strands.
const INTERSECTING: f64 = 1e-9;

/// Iterations of a bisection in time.
const BISECTIONS: usize = 60;

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

    /// The first time at which a pair comes too close, as a fraction of the sub-step, and the contact then.
    /// Too close is nearer than `clearance`, m, or, for a pair that is so from the start, a fifth of its
    /// initial distance: what is apart stays apart, however often it is stopped.
    ///
    /// Conservative advancement along the direction between the closest points, as for bodies
    /// (`contact::ccd`): each end of one segment against each end of the other.
    pub fn impact(&self, closest: &ClosestPair, clearance: f64) -> Option<(SegmentContact, f64)> {
        if self.distance_lower_bound(closest) > clearance {
            return None;
        }
        let pair = closest.pair;
        let start = [Self::ends(self.x0, pair.0), Self::ends(self.x0, pair.1)];
        let end = [Self::ends(self.x1, pair.0), Self::ends(self.x1, pair.1)];
        let velocity = [0, 1].map(|s| [0, 1].map(|i| end[s][i] - start[s][i]));
        let scale = clearance.min(closest.distance);
        if scale <= OVERLAP {
            return None;
        }
        let share = if closest.distance > clearance { 1.0 } else { SEPARATION };
        let (minimum, stop) = (share * scale, (share + TOLERANCE) * scale);
        let mut closest = *closest;
        let mut ends = start;
        let mut t = 0.0;
        for _ in 0..STEPS {
            t += safe_time(&closest.normal, &ends, &velocity, minimum);
            if t >= 1.0 {
                return None;
            }
            ends = [0, 1].map(|s| [0, 1].map(|i| start[s][i] + velocity[s][i] * t));
            closest = Self::closest(pair, ends);
            if closest.distance <= stop {
                break;
            }
        }
        Some((self.contact(&closest), t))
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
