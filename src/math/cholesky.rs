//! Dense Cholesky factorisation in place, in a fixed order of operations.
//!
//! For the few dozen unknowns of a rod. A library kernel selects its instructions at run time, so that the
//! bits of a bake would depend on the machine.

use super::lanes::{Mask, Real};

/// Factors the lower triangle of the row-major `n × n` matrix `a` as L Lᵀ, in place (the diagonal of L is
/// stored inverted). Returns the lanes in which `a` is positive definite; the factor is invalid in the
/// others.
#[inline(always)]
pub fn factor<F: Real>(a: &mut [F], n: usize) -> Mask {
    debug_assert_eq!(a.len(), n * n);
    let mut positive = F::ALL;
    // By columns, whose entries are independent of each other.
    for j in 0..n {
        let (above, below) = a.split_at_mut((j + 1) * n);
        let row = &mut above[j * n..j * n + j + 1];
        let d = less_dot(row[j], &row[..j], &row[..j]);
        // False for NaN, too.
        positive &= (row[j].abs() * 1e-14).below(d);
        row[j] = d.same(1.0) / d.sqrt();
        for other in below.chunks_exact_mut(n) {
            other[j] = less_dot(other[j], &other[..j], &row[..j]) * row[j];
        }
    }
    positive
}

/// [`factor`] of a positive semi-definite matrix. A row that depends on those before it, up to `share` of its
/// diagonal, is left out: [`solve`] sets its unknown to zero.
pub fn factor_semidefinite(a: &mut [f64], n: usize, share: f64) {
    debug_assert_eq!(a.len(), n * n);
    for j in 0..n {
        let (above, below) = a.split_at_mut((j + 1) * n);
        let row = &mut above[j * n..j * n + j + 1];
        let d = less_dot(row[j], &row[..j], &row[..j]);
        row[j] = if d > share * row[j] { 1.0 / d.sqrt() } else { 0.0 };
        for other in below.chunks_exact_mut(n) {
            other[j] = less_dot(other[j], &other[..j], &row[..j]) * row[j];
        }
    }
}

/// Solves L Lᵀ x = b in place, with `a` from [`factor`].
#[inline(always)]
pub fn solve<F: Real>(a: &[F], n: usize, b: &mut [F]) {
    solve_lower(a, n, b);
    solve_upper(a, n, b);
}

/// Solves Lᵀ x = b in place, with `a` from [`factor`].
#[inline(always)]
pub fn solve_upper<F: Real>(a: &[F], n: usize, b: &mut [F]) {
    for j in (0..n).rev() {
        let (b, x) = b.split_at_mut(j);
        let row = &a[j * n..j * n + j + 1];
        x[0] = x[0] * row[j];
        for (b, l) in b.iter_mut().zip(row) {
            *b -= *l * x[0];
        }
    }
}

/// Solves L y = b in place, with `a` from [`factor`].
#[inline(always)]
pub fn solve_lower<F: Real>(a: &[F], n: usize, b: &mut [F]) {
    for j in 0..n {
        let row = &a[j * n..j * n + j + 1];
        b[j] = less_dot(b[j], &row[..j], &b[..j]) * row[j];
    }
}

/// a · b.
#[inline(always)]
pub fn dot(a: &[f64], b: &[f64]) -> f64 {
    -less_dot(0.0, a, b)
}

/// x − a · b, summed in four fixed chains.
#[inline(always)]
pub fn less_dot<F: Real>(x: F, a: &[F], b: &[F]) -> F {
    let mut chain = [x.same(0.0); 4];
    let (ca, cb) = (a.chunks_exact(4), b.chunks_exact(4));
    let mut rest = x;
    for (a, b) in ca.remainder().iter().zip(cb.remainder()) {
        rest -= *a * *b;
    }
    for (a, b) in ca.zip(cb) {
        for i in 0..4 {
            chain[i] += a[i] * b[i];
        }
    }
    rest - ((chain[0] + chain[1]) + (chain[2] + chain[3]))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_that_depend_on_others_are_left_out() {
        let g = nalgebra::DMatrix::from_fn(5, 4, |i, j| ((i * j * 7 + i * 3 + j * 11) as f64).sin());
        let spsd = &g * g.transpose();
        let x = nalgebra::DVector::from_column_slice(&[1.0, -2.0, 0.5, 3.0, 0.0]);
        let b = &spsd * &x;
        let mut a = spsd.as_slice().to_vec();
        factor_semidefinite(&mut a, 5, 1e-10);
        let mut found = b.as_slice().to_vec();
        solve(&a, 5, &mut found);
        assert!((nalgebra::DVector::from_vec(found) - x).norm() < 1e-9);
    }

    #[test]
    fn solutions_satisfy_the_system() {
        for n in [1, 3, 4, 21, 60] {
            let g = nalgebra::DMatrix::from_fn(n, n, |i, j| ((i * 31 + j * 17) as f64).sin());
            let spd = &g * g.transpose() + nalgebra::DMatrix::identity(n, n) * 0.1;
            let b = nalgebra::DVector::from_fn(n, |i, _| (i as f64).cos());
            let mut a: Vec<f64> = spd.transpose().as_slice().to_vec();
            let mut x = b.as_slice().to_vec();
            assert_eq!(factor(&mut a, n), 1);
            solve(&a, n, &mut x);
            let r = &spd * nalgebra::DVector::from_column_slice(&x) - b;
            assert!(r.norm() < 1e-9, "{n}: {}", r.norm());
        }
    }

    #[test]
    fn solutions_agree_with_those_of_a_library_for_large_matrices() {
        use faer::linalg::solvers::Solve;
        for n in [21, 96, 300] {
            let g = faer::Mat::from_fn(n, n, |i, j| ((i * 31 + j * 17) as f64).sin());
            let mut spd = &g * g.transpose();
            (0..n).for_each(|i| spd[(i, i)] += 0.1);
            let b = faer::Col::from_fn(n, |i| (i as f64).cos());
            let expected = spd.llt(faer::Side::Lower).unwrap().solve(&b);
            let mut a: Vec<f64> = (0..n * n).map(|k| spd[(k / n, k % n)]).collect();
            let mut x: Vec<f64> = b.iter().copied().collect();
            assert_eq!(factor(&mut a, n), 1);
            solve(&a, n, &mut x);
            let size = expected.norm_max();
            for (found, expected) in x.iter().zip(expected.iter()) {
                assert!((found - expected).abs() < 1e-9 * size, "{n}: {found} {expected}");
            }
        }
    }

    #[test]
    fn indefinite_and_nan_matrices_are_rejected() {
        assert_eq!(factor(&mut [1.0, 0.0, 2.0, 1.0], 2), 0);
        assert_eq!(factor(&mut [f64::NAN], 1), 0);
    }
}
