//! Displacements of a guide to first order in its strain.

use nalgebra::Vector3;

/// First-order map from the normalised strain of a guide to the displacements of its nodes. The normalised
/// strain of a node is the deviation of its strain from rest in rest-space axes, times the length of the
/// guide: rotation per arc-length fraction, rad.
#[derive(Debug, Clone, Default)]
pub struct LinearKinematics {
    /// For every element: the vector between its nodes at rest over the length of the guide, and its
    /// arc-length fraction.
    edges: Vec<(Vector3<f64>, f64)>,
}

impl LinearKinematics {
    /// Of a guide with `nodes` at rest, m, rest space, at arc lengths `arc`, m.
    pub fn new(nodes: &[Vector3<f64>], arc: &[f64]) -> Self {
        let length = arc[arc.len() - 1];
        let edge = |(x, s): (&[Vector3<f64>], &[f64])| ((x[1] - x[0]) / length, (s[1] - s[0]) / length);
        LinearKinematics { edges: nodes.windows(2).zip(arc.windows(2)).map(edge).collect() }
    }

    /// Displacements of all nodes but the root over the length of the guide, each with the arc-length
    /// fraction of the element before the node. `strain` is the normalised strain of all nodes but the tip.
    pub fn displacements(
        &self,
        strain: impl Iterator<Item = Vector3<f64>>,
    ) -> impl Iterator<Item = (Vector3<f64>, f64)> {
        let (mut angle, mut x) = (Vector3::zeros(), Vector3::zeros());
        self.edges.iter().zip(strain).map(move |((edge, span), strain)| {
            angle += strain * *span;
            x += angle.cross(edge);
            (x, *span)
        })
    }

    /// Mean length of the displacements along the guide, over its length.
    pub fn mean_displacement(&self, strain: impl Iterator<Item = Vector3<f64>>) -> f64 {
        self.displacements(strain).map(|(x, span)| x.norm() * span).sum()
    }
}
