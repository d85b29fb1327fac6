//! Approximate derivatives of a rod's shape, and the matrices of its linear model.

use super::model::Rod;
use super::shape::RodShape;
use nalgebra::{Matrix3, Vector3};
use std::cmp::Ordering;

/// Derivatives of a rod's shape by its unknowns if the bend of each node acted upstream of that node: cheaper
/// than [`Sensitivity`](super::Sensitivity), to first order in the spacing of the nodes.
#[derive(Debug, Clone)]
pub struct LumpedSensitivity {
    nodes: Vec<Node>,
    /// One entry per node that has unknowns.
    twists: Vec<NodeTwist>,
}

#[derive(Debug, Clone, Copy)]
struct Node {
    /// Position relative to the root, m.
    x: Vector3<f64>,
    /// Index of the point at the node.
    point: usize,
}

/// Twist about the root of everything beyond a node, per unknown of the node (columns).
#[derive(Debug, Clone, Copy)]
struct NodeTwist {
    /// Rotation ∫ N R ds, m.
    rotation: Matrix3<f64>,
    /// Translation at the root ∫ N x × R ds, m².
    translation: Matrix3<f64>,
}

impl LumpedSensitivity {
    /// The derivatives of `rod` at `shape`.
    pub fn new(rod: &Rod, shape: &RodShape) -> Self {
        let nodes = (0..rod.nodes.len())
            .map(|node| rod.node_point(node))
            .map(|point| Node { x: shape.x(point), point })
            .collect();
        let mut twists = vec![[Matrix3::zeros(); 2]; rod.nodes.len()];
        let mut start = [Matrix3::zeros(); 2];
        for (k, pose) in shape.poses().enumerate() {
            let carried = Matrix3::from_columns(&[0, 1, 2].map(|axis| pose.p.cross(&pose.r.column(axis))));
            let end = [pose.r, carried];
            // Trapezoidal rule on each segment, with the hat functions' mean over it.
            if let Some(segment) = k.checked_sub(1).map(|k| &rod.core.segments[k]) {
                let first = 0.5 * (segment.hat[0] + segment.hat[1]);
                for (side, hat) in [first, 1.0 - first].into_iter().enumerate() {
                    let twist = &mut twists[segment.element + side];
                    (0..2).for_each(|i| twist[i] += (start[i] + end[i]) * (0.5 * segment.h * hat));
                }
            }
            start = end;
        }
        twists.truncate(rod.unknowns() / 3);
        let twists = twists.into_iter().map(|[rotation, translation]| NodeTwist { rotation, translation });
        LumpedSensitivity { nodes, twists: twists.collect() }
    }

    /// Position of node `node` relative to the root, m.
    pub fn node(&self, node: usize) -> Vector3<f64> {
        self.nodes[node].x
    }

    /// Jacobian row dᵀ ∂x/∂q, m² per unknown, of a place at `x` (relative to the root, m) along the world
    /// direction `d`. The place lies at point `end` or on the segment before it.
    pub fn row(&self, end: usize, x: &Vector3<f64>, d: &Vector3<f64>) -> Vec<f64> {
        let mut row = vec![0.0; 3 * self.twists.len()];
        self.set_row(end, x, d, &mut row);
        row
    }

    /// Sets `row` to [`LumpedSensitivity::row`].
    pub fn set_row(&self, end: usize, x: &Vector3<f64>, d: &Vector3<f64>, row: &mut [f64]) {
        row.fill(0.0);
        let about = x.cross(d);
        let upstream = self.nodes.iter().zip(&self.twists).take_while(|(node, _)| node.point < end);
        for (row, (_, twist)) in row.chunks_exact_mut(3).zip(upstream) {
            row.copy_from_slice((twist.rotation.tr_mul(&about) + twist.translation.tr_mul(d)).as_slice());
        }
    }

    /// Σ w (∂x/∂q)ᵀ ∂x/∂q over the nodes with weights w = `weight(node)`, row-major n × n: the mass matrix if
    /// the weights are lumped masses, the damping matrix if they are drag coefficients.
    pub fn mass_matrix(&self, weight: impl Fn(usize) -> f64) -> Vec<f64> {
        let n = 3 * self.twists.len();
        let mut sum = vec![0.0; n * n];
        for (node, Node { x, point }) in self.nodes.iter().enumerate().skip(1) {
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

    /// Geometric stiffness: second derivative of −Σ f·x over the nodes with constant forces f =
    /// `force(node)`, N; row-major n × n, N·m³. Positive for a rod in tension, negative under compression.
    pub fn geometric_stiffness(&self, force: impl Fn(usize) -> Vector3<f64>) -> Vec<f64> {
        let n = 3 * self.twists.len();
        let rotation = |a: usize| Vector3::from(self.twists[a / 3].rotation.column(a % 3));
        // For each unknown, Σ (displacement of the node per unknown) × force.
        let mut torque = vec![Vector3::zeros(); n];
        for (node, Node { x, .. }) in self.nodes.iter().enumerate().skip(1) {
            let force = force(node);
            for (a, torque) in torque.iter_mut().enumerate().take(3 * node) {
                let displacement = rotation(a).cross(x) + self.twists[a / 3].translation.column(a % 3);
                *torque += displacement.cross(&force);
            }
        }
        // An upstream unknown rotates the displacements of a downstream one. The order within a node is
        // symmetrised.
        let upstream = |a: usize, b: usize| -rotation(a).dot(&torque[b]);
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
    use crate::rod::model::RodSource;

    /// A thin rod through `points` with nodes at the arc-length fractions `arc`.
    fn through(points: &[Vector3<f64>], arc: &[f64]) -> Rod {
        Rod::new(&RodSource { stiffness: [1e-9; 3], line_density: 6e-6, ..RodSource::hair(points, arc) })
            .unwrap()
    }

    #[test]
    fn rows_match_differences_at_the_tip_of_a_curl() {
        // A turn and a half; the nodes are a third of a turn apart.
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
    fn geometric_stiffness_of_weight_matches_differences_of_its_forces() {
        let points: Vec<_> =
            (0..30).map(|k| 0.01 * f64::from(k)).map(|s| Vector3::new(s, 3.0 * s * s, -0.2 * s)).collect();
        let rod = through(&points, &[0.0, 0.125, 0.25, 0.375, 0.5, 0.625, 0.75, 0.875, 1.0]);
        let mut q = rod.initial_q.clone();
        let mut shape = RodShape::default();
        let weight = |node: usize| Vector3::new(1.0, -9.81, 2.0) * rod.lumped_mass(node);
        // Generalised force of the weights.
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
