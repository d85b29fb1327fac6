//! The law of contacts, rounded off.
//!
//! With x = (µ r_N, r_T) and y = (ũ_N/µ, u_T), ũ_N = u_N + µ|u_T|, the law is 0 = x − [x − y]₊, [·]₊ being the projection on the cone |x_T| ≤ x_N
//! (Acary & Brogliato 2008, §13.3). That is not smooth, and Newton's method with a line search gets caught in its kinks. So they are rounded off: by the spectral
//! decomposition of the cone the projection takes the positive part of two eigenvalues λ, which (λ + √(λ² + 4τ²))/2 stands for, and √(|u_T|² + τ²) − τ for
//! |u_T| (M. Fukushima, Z.-Q. Luo & P. Tseng, "Smoothing functions for second-order-cone complementarity problems", 2001).

use super::mobility::{Bordered, Mobility};
use super::{Law, Problem, at};
use nalgebra::{DVector, Matrix3, Vector2, Vector3};

/// Shortest share of a step that is tried.
const LEAST_SHARE: f64 = 1e-3;

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

/// The contacts that take part. Velocities are over the root of the mean square of those without contact forces, and impulses times their contact's mobility
/// are so too.
pub(super) struct Smoothed {
    contacts: Vec<usize>,
    kinds: Vec<Kind>,
    /// Impulse of each contact that is one here.
    scale: Vec<f64>,
    mobility: Mobility,
    b: DVector<f64>,
}

/// The law of all contacts at some impulses, rounded off.
pub(super) struct Point {
    /// What is to vanish.
    pub f: DVector<f64>,
    laws: Vec<Rounded>,
    tau: f64,
}

impl Smoothed {
    /// A contact that holds by static friction, at `r`, goes on to. `None` where nothing moves without contact forces.
    pub fn new(problem: &Problem, r: &[f64]) -> Option<Self> {
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
        // Those that do not take part push as they do.
        let mut others = r.to_vec();
        contacts.iter().for_each(|&i| others[3 * i..3 * i + 3].fill(0.0));
        let free = contacts.iter().flat_map(|&i| <[f64; 3]>::from(problem.velocity(&others, i)));
        let b = DVector::from_iterator(3 * contacts.len(), free);
        let unit = b.norm() / (contacts.len() as f64).sqrt();
        if unit.is_nan() || unit <= 0.0 {
            return None;
        }
        let of_unit: Vec<f64> = contacts.iter().map(|&i| 3.0 / traces[i]).collect();
        let stride = 3 * problem.len();
        let entry = |row: usize, column: usize| {
            let [row, column] = [row, column].map(|k| 3 * contacts[k / 3] + k % 3);
            problem.w[row * stride + column]
        };
        Some(Smoothed {
            kinds: contacts.iter().map(kind).collect(),
            mobility: Mobility::new(&of_unit, entry),
            b: b / unit,
            scale: of_unit.iter().map(|scale| scale * unit).collect(),
            contacts,
        })
    }

    /// Number of unknowns.
    pub fn len(&self) -> usize {
        self.b.len()
    }

    pub fn scaled(&self, r: &[f64]) -> DVector<f64> {
        let scaled =
            self.contacts.iter().zip(&self.scale).flat_map(|(&i, s)| <[f64; 3]>::from(at(r, i) / *s));
        DVector::from_iterator(self.len(), scaled)
    }

    /// Puts `x` into impulses `r`, those that do not take part left alone.
    pub fn unscale(&self, x: &[f64], r: &mut [f64]) {
        for (k, (&i, scale)) in self.contacts.iter().zip(&self.scale).enumerate() {
            (0..3).for_each(|c| r[3 * i + c] = x[3 * k + c] * scale);
        }
    }

    /// The law at scaled impulses `x`, rounded off by `tau`.
    pub fn at(&self, x: &DVector<f64>, tau: f64) -> Point {
        let u = self.mobility.times(x) + &self.b;
        let law = |(k, kind): (usize, &Kind)| {
            let [r, u] = [x, &u].map(|v| Vector3::new(v[3 * k], v[3 * k + 1], v[3 * k + 2]));
            match kind {
                Kind::Held => Rounded {
                    value: u,
                    by_r: Matrix3::zeros(),
                    by_u: Matrix3::identity(),
                    by_tau: Vector3::zeros(),
                },
                Kind::Frictionless => frictionless(&r, &u, tau),
                Kind::Cone(mu) => cone(&r, &u, *mu, tau),
            }
        };
        let laws: Vec<Rounded> = self.kinds.iter().enumerate().map(law).collect();
        let f = DVector::from_iterator(self.len(), laws.iter().flat_map(|law| <[f64; 3]>::from(law.value)));
        Point { f, laws, tau }
    }

    /// The changes of x and ln τ at a point by which what is to vanish changes as the upper rows of `right` say, and that make its last along `border`.
    pub fn change(&self, point: &Point, right: DVector<f64>, border: &DVector<f64>) -> Option<DVector<f64>> {
        self.mobility.solve(&Bordered { laws: &point.laws, tau: point.tau, right, border })
    }

    /// How much of `step` back from `x`, which is at `point`, lessens |f| as it should, and |f|² there.
    pub fn search(&self, x: &DVector<f64>, step: &DVector<f64>, point: &Point) -> (f64, f64) {
        let before = point.f.norm_squared();
        let mut share = 1.0;
        loop {
            let after = self.at(&(x - step * share), point.tau).f.norm_squared();
            if after <= (1.0 - 1e-4 * share) * before || share < LEAST_SHARE {
                return (share, after);
            }
            share *= 0.5;
        }
    }
}

/// The rounded law of a contact, with its derivatives by impulse, velocity and τ.
pub(super) struct Rounded {
    pub value: Vector3<f64>,
    pub by_r: Matrix3<f64>,
    pub by_u: Matrix3<f64>,
    pub by_tau: Vector3<f64>,
}

/// Positive part of `x`, rounded off by `tau`, and its derivatives by both.
fn positive(x: f64, tau: f64) -> [f64; 3] {
    let root = x.hypot(2.0 * tau);
    [0.5 * (x + root), 0.5 * (1.0 + x / root), 2.0 * tau / root]
}

/// Of a contact without friction.
fn frictionless(r: &Vector3<f64>, u: &Vector3<f64>, tau: f64) -> Rounded {
    let [part, slope, by_tau] = positive(r.x - u.x, tau);
    Rounded {
        value: Vector3::new(r.x - part, r.y, r.z),
        by_r: Matrix3::from_diagonal(&Vector3::new(1.0 - slope, 1.0, 1.0)),
        by_u: Matrix3::from_diagonal(&Vector3::new(slope, 0.0, 0.0)),
        by_tau: Vector3::new(-by_tau, 0.0, 0.0),
    }
}

/// Of a contact of coefficient `mu`.
fn cone(r: &Vector3<f64>, u: &Vector3<f64>, mu: f64, tau: f64) -> Rounded {
    let slip = u.yz().norm().hypot(tau);
    let y = Vector3::new(u.x / mu + slip - tau, u.y, u.z);
    let y_by_u = Matrix3::new(1.0 / mu, u.y / slip, u.z / slip, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0);
    let x = Vector3::new(mu * r.x, r.y, r.z);
    let x_by_r = Matrix3::from_diagonal(&Vector3::new(mu, 1.0, 1.0));
    let (part, slope, by_tau) = projection(&(x - y), tau);
    Rounded {
        value: x - part,
        by_r: (Matrix3::identity() - slope) * x_by_r,
        by_u: slope * y_by_u,
        by_tau: slope.column(0) * (tau / slip - 1.0) - by_tau,
    }
}

/// Nearest point of the cone |v_T| ≤ v_N to `v`, rounded off by `tau`, and its derivatives by both.
fn projection(v: &Vector3<f64>, tau: f64) -> (Vector3<f64>, Matrix3<f64>, Vector3<f64>) {
    let length = v.yz().norm();
    let along = if length > 0.0 { v.yz() / length } else { Vector2::x() };
    let [low, high] = [v.x - length, v.x + length].map(|l| positive(l, tau));
    // Of the value, its slope and its derivative by τ: mean and half the difference of the two eigenvalues'.
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
    let on = |mean: f64, half: f64| Vector3::new(mean, half * along.x, half * along.y);
    (on(mean, half), slope, on(mean_by_tau, half_by_tau))
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
                    let Rounded { by_r, by_u, by_tau, .. } = law(&r, &u, tau);
                    let slope = |at: &dyn Fn(f64) -> Rounded| (at(d).value - at(-d).value) / (2.0 * d);
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
    fn without_rounding_it_is_the_projection() {
        let mut random = Random::new(8);
        for _ in 0..200 {
            let v = random.vector();
            let (part, _, _) = projection(&v, 1e-12);
            assert!((part - super::super::project_on_cone(v, 1.0)).norm() < 1e-9);
        }
    }
}
