//! Which ties hold a guide.

use super::model::GuideModel;
use super::state::GuideState;
use crate::dynamics::environment::Environment;
use crate::dynamics::tie::Tie;
use nalgebra::Vector3;

impl GuideModel {
    /// The ties that hold the guide at time `t`, s, and their indices.
    pub(super) fn holding_ties<'a>(
        &'a self,
        state: &'a GuideState,
        t: f64,
    ) -> impl Iterator<Item = (usize, &'a Tie)> {
        let holds = move |(i, tie): &(usize, &Tie)| tie.holds_at(t) && !state.released.contains(i);
        self.ties.iter().enumerate().filter(holds)
    }

    /// Has ties let go of the guide that it has slid out of at time `t`, s, if they release it. `line` is a buffer.
    pub(super) fn release_ties(
        &self,
        env: &Environment,
        state: &mut GuideState,
        t: f64,
        line: &mut Vec<Vector3<f64>>,
    ) {
        if self.ties.iter().all(|tie| !tie.releases) {
            return;
        }
        state.contact_polyline(self, line);
        let left =
            |(_, tie): &(usize, &Tie)| tie.releases && tie.is_left_by(line, &(env.carrier)(tie.body, t));
        let released: Vec<usize> = self.holding_ties(state, t).filter(left).map(|(i, _)| i).collect();
        state.released.extend(released);
    }
}
