//! Constrained relaxation of a chain that no sequence of single-edge rotations brings out of a body (the fold
//! of an ear).

use nalgebra::Vector3;

/// Number of sweeps. Fixed, so that the result is as smooth in time as its start.
const SWEEPS: usize = 30;

/// Alternates `push` (vertex and position to position) on all vertices `x`, m, with restoring the edges to
/// their `length`, m: from vertex `last` to the root, then from the root to the tip (FABRIK; Aristidou &
/// Lasenby 2011). The root stays; the final lengths are exact.
pub(super) fn relax(
    x: &mut [Vector3<f64>],
    length: &[f64],
    last: usize,
    push: impl Fn(usize, &Vector3<f64>) -> Vector3<f64>,
) {
    // An edge of zero length needs no direction.
    let at_length = |from: Vector3<f64>, towards: Vector3<f64>, length: f64| {
        from + (towards - from).try_normalize(0.0).unwrap_or_default() * length
    };
    for _ in 0..SWEEPS {
        for (k, x) in x.iter_mut().enumerate().skip(1) {
            *x = push(k, x);
        }
        for k in (1..last).rev() {
            x[k] = at_length(x[k + 1], x[k], length[k]);
        }
        for k in 1..x.len() {
            x[k] = at_length(x[k - 1], x[k], length[k - 1]);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn chain_inside_a_ball_comes_out_with_exact_lengths() {
        // A straight chain from a root on the ball to 2 cm inside. No edge of 5 mm comes out by rotation
        // alone.
        let (radius, n) = (0.05, 24);
        let root = Vector3::x() * radius;
        let mut x: Vec<_> = (0..n).map(|k| root - Vector3::new(0.6, 0.8, 0.0) * (0.005 * k as f64)).collect();
        let mut length = vec![0.005; n - 1];
        // Real strands have edges of zero length.
        (x[7], length[6]) = (x[6], 0.0);
        (7..n - 1).for_each(|k| x[k + 1] = x[k] - Vector3::new(0.6, 0.8, 0.0) * 0.005);
        let depth = |x: &Vector3<f64>| radius - x.norm();
        let deepest = |x: &[Vector3<f64>]| x.iter().map(depth).fold(0.0, f64::max);
        assert!(deepest(&x) > 0.008, "{}", deepest(&x));
        relax(&mut x, &length, n - 1, |_, x| if depth(x) > 0.0 { x.normalize() * radius } else { *x });
        assert!(deepest(&x) < 2e-4, "{}", deepest(&x));
        assert_eq!(x[0], root);
        for (x, length) in x.windows(2).zip(&length) {
            assert!(((x[1] - x[0]).norm() - length).abs() < 1e-12);
        }
    }
}
