//! Newton's method for contacts of which sweeps make nothing: more of them than the strand has unknowns, as where it is pulled taut round a body.
//!
//! With x = (µ r_N, r_T) and y = (ũ_N/µ, u_T), ũ_N = u_N + µ|u_T|, the law is 0 = x − [x − y]₊, [·]₊ being the projection on the cone |x_T| ≤ x_N
//! (Acary & Brogliato 2008, §13.3). That is not smooth, and Newton's method with a line search gets caught in its kinks. So they are rounded off: by the spectral
//! decomposition of the cone the projection takes the positive part of two eigenvalues λ, which (λ + √(λ² + 4τ²))/2 stands for, and √(|u_T|² + τ²) − τ for
//! |u_T|; τ falls from step to step (M. Fukushima, Z.-Q. Luo & P. Tseng, "Smoothing functions for second-order-cone complementarity problems", 2001).

use super::{Law, Problem, at};
use nalgebra::{DMatrix, DVector, Matrix3, Vector2, Vector3};

/// Steps at most.
const STEPS: u32 = 60;

/// What is left of τ after a step that did well, and after one that did passably.
const WELL: f64 = 0.3;
const PASSABLY: f64 = 0.7;

/// Shortest share of a step that is tried.
const LEAST_SHARE: f64 = 1e-3;

/// What is added to the diagonal, whose own size is 1: forces that balance each other and move nothing stay as they are.
const RIDGE: f64 = 1e-9;

/// How far a contact gives way, as a share of its own mobility.
pub(super) const COMPLIANCE: f64 = 1e-6;

/// Trace of a contact's mobility, over the largest, below which it does not take part.
const RIGID: f64 = 1e-12;

/// Coefficient below which a contact has no friction.
const SMOOTH: f64 = 1e-6;

/// What holds at a contact that takes part.
#[derive(Clone, Copy)]
enum Kind {
    Held,
    Frictionless,
    /// With this coefficient.
    Cone(f64),
}

/// The contacts that take part, impulses times their own scale of mobility.
struct Smoothed {
    contacts: Vec<usize>,
    kinds: Vec<Kind>,
    /// Impulse over velocity of each contact.
    scale: Vec<f64>,
    w: DMatrix<f64>,
    b: DVector<f64>,
}

/// Improves the impulses `r` of `problem` and returns its residual, which is some [`COMPLIANCE`] at best; never more than at the start.
///
/// What is solved, to a residual of `wanted`, is a problem whose contacts give way: without that, impulses that balance each other and move next to nothing
/// would be of any size, for contacts wedge a strand at its root.
pub(super) fn improve(problem: &Problem, wanted: f64, r: &mut [f64]) -> f64 {
    let mut w = problem.w.to_vec();
    for i in 0..problem.len() {
        let compliance = COMPLIANCE / 3.0 * problem.block(i).trace();
        (3 * i..3 * i + 3).for_each(|k| w[k * (3 * problem.len() + 1)] += compliance);
    }
    let mut soft = r.to_vec();
    descend(&Problem { w: &w, ..*problem }, wanted, &mut soft);
    let [before, after] = [&*r, &soft].map(|r| problem.residual(r));
    if after < before {
        r.copy_from_slice(&soft);
    }
    after.min(before)
}

fn descend(problem: &Problem, wanted: f64, r: &mut [f64]) {
    let mut best = problem.residual(r);
    let smoothed = Smoothed::new(problem, r);
    let mut x = smoothed.scaled(r);
    let mut trial_r = r.to_vec();
    let n = x.len();
    let (mut f, mut trial) = (DVector::zeros(n), DVector::zeros(n));
    let mut tau = smoothed.b.norm() / (n as f64 / 3.0).sqrt();
    for _ in 0..STEPS {
        if best <= wanted || tau == 0.0 {
            break;
        }
        let mut jacobian = DMatrix::zeros(n, n);
        smoothed.evaluate(&x, tau, &mut f, Some(&mut jacobian));
        (0..n).for_each(|i| jacobian[(i, i)] += RIDGE);
        let Some(step) = jacobian.lu().solve(&f) else { break };
        let before = f.norm_squared();
        let mut share = 1.0;
        let (next, after) = loop {
            let next = &x - &step * share;
            smoothed.evaluate(&next, tau, &mut trial, None);
            let after = trial.norm_squared();
            if after <= (1.0 - 1e-4 * share) * before || share < LEAST_SHARE {
                break (next, after);
            }
            share *= 0.5;
        };
        if !after.is_finite() {
            break;
        }
        x = next;
        if share > 0.5 || after < 0.25 * before {
            tau *= WELL;
        } else if share > 0.1 {
            tau *= PASSABLY;
        }
        smoothed.unscale(&x, &mut trial_r);
        let residual = problem.residual(&trial_r);
        if residual < best {
            best = residual;
            r.copy_from_slice(&trial_r);
        }
    }
}

impl Smoothed {
    /// A contact that holds by static friction, at `r`, goes on to.
    fn new(problem: &Problem, r: &[f64]) -> Self {
        let traces: Vec<f64> = (0..problem.len()).map(|i| problem.block(i).trace()).collect();
        let least = RIGID * traces.iter().fold(0.0, |a: f64, b| a.max(*b));
        let contacts: Vec<usize> = (0..problem.len()).filter(|&i| traces[i] > least).collect();
        let kind = |i: &usize| match problem.laws[*i] {
            Law::Held => Kind::Held,
            Law::Coulomb(friction) => {
                let r = at(r, *i);
                let sticks = r.yz().norm() > friction.kinetic * r.x * (1.0 + 1e-12);
                let mu = if sticks { friction.fixed } else { friction.kinetic };
                if mu < SMOOTH { Kind::Frictionless } else { Kind::Cone(mu) }
            }
        };
        let scale: Vec<f64> = contacts.iter().map(|&i| 3.0 / traces[i]).collect();
        // Those that do not take part push as they do.
        let mut others = r.to_vec();
        contacts.iter().for_each(|&i| others[3 * i..3 * i + 3].fill(0.0));
        let free = contacts.iter().flat_map(|&i| <[f64; 3]>::from(problem.velocity(&others, i)));
        let stride = 3 * problem.len();
        let entry = |row: usize, column: usize| {
            let [row, j] = [3 * contacts[row / 3] + row % 3, 3 * contacts[column / 3] + column % 3];
            problem.w[row * stride + j] * scale[column / 3]
        };
        let n = 3 * contacts.len();
        Smoothed {
            kinds: contacts.iter().map(kind).collect(),
            w: DMatrix::from_fn(n, n, entry),
            b: DVector::from_iterator(n, free),
            scale,
            contacts,
        }
    }

    fn scaled(&self, r: &[f64]) -> DVector<f64> {
        let scaled =
            self.contacts.iter().zip(&self.scale).flat_map(|(&i, s)| <[f64; 3]>::from(at(r, i) / *s));
        DVector::from_iterator(3 * self.contacts.len(), scaled)
    }

    fn unscale(&self, x: &DVector<f64>, r: &mut [f64]) {
        for (k, (&i, scale)) in self.contacts.iter().zip(&self.scale).enumerate() {
            (0..3).for_each(|c| r[3 * i + c] = x[3 * k + c] * scale);
        }
    }

    /// What is to vanish, at scaled impulses `x`, rounded off by `tau`, and its derivative.
    fn evaluate(
        &self,
        x: &DVector<f64>,
        tau: f64,
        f: &mut DVector<f64>,
        mut jacobian: Option<&mut DMatrix<f64>>,
    ) {
        let u = &self.w * x + &self.b;
        for (k, kind) in self.kinds.iter().enumerate() {
            let [r, u] = [x, &u].map(|v| Vector3::new(v[3 * k], v[3 * k + 1], v[3 * k + 2]));
            let (value, by_r, by_u) = match kind {
                Kind::Held => (u, Matrix3::zeros(), Matrix3::identity()),
                Kind::Frictionless => frictionless(&r, &u, tau),
                Kind::Cone(mu) => cone(&r, &u, *mu, tau),
            };
            f.fixed_rows_mut::<3>(3 * k).copy_from(&value);
            if let Some(jacobian) = &mut jacobian {
                let mut rows = jacobian.fixed_rows_mut::<3>(3 * k);
                rows.gemm(1.0, &by_u, &self.w.fixed_rows::<3>(3 * k), 0.0);
                let mut own = rows.fixed_columns_mut::<3>(3 * k);
                own += by_r;
            }
        }
    }
}

/// Positive part of `x`, rounded off by `tau`, and its derivative.
fn positive(x: f64, tau: f64) -> (f64, f64) {
    let root = x.hypot(2.0 * tau);
    (0.5 * (x + root), 0.5 * (1.0 + x / root))
}

/// The rounded law of a contact without friction, with its derivatives by impulse and velocity.
fn frictionless(r: &Vector3<f64>, u: &Vector3<f64>, tau: f64) -> (Vector3<f64>, Matrix3<f64>, Matrix3<f64>) {
    let (part, slope) = positive(r.x - u.x, tau);
    let by_r = Matrix3::from_diagonal(&Vector3::new(1.0 - slope, 1.0, 1.0));
    (Vector3::new(r.x - part, r.y, r.z), by_r, Matrix3::from_diagonal(&Vector3::new(slope, 0.0, 0.0)))
}

/// The rounded law of a contact of coefficient `mu`, with its derivatives by impulse and velocity.
fn cone(r: &Vector3<f64>, u: &Vector3<f64>, mu: f64, tau: f64) -> (Vector3<f64>, Matrix3<f64>, Matrix3<f64>) {
    let slip = u.yz().norm().hypot(tau);
    let y = Vector3::new(u.x / mu + slip - tau, u.y, u.z);
    let y_by_u = Matrix3::new(1.0 / mu, u.y / slip, u.z / slip, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0);
    let x = Vector3::new(mu * r.x, r.y, r.z);
    let x_by_r = Matrix3::from_diagonal(&Vector3::new(mu, 1.0, 1.0));
    let (part, slope) = projection(&(x - y), tau);
    (x - part, (Matrix3::identity() - slope) * x_by_r, slope * y_by_u)
}

/// Nearest point of the cone |v_T| ≤ v_N to `v`, rounded off by `tau`, and its derivative.
fn projection(v: &Vector3<f64>, tau: f64) -> (Vector3<f64>, Matrix3<f64>) {
    let length = v.yz().norm();
    let along = if length > 0.0 { v.yz() / length } else { Vector2::x() };
    let [(low, low_slope), (high, high_slope)] = [v.x - length, v.x + length].map(|l| positive(l, tau));
    let (mean, half) = (0.5 * (low + high), 0.5 * (high - low));
    let (even, odd) = (0.5 * (low_slope + high_slope), 0.5 * (high_slope - low_slope));
    let around = if length > 0.0 { half / length } else { low_slope };
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
    (Vector3::new(mean, half * along.x, half * along.y), slope)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::contact::tests::Random;

    #[test]
    fn derivatives_are_those_of_differences() {
        let mut random = Random::new(4);
        let d = 1e-6;
        for tau in [1.0, 0.1] {
            for _ in 0..50 {
                let (r, u) = (random.vector(), random.vector());
                for law in [frictionless, |r: &_, u: &_, tau: f64| cone(r, u, 0.4, tau)] {
                    let (_, by_r, by_u) = law(&r, &u, tau);
                    for c in 0..3 {
                        let e = Vector3::ith(c, d);
                        let r_slope = (law(&(r + e), &u, tau).0 - law(&(r - e), &u, tau).0) / (2.0 * d);
                        let u_slope = (law(&r, &(u + e), tau).0 - law(&r, &(u - e), tau).0) / (2.0 * d);
                        assert!((r_slope - by_r.column(c)).norm() < 1e-8, "{r_slope} {by_r}");
                        assert!((u_slope - by_u.column(c)).norm() < 1e-8, "{u_slope} {by_u}");
                    }
                }
            }
        }
    }

    #[test]
    fn without_rounding_it_is_the_projection() {
        let mut random = Random::new(8);
        for _ in 0..200 {
            let v = random.vector();
            let (part, _) = projection(&v, 1e-12);
            assert!((part - super::super::project_on_cone(v, 1.0)).norm() < 1e-9);
        }
    }
}
