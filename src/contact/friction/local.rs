//! One contact: u = W r + q with Signorini's condition and Coulomb's cone, or held fast, exactly.

use super::problem::Law;
use crate::geometry::Friction;
use nalgebra::{Matrix2, Matrix3, Vector2, Vector3};

/// Relative size below which an eigenvalue of a mobility is no mobility at all.
const RIGID: f64 = 1e-14;

/// Relative step of Newton's method for the slip after which none is needed.
const NEGLIGIBLE: f64 = 1e-7;

/// Impulse r of one contact with mobility `w` (symmetric, positive semi-definite) and velocity `q` without impulse.
pub fn solve_local(w: &Matrix3<f64>, q: &Vector3<f64>, law: Law) -> Vector3<f64> {
    Local::new(w).solve(q, law)
}

/// One contact, made ready for many solves with the same mobility.
///
/// Take-off: q_N ≥ 0, r = 0. Stick: u = 0, within the cone of what sticks. Slip: u_N = 0 and u_T = −s r_T, s > 0, on that of what slides. With u_N = 0 the normal impulse is
/// r_N = −(q_N + w·r_T)/W_NN; the tangential one then obeys (A + s I) r_T = −a, where A = W_TT − w wᵀ/W_NN and
/// a = q_T − w q_N/W_NN. Along s from 0 (stick) to ∞ (no friction) |r_T| − µ r_N goes from positive to negative when
/// sticking is impossible; the root is bracketed and found by Newton's method kept inside by bisection. This holds for any
/// coupling of normal and tangent, where the quartic of Bonnefon & Daviet (2011) loses digits to its coefficients.
#[derive(Debug, Clone, Copy)]
pub(super) struct Local {
    pub w: Matrix3<f64>,
    /// W_NN, 0 where the contact cannot move.
    normal: f64,
    /// w/W_NN.
    coupling: Vector2<f64>,
    /// Eigenvalues and eigenvectors of A.
    lambda: Vector2<f64>,
    basis: Matrix2<f64>,
    /// s of the last solve that slipped: where the next starts from.
    rate: f64,
}

impl Local {
    pub fn new(w: &Matrix3<f64>) -> Self {
        let floor = RIGID * w.trace();
        if w[(0, 0)] <= floor {
            let (zero, basis) = (Vector2::zeros(), Matrix2::identity());
            return Local { w: *w, normal: 0.0, coupling: zero, lambda: zero, basis, rate: 0.0 };
        }
        let coupling = Vector2::new(w[(1, 0)], w[(2, 0)]) / w[(0, 0)];
        let tangential = Matrix2::new(w[(1, 1)], w[(1, 2)], w[(2, 1)], w[(2, 2)]);
        let (lambda, basis) = eigen(&(tangential - coupling * coupling.transpose() * w[(0, 0)]));
        Local { w: *w, normal: w[(0, 0)], coupling, lambda: lambda.map(|l| l.max(floor)), basis, rate: 0.0 }
    }

    pub fn solve(&mut self, q: &Vector3<f64>, law: Law) -> Vector3<f64> {
        let Law::Coulomb(Friction { mu_s, mu_k: mu }) = law else {
            return self.w.cholesky().map_or_else(Vector3::zeros, |w| -w.solve(q));
        };
        if q.x >= 0.0 || self.normal == 0.0 {
            return Vector3::zeros();
        }
        let normal_alone = -q.x / self.normal;
        if mu_s == 0.0 {
            return Vector3::new(normal_alone, 0.0, 0.0);
        }
        // In the eigenbasis of A.
        let a = self.basis.tr_mul(&(q.yz() - self.coupling * q.x));
        let c = self.basis.tr_mul(&self.coupling);
        let impulse = |s: f64| {
            let softness = self.lambda.map(|l| 1.0 / (l + s));
            let tangent = -a.component_mul(&softness);
            (normal_alone - c.dot(&tangent), tangent, softness)
        };
        let (mut normal, mut tangent, _) = impulse(0.0);
        if tangent.norm() > mu_s * normal && mu == 0.0 {
            return Vector3::new(normal_alone, 0.0, 0.0);
        }
        if tangent.norm() > mu_s * normal {
            self.rate = slip_rate(mu, &c, self.lambda.max(), self.rate, impulse);
            (normal, tangent, _) = impulse(self.rate);
        }
        let tangent = self.basis * tangent;
        Vector3::new(normal, tangent.x, tangent.y)
    }
}

/// Eigenvalues and eigenvectors of a symmetric matrix, by one rotation (Jacobi 1846).
fn eigen(m: &Matrix2<f64>) -> (Vector2<f64>, Matrix2<f64>) {
    let (a, b, d) = (m[(0, 0)], m[(0, 1)], m[(1, 1)]);
    if b == 0.0 {
        return (Vector2::new(a, d), Matrix2::identity());
    }
    let tau = (d - a) / (2.0 * b);
    let t = f64::copysign(1.0, tau) / (tau.abs() + (1.0 + tau * tau).sqrt());
    let c = 1.0 / (1.0 + t * t).sqrt();
    (Vector2::new(a - t * b, d + t * b), Matrix2::new(c, t * c, -t * c, c))
}

/// Root s > 0 of |r_T(s)| − µ r_N(s), which is positive at 0: that of g(s) = µ r_N/|r_T| − 1, which without coupling and with equal λ is a
/// straight line, so that Newton's method takes a few steps from `start`. `impulse` gives for s r_N, r_T and −dr_T/ds over r_T; the largest λ tells how far
/// s may go at first.
fn slip_rate(
    mu: f64,
    c: &Vector2<f64>,
    lambda: f64,
    start: f64,
    impulse: impl Fn(f64) -> (f64, Vector2<f64>, Vector2<f64>),
) -> f64 {
    let (mut lo, mut hi) = (0.0, f64::INFINITY);
    let mut s = if start.is_finite() { start } else { 0.0 };
    for _ in 0..200 {
        let (normal, tangent, softness) = impulse(s);
        let over_length = 1.0 / tangent.norm();
        let g = mu * normal * over_length - 1.0;
        if g < 0.0 {
            lo = s;
        } else {
            hi = s;
        }
        let slope = -tangent.component_mul(&softness);
        let growth =
            -mu * over_length * (c.dot(&slope) + normal * tangent.dot(&slope) * over_length * over_length);
        let newton = s - g / growth;
        let trusted = newton >= lo && newton <= hi;
        let next = if trusted {
            newton
        } else if hi.is_finite() {
            0.5 * (lo + hi)
        } else {
            4.0 * s.max(lambda)
        };
        let step = (next - s).abs();
        s = next;
        // After so short a step of Newton's method the next would be the square of it.
        if trusted && step <= NEGLIGIBLE * s || !s.is_finite() {
            break;
        }
    }
    s
}
