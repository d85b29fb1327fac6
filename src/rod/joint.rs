//! The joint between a root and what carries it (`docs/theory.md` §3.6): the rotation of the root's frame, free about
//! all axes, of a pinned root, and its displacement as well of a free one.

use crate::math::lanes::{M3, Real, Twist, V3};
use crate::math::se3::Coefficients;

/// How a root is held.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum RootJoint {
    /// Position and frame are those of what carries it.
    Clamped,
    /// The position is; the frame turns freely.
    Pinned,
    /// Nothing holds it.
    Free,
}

impl RootJoint {
    /// Number of its unknowns, over three: the rotation vector, then the displacement.
    #[inline(always)]
    pub(super) fn blocks(self) -> usize {
        match self {
            RootJoint::Clamped => 0,
            RootJoint::Pinned => 1,
            RootJoint::Free => 2,
        }
    }
}

/// The unknowns of a root that turns: the rotation vector θ of its frame, rad, in the axes of the root that carries
/// it, like those of a node without length. Those of a free one are followed by its displacement, m, in the same axes.
#[derive(Debug, Clone, Copy)]
pub(super) struct Joint<F> {
    theta: V3<F>,
    /// sin θ/θ, (1 − cos θ)/θ² and (θ − sin θ)/θ³.
    coefficients: [F; 3],
    /// Twice the derivatives of these by θ².
    slopes: [F; 3],
}

impl<F: Real> Joint<F> {
    /// The joint with the first of the unknowns `q`, below a full turn.
    #[inline(always)]
    pub fn new(q: &[F]) -> Self {
        let theta = V3([q[0], q[1], q[2]]);
        let t = theta.dot(theta);
        let one = t.same(1.0);
        // The series is that of up to half a turn.
        let half = Coefficients::of(&Twist { w: theta * t.same(0.5), v: theta });
        let cosine = -(half.b * t * 0.25) + 1.0;
        let (a, b) = (half.a * cosine, half.a * half.a * 0.5);
        let c = (half.c + half.a * half.b) * 0.25;
        let near = Coefficients::of(&Twist { w: theta, v: theta });
        let (small, from) = (t.below(one), t.max(one));
        let d = (near.d * 2.0 - near.c).or(small, (a - b * 2.0) / from);
        let e = (near.e * -2.0).or(small, (b - c * 3.0) / from);
        Joint { theta, coefficients: [a, b, c], slopes: [c - b, d, e] }
    }

    /// The unit vectors of the axes of what carries the root, whose frame is `r`.
    #[inline(always)]
    pub fn carried_axes(&self, r: &M3<F>) -> [V3<F>; 3] {
        let turned = self.rotation();
        let (one, zero) = (self.theta.0[0].same(1.0), self.theta.0[0].same(0.0));
        let row = |x, y, z| *r * turned.transposed(V3([x, y, z]));
        [row(one, zero, zero), row(zero, one, zero), row(zero, zero, one)]
    }

    /// θ².
    #[inline(always)]
    pub fn squared_angle(&self) -> F {
        self.theta.dot(self.theta)
    }

    /// The rotation.
    #[inline(always)]
    pub fn rotation(&self) -> M3<F> {
        let [a, b, _] = self.coefficients;
        let hat = M3::hat(self.theta);
        M3::diagonal(a.same(1.0)) + hat * a + hat * hat * b
    }

    /// The rotations in the turned frame per unit of θ, by columns.
    #[inline(always)]
    pub fn jacobian(&self) -> M3<F> {
        let [a, b, c] = self.coefficients;
        M3::diagonal(a) - M3::hat(self.theta) * b + M3::outer(self.theta, self.theta) * c
    }

    /// Derivative by θ, symmetrised, of the generalised force of the moment `n`, which keeps its components in
    /// the turned frame.
    #[inline(always)]
    pub fn stiffness(&self, n: V3<F>) -> M3<F> {
        let ([_, _, c], [slope_a, slope_b, slope_c], theta) = (self.coefficients, self.slopes, self.theta);
        let along = theta.dot(n);
        let across = n * (slope_a + c) + theta.cross(n) * slope_b;
        (M3::outer(across, theta) + M3::outer(theta, across)) * slope_a.same(0.5)
            + M3::outer(theta, theta) * (slope_c * along)
            + M3::diagonal(c * along)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Matrix3, Rotation3, Vector3};

    #[test]
    fn rotation_and_derivatives_are_exact_up_to_nearly_a_full_turn() {
        for theta in [[0.0; 3], [0.1, -0.2, 0.05], [0.9, 0.5, -0.4], [1.5, -2.0, 1.2], [3.0, 3.0, -3.5]] {
            let joint = Joint::new(&theta);
            let rotation = |theta: [f64; 3]| *Rotation3::from_scaled_axis(Vector3::from(theta)).matrix();
            let now = Matrix3::from(joint.rotation());
            assert!((now - rotation(theta)).norm() < 1e-14, "{theta:?}");
            let moved = |i: usize, by: f64| {
                let mut theta = theta;
                theta[i] += by;
                theta
            };
            let (n, jacobian) = (V3([0.3, -0.7, 0.4]), Matrix3::from(joint.jacobian()));
            let mut slopes = Matrix3::zeros();
            for i in 0..3 {
                let [ahead, behind] = [1e-5, -1e-5].map(|by| moved(i, by));
                let spin = now.transpose() * (rotation(ahead) - rotation(behind)) / 2e-5;
                let spin = Vector3::new(spin[(2, 1)], spin[(0, 2)], spin[(1, 0)]);
                assert!((jacobian.column(i) - spin).norm() < 1e-9, "{theta:?}");
                let force =
                    |theta: [f64; 3]| Matrix3::from(Joint::new(&theta).jacobian()).tr_mul(&Vector3::from(n));
                slopes.set_column(i, &((force(ahead) - force(behind)) / 2e-5));
            }
            let symmetric = (slopes + slopes.transpose()) * 0.5;
            assert!((Matrix3::from(joint.stiffness(n)) - symmetric).norm() < 1e-9, "{theta:?}");
        }
    }
}
