//! Dense Cholesky factorisation in place, in a fixed order of operations.
//!
//! For the few dozen unknowns of a rod. A library kernel would pick its instructions at run time, and the
//! bits of a bake would then depend on the machine that ran it.

/// Factors the lower triangle of the row-major `n × n` matrix `a` as L Lᵀ, in place (the diagonal of L is stored
/// inverted). Returns `false`, with `a` spoiled, where `a` is not positive definite.
pub fn factor(a: &mut [f64], n: usize) -> bool {
    debug_assert_eq!(a.len(), n * n);
    for j in 0..n {
        let (above, rest) = a.split_at_mut(j * n);
        let row = &mut rest[..j + 1];
        for k in 0..j {
            let lk = &above[k * n..k * n + k];
            let s = row[k] - dot(&row[..k], lk);
            row[k] = s * above[k * n + k];
        }
        let d = row[j] - dot(&row[..j], &row[..j]);
        // False for NaN too.
        let positive = d > row[j].abs() * 1e-14;
        if !positive {
            return false;
        }
        row[j] = 1.0 / d.sqrt();
    }
    true
}

/// Solves L Lᵀ x = b in place, with `a` from [`factor`].
pub fn solve(a: &[f64], n: usize, b: &mut [f64]) {
    solve_lower(a, n, b);
    solve_upper(a, n, b);
}

/// Solves Lᵀ x = b in place, with `a` from [`factor`].
pub fn solve_upper(a: &[f64], n: usize, b: &mut [f64]) {
    for j in (0..n).rev() {
        b[j] *= a[j * n + j];
        let x = b[j];
        for k in 0..j {
            b[k] -= a[j * n + k] * x;
        }
    }
}

/// Solves L y = b in place, with `a` from [`factor`].
pub fn solve_lower(a: &[f64], n: usize, b: &mut [f64]) {
    for j in 0..n {
        let row = &a[j * n..j * n + j];
        b[j] = (b[j] - dot(row, &b[..j])) * a[j * n + j];
    }
}

/// a · b, summed in four fixed lanes.
pub fn dot(a: &[f64], b: &[f64]) -> f64 {
    let mut lane = [0.0; 4];
    let (ca, cb) = (a.chunks_exact(4), b.chunks_exact(4));
    let tail: f64 = ca.remainder().iter().zip(cb.remainder()).map(|(x, y)| x * y).sum();
    for (x, y) in ca.zip(cb) {
        for i in 0..4 {
            lane[i] += x[i] * y[i];
        }
    }
    (lane[0] + lane[1]) + (lane[2] + lane[3]) + tail
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn solves_what_nalgebra_solves() {
        for n in [1, 3, 4, 21, 60] {
            let g = nalgebra::DMatrix::from_fn(n, n, |i, j| ((i * 31 + j * 17) as f64).sin());
            let spd = &g * g.transpose() + nalgebra::DMatrix::identity(n, n) * 0.1;
            let b = nalgebra::DVector::from_fn(n, |i, _| (i as f64).cos());
            let mut a: Vec<f64> = spd.transpose().as_slice().to_vec();
            let mut x = b.as_slice().to_vec();
            assert!(factor(&mut a, n));
            solve(&a, n, &mut x);
            let r = &spd * nalgebra::DVector::from_column_slice(&x) - b;
            assert!(r.norm() < 1e-9, "{n}: {}", r.norm());
        }
    }

    #[test]
    fn refuses_indefinite_and_nan() {
        assert!(!factor(&mut [1.0, 0.0, 2.0, 1.0], 2));
        assert!(!factor(&mut [f64::NAN], 1));
    }
}
