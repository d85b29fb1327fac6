//! Many strands that touch each other and bodies: the same law, with W left in its factors.
//!
//! With H = LLᵀ for every strand and Y = L⁻¹Jᵀ, W = YᵀY is never formed: w = Y r is kept for every strand, so that a sweep
//! costs O(unknowns of a strand) a contact, however many contacts there are.

use super::{Law, Outcome, Scratch, System, Tolerance, at, sweep};
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
    /// What holds at each contact, c.
    pub laws: &'a [Law],
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
            u += dots(&self.rows[side.rows..][..3 * n], &w[first..first + n]);
        }
        u
    }

    /// w += Y Δr of contact `i`.
    fn push(&self, w: &mut [f64], i: usize, change: &Vector3<f64>) {
        for side in self.sides[i].iter().flatten() {
            let (first, n) = side.unknowns;
            let (a, rest) = self.rows[side.rows..][..3 * n].split_at(n);
            let (b, c) = rest.split_at(n);
            let rows = a.iter().zip(b).zip(c);
            for (w, ((a, b), c)) in w[first..first + n].iter_mut().zip(rows) {
                *w += a * change.x + (b * change.y + c * change.z);
            }
        }
    }
}

/// The products of three rows, one after another, with `w`: at once, in four fixed chains each.
fn dots(rows: &[f64], w: &[f64]) -> Vector3<f64> {
    let (a, rest) = rows.split_at(w.len());
    let (b, c) = rest.split_at(w.len());
    let mut sums = [[0.0; 4]; 3];
    let fours = w.chunks_exact(4).zip(a.chunks_exact(4)).zip(b.chunks_exact(4)).zip(c.chunks_exact(4));
    for (((w, a), b), c) in fours {
        for i in 0..4 {
            sums[0][i] += a[i] * w[i];
            sums[1][i] += b[i] * w[i];
            sums[2][i] += c[i] * w[i];
        }
    }
    for j in w.len() / 4 * 4..w.len() {
        sums[0][0] += a[j] * w[j];
        sums[1][0] += b[j] * w[j];
        sums[2][0] += c[j] * w[j];
    }
    Vector3::from_fn(|d, _| (sums[d][0] + sums[d][1]) + (sums[d][2] + sums[d][3]))
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
    for i in 0..problem.laws.len() {
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
        self.problem.laws.len()
    }

    fn block(&self, i: usize) -> Matrix3<f64> {
        self.problem.block(i)
    }

    fn free(&self, i: usize) -> Vector3<f64> {
        at(self.problem.b, i)
    }

    fn law(&self, i: usize) -> Law {
        self.problem.laws[i]
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

    fn state(&mut self) -> [&mut [f64]; 2] {
        [self.r, self.w]
    }
}
