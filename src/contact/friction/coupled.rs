//! Many strands that touch each other and bodies: the same law, with W left in its factors.
//!
//! With H = LLᵀ for every strand and Y = L⁻¹Jᵀ, W = YᵀY is never formed: w = Y r is kept for every strand, so that a sweep
//! costs O(unknowns of a strand) a contact, however many contacts there are.

use super::local::Local;
use super::{Outcome, Tolerance, project_on_cone};
use crate::math::cholesky::dot;
use nalgebra::{Matrix3, Vector3};

/// One strand's part in a contact.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Side {
    /// First unknown of the strand in w, and how many it has.
    pub unknowns: (usize, usize),
    /// Where its three rows of Y (normal, tangents) begin in [`Coupled::rows`].
    pub rows: usize,
}

/// A frictional problem of c contacts between strands, or of strands with bodies.
#[derive(Debug, Clone, Copy)]
pub struct Coupled<'a> {
    /// The strands of each contact; one where the other side is a body.
    pub sides: &'a [[Option<Side>; 2]],
    /// L⁻¹Jᵀ, row after row.
    pub rows: &'a [f64],
    /// b, 3c: gap and slip without contact forces.
    pub b: &'a [f64],
    /// µ, c, none negative.
    pub mu: &'a [f64],
}

impl Coupled<'_> {
    fn block(&self, i: usize) -> Matrix3<f64> {
        let mut w = Matrix3::zeros();
        for side in self.sides[i].iter().flatten() {
            let row = |d: usize| &self.rows[side.rows + d * side.unknowns.1..][..side.unknowns.1];
            for a in 0..3 {
                for b in 0..=a {
                    let part = dot(row(a), row(b));
                    w[(a, b)] += part;
                    if a != b {
                        w[(b, a)] += part;
                    }
                }
            }
        }
        w
    }

    /// u of contact `i`, given w = Y r.
    fn velocity(&self, w: &[f64], i: usize) -> Vector3<f64> {
        let mut u = Vector3::from_column_slice(&self.b[3 * i..3 * i + 3]);
        for side in self.sides[i].iter().flatten() {
            let (first, n) = side.unknowns;
            for d in 0..3 {
                u[d] += dot(&self.rows[side.rows + d * n..][..n], &w[first..first + n]);
            }
        }
        u
    }

    /// w += Y Δr of contact `i`.
    fn push(&self, w: &mut [f64], i: usize, change: &Vector3<f64>) {
        for side in self.sides[i].iter().flatten() {
            let (first, n) = side.unknowns;
            for d in 0..3 {
                if change[d] != 0.0 {
                    let row = &self.rows[side.rows + d * n..][..n];
                    w[first..first + n].iter_mut().zip(row).for_each(|(w, y)| *w += y * change[d]);
                }
            }
        }
    }
}

/// Squares whose ratio is that of the relative residual ([`super::Problem::residual`]).
#[derive(Default)]
struct Residual {
    error: f64,
    impulse: f64,
    free: f64,
}

impl Residual {
    fn add(&mut self, w: &Matrix3<f64>, u: Vector3<f64>, r: &Vector3<f64>, b: &[f64], mu: f64) {
        let trace = w.trace();
        if trace <= 0.0 {
            return;
        }
        let rho = 3.0 / trace;
        let changed = Vector3::new(u.x + mu * u.yz().norm(), u.y, u.z);
        self.error += (r - project_on_cone(r - changed * rho, mu)).norm_squared();
        self.impulse += r.norm_squared();
        self.free += (Vector3::from_column_slice(b) * rho).norm_squared();
    }

    fn relative(&self) -> f64 {
        let scale = self.impulse.max(self.free);
        if scale > 0.0 { (self.error / scale).sqrt() } else { 0.0 }
    }
}

/// Solves for the impulses `r` (3c) from what they hold, and leaves Y r in `w`. The residual that ends it is gathered during the
/// sweep, each contact as it is met; the one returned is that of the result.
pub fn solve_coupled(problem: &Coupled, tolerance: Tolerance, r: &mut [f64], w: &mut [f64]) -> Outcome {
    let contacts = problem.mu.len();
    let at = |r: &[f64], i: usize| Vector3::from_column_slice(&r[3 * i..3 * i + 3]);
    let locals: Vec<Local> = (0..contacts).map(|i| Local::new(&problem.block(i))).collect();
    w.fill(0.0);
    for i in 0..contacts {
        problem.push(w, i, &at(r, i));
    }
    let mut sweeps = 0;
    let mut change = true;
    loop {
        let mut residual = Residual::default();
        for (i, local) in locals.iter().enumerate() {
            let (old, mu, b) = (at(r, i), problem.mu[i], &problem.b[3 * i..3 * i + 3]);
            let u = problem.velocity(w, i);
            residual.add(&local.w, u, &old, b, mu);
            if change && !(old == Vector3::zeros() && u.x >= 0.0) {
                let new = local.solve(&(u - local.w * old), mu);
                problem.push(w, i, &(new - old));
                r[3 * i..3 * i + 3].copy_from_slice(new.as_slice());
            }
        }
        let residual = residual.relative();
        if !change {
            return Outcome { sweeps, residual };
        }
        sweeps += 1;
        // One more pass, without change, for the residual of the result.
        change = residual > tolerance.residual && sweeps < tolerance.sweeps;
    }
}
