//! What the hair around followers does to them and not to their leaders.

use super::HairVolume;
use crate::dynamics::environment::Environment;
use crate::dynamics::guide::{GuideModel, GuideState};
use crate::wisp::ForceApart;
use nalgebra::Vector3;
use rayon::prelude::*;

impl HairVolume {
    /// The forces of the last sub-step on a hair of each guide that its leader does not have, with the head as at
    /// time `t`, s: one for each piece of a guide that follows, none for others.
    pub fn forces_apart(&self, models: &[GuideModel], env: &Environment, t: f64) -> Vec<Vec<ForceApart>> {
        let to_world = (env.head)(t).rotation;
        let of_guide = |(guide, model): (usize, &GuideModel)| {
            if self.leaders[guide] == guide {
                return Vec::new();
            }
            let to_rest = env.carried(model.skin.as_ref(), t).rotation.inverse() * to_world;
            let mut before = 0.0;
            let force = |own: usize| {
                let (piece, part) = (&self.pieces[own], &self.parts[own]);
                let [pressure, load] = self.led(own)?;
                let middle = before + 0.5 * part.length;
                before += part.length;
                Some(ForceApart {
                    place: middle / model.rod.length(),
                    force: to_rest
                        * ((piece.pressure - pressure) * part.length + (piece.load - load) * part.mass),
                })
            };
            self.pieces_of(guide).filter_map(force).collect()
        };
        models.par_iter().enumerate().map(of_guide).collect()
    }

    /// Adds to guide `i`, if it follows, the forces of the last sub-step on its leader, with what it bore beyond them
    /// when it began to follow, with the head as at time `t`, s. Its own would be those of a place from which it
    /// does not give way.
    pub fn add_force_of_leader(
        &self,
        i: usize,
        model: &GuideModel,
        state: &mut GuideState,
        env: &Environment,
        t: f64,
    ) {
        let to_world = (env.head)(t).rotation;
        let (rod, forces) = (&model.rod, state.hair_force_mut());
        for own in self.pieces_of(i) {
            if let Some(led) = self.led(own) {
                self.parts[own].push(rod, &led.map(|of| to_world * of), forces);
            }
        }
    }

    /// Force per length, N/m, and acceleration, m/s², of piece `own` of a follower by what acts on its leader, with
    /// what it bore beyond that when it began to follow, head space.
    fn led(&self, own: usize) -> Option<[Vector3<f64>; 2]> {
        let (between, history) = (self.between[own].as_ref()?, &self.history[own]);
        Some([
            between.mean(|j| self.pieces[j].pressure) + history.pressure_beyond_leader,
            between.mean(|j| self.pieces[j].load) - history.beyond_leader,
        ])
    }
}
