//! Exact solution of one contact: u = W r + q with Signorini's condition and Coulomb's law.

use crate::geometry::Friction;
use nalgebra::{Matrix2, Matrix3, Vector2, Vector3};

/// Relative size below which an eigenvalue of W is zero.
const RIGID: f64 = 1e-14;

/// Relative Newton step for the slip rate below which the iteration stops.
const NEGLIGIBLE: f64 = 1e-7;

/// Maximum number of iterations for the slip rate.
const ITERATIONS: usize = 200;

/// Impulse r of one contact with Delassus block `w` (symmetric positive semi-definite) and free velocity `q`.
pub fn solve_local(w: &Matrix3<f64>, q: &Vector3<f64>, friction: Friction) -> Vector3<f64> {
    LocalSolver::new(w).solve(q, friction)
}

/// Solver of one contact, prepared for many free velocities.
///
/// - Take-off: q_N ≥ 0, r = 0.
/// - Stick: u = 0, inside the static cone.
/// - Slip: u_N = 0 and u_T = −s r_T, s > 0, on the kinetic cone.
///
/// With u_N = 0 the normal impulse is r_N = −(q_N + w·r_T)/W_NN, and the tangential one obeys (A + s I) r_T =
/// −a, with A = W_TT − w wᵀ/W_NN and a = q_T − w q_N/W_NN. Along s from 0 (stick) to ∞ (no friction) |r_T| −
/// µ r_N changes from positive to negative if sticking is impossible. The root is bracketed, and found by
/// Newton's method safeguarded by bisection. This holds for any coupling of normal and tangent, where the
/// quartic of Bonnefon & Daviet (2011) loses digits in its coefficients.
#[derive(Debug, Clone, Copy)]
pub(super) struct LocalSolver {
    pub w: Matrix3<f64>,
    /// Square root of the mobility, tr W.
    pub scale: f64,
    /// W_NN; 0 if the contact cannot move.
    normal: f64,
    /// w/W_NN, in the eigenbasis of A.
    coupling: Vector2<f64>,
    /// Eigenvalues of A.
    lambda: Vector2<f64>,
    /// Eigenvectors of A.
    basis: Matrix2<f64>,
    /// s of the last solve that slipped, the next initial value.
    slip_rate: f64,
}

impl LocalSolver {
    pub fn new(w: &Matrix3<f64>) -> Self {
        let floor = RIGID * w.trace();
        if w[(0, 0)] <= floor {
            let (zero, basis) = (Vector2::zeros(), Matrix2::identity());
            return LocalSolver {
                w: *w,
                scale: 0.0,
                normal: 0.0,
                coupling: zero,
                lambda: zero,
                basis,
                slip_rate: 0.0,
            };
        }
        let coupling = Vector2::new(w[(1, 0)], w[(2, 0)]) / w[(0, 0)];
        let tangential = Matrix2::new(w[(1, 1)], w[(1, 2)], w[(2, 1)], w[(2, 2)]);
        let (lambda, basis) = eigen(&(tangential - coupling * coupling.transpose() * w[(0, 0)]));
        let lambda = lambda.map(|l| l.max(floor));
        let coupling = basis.tr_mul(&coupling);
        let scale = w.trace().sqrt();
        LocalSolver { w: *w, scale, normal: w[(0, 0)], coupling, lambda, basis, slip_rate: 0.0 }
    }

    /// Impulse for free velocity `q`.
    #[inline(always)]
    pub fn solve(&mut self, q: &Vector3<f64>, Friction { mu_s, mu_k }: Friction) -> Vector3<f64> {
        if q.x >= 0.0 || self.normal == 0.0 {
            return Vector3::zeros();
        }
        let frictionless = -q.x / self.normal;
        // Interpolated along a strand, no friction may be a little less than none.
        if mu_s <= 0.0 {
            return Vector3::new(frictionless, 0.0, 0.0);
        }
        // In the eigenbasis of A.
        let c = self.coupling;
        let a = self.basis.tr_mul(&q.yz()) - c * q.x;
        let impulse = |s: f64| {
            let inverse = self.lambda.map(|l| 1.0 / (l + s));
            let tangent = -a.component_mul(&inverse);
            (frictionless - c.dot(&tangent), tangent, inverse)
        };
        let (mut normal, mut tangent, _) = impulse(0.0);
        if tangent.norm() > mu_s * normal && mu_k <= 0.0 {
            return Vector3::new(frictionless, 0.0, 0.0);
        }
        if tangent.norm() > mu_s * normal {
            self.slip_rate = find_slip_rate(mu_k, &c, self.lambda.max(), self.slip_rate, impulse);
            (normal, tangent, _) = impulse(self.slip_rate);
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

/// Root s > 0 of |r_T(s)| − µ r_N(s), which is positive at 0.
///
/// Finds the zero of g(s) = µ r_N/|r_T| − 1, which is linear without coupling and for equal λ, so that
/// Newton's method takes few steps from `start`. `impulse` returns r_N, r_T, and the ratio of −dr_T/ds to
/// r_T; `c` is the coupling in the eigenbasis, `lambda` the largest λ, the scale of the first steps.
#[inline(always)]
fn find_slip_rate(
    mu: f64,
    c: &Vector2<f64>,
    lambda: f64,
    start: f64,
    impulse: impl Fn(f64) -> (f64, Vector2<f64>, Vector2<f64>),
) -> f64 {
    let (mut lo, mut hi) = (0.0, f64::INFINITY);
    let mut s = if start.is_finite() { start } else { 0.0 };
    for _ in 0..ITERATIONS {
        let (normal, tangent, inverse) = impulse(s);
        let over_length = 1.0 / tangent.norm();
        let g = mu * normal * over_length - 1.0;
        if g < 0.0 {
            lo = s;
        } else {
            hi = s;
        }
        let slope = -tangent.component_mul(&inverse);
        let growth =
            -mu * over_length * (c.dot(&slope) + normal * tangent.dot(&slope) * over_length * over_length);
        let newton = s - g / growth;
        let accepted = newton >= lo && newton <= hi;
        let next = if accepted {
            newton
        } else if hi.is_finite() {
            0.5 * (lo + hi)
        } else {
            4.0 * s.max(lambda)
        };
        let step = (next - s).abs();
        s = next;
        // Newton's method converges quadratically: the next step would be the square of this one.
        if accepted && step <= NEGLIGIBLE * s || !s.is_finite() {
            break;
        }
    }
    s
}
