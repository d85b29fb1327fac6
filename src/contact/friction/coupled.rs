//! Many strands that touch each other and bodies: the same law, with W sparse.
//!
//! With H = LLᵀ for every strand and Y = L⁻¹Jᵀ, W = YᵀY has a block for two contacts that share a strand and none for others. It is formed once,
//! block by block; a sweep then costs nine products for each of the pushing contacts that a contact shares a strand with, a few as a rule, where
//! by way of the strands' unknowns it would cost six for each of these.

use super::{Law, Outcome, Problem, Residual, Scratch, System, Tolerance, at, newton, sweep};
use crate::math::cholesky::dot;
use nalgebra::{Matrix3, Vector3};
use rayon::prelude::*;
use std::collections::BTreeSet;

/// Times that contacts which sweeps do not get to obey are singled out.
const MENDINGS: usize = 3;

/// Share of the squares of all errors that the contacts have which are singled out.
const WORST: f64 = 0.99;

/// With that many contacts singled out, those of their strands included, no more are.
const MENDED: usize = 60;

/// One strand's part in a contact.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Side {
    /// First unknown of the strand in w, which tells it from the others, and how many it has.
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
    /// The part of one strand in the block of W of two contacts.
    fn block(&self, a: &Side, b: &Side) -> Matrix3<f64> {
        let n = a.unknowns.1;
        let row = |side: &Side, d: usize| &self.rows[side.rows + d * n..][..n];
        Matrix3::from_fn(|i, j| dot(row(a, i), row(b, j)))
    }

    fn delassus(&self) -> Delassus {
        let sides = || self.sides.iter().enumerate();
        let mut parts: Vec<(u32, Side)> =
            sides().flat_map(|(i, sides)| sides.iter().flatten().map(move |s| (i as u32, *s))).collect();
        parts.sort_by_key(|(i, side)| (side.unknowns.0, *i));
        let of_strand = |first: usize| {
            let from = parts.partition_point(|(_, side)| side.unknowns.0 < first);
            parts[from..].iter().take_while(move |(_, side)| side.unknowns.0 == first)
        };
        let lines = self.sides.par_iter().map(|sides| {
            let blocks = |side: &'_ Side| {
                let side = *side;
                of_strand(side.unknowns.0).map(move |(j, other)| (*j, self.block(&side, other)))
            };
            let mut line: Vec<_> = sides.iter().flatten().flat_map(blocks).collect();
            line.sort_by_key(|(j, _)| *j);
            // Two strands that touch in two places share both.
            line.dedup_by(|next, kept| {
                let same = next.0 == kept.0;
                if same {
                    kept.1 += next.1;
                }
                same
            });
            line
        });
        let lines: Vec<_> = lines.collect();
        let own = |(i, line): (usize, &Vec<(u32, Matrix3<f64>)>)| {
            let own = line.iter().find(|(j, _)| *j as usize == i);
            own.map_or_else(Matrix3::zeros, |(_, block)| *block)
        };
        Delassus { diagonal: lines.iter().enumerate().map(own).collect(), lines }
    }
}

/// W.
struct Delassus {
    diagonal: Vec<Matrix3<f64>>,
    /// Line after line the blocks that are not zero with their columns, ascending.
    lines: Vec<Vec<(u32, Matrix3<f64>)>>,
}

/// Solves for the impulses `r` (3c) from what they hold, and leaves Y r in `w`.
///
/// What sweeps leave is nearly all in a few contacts, wedged between strands. These are solved for by themselves, and sweeps go on from there, as
/// long as that leaves less.
pub fn solve_coupled(
    problem: &Coupled,
    tolerance: Tolerance,
    r: &mut [f64],
    w: &mut [f64],
    scratch: &mut Scratch,
) -> Outcome {
    let mut network = Network { problem, delassus: problem.delassus(), r };
    let mut outcome = sweep(&mut network, tolerance, true, scratch);
    for _ in 0..MENDINGS {
        if outcome.residual <= tolerance.residual {
            break;
        }
        let before = network.r.to_vec();
        network.mend(tolerance.residual);
        let Outcome { sweeps, residual } = sweep(&mut network, tolerance, true, scratch);
        outcome.sweeps += sweeps;
        if residual >= outcome.residual {
            network.r.copy_from_slice(&before);
            break;
        }
        outcome.residual = residual;
    }
    let r = network.r;
    w.fill(0.0);
    for (sides, r) in problem.sides.iter().zip(r.chunks_exact(3)).filter(|(_, r)| **r != [0.0; 3]) {
        for Side { unknowns: (first, n), rows } in sides.iter().flatten() {
            for (row, r) in problem.rows[*rows..][..3 * n].chunks_exact(*n).zip(r) {
                w[*first..first + n].iter_mut().zip(row).for_each(|(w, y)| *w += y * r);
            }
        }
    }
    outcome
}

struct Network<'a> {
    problem: &'a Coupled<'a>,
    delassus: Delassus,
    r: &'a mut [f64],
}

impl Network<'_> {
    /// Solves for the contacts that are farthest from the law and those that push the same strands, all others as they are, where Newton's
    /// method can tell.
    fn mend(&mut self, wanted: f64) {
        let chosen = self.worst();
        let mut impulses: Vec<f64> = chosen.iter().flat_map(|&i| <[f64; 3]>::from(self.impulse(i))).collect();
        let laws: Vec<Law> = chosen.iter().map(|&i| self.law(i)).collect();
        let stride = 3 * chosen.len();
        let (mut w, mut b) = (vec![0.0; stride * stride], Vec::with_capacity(stride));
        for (line, &i) in w.chunks_exact_mut(3 * stride).zip(&chosen) {
            let mut free = self.velocity(i);
            for (j, block) in &self.delassus.lines[i] {
                let Ok(column) = chosen.binary_search(&(*j as usize)) else { continue };
                free -= block * self.impulse(*j as usize);
                for (line, row) in line.chunks_exact_mut(stride).zip(block.row_iter()) {
                    line[3 * column..][..3].iter_mut().zip(row.iter()).for_each(|(w, block)| *w = *block);
                }
            }
            b.extend_from_slice(free.as_slice());
        }
        let problem = Problem { w: &w, b: &b, laws: &laws };
        if problem.residual(&impulses) > newton::COMPLIANCE {
            newton::improve(&problem, wanted, &mut impulses);
            for (&i, impulse) in chosen.iter().zip(impulses.chunks_exact(3)) {
                self.set(i, Vector3::from_column_slice(impulse));
            }
        }
    }

    /// The contacts that have nearly all of the error, and those that push their strands or would be passed, ascending.
    fn worst(&self) -> Vec<usize> {
        let error = |i: usize| {
            let mut residual = Residual::default();
            let (u, r) = (self.velocity(i), self.impulse(i));
            residual.add(self.block(i).trace(), u, &r, &self.free(i), self.law(i));
            residual.error
        };
        let errors: Vec<f64> = (0..self.contacts()).map(error).collect();
        let mut order: Vec<usize> = (0..errors.len()).collect();
        order.sort_by(|&i, &j| errors[j].total_cmp(&errors[i]));
        let mut left = WORST * errors.iter().sum::<f64>();
        let mut chosen = BTreeSet::new();
        for i in order {
            if left <= 0.0 || chosen.len() >= MENDED {
                break;
            }
            left -= errors[i];
            let beside = self.delassus.lines[i].iter().map(|(j, _)| *j as usize);
            chosen
                .extend(beside.filter(|&j| self.impulse(j) != Vector3::zeros() || self.velocity(j).x < 0.0));
            chosen.insert(i);
        }
        chosen.into_iter().collect()
    }
}

impl System for Network<'_> {
    fn contacts(&self) -> usize {
        self.problem.laws.len()
    }

    fn block(&self, i: usize) -> Matrix3<f64> {
        self.delassus.diagonal[i]
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
        let mut u = self.free(i);
        for (j, block) in &self.delassus.lines[i] {
            let r = self.impulse(*j as usize);
            if r != Vector3::zeros() {
                u += block * r;
            }
        }
        u
    }

    fn set(&mut self, i: usize, impulse: Vector3<f64>) {
        self.r[3 * i..3 * i + 3].copy_from_slice(impulse.as_slice());
    }
}
