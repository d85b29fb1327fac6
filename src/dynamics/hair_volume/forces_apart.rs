//! What the hair around followers does to them and not to their leaders.

use super::HairVolume;
use crate::dynamics::environment::Environment;
use crate::dynamics::guide::GuideModel;
use crate::wisp::ForceApart;

impl HairVolume {
    /// The forces of the last sub-step on a hair of each guide that its leader does not have, with the head as at
    /// time `t`, s: one for each piece of a guide that follows, none for others.
    pub fn forces_apart(&self, models: &[GuideModel], env: &Environment, t: f64) -> Vec<Vec<ForceApart>> {
        let to_world = (env.head)(t).rotation;
        let mut forces = vec![Vec::new(); models.len()];
        for follower in &self.followers {
            let guide = follower.guide();
            let model = &models[guide];
            let to_rest = env.carried(model.skin.as_ref(), t).rotation.inverse() * to_world;
            let mut before = 0.0;
            let force = |(own, between): (usize, super::follower::Between)| {
                let (piece, history, part) = (&self.pieces[own], &self.history[own], &self.parts[own]);
                let pressure = between.mean(|j| self.pieces[j].pressure) + history.pressure_beyond_leader;
                let load = between.mean(|j| self.pieces[j].load) - history.beyond_leader;
                let middle = before + 0.5 * part.length;
                before += part.length;
                ForceApart {
                    place: middle / model.rod.length(),
                    force: to_rest
                        * ((piece.pressure - pressure) * part.length + (piece.load - load) * part.mass),
                }
            };
            forces[guide] = follower.pieces(&self.first).map(force).collect();
        }
        forces
    }
}
