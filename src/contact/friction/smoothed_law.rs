//! The smoothed law of a contact.
//!
//! With x = (µ r_N, r_T) and y = (ũ_N/µ, u_T), ũ_N = u_N + µ|u_T|, the law is 0 = x − [x − y]₊, where [·]₊
//! projects on the cone |x_T| ≤ x_N (Acary & Brogliato 2008, §13.3; `docs/theory.md` eq. 5.4). It is
//! nonsmooth, and Newton's method with a line search fails at its kinks, so they are smoothed: by the
//! spectral decomposition of the cone the projection takes the positive part of two eigenvalues λ, which
//! becomes (λ + √(λ² + 4τ²))/2, and |u_T| becomes √(|u_T|² + τ²) − τ (M. Fukushima, Z.-Q. Luo & P. Tseng,
//! "Smoothing functions for second-order-cone complementarity problems", 2001).

use nalgebra::{Matrix3, Vector2, Vector3};

/// The smoothed law of a contact, which is to vanish, and its derivatives.
pub(super) struct SmoothedLaw {
    pub value: Vector3<f64>,
    /// Derivative by the impulse r.
    pub by_r: Matrix3<f64>,
    /// Derivative by the velocity u.
    pub by_u: Matrix3<f64>,
    /// Derivative by the smoothing parameter τ.
    pub by_tau: Vector3<f64>,
}

impl SmoothedLaw {
    /// Of a contact without friction, with impulse `r` and velocity `u`.
    pub fn frictionless(r: &Vector3<f64>, u: &Vector3<f64>, tau: f64) -> Self {
        let [part, slope, by_tau] = positive_part(r.x - u.x, tau);
        SmoothedLaw {
            value: Vector3::new(r.x - part, r.y, r.z),
            by_r: Matrix3::from_diagonal(&Vector3::new(1.0 - slope, 1.0, 1.0)),
            by_u: Matrix3::from_diagonal(&Vector3::new(slope, 0.0, 0.0)),
            by_tau: Vector3::new(-by_tau, 0.0, 0.0),
        }
    }

    /// Of a contact with coefficient `mu`, impulse `r` and velocity `u`.
    pub fn coulomb(r: &Vector3<f64>, u: &Vector3<f64>, mu: f64, tau: f64) -> Self {
        let slip = u.yz().norm().hypot(tau);
        let y = Vector3::new(u.x / mu + slip - tau, u.y, u.z);
        let y_by_u = Matrix3::new(1.0 / mu, u.y / slip, u.z / slip, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0);
        let x = Vector3::new(mu * r.x, r.y, r.z);
        let x_by_r = Matrix3::from_diagonal(&Vector3::new(mu, 1.0, 1.0));
        let (part, slope, by_tau) = project(&(x - y), tau);
        SmoothedLaw {
            value: x - part,
            by_r: (Matrix3::identity() - slope) * x_by_r,
            by_u: slope * y_by_u,
            by_tau: slope.column(0) * (tau / slip - 1.0) - by_tau,
        }
    }
}

/// Smoothed positive part of `x`, and its derivatives by `x` and `tau`.
fn positive_part(x: f64, tau: f64) -> [f64; 3] {
    let root = x.hypot(2.0 * tau);
    [0.5 * (x + root), 0.5 * (1.0 + x / root), 2.0 * tau / root]
}

/// Smoothed projection of `v` on the cone |v_T| ≤ v_N, and its derivatives by `v` and `tau`.
pub(super) fn project(v: &Vector3<f64>, tau: f64) -> (Vector3<f64>, Matrix3<f64>, Vector3<f64>) {
    let length = v.yz().norm();
    let along = if length > 0.0 { v.yz() / length } else { Vector2::x() };
    let [low, high] = [v.x - length, v.x + length].map(|l| positive_part(l, tau));
    // Mean and half the difference over the two eigenvalues: of the value, its slope, and its derivative by
    // τ.
    let [mean, even, mean_by_tau] = std::array::from_fn(|i| 0.5 * (low[i] + high[i]));
    let [half, odd, half_by_tau] = std::array::from_fn(|i| 0.5 * (high[i] - low[i]));
    let around = if length > 0.0 { half / length } else { low[1] };
    let tangential = along * along.transpose() * (even - around);
    let slope = Matrix3::new(
        even,
        odd * along.x,
        odd * along.y,
        odd * along.x,
        around + tangential[(0, 0)],
        tangential[(0, 1)],
        odd * along.y,
        tangential[(1, 0)],
        around + tangential[(1, 1)],
    );
    let compose = |mean: f64, half: f64| Vector3::new(mean, half * along.x, half * along.y);
    (compose(mean, half), slope, compose(mean_by_tau, half_by_tau))
}

#[cfg(test)]
mod tests {
    use super::super::residual::project_on_cone;
    use super::*;
    use crate::math::random::Random;

    #[test]
    fn derivatives_agree_with_differences() {
        let mut random = Random::new(4);
        let d = 1e-6;
        for tau in [1.0, 0.1] {
            for _ in 0..50 {
                let (r, u) = (random.vector(), random.vector());
                let coulomb = |r: &_, u: &_, tau: f64| SmoothedLaw::coulomb(r, u, 0.4, tau);
                for law in [SmoothedLaw::frictionless, coulomb] {
                    let SmoothedLaw { by_r, by_u, by_tau, .. } = law(&r, &u, tau);
                    let slope = |at: &dyn Fn(f64) -> SmoothedLaw| (at(d).value - at(-d).value) / (2.0 * d);
                    for c in 0..3 {
                        let e = |d: f64| Vector3::ith(c, d);
                        let by =
                            [slope(&|d| law(&(r + e(d)), &u, tau)), slope(&|d| law(&r, &(u + e(d)), tau))];
                        assert!((by[0] - by_r.column(c)).norm() < 1e-8, "{} {by_r}", by[0]);
                        assert!((by[1] - by_u.column(c)).norm() < 1e-8, "{} {by_u}", by[1]);
                    }
                    let by = slope(&|d| law(&r, &u, tau + d));
                    assert!((by - by_tau).norm() < 1e-8, "{by} {by_tau}");
                }
            }
        }
    }

    #[test]
    fn the_smoothed_projection_converges_to_the_projection() {
        let mut random = Random::new(8);
        for _ in 0..200 {
            let v = random.vector();
            let (part, _, _) = project(&v, 1e-12);
            assert!((part - project_on_cone(v, 1.0)).norm() < 1e-9);
        }
    }
}
