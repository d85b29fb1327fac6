//! Ties within a step: they are eliminated from the linearised rod before contacts are solved (`docs/theory.md`
//! §4.10).

use crate::dynamics::reaction::TieReaction;
use crate::dynamics::tie::{ActiveTie, HeldPlace};
use crate::math::cholesky::{dot, factor_semidefinite, solve, solve_lower};
use crate::rod::contact_load::ContactLoad;
use crate::rod::newton::Solver;
use crate::rod::{HoldingMoment, Rod, RodShape};
use nalgebra::Vector3;

/// How far a tie gives way in a round under the rod's own force ([`Rod::own_force`]) in addition to the force of the
/// round before, as a share of the rod's length.
const COMPLIANCE: f64 = 1e-10;

/// Share of its mobility below which a constraint depends on others, in steps so long that the compliance is lost in
/// rounding.
const DEPENDENT: f64 = 1e-12;

/// Greatest force of a tie, in units of the rod's own ([`Rod::own_force`]); its greatest moment is that at an
/// arm of the rod's length. A tie that cannot reach its target would else pull without bound.
const MAX_FORCE: f64 = 1e4;

/// Greatest force that is carried on from round to round and from step to step, in the same units. Where ties
/// contradict each other what is carried grows to it.
const MAX_CARRIED: f64 = 2e3;

/// Share by which the greatest force may be exceeded.
const EXCESS: f64 = 0.01;

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
    /// J H⁻¹ Jᵀ.
    mobility: Vec<f64>,
    /// How far each constraint gives way per force in addition to that of the round before, m/N and rad/(N·m).
    compliance: Vec<f64>,
    /// Cholesky factor of the mobility with the compliance.
    factor: Vec<f64>,
    /// By how much each constraint is off without forces, m and rad.
    off: Vec<f64>,
    /// Constraint forces of the round before, or of the step before, N and N·m.
    before: Vec<f64>,
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
        self.clear_round();
        self.loads.clear();
    }

    /// Forgets the last round but for its forces.
    fn clear_round(&mut self) {
        self.places.clear();
        self.rows.clear();
        self.off.clear();
        self.compliance.clear();
        self.before.clear();
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
        self.clear_round();
        if ties.is_empty() {
            self.loads.clear();
            return;
        }
        let (n, length, own_force) = (rod.unknowns(), rod.length(), rod.own_force());
        let first = self.loads.len() != ties.len();
        let TieSystem { places, rows, off, compliance, before, loads, .. } = self;
        for (i, tie) in ties.iter().enumerate() {
            let place = tie.held(x);
            let (k, s) = (place.segment, place.u);
            let last = if first { tie.last } else { TieReaction::of(&loads[i]) };
            let carried = (MAX_CARRIED / relative_size(&last, rod)).min(1.0);
            let points = solver.shape.blend_points(rod, k, s);
            for (d, apart) in place.directions.iter().zip(place.off).take(place.held) {
                let at = rows.len();
                rows.resize(at + n, 0.0);
                for (point, (share, x)) in (k..).zip(&points) {
                    solver.sensitivity.add_row(point, x, d, *share, &mut rows[at..]);
                }
                off.push(apart);
                compliance.push(COMPLIANCE * length / own_force);
                before.push(carried * d.dot(&last.force));
            }
            places.push(place);
            let Some(frame) = &tie.frame else { continue };
            for d in AXES {
                let at = rows.len();
                rows.resize(at + n, 0.0);
                solver.sensitivity.add_rotation_row(&solver.shape, (k, s), frame, &d, &mut rows[at..]);
                compliance.push(COMPLIANCE / (length * own_force));
                before.push(carried * d.dot(&last.moment));
            }
            off.extend(solver.shape.rotation_from(k, s, frame).iter());
        }
        let m = off.len();
        rows.chunks_exact_mut(n).for_each(|row| solve_lower(&solver.factor, n, row));
        self.mobility.clear();
        self.mobility.resize(m * m, 0.0);
        for (a, row) in self.rows.chunks_exact(n).enumerate() {
            self.off[a] += dot(row, &solver.direction);
            for (b, other) in self.rows.chunks_exact(n).enumerate().take(a + 1) {
                self.mobility[a * m + b] = dot(row, other);
            }
        }
        let mut softer = 1.0;
        self.solve_alone(softer);
        while let Some(excess) = self.excess(ties, rod) {
            softer *= excess;
            self.solve_alone(softer);
        }
        self.along.resize(m, 0.0);
        for (force, row) in self.alone.iter().zip(self.rows.chunks_exact(n)) {
            solver.direction.iter_mut().zip(row).for_each(|(d, r)| *d += force * r);
        }
    }

    /// Sets the constraint forces without contacts, where ties give way `softer` times as far as they should.
    fn solve_alone(&mut self, softer: f64) {
        let TieSystem { mobility, compliance, off, before, alone, factor, .. } = self;
        let m = off.len();
        factor.clone_from(mobility);
        alone.clear();
        for (a, ((c, off), before)) in compliance.iter().zip(off).zip(before).enumerate() {
            factor[a * m + a] += softer * c;
            alone.push(softer * c * *before - *off);
        }
        factor_semidefinite(factor, m, DEPENDENT);
        solve(factor, m, alone);
    }

    /// Removes what the ties prevent from `rows`, L⁻¹Jᵀ of contacts with `n` entries each.
    pub(in crate::dynamics) fn constrain(&mut self, n: usize, rows: &mut [f64]) {
        let m = self.off.len();
        if m == 0 {
            return;
        }
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
        if self.places.is_empty() {
            return;
        }
        let n = rod.unknowns();
        self.forces.clone_from(&self.alone);
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
        self.set_loads(ties);
    }

    fn set_loads(&mut self, ties: &[ActiveTie]) {
        let TieSystem { places, forces, loads, .. } = self;
        loads.clear();
        let mut forces = &forces[..];
        for (place, tie) in places.iter().zip(ties) {
            let TieReaction { force, moment } = take_reaction(&mut forces, place, tie);
            loads.push(ContactLoad {
                segment: place.segment,
                u: place.u,
                force,
                normal: Vector3::zeros(),
                sticks: true,
                slides_along: (place.held == 2).then_some(place.directions[2]),
                moment: tie.frame.map(|frame| HoldingMoment { frame, moment }),
            });
        }
    }

    /// By what factor the ties need more than their greatest force, if notably.
    fn excess(&self, ties: &[ActiveTie], rod: &Rod) -> Option<f64> {
        let mut forces = &self.alone[..];
        let needed = |(place, tie)| relative_size(&take_reaction(&mut forces, place, tie), rod);
        let largest = self.places.iter().zip(ties).map(needed).fold(0.0, f64::max);
        (largest > (1.0 + EXCESS) * MAX_FORCE && largest.is_finite()).then_some(largest / MAX_FORCE)
    }
}

/// That of `tie`, which holds `place`, world, from the front of the constraint `forces`.
fn take_reaction(forces: &mut &[f64], place: &HeldPlace, tie: &ActiveTie) -> TieReaction {
    let (force, rest) = forces.split_at(place.held);
    let (moment, rest) = rest.split_at(if tie.frame.is_some() { 3 } else { 0 });
    *forces = rest;
    let sum = |(d, r): (&Vector3<f64>, &f64)| d * *r;
    let force = place.directions.iter().zip(force).map(sum).sum();
    TieReaction { force, moment: AXES.iter().zip(moment).map(sum).sum() }
}

/// Size of `reaction` in units of the force of `rod`'s own making, and of it at an arm of the rod's length.
fn relative_size(reaction: &TieReaction, rod: &Rod) -> f64 {
    reaction.force.norm().max(reaction.moment.norm() / rod.length()) / rod.own_force()
}
