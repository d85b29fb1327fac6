//! How contacts that take part move each other, and the systems of Newton's method with that.
//!
//! Contacts of one strand often have many more components than the strand has unknowns: W has a factor, W = GᵀG, of few rows. A system (A + U W) δ = f, A and U
//! being of blocks of single contacts, then is one for z = G δ, as small as that: (1 + G A⁻¹U Gᵀ) z = G A⁻¹ f and A δ = f − U Gᵀ z.

use super::rounded::Rounded;
use nalgebra::{DMatrix, DVector, Matrix3, Vector3};

/// How far a contact gives way, as a share of its own mobility.
pub(super) const COMPLIANCE: f64 = 1e-6;

/// What is added to the diagonal of a system, whose own size is 1: forces that balance each other and move nothing stay as they are.
const RIDGE: f64 = 1e-9;

/// What is left of a diagonal of size 1 where W has been factored: rounding.
const ROUNDING: f64 = 1e-12;

/// Impulses to velocities, both scaled so that each contact's own block has a trace of 3, and gives way by [`COMPLIANCE`] beside that.
pub(super) struct Mobility {
    /// Of each contact the root of what scales its block: makes the scaled W symmetric.
    roots: Vec<f64>,
    form: Form,
}

enum Form {
    /// G of the symmetric W.
    Thin(DMatrix<f64>),
    /// W where it has no factor of half as many rows, not symmetric but as it is scaled.
    Full(DMatrix<f64>),
}

/// A system of Newton's method along a border: of changes of the scaled impulses and of ln τ.
pub(super) struct Bordered<'a> {
    /// The laws, with their derivatives.
    pub laws: &'a [Rounded],
    pub tau: f64,
    /// What the laws are to change by and, last, the change along the border.
    pub right: DVector<f64>,
    /// The last row.
    pub border: &'a DVector<f64>,
}

impl Mobility {
    /// Of blocks scaled by `scales`, one a contact; `w` tells an entry of W by row and column.
    pub fn new(scales: &[f64], w: impl Fn(usize, usize) -> f64) -> Self {
        let roots: Vec<f64> = scales.iter().map(|scale| scale.sqrt()).collect();
        let n = 3 * roots.len();
        let symmetric = DMatrix::from_fn(n, n, |i, j| w(i, j) * roots[i / 3] * roots[j / 3]);
        let form = thin_factor(&symmetric, n / 2)
            .map_or_else(|| Form::Full(DMatrix::from_fn(n, n, |i, j| w(i, j) * scales[j / 3])), Form::Thin);
        Mobility { roots, form }
    }

    /// Velocities of impulses `x`.
    pub fn times(&self, x: &DVector<f64>) -> DVector<f64> {
        let own = x * COMPLIANCE;
        match &self.form {
            Form::Full(w) => w * x + own,
            Form::Thin(g) => {
                let rooted = |i: usize, x: f64| x * self.roots[i / 3];
                let mut u = g.tr_mul(&(g * x.map_with_location(|i, _, x| rooted(i, x))));
                u.iter_mut().enumerate().for_each(|(i, u)| *u /= self.roots[i / 3]);
                u + own
            }
        }
    }

    /// Changes of the impulses and of ln τ, if they are determined.
    pub fn solve(&self, system: &Bordered) -> Option<DVector<f64>> {
        match &self.form {
            Form::Full(w) => system.solve_with(w),
            Form::Thin(g) => system.solve_within(g, &self.roots),
        }
    }
}

/// G of GᵀG = `w`, which is positive semi-definite, by Cholesky's method with pivots; `None` if it has more than `most` rows.
fn thin_factor(w: &DMatrix<f64>, most: usize) -> Option<DMatrix<f64>> {
    let mut left = w.diagonal();
    let mut rows: Vec<DVector<f64>> = Vec::new();
    loop {
        let (pivot, largest) = left.argmax();
        if largest <= ROUNDING {
            break;
        }
        if rows.len() == most {
            return None;
        }
        let mut row = w.column(pivot).into_owned();
        rows.iter().for_each(|above| row.axpy(-above[pivot], above, 1.0));
        row /= largest.sqrt();
        left.zip_apply(&row, |left, row| *left -= row * row);
        left[pivot] = 0.0;
        rows.push(row);
    }
    Some(DMatrix::from_fn(rows.len(), w.ncols(), |i, j| rows[i][j]))
}

impl Bordered<'_> {
    /// What a law's derivative by its own impulse is: A.
    fn own(law: &Rounded) -> Matrix3<f64> {
        law.by_r + law.by_u * COMPLIANCE + Matrix3::identity() * RIDGE
    }

    /// With W as it is.
    fn solve_with(&self, w: &DMatrix<f64>) -> Option<DVector<f64>> {
        let n = w.nrows();
        let mut system = DMatrix::zeros(n + 1, n + 1);
        for (k, law) in self.laws.iter().enumerate() {
            let mut rows = system.fixed_rows_mut::<3>(3 * k);
            rows.columns_mut(0, n).gemm(1.0, &law.by_u, &w.fixed_rows::<3>(3 * k), 0.0);
            let mut own = rows.fixed_columns_mut::<3>(3 * k);
            own += Self::own(law);
            rows.set_column(n, &(law.by_tau * self.tau));
        }
        system.row_mut(n).tr_copy_from(self.border);
        system.lu().solve(&self.right)
    }

    /// With its factor `g`.
    fn solve_within(&self, g: &DMatrix<f64>, roots: &[f64]) -> Option<DVector<f64>> {
        let (k, n) = g.shape();
        let mut system = DMatrix::identity(k + 1, k + 1);
        let mut right = DVector::zeros(k + 1);
        (system[(k, k)], right[k]) = (self.border[n], self.right[n]);
        // Of each contact A⁻¹U, and A⁻¹ times what multiplies ln τ and what is wanted.
        let mut solved = Vec::with_capacity(roots.len());
        let (mut row, mut border) = (DVector::zeros(k), DVector::zeros(k));
        for (i, (law, root)) in self.laws.iter().zip(roots).enumerate() {
            let inverse = Self::own(law).try_inverse()?;
            let by_z = inverse * law.by_u;
            let by_tau = inverse * law.by_tau * (self.tau * root);
            let wanted = inverse * self.right.fixed_rows::<3>(3 * i) * *root;
            let along: Vector3<f64> = self.border.fixed_rows::<3>(3 * i) / *root;
            for c in 0..3 {
                row.fill(0.0);
                (0..3).for_each(|d| row.axpy(by_z[(c, d)], &g.column(3 * i + d), 1.0));
                let own = g.column(3 * i + c);
                system.view_mut((0, 0), (k, k)).ger(1.0, &own, &row, 1.0);
                system.column_mut(k).rows_mut(0, k).axpy(by_tau[c], &own, 1.0);
                right.rows_mut(0, k).axpy(wanted[c], &own, 1.0);
                border.axpy(-along[c], &row, 1.0);
            }
            system[(k, k)] -= along.dot(&by_tau);
            right[k] -= along.dot(&wanted);
            solved.push((by_z, by_tau, wanted));
        }
        system.view_mut((k, 0), (1, k)).tr_copy_from(&border);
        let z = system.lu().solve(&right)?;
        let moved = g.tr_mul(&z.rows(0, k));
        let mut x = DVector::zeros(n + 1);
        for (i, ((by_z, by_tau, wanted), root)) in solved.iter().zip(roots).enumerate() {
            let own = wanted - by_z * moved.fixed_rows::<3>(3 * i) - by_tau * z[k];
            x.fixed_rows_mut::<3>(3 * i).copy_from(&(own / *root));
        }
        x[n] = z[k];
        Some(x)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::random::Random;

    #[test]
    fn the_small_system_is_the_large_one() {
        let mut random = Random::new(31);
        for contacts in [4, 9, 20] {
            let n = 3 * contacts;
            let rows = DMatrix::from_fn(n, 5, |_, _| random.draw());
            let w = &rows * rows.transpose();
            let traces = (0..contacts).map(|i| w.fixed_view::<3, 3>(3 * i, 3 * i).trace());
            let scales: Vec<f64> = traces.map(|trace| 3.0 / trace).collect();
            let mobility = Mobility::new(&scales, |i, j| w[(i, j)]);
            let Form::Thin(g) = &mobility.form else { panic!("{contacts} contacts have no thin factor") };
            assert_eq!(g.nrows(), 5);
            let full = DMatrix::from_fn(n, n, |i, j| w[(i, j)] * scales[j / 3]);
            let x = DVector::from_fn(n, |_, _| random.draw());
            let apart = mobility.times(&x) - (&full * &x + &x * COMPLIANCE);
            assert!(apart.norm() < 1e-12 * n as f64, "{}", apart.norm());
            // Of contacts that are held A is no more than what they give way by: rounding counts a million times there.
            for (held, exact) in [(0, 1e-8), (contacts / 2, 1e-6), (contacts, 1e-6)] {
                let law = |i: usize| match i {
                    i if i < held => Rounded::held(&Vector3::zeros()),
                    _ => Rounded {
                        value: Vector3::zeros(),
                        by_r: Matrix3::from_fn(|_, _| random.draw()),
                        by_u: Matrix3::from_fn(|_, _| random.draw()),
                        by_tau: random.vector(),
                    },
                };
                let laws: Vec<Rounded> = (0..contacts).map(law).collect();
                let [right, border] = [0, 1].map(|_| DVector::from_fn(n + 1, |_, _| random.draw()));
                let system = Bordered { laws: &laws, tau: 0.3, right, border: &border };
                let [small, large] = [mobility.solve(&system), system.solve_with(&full)].map(Option::unwrap);
                let apart = (&small - &large).norm() / large.norm();
                assert!(apart < exact, "{contacts} contacts, {held} held: {apart}");
            }
        }
    }

    #[test]
    fn what_has_no_thin_factor_is_left_full() {
        let mobility = Mobility::new(&[1.0, 1.0], |i, j| f64::from(u8::from(i == j)));
        assert!(matches!(mobility.form, Form::Full(_)));
    }
}
