//! Anderson acceleration of fixed-point iterations.

use crate::math::cholesky::dot;
use nalgebra::{SMatrix, SVector};

/// Number of previous iterations used. Five are nearly as good, twenty hardly better.
const DEPTH: usize = 8;

/// Ridge on the diagonal of the normal matrix, as a fraction of its trace, against nearly dependent
/// iterations.
const RIDGE: f64 = 1e-12;

/// Maximum growth of the change from one iteration to the next; beyond it the history belongs to another
/// problem.
const GROWTH: f64 = 1.5;

/// Acceleration of x ← g(x): of all affine combinations of the last images, the one whose changes g(x) − x
/// nearly cancel (D. G. Anderson, "Iterative procedures for nonlinear integral equations", 1965). For linear
/// g it is equivalent to GMRES (H. F. Walker & P. Ni, 2011).
#[derive(Debug, Default)]
pub(super) struct Anderson {
    image: Vec<f64>,
    change: Vec<f64>,
    /// Differences of successive images, in a ring buffer.
    images: [Vec<f64>; DEPTH],
    /// Differences of successive changes, in a ring buffer.
    changes: [Vec<f64>; DEPTH],
    /// changesᵀ changes.
    gram: SMatrix<f64, DEPTH, DEPTH>,
    iterations: usize,
}

impl Anderson {
    /// Discards the history.
    pub fn clear(&mut self) {
        self.iterations = 0;
    }

    /// Replaces the image `y` of `x` by the combination. All iterations since [`Anderson::clear`] must have
    /// the same length.
    #[inline(always)]
    pub fn accelerate(&mut self, x: &[f64], y: &mut [f64]) {
        let change = || y.iter().zip(x).map(|(y, x)| y - x);
        let grown = change().map(|c| c * c).sum::<f64>() > GROWTH * GROWTH * dot(&self.change, &self.change);
        if self.iterations > 0 && grown {
            self.iterations = 0;
        }
        if self.iterations > 0 {
            let at = (self.iterations - 1) % DEPTH;
            replace(&mut self.images[at], y.iter().zip(&self.image).map(|(new, old)| new - old));
            replace(&mut self.changes[at], change().zip(&self.change).map(|(new, old)| new - old));
        }
        self.image.clear();
        self.image.extend_from_slice(y);
        replace(&mut self.change, y.iter().zip(x).map(|(y, x)| y - x));
        self.iterations += 1;
        let held = (self.iterations - 1).min(DEPTH);
        if held > 0 {
            self.combine((self.iterations - 2) % DEPTH, held, y);
        }
    }

    /// Subtracts from `y` the combination of the `held` differences of images whose changes best fit the last
    /// change. The difference at `newest` is not yet in the normal matrix.
    #[inline(always)]
    fn combine(&mut self, newest: usize, held: usize, y: &mut [f64]) {
        if held == 1 {
            self.gram = SMatrix::identity();
        }
        let mut right = SVector::<f64, DEPTH>::zeros();
        for i in 0..held {
            let product = dot(&self.changes[i], &self.changes[newest]);
            self.gram[(i, newest)] = product;
            self.gram[(newest, i)] = product;
            right[i] = dot(&self.changes[i], &self.change);
        }
        // Rows not yet held are those of the identity, scaled to the others, so that they have no effect.
        let trace = (0..held).map(|i| self.gram[(i, i)]).sum::<f64>();
        let mut normal = self.gram;
        for i in 0..DEPTH {
            normal[(i, i)] = if i < held { normal[(i, i)] + RIDGE * trace } else { trace };
        }
        let Some(normal) = normal.cholesky() else { return };
        let weights = normal.solve(&right);
        for (images, weight) in self.images.iter().zip(&weights).take(held) {
            y.iter_mut().zip(images).for_each(|(y, d)| *y -= weight * d);
        }
    }
}

#[inline(always)]
fn replace(old: &mut Vec<f64>, new: impl Iterator<Item = f64>) {
    old.clear();
    old.extend(new);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::random::Random;

    #[test]
    fn a_linear_map_of_depth_unknowns_converges_in_depth_iterations() {
        let mut random = Random::new(9);
        let mut m = SMatrix::<f64, DEPTH, DEPTH>::from_fn(|_, _| random.draw());
        m *= 0.95 / m.norm();
        let b = SVector::<f64, DEPTH>::from_fn(|_, _| random.draw());
        let map = |x: &[f64]| m * SVector::<f64, DEPTH>::from_column_slice(x) + b;
        let mut anderson = Anderson::default();
        let (mut x, mut plain) = (vec![0.0; DEPTH], vec![0.0; DEPTH]);
        for _ in 0..=DEPTH + 1 {
            let mut y = map(&x).as_slice().to_vec();
            anderson.accelerate(&x, &mut y);
            x = y;
            plain = map(&plain).as_slice().to_vec();
        }
        let error = |x: &[f64]| (map(x) - SVector::<f64, DEPTH>::from_column_slice(x)).norm();
        assert!(error(&x) < 1e-9 && error(&plain) > 1e4 * error(&x), "{} {}", error(&x), error(&plain));
    }
}
