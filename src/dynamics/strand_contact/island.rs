//! Guides that hang together over places, and the reactions between them.

use super::contact_pairs::ContactPairs;
use super::member::Member;
use crate::contact::FrictionTolerance;
use crate::contact::friction::{
    CoupledFrictionProblem, FrictionOutcome, FrictionScratch, Law, StrandRows, solve_coupled,
};
use crate::dynamics::guide::GuideModel;
use crate::geometry::Friction;
use crate::math::cholesky::dot;
use nalgebra::UnitQuaternion;

/// When the reactions are good enough: their residual multiplies displacements of a step, some 0.1 to 1 mm. In the first round, whose
/// linearisation is worth no more, and in those that follow.
const TOLERANCES: [FrictionTolerance; 2] =
    [FrictionTolerance { residual: 1e-4, sweeps: 60 }, FrictionTolerance { residual: SOUND, sweeps: 200 }];

/// Residual after which no other round is asked for on its account.
pub(super) const SOUND: f64 = 1e-6;

/// Guides that are solved together: no place is between one of them and one of another island.
#[derive(Debug, Default)]
pub(super) struct Island {
    /// The guides, ascending.
    pub members: Vec<usize>,
    /// The places that they have a part in, ascending.
    pub places: Vec<usize>,
}

/// Reactions of an island.
pub(super) struct Reactions {
    /// L⁻¹Jᵀr of its members, one after another, r being what acts on their rods.
    pub pushes: Vec<f64>,
    /// Of the contacts of its members' rods with bodies, then of its places, in the frames of the contacts, N.
    pub forces: Vec<f64>,
    pub outcome: FrictionOutcome,
}

impl Island {
    /// The sets that hold one of `wanted`, in ascending order of their first guides, and the island of each of `count` guides.
    pub fn of(
        mut sets: Sets,
        count: usize,
        wanted: impl Iterator<Item = usize>,
    ) -> (Vec<Island>, Vec<Option<usize>>) {
        let mut chosen = vec![false; count];
        wanted.for_each(|g| chosen[sets.first_of(g)] = true);
        let mut islands: Vec<Island> = Vec::new();
        let mut of = vec![None; count];
        for g in 0..count {
            let first = sets.first_of(g);
            if !chosen[first] {
                continue;
            }
            if first == g {
                of[g] = Some(islands.len());
                islands.push(Island::default());
            } else {
                of[g] = of[first];
            }
            if let Some(island) = of[g] {
                islands[island].members.push(g);
            }
        }
        (islands, of)
    }

    /// Solves for the reactions of all contacts, by the systems of the members as they are. A bundle of n hairs is n times as stiff and as heavy as its rod: it
    /// moves by L⁻ᵀL⁻¹Jᵀr/n, and so rows are over √n here, which keeps W symmetric, and forces are those on bundles.
    pub fn react(
        &self,
        models: &[GuideModel],
        members: &[Member],
        places: &ContactPairs,
        to_world: &UnitQuaternion<f64>,
    ) -> Reactions {
        let (mut sides, mut rows, mut b, mut laws) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
        let mut forces = Vec::new();
        let mut unknowns = 0;
        let mut sides_of_places = vec![[None; 2]; self.places.len()];
        for &g in &self.members {
            let m = &members[g];
            let (n, touch, at) = (models[g].rod.unknowns(), &m.scratch.contact, rows.len());
            let hairs = places.skin[g].hairs;
            let part = |j: usize| StrandRows { first_unknown: unknowns, unknowns: n, offset: at + 3 * n * j };
            let bodies = touch.problem.laws.len();
            for (j, &(i, side)) in m.parts.iter().enumerate() {
                if let Ok(place) = self.places.binary_search(&i) {
                    sides_of_places[place][side] = Some(part(bodies + j));
                }
            }
            sides.extend((0..bodies).map(|j| [Some(part(j)), None]));
            b.extend_from_slice(&touch.problem.free_displacement);
            laws.extend_from_slice(&touch.problem.laws);
            forces.extend(touch.reactions.forces.iter().map(|r| r * hairs));
            forces.resize(3 * sides.len(), 0.0);
            rows.extend(touch.problem.rows.iter().chain(&m.rows).map(|row| row / hairs.sqrt()));
            unknowns += n;
        }
        for (&i, sides_here) in self.places.iter().zip(&sides_of_places) {
            let place = &places.found[i];
            let guides_here = places.guides(&place.contact);
            let axes = place.axes(to_world);
            let slip = to_world * places.slip(place);
            let mut free = [place.gap(), slip.dot(&axes[1]), slip.dot(&axes[2])];
            for (side, g) in sides_here.iter().zip(guides_here).filter_map(|(side, g)| Some(((*side)?, g))) {
                let (n, hairs) = (side.unknowns, places.skin[g].hairs);
                for (d, free) in free.iter_mut().enumerate() {
                    let row = &rows[side.offset + d * n..][..n];
                    *free += dot(row, &members[g].scratch.solver.direction) * hairs.sqrt();
                }
            }
            b.extend(free);
            sides.push(*sides_here);
            let own = |side: usize| {
                let (model, (k, u)) = (&models[guides_here[side]], places.on_rod(&place.contact, side));
                Friction::lerp(model.friction, model.rod.arc_fraction(k, u))
            };
            laws.push(Law::Coulomb(Friction::lerp([own(0), own(1)], 0.5)));
            let force = to_world * place.reaction;
            let [n, along, across] = axes.map(|d| force.dot(&d) / d.norm_squared());
            forces.extend([n.max(0.0), along, across]);
        }
        let mut pushes = vec![0.0; unknowns];
        let problem = CoupledFrictionProblem { strands: &sides, rows: &rows, b: &b, laws: &laws };
        let first = self.members.iter().all(|&g| members[g].rounds == 0);
        let tolerance = TOLERANCES[usize::from(!first)];
        let outcome =
            solve_coupled(&problem, tolerance, &mut forces, &mut pushes, &mut FrictionScratch::default());
        let (mut pushes_left, mut forces_left) = (&mut pushes[..], &mut forces[..]);
        for &g in &self.members {
            let hairs = places.skin[g].hairs;
            let (push, others) = pushes_left.split_at_mut(models[g].rod.unknowns());
            push.iter_mut().for_each(|w| *w /= hairs.sqrt());
            let (of_bodies, of_others) =
                forces_left.split_at_mut(3 * members[g].scratch.contact.problem.laws.len());
            of_bodies.iter_mut().for_each(|r| *r /= hairs);
            (pushes_left, forces_left) = (others, of_others);
        }
        Reactions { pushes, forces, outcome }
    }
}

/// Disjoint sets of the first numbers, each named by its least (union-find).
pub(super) struct Sets(Vec<u32>);

impl Sets {
    /// `count` sets of one.
    pub fn new(count: usize) -> Self {
        Sets((0..count as u32).collect())
    }

    /// The least of the set that holds `i`.
    pub fn first_of(&mut self, i: usize) -> usize {
        let mut i = i as u32;
        while self.0[i as usize] != i {
            self.0[i as usize] = self.0[self.0[i as usize] as usize];
            i = self.0[i as usize];
        }
        i as usize
    }

    /// Makes the sets of `a` and `b` one.
    pub fn join(&mut self, a: usize, b: usize) {
        let (a, b) = (self.first_of(a), self.first_of(b));
        self.0[a.max(b)] = a.min(b) as u32;
    }
}
