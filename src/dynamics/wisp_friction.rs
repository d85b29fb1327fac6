//! Internal friction of wisps (S19): what a guide moves otherwise than its wisp does dies away (`docs/theory.md` §4.7).

use super::environment::Environment;
use super::guide::GuideState;
use crate::rod::Rod;
use nalgebra::{Isometry3, Vector3};
use rayon::prelude::*;

/// The guides of a groom as they rub against those of the same coarse wisp.
pub(super) struct WispFriction {
    /// The guides of each coarse wisp that has two and more.
    wisps: Vec<Vec<usize>>,
    guides: Vec<FrictionSampler>,
}

/// A guide among others.
pub(super) struct FrictionSampler {
    /// How many hairs it stands for.
    pub hairs: f64,
    /// Rate at which it loses what it moves otherwise than its wisp, 1/s.
    pub rate: f64,
    /// Strain nodes of the rod.
    nodes: usize,
    places: Vec<Place>,
}

/// A point of a guide between two strain nodes.
struct Place {
    node: usize,
    /// How much it belongs to the node and to the next.
    shares: [f64; 2],
    mass: f64,
}

/// Mass that belongs to each strain node, kg, and its mean velocity, m/s.
type AtNodes = Vec<(f64, Vector3<f64>)>;

impl FrictionSampler {
    /// A guide of `rod`.
    pub fn new(rod: &Rod, hairs: f64, rate: f64) -> Self {
        let place = |(&s, &mass): (&f64, &f64)| {
            let node = rod.nodes[1..rod.nodes.len() - 1].partition_point(|n| *n <= s);
            let beyond = (s - rod.nodes[node]) / (rod.nodes[node + 1] - rod.nodes[node]);
            Place { node, shares: [1.0 - beyond, beyond], mass }
        };
        FrictionSampler {
            hairs,
            rate,
            nodes: rod.nodes.len(),
            places: rod.arc.iter().zip(&rod.mass).map(place).collect(),
        }
    }

    /// The points that move by themselves, all but the root.
    fn moving(&self) -> impl Iterator<Item = (usize, &Place)> {
        self.places.iter().enumerate().skip(1)
    }

    /// The guide at its nodes, as seen from the head, in its frame.
    fn at_nodes(&self, guide: &GuideState, head: &HeadVelocity) -> AtNodes {
        let mut nodes = vec![(0.0, Vector3::zeros()); self.nodes];
        for (k, place) in self.moving() {
            let v = head.seen(&guide.x[k], &guide.v[k]);
            for (node, share) in nodes[place.node..].iter_mut().zip(&place.shares) {
                node.0 += share * place.mass;
                node.1 += v * (share * place.mass);
            }
        }
        nodes.iter_mut().for_each(|(mass, momentum)| *momentum /= *mass);
        nodes
    }

    /// Share of what it moves otherwise that it loses in a time `h`, s.
    fn lost(&self, h: f64) -> f64 {
        -(-self.rate * h).exp_m1()
    }

    /// Force on each of its points over a step of `h`, s, in the frame of `head`, N, by what its nodes move otherwise than the wisp, m/s.
    fn forces(&self, otherwise: &[Vector3<f64>], h: f64) -> Vec<Vector3<f64>> {
        let mut forces = vec![Vector3::zeros(); self.places.len()];
        for (k, place) in self.moving() {
            let [here, next] = place.shares;
            let v = otherwise[place.node] * here + otherwise[place.node + 1] * next;
            forces[k] = v * (-place.mass * self.lost(h) / h);
        }
        forces
    }
}

impl WispFriction {
    /// From the guides with the coarse wisp of each; `None` where none rubs. Guides of one wisp have as many nodes.
    pub fn new(guides: Vec<FrictionSampler>, wisp: &[usize]) -> Option<Self> {
        let mut wisps = vec![Vec::new(); wisp.iter().max().map_or(0, |last| last + 1)];
        wisp.iter().enumerate().for_each(|(i, &w)| wisps[w].push(i));
        wisps.retain(|wisp: &Vec<usize>| wisp.len() > 1 && wisp.iter().any(|&i| guides[i].rate > 0.0));
        (!wisps.is_empty()).then_some(WispFriction { wisps, guides })
    }

    /// Sets the forces on `guides` over a step of `h`, s, that starts now, where the head is as `head` says. `mover` is the guide with which each moves:
    /// itself, or the one that it follows.
    pub fn apply(
        &self,
        states: &mut [GuideState],
        mover: impl Fn(usize) -> usize + Sync,
        head: &HeadVelocity,
        h: f64,
    ) {
        let forces: Vec<_> =
            self.wisps.par_iter().map(|wisp| self.forces(wisp, states, &mover, head, h)).collect();
        for (i, forces) in forces.into_iter().flatten() {
            states[i].set_friction_force(forces);
        }
    }

    /// Forces on the points of the guides of `wisp` that move by themselves, N, world.
    fn forces(
        &self,
        wisp: &[usize],
        states: &[GuideState],
        mover: impl Fn(usize) -> usize,
        head: &HeadVelocity,
        h: f64,
    ) -> Vec<(usize, Vec<Vector3<f64>>)> {
        let mut hairs: Vec<(usize, f64)> = wisp.iter().map(|&i| (mover(i), self.guides[i].hairs)).collect();
        hairs.sort_by_key(|(i, _)| *i);
        hairs.dedup_by(|next, kept| {
            let same = next.0 == kept.0;
            if same {
                kept.1 += next.1;
            }
            same
        });
        let nodes: Vec<_> = hairs.iter().map(|&(i, _)| self.guides[i].at_nodes(&states[i], head)).collect();
        // Weighted with what each loses, so that what one loses others gain.
        let mut mean = vec![(0.0, Vector3::zeros()); nodes[0].len()];
        for ((i, hairs), nodes) in hairs.iter().zip(&nodes) {
            let lost = hairs * self.guides[*i].lost(h);
            for (mean, (mass, v)) in mean.iter_mut().zip(nodes) {
                mean.0 += lost * mass;
                mean.1 += v * (lost * mass);
            }
        }
        if mean.iter().any(|(weight, _)| *weight == 0.0) {
            return Vec::new();
        }
        let on = |(&(i, _), nodes): (&(usize, f64), &AtNodes)| {
            let otherwise: Vec<_> = nodes.iter().zip(&mean).map(|((_, v), (w, sum))| v - sum / *w).collect();
            (i, self.guides[i].forces(&otherwise, h).iter().map(|f| head.to_world(f)).collect())
        };
        hairs.iter().zip(&nodes).map(on).collect()
    }
}

/// The head at a moment, and how it moves.
pub(super) struct HeadVelocity {
    pose: Isometry3<f64>,
    beside: [Isometry3<f64>; 2],
}

impl HeadVelocity {
    /// Half the time over which its velocity is taken, s.
    const DELTA: f64 = 1e-4;

    pub fn new(env: &Environment, t: f64) -> Self {
        let beside = [t + HeadVelocity::DELTA, t - HeadVelocity::DELTA].map(|t| (env.head)(t));
        HeadVelocity { pose: (env.head)(t), beside }
    }

    /// Velocity `v`, m/s, of what is at `x`, m, as seen from the head, in its frame.
    pub fn seen(&self, x: &Vector3<f64>, v: &Vector3<f64>) -> Vector3<f64> {
        let local = self.pose.inverse_transform_point(&(*x).into());
        let carried = (self.beside[0] * local - self.beside[1] * local) / (2.0 * HeadVelocity::DELTA);
        self.pose.rotation.inverse() * (v - carried)
    }

    /// A vector of its frame in the world.
    pub fn to_world(&self, v: &Vector3<f64>) -> Vector3<f64> {
        self.pose.rotation * v
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::contact::Bodies;
    use crate::dynamics::guide::{ContactMode, GuideModel, GuideScratch};
    use crate::math::random;
    use crate::rod::{RodSource, SegmentSize, Taper};
    use crate::scene::Tree;
    use crate::scene::anim::Scheme;
    use nalgebra::UnitQuaternion;

    type V = Vector3<f64>;

    fn hair(i: usize, length: f64) -> Rod {
        let root = V::x() * (2e-3 * i as f64);
        Rod::new(&RodSource {
            points: &[root, root + V::y() * length],
            root_frame: None,
            arc: &Tree::default_arc(6),
            stiffness: [7.8e-9, 7.8e-9, 3.6e-9],
            line_density: 6.6e-6,
            damping: 1e-3,
            taper: Taper::NONE,
            natural_strain: None,
            segment_size: SegmentSize::FINE,
        })
        .unwrap()
    }

    fn turning_head() -> Environment<'static> {
        Environment { head: Box::new(turning), ..Environment::at_rest(Bodies::default()) }
    }

    /// Guides of one wisp, and their friction.
    struct Wisp {
        models: Vec<GuideModel>,
        states: Vec<GuideState>,
        friction: WispFriction,
    }

    /// Guides of the given lengths, and of one wisp that rubs at the given rates; each guide stands for more hairs than the one before.
    fn wisp(lengths: &[f64], rates: &[f64], env: &Environment, h: f64) -> Wisp {
        let rods: Vec<Rod> = lengths.iter().enumerate().map(|(i, l)| hair(i, *l)).collect();
        let sampler =
            |(i, (rod, rate)): (usize, (&Rod, &f64))| FrictionSampler::new(rod, 1.0 + i as f64, *rate);
        let samplers = rods.iter().zip(rates).enumerate().map(sampler).collect();
        let friction = WispFriction::new(samplers, &vec![0; lengths.len()]).unwrap();
        let model = |rod: Rod| {
            let drag = vec![0.0; rod.points()];
            GuideModel::new(rod, drag, 0.3)
        };
        let models: Vec<GuideModel> = rods.into_iter().map(model).collect();
        let states = models.iter().map(|model| GuideState::new(model, &[], env, 0.0, h)).collect();
        Wisp { models, states, friction }
    }

    fn turning(t: f64) -> Isometry3<f64> {
        let turn = UnitQuaternion::from_scaled_axis(V::new(0.3, 2.0, -1.0) * t);
        Isometry3::from_parts(V::new(1.0 + t, 0.2, -3.0 * t).into(), turn)
    }

    const H: f64 = 1.0 / 192.0;

    #[test]
    fn what_one_loses_others_gain_and_together_they_lose_energy() {
        let env = turning_head();
        let Wisp { mut states, friction, .. } = wisp(&[0.1, 0.23, 0.17], &[10.0, 300.0, 0.0], &env, H);
        let head = HeadVelocity::new(&env, 0.0);
        let mut drawn = 0..;
        for guide in &mut states {
            guide.v.fill_with(|| V::from_fn(|_, _| random::unit(5, drawn.next().unwrap()) - 0.5));
        }
        friction.apply(&mut states, |i| i, &head, H);
        let (mut force, mut power, mut energy, mut size) = (V::zeros(), 0.0, 0.0, 0.0);
        for (guide, FrictionSampler { hairs, places, .. }) in states.iter().zip(&friction.guides) {
            for ((f, place), (x, v)) in
                guide.friction_force().iter().zip(places).zip(guide.x.iter().zip(&guide.v)).skip(1)
            {
                let v = head.to_world(&head.seen(x, v));
                force += f * *hairs;
                size += f.norm() * hairs;
                power += f.dot(&v) * hairs;
                energy += 0.5 * place.mass * v.norm_squared() * hairs;
            }
            assert_eq!(guide.friction_force()[0], V::zeros());
        }
        assert!(force.norm() < 1e-12 * size, "{force}");
        // No more than there is in a step, whatever the rate.
        assert!(power < 0.0 && -power * H < 2.0 * energy, "{power} {energy}");
    }

    #[test]
    fn what_all_move_together_is_left_alone() {
        let env = turning_head();
        let Wisp { mut states, friction, .. } = wisp(&[0.1, 0.23, 0.17], &[50.0; 3], &env, H);
        let head = HeadVelocity::new(&env, 0.0);
        for guide in &mut states {
            for (x, v) in guide.x.iter().zip(&mut guide.v) {
                // As the head carries them, and all in one direction.
                *v = V::new(0.5, -2.0, 0.1)
                    + (turning(1e-5) * turning(0.0).inverse_transform_point(&(*x).into()) - *x).coords / 1e-5;
            }
        }
        friction.apply(&mut states, |i| i, &head, H);
        let largest =
            states.iter().flat_map(GuideState::friction_force).map(|f| f.norm()).fold(0.0, f64::max);
        assert!(largest < 1e-9, "{largest} N");
    }

    /// Mean over time of the energy of what guides of three lengths move otherwise than their wisp, J, after they were let go from the side,
    /// in steps of `h`, s.
    fn unrest(rate: f64, h: f64, scheme: Scheme) -> (f64, f64) {
        let gravity = Box::new(|_| V::x() * 9.81);
        let env = Environment { gravity, ..Environment::at_rest(Bodies::default()) };
        let Wisp { mut models, mut states, friction } =
            wisp(&[0.1, 0.15, 0.22], &[rate.max(1e-9); 3], &env, h);
        models.iter_mut().for_each(|model| model.scheme = scheme);
        let mut scratch = GuideScratch::default();
        let (mut energy, mut fastest) = (0.0, 0.0_f64);
        let steps = (1.0 / h) as u32;
        for step in 0..steps {
            let t = [f64::from(step) * h, f64::from(step + 1) * h];
            let head = HeadVelocity::new(&env, t[0]);
            if rate > 0.0 {
                friction.apply(&mut states, |i| i, &head, h);
            }
            for (model, state) in models.iter().zip(&mut states) {
                let record = model.step(&env, state, t, ContactMode::Bodies, &mut scratch);
                assert_eq!(record.unconverged, 0);
                fastest = state.v.iter().map(|v| v.norm()).fold(fastest, f64::max);
            }
            let nodes: Vec<_> =
                states.iter().zip(&friction.guides).map(|(g, r)| (r.hairs, r.at_nodes(g, &head))).collect();
            for k in 0..nodes[0].1.len() {
                let mass: f64 = nodes.iter().map(|(hairs, n)| hairs * n[k].0).sum();
                let mean = nodes.iter().map(|(hairs, n)| n[k].1 * (hairs * n[k].0)).sum::<V>() / mass;
                for (hairs, n) in &nodes {
                    energy += 0.5 * hairs * n[k].0 * (n[k].1 - mean).norm_squared() / f64::from(steps);
                }
            }
        }
        (energy, fastest)
    }

    #[test]
    fn guides_of_a_wisp_move_more_alike_the_more_they_rub_and_never_run_away() {
        for (scheme, h) in [(Scheme::Bdf2, H), (Scheme::BackwardEuler, H), (Scheme::Bdf2, 1.0 / 24.0)] {
            let runs = [0.0, 5.0, 50.0, 1e6].map(|rate| unrest(rate, h, scheme));
            assert!(runs.windows(2).all(|r| r[1].0 < 0.9 * r[0].0), "{scheme:?} {h}: {runs:?}");
            assert!(runs.iter().all(|(_, fastest)| *fastest < 1.1 * runs[0].1), "{scheme:?} {h}: {runs:?}");
        }
    }
}
