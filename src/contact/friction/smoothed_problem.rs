//! The smoothed laws of all contacts of a problem, and their linearisation.

use super::problem::{FrictionProblem, at};
use super::regularised::{BorderedSystem, RegularisedDelassus};
use super::smoothed_law::SmoothedLaw;
use nalgebra::{DVector, Vector3};

/// Smallest fraction of a Newton step in the line search.
const MIN_FRACTION: f64 = 1e-3;

/// Trace of a contact's block of W, over the largest one, below which the contact is omitted.
const RIGID: f64 = 1e-12;

/// Coefficient below which a contact is frictionless.
const FRICTIONLESS: f64 = 1e-6;

/// The law of a contact of the problem, with its coefficient chosen.
#[derive(Clone, Copy)]
enum Kind {
    Frictionless,
    Coulomb(f64),
}

/// The contacts of a problem that can move, in scaled variables.
///
/// Velocities are scaled by the root mean square of the free ones, and impulses by that over the mobility of
/// their contact, tr W_ii / 3.
pub(super) struct SmoothedProblem {
    /// Indices in the problem.
    contacts: Vec<usize>,
    kinds: Vec<Kind>,
    /// Unit of the impulse of each contact.
    scale: Vec<f64>,
    delassus: RegularisedDelassus,
    b: DVector<f64>,
}

/// The smoothed laws at given impulses.
pub(super) struct Evaluation {
    /// Values of the laws, which are to vanish.
    pub f: DVector<f64>,
    laws: Vec<SmoothedLaw>,
    tau: f64,
}

impl SmoothedProblem {
    /// A contact that sticks by static friction at the impulses `r` keeps the static coefficient. `None` if
    /// nothing moves without reactions.
    pub fn new(problem: &FrictionProblem, r: &[f64]) -> Option<Self> {
        let traces: Vec<f64> = (0..problem.len()).map(|i| problem.block(i).trace()).collect();
        let least = RIGID * traces.iter().fold(0.0, |a: f64, b| a.max(*b));
        let contacts: Vec<usize> = (0..problem.len()).filter(|&i| traces[i] > least).collect();
        let kind = |i: &usize| {
            let (friction, r) = (problem.friction[*i], at(r, *i));
            let sticks = r.yz().norm() > friction.mu_k * r.x * (1.0 + 1e-12);
            let mu = if sticks { friction.mu_s } else { friction.mu_k };
            if mu < FRICTIONLESS { Kind::Frictionless } else { Kind::Coulomb(mu) }
        };
        // Omitted contacts keep their impulses.
        let mut omitted = r.to_vec();
        contacts.iter().for_each(|&i| omitted[3 * i..3 * i + 3].fill(0.0));
        let free = contacts.iter().flat_map(|&i| <[f64; 3]>::from(problem.velocity(&omitted, i)));
        let b = DVector::from_iterator(3 * contacts.len(), free);
        let unit = b.norm() / (contacts.len() as f64).sqrt();
        if unit.is_nan() || unit <= 0.0 {
            return None;
        }
        let over_mobility: Vec<f64> = contacts.iter().map(|&i| 3.0 / traces[i]).collect();
        let stride = 3 * problem.len();
        let entry = |row: usize, column: usize| {
            let [row, column] = [row, column].map(|k| 3 * contacts[k / 3] + k % 3);
            problem.w[row * stride + column]
        };
        Some(SmoothedProblem {
            kinds: contacts.iter().map(kind).collect(),
            delassus: RegularisedDelassus::new(&over_mobility, entry),
            b: b / unit,
            scale: over_mobility.iter().map(|scale| scale * unit).collect(),
            contacts,
        })
    }

    /// Number of unknowns.
    pub fn len(&self) -> usize {
        self.b.len()
    }

    /// Scaled impulses x of the impulses `r`.
    pub fn scaled(&self, r: &[f64]) -> DVector<f64> {
        let scaled =
            self.contacts.iter().zip(&self.scale).flat_map(|(&i, s)| <[f64; 3]>::from(at(r, i) / *s));
        DVector::from_iterator(self.len(), scaled)
    }

    /// Writes the scaled impulses `x` to `r`; omitted contacts keep theirs.
    pub fn unscale(&self, x: &[f64], r: &mut [f64]) {
        for (k, (&i, scale)) in self.contacts.iter().zip(&self.scale).enumerate() {
            (0..3).for_each(|c| r[3 * i + c] = x[3 * k + c] * scale);
        }
    }

    /// The laws at scaled impulses `x` with smoothing parameter `tau`.
    pub fn evaluate(&self, x: &DVector<f64>, tau: f64) -> Evaluation {
        let u = self.delassus.times(x) + &self.b;
        let law = |(k, kind): (usize, &Kind)| {
            let [r, u] = [x, &u].map(|v| Vector3::new(v[3 * k], v[3 * k + 1], v[3 * k + 2]));
            match kind {
                Kind::Frictionless => SmoothedLaw::frictionless(&r, &u, tau),
                Kind::Coulomb(mu) => SmoothedLaw::coulomb(&r, &u, *mu, tau),
            }
        };
        let laws: Vec<SmoothedLaw> = self.kinds.iter().enumerate().map(law).collect();
        let f = DVector::from_iterator(self.len(), laws.iter().flat_map(|law| <[f64; 3]>::from(law.value)));
        Evaluation { f, laws, tau }
    }

    /// Solves the bordered Newton system: the changes of x and ln τ that change the laws by the first rows of
    /// `right`, and whose product with `border` is its last row.
    pub fn solve_bordered(
        &self,
        at: &Evaluation,
        right: DVector<f64>,
        border: &DVector<f64>,
    ) -> Option<DVector<f64>> {
        self.delassus.solve(&BorderedSystem { laws: &at.laws, tau: at.tau, right, border })
    }

    /// Line search (Armijo): the fraction of `step` to subtract from `x`, which was evaluated `at`, and |f|²
    /// there.
    pub fn line_search(&self, x: &DVector<f64>, step: &DVector<f64>, at: &Evaluation) -> (f64, f64) {
        let before = at.f.norm_squared();
        let mut fraction = 1.0;
        loop {
            let after = self.evaluate(&(x - step * fraction), at.tau).f.norm_squared();
            if after <= (1.0 - 1e-4 * fraction) * before || fraction < MIN_FRACTION {
                return (fraction, after);
            }
            fraction *= 0.5;
        }
    }
}
