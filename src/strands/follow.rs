//! How a render strand follows a guide: the guide's deviation, seen in the strand's frame and summed over the stretch
//! between the middles of two edges.
//!
//! Seen in the strand's frame as it stands beside the guide's at rest: a strand of one guide then turns everywhere as the
//! guide does at the same arc length, R = R_g R_gᵀ(rest) R(rest), and keeps its place beside it however far both have turned.

use crate::math::se3::{self, Pose};
use crate::rod::{Rod, Shape};
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

    /// The nearest point of the polyline.
    pub fn nearest(self) -> usize {
        self.segment as usize + usize::from(self.u >= 0.5)
    }
}

/// A guide at rest.
pub(super) struct RestGuide {
    nodes: Vec<f64>,
    arc: Vec<f64>,
    pose: Vec<Pose>,
    root: Vector3<f64>,
}

impl RestGuide {
    pub fn new(rod: &Rod) -> Self {
        let mut shape = Shape::default();
        shape.update(rod, &rod.root.r, &vec![0.0; rod.unknowns()]);
        RestGuide {
            nodes: rod.nodes.clone(),
            arc: rod.arc_lengths(),
            pose: shape.poses().collect(),
            root: rod.root.p,
        }
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

    /// The place of the rod at arc length `s`, m.
    pub fn place(&self, s: f64) -> Place {
        let i = self.arc.partition_point(|&a| a <= s).clamp(1, self.arc.len() - 1);
        let (from, to) = (self.arc[i - 1], self.arc[i]);
        Place { segment: i as u32 - 1, u: ((s - from) / (to - from)).clamp(0.0, 1.0) as f32 }
    }

    /// Material frame at arc length `s`, held past the tip.
    fn frame(&self, s: f64) -> Matrix3<f64> {
        let last = self.arc.len() - 1;
        let i = self.arc.partition_point(|&a| a <= s).clamp(1, last) - 1;
        let u = ((s - self.arc[i]) / (self.arc[i + 1] - self.arc[i])).clamp(0.0, 1.0);
        let (a, b) = (self.pose[i].r, self.pose[i + 1].r);
        a * se3::exp_so3(&(se3::log_so3(&(a.transpose() * b)) * u))
    }

    /// ∫ N_i ds over [a, b] for every node but the tip's, as far as the guide reaches: (first node, integrals).
    fn shares(&self, a: f64, b: f64) -> (usize, Vec<f64>) {
        let n = self.nodes.len() - 1;
        let mut first = None;
        let mut shares = Vec::new();
        for i in 0..n {
            let mut sum = 0.0;
            if i > 0 {
                sum += ramp(self.nodes[i - 1], self.nodes[i], a, b);
            }
            // The falling side is the rising one seen from the other end.
            sum += ramp(-self.nodes[i + 1], -self.nodes[i], -b, -a);
            if sum > 0.0 {
                first.get_or_insert(i);
                shares.push(sum);
            } else if first.is_some() {
                break;
            }
        }
        (first.unwrap_or(0), shares)
    }
}

/// ∫ (s − s0)/(s1 − s0) ds over the part of [a, b] in [s0, s1].
fn ramp(s0: f64, s1: f64, a: f64, b: f64) -> f64 {
    let (a, b) = (a.max(s0), b.min(s1));
    if b <= a { 0.0 } else { (b - a) * (0.5 * (a + b) - s0) / (s1 - s0) }
}

/// How one strand follows one guide. Entry `j` of `align` and `first` is for the turn into edge `j`.
#[derive(Debug, Clone)]
pub(super) struct Follow {
    /// Index of the guide.
    pub guide: usize,
    /// Turns the guide's material frame into the strand's, both at rest; times the weight.
    align: Vec<Matrix3<f64>>,
    /// First node, and where its integrals start in `share`.
    first: Vec<(u32, u32)>,
    /// Integrals of the hat functions, m.
    share: Vec<f64>,
}

impl Follow {
    /// `frames`, `turn` and `length` are the strand's edges at rest.
    pub fn new(
        guide: usize,
        weight: f64,
        rest: &RestGuide,
        frames: &[Matrix3<f64>],
        turn: &[Vector3<f64>],
        length: &[f64],
    ) -> Self {
        let mut follow = Follow { guide, align: Vec::new(), first: Vec::new(), share: Vec::new() };
        let (mut middle, mut vertex) = (0.0, 0.0);
        for j in 0..length.len() {
            let next = vertex + length[j] / 2.0;
            let (node, shares) = rest.shares(middle, next);
            follow.first.push((node as u32, follow.share.len() as u32));
            follow.share.extend(shares);
            // The strand's frame at the vertex, half way between the two edges'.
            let own = frames[j] * se3::exp_so3(&(turn[j] * -0.5));
            let its = rest.frame(vertex);
            follow.align.push(own.transpose() * its * weight);
            middle = next;
            vertex += length[j];
        }
        follow.first.push((0, follow.share.len() as u32));
        follow
    }

    /// Weighted turn added into edge `j`, in the strand's frame, of the guide's deviation `q`, 1/m; its rate, of the rate of `q`.
    pub fn turn(&self, j: usize, q: &[f64]) -> Vector3<f64> {
        let (node, start) = self.first[j];
        let shares = &self.share[start as usize..self.first[j + 1].1 as usize];
        let mut sum = Vector3::zeros();
        for (n, a) in q[3 * node as usize..].chunks_exact(3).zip(shares) {
            sum += Vector3::new(n[0], n[1], n[2]) * *a;
        }
        self.align[j] * sum
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rod::{Cut, RodSource};

    #[test]
    fn a_place_moves_with_the_arc_length_also_between_points() {
        let points: Vec<_> =
            (0..50).map(|i| f64::from(i) * 0.05).map(|t| Vector3::new(t.cos(), t.sin(), t) * 0.05).collect();
        let rod = Rod::new(&RodSource {
            points: &points,
            root_frame: None,
            arc: &[0.0, 0.5, 1.0],
            stiffness: [1e-9; 3],
            line_density: 1e-5,
            damping: 0.0,
            natural: None,
            cut: Cut::FINE,
        })
        .unwrap();
        let guide = RestGuide::new(&rod);
        let at = |i: usize| guide.at(guide.place(guide.length() * i as f64 / 400.0));
        for i in 0..400 {
            let moved = (at(i + 1) - at(i)).norm() / (guide.length() / 400.0);
            assert!((0.97..1.0 + 1e-6).contains(&moved), "{i}: {moved}");
        }
        assert_eq!(guide.at(guide.place(2.0 * guide.length())), at(400));
    }
}
