//! MovingStrands against strands: which segments are near each other, and when moving ones first come too close.
//!
//! All strands of a scene move over a sub-step in a common frame, best that of the head: what the head carries along is
//! no motion of one strand against another. Every vertex moves linearly in that frame. A strand does not meet itself.

use super::ccd::{SEPARATION, STEPS, TOLERANCE, TOUCHING};
use crate::geometry::Bounds;
use crate::geometry::segment_segment;
use nalgebra::Vector3;
use rayon::prelude::*;

/// Edge of a cell of the broad phase over the mean extent of the boxes.
const CELL: f64 = 1.5;

/// Most cells along an axis that a box may span before the cells are made larger.
const SPAN: f64 = 8.0;

/// The last cell along an axis: its number has 21 bits.
const LAST_CELL: u64 = (1 << 21) - 1;

/// Distance at which segments meet, m: above what rounding leaves of none, far below what strands keep.
const MEETING: f64 = 1e-9;

/// MovingStrands that move over a sub-step: the vertices of all, one strand after another, root first.
#[derive(Debug, Clone, Copy)]
pub struct MovingStrands<'a> {
    /// Vertices at the start, m.
    pub x0: &'a [Vector3<f64>],
    /// Vertices at the end, m.
    pub x1: &'a [Vector3<f64>],
    /// Strand of each vertex, ascending.
    pub strand: &'a [u32],
}

/// Two segments of different strands by their first vertices, the lower first.
pub type SegmentPair = (u32, u32);

/// A pair with its closest points at the start of the sub-step.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ClosestPair {
    /// The segments.
    pub pair: SegmentPair,
    /// The closest points on them, 0..=1.
    pub u: [f64; 2],
    /// Unit direction from the second to the first; not a number where the segments meet.
    pub normal: Vector3<f64>,
    /// Their distance, m.
    pub distance: f64,
}

/// A place where two strands must keep their distance.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SegmentContact {
    /// The segments.
    pub pair: SegmentPair,
    /// Places on them, 0..=1.
    pub u: [f64; 2],
    /// Unit direction from the second segment to the first.
    pub normal: Vector3<f64>,
    /// `normal · (x(u) − y(v))` at the end of the sub-step, m.
    pub distance: f64,
}

impl MovingStrands<'_> {
    /// Whether a segment starts at vertex `k`.
    fn is_segment(&self, k: usize) -> bool {
        self.strand.get(k + 1) == Some(&self.strand[k])
    }

    fn ends(x: &[Vector3<f64>], k: u32) -> [Vector3<f64>; 2] {
        [x[k as usize], x[k as usize + 1]]
    }

    /// Box of the whole motion of a segment.
    fn bounds(&self, k: usize, margin: f64) -> Bounds {
        Bounds::around(self.x0[k..=k + 1].iter().chain(&self.x1[k..=k + 1]), margin)
    }

    /// Pairs of segments of different strands that may come within `reach`, m, of each other at any time of the sub-step:
    /// those whose swept boxes, grown by half of it, meet. In ascending order.
    ///
    /// A uniform grid, its cells somewhat larger than the boxes; a pair is told by the cell of the lower corner of the boxes'
    /// intersection, so once.
    pub fn broad_phase(&self, reach: f64) -> Vec<SegmentPair> {
        let segments: Vec<u32> =
            (0..self.strand.len()).filter(|&k| self.is_segment(k)).map(|k| k as u32).collect();
        if segments.is_empty() {
            return Vec::new();
        }
        let boxes: Vec<Bounds> = segments.par_iter().map(|&k| self.bounds(k as usize, 0.5 * reach)).collect();
        let all = Bounds::around(boxes.iter().flat_map(|b| [&b.min, &b.max]), 0.0);
        let extents = || boxes.iter().map(|b| (b.max - b.min).max());
        let mean = extents().sum::<f64>() / boxes.len() as f64;
        let cell = (CELL * mean).max(extents().fold(0.0, f64::max) / SPAN);
        let place = |x: &Vector3<f64>| ((x - all.min) / cell).map(|c| (c as u64).min(LAST_CELL));
        let key = |c: [u64; 3]| (c[0] << 42) | (c[1] << 21) | c[2];
        let cells_of = |(i, b): (usize, &Bounds)| {
            let (lo, hi) = (place(&b.min), place(&b.max));
            let columns = (lo.x..=hi.x).flat_map(move |x| (lo.y..=hi.y).map(move |y| [x, y]));
            columns.flat_map(move |[x, y]| (lo.z..=hi.z).map(move |z| (key([x, y, z]), i as u32)))
        };
        let mut entries: Vec<(u64, u32)> = boxes.par_iter().enumerate().flat_map_iter(cells_of).collect();
        entries.par_sort_unstable();
        let mut found: Vec<SegmentPair> = entries
            .par_chunk_by(|a, b| a.0 == b.0)
            .flat_map_iter(|cell| {
                let (boxes, segments) = (&boxes, &segments);
                cell.iter().enumerate().flat_map(move |(i, &(here, a))| {
                    cell[i + 1..].iter().filter_map(move |&(_, b)| {
                        let (k, l) = (segments[a as usize], segments[b as usize]);
                        let (p, q) = (&boxes[a as usize], &boxes[b as usize]);
                        let apart = self.strand[k as usize] != self.strand[l as usize];
                        let told = || {
                            let corner = place(&p.min.sup(&q.min));
                            key([corner.x, corner.y, corner.z]) == here
                        };
                        (apart && p.overlaps(q) && told()).then_some((k, l))
                    })
                })
            })
            .collect();
        found.par_sort_unstable();
        found
    }

    /// The closest points of a pair at the start of the step.
    pub fn closest_pair(&self, pair: SegmentPair) -> ClosestPair {
        Self::closest(pair, [Self::ends(self.x0, pair.0), Self::ends(self.x0, pair.1)])
    }

    fn closest(pair: SegmentPair, [p, q]: [[Vector3<f64>; 2]; 2]) -> ClosestPair {
        let (u, v) = segment_segment([&p[0], &p[1]], [&q[0], &q[1]]);
        let offset = p[0].lerp(&p[1], u) - q[0].lerp(&q[1], v);
        let distance = offset.norm();
        ClosestPair { pair, u: [u, v], normal: offset / distance, distance }
    }

    /// What the distance of a pair does not fall below in the step, m: that at the start less the most that an end of one moves against an
    /// end of the other.
    pub fn distance_lower_bound(&self, near: &ClosestPair) -> f64 {
        let [p, q] = [near.pair.0, near.pair.1].map(|k| {
            let (start, end) = (Self::ends(self.x0, k), Self::ends(self.x1, k));
            [end[0] - start[0], end[1] - start[1]]
        });
        let most = p.iter().flat_map(|p| q.map(|q| (p - q).norm_squared())).fold(0.0, f64::max);
        near.distance - most.sqrt()
    }

    /// The closest points at the start of the step as a place. `None` where they are at a
    /// vertex and the segment beyond it is nearer, or speaks for it; and where the segments meet, so that there is no direction.
    pub fn contact_candidate(&self, near: &ClosestPair) -> Option<SegmentContact> {
        let ClosestPair { pair, u, normal, distance } = *near;
        let left = || self.left_to_next(pair.0, u[0], &normal) || self.left_to_next(pair.1, u[1], &-normal);
        (distance > TOUCHING && !left()).then(|| self.contact(near))
    }

    /// The closest points of a pair as a place, with the vertices as they are now at the end of the step.
    fn contact(&self, near: &ClosestPair) -> SegmentContact {
        let ClosestPair { pair, u, normal, .. } = *near;
        let contact = SegmentContact { pair, u, normal, distance: 0.0 };
        SegmentContact { distance: self.distance(&contact), ..contact }
    }

    /// Whether a closest point at `u` on segment `k`, seen in direction `normal` from the other strand, is another segment's: vertices are
    /// their upper segment's, unless the lower goes nearer still.
    fn left_to_next(&self, k: u32, u: f64, normal: &Vector3<f64>) -> bool {
        let k = k as usize;
        if u == 0.0 {
            return k > 0 && self.strand[k - 1] == self.strand[k];
        }
        u == 1.0 && self.is_segment(k + 1) && normal.dot(&(self.x0[k + 2] - self.x0[k + 1])) < 0.0
    }

    /// Distance along the contact's normal, at its places, with the vertices as they are now at the end of the step, m.
    pub fn distance(&self, contact: &SegmentContact) -> f64 {
        contact.normal.dot(&self.offset(self.x1, contact))
    }

    /// How far the place on the first strand moves past that on the second, m.
    pub fn slip(&self, contact: &SegmentContact) -> Vector3<f64> {
        self.offset(self.x1, contact) - self.offset(self.x0, contact)
    }

    /// Unit directions of the segments of a pair at the start of the step; null vectors where they have no length.
    pub fn directions(&self, pair: SegmentPair) -> [Vector3<f64>; 2] {
        [pair.0, pair.1].map(|k| {
            let [a, b] = Self::ends(self.x0, k);
            (b - a).try_normalize(0.0).unwrap_or_else(Vector3::zeros)
        })
    }

    /// Mean length of the segments of a pair at the start of the step, m.
    pub fn mean_length(&self, pair: SegmentPair) -> f64 {
        let [a, b] = [pair.0, pair.1].map(|k| {
            let [a, b] = Self::ends(self.x0, k);
            (b - a).norm()
        });
        0.5 * (a + b)
    }

    fn offset(&self, x: &[Vector3<f64>], contact: &SegmentContact) -> Vector3<f64> {
        let (p, q) = (Self::ends(x, contact.pair.0), Self::ends(x, contact.pair.1));
        p[0].lerp(&p[1], contact.u[0]) - q[0].lerp(&q[1], contact.u[1])
    }

    /// Whether the segments of a pair pass through each other: whether their ends come to lie in a plane, a root of a cubic in time (Provot
    /// 1997), in which the segments meet. To come as near as one may like is not to cross, nor is to turn past each other's direction, where all four
    /// ends lie in a plane too, but the segments apart.
    pub fn crosses(&self, pair: SegmentPair) -> bool {
        let ends = |x| [Self::ends(x, pair.0), Self::ends(x, pair.1)];
        let (start, end) = (ends(self.x0), ends(self.x1));
        let at = |t: f64| [0, 1].map(|s: usize| [0, 1].map(|i: usize| start[s][i].lerp(&end[s][i], t)));
        let volume = |t: f64| {
            let [p, q] = at(t);
            (p[1] - p[0]).cross(&(q[1] - q[0])).dot(&(q[0] - p[0]))
        };
        let meet = |t: f64| Self::closest(pair, at(t)).distance < MEETING;
        // The cubic through its values at thirds turns at most twice; between its turns it is monotonous.
        let [a, b, c, d] = [0.0, 1.0, 2.0, 3.0].map(|k| volume(k / 3.0));
        let cubic = 4.5 * (d - a - 3.0 * (c - b));
        let square = 4.5 * (2.0 * a - 5.0 * b + 4.0 * c - d);
        let linear = d - a - square - cubic;
        let root = (square * square - 3.0 * cubic * linear).max(0.0).sqrt();
        let sum = -(square + root.copysign(square));
        let mut turns = [sum / (3.0 * cubic), linear / sum].map(|t| if t > 0.0 && t < 1.0 { t } else { 0.0 });
        turns.sort_by(f64::total_cmp);
        let knots = [0.0, turns[0], turns[1], 1.0];
        knots.windows(2).any(|k| {
            let (mut lo, mut hi) = (k[0], k[1]);
            let before = volume(lo) > 0.0;
            if before == (volume(hi) > 0.0) {
                return false;
            }
            for _ in 0..60 {
                let middle = 0.5 * (lo + hi);
                if before == (volume(middle) > 0.0) { lo = middle } else { hi = middle }
            }
            meet(hi)
        })
    }

    /// The first time at which a pair that must keep `clearance`, m, comes too close, if it does: a fifth of the clearance, or of
    /// the distance at the start where that is less, so that what is apart stays apart however often it is
    /// stopped. The time is a fraction of the sub-step.
    ///
    /// Conservative advancement along the direction between the closest points, as for bodies (`ccd`): each of the ends of
    /// one segment against each of the other.
    pub fn impact(&self, near: &ClosestPair, clearance: f64) -> Option<(SegmentContact, f64)> {
        let pair = near.pair;
        let start = [Self::ends(self.x0, pair.0), Self::ends(self.x0, pair.1)];
        let end = [Self::ends(self.x1, pair.0), Self::ends(self.x1, pair.1)];
        let velocity = [0, 1].map(|s| [0, 1].map(|i| end[s][i] - start[s][i]));
        let scale = clearance.min(near.distance);
        if scale <= TOUCHING {
            return None;
        }
        let (separation, stop) = (SEPARATION * scale, (SEPARATION + TOLERANCE) * scale);
        let mut near = *near;
        let mut place = start;
        let mut t = 0.0;
        for _ in 0..STEPS {
            let mut free = f64::INFINITY;
            for i in 0..2 {
                for j in 0..2 {
                    let approach = -near.normal.dot(&(velocity[0][i] - velocity[1][j]));
                    if approach > 0.0 {
                        let gap = near.normal.dot(&(place[0][i] - place[1][j]));
                        free = free.min((gap - separation) / approach);
                    }
                }
            }
            t += free;
            if t >= 1.0 {
                return None;
            }
            place = [0, 1].map(|s| [0, 1].map(|i| start[s][i] + velocity[s][i] * t));
            near = Self::closest(pair, place);
            if near.distance <= stop {
                break;
            }
        }
        Some((self.contact(&near), t))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::random::Random;

    /// MovingStrands of four vertices each in a cube of `edge`, m, that move by up to `motion`, m.
    fn tangle(
        count: u32,
        edge: f64,
        motion: f64,
        seed: u64,
    ) -> (Vec<Vector3<f64>>, Vec<Vector3<f64>>, Vec<u32>) {
        let mut random = Random::new(seed);
        let mut vector = |scale: f64| random.vector() * (0.5 * scale);
        let (mut x0, mut x1, mut strand) = (Vec::new(), Vec::new(), Vec::new());
        for s in 0..count {
            let mut x = vector(edge);
            for _ in 0..4 {
                x += vector(0.04);
                x0.push(x);
                x1.push(x + vector(motion));
                strand.push(s);
            }
        }
        (x0, x1, strand)
    }

    fn all_pairs(strands: &MovingStrands) -> Vec<SegmentPair> {
        let n = strands.strand.len();
        let segments: Vec<usize> = (0..n).filter(|&k| strands.is_segment(k)).collect();
        let mut out = Vec::new();
        for (i, &k) in segments.iter().enumerate() {
            for &l in &segments[i + 1..] {
                if strands.strand[k] != strands.strand[l] {
                    out.push((k as u32, l as u32));
                }
            }
        }
        out
    }

    #[test]
    fn the_grid_finds_what_all_against_all_finds() {
        for (seed, motion) in [(1, 0.0), (2, 0.01), (3, 0.2)] {
            let (x0, x1, strand) = tangle(60, 0.3, motion, seed);
            let strands = MovingStrands { x0: &x0, x1: &x1, strand: &strand };
            let reach = 0.004;
            let boxes = |k: u32| strands.bounds(k as usize, 0.5 * reach);
            let wanted: Vec<SegmentPair> =
                all_pairs(&strands).into_iter().filter(|&(k, l)| boxes(k).overlaps(&boxes(l))).collect();
            assert!(wanted.len() > 10, "{}", wanted.len());
            assert_eq!(strands.broad_phase(reach), wanted);
        }
    }

    #[test]
    fn no_impact_means_no_approach_and_an_impact_means_one() {
        let clearance: f64 = 0.002;
        let mut hits = 0;
        for seed in 0..40 {
            let (x0, x1, strand) = tangle(6, 0.05, 0.08, seed);
            let strands = MovingStrands { x0: &x0, x1: &x1, strand: &strand };
            for pair in all_pairs(&strands) {
                let near = strands.closest_pair(pair);
                let least = (0..=400)
                    .map(|i| {
                        let t = f64::from(i) / 400.0;
                        let x: Vec<_> = x0.iter().zip(&x1).map(|(a, b)| a.lerp(b, t)).collect();
                        MovingStrands { x0: &x, x1: &x, strand: &strand }.closest_pair(pair).distance
                    })
                    .fold(f64::INFINITY, f64::min);
                assert!(least >= strands.distance_lower_bound(&near));
                let scale = clearance.min(near.distance);
                match strands.impact(&near, clearance) {
                    None => assert!(least > 0.99 * SEPARATION * scale, "{pair:?} passed at {least}"),
                    Some((hit, _)) => {
                        hits += 1;
                        // The samples miss the instant by a four-hundredth of the motion.
                        assert!(least < (SEPARATION + TOLERANCE) * scale + 4e-4, "{pair:?} stays at {least}");
                        assert!((hit.normal.norm() - 1.0).abs() < 1e-12);
                    }
                }
            }
        }
        assert!(hits > 50, "{hits}");
    }

    #[test]
    fn a_crossing_is_told_from_a_near_miss() {
        // A segment through another, beside it, and back out again.
        let still = [Vector3::new(-1.0, 0.0, 0.0), Vector3::new(1.0, 0.0, 0.0)];
        let needle = |x: f64, y: [f64; 2]| [Vector3::new(x, y[0], -1.0), Vector3::new(x, y[1], 1.0)];
        let crosses = |a: [Vector3<f64>; 2], b: [Vector3<f64>; 2]| {
            let (x0, x1) = ([still, a].concat(), [still, b].concat());
            MovingStrands { x0: &x0, x1: &x1, strand: &[0, 0, 1, 1] }.crosses((0, 2))
        };
        for depth in [1e-9, 1e-3, 1.0] {
            assert!(crosses(needle(0.3, [1e-6, 1e-6]), needle(0.3, [-depth, -depth])));
            assert!(!crosses(needle(0.3, [1e-6, 1e-6]), needle(0.3, [1e-15, 1e-15])));
            assert!(!crosses(needle(1.1, [1.0, 1.0]), needle(1.1, [-depth, -depth])));
        }
        // Its ends pass one after the other while it moves past the end of the other segment, or before that.
        assert!(crosses(needle(0.9, [1.0, 1.0]), needle(1.2, [-3.0, -3.0])));
        assert!(!crosses(needle(0.9, [1.0, 1.0]), needle(1.5, [-1.0, -1.0])));
    }

    #[test]
    fn to_turn_past_the_direction_of_a_near_one_is_not_to_cross_it() {
        let still = [Vector3::new(-1.0, 0.0, 0.0), Vector3::new(1.0, 0.0, 0.0)];
        let turned = |y: f64, z: f64| [Vector3::new(-1.0, -y, z), Vector3::new(1.0, y, z)];
        let crosses = |z: [f64; 2]| {
            let (x0, x1) = ([still, turned(1e-3, z[0])].concat(), [still, turned(-2e-3, z[1])].concat());
            MovingStrands { x0: &x0, x1: &x1, strand: &[0, 0, 1, 1] }.crosses((0, 2))
        };
        for z in [1e-6, 1e-5, 0.1] {
            assert!(!crosses([z, z]) && !crosses([-z, -0.5 * z]));
            assert!(crosses([z, -z]) && crosses([-0.3 * z, z]));
        }
    }

    #[test]
    fn crossings_are_those_that_fine_samples_of_the_side_show() {
        let mut counts = [0; 2];
        for seed in 0..60 {
            let (x0, x1, strand) = tangle(6, 0.05, 0.08, seed);
            let strands = MovingStrands { x0: &x0, x1: &x1, strand: &strand };
            for pair in all_pairs(&strands) {
                // The side on which the second segment is where their closest points are within both changes at a crossing, and nowhere else.
                let side = |t: f64| {
                    let x: Vec<_> = x0.iter().zip(&x1).map(|(a, b)| a.lerp(b, t)).collect();
                    let (p, q) = (MovingStrands::ends(&x, pair.0), MovingStrands::ends(&x, pair.1));
                    let (u, v) = segment_segment([&p[0], &p[1]], [&q[0], &q[1]]);
                    let inner = |s: f64| s > 0.0 && s < 1.0;
                    let normal = (p[1] - p[0]).cross(&(q[1] - q[0]));
                    (inner(u) && inner(v)).then(|| normal.dot(&(q[0] - p[0])) > 0.0)
                };
                let sides: Vec<_> = (0..=4000).map(|i| side(f64::from(i) / 4000.0)).collect();
                let swaps = sides.windows(2).any(|s| s[0].is_some() && s[1].is_some() && s[0] != s[1]);
                // What crosses within a sample of an edge is seen by one and not by the other.
                if swaps {
                    assert!(strands.crosses(pair), "seed {seed} {pair:?}");
                }
                counts[0] += usize::from(swaps);
                counts[1] += usize::from(strands.crosses(pair));
            }
        }
        assert!(counts[0] > 100 && counts[1] - counts[0] < counts[0] / 10, "{counts:?}");
    }

    #[test]
    fn strands_that_swap_sides_are_stopped() {
        // A needle crossing another at right angles and nearly parallel, at 10,000 times the clearance.
        for slope in [1.0, 1e-3] {
            let x0 = [[-0.1, 0.0, 0.0], [0.1, 0.0, 0.0], [-0.1, 1.0, -0.1 * slope], [0.1, 1.0, 0.1 * slope]];
            let x0 = x0.map(Vector3::from);
            let mut x1 = x0;
            x1[2].y = -1.0;
            x1[3].y = -1.0;
            let strands = MovingStrands { x0: &x0, x1: &x1, strand: &[0, 0, 1, 1] };
            let (hit, _) = strands.impact(&strands.closest_pair((0, 2)), 1e-4).expect("stopped");
            assert!(hit.normal.y < -0.99 && hit.distance < -0.9, "{hit:?}");
            assert!(strands.crosses((0, 2)));
        }
    }
}
