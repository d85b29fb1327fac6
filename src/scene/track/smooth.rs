//! Low-pass filter of tracks: penalised least squares (Whittaker 1923; Eilers 2003, "A perfect smoother"),
//! z = argmin Σ w_i |y_i − z_i|² + λ Σ |Δ³z_i|².
//!
//! The penalty on third differences leaves quadratics unchanged, so a constant acceleration passes up to the
//! ends of the track. On a long track with unit weights a wave of frequency f, cycles per sample, has the
//! gain 1 / (1 + λ (2 sin πf)⁶): flat up to the cutoff, without phase shift. Samples of weight zero are
//! bridged. The normal equations are banded; one LDLᵀ factorisation in a fixed order gives the same bits on
//! every machine.

use nalgebra::SVector;

/// Coefficients of the third difference.
const DELTA3: [f64; 4] = [-1.0, 3.0, -3.0, 1.0];

/// Largest λ: a larger one would lose the weights in rounding. It is that of a wave of 292 samples.
const MAX_PENALTY: f64 = 1e10;

/// The λ for which half of the amplitude passes at the frequency `f`, cycles per sample, below ½. Slower
/// frequencies are taken as the slowest that can be solved.
pub fn penalty(f: f64) -> f64 {
    (2.0 * (std::f64::consts::PI * f).sin()).powi(-6).min(MAX_PENALTY)
}

/// The filtered sequence. `weights`: one per value, not negative, at least three positive. Fewer than four
/// values are returned unchanged.
pub fn whittaker<const D: usize>(
    y: &[SVector<f64, D>],
    weights: &[f64],
    lambda: f64,
) -> Vec<SVector<f64, D>> {
    let n = y.len();
    if n < DELTA3.len() {
        return y.to_vec();
    }
    // Row i holds A[i][i − 3 ..= i]; the factorisation replaces it by the row of L, with D on the diagonal.
    let mut band = vec![[0.0; 4]; n];
    for (row, &w) in band.iter_mut().zip(weights) {
        row[3] = w;
    }
    for start in 0..=n - DELTA3.len() {
        for (i, a) in DELTA3.iter().enumerate() {
            for (j, b) in DELTA3[..=i].iter().enumerate() {
                band[start + i][3 + j - i] += lambda * a * b;
            }
        }
    }
    let mut z: Vec<_> = y.iter().zip(weights).map(|(y, &w)| y * w).collect();
    for i in 0..n {
        for j in i.saturating_sub(3)..=i {
            let mut a = band[i][3 + j - i];
            for k in i.saturating_sub(3)..j {
                if k + 3 >= j {
                    a -= band[i][3 + k - i] * band[j][3 + k - j] * band[k][3];
                }
            }
            band[i][3 + j - i] = if j < i { a / band[j][3] } else { a };
        }
        for j in i.saturating_sub(3)..i {
            let known = z[j];
            z[i] -= known * band[i][3 + j - i];
        }
    }
    for i in (0..n).rev() {
        z[i] /= band[i][3];
        for j in i + 1..n.min(i + 4) {
            let known = z[j];
            z[i] -= known * band[j][3 + i - j];
        }
    }
    z
}
