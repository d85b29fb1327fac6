//! Ties within a step: they are eliminated from the linearised rod, exactly, before contacts are solved
//! (`docs/theory.md` §4.10).

use crate::dynamics::tie::{ActiveTie, HeldPlace};
use crate::math::cholesky::{dot, factor_semidefinite, solve, solve_lower};
use crate::rod::contact_load::ContactLoad;
use crate::rod::newton::Solver;
use crate::rod::{HoldingMoment, Rod, RodShape};
use nalgebra::Vector3;

/// Share of its mobility below which a constraint depends on others, or on the rod being inextensible.
const DEPENDENT: f64 = 1e-12;

/// Greatest force of a tie, in units of the rod's own ([`Rod::own_force`]); its greatest moment is that at an
/// arm of the rod's length. A tie that cannot reach its target would else pull without bound.
const MAX_FORCE: f64 = 1e4;

const AXES: [Vector3<f64>; 3] =
    [Vector3::new(1.0, 0.0, 0.0), Vector3::new(0.0, 1.0, 0.0), Vector3::new(0.0, 0.0, 1.0)];

/// The ties of a guide as constraints on its linearised rod. A tie has three in position, or two if the strand
/// slides through it, then three in rotation if it holds its frame.
#[derive(Debug, Default)]
pub(in crate::dynamics) struct TieSystem {
    /// The place of each tie.
    places: Vec<HeldPlace>,
    /// L⁻¹Jᵀ, one row for each constraint.
    rows: Vec<f64>,
    /// Cholesky factor of J H⁻¹ Jᵀ; empty while the ties pull with their greatest force instead of holding.
    factor: Vec<f64>,
    /// Constraint forces without contacts, N and N·m.
    alone: Vec<f64>,
    /// Constraint forces, N and N·m.
    forces: Vec<f64>,
    /// Buffer of one entry for each constraint.
    along: Vec<f64>,
    /// Buffer of one entry for each unknown.
    unknowns: Vec<f64>,
    /// The ties as loads on the rod.
    pub(super) loads: Vec<ContactLoad>,
}

impl TieSystem {
    /// Forgets the ties of the last step.
    pub(super) fn clear(&mut self) {
        self.places.clear();
        self.rows.clear();
        self.factor.clear();
        self.alone.clear();
        self.forces.clear();
        self.loads.clear();
    }

    /// Segment, fraction of it, and force (world, N) of each tie.
    pub(in crate::dynamics) fn world_forces(
        &self,
    ) -> impl Iterator<Item = (usize, f64, Vector3<f64>)> + Clone {
        self.loads.iter().map(|load| (load.segment, load.u, load.force))
    }

    /// Moment of each tie on a rod in `shape`, N·m, world.
    pub(in crate::dynamics) fn world_moments(&self, shape: &RodShape) -> impl Iterator<Item = Vector3<f64>> {
        self.loads.iter().map(|load| match &load.moment {
            Some(moment) => shape.moment_of(load.segment, load.u, moment),
            None => Vector3::zeros(),
        })
    }

    /// Work of the moments on a rod in `shape`, J, up to a constant.
    pub(in crate::dynamics) fn work_of_moments(&self, shape: &RodShape) -> f64 {
        let work = |load: &ContactLoad| {
            let HoldingMoment { frame, moment } = load.moment.as_ref()?;
            Some(moment.dot(&shape.rotation_from(load.segment, load.u, frame)))
        };
        self.loads.iter().filter_map(work).sum()
    }

    /// Adds what the ties do to the solver's direction, L⁻¹ times all other forces but those of contacts.
    /// Without contacts the linearised rod then reaches its targets. `x` is the contact polyline, world, m.
    pub(super) fn eliminate(
        &mut self,
        ties: &[ActiveTie],
        rod: &Rod,
        x: &[Vector3<f64>],
        solver: &mut Solver,
    ) {
        self.clear();
        if ties.is_empty() {
            return;
        }
        let n = rod.unknowns();
        let TieSystem { places, rows, alone, factor, .. } = self;
        for tie in ties {
            let place = tie.held(x);
            let (k, s) = (place.segment, place.u);
            let points = solver.shape.blend_points(rod, k, s);
            for (d, off) in place.directions.iter().zip(place.off).take(place.held) {
                let at = rows.len();
                rows.resize(at + n, 0.0);
                for (point, (share, x)) in (k..).zip(&points) {
                    solver.sensitivity.add_row(point, x, d, *share, &mut rows[at..]);
                }
                alone.push(off);
            }
            places.push(place);
            let Some(frame) = &tie.frame else { continue };
            for d in AXES {
                let at = rows.len();
                rows.resize(at + n, 0.0);
                solver.sensitivity.add_rotation_row(&solver.shape, (k, s), frame, &d, &mut rows[at..]);
            }
            alone.extend(solver.shape.rotation_from(k, s, frame).iter());
        }
        let m = alone.len();
        rows.chunks_exact_mut(n).for_each(|row| solve_lower(&solver.factor, n, row));
        factor.resize(m * m, 0.0);
        for (a, row) in rows.chunks_exact(n).enumerate() {
            alone[a] = -(alone[a] + dot(row, &solver.direction));
            for (b, other) in rows.chunks_exact(n).enumerate().take(a + 1) {
                factor[a * m + b] = dot(row, other);
            }
        }
        factor_semidefinite(factor, m, DEPENDENT);
        solve(factor, m, alone);
        if self.limit(ties, rod) {
            self.factor.clear();
        }
        self.along.resize(m, 0.0);
        for (force, row) in self.alone.iter().zip(self.rows.chunks_exact(n)) {
            solver.direction.iter_mut().zip(row).for_each(|(d, r)| *d += force * r);
        }
    }

    /// Removes what the ties prevent from `rows`, L⁻¹Jᵀ of contacts with `n` entries each.
    pub(in crate::dynamics) fn constrain(&mut self, n: usize, rows: &mut [f64]) {
        if self.factor.is_empty() {
            return;
        }
        let m = self.along.len();
        for row in rows.chunks_exact_mut(n) {
            for (along, tie) in self.along.iter_mut().zip(self.rows.chunks_exact(n)) {
                *along = dot(tie, row);
            }
            solve(&self.factor, m, &mut self.along);
            for (along, tie) in self.along.iter().zip(self.rows.chunks_exact(n)) {
                row.iter_mut().zip(tie).for_each(|(r, t)| *r -= along * t);
            }
        }
    }

    /// Sets the constraint forces under the forces `contacts` of contacts: segment, fraction of it, force, N,
    /// world. The solver holds the shape and the factor of the linearisation.
    pub(super) fn balance(
        &mut self,
        ties: &[ActiveTie],
        rod: &Rod,
        solver: &Solver,
        contacts: impl Iterator<Item = (usize, f64, Vector3<f64>)>,
    ) {
        let n = rod.unknowns();
        self.forces.clone_from(&self.alone);
        if !self.factor.is_empty() {
            self.unknowns.clear();
            self.unknowns.resize(n, 0.0);
            for (k, s, force) in contacts {
                for (point, (share, x)) in (k..).zip(solver.shape.blend_points(rod, k, s)) {
                    solver.sensitivity.add_row(point, &x, &force, share, &mut self.unknowns);
                }
            }
            solve_lower(&solver.factor, n, &mut self.unknowns);
            for (along, tie) in self.along.iter_mut().zip(self.rows.chunks_exact(n)) {
                *along = dot(tie, &self.unknowns);
            }
            solve(&self.factor, self.along.len(), &mut self.along);
            self.forces.iter_mut().zip(&self.along).for_each(|(force, along)| *force -= along);
        }
        self.set_loads(ties);
    }

    fn set_loads(&mut self, ties: &[ActiveTie]) {
        let TieSystem { places, forces, loads, .. } = self;
        loads.clear();
        let mut forces = &forces[..];
        for (place, tie) in places.iter().zip(ties) {
            let wrench = Wrench::take(&mut forces, place, tie);
            loads.push(ContactLoad {
                segment: place.segment,
                u: place.u,
                force: wrench.force,
                normal: Vector3::zeros(),
                sticks: true,
                slides_along: (place.held == 2).then_some(place.directions[2]),
                moment: tie.frame.map(|frame| HoldingMoment { frame, moment: wrench.moment }),
            });
        }
    }

    /// True if a tie would need more than its greatest force; the forces are then scaled down to it.
    fn limit(&mut self, ties: &[ActiveTie], rod: &Rod) -> bool {
        let most = MAX_FORCE * rod.own_force();
        let (mut forces, mut largest) = (&self.alone[..], 0.0_f64);
        for (place, tie) in self.places.iter().zip(ties) {
            let Wrench { force, moment } = Wrench::take(&mut forces, place, tie);
            largest = largest.max(force.norm()).max(moment.norm() / rod.length());
        }
        if largest > most {
            self.alone.iter_mut().for_each(|force| *force *= most / largest);
        }
        largest > most
    }
}

/// Force, N, and moment, N·m, of a tie, world.
struct Wrench {
    force: Vector3<f64>,
    moment: Vector3<f64>,
}

impl Wrench {
    /// That of `tie`, which holds `place`, from the front of the constraint `forces`.
    fn take(forces: &mut &[f64], place: &HeldPlace, tie: &ActiveTie) -> Self {
        let (force, rest) = forces.split_at(place.held);
        let (moment, rest) = rest.split_at(if tie.frame.is_some() { 3 } else { 0 });
        *forces = rest;
        let sum = |(d, r): (&Vector3<f64>, &f64)| d * *r;
        let force = place.directions.iter().zip(force).map(sum).sum();
        Wrench { force, moment: AXES.iter().zip(moment).map(sum).sum() }
    }
}
