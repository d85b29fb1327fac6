//! Rigid motions SE(3) and their twists se(3), written (ω, v): rotation part first.
//!
//! A pose is (R, p); a twist ξ = (ω, v) moves a point x by ω × x + v. Letters as in
//! `docs/theory.md` §2; closed forms from Barfoot, *State Estimation for Robotics* (2017), §7.1.

use super::lanes::{self, M3, Real, V3};
use nalgebra::{Matrix3, Vector3};

/// A twist (ω, v) of se(3).
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Twist {
    /// Rotation part ω.
    pub w: Vector3<f64>,
    /// Translation part v.
    pub v: Vector3<f64>,
}

/// A pose (R, p), the map x ↦ R x + p.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pose {
    /// Rotation R.
    pub r: Matrix3<f64>,
    /// Translation p.
    pub p: Vector3<f64>,
}

/// The left Jacobian of the exponential, exp(ξ + δ) = exp(J_l δ) exp(ξ) to first order, as the blocks of
/// J_l = ((J, 0), (Q, J)).
#[derive(Debug, Clone, Copy)]
pub struct LeftJacobian<F> {
    /// Rotation block J.
    pub j: M3<F>,
    /// Coupling block Q.
    pub q: M3<F>,
}

/// The matrix \[a\]× of the cross product a × ·.
pub fn hat(a: &Vector3<f64>) -> Matrix3<f64> {
    Matrix3::new(0.0, -a.z, a.y, a.z, 0.0, -a.x, -a.y, a.x, 0.0)
}

impl Twist {
    /// The twist (ω, v).
    pub fn new(w: Vector3<f64>, v: Vector3<f64>) -> Self {
        Twist { w, v }
    }
}

impl Pose {
    /// `self` after `other`: x ↦ self(other(x)).
    pub fn compose(&self, other: &Pose) -> Pose {
        Pose { r: self.r * other.r, p: self.r * other.p + self.p }
    }

    /// The inverse pose.
    pub fn inverse(&self) -> Pose {
        let rt = self.r.transpose();
        Pose { r: rt, p: -(rt * self.p) }
    }
}

/// Terms of each half of the series of [`Coefficients`]; the truncation error is below 10⁻¹⁶ of the sum for θ
/// ≤ π.
const TERMS: usize = 7;

/// (−1)ᵏ/(2k + 4)! and (−1)ᵏ (k + 1)/(2k + 5)!, the terms of d and e; for even k, then for odd k.
const SERIES: [[[f64; TERMS]; 2]; 2] = {
    let mut series = [[[0.0; TERMS]; 2]; 2];
    let (mut k, mut factorial, mut sign) = (0, 24.0, 1.0);
    while k < 2 * TERMS {
        let n = (2 * k) as f64;
        series[0][k % 2][k / 2] = sign / factorial;
        series[1][k % 2][k / 2] = sign * (0.5 * n + 1.0) / (factorial * (n + 5.0));
        factorial *= (n + 5.0) * (n + 6.0);
        sign = -sign;
        k += 1;
    }
    series
};

/// Coefficients of the closed forms at angle² t = θ²: a = sin θ/θ, b = (1 − cos θ)/θ², c = (θ − sin θ)/θ³,
/// d = (θ² + 2 cos θ − 2)/(2θ⁴), e = (2θ − 3 sin θ + θ cos θ)/(2θ⁵).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Coefficients<F> {
    pub(crate) a: F,
    pub(crate) b: F,
    pub(crate) c: F,
    pub(crate) d: F,
    pub(crate) e: F,
}

impl<F: Real> Coefficients<F> {
    /// The coefficients of the twist ξ, |ω| ≤ π.
    #[inline(always)]
    pub fn of(x: &lanes::Twist<F>) -> Self {
        Self::at(x.w.dot(x.w))
    }

    /// By series, for θ ≤ π: d and e by their own, from which the others follow without cancellation.
    #[inline(always)]
    fn at(t: F) -> Self {
        let tt = t * t;
        // Even and odd powers separately: two dependency chains of half the length.
        let mut sums = [[t.same(0.0); 2]; 2];
        for k in (0..TERMS).rev() {
            for s in 0..2 {
                for half in 0..2 {
                    sums[s][half] = sums[s][half] * tt + SERIES[s][half][k];
                }
            }
        }
        let (d, e) = (sums[0][0] + sums[0][1] * t, sums[1][0] + sums[1][1] * t);
        let b = -(t * d) + 0.5;
        let c = (b + t * e * 2.0) * (1.0 / 3.0);
        Coefficients { a: -(t * c) + 1.0, b, c, d, e }
    }
}

impl<F: Real> Coefficients<F> {
    /// At any angle; d and e are valid for θ ≤ π only, where they are needed.
    #[inline(always)]
    fn anywhere(t: F) -> Self {
        let mut k = Self::at(t);
        let large = F::ALL & !t.below(t.same(10.0));
        for i in (0..F::LANES).filter(|i| large >> i & 1 != 0) {
            let t = t.lane(i);
            let (s, c) = t.sqrt().sin_cos();
            let a = s / t.sqrt();
            k.a.set(i, a);
            k.b.set(i, (1.0 - c) / t);
            k.c.set(i, (1.0 - a) / t);
        }
        k
    }
}

/// exp \[φ\]×, the rotation by |φ| rad about φ (Rodrigues).
pub fn exp_so3(phi: &Vector3<f64>) -> Matrix3<f64> {
    let phi = V3::from(*phi);
    let t = phi.dot(phi);
    let k = Coefficients::anywhere(t);
    (M3::outer(phi, phi * k.b) + M3::hat(phi * k.a) + M3::diagonal(-(t * k.b) + 1.0)).into()
}

/// The rotation vector of R, |φ| ≤ π.
pub fn log_so3(r: &Matrix3<f64>) -> Vector3<f64> {
    // By the quaternion, which is well-conditioned at every angle, π included.
    nalgebra::UnitQuaternion::from_rotation_matrix(&nalgebra::Rotation3::from_matrix_unchecked(*r))
        .scaled_axis()
}

/// exp ξ, with the coefficients `k` of ξ; |ω| ≤ π.
#[inline(always)]
pub fn exp<F: Real>(x: &lanes::Twist<F>, k: &Coefficients<F>) -> lanes::Pose<F> {
    let t = x.w.dot(x.w);
    // [ω]×² = ω ωᵀ − θ² 1.
    let r = M3::outer(x.w, x.w * k.b) + M3::hat(x.w * k.a) + M3::diagonal(-(t * k.b) + 1.0);
    let turn = x.w.cross(x.v);
    lanes::Pose { r, p: x.v + turn * k.b + x.w.cross(turn) * k.c }
}

/// The twist ξ, |ω| < π, with exp ξ = `g`.
pub fn log(g: &Pose) -> Twist {
    let w = log_so3(&g.r);
    let t = w.norm_squared();
    let k = Coefficients::anywhere(t);
    // J⁻¹ = 1 − ½[φ]× + (1/θ²)(1 − a/(2b))[φ]×²; the last coefficient tends to 1/12.
    let e = if t < 1e-6 { 1.0 / 12.0 + t / 720.0 } else { (1.0 - k.a / (2.0 * k.b)) / t };
    let h = hat(&w);
    Twist { w, v: g.p - h * g.p * 0.5 + h * (h * g.p) * e }
}

/// The left Jacobian of exp at ξ, with the coefficients `k` of ξ; |ω| ≤ π (Barfoot 2017, eqs. 7.77 and 7.86,
/// with the products of \[ω\]× and \[v\]× in Q expanded).
#[inline(always)]
pub fn left_jacobian<F: Real>(x: &lanes::Twist<F>, k: &Coefficients<F>) -> LeftJacobian<F> {
    let (t, s) = (x.w.dot(x.w), x.w.dot(x.v));
    let j = M3::outer(x.w, x.w * k.c) + M3::hat(x.w * k.b) + M3::diagonal(-(t * k.c) + 1.0);
    let es = k.e * s * 2.0;
    let turning = x.v * (-(t * k.d) + 0.5) + x.w * ((k.d * 2.0 - k.c) * s);
    let sum = x.v * k.c - x.w * es;
    let q = M3::outer(x.w, sum)
        + M3::outer(x.v * k.c, x.w)
        + M3::hat(turning)
        + M3::diagonal(t * es - k.c * s * 2.0);
    LeftJacobian { j, q }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn twist() -> impl Strategy<Value = Twist> {
        prop::array::uniform6(-1.7..1.7f64)
            .prop_map(|a| Twist::new(Vector3::new(a[0], a[1], a[2]), Vector3::new(a[3], a[4], a[5])))
    }

    fn exp(x: &Twist) -> Pose {
        let x = lanes::Twist { w: x.w.into(), v: x.v.into() };
        let g = super::exp(&x, &Coefficients::of(&x));
        Pose { r: g.r.into(), p: g.p.into() }
    }

    proptest! {
        #[test]
        fn log_is_the_inverse_of_exp(x in twist()) {
            let y = log(&exp(&x));
            prop_assert!((y.w - x.w).norm() < 1e-12 && (y.v - x.v).norm() < 1e-11);
        }

        #[test]
        fn left_jacobian_is_the_derivative_of_exp(x in twist(), d in twist(), tiny in 0.0..1.0f64) {
            let x = Twist::new(x.w * tiny, x.v);
            let eps = 1e-5;
            let at = |s: f64| exp(&Twist::new(x.w + d.w * s, x.v + d.v * s));
            let back = exp(&x).inverse();
            let (p, m) = (log(&at(eps).compose(&back)), log(&at(-eps).compose(&back)));
            let x = lanes::Twist { w: x.w.into(), v: x.v.into() };
            let lj = left_jacobian(&x, &Coefficients::of(&x));
            let [j, q] = [lj.j, lj.q].map(Matrix3::from);
            let (w, v) = (j * d.w, q * d.w + j * d.v);
            prop_assert!(((p.w - m.w) / (2.0 * eps) - w).norm() < 1e-8);
            prop_assert!(((p.v - m.v) / (2.0 * eps) - v).norm() < 1e-8);
        }
    }

    #[test]
    fn series_agree_with_the_closed_forms_up_to_pi() {
        for th in [0.5, 1.0, 2.0, 3.0, std::f64::consts::PI] {
            let (k, t, (s, c)) = (Coefficients::at(th * th), th * th, th.sin_cos());
            let closed = [
                s / th,
                (1.0 - c) / t,
                (th - s) / (t * th),
                (t + 2.0 * c - 2.0) / (2.0 * t * t),
                (2.0 * th - 3.0 * s + th * c) / (2.0 * t * t * th),
            ];
            for (series, closed) in [k.a, k.b, k.c, k.d, k.e].into_iter().zip(closed) {
                assert!((series - closed).abs() < 5e-15, "{th}: {series} {closed}");
            }
        }
    }

    #[test]
    fn log_is_exact_at_pi() {
        let phi = Vector3::new(0.6, 0.0, 0.8) * std::f64::consts::PI;
        assert!((exp_so3(&log_so3(&exp_so3(&phi))) - exp_so3(&phi)).norm() < 1e-12);
    }
}
