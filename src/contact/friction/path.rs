//! The way to a solution of the law by way of rounded ones.
//!
//! Rounded off by a large τ the law of all contacts is next to that of a convex problem, with one solution. As τ falls the solutions make up a path that leads to one
//! without rounding, since they stay bounded where no impulses move nothing; but they need not go on for ever smaller τ: where contacts slip with friction the path turns back, so
//! that Newton's method from one τ to the next stands before nothing. So the path is followed along its own length, in x and ln τ (H. B. Keller, "Numerical solution of
//! bifurcation and nonlinear eigenvalue problems", 1977).

use super::mobility::COMPLIANCE;
use super::problem::FrictionProblem;
use super::smoothed::{Point, Smoothed};
use nalgebra::DVector;

/// τ at which the path is entered.
const ENTRY: f64 = 3.0;

/// Systems that are solved at most: some 150 as a rule.
const SYSTEMS: u32 = 400;

/// Corrections of a step at most; with no more than the second it was easy, with the fourth hard.
const CORRECTIONS: u32 = 5;
const EASY: u32 = 2;
const HARD: u32 = 4;

/// First length of a step, and the shortest.
const LENGTH: f64 = 0.5;
const SHORTEST: f64 = 1e-6;

/// Root of the mean square of what is to vanish, over τ, with which a point counts as on the path; and the least, which rounding may leave.
const ON_PATH: f64 = 1e-6;
const ROUNDING: f64 = 1e-11;

/// Improves `r` where the path leads to a solution whose residual is less, and ends where that is `wanted`.
pub(super) fn follow(smoothed: &Smoothed, problem: &FrictionProblem, wanted: f64, r: &mut [f64]) {
    let Some(mut path) = Path::enter(smoothed) else { return };
    let mut best = problem.residual_giving(r, COMPLIANCE);
    let mut trial = r.to_vec();
    while best > wanted && path.step() {
        smoothed.unscale(&path.at.as_slice()[..smoothed.len()], &mut trial);
        let residual = problem.residual_giving(&trial, COMPLIANCE);
        if residual < best {
            best = residual;
            r.copy_from_slice(&trial);
        }
    }
}

struct Path<'a> {
    smoothed: &'a Smoothed,
    /// x and ln τ.
    at: DVector<f64>,
    /// Where it leads: a unit vector.
    along: DVector<f64>,
    length: f64,
    systems: u32,
}

impl<'a> Path<'a> {
    fn enter(smoothed: &'a Smoothed) -> Option<Self> {
        let n = smoothed.len();
        let mut at = DVector::zeros(n + 1);
        at[n] = ENTRY.ln();
        let mut along = DVector::zeros(n + 1);
        along[n] = -1.0;
        let mut path = Path { smoothed, at, along, length: LENGTH, systems: 0 };
        loop {
            let point = path.point(&path.at)?;
            if path.is_on(&point.f, path.at[n]) {
                return Some(path);
            }
            // With a change of nothing along the border it is Newton's method for this τ.
            let step = smoothed.change(&point, point.f.push(0.0), &path.along)?.remove_row(n);
            let x = path.at.rows(0, n).into_owned();
            let (share, _) = smoothed.search(&x, &step, &point);
            path.at.rows_mut(0, n).copy_from(&(x - step * share));
            path.systems += 1;
        }
    }

    /// Goes on along the path; whether that was possible.
    fn step(&mut self) -> bool {
        while self.length > SHORTEST {
            let ahead = &self.at + &self.along * self.length;
            let Some((corrections, next, along)) = self.corrected(ahead) else {
                self.length *= 0.4;
                continue;
            };
            if corrections <= EASY {
                self.length *= 2.0;
            } else if corrections >= HARD {
                self.length *= 0.7;
            }
            (self.at, self.along) = (next, along);
            return true;
        }
        false
    }

    /// The point of the path that `ahead` leads to, across the direction that is known, how many corrections that took, and the direction there.
    fn corrected(&mut self, ahead: DVector<f64>) -> Option<(u32, DVector<f64>, DVector<f64>)> {
        let n = self.smoothed.len();
        let mut at = ahead;
        for corrections in 0..=CORRECTIONS {
            let point = self.point(&at)?;
            self.systems += 1;
            let is_on = self.is_on(&point.f, at[n]);
            let right = if is_on { DVector::zeros(n).push(1.0) } else { point.f.push(0.0) };
            let change = self.smoothed.change(&point, right, &self.along)?;
            if is_on {
                return Some((corrections, at, change.normalize()));
            }
            at -= change;
        }
        None
    }

    /// The law at x and ln τ. `None` beyond the bounds of what can be told.
    fn point(&self, at: &DVector<f64>) -> Option<Point> {
        let n = self.smoothed.len();
        let tau = at[n].exp();
        if self.systems >= SYSTEMS || !(tau.is_normal() && at.iter().all(|x| x.is_finite())) {
            return None;
        }
        Some(self.smoothed.at(&at.rows(0, n).into_owned(), tau))
    }

    fn is_on(&self, f: &DVector<f64>, ln_tau: f64) -> bool {
        f.norm() <= (ON_PATH * ln_tau.exp().min(1.0)).max(ROUNDING) * (f.len() as f64).sqrt()
    }
}

#[cfg(test)]
mod tests {
    use super::super::newton::{descend, improve};
    use super::super::{FrictionProblem, Law};
    use super::*;
    use crate::math::random::Random;
    use nalgebra::DMatrix;

    /// Contacts along a chain of half as many unknowns as they have components, each of which gives way a little: what moves one moves those beside it.
    fn wedged(random: &mut Random, contacts: usize) -> (Vec<f64>, Vec<f64>) {
        let (n, freedoms) = (3 * contacts, 3 * contacts / 2);
        let rows = DMatrix::from_fn(n, freedoms, |i, j| {
            let x = random.draw();
            let off = i as f64 / n as f64 - j as f64 / freedoms as f64;
            if off.abs() < 0.15 { x } else { 0.0 }
        });
        let mobility = &rows * rows.transpose() + DMatrix::identity(n, n) * 1e-6;
        let free = rows * DVector::from_fn(freedoms, |_, _| random.draw());
        (mobility.as_slice().to_vec(), free.as_slice().to_vec())
    }

    #[test]
    fn it_leads_to_a_solution_where_falling_rounding_alone_gets_caught() {
        let mut random = Random::new(12);
        let (mut caught, mut turned_back) = (0, 0);
        for case in 0..240 {
            let contacts = 8 + case % 12;
            let (w, b) = wedged(&mut random, contacts);
            let laws = vec![Law::Coulomb(0.3.into()); contacts];
            let problem = FrictionProblem { w: &w, b: &b, laws: &laws };
            let mut r = vec![0.0; 3 * contacts];
            let smoothed = Smoothed::new(&problem, &r).unwrap();
            caught += u32::from(descend(&smoothed, &problem, 1e-8, &mut r) > 1e-5);
            r.fill(0.0);
            follow(&smoothed, &problem, 1e-8, &mut r);
            let residual = problem.residual_giving(&r, COMPLIANCE);
            assert!(residual <= 1e-8, "case {case}: {residual}");
            r.fill(0.0);
            let improved = improve(&problem, 1e-6, &mut r);
            assert!(improved <= 1e-5, "case {case}: {improved}");
            let mut path = Path::enter(&smoothed).unwrap();
            let n = smoothed.len();
            turned_back += u32::from((0..60).any(|_| path.step() && path.along[n] > 0.0));
        }
        assert!(
            caught > 0 && turned_back > 0,
            "the test is of no use: {caught} caught, {turned_back} turned back"
        );
    }

    #[test]
    fn without_friction_it_never_turns_back() {
        let mut random = Random::new(13);
        for _ in 0..20 {
            let (w, b) = wedged(&mut random, 10);
            let problem = FrictionProblem { w: &w, b: &b, laws: &[Law::Coulomb(0.0.into()); 10] };
            let smoothed = Smoothed::new(&problem, &[0.0; 30]).unwrap();
            let mut path = Path::enter(&smoothed).unwrap();
            while path.at[smoothed.len()] > 1e-6_f64.ln() {
                assert!(path.step() && path.along[smoothed.len()] < 0.0);
            }
        }
    }
}
