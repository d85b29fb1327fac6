//! Many strands that touch each other and bodies: the same law, with W left in its factors.
//!
//! With H = LLᵀ for every strand and Y = L⁻¹Jᵀ, W = YᵀY is never formed: w = Y r is kept for every strand, so that a sweep
//! costs O(unknowns of a strand) a contact, however many contacts there are.

use super::{Outcome, Scratch, System, Tolerance, at, sweep};
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
        let mut u = at(self.b, i);
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

/// Solves for the impulses `r` (3c) from what they hold, and leaves Y r in `w`.
pub fn solve_coupled(
    problem: &Coupled,
    tolerance: Tolerance,
    r: &mut [f64],
    w: &mut [f64],
    scratch: &mut Scratch,
) -> Outcome {
    w.fill(0.0);
    for i in 0..problem.mu.len() {
        problem.push(w, i, &at(r, i));
    }
    sweep(&mut Network { problem, r, w }, tolerance, scratch)
}

struct Network<'a> {
    problem: &'a Coupled<'a>,
    r: &'a mut [f64],
    w: &'a mut [f64],
}

impl System for Network<'_> {
    fn contacts(&self) -> usize {
        self.problem.mu.len()
    }

    fn block(&self, i: usize) -> Matrix3<f64> {
        self.problem.block(i)
    }

    fn free(&self, i: usize) -> Vector3<f64> {
        at(self.problem.b, i)
    }

    fn friction(&self, i: usize) -> f64 {
        self.problem.mu[i]
    }

    fn impulse(&self, i: usize) -> Vector3<f64> {
        at(self.r, i)
    }

    fn velocity(&self, i: usize) -> Vector3<f64> {
        self.problem.velocity(self.w, i)
    }

    fn set(&mut self, i: usize, impulse: Vector3<f64>) {
        self.problem.push(self.w, i, &(impulse - at(self.r, i)));
        self.r[3 * i..3 * i + 3].copy_from_slice(impulse.as_slice());
    }
}
