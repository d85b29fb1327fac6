//! What a checkpoint holds of a guide.

use super::{Guide, State};
use crate::dynamics::checkpoint::{Checkpoint, StateMismatch};
use crate::dynamics::clearance::Clearance;
use crate::rod::contact_load::ContactLoad;
use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

/// A guide's state: the fields of [`Guide`] that change.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct Saved {
    clearance: Clearance,
    q: [Vec<f64>; 3],
    x: Vec<Vector3<f64>>,
    v: Vec<Vector3<f64>>,
    tangent: Vec<Vector3<f64>>,
    before: State,
    last: f64,
    past: [(f64, Vec<f64>); 2],
    pushes: Vec<ContactLoad>,
    pinched: bool,
}

impl Checkpoint for Guide {
    type State = Saved;

    fn state(&self) -> Saved {
        // All fields by name: whoever adds one has to say here whether it changes.
        let Guide {
            rod: _,
            friction: _,
            across: _,
            ties: _,
            goal: _,
            // As the velocities at the start of a sub-step make it.
            friction_force: _,
            drag: _,
            coupled: _,
            sprung: _,
            scheme: _,
            lengths: _,
            // It spares searches and changes no result.
            memory: _,
            clearance,
            q,
            x,
            v,
            tangent,
            before,
            last,
            past,
            pushes,
            pinched,
        } = self;
        Saved {
            clearance: clearance.clone(),
            q: q.clone(),
            x: x.clone(),
            v: v.clone(),
            tangent: tangent.clone(),
            before: before.clone(),
            last: *last,
            past: past.clone(),
            pushes: pushes.clone(),
            pinched: *pinched,
        }
    }

    fn restore(&mut self, state: Saved) -> Result<(), StateMismatch> {
        let Saved { clearance, q, x, v, tangent, before, last, past, pushes, pinched } = state;
        let (points, unknowns) = (self.x.len(), self.rod.unknowns());
        for (what, found, expected) in [
            ("clearances", clearance.len(), self.clearance.len()),
            ("unknowns", q[0].len(), unknowns),
            ("unknowns one step back", q[1].len(), unknowns),
            ("unknowns two steps back", q[2].len(), unknowns),
            ("points", x.len(), points),
            ("velocities", v.len(), points),
            ("tangents", tangent.len(), points),
            ("past unknowns", before.q.len(), unknowns),
            ("past points", before.x.len(), points),
            ("past velocities", before.v.len(), points),
            ("past tangents", before.tangent.len(), points),
            ("rates", past[0].1.len(), unknowns),
            ("past rates", past[1].1.len(), unknowns),
        ] {
            StateMismatch::unless_same(what, found, expected)?;
        }
        (self.clearance, self.q, self.before, self.past) = (clearance, q, before, past);
        (self.x, self.v, self.tangent) = (x, v, tangent);
        (self.last, self.pushes, self.pinched) = (last, pushes, pinched);
        Ok(())
    }
}
