//! Solver for many strands that touch each other and bodies.
//!
//! The blocks of W of active contacts are computed, and kept while they stay active. A sweep then costs nine
//! products for each contact that shares a strand with one, usually few; by way of the strands' unknowns, w =
//! Y r, it would cost six for each unknown. Checks of all contacts use w.

use super::budget::SystemBudget;
use super::coupled_problem::CoupledFrictionProblem;
use super::delassus::SparseDelassus;
use super::gauss_seidel::{FrictionOutcome, FrictionScratch, FrictionTolerance, System, solve_by_sweeps};
use super::newton;
use super::problem::{FrictionProblem, at};
use super::regularised::COMPLIANCE;
use super::residual::Residual;
use crate::geometry::Friction;
use nalgebra::{Matrix3, Vector3};
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
/// for them separately, and sweeps continue from there, as long as the residual decreases.
pub fn solve_coupled(
    problem: &CoupledFrictionProblem,
    tolerance: FrictionTolerance,
    r: &mut [f64],
    w: &mut [f64],
    scratch: &mut FrictionScratch,
) -> FrictionOutcome {
    let diagonal = (0..r.len() / 3).into_par_iter().map(|i| problem.block(i, i)).collect();
    let mut network = Network { problem, diagonal, delassus: SparseDelassus::default(), r, w };
    let mut outcome = solve_by_sweeps(&mut network, tolerance, true, scratch);
    for _ in 0..NEWTON_SOLVES {
        if outcome.residual <= tolerance.residual || !tolerance.continuation {
            break;
        }
        let before = network.r.to_vec();
        network.solve_worst(tolerance);
        let FrictionOutcome { sweeps, residual } = solve_by_sweeps(&mut network, tolerance, true, scratch);
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

/// A coupled problem, its impulses, and the blocks of W in use.
struct Network<'a> {
    problem: &'a CoupledFrictionProblem<'a>,
    /// Diagonal blocks of all contacts.
    diagonal: Vec<Matrix3<f64>>,
    /// Blocks of the active contacts.
    delassus: SparseDelassus,
    r: &'a mut [f64],
    /// Y r at the last check.
    w: &'a mut [f64],
}

impl Network<'_> {
    /// Solves by Newton's method for the contacts with the largest errors and their neighbours, with all
    /// other impulses fixed.
    fn solve_worst(&mut self, tolerance: FrictionTolerance) {
        let selected = self.worst();
        let mut impulses: Vec<f64> =
            selected.iter().flat_map(|&i| <[f64; 3]>::from(self.impulse(i))).collect();
        let friction: Vec<Friction> = selected.iter().map(|&i| self.friction(i)).collect();
        let (w, b) = self.assemble(&selected);
        let problem = FrictionProblem { w: &w, b: &b, friction: &friction };
        if problem.residual(&impulses) > COMPLIANCE {
            newton::improve(&problem, tolerance, &mut impulses, &mut SystemBudget::default());
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
            for (j, block) in self.delassus.line(i as u32) {
                let Ok(column) = selected.binary_search(&(*j as usize)) else { continue };
                free -= block * self.impulse(*j as usize);
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
        let mut errors: Vec<(usize, f64)> =
            self.delassus.contacts().iter().map(|&i| (i as usize, error(i as usize))).collect();
        errors.sort_by(|a, b| b.1.total_cmp(&a.1).then(a.0.cmp(&b.0)));
        let mut remaining = WORST * errors.iter().map(|(_, error)| error).sum::<f64>();
        let mut selected = BTreeSet::new();
        for (i, error) in errors {
            if remaining <= 0.0 || selected.len() >= SELECTED {
                break;
            }
            remaining -= error;
            let neighbours = self.delassus.line(i as u32).iter().map(|(j, _)| *j as usize);
            let acting = |j: &usize| self.impulse(*j) != Vector3::zeros() || self.velocity(*j).x < 0.0;
            selected.extend(neighbours.filter(acting));
            selected.insert(i);
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

    fn set_active(&mut self, active: &[u32]) {
        self.delassus = SparseDelassus::new(self.problem, active, &self.delassus);
    }

    fn velocity(&self, i: usize) -> Vector3<f64> {
        let line = self.delassus.line(i as u32).iter();
        line.fold(self.free(i), |u, (j, block)| u + block * self.impulse(*j as usize))
    }

    fn set_impulse(&mut self, i: usize, impulse: Vector3<f64>) {
        self.r[3 * i..3 * i + 3].copy_from_slice(impulse.as_slice());
    }
}
