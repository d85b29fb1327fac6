//! What a guide takes up as it comes away from its wisps, and how near to bodies it may follow.

use super::{Environment, Guide};
use crate::math::se3::Pose;
use crate::rod::RodShape;

impl Guide {
    /// Takes the motion up at time `t`, s, with the unknowns that it was given for now, and for one and two sub-steps of `h`, s, ago.
    pub(in crate::dynamics) fn take_up(&mut self, env: &Environment, t: f64, h: f64) {
        let mut shape = RodShape::default();
        let mut poses = |back: usize| -> Vec<Pose> {
            let root = env.root(&self.rod.root, t - back as f64 * h);
            shape.update(&self.rod, &root.r, &self.q[back]);
            shape.poses().map(|g| Pose { r: g.r, p: g.p + root.p }).collect()
        };
        let [now, one, two] = [0, 1, 2].map(&mut poses);
        for k in 0..self.x.len() {
            let [x, x1, x2] = [now[k].p, one[k].p, two[k].p];
            (self.x[k], self.v[k]) = (x, (x * 3.0 - x1 * 4.0 + x2) / (2.0 * h));
            self.tangent[k] = now[k].r.column(2).into();
            (self.before.x[k], self.before.v[k]) = (x1, (x - x2) / (2.0 * h));
            self.before.tangent[k] = one[k].r.column(2).into();
        }
        let rate = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| (a - b) / h).collect();
        self.past = [(h, rate(&self.q[0], &self.q[1])), (h, rate(&self.q[1], &self.q[2]))];
        self.before.q.clone_from(&self.q[1]);
        self.last = h;
        self.pushes.clear();
        self.friction_force.clear();
        self.pinched = false;
    }

    /// Distance that each place is to keep from each body, m, −∞ where it is exempt: at body b and place k at `b * places + k`, the points
    /// first, then the middles between any two.
    pub(in crate::dynamics) fn kept(&self) -> Vec<f64> {
        let mut clearance = Vec::new();
        self.clearance.at(1.0, &mut clearance);
        let halves = 2 * (self.x.len() - 1);
        let of = |ends: &[[f64; 2]]| {
            let between = |k: usize| ends[k - 1][1].min(ends[k][0]);
            let points = [f64::NEG_INFINITY].into_iter().chain((2..halves).step_by(2).map(between));
            points.chain([ends[halves - 1][1]]).chain((1..halves).step_by(2).map(between)).collect::<Vec<_>>()
        };
        clearance.chunks_exact(halves).flat_map(of).collect()
    }
}
