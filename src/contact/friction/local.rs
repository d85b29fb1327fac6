//! One contact: u = W r + q with Signorini's condition and Coulomb's cone, exactly.

use nalgebra::{Matrix2, Matrix3, Vector2, Vector3};

/// Relative size below which an eigenvalue of a mobility is no mobility at all.
const RIGID: f64 = 1e-14;

/// Impulse r of one contact with mobility `w` (symmetric, positive semi-definite), velocity `q` without impulse, and
/// friction coefficient `mu`.
///
/// Take-off: q_N ≥ 0, r = 0. Stick: u = 0. Slip: u_N = 0 and u_T = −s r_T, s > 0. With u_N = 0 the normal impulse is
/// r_N = −(q_N + w·r_T)/W_NN; the tangential one then obeys (A + s I) r_T = −a, where A = W_TT − w wᵀ/W_NN and
/// a = q_T − w q_N/W_NN. Along s from 0 (stick) to ∞ (no friction) |r_T| − µ r_N goes from positive to negative when
/// sticking is impossible; the root is bracketed and found by Newton's method kept inside by bisection. This holds for any
/// coupling of normal and tangent, where the quartic of Bonnefon & Daviet (2011) loses digits to its coefficients.
pub fn solve_local(w: &Matrix3<f64>, q: &Vector3<f64>, mu: f64) -> Vector3<f64> {
    let floor = RIGID * w.trace();
    if q.x >= 0.0 || w[(0, 0)] <= floor {
        return Vector3::zeros();
    }
    if mu == 0.0 {
        return Vector3::new(-q.x / w[(0, 0)], 0.0, 0.0);
    }
    let coupling = Vector2::new(w[(1, 0)], w[(2, 0)]) / w[(0, 0)];
    let tangential = Matrix2::new(w[(1, 1)], w[(1, 2)], w[(2, 1)], w[(2, 2)]);
    let mobility = (tangential - coupling * coupling.transpose() * w[(0, 0)]).symmetric_eigen();
    let lambda = mobility.eigenvalues.map(|l| l.max(floor));
    // In the eigenbasis of A.
    let a = mobility.eigenvectors.tr_mul(&(q.yz() - coupling * q.x));
    let c = mobility.eigenvectors.tr_mul(&coupling);
    let normal_alone = -q.x / w[(0, 0)];
    let impulse = |s: f64| {
        let tangent = Vector2::new(-a.x / (lambda.x + s), -a.y / (lambda.y + s));
        (normal_alone - c.dot(&tangent), tangent)
    };
    let (mut normal, mut tangent) = impulse(0.0);
    if tangent.norm() > mu * normal {
        (normal, tangent) = impulse(slip_rate(mu, &lambda, &a, &c, impulse));
    }
    let tangent = mobility.eigenvectors * tangent;
    Vector3::new(normal, tangent.x, tangent.y)
}

/// Root s > 0 of |r_T(s)| − µ r_N(s), which is positive at 0.
fn slip_rate(
    mu: f64,
    lambda: &Vector2<f64>,
    a: &Vector2<f64>,
    c: &Vector2<f64>,
    impulse: impl Fn(f64) -> (f64, Vector2<f64>),
) -> f64 {
    let excess = |s: f64| {
        let (normal, tangent) = impulse(s);
        (tangent.norm() - mu * normal, tangent)
    };
    let mut lo = 0.0;
    let mut hi = lambda.max();
    while excess(hi).0 > 0.0 {
        lo = hi;
        hi *= 4.0;
        if !hi.is_finite() {
            return lo;
        }
    }
    let mut s = 0.5 * (lo + hi);
    for _ in 0..200 {
        let (f, tangent) = excess(s);
        if f > 0.0 {
            lo = s;
        } else {
            hi = s;
        }
        let slope = Vector2::new(a.x / (lambda.x + s).powi(2), a.y / (lambda.y + s).powi(2));
        let derivative = tangent.dot(&slope) / tangent.norm() + mu * c.dot(&slope);
        let newton = s - f / derivative;
        let next = if newton > lo && newton < hi { newton } else { 0.5 * (lo + hi) };
        if next == s || hi - lo <= f64::EPSILON * hi {
            break;
        }
        s = next;
    }
    s
}
