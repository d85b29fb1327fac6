//! What a guide takes up as it comes away from its wisp, how it is stirred as a leader, and how near to bodies it may follow.

use super::{Guide, Surroundings};
use crate::bake::wisps::Moving;
use crate::math::se3::Pose;
use crate::rod::Shape;

impl Guide {
    /// Takes the motion up at time `t`, s, with unknowns `q` now, and one and two sub-steps of `h`, s, ago, 1/m.
    pub(in crate::bake) fn place(&mut self, q: [Vec<f64>; 3], around: &Surroundings, t: f64, h: f64) {
        let mut shape = Shape::default();
        let mut poses = |back: usize| -> Vec<Pose> {
            let root = around.root(&self.rod.root, t - back as f64 * h);
            shape.update(&self.rod, &root.r, &q[back]);
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
        self.past = [(h, rate(&q[0], &q[1])), (h, rate(&q[1], &q[2]))];
        self.before.q.clone_from(&q[1]);
        self.q = q;
        self.last = h;
        self.pushes.clear();
        self.pinched = false;
    }

    /// Size of the acceleration at each node as seen from the head, m/s², over the last sub-step, of `h`, s; `heads` is the head at its end and
    /// at its start.
    pub(in crate::bake) fn accelerations(&self, heads: &[Moving; 2], h: f64) -> Vec<f64> {
        let at = |k: usize| {
            let now = heads[0].seen(&self.x[k], &self.v[k]);
            (now - heads[1].seen(&self.before.x[k], &self.before.v[k])).norm() / h
        };
        (0..self.rod.nodes.len()).map(|node| at(self.rod.node_point(node))).collect()
    }

    /// Distance that each point is to keep from each body, m, less `slack` of that body, m: at body b and point k at `b * points + k`, −∞ where it is
    /// exempt.
    pub(in crate::bake) fn kept(&self, slack: &[f64]) -> Vec<f64> {
        let mut clearance = Vec::new();
        self.clearance.at(1.0, &mut clearance);
        let segments = self.x.len() - 1;
        let of = |(ends, slack): (&[[f64; 2]], &f64)| {
            let between = ends.windows(2).map(|w| w[0][1].min(w[1][0]));
            let points: Vec<f64> =
                [f64::NEG_INFINITY].into_iter().chain(between).chain([ends[segments - 1][1]]).collect();
            points.into_iter().map(|kept| kept - slack).collect::<Vec<_>>()
        };
        clearance.chunks_exact(segments).zip(slack).flat_map(of).collect()
    }
}
