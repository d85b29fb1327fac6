//! Segments of a rod's curve: the pieces over which the strain is integrated by one Magnus step each.

use super::joint::RootJoint;
use crate::math::lanes::{Real, Twist, V3};

/// Gauss points of a segment, as fractions of its length: ½ ∓ √3/6.
pub(super) const GAUSS: [f64; 2] = [0.211_324_865_405_187_13, 0.788_675_134_594_812_9];

/// Upper bounds on the segments into which each element (between two strain nodes) is divided. An element has
/// at least two segments.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SegmentSize {
    /// Length of a segment, m.
    pub max_length: f64,
    /// Rotation of the natural shape over a segment, rad. The Magnus series converges below π.
    pub max_turn: f64,
}

impl SegmentSize {
    /// For rods without contact: the error of the segments is far below the error of the strain nodes.
    pub const COARSE: SegmentSize = SegmentSize { max_length: f64::INFINITY, max_turn: 0.8 };

    /// For contact and output: the polyline through the points is within 0.1 mm of the curve on a head (10 cm
    /// radius of curvature) and within a fiftieth of the radius on a curl.
    pub const FINE: SegmentSize = SegmentSize { max_length: 0.01, max_turn: 0.4 };
}

/// One Magnus step of the natural shape.
#[derive(Debug, Clone, Copy)]
pub(super) struct Segment<F> {
    /// Index of the element that contains it: between nodes `element` and `element + 1`, counted with the
    /// [joint](RootJoint::blocks) of the root as the first.
    pub element: usize,
    /// Length h, m.
    pub h: F,
    /// Exponent ψ̄ of the natural shape, taken from the drawn curve: at q = 0 the shape is reproduced to
    /// rounding.
    pub natural: Twist<F>,
    /// Natural strain Ω̄ at the two Gauss points, 1/m.
    pub strain: [V3<F>; 2],
    /// Hat function of the element's first node at the two Gauss points; that of the second node is one minus
    /// this.
    pub hat: [F; 2],
}

/// The part of a rod that the kernels of the implicit step read: of one rod (`F` = f64) or of one rod per
/// lane.
#[derive(Debug, Clone)]
pub(super) struct RodCore<F> {
    /// Segments, root first.
    pub segments: Vec<Segment<F>>,
    /// ∫ N_i N_i σ ds and ∫ N_i N_{i+1} σ ds for every node i with unknowns, m; σ is the stiffness relative to
    /// the root.
    pub hat: Vec<[F; 2]>,
    /// (E I1, E I2, G J) at the root, N·m².
    pub stiffness: [F; 3],
    /// Generalised force of the offset of the natural strain, N·m²; see
    /// [`set_natural_offset`](super::Rod::set_natural_offset).
    pub prebend: Vec<F>,
    /// Length L, m.
    pub length: F,
    /// Length of the longest segment, m.
    pub longest: F,
    /// Mass, kg.
    pub mass: F,
    /// How the root is held: its joint has the first unknowns.
    pub joint: RootJoint,
}

impl<F: Real> RodCore<F> {
    /// Number of unknowns.
    #[inline(always)]
    pub fn unknowns(&self) -> usize {
        3 * self.hat.len()
    }

    /// Index of the first point that is not held: loads have one spring for each from there on.
    #[inline(always)]
    pub fn first_moving(&self) -> usize {
        usize::from(self.joint != RootJoint::Free)
    }

    /// Number of points.
    #[inline(always)]
    pub fn points(&self) -> usize {
        self.segments.len() + 1
    }

    /// y += a ∫ N_i K N_j ds x for the integrals `hat` of N_i N_j, laid out as [`RodCore::hat`].
    #[inline(always)]
    pub fn add_elastic(&self, hat: &[[F; 2]], a: F, x: &[F], y: &mut [F]) {
        let n = hat.len();
        for i in 0..n {
            for c in 0..3 {
                let mut s = hat[i][0] * x[3 * i + c];
                if i > 0 {
                    s += hat[i - 1][1] * x[3 * (i - 1) + c];
                }
                if i + 1 < n {
                    s += hat[i][1] * x[3 * (i + 1) + c];
                }
                y[3 * i + c] += a * self.stiffness[c] * s;
            }
        }
    }
}
