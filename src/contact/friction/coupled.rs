//! Solver for many strands that touch each other and bodies.
//!
//! Sweeps know the impulses by w = Y r, which every change of one updates: a contact costs twelve products for each
//! unknown of its strands, however many others share them.

use super::budget::SystemBudget;
use super::coupled_problem::CoupledFrictionProblem;
use super::gauss_seidel::{FrictionOutcome, FrictionScratch, FrictionTolerance, System, solve_by_sweeps};
use super::interrupt::Interrupt;
use super::newton;
use super::problem::{FrictionProblem, at};
use super::regularised::COMPLIANCE;
use super::residual::Residual;
use crate::geometry::Friction;
use nalgebra::{Matrix3, Vector3};
use pulp::{Arch, Simd, WithSimd};
use rayon::prelude::*;
use std::collections::BTreeSet;

/// Maximum number of Newton solves for the worst contacts.
const NEWTON_SOLVES: usize = 3;

/// Fraction of the total squared error that the selected contacts account for.
const WORST: f64 = 0.99;

/// Number of selected contacts, neighbours included, beyond which no more are selected.
const SELECTED: usize = 60;

/// Solves for the impulses `r` (3c), starting from their values, and leaves Y r in `w`.
///
/// The error left by sweeps is concentrated in a few contacts, wedged between strands. Newton's method solves
/// for them separately, and sweeps continue from there, as long as the residual decreases. Both end early
/// once `interrupt` is asked for, and the impulses are then of no use.
pub fn solve_coupled(
    problem: &CoupledFrictionProblem,
    tolerance: FrictionTolerance,
    r: &mut [f64],
    w: &mut [f64],
    scratch: &mut FrictionScratch,
    interrupt: &Interrupt,
) -> FrictionOutcome {
    let diagonal = (0..r.len() / 3).into_par_iter().map(|i| problem.block(i, i)).collect();
    let mut network = Network { problem, diagonal, r, w };
    let mut outcome = Arch::new().dispatch(Sweeps { network: &mut network, tolerance, scratch });
    for _ in 0..NEWTON_SOLVES {
        let solved = outcome.residual <= tolerance.residual;
        if solved || !tolerance.continuation || interrupt.is_asked_for() {
            break;
        }
        let before = network.r.to_vec();
        network.solve_worst(tolerance, interrupt);
        let FrictionOutcome { sweeps, residual } =
            Arch::new().dispatch(Sweeps { network: &mut network, tolerance, scratch });
        outcome.sweeps += sweeps;
        if residual >= outcome.residual {
            network.r.copy_from_slice(&before);
            break;
        }
        outcome.residual = residual;
    }
    problem.apply(network.r, network.w);
    outcome
}

/// Sweeps with the registers that the processor has; the order of operations is the same on all.
struct Sweeps<'a, 'b> {
    network: &'a mut Network<'b>,
    tolerance: FrictionTolerance,
    scratch: &'a mut FrictionScratch,
}

impl WithSimd for Sweeps<'_, '_> {
    type Output = FrictionOutcome;

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) -> FrictionOutcome {
        solve_by_sweeps(self.network, self.tolerance, true, self.scratch)
    }
}

/// A coupled problem, its impulses, and what they add up to.
struct Network<'a> {
    problem: &'a CoupledFrictionProblem<'a>,
    /// Diagonal blocks of all contacts.
    diagonal: Vec<Matrix3<f64>>,
    r: &'a mut [f64],
    /// Y r.
    w: &'a mut [f64],
}

impl Network<'_> {
    /// Solves by Newton's method for the contacts with the largest errors and their neighbours, with all
    /// other impulses fixed.
    fn solve_worst(&mut self, tolerance: FrictionTolerance, interrupt: &Interrupt) {
        let selected = self.worst();
        let mut impulses: Vec<f64> =
            selected.iter().flat_map(|&i| <[f64; 3]>::from(self.impulse(i))).collect();
        let friction: Vec<Friction> = selected.iter().map(|&i| self.friction(i)).collect();
        let (w, b) = self.assemble(&selected);
        let problem = FrictionProblem { w: &w, b: &b, friction: &friction };
        if problem.residual(&impulses) > COMPLIANCE {
            let mut budget = SystemBudget::new(interrupt.clone());
            newton::improve(&problem, tolerance, &mut impulses, &mut budget);
            for (&i, impulse) in selected.iter().zip(impulses.chunks_exact(3)) {
                self.set_impulse(i, Vector3::from_column_slice(impulse));
            }
        }
    }

    /// W, row-major, and b of the `selected` contacts, ascending, with all other impulses fixed.
    fn assemble(&self, selected: &[usize]) -> (Vec<f64>, Vec<f64>) {
        let stride = 3 * selected.len();
        let (mut w, mut b) = (vec![0.0; stride * stride], Vec::with_capacity(stride));
        for (rows, &i) in w.chunks_exact_mut(3 * stride).zip(selected) {
            let mut free = self.velocity(i);
            for (column, &j) in selected.iter().enumerate() {
                let block = self.problem.block(i, j);
                free -= block * self.impulse(j);
                for (row, values) in rows.chunks_exact_mut(stride).zip(block.row_iter()) {
                    row[3 * column..][..3].iter_mut().zip(values.iter()).for_each(|(w, value)| *w = *value);
                }
            }
            b.extend_from_slice(free.as_slice());
        }
        (w, b)
    }

    /// The contacts that account for nearly all of the error, and their neighbours with an impulse or
    /// penetration, ascending.
    fn worst(&self) -> Vec<usize> {
        let error = |i: usize| {
            let mut residual = Residual::default();
            let (u, r) = (self.velocity(i), self.impulse(i));
            residual.add(self.block(i).trace(), u, &r, &self.free(i), self.friction(i));
            residual.error
        };
        let strands = |i: usize| self.problem.strands[i].iter().flatten().map(|strand| strand.first_unknown);
        let acts = |i: &usize| self.impulse(*i) != Vector3::zeros() || self.velocity(*i).x < 0.0;
        let acting: Vec<usize> = (0..self.contacts()).filter(acts).collect();
        let mut of_strands: Vec<(usize, usize)> =
            acting.iter().flat_map(|&i| strands(i).map(move |strand| (strand, i))).collect();
        of_strands.sort_unstable();
        let mut errors: Vec<(usize, f64)> = acting.iter().map(|&i| (i, error(i))).collect();
        errors.sort_by(|a, b| b.1.total_cmp(&a.1).then(a.0.cmp(&b.0)));
        let mut remaining = WORST * errors.iter().map(|(_, error)| error).sum::<f64>();
        let mut selected = BTreeSet::new();
        for (i, error) in errors {
            if remaining <= 0.0 || selected.len() >= SELECTED {
                break;
            }
            remaining -= error;
            for strand in strands(i) {
                let from = of_strands.partition_point(|of| of.0 < strand);
                selected.extend(of_strands[from..].iter().take_while(|of| of.0 == strand).map(|of| of.1));
            }
        }
        selected.into_iter().collect()
    }
}

impl System for Network<'_> {
    fn contacts(&self) -> usize {
        self.problem.friction.len()
    }

    fn block(&self, i: usize) -> Matrix3<f64> {
        self.diagonal[i]
    }

    fn free(&self, i: usize) -> Vector3<f64> {
        at(self.problem.b, i)
    }

    fn friction(&self, i: usize) -> Friction {
        self.problem.friction[i]
    }

    fn impulse(&self, i: usize) -> Vector3<f64> {
        at(self.r, i)
    }

    fn velocities(&mut self, u: &mut Vec<Vector3<f64>>) {
        self.problem.apply(self.r, self.w);
        let of = |i: usize| self.problem.velocity(self.w, i);
        (0..self.contacts()).into_par_iter().map(of).collect_into_vec(u);
    }

    #[inline(always)]
    fn velocity(&self, i: usize) -> Vector3<f64> {
        self.problem.velocity(self.w, i)
    }

    #[inline(always)]
    fn set_impulse(&mut self, i: usize, impulse: Vector3<f64>) {
        self.problem.push(self.w, i, &(impulse - self.impulse(i)));
        self.r[3 * i..3 * i + 3].copy_from_slice(impulse.as_slice());
    }
}
