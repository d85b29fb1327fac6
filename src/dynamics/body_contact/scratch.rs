//! Buffers of the contact problem.

use super::impacts::Impacts;
use super::midpoints::Midpoints;
use super::stats::ContactStats;
use super::ties::TieSystem;
use crate::contact::Contact;
use crate::contact::friction::{FrictionScratch, SystemBudget};
use crate::dynamics::tie::ActiveTie;
use crate::geometry::Friction;
use crate::rod::Rod;
use crate::rod::contact_load::{ContactLoad, ContactLoadBuffers};
use crate::rod::newton::Solver;
use nalgebra::Vector3;

/// Buffers of [`BodyContact`](super::BodyContact), kept between steps.
#[derive(Debug, Default)]
pub(in crate::dynamics) struct BodyContactScratch {
    pub(in crate::dynamics) detection: Detection,
    pub(in crate::dynamics) problem: ContactRows,
    pub(in crate::dynamics) reactions: Reactions,
    pub(in crate::dynamics) ties: TieSystem,
    /// Unknowns at the end of a motion before it is truncated, 1/m.
    pub(super) full_q: Vec<f64>,
    pub(in crate::dynamics) stats: ContactStats,
}

/// Contacts at the current end of the step.
#[derive(Debug, Default)]
pub(in crate::dynamics) struct Detection {
    /// Points and midpoints at the current end, world, m.
    pub(super) x1: Vec<Vector3<f64>>,
    /// Contacts of the current problem.
    pub(super) contacts: Vec<Contact>,
    /// Contacts at the current end, without impacts.
    pub(super) found: Vec<Contact>,
    /// Contacts that stay in the problem while `frozen`.
    pub(super) planes: Vec<Contact>,
    pub(super) midpoints: Midpoints,
    /// Impacts of the current motion.
    pub(super) new_impacts: Vec<Contact>,
    /// Impacts of all rounds of the step.
    pub(super) impacts: Impacts,
    /// Deepest violation of a clearance at the current end, m, ≤ 0.
    pub(super) worst: f64,
    /// Deepest violation that the compliance of the contacts does not account for, m, ≤ 0.
    pub(super) unaccounted: f64,
    /// Largest shortfall from the distance that even a wedged strand must keep, m, ≥ 0.
    pub(in crate::dynamics) shortfall: f64,
    /// True if contacts stay in the problem and new ones are only added.
    pub(in crate::dynamics) frozen: bool,
}

/// The linearised contact problem.
#[derive(Debug, Default)]
pub(in crate::dynamics) struct ContactRows {
    /// L⁻¹Jᵀ less what ties prevent, one row for each contact and direction.
    pub(in crate::dynamics) rows: Vec<f64>,
    /// Delassus matrix with compliance, row-major, m/N.
    pub(super) delassus: Vec<f64>,
    /// Relative displacement without reactions, three components each, m.
    pub(in crate::dynamics) free_displacement: Vec<f64>,
    pub(in crate::dynamics) friction: Vec<Friction>,
    pub(super) frames: Vec<ContactFrame>,
}

/// Position and axes of a contact.
#[derive(Debug, Clone, Copy)]
pub(super) struct ContactFrame {
    /// Segment of the rod.
    pub segment: usize,
    /// Position on it, 0..=1.
    pub u: f64,
    pub axes: [Vector3<f64>; 3],
}

impl ContactFrame {
    /// The force with the components `r` in these axes, N, world.
    pub fn world(&self, r: &[f64]) -> Vector3<f64> {
        let [n, t1, t2] = self.axes;
        n * r[0] + t1 * r[1] + t2 * r[2]
    }
}

/// Reactions of the contacts.
#[derive(Debug, Default)]
pub(in crate::dynamics) struct Reactions {
    /// Components in the axes of each contact, N.
    pub(in crate::dynamics) forces: Vec<f64>,
    pub(super) friction: FrictionScratch,
    /// Nonzero reactions as loads on the rod; they start the next solve.
    pub(in crate::dynamics) contact_loads: Vec<ContactLoad>,
    pub(in crate::dynamics) load_buffers: ContactLoadBuffers,
}

impl BodyContactScratch {
    /// What the friction solver may still take in the sub-step.
    pub(in crate::dynamics) fn budget(&mut self) -> &mut SystemBudget {
        &mut self.reactions.friction.budget
    }

    /// Sets the constraint forces of `ties` under the last reactions of bodies and the forces `others`:
    /// segment, fraction of it, force, N, world. The solver is that of the linearisation.
    pub(in crate::dynamics) fn balance_ties(
        &mut self,
        ties: &[ActiveTie],
        rod: &Rod,
        solver: &Solver,
        others: impl Iterator<Item = (usize, f64, Vector3<f64>)>,
    ) {
        let bodies = self.problem.frames.iter().zip(self.reactions.forces.chunks_exact(3));
        let bodies = bodies.map(|(frame, r)| (frame.segment, frame.u, frame.world(r)));
        self.ties.balance(ties, rod, solver, bodies.chain(others));
    }

    /// Clears the previous step, possibly of another guide.
    pub(in crate::dynamics) fn clear(&mut self) {
        self.detection.contacts.clear();
        self.detection.impacts.clear();
        self.detection.midpoints.clear();
        self.detection.frozen = false;
        self.reactions.forces.clear();
        self.reactions.contact_loads.clear();
        self.ties.clear();
        self.stats = ContactStats::default();
    }

    /// Segment, position on it, and force (world, N) of each contact, then of each tie.
    pub(in crate::dynamics) fn world_forces(
        &self,
    ) -> impl Iterator<Item = (usize, f64, Vector3<f64>)> + Clone {
        let contacts = self.problem.frames.iter().zip(self.reactions.forces.chunks_exact(3));
        let contacts = contacts.map(|(frame, r)| (frame.segment, frame.u, frame.world(r)));
        contacts.chain(self.ties.world_forces())
    }
}
