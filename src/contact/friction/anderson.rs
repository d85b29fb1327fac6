//! Fixed points in fewer turns.

use crate::math::cholesky::dot;
use nalgebra::{SMatrix, SVector};

/// Turns that are looked back on. Five do nearly as well, twenty hardly better.
const DEPTH: usize = 8;

/// Share of the normal matrix's trace that is added to its diagonal, so that turns that say the same do not cancel each other.
const RIDGE: f64 = 1e-12;

/// How much larger than the last a change may be; beyond it what is looked back on was another problem's.
const GROWTH: f64 = 1.5;

/// Acceleration of x ← g(x): of all combinations of the last images, with weights that add up to one, the one whose changes g(x) − x all but
/// cancel (D. G. Anderson, "Iterative procedures for nonlinear integral equations", 1965; where g is linear this is GMRES: H. F. Walker
/// & P. Ni, 2011).
#[derive(Debug, Default)]
pub(super) struct Anderson {
    image: Vec<f64>,
    change: Vec<f64>,
    /// Differences of images and changes from one turn to the next, the oldest replaced in turn.
    images: [Vec<f64>; DEPTH],
    changes: [Vec<f64>; DEPTH],
    /// changesᵀ changes.
    gram: SMatrix<f64, DEPTH, DEPTH>,
    turns: usize,
}

impl Anderson {
    pub fn clear(&mut self) {
        self.turns = 0;
    }

    /// Replaces the image `y` of `x` by the combination. All turns since [`Anderson::clear`] must have as many components.
    pub fn accelerate(&mut self, x: &[f64], y: &mut [f64]) {
        let change = || y.iter().zip(x).map(|(y, x)| y - x);
        let grown = change().map(|c| c * c).sum::<f64>() > GROWTH * GROWTH * dot(&self.change, &self.change);
        if self.turns > 0 && grown {
            self.turns = 0;
        }
        if self.turns > 0 {
            let at = (self.turns - 1) % DEPTH;
            replace(&mut self.images[at], y.iter().zip(&self.image).map(|(new, old)| new - old));
            replace(&mut self.changes[at], change().zip(&self.change).map(|(new, old)| new - old));
        }
        self.image.clear();
        self.image.extend_from_slice(y);
        replace(&mut self.change, y.iter().zip(x).map(|(y, x)| y - x));
        self.turns += 1;
        let held = (self.turns - 1).min(DEPTH);
        if held > 0 {
            self.combine((self.turns - 2) % DEPTH, held, y);
        }
    }

    /// Subtracts from `y` the combination of the `held` differences of images whose changes are nearest to the last; that at `newest` is
    /// not yet in the normal matrix.
    fn combine(&mut self, newest: usize, held: usize, y: &mut [f64]) {
        if held == 1 {
            self.gram = SMatrix::identity();
        }
        let mut wanted = SVector::<f64, DEPTH>::zeros();
        for i in 0..held {
            let product = dot(&self.changes[i], &self.changes[newest]);
            self.gram[(i, newest)] = product;
            self.gram[(newest, i)] = product;
            wanted[i] = dot(&self.changes[i], &self.change);
        }
        // Rows that are not held yet are those of the identity, scaled to the others, so that they change nothing.
        let trace = (0..held).map(|i| self.gram[(i, i)]).sum::<f64>();
        let mut normal = self.gram;
        for i in 0..DEPTH {
            normal[(i, i)] = if i < held { normal[(i, i)] + RIDGE * trace } else { trace };
        }
        let Some(normal) = normal.cholesky() else { return };
        let weights = normal.solve(&wanted);
        for (images, weight) in self.images.iter().zip(&weights).take(held) {
            y.iter_mut().zip(images).for_each(|(y, d)| *y -= weight * d);
        }
    }
}

fn replace(old: &mut Vec<f64>, new: impl Iterator<Item = f64>) {
    old.clear();
    old.extend(new);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::random::Random;

    #[test]
    fn a_linear_map_of_as_many_unknowns_as_turns_is_solved_in_as_many() {
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
        let off = |x: &[f64]| (map(x) - SVector::<f64, DEPTH>::from_column_slice(x)).norm();
        assert!(off(&x) < 1e-9 && off(&plain) > 1e4 * off(&x), "{} {}", off(&x), off(&plain));
    }
}
