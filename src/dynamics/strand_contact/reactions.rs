//! The reactions of all contacts of an island.

use super::contact_pairs::ContactPairs;
use super::coupled_guide::{CoupledGuide, RESIDUAL_TOLERANCE};
use super::island::Island;
use crate::contact::FrictionTolerance;
use crate::contact::friction::{
    CoupledFrictionProblem, FrictionOutcome, FrictionScratch, Interrupt, ROW_WIDTH, StrandRows, solve_coupled,
};
use crate::dynamics::guide::GuideModel;
use crate::geometry::Friction;
use crate::math::cholesky::dot;
use nalgebra::UnitQuaternion;

/// Displacement of a point in a round, m, above which the next is one on the way in a large island; in a small
/// one only the first is. A round more costs more than an accurate solve of a small island.
const PROVISIONAL_DISPLACEMENT: f64 = 3e-4;

/// Number of contacts of a large island.
const LARGE: usize = 500;

/// Tolerances of rounds on the way, which the next linearisation corrects, and of later ones. The residual
/// multiplies displacements of a step of some 0.1 to 1 mm.
const PROVISIONAL: FrictionTolerance = FrictionTolerance { residual: 1e-4, sweeps: 60, continuation: false };
const FINAL: FrictionTolerance =
    FrictionTolerance { residual: RESIDUAL_TOLERANCE, sweeps: 200, continuation: true };

/// Reactions of an island.
pub(super) struct Reactions {
    /// L⁻¹Jᵀr of its guides, concatenated; r acts on their rods.
    pub pushes: Vec<f64>,
    /// Forces of the guides' contacts with bodies, guide by guide, then of the contacts between guides, along
    /// the axes of the contacts, N.
    pub forces: Vec<f64>,
    pub outcome: FrictionOutcome,
    /// True if they were solved for on the way only.
    pub provisional: bool,
}

/// The coupled friction problem of an island. A bundle of n hairs is n times as stiff and heavy as its rod
/// and moves by L⁻ᵀL⁻¹Jᵀr/n: dividing its rows by √n keeps the Delassus operator symmetric, and forces are
/// those on bundles.
#[derive(Default)]
struct System {
    strands: Vec<[Option<StrandRows>; 2]>,
    rows: Vec<f64>,
    b: Vec<f64>,
    friction: Vec<Friction>,
    forces: Vec<f64>,
    unknowns: usize,
}

impl Reactions {
    /// Solves for the reactions of all contacts of an island, with the linearised systems of its guides; those of the
    /// `last` round are no longer on the way. They are of no use once `interrupt` is asked for.
    pub fn solve(
        island: &Island,
        models: &[GuideModel],
        guides: &[CoupledGuide],
        pairs: &ContactPairs,
        to_world: &UnitQuaternion<f64>,
        last: bool,
        interrupt: &Interrupt,
    ) -> Self {
        let mut system = System::default();
        let strands = system.add_guides(island, models, guides, pairs);
        for (&i, strands) in island.contacts.iter().zip(strands) {
            system.add_contact(i, strands, models, guides, pairs, to_world);
        }
        let System { strands, rows, b, friction, mut forces, unknowns } = system;
        let mut padded_pushes = vec![0.0; unknowns];
        let problem = CoupledFrictionProblem { strands: &strands, rows: &rows, b: &b, friction: &friction };
        let large = island.contacts.len() >= LARGE;
        let is_on_the_way = |guide: &CoupledGuide| {
            guide.rounds == 0 || large && guide.displacement > PROVISIONAL_DISPLACEMENT
        };
        let provisional = !last && island.guides.iter().any(|&g| is_on_the_way(&guides[g]));
        let tolerance = if provisional { PROVISIONAL } else { FINAL };
        let outcome = solve_coupled(
            &problem,
            tolerance,
            &mut forces,
            &mut padded_pushes,
            &mut FrictionScratch::default(),
            interrupt,
        );
        let mut pushes = Vec::with_capacity(unknowns);
        let (mut pushes_left, mut forces_left) = (&padded_pushes[..], &mut forces[..]);
        for &g in &island.guides {
            let hairs = pairs.bundles[g].hairs;
            let unknowns = models[g].rod.unknowns();
            let (push, next_pushes) = pushes_left.split_at(unknowns.next_multiple_of(ROW_WIDTH));
            pushes.extend(push[..unknowns].iter().map(|w| w / hairs.sqrt()));
            let body_forces = 3 * guides[g].scratch.contact.problem.friction.len();
            let (of_bodies, next_forces) = forces_left.split_at_mut(body_forces);
            of_bodies.iter_mut().for_each(|r| *r /= hairs);
            (pushes_left, forces_left) = (next_pushes, next_forces);
        }
        Reactions { pushes, forces, outcome, provisional }
    }
}

impl System {
    /// Adds the rows of the guides and their contacts with bodies; returns the rows of both sides of each
    /// contact between guides.
    fn add_guides(
        &mut self,
        island: &Island,
        models: &[GuideModel],
        guides: &[CoupledGuide],
        pairs: &ContactPairs,
    ) -> Vec<[Option<StrandRows>; 2]> {
        let mut contact_strands = vec![[None; 2]; island.contacts.len()];
        for &g in &island.guides {
            let guide = &guides[g];
            let (n, body_contact, at) = (models[g].rod.unknowns(), &guide.scratch.contact, self.rows.len());
            let hairs = pairs.bundles[g].hairs;
            let first_unknown = self.unknowns;
            let padded = n.next_multiple_of(ROW_WIDTH);
            let rows_of =
                |j: usize| StrandRows { first_unknown, unknowns: padded, offset: at + 3 * padded * j };
            let bodies = body_contact.problem.friction.len();
            for (j, &(i, side)) in guide.sides.iter().enumerate() {
                if let Ok(contact) = island.contacts.binary_search(&i) {
                    contact_strands[contact][side] = Some(rows_of(bodies + j));
                }
            }
            self.strands.extend((0..bodies).map(|j| [Some(rows_of(j)), None]));
            self.b.extend_from_slice(&body_contact.problem.free_displacement);
            self.friction.extend_from_slice(&body_contact.problem.friction);
            self.forces.extend(body_contact.reactions.forces.iter().map(|r| r * hairs));
            self.forces.resize(3 * self.strands.len(), 0.0);
            for row in body_contact.problem.rows.chunks_exact(n).chain(guide.rows.chunks_exact(n)) {
                self.rows.extend(row.iter().map(|y| y / hairs.sqrt()));
                self.rows.resize(self.rows.len() + padded - n, 0.0);
            }
            self.unknowns += padded;
        }
        contact_strands
    }

    /// Adds contact `i` between two guides.
    fn add_contact(
        &mut self,
        i: usize,
        strands: [Option<StrandRows>; 2],
        models: &[GuideModel],
        guides: &[CoupledGuide],
        pairs: &ContactPairs,
        to_world: &UnitQuaternion<f64>,
    ) {
        let pair = &pairs.contacts[i];
        let its_guides = pairs.guides(&pair.contact);
        let axes = pair.axes(to_world);
        let slip = to_world * pairs.slip(pair);
        let mut free = [pair.gap(), slip.dot(&axes[1]), slip.dot(&axes[2])];
        for (side, g) in strands.iter().zip(its_guides).filter_map(|(side, g)| Some(((*side)?, g))) {
            let (direction, hairs) = (&guides[g].scratch.solver.direction, pairs.bundles[g].hairs);
            for (d, free) in free.iter_mut().enumerate() {
                let row = &self.rows[side.offset + d * side.unknowns..][..direction.len()];
                *free += dot(row, direction) * hairs.sqrt();
            }
        }
        self.b.extend(free);
        self.strands.push(strands);
        let friction = |side: usize| {
            let (model, (k, u)) = (&models[its_guides[side]], pairs.position_on_rod(&pair.contact, side));
            Friction::lerp(model.friction, model.rod.arc_fraction(k, u))
        };
        self.friction.push(Friction::lerp([friction(0), friction(1)], 0.5));
        let force = to_world * pair.reaction;
        let [n, along, across] = axes.map(|d| force.dot(&d) / d.norm_squared());
        self.forces.extend([n.max(0.0), along, across]);
    }
}
