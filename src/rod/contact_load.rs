//! Linearisation of a rod under contact forces: the forces move with the rod, so they are part of its
//! stiffness.

use super::held_frame::HoldingMoment;
use super::hessian::hessian;
use super::model::Rod;
use super::newton::Solver;
use super::potential::{Load, gradient};
use super::sensitivity::Sensitivity;
use super::shape::RodShape;
use crate::math::cholesky;
use crate::math::frame::any_frame;
use crate::math::lanes::Twist;
use nalgebra::{DMatrix, SymmetricEigen, Vector3};
use serde::{Deserialize, Serialize};

/// Stiffness added at a contact along its constrained directions, relative to the rod's own stiffness there,
/// if the contact forces make the Hessian indefinite. It affects the convergence of the contact rounds, not
/// their result.
const STIFFENING: f64 = 1e2;

/// The same of ties alone, if that does not suffice, as near the load that buckles the rod between them. Places that
/// friction holds may have to slip, which so much would prevent.
const STIFFENING_OF_TIES: f64 = 1e5;

const AXES: [Vector3<f64>; 3] =
    [Vector3::new(1.0, 0.0, 0.0), Vector3::new(0.0, 1.0, 0.0), Vector3::new(0.0, 0.0, 1.0)];

/// Most iterations for each eigenvalue of a geometric stiffness.
const EIGEN_ITERATIONS: usize = 50;

/// A contact force at a place of a rod.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct ContactLoad {
    /// Segment of the place: from point `segment` to the next.
    pub segment: usize,
    /// Fraction of the segment, 0..=1.
    pub u: f64,
    /// Force, N, world axes.
    pub force: Vector3<f64>,
    /// Unit normal of the surface, world axes; zero if a tie holds the place.
    pub normal: Vector3<f64>,
    /// Whether the contact constrains all directions (sticking friction, attachment).
    pub sticks: bool,
    /// Unit axis along which one that sticks nevertheless slides, if any: a tie.
    pub slides_along: Option<Vector3<f64>>,
    /// Moment that holds the frame there, if one does.
    pub moment: Option<HoldingMoment>,
}

impl ContactLoad {
    /// Whether it is that of a tie.
    pub fn is_of_tie(&self) -> bool {
        self.normal == Vector3::zeros()
    }

    /// The two points of the segment with their weights in the place.
    fn points(&self) -> [(usize, f64); 2] {
        [(self.segment, 1.0 - self.u), (self.segment + 1, self.u)]
    }

    /// Adds the Jacobian row of the place along the world direction `d` to `row`.
    fn add_row(&self, d: &Vector3<f64>, shape: &RodShape, sensitivity: &Sensitivity, row: &mut [f64]) {
        for (k, weight) in self.points() {
            sensitivity.add_row(k, &shape.x(k), d, weight, row);
        }
    }

    /// Directions that the contact constrains.
    fn constrained(&self) -> impl Iterator<Item = Vector3<f64>> {
        let (axes, count) = match (self.sticks, &self.slides_along) {
            (true, None) => (AXES, 3),
            (true, Some(axis)) => {
                let frame = any_frame(axis);
                ([0, 1, 2].map(|d| frame.column(d).into()), 2)
            }
            (false, _) => ([self.normal; 3], 1),
        };
        axes.into_iter().take(count)
    }
}

/// Buffers of [`Solver::linearise_loaded`] and [`Solver::linearise_stiffened`].
#[derive(Debug, Default)]
pub struct ContactLoadBuffers {
    load: Load,
    wrench: Vec<Twist<f64>>,
    hessian: Vec<f64>,
    /// The Hessian with the geometric stiffness of twice the forces.
    doubled: Vec<f64>,
    row: Vec<f64>,
}

impl Solver {
    /// [`Solver::linearise`] of a rod under `contacts` (`docs/theory.md` §5). The Hessian includes their
    /// geometric stiffness; the direction excludes their forces and moments, which are the unknowns of the
    /// contact problem. If they make the Hessian indefinite (a strand buckled against a wall), it is stiffened along
    /// the constrained directions, which does not affect motions that satisfy the constraints. If that does
    /// not suffice, the contacts are ignored.
    pub fn linearise_loaded(
        &mut self,
        rod: &Rod,
        load: &Load,
        contacts: &[ContactLoad],
        q: &[f64],
        buffers: &mut ContactLoadBuffers,
    ) -> bool {
        if contacts.is_empty() {
            return self.linearise(rod, load, q);
        }
        let ContactLoadBuffers { load: loaded, wrench, hessian: matrix, row, .. } = buffers;
        let n = q.len();
        loaded.clone_from(load);
        for contact in contacts {
            for (k, weight) in contact.points() {
                loaded.add_force(k, &(contact.force * weight));
                if let Some(HoldingMoment { frame, moment }) = &contact.moment {
                    loaded.add_moment(k, frame, &(moment * weight));
                }
            }
        }
        self.sensitivity.update(rod, &self.shape, q);
        let (core, shape, sensitivity) = (&rod.core, &self.shape, &self.sensitivity);
        gradient(core, loaded, shape, sensitivity, q, &mut self.direction, wrench);
        hessian(core, loaded, shape, sensitivity, wrench, q, 1.0, matrix);
        if contacts.iter().any(|contact| contact.moment.is_some()) {
            // Moments of different frames at one point are exact in none.
            gradient(core, load, shape, sensitivity, q, &mut self.direction, wrench);
            self.direction.iter_mut().for_each(|d| *d = -*d);
        } else {
            self.direction.iter_mut().for_each(|d| *d = -*d);
            for contact in contacts {
                contact.add_row(&-contact.force, &self.shape, &self.sensitivity, &mut self.direction);
            }
        }
        self.factor.clone_from(matrix);
        let mut definite = cholesky::factor(&mut self.factor, n) == 1;
        for (stiffening, of_all) in [(STIFFENING, true), (STIFFENING_OF_TIES, false)] {
            let stiffened = || contacts.iter().filter(move |contact| of_all || contact.is_of_tie());
            if definite || stiffened().next().is_none() {
                break;
            }
            for contact in stiffened() {
                for d in contact.constrained() {
                    row.clear();
                    row.resize(n, 0.0);
                    contact.add_row(&d, &self.shape, &self.sensitivity, row);
                    add_spring(row, stiffening, matrix);
                }
                let place = (contact.segment, contact.u);
                for (moment, d) in contact.moment.iter().flat_map(|moment| AXES.map(|d| (moment, d))) {
                    row.clear();
                    row.resize(n, 0.0);
                    self.sensitivity.add_rotation_row(&self.shape, place, &moment.frame, &d, row);
                    add_spring(row, stiffening, matrix);
                }
            }
            self.factor.clone_from(matrix);
            definite = cholesky::factor(&mut self.factor, n) == 1;
        }
        if !definite {
            return self.linearise(rod, load, q);
        }
        cholesky::solve_lower(&self.factor, n, &mut self.direction);
        true
    }
}

impl Solver {
    /// [`Solver::linearise`] of a rod under `forces`: segment, fraction of it, force, N, world. The Hessian
    /// includes their geometric stiffness, or, where that more than halves a stiffness, the part of it that stiffens
    /// the rod (`docs/theory.md` §5.2); the direction excludes the forces.
    pub fn linearise_stiffened(
        &mut self,
        rod: &Rod,
        load: &Load,
        forces: &[(usize, f64, Vector3<f64>)],
        q: &[f64],
        buffers: &mut ContactLoadBuffers,
    ) -> bool {
        if forces.is_empty() {
            return self.linearise(rod, load, q);
        }
        let ContactLoadBuffers { load: loaded, wrench, hessian: matrix, doubled, .. } = buffers;
        let n = q.len();
        loaded.clone_from(load);
        for (k, u, force) in forces {
            loaded.add_force(*k, &(force * (1.0 - u)));
            loaded.add_force(k + 1, &(force * *u));
        }
        self.sensitivity.update(rod, &self.shape, q);
        let (core, shape, sensitivity) = (&rod.core, &self.shape, &self.sensitivity);
        gradient(core, loaded, shape, sensitivity, q, &mut self.direction, wrench);
        hessian(core, loaded, shape, sensitivity, wrench, q, 1.0, matrix);
        gradient(core, load, shape, sensitivity, q, &mut self.direction, wrench);
        hessian(core, load, shape, sensitivity, wrench, q, 1.0, &mut self.factor);
        self.direction.iter_mut().for_each(|d| *d = -*d);
        // If H + 2K is definite, H + K is above H/2.
        doubled.clear();
        doubled.extend(matrix.iter().zip(&self.factor).map(|(loaded, alone)| 2.0 * loaded - alone));
        if cholesky::factor(doubled, n) == 1 {
            self.factor.clone_from(matrix);
        } else if !add_stiffening(matrix, &mut self.factor, n) {
            return self.linearise(rod, load, q);
        }
        if cholesky::factor(&mut self.factor, n) != 1 {
            return self.linearise(rod, load, q);
        }
        cholesky::solve_lower(&self.factor, n, &mut self.direction);
        true
    }
}

/// Adds to the Hessian `alone` of a rod without forces the part with positive eigenvalues of their geometric
/// stiffness, which the one `loaded` has in addition; both are lower triangles of `n` rows. Returns `false` if the
/// eigenvalues are not found.
fn add_stiffening(loaded: &[f64], alone: &mut [f64], n: usize) -> bool {
    let entry = |a: usize, b: usize| a.max(b) * n + a.min(b);
    let geometric = DMatrix::from_fn(n, n, |a, b| loaded[entry(a, b)] - alone[entry(a, b)]);
    let Some(modes) = SymmetricEigen::try_new(geometric, f64::EPSILON, EIGEN_ITERATIONS * n) else {
        return false;
    };
    for (stiffness, mode) in modes.eigenvalues.iter().zip(modes.eigenvectors.column_iter()) {
        for a in (0..n).filter(|_| *stiffness > 0.0) {
            for b in 0..=a {
                alone[a * n + b] += stiffness * mode[a] * mode[b];
            }
        }
    }
    true
}

/// Adds a spring along `row` to the lower triangle of `hessian`, `stiffening` times as stiff as its diagonal
/// along `row`.
fn add_spring(row: &[f64], stiffening: f64, hessian: &mut [f64]) {
    let n = row.len();
    let compliance: f64 = (0..n).map(|a| row[a] * row[a] / hessian[a * n + a].abs()).sum();
    // A place that cannot move, such as the root, needs no spring.
    if !(compliance > 0.0 && compliance.is_finite()) {
        return;
    }
    for a in 0..n {
        for b in 0..=a {
            hessian[a * n + b] += stiffening / compliance * row[a] * row[b];
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rod::model::RodSource;
    use crate::rod::potential::PointLoad;
    use crate::rod::segment::SegmentSize;

    fn hair() -> Rod {
        Rod::new(&RodSource {
            stiffness: [8e-9, 6e-9, 4e-9],
            damping: 0.004,
            segment_size: SegmentSize { max_length: 0.005, max_turn: 0.8 },
            ..RodSource::hair(
                &[Vector3::zeros(), Vector3::new(0.03, 0.1, 0.0), Vector3::new(0.1, 0.15, 0.03)],
                &[0.0, 0.2, 0.5, 1.0],
            )
        })
        .unwrap()
    }

    fn at_rest(rod: &Rod, h: f64) -> Load {
        let mut shape = RodShape::default();
        shape.update(rod, &rod.root.r, &rod.initial_q);
        let points = (0..rod.points()).map(|k| PointLoad {
            inertial: shape.x(k),
            previous: shape.x(k),
            air: Vector3::zeros(),
            tangent: shape.tangent(k),
            drag: 2e-5,
        });
        let mut load = Load::default();
        load.set(rod, h, &Vector3::zeros(), &vec![0.0; rod.unknowns()], points);
        load
    }

    /// The solver after the linearisation, and −gradient without the contact forces.
    fn linearised(rod: &Rod, load: &Load, contacts: &[ContactLoad], q: &[f64]) -> (Solver, Vec<f64>) {
        let mut solver = Solver::default();
        solver.shape.update(rod, &rod.root.r, q);
        assert!(solver.linearise_loaded(rod, load, contacts, q, &mut ContactLoadBuffers::default()));
        let n = q.len();
        // The diagonal of L is stored inverted.
        let l = |a: usize, b: usize| solver.factor[a * n + b];
        let slope = (0..n)
            .map(|a| {
                (0..a).map(|b| l(a, b) * solver.direction[b]).sum::<f64>() + solver.direction[a] / l(a, a)
            })
            .collect();
        (solver, slope)
    }

    #[test]
    fn hessian_includes_the_geometric_stiffness_of_contact_forces() {
        let rod = hair();
        let load = at_rest(&rod, 0.1);
        let q: Vec<f64> = (0..rod.unknowns()).map(|i| (i as f64 * 1.7).cos() * 0.3).collect();
        let n = q.len();
        let force = Vector3::new(1e-7, 2e-7, 1e-7);
        let contacts = [5, 20].map(|segment| ContactLoad {
            segment,
            u: 0.3,
            force,
            normal: Vector3::y(),
            sticks: false,
            slides_along: None,
            moment: None,
        });
        // −gradient of Φ minus the work of the contact forces.
        let gradient = |q: &[f64]| {
            let (solver, mut slope) = linearised(&rod, &load, &[], q);
            for contact in &contacts {
                contact.add_row(&contact.force, &solver.shape, &solver.sensitivity, &mut slope);
            }
            slope
        };
        let (solver, slope) = linearised(&rod, &load, &contacts, &q);
        let (_, alone) = linearised(&rod, &load, &[], &q);
        let scale = alone.iter().fold(0.0_f64, |m, x| m.max(x.abs()));
        assert!(slope.iter().zip(&alone).all(|(a, b)| (a - b).abs() < 1e-9 * scale));
        let entry = |a: usize, b: usize| {
            let l = |i: usize, j: usize| match i == j {
                true => 1.0 / solver.factor[i * n + j],
                false => solver.factor[i * n + j],
            };
            (0..=b).map(|k| l(a, k) * l(b, k)).sum::<f64>()
        };
        let (mut worst, mut largest, mut geometric) = (0.0_f64, 0.0_f64, 0.0_f64);
        for b in 0..n {
            let moved = |d: f64| {
                let mut p = q.clone();
                p[b] += d;
                (gradient(&p), linearised(&rod, &load, &[], &p).1)
            };
            let ((ahead, ahead_alone), (behind, behind_alone)) = (moved(1e-4), moved(-1e-4));
            for a in b..n {
                let numeric = (behind[a] - ahead[a]) / 2e-4;
                worst = worst.max((numeric - entry(a, b)).abs());
                geometric = geometric.max((numeric - (behind_alone[a] - ahead_alone[a]) / 2e-4).abs());
                largest = largest.max(numeric.abs());
            }
        }
        assert!(worst < 1e-4 * geometric && geometric > 1e-3 * largest, "{worst} {geometric} {largest}");
    }

    #[test]
    fn forces_stiffen_a_rod_that_they_draw_out_and_do_not_buckle_one_that_they_press_hard() {
        let ends = [Vector3::zeros(), Vector3::new(0.0, 0.2, 0.0)];
        let rod = Rod::new(&RodSource::hair(&ends, &[0.0, 0.2, 0.5, 1.0])).unwrap();
        let load = at_rest(&rod, 0.1);
        let tip = rod.points() - 2;
        let factor = |force: f64| {
            let mut solver = Solver::default();
            solver.shape.update(&rod, &rod.root.r, &rod.initial_q);
            let forces = [(tip, 1.0, Vector3::y() * force)];
            let buffers = &mut ContactLoadBuffers::default();
            assert!(solver.linearise_stiffened(&rod, &load, &forces, &rod.initial_q, buffers));
            solver.factor
        };
        let contact = |force: f64| ContactLoad {
            segment: tip,
            u: 1.0,
            force: Vector3::y() * force,
            normal: Vector3::y(),
            sticks: false,
            slides_along: None,
            moment: None,
        };
        let under = |contacts: &[ContactLoad]| linearised(&rod, &load, contacts, &rod.initial_q).0.factor;
        let alone = under(&[]);
        let n = rod.unknowns();
        let distance = |a: &[f64], b: &[f64]| {
            let lower = (0..n).flat_map(|i| (0..=i).map(move |j| i * n + j));
            lower.map(|k| (a[k] - b[k]).abs() / b[k].abs().max(1e-3 * b[n * n - 1].abs())).fold(0.0, f64::max)
        };
        for (gentle, effect) in [(1e-5, 1e-2), (-1e-7, 1e-3)] {
            let exact = under(&[contact(gentle)]);
            assert!(distance(&factor(gentle), &exact) < 1e-6, "{}", distance(&factor(gentle), &exact));
            assert!(distance(&exact, &alone) > effect, "{}", distance(&exact, &alone));
        }
        // Half of the load at which the rod buckles, by bisection: beyond it nothing of the force is left.
        let (mut gentle, mut hard) = (1e-7, 1e-5);
        for _ in 0..30 {
            let middle = 0.5 * (gentle + hard);
            *if distance(&factor(-middle), &alone) < 1e-6 { &mut hard } else { &mut gentle } = middle;
        }
        for hard in [1.01 * hard, 1.9 * hard] {
            assert!(distance(&factor(-hard), &alone) < 1e-6, "{}", distance(&factor(-hard), &alone));
        }
        // The whole of 1.9 times as much would still soften the rod, that of 2.1 buckles it.
        let determinant = |factor: &[f64]| (0..n).map(|a| -factor[a * n + a].ln()).sum::<f64>();
        let [before, beyond] = [1.9, 2.1].map(|times| determinant(&under(&[contact(-times * hard)])));
        assert!(
            before < determinant(&alone) - 1.0 && beyond > determinant(&alone) - 0.1,
            "{before} {beyond}"
        );
    }

    #[test]
    fn a_rod_linearised_anew_near_its_factor_has_its_own_gradient() {
        let rod = hair();
        let load = at_rest(&rod, 0.1);
        let moved: Vec<f64> = rod.initial_q.iter().map(|q| q + 1e-3).collect();
        let (mut solver, _) = linearised(&rod, &load, &[], &rod.initial_q);
        let (factor, n) = (solver.factor.clone(), moved.len());
        solver.shape.update(&rod, &rod.root.r, &moved);
        solver.relinearise(&rod, &load, &moved);
        assert_eq!(solver.factor, factor);
        let (_, slope) = linearised(&rod, &load, &[], &moved);
        let mut expected = slope;
        cholesky::solve_lower(&factor, n, &mut expected);
        let scale = expected.iter().fold(0.0_f64, |m, x| m.max(x.abs()));
        assert!(solver.direction.iter().zip(&expected).all(|(a, b)| (a - b).abs() < 1e-9 * scale));
    }

    #[test]
    fn hessian_beyond_the_buckling_load_is_stiffened_at_contacts() {
        let rod = hair();
        let load = at_rest(&rod, 1.0);
        let q = rod.initial_q.clone();
        let tip = rod.points() - 2;
        // Above the buckling load of a column with a free end, below that with a pinned end.
        let along = Vector3::new(0.1, 0.15, 0.03).normalize();
        let contact = ContactLoad {
            segment: tip,
            u: 1.0,
            force: along * -2e-6,
            normal: along,
            sticks: true,
            slides_along: None,
            moment: None,
        };
        let (held, _) = linearised(&rod, &load, &[contact], &q);
        let (free, _) = linearised(&rod, &load, &[], &q);
        // The compliance of the held tip is far below that of the free one.
        let compliance = |solver: &Solver| {
            let mut row = vec![0.0; q.len()];
            contact.add_row(&Vector3::z(), &solver.shape, &solver.sensitivity, &mut row);
            cholesky::solve_lower(&solver.factor, q.len(), &mut row);
            cholesky::dot(&row, &row)
        };
        assert!(compliance(&held) < 0.1 * compliance(&free), "{} {}", compliance(&held), compliance(&free));
    }
}
