//! A render strand as a chain of rigid edges at rest.

use super::guide_weights::{GuideWeights, MAX_GUIDES};
use super::posed_guide::PosedGuide;
use super::rest_guide::GuidePlace;
use nalgebra::Vector3;

/// A point and its velocity, world, m and m/s.
#[derive(Debug, Clone, Copy)]
pub(super) struct Vertex {
    pub x: Vector3<f64>,
    pub v: Vector3<f64>,
}

/// A strand at rest.
#[derive(Debug, Clone)]
pub(super) struct RestChain {
    /// Position of the root, m, rest space.
    pub root: Vector3<f64>,
    /// The guides that it follows. The first, of largest weight, stands for all of them with respect to
    /// bodies.
    pub guides: GuideWeights,
    pub edges: Vec<Edge>,
}

/// An edge of a strand at rest, and the vertex at its end.
#[derive(Debug, Clone)]
pub(super) struct Edge {
    /// From its start to its end, m, rest space. Single precision, like the output: reading edges dominates
    /// the cost.
    vector: Vector3<f32>,
    /// For each guide, the place at the arc length of its midpoint.
    midpoint: [GuidePlace; MAX_GUIDES],
    /// The place on the first guide that corresponds to its end.
    pub beside: GuidePlace,
    /// Whether a body separates that place from the end at rest.
    pub separated: bool,
}

impl Edge {
    pub fn new(
        vector: Vector3<f64>,
        midpoint: [GuidePlace; MAX_GUIDES],
        beside: GuidePlace,
        separated: bool,
    ) -> Self {
        Edge { vector: vector.cast(), midpoint, beside, separated }
    }

    /// From its start to its end, m, rest space.
    #[inline(always)]
    pub fn vector(&self) -> Vector3<f64> {
        self.vector.cast()
    }

    /// Length, m.
    pub fn length(&self) -> f64 {
        self.vector().norm()
    }
}

impl RestChain {
    /// Index of the guide of largest weight.
    pub fn main_guide(&self) -> usize {
        self.guides[0].0
    }

    /// Blended integral of the guides' deviations up to the midpoint of edge `j`, rad, rest space, and its
    /// rate, rad/s (`docs/theory.md` eq. 7.1).
    #[inline(always)]
    pub fn integral(&self, j: usize, guides: &[PosedGuide]) -> [f64; 6] {
        let mut sum = [0.0; 6];
        for ((guide, weight), midpoint) in self.guides.iter().zip(self.edges[j].midpoint) {
            let part = midpoint.integral(&guides[*guide].integrals);
            sum.iter_mut().zip(part).for_each(|(sum, part)| *sum += part * weight);
        }
        sum
    }
}
