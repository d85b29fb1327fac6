//! The solver compared with enumeration, the law itself, and problems with known solutions.

use super::dense::Dense;
use super::gauss_seidel::solve_by_sweeps;
use super::residual::project_on_cone;
use super::*;
use crate::geometry::Friction;
use crate::math::random::Random;
use nalgebra::{DMatrix, DVector, Matrix2, Matrix3, Vector2, Vector3};
use proptest::prelude::*;

mod continuation;

impl Random {
    /// A symmetric positive definite matrix with eigenvalues of at least 1e-3.
    fn delassus_block(&mut self, spread: f64) -> Matrix3<f64> {
        let stretch = Matrix3::from_diagonal(&Vector3::from_fn(|_, _| spread.powf(self.draw())));
        let m = Matrix3::from_fn(|_, _| self.draw()) * stretch;
        m * m.transpose() + Matrix3::identity() * 1e-3
    }
}

fn all(mu: &[f64]) -> Vec<Friction> {
    mu.iter().map(|mu| (*mu).into()).collect()
}

/// All solutions of one contact: take-off, stick, and slip in any direction, by scanning and bisection.
fn enumerate(w: &Matrix3<f64>, q: &Vector3<f64>, mu: f64) -> Vec<Vector3<f64>> {
    let mut solutions = Vec::new();
    if q.x >= 0.0 {
        solutions.push(Vector3::zeros());
    }
    if let Some(r) = w.lu().solve(&-q)
        && r.yz().norm() <= mu * r.x
    {
        solutions.push(r);
    }
    // Slip with friction along e(θ): r_N = −q_N / den, multiplied by den so that den = 0 is finite. u_T is
    // opposite to e where their cross product vanishes and their dot product is negative.
    let slip = |theta: f64| {
        let e = Vector2::new(theta.cos(), theta.sin());
        let direction = Vector3::new(1.0, mu * e.x, mu * e.y);
        let den = (w.row(0) * direction).x;
        let u = (w * direction * -q.x + q * den).yz();
        (e.x * u.y - e.y * u.x, e.dot(&u), den, direction * (-q.x / den))
    };
    let count = 2000;
    for k in 0..count {
        let angle = |x: f64| x / count as f64 * std::f64::consts::TAU;
        let (mut lo, mut hi) = (angle(k as f64), angle(k as f64 + 1.0));
        let side = slip(lo).0 > 0.0;
        if (slip(hi).0 > 0.0) == side {
            continue;
        }
        for _ in 0..80 {
            let mid = 0.5 * (lo + hi);
            if (slip(mid).0 > 0.0) == side { lo = mid } else { hi = mid }
        }
        let (_, along, den, r) = slip(lo);
        if along / den <= 0.0 && r.x >= 0.0 {
            solutions.push(r);
        }
    }
    solutions
}

#[test]
fn local_solve_agrees_with_enumeration() {
    let mut random = Random::new(1);
    let mut kinds = [0; 3];
    for k in 0..5000 {
        let w = random.delassus_block(if k % 2 == 0 { 1.0 } else { 10.0 });
        let q = random.vector();
        let mu = (random.draw() + 1.0) * if k % 3 == 0 { 1.0 } else { 0.3 } + 0.01;
        let r = solve_local(&w, &q, mu.into());
        let found = enumerate(&w, &q, mu);
        let error = found.iter().map(|s| (s - r).norm()).fold(f64::INFINITY, f64::min);
        assert!(error <= 1e-10 * (1.0 + r.norm()), "case {k}: {r:?} is not among {found:?} {w:?} {q:?} {mu}");
        let slack = mu * r.x - r.yz().norm();
        kinds[if r.x == 0.0 {
            0
        } else if slack > 1e-9 {
            1
        } else {
            2
        }] += 1;
    }
    assert!(kinds.iter().all(|&n| n > 200), "every case must occur: {kinds:?}");
}

/// Asserts the law at every contact: cone, no penetration, complementarity, friction opposite to slip.
fn check_law(problem: &FrictionProblem, r: &[f64], tolerance: f64) {
    for i in 0..problem.len() {
        let u = problem.velocity(r, i);
        let r = Vector3::from_column_slice(&r[3 * i..3 * i + 3]);
        let mu = problem.friction[i].mu_k;
        assert!(r.x >= 0.0 && r.yz().norm() <= mu * r.x * (1.0 + 1e-12) + tolerance);
        assert!(u.x >= -tolerance, "penetrates: {u}");
        assert!((u.x * r.x).abs() <= tolerance, "impulse of a separating contact: {u} {r}");
        let sliding = u.yz() * r.yz().norm() + r.yz() * u.yz().norm();
        assert!(sliding.norm() <= tolerance, "friction is not opposite to the slip: {u} {r}");
        assert!((mu * r.x - r.yz().norm()) * u.yz().norm() <= tolerance, "slips inside the cone: {u} {r}");
    }
}

/// W = M Mᵀ, b and µ of a random problem: `contacts` on a system of `freedoms`.
fn system(random: &mut Random, contacts: usize, freedoms: usize) -> (Vec<f64>, Vec<f64>, Vec<f64>) {
    let n = 3 * contacts;
    let jacobian: Vec<f64> = (0..n * freedoms).map(|_| random.draw()).collect();
    let row = |i: usize| &jacobian[i * freedoms..(i + 1) * freedoms];
    let mut w = vec![0.0; n * n];
    for i in 0..n {
        for j in 0..n {
            w[i * n + j] = row(i).iter().zip(row(j)).map(|(a, b)| a * b).sum();
        }
    }
    // b = J v keeps problems of low rank solvable: −v opens all contacts.
    let v: Vec<f64> = (0..freedoms).map(|_| random.draw()).collect();
    let b = (0..n).map(|i| row(i).iter().zip(&v).map(|(a, b)| a * b).sum()).collect();
    let mu = (0..contacts).map(|_| 0.2 + 0.1 * random.draw()).collect();
    (w, b, mu)
}

#[test]
fn solutions_obey_the_law_at_every_contact() {
    let mut random = Random::new(7);
    for contacts in [1, 2, 5, 12] {
        for _ in 0..20 {
            let (w, b, mu) = system(&mut random, contacts, 4 * contacts + 3);
            let problem = FrictionProblem { w: &w, b: &b, friction: &all(&mu) };
            let mut r = vec![0.0; 3 * contacts];
            let outcome = solve(
                &problem,
                FrictionTolerance { residual: 1e-12, sweeps: 5000, continuation: true },
                &mut r,
                &mut FrictionScratch::default(),
            );
            assert!(outcome.residual <= 1e-12, "{contacts} contacts: {outcome:?}");
            check_law(&problem, &r, 1e-9);
        }
    }
}

#[test]
fn problems_with_more_contacts_than_freedoms_converge() {
    let mut random = Random::new(11);
    for _ in 0..20 {
        let (w, b, mu) = system(&mut random, 10, 12);
        let problem = FrictionProblem { w: &w, b: &b, friction: &all(&mu) };
        let mut r = vec![0.0; 30];
        let outcome = solve(
            &problem,
            FrictionTolerance { residual: 1e-8, sweeps: 20_000, continuation: true },
            &mut r,
            &mut FrictionScratch::default(),
        );
        assert!(outcome.residual <= 1e-8, "{outcome:?}");
        check_law(&problem, &r, 1e-5);
    }
}

#[test]
fn next_to_no_friction_leaves_the_impulse_of_none() {
    let mut random = Random::new(17);
    for mu in [1e-9, 1e-100, 1e-300, f64::MIN_POSITIVE, -1e-15] {
        for _ in 0..20 {
            let w = random.delassus_block(1.0);
            let q = Vector3::new(-1.0, random.draw(), random.draw());
            let r = solve_local(&w, &q, mu.into());
            assert!((r - Vector3::x() / w[(0, 0)]).norm() < 1e-8 * r.x, "{mu}: {r:?}");
        }
    }
}

#[test]
fn sticking_uses_the_static_and_sliding_the_kinetic_coefficient() {
    let mut random = Random::new(13);
    let mut kinds = [0; 3];
    for case in 0..5000 {
        let (w, q) = (random.delassus_block(1.0), random.vector());
        let mu_k = 0.3 * (random.draw() + 1.01);
        let mu_s = mu_k * (1.5 + 0.5 * random.draw());
        let r = solve_local(&w, &q, Friction { mu_s, mu_k });
        let stick = enumerate(&w, &q, mu_s).into_iter().find(|r| (w * r + q).norm() < 1e-10);
        let (expected, kind) = match stick {
            _ if q.x >= 0.0 => (vec![Vector3::zeros()], 0),
            Some(stick) => (vec![stick], 1),
            None => (enumerate(&w, &q, mu_k), 2),
        };
        kinds[kind] += 1;
        let error = expected.iter().map(|s| (s - r).norm()).fold(f64::INFINITY, f64::min);
        assert!(error <= 1e-10 * (1.0 + r.norm()), "case {case}: {r:?} is not among {expected:?}");
    }
    assert!(kinds.iter().all(|&n| n > 100), "every case must occur: {kinds:?}");
}

#[test]
fn a_scaled_tangent_makes_the_cone_elliptic() {
    // Friction along the second tangent is `across` times that along the first. With the second axis scaled
    // by it the cone is round, impulses are divided by the lengths of the axes, and velocities multiplied by
    // them.
    let mut random = Random::new(29);
    let mut kinds = [0; 3];
    for case in 0..2000 {
        let (w, q) = (random.delassus_block(1.0), random.vector());
        let (mu, across) = (0.8 * (random.draw() + 1.01), 2.0_f64.powf(random.draw()));
        let axes = Matrix3::from_diagonal(&Vector3::new(1.0, 1.0, across));
        let r = axes * solve_local(&(axes * w * axes), &(axes * q), mu.into());
        let u = w * r + q;
        let close = 1e-10 * (1.0 + r.norm());
        assert!(r.x >= 0.0 && u.x > -close && (r.x * u.x).abs() < close, "case {case}");
        let used = (r.y / mu).hypot(r.z / (mu * across));
        assert!(used <= r.x + close, "case {case}: outside the ellipse");
        if r.x == 0.0 {
            kinds[0] += 1;
        } else if u.yz().norm() < close {
            kinds[1] += 1;
        } else {
            kinds[2] += 1;
            // The dissipation is the largest that the ellipse allows.
            let most = (0..3600).map(|k| {
                let (sin, cos) = (f64::from(k) / 3600.0 * std::f64::consts::TAU).sin_cos();
                -mu * r.x * (cos * u.y + across * sin * u.z)
            });
            let (most, braked) = (most.fold(0.0, f64::max), -r.yz().dot(&u.yz()));
            assert!((braked / most - 1.0).abs() < 2e-6, "case {case}: dissipates {braked} of {most}");
        }
    }
    assert!(kinds.iter().all(|&n| n > 100), "every case must occur: {kinds:?}");
}

#[test]
fn a_warm_start_at_the_solution_needs_no_sweep() {
    let (w, b, mu) = system(&mut Random::new(3), 6, 30);
    let problem = FrictionProblem { w: &w, b: &b, friction: &all(&mu) };
    let mut r = vec![0.0; 18];
    assert!(
        solve(&problem, FrictionTolerance::default(), &mut r, &mut FrictionScratch::default()).sweeps > 0
    );
    assert!(r.iter().any(|&x| x > 0.0));
    assert_eq!(
        solve(&problem, FrictionTolerance::default(), &mut r, &mut FrictionScratch::default()).sweeps,
        0
    );
}

#[test]
fn a_block_on_an_incline_slides_above_the_friction_angle() {
    let (mass, gravity, step, mu) = (2.0, 9.81, 0.01, 0.4);
    let w: Vec<f64> = (Matrix3::identity() / mass).iter().copied().collect();
    for (angle, slides) in [(0.99 * f64::atan(mu), false), (1.01 * f64::atan(mu), true)] {
        let b = [-gravity * angle.cos() * step, gravity * angle.sin() * step, 0.0];
        let problem = FrictionProblem { w: &w, b: &b, friction: &all(&[mu]) };
        let mut r = [0.0; 3];
        solve(&problem, FrictionTolerance::default(), &mut r, &mut FrictionScratch::default());
        let u = problem.velocity(&r, 0);
        let acceleration = if slides { gravity * (angle.sin() - mu * angle.cos()) } else { 0.0 };
        assert!((r[0] - mass * gravity * angle.cos() * step).abs() < 1e-12);
        assert!((u.y / step - acceleration).abs() < 1e-10, "{} against {acceleration}", u.y / step);
        assert!((-r[1]).min(mu * r[0]) > 0.0);
    }
}

#[test]
fn immovable_contacts_keep_their_impulse() {
    let problem = FrictionProblem { w: &[0.0; 9], b: &[-1.0, 0.0, 0.0], friction: &[0.3.into()] };
    let mut r = [0.0; 3];
    let outcome = solve(&problem, FrictionTolerance::default(), &mut r, &mut FrictionScratch::default());
    assert_eq!((r, outcome.residual), ([0.0; 3], 0.0));
}

proptest! {
    #[test]
    fn projection_is_the_nearest_point_of_the_cone(
        v in prop::array::uniform3(-2.0f64..2.0), p in prop::array::uniform3(-2.0f64..2.0), mu in 0.01f64..2.0
    ) {
        let v = Vector3::from(v);
        let nearest = project_on_cone(v, mu);
        prop_assert!(nearest.yz().norm() <= mu * nearest.x + 1e-12);
        let mut other = Vector3::from(p);
        other.x = other.x.abs();
        let scale = (mu * other.x / other.yz().norm()).min(1.0);
        other.y *= scale;
        other.z *= scale;
        prop_assert!((v - nearest).norm() <= (v - other).norm() + 1e-12);
    }
}

#[test]
fn coupled_solutions_obey_the_law_of_the_assembled_problem() {
    let (strands, n, contacts) = (5, 12, 14);
    let mut random = Random::new(5);
    let mut sides = Vec::new();
    let mut rows = Vec::new();
    for i in 0..contacts {
        let (a, b) = (i % strands, (2 * i + 1) % strands);
        let ends = [Some(a), (i % 3 > 0 && b != a).then_some(b)];
        sides.push(ends.map(|end| {
            end.map(|s| {
                let side = StrandRows { first_unknown: s * n, unknowns: n, offset: rows.len() };
                rows.extend((0..3 * n).map(|_| random.draw()));
                side
            })
        }));
    }
    let b: Vec<f64> = (0..3 * contacts).map(|_| random.draw() - 0.3).collect();
    let mu: Vec<f64> = (0..contacts).map(|i| 0.1 * (i % 8) as f64).collect();
    // Yᵀ as a dense matrix, 3c rows of all unknowns.
    let mut dense = vec![0.0; 3 * contacts * strands * n];
    for (i, both) in sides.iter().enumerate() {
        for side in both.iter().flatten() {
            for d in 0..3 {
                for k in 0..n {
                    dense[(3 * i + d) * strands * n + side.first_unknown + k] +=
                        rows[side.offset + d * n + k];
                }
            }
        }
    }
    let line = |i: usize| &dense[i * strands * n..(i + 1) * strands * n];
    let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
    let w: Vec<f64> = (0..9 * contacts * contacts)
        .map(|k| dot(line(k / (3 * contacts)), line(k % (3 * contacts))))
        .collect();
    let (mut r, mut moved) = (vec![0.0; 3 * contacts], vec![0.0; strands * n]);
    let coupled = CoupledFrictionProblem { strands: &sides, rows: &rows, b: &b, friction: &all(&mu) };
    let outcome = solve_coupled(
        &coupled,
        FrictionTolerance { residual: 1e-11, sweeps: 20_000, continuation: true },
        &mut r,
        &mut moved,
        &mut FrictionScratch::default(),
        &Interrupt::default(),
    );
    let problem = FrictionProblem { w: &w, b: &b, friction: &all(&mu) };
    assert!(outcome.residual <= 1e-11 && outcome.sweeps > 1, "{outcome:?}");
    assert!((problem.residual(&r) - outcome.residual).abs() < 1e-10);
    assert!(r.chunks(3).filter(|r| r[0] > 0.0).count() > 3);
    check_law(&problem, &r, 1e-8);
    for (k, moved) in moved.iter().enumerate() {
        let sum: f64 = (0..3 * contacts).map(|i| line(i)[k] * r[i]).sum();
        assert!((sum - moved).abs() < 1e-12);
    }
}

/// A planar string over an arc, with stretching, bending and springs at both ends, and next to no inertia.
/// The end of the second spring is pulled by a millimetre.
struct Rope {
    h: DMatrix<f64>,
    j: DMatrix<f64>,
    pull: DVector<f64>,
    ends: [DVector<f64>; 2],
}

/// Stiffness of the springs at the ends, N/m.
const SPRING: f64 = 10.0;
/// Displacement of the end of the second spring, m.
const PULLED: f64 = 1e-3;

impl Rope {
    fn over(angle: f64, nodes: usize) -> Self {
        let n = 2 * nodes;
        let turn = angle / nodes as f64;
        let direction = |theta: f64| [theta.cos(), -theta.sin()];
        // The chord up to a node; one more follows the last.
        let chord = |i: usize| direction(turn * i as f64);
        let mut h = DMatrix::identity(n, n) * 1e-6;
        // Bending resists displacement of a node off the arc.
        let mut bend = |i: usize, [c, s]: [f64; 2]| {
            let mut row = DVector::zeros(n);
            row.rows_mut(2 * i, 2).copy_from_slice(&[-s, c]);
            h += &row * row.transpose() * 1e-3;
        };
        (0..nodes).for_each(|i| bend(i, direction(turn * (i as f64 + 0.5))));
        let along = |i: usize, node: usize| {
            let mut row = DVector::zeros(n);
            row.rows_mut(2 * node, 2).copy_from_slice(&chord(i));
            row
        };
        for i in 1..nodes {
            let stretch = along(i, i) - along(i, i - 1);
            h += &stretch * stretch.transpose() * 1e4;
        }
        let ends = [along(0, 0), along(nodes, nodes - 1)];
        ends.iter().for_each(|end| h += end * end.transpose() * SPRING);
        let mut j = DMatrix::zeros(3 * nodes, n);
        for i in 0..nodes {
            let [c, s] = direction(turn * (i as f64 + 0.5));
            j.fixed_view_mut::<2, 2>(3 * i, 2 * i).copy_from(&Matrix2::new(-s, c, c, s));
        }
        Rope { pull: &ends[1] * (SPRING * PULLED), h, j, ends }
    }

    /// Force at the second end over that at the first.
    fn ratio(&self, r: &[f64]) -> f64 {
        let forces = &self.pull + self.j.tr_mul(&DVector::from_column_slice(r));
        let x = self.h.clone().cholesky().unwrap().solve(&forces);
        (PULLED - self.ends[1].dot(&x)) / self.ends[0].dot(&x)
    }
}

#[test]
fn a_string_sliding_over_an_arc_obeys_the_capstan_equation() {
    for (angle, mu) in [(1.5, 0.2), (3.0, 0.5), (6.0, 0.3)] {
        let nodes = 40;
        let rope = Rope::over(angle, nodes);
        let h = rope.h.clone().cholesky().unwrap();
        let b = &rope.j * h.solve(&rope.pull);
        let w = &rope.j * h.solve(&rope.j.transpose());
        let friction = vec![mu.into(); nodes];
        let problem = FrictionProblem { w: w.as_slice(), b: b.as_slice(), friction: &friction };
        let tolerance = FrictionTolerance { residual: 1e-6, sweeps: 100, continuation: true };
        let mut r = vec![0.0; 3 * nodes];
        let sweeps = solve_by_sweeps(
            &mut Dense { problem: &problem, r: &mut r },
            tolerance,
            false,
            &mut FrictionScratch::default(),
        );
        assert!(sweeps.residual > 5e-3, "sweeps alone suffice: {sweeps:?}");
        r.fill(0.0);
        let outcome = solve(&problem, tolerance, &mut r, &mut FrictionScratch::default());
        assert!(outcome.residual <= 1e-4, "{outcome:?}");
        assert!((problem.residual(&r) / outcome.residual - 1.0).abs() < 1e-9);
        // The ratio for nodes with an angle between the chords; that of an arc is nearly the same.
        let half = (0.5 * angle / f64::from(nodes as u32)).tan();
        let ratio = ((1.0 + mu * half) / (1.0 - mu * half)).powi(nodes as i32);
        assert!((rope.ratio(&r) / ratio - 1.0).abs() < 2e-4, "{} {ratio}", rope.ratio(&r));
        assert!((ratio / (mu * angle).exp() - 1.0).abs() < 5e-3);
    }
}

#[test]
fn wedged_contacts_that_sweeps_do_not_solve_converge() {
    let mut random = Random::new(31);
    let mut needed_newton = 0;
    for (contacts, n, mu) in [(14, 12, 0.8), (20, 21, 0.5)] {
        for case in 0..60 {
            let rows: Vec<f64> = (0..3 * contacts * n).map(|_| random.draw()).collect();
            // b = J v is always solvable.
            let v: Vec<f64> = (0..n).map(|_| random.draw()).collect();
            let b: Vec<f64> =
                rows.chunks_exact(n).map(|row| row.iter().zip(&v).map(|(a, b)| a * b).sum()).collect();
            let sides: Vec<_> = (0..contacts)
                .map(|i| [Some(StrandRows { first_unknown: 0, unknowns: n, offset: 3 * n * i }), None])
                .collect();
            let friction = vec![mu.into(); contacts];
            let problem = CoupledFrictionProblem { strands: &sides, rows: &rows, b: &b, friction: &friction };
            let (mut r, mut moved) = (vec![0.0; 3 * contacts], vec![0.0; n]);
            let tolerance = FrictionTolerance { residual: 1e-6, sweeps: 200, continuation: true };
            let outcome = solve_coupled(
                &problem,
                tolerance,
                &mut r,
                &mut moved,
                &mut FrictionScratch::default(),
                &Interrupt::default(),
            );
            assert!(outcome.residual <= 1e-6, "{contacts} contacts, case {case}: {outcome:?}");
            needed_newton += u32::from(outcome.sweeps > tolerance.sweeps);
        }
    }
    assert!(needed_newton > 0, "sweeps alone suffice");
}
