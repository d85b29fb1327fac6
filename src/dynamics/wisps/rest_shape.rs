//! The shapes of guides at rest, and the deflections from them.

use crate::dynamics::guide::GuideState;
use crate::math::cholesky;
use crate::rod::{LumpedSensitivity, Rod, RodShape};
use crate::scene::anim::GRAVITY;
use crate::wisp::{Deflection, LinearKinematics};
use nalgebra::{Matrix3, Vector3};
use serde::{Deserialize, Serialize};
use std::sync::OnceLock;

/// A guide at rest.
#[derive(Debug, Clone, Default)]
pub(super) struct RestShape {
    pub state: RestState,
    /// Frames of the strain nodes with unknowns, rest space.
    frames: Vec<Matrix3<f64>>,
    pub kinematics: LinearKinematics,
    /// See [`RestShape::metric`].
    metric: OnceLock<Vec<f64>>,
}

/// What determines a [`RestShape`]; held by checkpoints.
#[derive(Debug, Clone, Default, Serialize, Deserialize)]
pub(super) struct RestState {
    /// Unknowns, 1/m.
    pub q: Vec<f64>,
    /// Distance that each point keeps from each body as a follower, m, as in
    /// [`GuideState::required_distances`].
    pub required_distances: Vec<f64>,
}

impl RestShape {
    /// The rest shape of `rod`.
    pub fn new(rod: &Rod, state: RestState) -> Self {
        let mut shape = RodShape::default();
        shape.update(rod, &rod.root.r, &state.q);
        let poses: Vec<_> = shape.poses().collect();
        let nodes: Vec<_> = (0..rod.nodes.len()).map(|node| poses[rod.node_point(node)]).collect();
        let positions: Vec<_> = nodes.iter().map(|node| node.p).collect();
        RestShape {
            frames: nodes[..nodes.len() - 1].iter().map(|node| node.r).collect(),
            kinematics: LinearKinematics::new(&positions, &rod.nodes),
            state,
            metric: OnceLock::new(),
        }
    }

    /// The metric of changes of the unknowns: L of L Lᵀ = K + ∫ ρS ω² (∂x/∂q)ᵀ ∂x/∂q ds, ω² = g/length, at
    /// the rest shape. The least change in this metric moves an elastic, hanging hair least. Computed on
    /// first use.
    pub fn metric(&self, rod: &Rod) -> &[f64] {
        self.metric.get_or_init(|| {
            let mut shape = RodShape::default();
            shape.update(rod, &rod.root.r, &self.state.q);
            let mut metric = LumpedSensitivity::new(rod, &shape)
                .mass_matrix(|node| rod.lumped_mass(node) * GRAVITY / rod.length());
            metric.iter_mut().zip(rod.elastic_matrix()).for_each(|(m, k)| *m += k);
            // Positive definite because K is.
            cholesky::factor(&mut metric, rod.unknowns());
            metric
        })
    }

    /// Sets `deflection` to that of the guide of `rod` in `state`.
    pub fn deflection(&self, rod: &Rod, state: &GuideState, deflection: &mut Deflection) {
        let strain = state.q.iter().flat_map(|q| {
            let at_rest = self.state.q.chunks_exact(3).zip(&self.frames);
            q.chunks_exact(3).zip(at_rest).map(|(q, (rest, frame))| {
                let deviation = Vector3::from_column_slice(q) - Vector3::from_column_slice(rest);
                frame * deviation * rod.length()
            })
        });
        deflection.set(strain, &self.kinematics);
    }

    /// Sets `q` to the unknowns, 1/m, of normalised strain `strain`.
    pub fn unknowns(&self, rod: &Rod, strain: &[f64], q: &mut Vec<f64>) {
        q.clone_from(&self.state.q);
        let strains = strain.chunks_exact(3).map(Vector3::from_column_slice);
        for ((q, strain), frame) in q.chunks_exact_mut(3).zip(strains).zip(&self.frames) {
            let deviation = frame.tr_mul(&strain) / rod.length();
            q.iter_mut().zip(&deviation).for_each(|(q, more)| *q += more);
        }
    }
}
