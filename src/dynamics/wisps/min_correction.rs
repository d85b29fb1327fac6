//! The least change of a rod's unknowns that keeps its points out of bodies, to first order (`docs/theory.md`
//! eq. 8.6).

use super::snapshot::{NearPoint, PosedRod};
use crate::math::cholesky;
use crate::rod::{LumpedSensitivity, Rod};

/// Violation of a constraint that counts as none, m.
pub(super) const CONSTRAINT_TOLERANCE: f64 = 1e-6;

/// Compliance of an active constraint relative to that of the rod there. It bounds the change where
/// constraints oppose each other.
const COMPLIANCE: f64 = 1e-4;

/// A quadratic program: the least change in a metric with A·change ≥ b. The dual is solved as non-negative
/// least squares by an active-set method (Lawson & Hanson 1974, chapter 23).
#[derive(Default)]
pub(super) struct MinCorrection {
    /// The solution, 1/m.
    pub change: Vec<f64>,
    /// b: how far each point must move outwards from the unchanged rod, m.
    bounds: Vec<f64>,
    /// A: derivative of each point's outward displacement with respect to the unknowns, m².
    rows: Vec<f64>,
    /// Indices of the active constraints.
    active: Vec<usize>,
    /// L⁻¹ times the rows of the active constraints.
    reduced: Vec<f64>,
    /// Their multipliers.
    multipliers: Vec<f64>,
    /// Scratch: Gram matrix of `reduced`.
    gram: Vec<f64>,
    /// Scratch: multipliers of the unconstrained least squares.
    trial: Vec<f64>,
}

impl MinCorrection {
    /// Solves for a rod that `change` has brought to `posed`, with the metric's Cholesky factor L.
    pub fn find(&mut self, rod: &Rod, posed: &PosedRod, near: &[NearPoint], metric: &[f64], change: &[f64]) {
        let n = rod.unknowns();
        let sensitivity = LumpedSensitivity::new(rod, &posed.shape);
        self.rows.resize(n * near.len(), 0.0);
        for (row, near) in self.rows.chunks_exact_mut(n).zip(near) {
            let point = near.index % posed.x.len();
            let end = point.checked_sub(rod.points()).map_or(point, |segment| segment + 1);
            sensitivity.set_row(end, &(posed.x[point] - posed.x[0]), &near.normal, row);
        }
        self.bounds.clear();
        let bound = |(near, row): (&NearPoint, &[f64])| near.shortfall + cholesky::dot(row, change);
        self.bounds.extend(near.iter().zip(self.rows.chunks_exact(n)).map(bound));
        self.solve(n, metric);
    }

    /// Solves for `n` unknowns with the rows and bounds as they are.
    fn solve(&mut self, n: usize, metric: &[f64]) {
        let MinCorrection { change, bounds, rows, active, reduced, multipliers, gram, trial } = self;
        let row = |k: usize| &rows[k * n..][..n];
        change.clear();
        change.resize(n, 0.0);
        active.clear();
        reduced.clear();
        multipliers.clear();
        // More iterations than unknowns are hardly ever needed.
        for _ in 0..2 * n {
            let violation = |k: usize| bounds[k] - cholesky::dot(row(k), change);
            let inactive = (0..bounds.len()).filter(|k| !active.contains(k)).map(|k| (violation(k), k));
            let Some((violation, k)) = inactive.reduce(|a, b| if b.0 > a.0 { b } else { a }) else { break };
            if violation < CONSTRAINT_TOLERANCE {
                break;
            }
            active.push(k);
            multipliers.push(0.0);
            reduced.extend_from_slice(row(k));
            cholesky::solve_lower(metric, n, &mut reduced[(active.len() - 1) * n..]);
            loop {
                let m = active.len();
                gram.clear();
                for (i, a) in reduced.chunks_exact(n).enumerate() {
                    gram.extend(reduced.chunks_exact(n).take(i + 1).map(|b| cholesky::dot(a, b)));
                    gram.resize((i + 1) * m, 0.0);
                    gram[i * m + i] += COMPLIANCE * gram[i * m + i] + f64::MIN_POSITIVE;
                }
                trial.clear();
                trial.extend(active.iter().map(|k| bounds[*k]));
                cholesky::factor(gram, m);
                cholesky::solve(gram, m, trial);
                // Move towards the trial until the first multiplier vanishes; drop its constraint.
                let negative =
                    multipliers.iter().zip(trial.iter()).enumerate().filter(|(_, (_, to))| **to <= 0.0);
                let shares = negative.map(|(i, (from, to))| (from / (from - to), i));
                let Some((share, first)) = shares.reduce(|a, b| if b.0 < a.0 { b } else { a }) else { break };
                multipliers.iter_mut().zip(trial.iter()).for_each(|(m, to)| *m += share * (to - *m));
                active.remove(first);
                multipliers.remove(first);
                reduced.drain(first * n..(first + 1) * n);
            }
            multipliers.clone_from(trial);
            change.fill(0.0);
            for (row, multiplier) in reduced.chunks_exact(n).zip(multipliers.iter()) {
                change.iter_mut().zip(row).for_each(|(c, r)| *c += multiplier * r);
            }
            cholesky::solve_upper(metric, n, change);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn solution_meets_the_karush_kuhn_tucker_conditions() {
        let (mut problem, mut random) = (MinCorrection::default(), 1_u64);
        let mut number = || {
            random = random.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
            (random >> 33) as f64 / f64::from(u32::MAX >> 1) - 0.5
        };
        let unit: Vec<f64> = (0..36).map(|i| f64::from(i % 7 == 0)).collect();
        let mut most = 0;
        for _ in 0..200 {
            problem.rows = (0..48).map(|_| number()).collect();
            problem.bounds = (0..8).map(|_| 0.01 * number()).collect();
            problem.solve(6, &unit);
            let MinCorrection { change, bounds, rows, active, multipliers, .. } = &problem;
            // The problem is convex: the conditions are sufficient.
            for (k, row) in rows.chunks_exact(6).enumerate() {
                let violation = bounds[k] - cholesky::dot(row, change);
                match active.iter().position(|active| *active == k) {
                    None => assert!(violation < CONSTRAINT_TOLERANCE, "{k}: {violation}"),
                    Some(i) => {
                        let given = COMPLIANCE * cholesky::dot(row, row) * multipliers[i];
                        let complementary = (violation - given).abs() < 1e-9;
                        assert!(multipliers[i] > 0.0 && complementary, "{k}: {violation} {given}");
                    }
                }
            }
            let gradient = |n: usize| {
                active
                    .iter()
                    .zip(multipliers)
                    .map(|(k, multiplier)| multiplier * rows[6 * k + n])
                    .sum::<f64>()
            };
            assert!((0..6).all(|n| (change[n] - gradient(n)).abs() < 1e-12));
            most = most.max(active.len());
        }
        assert!(most > 3, "{most}");
    }
}
