//! How far a guide goes as it turns.

use nalgebra::Vector3;

/// A guide at rest as far as it matters for where it goes as it turns, to first order.
#[derive(Debug, Clone, Default)]
pub struct LinearKinematics {
    /// From each node to the next: the way in rest space, and the share of the arc; both over the length.
    edges: Vec<(Vector3<f64>, f64)>,
}

impl LinearKinematics {
    /// Of the places of its `nodes`, m, rest space, at arc lengths `arc`, m.
    pub fn new(nodes: &[Vector3<f64>], arc: &[f64]) -> Self {
        let length = arc[arc.len() - 1];
        let edge = |(x, s): (&[Vector3<f64>], &[f64])| ((x[1] - x[0]) / length, (s[1] - s[0]) / length);
        LinearKinematics { edges: nodes.windows(2).zip(arc.windows(2)).map(edge).collect() }
    }

    /// Ways of its nodes but the root as shares of its length, and the share of the arc before each, where it turns by `turn` more per share of its length
    /// at each node, rad.
    pub fn displacements(
        &self,
        turn: impl Iterator<Item = Vector3<f64>>,
    ) -> impl Iterator<Item = (Vector3<f64>, f64)> {
        let (mut angle, mut x) = (Vector3::zeros(), Vector3::zeros());
        self.edges.iter().zip(turn).map(move |((edge, span), turn)| {
            angle += turn * *span;
            x += angle.cross(edge);
            (x, *span)
        })
    }

    /// The mean of them along it.
    pub fn mean_displacement(&self, turn: impl Iterator<Item = Vector3<f64>>) -> f64 {
        self.displacements(turn).map(|(x, span)| x.norm() * span).sum()
    }
}
