//! Many strands that touch each other and bodies: the same law, with W sparse.
//!
//! With H = LLᵀ for every strand and Y = L⁻¹Jᵀ, W = YᵀY has a block for two contacts that share a strand and none for others. The blocks of contacts
//! that are swept over are formed, and copied while they stay so; a sweep then costs nine products for each of those that a contact shares a strand with, a few as
//! a rule, where by way of the strands' unknowns, w = Y r, it would cost six for each of these. That way the others are looked at.

use super::problem::{FrictionOutcome, FrictionProblem, FrictionTolerance, Law, Residual, at};
use super::sweep::{FrictionScratch, System, sweep};
use super::{mobility, newton};
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
pub struct StrandRows {
    /// Index of the strand's first unknown in w; it identifies the strand.
    pub first_unknown: usize,
    /// Number of unknowns of the strand.
    pub unknowns: usize,
    /// Start of the strand's three rows of Y (normal, tangents) in [`CoupledFrictionProblem::rows`].
    pub offset: usize,
}

/// A frictional problem of c contacts between strands, or of strands with bodies.
#[derive(Debug, Clone, Copy)]
pub struct CoupledFrictionProblem<'a> {
    /// The strands of each contact; one where the other side is a body.
    pub strands: &'a [[Option<StrandRows>; 2]],
    /// L⁻¹Jᵀ, row after row.
    pub rows: &'a [f64],
    /// b, 3c: gap and slip without contact forces.
    pub b: &'a [f64],
    /// What holds at each contact, c.
    pub laws: &'a [Law],
}

impl CoupledFrictionProblem<'_> {
    fn row(&self, side: &StrandRows, d: usize) -> &[f64] {
        let n = side.unknowns;
        &self.rows[side.offset + d * n..][..n]
    }

    /// The block of W of two contacts.
    fn block(&self, i: usize, j: usize) -> Matrix3<f64> {
        let mut block = Matrix3::zeros();
        for a in self.strands[i].iter().flatten() {
            for b in self.strands[j].iter().flatten().filter(|b| b.first_unknown == a.first_unknown) {
                block += Matrix3::from_fn(|row, column| dot(self.row(a, row), self.row(b, column)));
            }
        }
        block
    }

    /// Y r, in `w`.
    fn push(&self, r: &[f64], w: &mut [f64]) {
        w.fill(0.0);
        for (sides, r) in self.strands.iter().zip(r.chunks_exact(3)).filter(|(_, r)| **r != [0.0; 3]) {
            for side in sides.iter().flatten() {
                let (first, n) = (side.first_unknown, side.unknowns);
                for (d, r) in r.iter().enumerate() {
                    w[first..first + n].iter_mut().zip(self.row(side, d)).for_each(|(w, y)| *w += y * r);
                }
            }
        }
    }

    /// u of contact `i`, w being Y r.
    fn velocity(&self, w: &[f64], i: usize) -> Vector3<f64> {
        let mut u = at(self.b, i);
        for side in self.strands[i].iter().flatten() {
            let (first, n) = (side.first_unknown, side.unknowns);
            u += Vector3::from_fn(|d, _| dot(self.row(side, d), &w[first..first + n]));
        }
        u
    }
}

/// The part of W of some contacts, line after line the blocks that are not zero with their columns, ascending.
#[derive(Default)]
struct Delassus {
    contacts: Vec<u32>,
    /// Of each contact of the problem its line, [`Delassus::NONE`] of those that have none.
    line: Vec<u32>,
    /// Where each line begins, and the end of the last.
    start: Vec<usize>,
    blocks: Vec<(u32, Matrix3<f64>)>,
}

impl Delassus {
    const NONE: u32 = u32::MAX;

    /// Of `contacts`; blocks that `known` has are taken from there.
    fn new(problem: &CoupledFrictionProblem, contacts: &[u32], known: &Delassus) -> Self {
        let strands = |i: u32| problem.strands[i as usize].iter().flatten().map(|side| side.first_unknown);
        let mut parts: Vec<(usize, u32)> =
            contacts.iter().flat_map(|&i| strands(i).map(move |strand| (strand, i))).collect();
        parts.sort_unstable();
        let of_strand = |strand: usize| {
            let from = parts.partition_point(|part| part.0 < strand);
            parts[from..].iter().take_while(move |part| part.0 == strand).map(|part| part.1)
        };
        let line = |&i: &u32| {
            let mut beside: Vec<u32> = strands(i).flat_map(of_strand).collect();
            beside.sort_unstable();
            beside.dedup();
            let of = |j: u32| known.block(i, j).unwrap_or_else(|| problem.block(i as usize, j as usize));
            beside.into_iter().map(|j| (j, of(j))).collect::<Vec<_>>()
        };
        let lines: Vec<_> = contacts.par_iter().map(line).collect();
        let mut delassus = Delassus { contacts: contacts.to_vec(), ..Delassus::default() };
        delassus.line.resize(problem.laws.len(), Self::NONE);
        delassus.start.push(0);
        for (k, (&i, line)) in contacts.iter().zip(lines).enumerate() {
            delassus.line[i as usize] = k as u32;
            delassus.blocks.extend(line);
            delassus.start.push(delassus.blocks.len());
        }
        delassus
    }

    fn of(&self, i: u32) -> Option<&[(u32, Matrix3<f64>)]> {
        let line = *self.line.get(i as usize)?;
        (line != Self::NONE).then(|| &self.blocks[self.start[line as usize]..self.start[line as usize + 1]])
    }

    fn block(&self, i: u32, j: u32) -> Option<Matrix3<f64>> {
        let line = self.of(i)?;
        Some(line[line.binary_search_by_key(&j, |(j, _)| *j).ok()?].1)
    }
}

/// Solves for the impulses `r` (3c) from what they hold, and leaves Y r in `w`.
///
/// What sweeps leave is nearly all in a few contacts, wedged between strands. These are solved for by themselves, and sweeps go on from there, as
/// long as that leaves less.
pub fn solve_coupled(
    problem: &CoupledFrictionProblem,
    tolerance: FrictionTolerance,
    r: &mut [f64],
    w: &mut [f64],
    scratch: &mut FrictionScratch,
) -> FrictionOutcome {
    let diagonal = (0..r.len() / 3).into_par_iter().map(|i| problem.block(i, i)).collect();
    let mut network = Network { problem, diagonal, delassus: Delassus::default(), r, w };
    let mut outcome = sweep(&mut network, tolerance, true, scratch);
    for _ in 0..MENDINGS {
        if outcome.residual <= tolerance.residual {
            break;
        }
        let before = network.r.to_vec();
        network.mend(tolerance.residual);
        let FrictionOutcome { sweeps, residual } = sweep(&mut network, tolerance, true, scratch);
        outcome.sweeps += sweeps;
        if residual >= outcome.residual {
            network.r.copy_from_slice(&before);
            break;
        }
        outcome.residual = residual;
    }
    problem.push(network.r, network.w);
    outcome
}

struct Network<'a> {
    problem: &'a CoupledFrictionProblem<'a>,
    /// Diagonal blocks of all contacts.
    diagonal: Vec<Matrix3<f64>>,
    /// Of those that are swept over.
    delassus: Delassus,
    r: &'a mut [f64],
    /// Y r at the last look.
    w: &'a mut [f64],
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
            for (j, block) in self.line(i) {
                let Ok(column) = chosen.binary_search(&(*j as usize)) else { continue };
                free -= block * self.impulse(*j as usize);
                for (line, row) in line.chunks_exact_mut(stride).zip(block.row_iter()) {
                    line[3 * column..][..3].iter_mut().zip(row.iter()).for_each(|(w, block)| *w = *block);
                }
            }
            b.extend_from_slice(free.as_slice());
        }
        let problem = FrictionProblem { w: &w, b: &b, laws: &laws };
        if problem.residual(&impulses) > mobility::COMPLIANCE {
            newton::improve(&problem, wanted, &mut impulses);
            for (&i, impulse) in chosen.iter().zip(impulses.chunks_exact(3)) {
                self.set(i, Vector3::from_column_slice(impulse));
            }
        }
    }

    /// The blocks of a contact that is swept over, with their columns.
    fn line(&self, i: usize) -> &[(u32, Matrix3<f64>)] {
        self.delassus.of(i as u32).unwrap_or_default()
    }

    /// The contacts that have nearly all of the error, and those that push their strands or would be passed, ascending.
    fn worst(&self) -> Vec<usize> {
        let error = |i: usize| {
            let mut residual = Residual::default();
            let (u, r) = (self.velocity(i), self.impulse(i));
            residual.add(self.block(i).trace(), u, &r, &self.free(i), self.law(i));
            residual.error
        };
        let mut errors: Vec<(usize, f64)> =
            self.delassus.contacts.iter().map(|&i| (i as usize, error(i as usize))).collect();
        errors.sort_by(|a, b| b.1.total_cmp(&a.1).then(a.0.cmp(&b.0)));
        let mut left = WORST * errors.iter().map(|(_, error)| error).sum::<f64>();
        let mut chosen = BTreeSet::new();
        for (i, error) in errors {
            if left <= 0.0 || chosen.len() >= MENDED {
                break;
            }
            left -= error;
            let beside = self.line(i).iter().map(|(j, _)| *j as usize);
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
        self.diagonal[i]
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

    fn look(&mut self, u: &mut Vec<Vector3<f64>>) {
        self.problem.push(self.r, self.w);
        let of = |i: usize| self.problem.velocity(self.w, i);
        (0..self.contacts()).into_par_iter().map(of).collect_into_vec(u);
    }

    fn narrow(&mut self, live: &[u32]) {
        self.delassus = Delassus::new(self.problem, live, &self.delassus);
    }

    fn velocity(&self, i: usize) -> Vector3<f64> {
        let line = self.line(i).iter();
        line.fold(self.free(i), |u, (j, block)| u + block * self.impulse(*j as usize))
    }

    fn set(&mut self, i: usize, impulse: Vector3<f64>) {
        self.r[3 * i..3 * i + 3].copy_from_slice(impulse.as_slice());
    }
}
