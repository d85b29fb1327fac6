//! Newton's method and continuation on the smoothed law.

use super::super::budget::SystemBudget;
use super::super::continuation::{Path, follow};
use super::super::dense::{Dense, solve};
use super::super::gauss_seidel::{FrictionScratch, FrictionTolerance, solve_by_sweeps};
use super::super::newton::{descend, improve};
use super::super::regularised::COMPLIANCE;
use super::super::smoothed_problem::SmoothedProblem;
use super::*;

/// Contacts along a chain with half as many unknowns as the contacts have components, and a small compliance
/// of each: neighbours are coupled.
fn wedged(random: &mut Random, contacts: usize) -> (Vec<f64>, Vec<f64>) {
    let (n, freedoms) = (3 * contacts, 3 * contacts / 2);
    let rows = DMatrix::from_fn(n, freedoms, |i, j| {
        let x = random.draw();
        let distance = i as f64 / n as f64 - j as f64 / freedoms as f64;
        if distance.abs() < 0.15 { x } else { 0.0 }
    });
    let mobility = &rows * rows.transpose() + DMatrix::identity(n, n) * 1e-6;
    let free = rows * DVector::from_fn(freedoms, |_, _| random.draw());
    (mobility.as_slice().to_vec(), free.as_slice().to_vec())
}

#[test]
fn continuation_finds_solutions_that_descent_in_tau_does_not() {
    let mut random = Random::new(12);
    let tolerance = FrictionTolerance { residual: 1e-6, ..FrictionTolerance::default() };
    let (mut failed, mut turned_back) = (0, 0);
    for case in 0..240 {
        let contacts = 8 + case % 12;
        let (w, b) = wedged(&mut random, contacts);
        let friction = vec![0.3.into(); contacts];
        let problem = FrictionProblem { w: &w, b: &b, friction: &friction };
        let mut r = vec![0.0; 3 * contacts];
        let smoothed = SmoothedProblem::new(&problem, &r).unwrap();
        failed += u32::from(descend(&smoothed, &problem, 1e-8, &mut r, &mut SystemBudget::default()) > 1e-5);
        r.fill(0.0);
        follow(&smoothed, &problem, 1e-8, &mut r, &mut SystemBudget::default());
        let residual = problem.compliant_residual(&r, COMPLIANCE);
        assert!(residual <= 1e-8, "case {case}: {residual}");
        r.fill(0.0);
        let improved = improve(&problem, tolerance, &mut r, &mut SystemBudget::default());
        assert!(improved <= 1e-5, "case {case}: {improved}");
        let mut budget = SystemBudget::default();
        let mut path = Path::enter(&smoothed, &mut budget).unwrap();
        let n = smoothed.len();
        turned_back += u32::from((0..60).any(|_| path.step() && path.tangent[n] > 0.0));
    }
    assert!(
        failed > 0 && turned_back > 0,
        "the cases are too easy: {failed} failed, {turned_back} turned back"
    );
}

#[test]
fn a_strand_takes_no_more_systems_than_its_sub_step_may() {
    let mut random = Random::new(14);
    let tolerance = FrictionTolerance { residual: 1e-15, sweeps: 20, continuation: true };
    let mut scratch = FrictionScratch::default();
    let mut improved = 0;
    let mut solve_wedged = |scratch: &mut FrictionScratch| {
        let (w, b) = wedged(&mut random, 12);
        let problem = FrictionProblem { w: &w, b: &b, friction: &[0.3.into(); 12] };
        let mut by_sweeps = vec![0.0; 36];
        let sweeps = solve_by_sweeps(
            &mut Dense { problem: &problem, r: &mut by_sweeps },
            tolerance,
            false,
            &mut FrictionScratch::default(),
        );
        let outcome = solve(&problem, tolerance, &mut [0.0; 36], scratch);
        assert!(outcome.residual <= sweeps.residual);
        outcome.residual < sweeps.residual
    };
    for _ in 0..400 {
        let left = scratch.budget.left();
        let better = solve_wedged(&mut scratch);
        improved += u32::from(better);
        assert!(left > 0 || !better);
        assert!(scratch.budget.left() <= left);
    }
    assert!(scratch.budget.is_exhausted() && improved > 0);
    scratch.budget = SystemBudget::new(Interrupt::new(|| true));
    assert!((0..10).all(|_| !solve_wedged(&mut scratch)));
    scratch.budget = SystemBudget::default();
    assert!((0..10).any(|_| solve_wedged(&mut scratch)));
}

#[test]
fn the_frictionless_path_is_monotonic_in_tau() {
    let mut random = Random::new(13);
    for _ in 0..20 {
        let (w, b) = wedged(&mut random, 10);
        let problem = FrictionProblem { w: &w, b: &b, friction: &[0.0.into(); 10] };
        let smoothed = SmoothedProblem::new(&problem, &[0.0; 30]).unwrap();
        let mut budget = SystemBudget::default();
        let mut path = Path::enter(&smoothed, &mut budget).unwrap();
        while path.at[smoothed.len()] > 1e-6_f64.ln() {
            assert!(path.step() && path.tangent[smoothed.len()] < 0.0);
        }
    }
}
