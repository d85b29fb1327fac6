//! How a render strand follows a guide: by the guide's deviation, in rest space, summed from the root.
//!
//! A guide whose frames are R(rest) at rest has turned by D at arc length s, R = D R(rest), and D' = D [R(rest) q]×. So R(rest) q, blended
//! of several guides, turns a strand as they turn, whatever its own frames; a strand of one guide keeps its place beside it
//! however far both have turned.

use crate::math::se3::{self, Pose};
use crate::rod::{Rod, RodShape};
use nalgebra::{Matrix3, Vector3};

/// A place on a guide: a segment of its rod's polyline, and how far along it (0..=1).
#[derive(Debug, Clone, Copy)]
pub(super) struct Place {
    segment: u32,
    u: f32,
}

impl Place {
    /// Between the points, m, that `x` tells.
    pub fn of(self, x: impl Fn(usize) -> Vector3<f64>) -> Vector3<f64> {
        let k = self.segment as usize;
        x(k).lerp(&x(k + 1), f64::from(self.u))
    }

    /// Of sums along the guide, one per segment.
    #[inline(always)]
    pub fn sum(self, of: &[Turned]) -> [f64; 6] {
        let (u, turned) = (f64::from(self.u), &of[self.segment as usize]);
        std::array::from_fn(|i| turned.before[i] + (turned.here[i] + turned.bow[i] * (1.0 - u)) * u)
    }

    /// The nearest point of the polyline.
    pub fn nearest(self) -> usize {
        self.segment as usize + usize::from(self.u >= 0.5)
    }
}

/// A guide at rest.
#[derive(Debug, Clone)]
pub(super) struct RestGuide {
    arc: Vec<f64>,
    pose: Vec<Pose>,
    root: Vector3<f64>,
    turns: Vec<Turn>,
}

/// The sum of R(rest) q, rad, and of its rate, 1/s, along a segment of a guide's polyline: at u of it, before + here u + bow u (1 − u).
#[derive(Debug)]
pub(super) struct Turned {
    before: [f64; 6],
    here: [f64; 6],
    bow: [f64; 6],
}

/// What a guide's deviation at two nodes adds to that sum in a segment.
#[derive(Debug, Clone)]
struct Turn {
    /// The first of the nodes.
    node: usize,
    /// ∫ R(rest) N ds for either, by Simpson's rule, m.
    here: [Matrix3<f64>; 2],
    /// Half the segment's length times the change of R(rest) N over it, less: what the integral to its middle is more than half.
    bow: [Matrix3<f64>; 2],
}

impl RestGuide {
    pub fn new(rod: &Rod) -> Self {
        let mut shape = RodShape::default();
        shape.update(rod, &rod.root.r, &vec![0.0; rod.unknowns()]);
        let (arc, pose): (Vec<f64>, Vec<Pose>) = (rod.arc.clone(), shape.poses().collect());
        let turns =
            arc.windows(2).zip(pose.windows(2)).map(|(s, pose)| Turn::new(&rod.nodes, s, pose)).collect();
        RestGuide { arc, pose, root: rod.root.p, turns }
    }

    pub fn root(&self) -> Vector3<f64> {
        self.root
    }

    /// Length, m.
    pub fn length(&self) -> f64 {
        self.arc[self.arc.len() - 1]
    }

    /// A place of the rod, m, rest space.
    pub fn at(&self, place: Place) -> Vector3<f64> {
        self.root + place.of(|k| self.pose[k].p)
    }

    /// The place of the rod at arc length `s`, m; past the tip, the tip.
    pub fn place(&self, s: f64) -> Place {
        let i = self.arc.partition_point(|&a| a <= s).clamp(1, self.arc.len() - 1);
        let (from, to) = (self.arc[i - 1], self.arc[i]);
        Place { segment: i as u32 - 1, u: ((s - from) / (to - from)).clamp(0.0, 1.0) as f32 }
    }

    /// Sums of R(rest) q from the root, rest space, of its deviation `q`, 1/m, and of its rate. One per segment.
    pub fn turned(&self, q: &[f64], rate: &[f64]) -> Vec<Turned> {
        let mut before = [0.0; 6];
        let turned = |turn: &Turn| {
            // The tip's node has no strain.
            let of = |parts: &[Matrix3<f64>; 2], q: &[f64]| {
                let nodes = q[3 * turn.node..].chunks_exact(3).zip(parts);
                nodes.fold(Vector3::zeros(), |sum, (q, part)| sum + part * Vector3::new(q[0], q[1], q[2]))
            };
            let both = |parts: &[Matrix3<f64>; 2]| {
                let [sum, rate] = [q, rate].map(|q| of(parts, q));
                [sum.x, sum.y, sum.z, rate.x, rate.y, rate.z]
            };
            let turned = Turned { before, here: both(&turn.here), bow: both(&turn.bow) };
            before.iter_mut().zip(turned.here).for_each(|(before, here)| *before += here);
            turned
        };
        self.turns.iter().map(turned).collect()
    }
}

impl Turn {
    /// For the segment between the arc lengths `s`, m, and the poses there, of a rod with these strain `nodes`.
    fn new(nodes: &[f64], s: &[f64], pose: &[Pose]) -> Self {
        let (middle, length) = (0.5 * (s[0] + s[1]), s[1] - s[0]);
        let node = nodes.partition_point(|&a| a <= middle).clamp(1, nodes.len() - 1) - 1;
        let [a, b] = [pose[0].r, pose[1].r];
        let half = a * se3::exp_so3(&(se3::log_so3(&(a.transpose() * b)) * 0.5));
        let carried = |s: f64, r: Matrix3<f64>| {
            let u = (s - nodes[node]) / (nodes[node + 1] - nodes[node]);
            [r * (length * (1.0 - u)), r * (length * u)]
        };
        let [a, half, b] = [carried(s[0], a), carried(middle, half), carried(s[1], b)];
        let both =
            |f: fn(f64, f64, f64) -> f64| std::array::from_fn(|i| a[i].zip_zip_map(&half[i], &b[i], f));
        Turn { node, here: both(|a, half, b| (a + 4.0 * half + b) / 6.0), bow: both(|a, _, b| 0.5 * (a - b)) }
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use crate::rod::{RodSource, SegmentSize, Taper};

    /// A guide drawn at `points`, m, with two strain nodes.
    pub fn drawn(points: &[Vector3<f64>]) -> RestGuide {
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
    fn a_place_moves_with_the_arc_length_also_between_points() {
        let points: Vec<_> =
            (0..50).map(|i| f64::from(i) * 0.05).map(|t| Vector3::new(t.cos(), t.sin(), t) * 0.05).collect();
        let guide = drawn(&points);
        let at = |i: usize| guide.at(guide.place(guide.length() * i as f64 / 400.0));
        for i in 0..400 {
            let moved = (at(i + 1) - at(i)).norm() / (guide.length() / 400.0);
            assert!((0.97..1.0 + 1e-6).contains(&moved), "{i}: {moved}");
        }
        assert_eq!(guide.at(guide.place(2.0 * guide.length())), at(400));
    }
}
