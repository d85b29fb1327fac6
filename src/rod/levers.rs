//! How a rod moves with its unknowns, about: enough to choose by, and for what is looked at again after each move.

use super::{Rod, RodShape};
use nalgebra::{Matrix3, Vector3};
use std::cmp::Ordering;

/// How places of a rod move with its unknowns, as if all that a node bends were upstream of what is beyond that node.
#[derive(Debug, Clone)]
pub struct LumpedSensitivity {
    /// At each node: where it is, m, relative to the root, and at which point of the rod.
    nodes: Vec<(Vector3<f64>, usize)>,
    /// Of each node that has unknowns the turn, m, and the way at the root, m², that each of them gives to what is beyond: ∫ N R ds and ∫ N x × R ds, N
    /// being the node's share of the strain.
    twists: Vec<[Matrix3<f64>; 2]>,
}

impl LumpedSensitivity {
    /// Of `rod` in `shape`.
    pub fn new(rod: &Rod, shape: &RodShape) -> Self {
        let nodes =
            (0..rod.nodes.len()).map(|node| rod.node_point(node)).map(|point| (shape.x(point), point));
        let mut twists = vec![[Matrix3::zeros(); 2]; rod.nodes.len()];
        let mut start = [Matrix3::zeros(); 2];
        for (k, pose) in shape.poses().enumerate() {
            let carried = Matrix3::from_columns(&[0, 1, 2].map(|axis| pose.p.cross(&pose.r.column(axis))));
            let end = [pose.r, carried];
            // By the trapezoidal rule on each sub-step.
            if let Some((h, element, [left, right])) = k.checked_sub(1).map(|k| rod.segment(k)) {
                for (side, share) in [left, right].into_iter().enumerate() {
                    let twist = &mut twists[element + side];
                    (0..2).for_each(|i| twist[i] += (start[i] + end[i]) * (0.5 * h * share));
                }
            }
            start = end;
        }
        twists.pop();
        LumpedSensitivity { nodes: nodes.collect(), twists }
    }

    /// Where node `node` is, m, relative to the root.
    pub fn node(&self, node: usize) -> Vector3<f64> {
        self.nodes[node].0
    }

    /// The way along `d` of a place at `x`, m, relative to the root, with each unknown, m²; the place lies upstream of point `end`, or is that point.
    pub fn row(&self, end: usize, x: &Vector3<f64>, d: &Vector3<f64>) -> Vec<f64> {
        let mut row = vec![0.0; 3 * self.twists.len()];
        self.set_row(end, x, d, &mut row);
        row
    }

    /// Sets `row` to [`LumpedSensitivity::row`].
    pub fn set_row(&self, end: usize, x: &Vector3<f64>, d: &Vector3<f64>, row: &mut [f64]) {
        row.fill(0.0);
        let about = x.cross(d);
        let upstream = self.nodes.iter().zip(&self.twists).take_while(|((_, point), _)| *point < end);
        for (row, (_, [turn, way])) in row.chunks_exact_mut(3).zip(upstream) {
            row.copy_from_slice((turn.tr_mul(&about) + way.tr_mul(d)).as_slice());
        }
    }

    /// Σ w (∂x/∂q)ᵀ ∂x/∂q over the nodes, w being what `weight` says of each; row-major.
    pub fn mass_matrix(&self, weight: impl Fn(usize) -> f64) -> Vec<f64> {
        let n = 3 * self.twists.len();
        let mut sum = vec![0.0; n * n];
        for (node, (x, point)) in self.nodes.iter().enumerate().skip(1) {
            for axis in [Vector3::x(), Vector3::y(), Vector3::z()] {
                let row = self.row(*point, x, &axis);
                for (sums, a) in sum.chunks_exact_mut(n).zip(&row) {
                    let a = a * weight(node);
                    sums.iter_mut().zip(&row).for_each(|(sum, b)| *sum += a * b);
                }
            }
        }
        sum
    }

    /// Second derivative of −Σ f·x over the nodes, where `force` tells the constant force f, N, at each: how hair that is loaded so resists being turned, or
    /// gives way; row-major, N·m³.
    pub fn geometric_stiffness(&self, force: impl Fn(usize) -> Vector3<f64>) -> Vec<f64> {
        let n = 3 * self.twists.len();
        let turn = |a: usize| Vector3::from(self.twists[a / 3][0].column(a % 3));
        // Of each unknown, the torque of the loads at the ways that it gives them.
        let mut torque = vec![Vector3::zeros(); n];
        for (node, (x, _)) in self.nodes.iter().enumerate().skip(1) {
            let force = force(node);
            for (a, torque) in torque.iter_mut().enumerate().take(3 * node) {
                let way = turn(a).cross(x) + self.twists[a / 3][1].column(a % 3);
                *torque += way.cross(&force);
            }
        }
        // What is upstream turns the way that what is downstream gives; nodes are taken as turning at once with themselves.
        let upstream = |a: usize, b: usize| -turn(a).dot(&torque[b]);
        let entry = |a: usize, b: usize| match (a / 3).cmp(&(b / 3)) {
            Ordering::Less => upstream(a, b),
            Ordering::Equal => 0.5 * (upstream(a, b) + upstream(b, a)),
            Ordering::Greater => upstream(b, a),
        };
        (0..n * n).map(|at| entry(at / n, at % n)).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rod::{RodSource, SegmentSize, Taper};

    /// A thin rod through these points with its nodes at these shares of the arc.
    fn through(points: &[Vector3<f64>], arc: &[f64]) -> Rod {
        Rod::new(&RodSource {
            points,
            root_frame: None,
            arc,
            stiffness: [1e-9; 3],
            line_density: 6e-6,
            damping: 0.0,
            taper: Taper::NONE,
            natural_strain: None,
            segment_size: SegmentSize::FINE,
        })
        .unwrap()
    }

    #[test]
    fn rows_are_how_the_tip_of_a_curl_moves() {
        // A turn and a half, nodes a third of a turn apart.
        let curl = |t: f64| Vector3::new(0.033 * t, 0.02 * t.cos(), 0.02 * t.sin());
        let points: Vec<_> = (0..90).map(|k| curl(0.1 * f64::from(k))).collect();
        let rod = through(&points, &[0.0, 0.2, 0.5, 0.7, 1.0]);
        let mut q: Vec<f64> = (0..rod.unknowns()).map(|i| 2.0 * (i as f64).sin()).collect();
        let mut shape = RodShape::default();
        let mut tip = |q: &[f64]| {
            shape.update(&rod, &rod.root.r, q);
            (shape.x(rod.points() - 1), LumpedSensitivity::new(&rod, &shape))
        };
        let (x, levers) = tip(&q);
        let d = Vector3::new(0.6, -0.48, 0.64);
        let row = levers.row(rod.points() - 1, &x, &d);
        let size = row.iter().map(|r| r * r).sum::<f64>().sqrt();
        for i in 0..q.len() {
            q[i] += 1e-4;
            let found = d.dot(&(tip(&q).0 - x)) / 1e-4;
            q[i] -= 1e-4;
            assert!((found - row[i]).abs() < 0.01 * size, "{i}: {found} {} {size}", row[i]);
        }
    }

    #[test]
    fn stiffness_under_weight_is_how_the_forces_of_weight_change() {
        let points: Vec<_> =
            (0..30).map(|k| 0.01 * f64::from(k)).map(|s| Vector3::new(s, 3.0 * s * s, -0.2 * s)).collect();
        let rod = through(&points, &[0.0, 0.125, 0.25, 0.375, 0.5, 0.625, 0.75, 0.875, 1.0]);
        let mut q = rod.initial_q.clone();
        let mut shape = RodShape::default();
        let weight = |node: usize| Vector3::new(1.0, -9.81, 2.0) * rod.lumped_mass(node);
        // What the weights do along each unknown.
        let mut forces = |q: &[f64]| -> Vec<f64> {
            shape.update(&rod, &rod.root.r, q);
            let levers = LumpedSensitivity::new(&rod, &shape);
            let mut sum = vec![0.0; q.len()];
            for node in 1..rod.nodes.len() {
                let row = levers.row(rod.node_point(node), &levers.node(node), &weight(node));
                sum.iter_mut().zip(row).for_each(|(sum, row)| *sum += row);
            }
            sum
        };
        let mut found = vec![0.0; q.len() * q.len()];
        for a in 0..q.len() {
            let [more, less] = [1e-4, -2e-4].map(|step| {
                q[a] += step;
                forces(&q)
            });
            q[a] += 1e-4;
            let n = q.len();
            (0..n).for_each(|b| found[b * n + a] = (less[b] - more[b]) / 2e-4);
        }
        shape.update(&rod, &rod.root.r, &q);
        let stiffness = LumpedSensitivity::new(&rod, &shape).geometric_stiffness(weight);
        let size = |a: &[f64]| a.iter().map(|a| a * a).sum::<f64>().sqrt();
        let off: Vec<f64> = stiffness.iter().zip(&found).map(|(a, b)| a - b).collect();
        assert!(size(&off) < 0.1 * size(&found), "{} of {}", size(&off), size(&found));
    }
}
