//! How guides rest, and how they are turned out of that.

use super::{keep_out, vectors};
use crate::dynamics::guide::GuideState;
use crate::rod::{Rod, RodShape};
use crate::wisp::{Deflection, LinearKinematics};
use nalgebra::{Matrix3, Vector3};
use serde::{Deserialize, Serialize};
use std::sync::OnceLock;

/// A guide at rest.
#[derive(Debug, Clone, Default)]
pub(super) struct Rest {
    pub settled: Settled,
    /// Frames of the nodes that have unknowns, rest space.
    pub frame: Vec<Matrix3<f64>>,
    pub reach: LinearKinematics,
    /// See [`Rest::metric`].
    metric: OnceLock<Vec<f64>>,
}

/// What a guide at rest is known by.
#[derive(Debug, Clone, Default, Serialize, Deserialize)]
pub(super) struct Settled {
    /// Unknowns, 1/m.
    pub q: Vec<f64>,
    /// Distance that each place keeps from each body when it follows, m, as in [`GuideState::required_distances`].
    pub kept: Vec<f64>,
}

impl Rest {
    pub fn new(rod: &Rod, settled: Settled) -> Self {
        let mut shape = RodShape::default();
        shape.update(rod, &rod.root.r, &settled.q);
        let poses: Vec<_> = shape.poses().collect();
        let nodes: Vec<_> = (0..rod.nodes.len()).map(|node| poses[rod.node_point(node)]).collect();
        let places: Vec<_> = nodes.iter().map(|node| node.p).collect();
        Rest {
            frame: nodes[..nodes.len() - 1].iter().map(|node| node.r).collect(),
            reach: LinearKinematics::new(&places, &rod.nodes),
            settled,
            metric: OnceLock::new(),
        }
    }

    /// How changes of its unknowns are measured, as [`keep_out::softness`] of its shape at rest; known once it is asked for.
    pub fn metric(&self, rod: &Rod) -> &[f64] {
        self.metric.get_or_init(|| {
            let mut shape = RodShape::default();
            shape.update(rod, &rod.root.r, &self.settled.q);
            keep_out::softness(rod, &shape)
        })
    }

    /// Sets `deflection` to that of a guide of `rod`.
    pub fn deflection(&self, rod: &Rod, state: &GuideState, deflection: &mut Deflection) {
        let strain = state.q.iter().flat_map(|q| {
            let at_rest = self.settled.q.chunks_exact(3).zip(&self.frame);
            q.chunks_exact(3).zip(at_rest).map(|(q, (rest, frame))| {
                let deviation = Vector3::from_column_slice(q) - Vector3::from_column_slice(rest);
                frame * deviation * rod.length()
            })
        });
        deflection.set(strain, &self.reach);
    }

    /// Sets `q` to the unknowns, 1/m, of a guide with the normalised strain `strain`.
    pub fn unknowns(&self, rod: &Rod, strain: &[f64], q: &mut Vec<f64>) {
        q.clone_from(&self.settled.q);
        for ((q, strain), frame) in q.chunks_exact_mut(3).zip(vectors(strain)).zip(&self.frame) {
            let deviation = frame.tr_mul(&strain) / rod.length();
            q.iter_mut().zip(&deviation).for_each(|(q, more)| *q += more);
        }
    }
}
