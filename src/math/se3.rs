//! Rigid motions SE(3) and their twists se(3), written (ω, v): rotation part first.
//!
//! A pose is (R, p); a twist ξ = (ω, v) moves a point x by ω × x + v. Letters as in
//! `docs/theory.md` §2; closed forms from Barfoot, *State Estimation for Robotics* (2017), §7.1.

use nalgebra::{Matrix3, Vector3};

/// A twist (ω, v) of se(3).
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Twist {
    /// Rotation part ω.
    pub w: Vector3<f64>,
    /// Translation part v.
    pub v: Vector3<f64>,
}

/// A pose (R, p): x ↦ R x + p.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pose {
    /// Rotation R.
    pub r: Matrix3<f64>,
    /// Translation p.
    pub p: Vector3<f64>,
}

/// The left Jacobian of the exponential: exp(ξ + δ) = exp(J δ) exp(ξ) to first order, as the blocks of
/// ((J, 0), (Q, J)).
#[derive(Debug, Clone, Copy)]
pub struct LeftJacobian {
    /// Rotation block J.
    pub j: Matrix3<f64>,
    /// Coupling block Q.
    pub q: Matrix3<f64>,
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
    /// The pose that moves nothing.
    pub fn identity() -> Self {
        Pose { r: Matrix3::identity(), p: Vector3::zeros() }
    }

    /// `self` after `other`: x ↦ self(other(x)).
    pub fn compose(&self, other: &Pose) -> Pose {
        Pose { r: self.r * other.r, p: self.r * other.p + self.p }
    }

    /// The pose that undoes this one.
    pub fn inverse(&self) -> Pose {
        let rt = self.r.transpose();
        Pose { r: rt, p: -(rt * self.p) }
    }

    /// Ad ξ: the twist that ξ is when seen from the frame in which this pose is given.
    pub fn adjoint(&self, x: &Twist) -> Twist {
        let w = self.r * x.w;
        Twist { w, v: self.r * x.v + self.p.cross(&w) }
    }
}

/// Coefficients of the closed forms at angle² t: a = sin θ/θ, b = (1 − cos θ)/θ², c = (θ − sin θ)/θ³,
/// d = (θ² + 2 cos θ − 2)/(2θ⁴), e = (2θ − 3 sin θ + θ cos θ)/(2θ⁵); Taylor series where those cancel.
struct Coefficients {
    a: f64,
    b: f64,
    c: f64,
    d: f64,
    e: f64,
}

impl Coefficients {
    fn at(t: f64) -> Self {
        if t < 0.25 {
            // Truncation below 1e-16 at t = 1/4.
            let series = |k: [f64; 7]| k.iter().rev().fold(0.0, |acc, &ck| acc * t + ck);
            Coefficients {
                a: series([
                    1.0,
                    -1.0 / 6.0,
                    1.0 / 120.0,
                    -1.0 / 5040.0,
                    1.0 / 362880.0,
                    -1.0 / 39916800.0,
                    1.0 / 6227020800.0,
                ]),
                b: series([
                    0.5,
                    -1.0 / 24.0,
                    1.0 / 720.0,
                    -1.0 / 40320.0,
                    1.0 / 3628800.0,
                    -1.0 / 479001600.0,
                    1.0 / 87178291200.0,
                ]),
                c: series([
                    1.0 / 6.0,
                    -1.0 / 120.0,
                    1.0 / 5040.0,
                    -1.0 / 362880.0,
                    1.0 / 39916800.0,
                    -1.0 / 6227020800.0,
                    1.0 / 1307674368000.0,
                ]),
                d: series([
                    1.0 / 24.0,
                    -1.0 / 720.0,
                    1.0 / 40320.0,
                    -1.0 / 3628800.0,
                    1.0 / 479001600.0,
                    -1.0 / 87178291200.0,
                    1.0 / 20922789888000.0,
                ]),
                e: series([
                    1.0 / 120.0,
                    -1.0 / 2520.0,
                    1.0 / 120960.0,
                    -1.0 / 9979200.0,
                    1.0 / 1245404160.0,
                    -1.0 / 217945728000.0,
                    1.0 / 50812489728000.0,
                ]),
            }
        } else {
            let th = t.sqrt();
            let (s, c) = th.sin_cos();
            Coefficients {
                a: s / th,
                b: (1.0 - c) / t,
                c: (th - s) / (t * th),
                d: (t + 2.0 * c - 2.0) / (2.0 * t * t),
                e: (2.0 * th - 3.0 * s + th * c) / (2.0 * t * t * th),
            }
        }
    }
}

/// exp \[φ\]×: the rotation by |φ| rad about φ (Rodrigues).
pub fn exp_so3(phi: &Vector3<f64>) -> Matrix3<f64> {
    let k = Coefficients::at(phi.norm_squared());
    let h = hat(phi);
    Matrix3::identity() + h * k.a + h * h * k.b
}

/// The rotation vector of R, |φ| ≤ π.
pub fn log_so3(r: &Matrix3<f64>) -> Vector3<f64> {
    // Through the quaternion: well-conditioned at every angle, π included.
    nalgebra::UnitQuaternion::from_rotation_matrix(&nalgebra::Rotation3::from_matrix_unchecked(*r))
        .scaled_axis()
}

/// exp ξ.
pub fn exp(x: &Twist) -> Pose {
    let k = Coefficients::at(x.w.norm_squared());
    let h = hat(&x.w);
    let hh = h * h;
    let j = Matrix3::identity() + h * k.b + hh * k.c;
    Pose { r: Matrix3::identity() + h * k.a + hh * k.b, p: j * x.v }
}

/// The twist ξ, |ω| < π, with exp ξ = `g`.
pub fn log(g: &Pose) -> Twist {
    let w = log_so3(&g.r);
    let t = w.norm_squared();
    let k = Coefficients::at(t);
    // J⁻¹ = 1 − ½[φ]× + (1/θ²)(1 − a/(2b))[φ]×²; the last coefficient tends to 1/12.
    let e = if t < 1e-6 { 1.0 / 12.0 + t / 720.0 } else { (1.0 - k.a / (2.0 * k.b)) / t };
    let h = hat(&w);
    Twist { w, v: g.p - h * g.p * 0.5 + h * (h * g.p) * e }
}

/// The left Jacobian of exp at ξ (Barfoot 2017, eqs. 7.77 and 7.86).
pub fn left_jacobian(x: &Twist) -> LeftJacobian {
    let k = Coefficients::at(x.w.norm_squared());
    let (f, r) = (hat(&x.w), hat(&x.v));
    let (fr, rf, ff) = (f * r, r * f, f * f);
    let frf = fr * f;
    let j = Matrix3::identity() + f * k.b + ff * k.c;
    let q = r * 0.5 + (fr + rf + frf) * k.c + (f * fr + rf * f - frf * 3.0) * k.d + (frf * f + f * frf) * k.e;
    LeftJacobian { j, q }
}

/// The left Jacobian of the rotation exponential at φ: exp(φ + δ) = exp(J δ) exp(φ) to first order.
pub fn left_jacobian_so3(phi: &Vector3<f64>) -> Matrix3<f64> {
    let k = Coefficients::at(phi.norm_squared());
    let f = hat(phi);
    Matrix3::identity() + f * k.b + f * f * k.c
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn twist() -> impl Strategy<Value = Twist> {
        prop::array::uniform6(-1.7..1.7f64)
            .prop_map(|a| Twist::new(Vector3::new(a[0], a[1], a[2]), Vector3::new(a[3], a[4], a[5])))
    }

    proptest! {
        #[test]
        fn log_undoes_exp(x in twist()) {
            let y = log(&exp(&x));
            prop_assert!((y.w - x.w).norm() < 1e-12 && (y.v - x.v).norm() < 1e-11);
        }

        #[test]
        fn left_jacobian_is_the_derivative_of_exp(x in twist(), d in twist(), tiny in 0.0..1.0f64) {
            // Also where the series take over from the closed forms.
            let x = Twist::new(x.w * tiny, x.v);
            let eps = 1e-5;
            let at = |s: f64| exp(&Twist::new(x.w + d.w * s, x.v + d.v * s));
            let back = exp(&x).inverse();
            let (p, m) = (log(&at(eps).compose(&back)), log(&at(-eps).compose(&back)));
            let lj = left_jacobian(&x);
            let (w, v) = (lj.j * d.w, lj.q * d.w + lj.j * d.v);
            prop_assert!(((p.w - m.w) / (2.0 * eps) - w).norm() < 1e-8);
            prop_assert!(((p.v - m.v) / (2.0 * eps) - v).norm() < 1e-8);
        }
    }

    #[test]
    fn series_meet_the_closed_forms() {
        let (lo, hi) = (Coefficients::at(0.25 - 1e-12), Coefficients::at(0.25));
        for (l, h) in [(lo.a, hi.a), (lo.b, hi.b), (lo.c, hi.c), (lo.d, hi.d), (lo.e, hi.e)] {
            assert!((l - h).abs() < 1e-12 * h.abs(), "{l} {h}");
        }
    }

    #[test]
    fn log_holds_at_half_a_turn() {
        let phi = Vector3::new(0.6, 0.0, 0.8) * std::f64::consts::PI;
        assert!((exp_so3(&log_so3(&exp_so3(&phi))) - exp_so3(&phi)).norm() < 1e-12);
    }
}
