//! Integrals of products of hat functions, and solves with them.

use nalgebra::Vector3;

/// ∫ N_i N_i σ ds and ∫ N_i N_{i+1} σ ds for the first `count` nodes: all, or all but the tip, m. `sigma` is a function of the
/// arc-length fraction. Exact for σ of degree up to 7 (five-point Gauss rule; Abramowitz & Stegun 1964, table
/// 25.4).
pub(super) fn hat_matrix(nodes: &[f64], count: usize, sigma: impl Fn(f64) -> f64) -> Vec<[f64; 2]> {
    const HALF: [(f64, f64); 3] = [
        (0.0, 0.568_888_888_888_888_9),
        (0.538_469_310_105_683_1, 0.478_628_670_499_366_47),
        (0.906_179_845_938_664, 0.236_926_885_056_189_08),
    ];
    let length = nodes[nodes.len() - 1];
    let abscissae = HALF.iter().flat_map(|&(x, w)| [(0.5 - 0.5 * x, w), (0.5 + 0.5 * x, w)]).skip(1);
    // ∫ of the falling hat squared, of the product of both, and of the rising hat squared.
    let element = |i: usize| {
        if i + 1 == nodes.len() {
            return [0.0; 3];
        }
        let (from, l) = (nodes[i], nodes[i + 1] - nodes[i]);
        abscissae.clone().fold([0.0; 3], |[a, b, c], (u, w)| {
            let w = 0.5 * w * l * sigma((from + u * l) / length);
            [a + w * (1.0 - u) * (1.0 - u), b + w * u * (1.0 - u), c + w * u * u]
        })
    };
    let mut before = 0.0;
    let entry = |i: usize| {
        let [a, b, c] = element(i);
        [a + std::mem::replace(&mut before, c), b]
    };
    (0..count).map(entry).collect()
}

/// Solves the symmetric tridiagonal system of [`hat_matrix`] for `rhs` in place.
pub(super) fn solve_hat(hat: &[[f64; 2]], rhs: &mut [Vector3<f64>]) {
    let n = rhs.len();
    let mut diag: Vec<f64> = hat[..n].iter().map(|m| m[0]).collect();
    for i in 1..n {
        let f = hat[i - 1][1] / diag[i - 1];
        diag[i] -= f * hat[i - 1][1];
        let prev = rhs[i - 1];
        rhs[i] -= prev * f;
    }
    for i in (0..n).rev() {
        if i + 1 < n {
            let next = rhs[i + 1];
            rhs[i] -= next * hat[i][1];
        }
        rhs[i] /= diag[i];
    }
}

#[cfg(test)]
mod tests {
    use super::hat_matrix;

    #[test]
    fn tapered_hat_integrals_are_exact() {
        let nodes = [0.0, 0.03, 0.07, 0.13];
        let hat = |i: usize, s: f64| {
            let side =
                |a: f64, b: f64| if (a.min(b)..a.max(b)).contains(&s) { (s - a) / (b - a) } else { 0.0 };
            let rising = if i > 0 { side(nodes[i - 1], nodes[i]) } else { 0.0 };
            rising + if i + 1 < nodes.len() { side(nodes[i + 1], nodes[i]) } else { 0.0 }
        };
        let linear = |tip: f64, u: f64| 1.0 + (tip - 1.0) * u;
        let sigma = |u: f64| linear(0.2, u) * linear(1.3, u).powi(4) * linear(3.0, u);
        let (n, found) = (130_000, hat_matrix(&nodes, 3, sigma));
        for (i, row) in found.iter().enumerate() {
            for (j, found) in row.iter().enumerate() {
                let sum: f64 = (0..n)
                    .map(|k| (k as f64 + 0.5) / n as f64 * 0.13)
                    .map(|s| hat(i, s) * hat(i + j, s) * sigma(s / 0.13))
                    .sum();
                assert!((sum * 0.13 / n as f64 - found).abs() < 1e-7 * found.max(1e-3), "{i} {j}");
            }
        }
        let l = |i: usize| nodes[i + 1] - nodes[i];
        let plain = hat_matrix(&nodes, 3, |_| 1.0);
        let whole = hat_matrix(&nodes, 4, |_| 1.0);
        assert_eq!(whole[..3], plain);
        assert!((whole[3][0] / (l(2) / 3.0) - 1.0).abs() < 1e-15 && whole[3][1] == 0.0, "{whole:?}");
        let exact = [[l(0) / 3.0, l(0) / 6.0], [(l(1) + l(0)) / 3.0, l(1) / 6.0]];
        for (plain, exact) in plain.iter().zip(exact).flat_map(|(a, b)| a.iter().copied().zip(b)) {
            assert!((plain / exact - 1.0).abs() < 1e-15);
        }
    }
}
