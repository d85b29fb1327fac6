//! Guides at rest, and the integrals of their deviation that rotate the strands.
//!
//! A guide whose frames at rest are R° has the frames D R° with D' = D [R° q]×. The integral of R° q, blended
//! over several guides, therefore rotates a strand as the guides rotate, whatever the strand's own frames. A
//! strand with a single guide keeps its place beside it at any rotation.

use crate::math::se3::{self, Pose};
use crate::rod::{Rod, RodShape};
use nalgebra::{Matrix3, Vector3};

/// A place on a guide: a segment of its polyline and the fraction (0..=1) along it.
#[derive(Debug, Clone, Copy)]
pub(super) struct GuidePlace {
    segment: u32,
    u: f32,
}

impl GuidePlace {
    /// Position of the place, given those of the points, m.
    pub fn position(self, x: impl Fn(usize) -> Vector3<f64>) -> Vector3<f64> {
        let k = self.segment as usize;
        x(k).lerp(&x(k + 1), f64::from(self.u))
    }

    /// The integral from the root to the place.
    #[inline(always)]
    pub fn integral(self, of: &[DeviationIntegral]) -> [f64; 6] {
        let (u, of) = (f64::from(self.u), &of[self.segment as usize]);
        std::array::from_fn(|i| of.before[i] + (of.here[i] + of.bow[i] * (1.0 - u)) * u)
    }

    /// Index of the nearest point.
    pub fn nearest_point(self) -> usize {
        self.segment as usize + usize::from(self.u >= 0.5)
    }
}

/// A guide at rest.
#[derive(Debug, Clone)]
pub(super) struct RestGuide {
    arc: Vec<f64>,
    pose: Vec<Pose>,
    root: Vector3<f64>,
    weights: Vec<SegmentWeights>,
}

/// ∫ R° q ds from the root, rad, and its rate, rad/s (three numbers each), at fraction u of a segment of a
/// guide: before + here u + bow u (1 − u).
#[derive(Debug)]
pub(super) struct DeviationIntegral {
    before: [f64; 6],
    here: [f64; 6],
    bow: [f64; 6],
}

/// Weights of the unknowns of two nodes in the integral over a segment.
#[derive(Debug, Clone)]
struct SegmentWeights {
    /// The first of the nodes.
    node: usize,
    /// ∫ R° N ds of both nodes (Simpson's rule), m.
    here: [Matrix3<f64>; 2],
    /// Half the segment's length times the decrease of R° N over it: the bow of a linear integrand, m.
    bow: [Matrix3<f64>; 2],
}

impl RestGuide {
    pub fn new(rod: &Rod) -> Self {
        let mut shape = RodShape::default();
        shape.update(rod, &rod.root.r, &vec![0.0; rod.unknowns()]);
        let (arc, pose): (Vec<f64>, Vec<Pose>) = (rod.arc.clone(), shape.poses().collect());
        let segments = arc.windows(2).zip(pose.windows(2));
        let weights = segments.map(|(s, pose)| SegmentWeights::new(&rod.nodes, s, pose)).collect();
        RestGuide { arc, pose, root: rod.root.p, weights }
    }

    /// Position of the root, m, rest space.
    pub fn root(&self) -> Vector3<f64> {
        self.root
    }

    /// Length, m.
    pub fn length(&self) -> f64 {
        self.arc[self.arc.len() - 1]
    }

    /// Position of a place, m, rest space.
    pub fn position(&self, place: GuidePlace) -> Vector3<f64> {
        self.root + place.position(|k| self.pose[k].p)
    }

    /// The place at arc length `s`, m, clamped to the tip.
    pub fn place(&self, s: f64) -> GuidePlace {
        let i = self.arc.partition_point(|&a| a <= s).clamp(1, self.arc.len() - 1);
        let (from, to) = (self.arc[i - 1], self.arc[i]);
        GuidePlace { segment: i as u32 - 1, u: ((s - from) / (to - from)).clamp(0.0, 1.0) as f32 }
    }

    /// Integrals of the deviation `q`, 1/m, and its rate, one per segment.
    pub fn deviation_integrals(&self, q: &[f64], rate: &[f64]) -> Vec<DeviationIntegral> {
        let mut before = [0.0; 6];
        let integral = |weights: &SegmentWeights| {
            // The tip node has no unknowns.
            let of = |parts: &[Matrix3<f64>; 2], q: &[f64]| {
                let nodes = q[3 * weights.node..].chunks_exact(3).zip(parts);
                nodes.fold(Vector3::zeros(), |sum, (q, part)| sum + part * Vector3::new(q[0], q[1], q[2]))
            };
            let both = |parts: &[Matrix3<f64>; 2]| {
                let [sum, rate] = [q, rate].map(|q| of(parts, q));
                [sum.x, sum.y, sum.z, rate.x, rate.y, rate.z]
            };
            let integral = DeviationIntegral { before, here: both(&weights.here), bow: both(&weights.bow) };
            before.iter_mut().zip(integral.here).for_each(|(before, here)| *before += here);
            integral
        };
        self.weights.iter().map(integral).collect()
    }
}

impl SegmentWeights {
    /// Of the segment between the arc lengths `s`, m, with the poses `pose`, of a rod with the strain
    /// `nodes`.
    fn new(nodes: &[f64], s: &[f64], pose: &[Pose]) -> Self {
        let (middle, length) = (0.5 * (s[0] + s[1]), s[1] - s[0]);
        let node = nodes.partition_point(|&a| a <= middle).clamp(1, nodes.len() - 1) - 1;
        let [a, b] = [pose[0].r, pose[1].r];
        let half = a * se3::exp_so3(&(se3::log_so3(&(a.transpose() * b)) * 0.5));
        let integrand = |s: f64, r: Matrix3<f64>| {
            let u = (s - nodes[node]) / (nodes[node + 1] - nodes[node]);
            [r * (length * (1.0 - u)), r * (length * u)]
        };
        let [a, half, b] = [integrand(s[0], a), integrand(middle, half), integrand(s[1], b)];
        let both =
            |f: fn(f64, f64, f64) -> f64| std::array::from_fn(|i| a[i].zip_zip_map(&half[i], &b[i], f));
        SegmentWeights {
            node,
            here: both(|a, half, b| (a + 4.0 * half + b) / 6.0),
            bow: both(|a, _, b| 0.5 * (a - b)),
        }
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use crate::rod::{RodSource, SegmentSize, Taper};

    /// A guide through `points`, m, with two nodes that have unknowns.
    pub fn guide_through(points: &[Vector3<f64>]) -> RestGuide {
        let rod = Rod::new(&RodSource {
            points,
            root_frame: None,
            arc: &[0.0, 0.5, 1.0],
            stiffness: [1e-9; 3],
            line_density: 1e-5,
            damping: 0.0,
            taper: Taper::NONE,
            natural_strain: None,
            segment_size: SegmentSize::FINE,
        });
        RestGuide::new(&rod.unwrap())
    }

    #[test]
    fn place_moves_with_arc_length_also_between_points() {
        let points: Vec<_> =
            (0..50).map(|i| f64::from(i) * 0.05).map(|t| Vector3::new(t.cos(), t.sin(), t) * 0.05).collect();
        let guide = guide_through(&points);
        let at = |i: usize| guide.position(guide.place(guide.length() * i as f64 / 400.0));
        for i in 0..400 {
            let moved = (at(i + 1) - at(i)).norm() / (guide.length() / 400.0);
            assert!((0.97..1.0 + 1e-6).contains(&moved), "{i}: {moved}");
        }
        assert_eq!(guide.position(guide.place(2.0 * guide.length())), at(400));
    }
}
