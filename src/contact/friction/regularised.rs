//! The scaled Delassus operator with a compliance, and solution of the Newton systems.
//!
//! The contacts of one strand often have many more components than the strand has unknowns. W then has a
//! factor of few rows, W = GᵀG. A system (A + U W) δ = f, with A and U block diagonal by contact, reduces to
//! one of that size for z = G δ: (1 + G A⁻¹U Gᵀ) z = G A⁻¹ f and A δ = f − U Gᵀ z (`docs/theory.md` eq. 5.5).

use super::smoothed_law::SmoothedLaw;
use nalgebra::{DMatrix, DVector, Matrix3, Vector3};
use pulp::{Arch, Simd, WithSimd};

/// Compliance of every contact, as a fraction of its own mobility.
pub(super) const COMPLIANCE: f64 = 1e-6;

/// Ridge on the diagonal of a system of unit scale: it fixes impulses that balance each other and move
/// nothing.
const RIDGE: f64 = 1e-9;

/// Remaining diagonal, of unit scale, at which the pivoted factorisation of W ends: rounding.
const ROUNDING: f64 = 1e-12;

/// W from scaled impulses to velocities, with blocks of trace 3 on the diagonal, plus [`COMPLIANCE`].
pub(super) struct RegularisedDelassus {
    /// Square roots of the scales of the contacts, which make the scaled W symmetric.
    roots: Vec<f64>,
    form: Form,
}

enum Form {
    /// The factor G of the symmetric W.
    LowRank(DMatrix<f64>),
    /// The scaled, unsymmetric W, if G would have more than half as many rows.
    Full(DMatrix<f64>),
}

/// A Newton system for the changes of the scaled impulses and of ln τ, with one additional row.
pub(super) struct BorderedSystem<'a> {
    /// The laws with their derivatives.
    pub laws: &'a [SmoothedLaw],
    pub tau: f64,
    /// Right-hand side: changes of the laws and, last, of the additional row.
    pub right: DVector<f64>,
    /// The additional row.
    pub border: &'a DVector<f64>,
}

impl RegularisedDelassus {
    /// From the scale of the impulses of each contact; `w` returns an entry of W by row and column.
    pub fn new(scales: &[f64], w: impl Fn(usize, usize) -> f64) -> Self {
        let roots: Vec<f64> = scales.iter().map(|scale| scale.sqrt()).collect();
        let n = 3 * roots.len();
        let symmetric = DMatrix::from_fn(n, n, |i, j| w(i, j) * roots[i / 3] * roots[j / 3]);
        let full = || Form::Full(DMatrix::from_fn(n, n, |i, j| w(i, j) * scales[j / 3]));
        let form = low_rank_factor(&symmetric, n / 2).map_or_else(full, Form::LowRank);
        RegularisedDelassus { roots, form }
    }

    /// Velocities for scaled impulses `x`.
    pub fn times(&self, x: &DVector<f64>) -> DVector<f64> {
        let own = x * COMPLIANCE;
        match &self.form {
            Form::Full(w) => w * x + own,
            Form::LowRank(g) => {
                let rooted = |i: usize, x: f64| x * self.roots[i / 3];
                let mut u = g.tr_mul(&(g * x.map_with_location(|i, _, x| rooted(i, x))));
                u.iter_mut().enumerate().for_each(|(i, u)| *u /= self.roots[i / 3]);
                u + own
            }
        }
    }

    /// Changes of the scaled impulses and of ln τ; `None` if the system is singular.
    pub fn solve(&self, system: &BorderedSystem) -> Option<DVector<f64>> {
        match &self.form {
            Form::Full(w) => system.solve_full(w),
            Form::LowRank(g) => system.solve_low_rank(g, &self.roots),
        }
    }
}

/// G with GᵀG = `w`, positive semi-definite, by pivoted Cholesky factorisation; `None` if it has more than
/// `most` rows.
fn low_rank_factor(w: &DMatrix<f64>, most: usize) -> Option<DMatrix<f64>> {
    let mut remaining = w.diagonal();
    let mut rows: Vec<DVector<f64>> = Vec::new();
    loop {
        let (pivot, largest) = remaining.argmax();
        if largest <= ROUNDING {
            break;
        }
        if rows.len() == most {
            return None;
        }
        let mut row = w.column(pivot).into_owned();
        rows.iter().for_each(|above| row.axpy(-above[pivot], above, 1.0));
        row /= largest.sqrt();
        remaining.zip_apply(&row, |remaining, row| *remaining -= row * row);
        remaining[pivot] = 0.0;
        rows.push(row);
    }
    Some(DMatrix::from_fn(rows.len(), w.ncols(), |i, j| rows[i][j]))
}

/// A⁻¹ times the blocks of one contact.
struct Eliminated {
    /// A⁻¹ U.
    by_z: Matrix3<f64>,
    /// A⁻¹ times the derivative by ln τ, rooted.
    by_tau: Vector3<f64>,
    /// A⁻¹ f, rooted.
    right: Vector3<f64>,
}

/// Adds Gᵢ (A⁻¹ U Gᵢᵀ), with the three columns of G of one contact, to the leading block of `sum`, which has one more
/// row and column; all are stored by columns. The order of operations is the same on all processors.
struct AddProduct<'a> {
    own: &'a [f64],
    by_z: &'a [f64],
    sum: &'a mut [f64],
}

impl WithSimd for AddProduct<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        let k = self.own.len() / 3;
        let [first, second, third] = [0, 1, 2].map(|c| &self.own[c * k..][..k]);
        for (j, column) in self.sum.chunks_exact_mut(k + 1).take(k).enumerate() {
            let [a, b, c] = [self.by_z[j], self.by_z[k + j], self.by_z[2 * k + j]];
            for (((sum, x), y), z) in column.iter_mut().zip(first).zip(second).zip(third) {
                *sum += x * a + y * b + z * c;
            }
        }
    }
}

impl BorderedSystem<'_> {
    /// Block A of a contact: the derivative of its law by its own impulse, without W.
    fn own_block(law: &SmoothedLaw) -> Matrix3<f64> {
        law.by_r + law.by_u * COMPLIANCE + Matrix3::identity() * RIDGE
    }

    /// Solves with W itself.
    fn solve_full(&self, w: &DMatrix<f64>) -> Option<DVector<f64>> {
        let n = w.nrows();
        let mut system = DMatrix::zeros(n + 1, n + 1);
        for (k, law) in self.laws.iter().enumerate() {
            let mut rows = system.fixed_rows_mut::<3>(3 * k);
            rows.columns_mut(0, n).gemm(1.0, &law.by_u, &w.fixed_rows::<3>(3 * k), 0.0);
            let mut own = rows.fixed_columns_mut::<3>(3 * k);
            own += Self::own_block(law);
            rows.set_column(n, &(law.by_tau * self.tau));
        }
        system.row_mut(n).tr_copy_from(self.border);
        system.lu().solve(&self.right)
    }

    /// Solves with the factor `g` of W, in its number of rows.
    fn solve_low_rank(&self, g: &DMatrix<f64>, roots: &[f64]) -> Option<DVector<f64>> {
        let (k, n) = g.shape();
        let mut system = DMatrix::identity(k + 1, k + 1);
        let mut right = DVector::zeros(k + 1);
        (system[(k, k)], right[k]) = (self.border[n], self.right[n]);
        let mut eliminated = Vec::with_capacity(roots.len());
        let (mut by_z, mut border) = (DMatrix::zeros(k, 3), DVector::zeros(k));
        let arch = Arch::new();
        for (i, (law, root)) in self.laws.iter().zip(roots).enumerate() {
            let contact = self.eliminate(i, law, *root)?;
            let along: Vector3<f64> = self.border.fixed_rows::<3>(3 * i) / *root;
            let own = g.fixed_columns::<3>(3 * i);
            by_z.gemm(1.0, &own, &contact.by_z.transpose(), 0.0);
            arch.dispatch(AddProduct {
                own: &g.as_slice()[3 * i * k..][..3 * k],
                by_z: by_z.as_slice(),
                sum: system.as_mut_slice(),
            });
            system.column_mut(k).rows_mut(0, k).gemv(1.0, &own, &contact.by_tau, 1.0);
            right.rows_mut(0, k).gemv(1.0, &own, &contact.right, 1.0);
            border.gemv(-1.0, &by_z, &along, 1.0);
            system[(k, k)] -= along.dot(&contact.by_tau);
            right[k] -= along.dot(&contact.right);
            eliminated.push(contact);
        }
        system.view_mut((k, 0), (1, k)).tr_copy_from(&border);
        let z = system.lu().solve(&right)?;
        let velocities = g.tr_mul(&z.rows(0, k));
        let mut x = DVector::zeros(n + 1);
        for (i, (contact, root)) in eliminated.iter().zip(roots).enumerate() {
            let own =
                contact.right - contact.by_z * velocities.fixed_rows::<3>(3 * i) - contact.by_tau * z[k];
            x.fixed_rows_mut::<3>(3 * i).copy_from(&(own / *root));
        }
        x[n] = z[k];
        Some(x)
    }

    fn eliminate(&self, i: usize, law: &SmoothedLaw, root: f64) -> Option<Eliminated> {
        let inverse = Self::own_block(law).try_inverse()?;
        Some(Eliminated {
            by_z: inverse * law.by_u,
            by_tau: inverse * law.by_tau * (self.tau * root),
            right: inverse * self.right.fixed_rows::<3>(3 * i) * root,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::random::Random;

    #[test]
    fn low_rank_and_full_systems_have_the_same_solution() {
        let mut random = Random::new(31);
        for contacts in [4, 9, 20] {
            let n = 3 * contacts;
            let rows = DMatrix::from_fn(n, 5, |_, _| random.draw());
            let w = &rows * rows.transpose();
            let traces = (0..contacts).map(|i| w.fixed_view::<3, 3>(3 * i, 3 * i).trace());
            let scales: Vec<f64> = traces.map(|trace| 3.0 / trace).collect();
            let delassus = RegularisedDelassus::new(&scales, |i, j| w[(i, j)]);
            let Form::LowRank(g) = &delassus.form else { panic!("{contacts} contacts have full rank") };
            assert_eq!(g.nrows(), 5);
            let full = DMatrix::from_fn(n, n, |i, j| w[(i, j)] * scales[j / 3]);
            let x = DVector::from_fn(n, |_, _| random.draw());
            let difference = delassus.times(&x) - (&full * &x + &x * COMPLIANCE);
            assert!(difference.norm() < 1e-12 * n as f64, "{}", difference.norm());
            let law = |_| SmoothedLaw {
                value: Vector3::zeros(),
                by_r: Matrix3::from_fn(|_, _| random.draw()),
                by_u: Matrix3::from_fn(|_, _| random.draw()),
                by_tau: random.vector(),
            };
            let laws: Vec<SmoothedLaw> = (0..contacts).map(law).collect();
            let [right, border] = [0, 1].map(|_| DVector::from_fn(n + 1, |_, _| random.draw()));
            let system = BorderedSystem { laws: &laws, tau: 0.3, right, border: &border };
            let [small, large] = [delassus.solve(&system), system.solve_full(&full)].map(Option::unwrap);
            let difference = (&small - &large).norm() / large.norm();
            assert!(difference < 1e-8, "{contacts} contacts: {difference}");
        }
    }

    #[test]
    fn an_operator_of_full_rank_is_not_factored() {
        let delassus = RegularisedDelassus::new(&[1.0, 1.0], |i, j| f64::from(u8::from(i == j)));
        assert!(matches!(delassus.form, Form::Full(_)));
    }
}
