//! A render strand as a chain of rigid edges at rest.

use super::curl::{HalfPhase, IN_PHASE};
use super::guide_place::GuidePlace;
use super::moving_rotation::MovingRotation;
use super::posed_guide::PosedGuides;
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
    /// Index of the strand.
    pub strand: usize,
    /// Position of the root, m, rest space.
    pub root: Vector3<f64>,
    /// Index of the guide of largest weight. It stands for all of them with respect to bodies.
    pub main: usize,
    /// Pairs of that guide and each other one that it follows, and the weights of these.
    pub others: Vec<(usize, f64)>,
    pub edges: Vec<Edge>,
    /// Half phase of each edge relative to the curl of the main guide; empty if none has any.
    pub half_phases: Vec<HalfPhase>,
}

/// An edge of a strand at rest, and the vertex at its end.
#[derive(Debug, Clone)]
pub(super) struct Edge {
    /// From its start to its end, m, rest space, turned back by its phase. Single precision, like the output:
    /// reading edges dominates the cost.
    vector: Vector3<f32>,
    /// The place on the main guide at the arc length of its midpoint.
    midpoint: GuidePlace,
    /// The place on the main guide that corresponds to its end.
    pub beside: GuidePlace,
    /// Whether a body separates that place from the end at rest.
    pub separated: bool,
}

impl Edge {
    pub fn new(vector: Vector3<f64>, midpoint: GuidePlace, beside: GuidePlace, separated: bool) -> Self {
        Edge { vector: vector.cast(), midpoint, beside, separated }
    }

    /// From its start to its end, m, rest space, turned back by its phase.
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
    /// Rotation of the main guide beside edge `j`, and the sum φ of the differences of the other guides, rad,
    /// with its rate, rad/s (`docs/theory.md` eq. 7.1).
    #[inline(always)]
    pub fn rotation(&self, j: usize, guides: &PosedGuides) -> (MovingRotation<f64>, [f64; 6]) {
        let midpoint = self.edges[j].midpoint;
        let mut sum = [0.0; 6];
        for (pair, weight) in &self.others {
            let (from, to, u) = midpoint.ends(&guides.differences[*pair]);
            for (i, sum) in sum.iter_mut().enumerate() {
                *sum += weight * (from[i] + (to[i] - from[i]) * u);
            }
        }
        (guides.guides[self.main].rotation(midpoint), sum)
    }

    /// The axis of the main guide beside edge `j` and its rate, 1/s, as one array; and the half phase
    /// of the edge.
    #[inline(always)]
    pub fn phase(&self, j: usize, guides: &PosedGuides) -> ([f64; 6], HalfPhase) {
        let axis = guides.guides[self.main].axis(self.edges[j].midpoint);
        (axis, self.half_phases.get(j).copied().unwrap_or(IN_PHASE))
    }
}
