//! The laws of all contacts of a problem, rounded off, and how they change with its impulses.

use super::mobility::{Bordered, Mobility};
use super::problem::{FrictionProblem, Law, at};
use super::rounded::{Rounded, cone, frictionless};
use nalgebra::{DVector, Vector3};

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
    pub fn new(problem: &FrictionProblem, r: &[f64]) -> Option<Self> {
        let traces: Vec<f64> = (0..problem.len()).map(|i| problem.block(i).trace()).collect();
        let least = RIGID * traces.iter().fold(0.0, |a: f64, b| a.max(*b));
        let contacts: Vec<usize> = (0..problem.len()).filter(|&i| traces[i] > least).collect();
        let kind = |i: &usize| match problem.laws[*i] {
            Law::Bilateral => Kind::Held,
            Law::Coulomb(friction) => {
                let r = at(r, *i);
                let sticks = r.yz().norm() > friction.mu_k * r.x * (1.0 + 1e-12);
                let mu = if sticks { friction.mu_s } else { friction.mu_k };
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
                Kind::Held => Rounded::held(&u),
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
