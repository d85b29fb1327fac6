//! Internal friction of wisps: damps each guide's velocity relative to its wisp's mean (`docs/theory.md`
//! §4.7).

use super::environment::Environment;
use super::guide::GuideState;
use crate::math;
use crate::rod::Rod;
use nalgebra::{Isometry3, Point3, Vector3};
use rayon::prelude::*;

/// Friction between the guides of each coarse wisp.
pub(super) struct WispFriction {
    /// The guides of each coarse wisp with two or more guides.
    wisps: Vec<Vec<usize>>,
    guides: Vec<FrictionSampler>,
}

/// Samples the velocity of one guide at its strain nodes.
pub(super) struct FrictionSampler {
    /// Number of hairs that the guide represents.
    pub hairs: f64,
    /// Decay rate of its velocity relative to its wisp, 1/s.
    pub rate: f64,
    /// Strain nodes of the rod.
    nodes: usize,
    points: Vec<SampledPoint>,
}

/// A point of a rod between two strain nodes.
struct SampledPoint {
    /// The node before it.
    node: usize,
    /// Weights of that node and the next.
    shares: [f64; 2],
    mass: f64,
}

/// Lumped mass of each strain node, kg, and its mean velocity, m/s.
type NodeVelocities = Vec<(f64, Vector3<f64>)>;

impl FrictionSampler {
    /// The sampler of a guide with `rod`.
    pub fn new(rod: &Rod, hairs: f64, rate: f64) -> Self {
        let point = |(&s, &mass): (&f64, &f64)| {
            let node = rod.nodes[1..rod.nodes.len() - 1].partition_point(|n| *n <= s);
            let beyond = (s - rod.nodes[node]) / (rod.nodes[node + 1] - rod.nodes[node]);
            SampledPoint { node, shares: [1.0 - beyond, beyond], mass }
        };
        FrictionSampler {
            hairs,
            rate,
            nodes: rod.nodes.len(),
            points: rod.arc.iter().zip(&rod.mass).map(point).collect(),
        }
    }

    /// All points but the root.
    fn free_points(&self) -> impl Iterator<Item = (usize, &SampledPoint)> {
        self.points.iter().enumerate().skip(1)
    }

    /// Masses and velocities at the nodes relative to the carrier of the root, in its frame.
    fn node_velocities(&self, guide: &GuideState, carrier: &CarrierVelocity) -> NodeVelocities {
        let mut nodes = vec![(0.0, Vector3::zeros()); self.nodes];
        for (k, point) in self.free_points() {
            let v = carrier.relative_velocity(&guide.x[k], &guide.v[k]);
            for (node, share) in nodes[point.node..].iter_mut().zip(&point.shares) {
                node.0 += share * point.mass;
                node.1 += v * (share * point.mass);
            }
        }
        nodes.iter_mut().for_each(|(mass, momentum)| *momentum /= *mass);
        nodes
    }

    /// Share of the relative velocity that is lost in a time `h`, s.
    fn loss(&self, h: f64) -> f64 {
        -(-self.rate * h).exp_m1()
    }

    /// Force on each point over a step of `h`, s, in the frame of the carrier, N, from the velocities of the
    /// nodes relative to the wisp, m/s.
    fn forces(&self, relative: &[Vector3<f64>], h: f64) -> Vec<Vector3<f64>> {
        let mut forces = vec![Vector3::zeros(); self.points.len()];
        for (k, point) in self.free_points() {
            let [here, next] = point.shares;
            let v = relative[point.node] * here + relative[point.node + 1] * next;
            forces[k] = v * (-point.mass * self.loss(h) / h);
        }
        forces
    }
}

impl WispFriction {
    /// Friction between guides with the coarse wisp of each; `None` if there is none. Guides of one wisp have
    /// equal numbers of nodes.
    pub fn new(guides: Vec<FrictionSampler>, wisp: &[usize]) -> Option<Self> {
        let mut wisps = vec![Vec::new(); wisp.iter().max().map_or(0, |last| last + 1)];
        wisp.iter().enumerate().for_each(|(i, &w)| wisps[w].push(i));
        wisps.retain(|wisp: &Vec<usize>| wisp.len() > 1 && wisp.iter().any(|&i| guides[i].rate > 0.0));
        (!wisps.is_empty()).then_some(WispFriction { wisps, guides })
    }

    /// Sets the friction forces on the guides over a step of `h`, s, that starts with what carries guide `i`
    /// at `carrier(i)`. `leader` maps each guide to the active guide that it moves with.
    pub fn apply(
        &self,
        states: &mut [GuideState],
        leader: impl Fn(usize) -> usize + Sync,
        carrier: impl Fn(usize) -> CarrierVelocity + Sync,
        h: f64,
    ) {
        let forces: Vec<_> =
            self.wisps.par_iter().map(|wisp| self.forces(wisp, states, &leader, &carrier, h)).collect();
        for (i, forces) in forces.into_iter().flatten() {
            states[i].add_hair_force(forces.into_iter());
        }
    }

    /// Forces on the points of the active guides of `wisp`, N, world.
    fn forces(
        &self,
        wisp: &[usize],
        states: &[GuideState],
        leader: impl Fn(usize) -> usize,
        carrier: impl Fn(usize) -> CarrierVelocity,
        h: f64,
    ) -> Vec<(usize, Vec<Vector3<f64>>)> {
        let mut hairs: Vec<(usize, f64)> = wisp.iter().map(|&i| (leader(i), self.guides[i].hairs)).collect();
        hairs.sort_by_key(|(i, _)| *i);
        math::merge_equal_keys(&mut hairs);
        let carriers: Vec<CarrierVelocity> = hairs.iter().map(|(i, _)| carrier(*i)).collect();
        let of = |(&(i, _), carrier): (&(usize, f64), &CarrierVelocity)| {
            self.guides[i].node_velocities(&states[i], carrier)
        };
        let nodes: Vec<_> = hairs.iter().zip(&carriers).map(of).collect();
        // Weighted by the momentum that each guide loses, so that momentum is conserved.
        let mut mean = vec![(0.0, Vector3::zeros()); nodes[0].len()];
        for ((i, hairs), nodes) in hairs.iter().zip(&nodes) {
            let loss = hairs * self.guides[*i].loss(h);
            for (mean, (mass, v)) in mean.iter_mut().zip(nodes) {
                mean.0 += loss * mass;
                mean.1 += v * (loss * mass);
            }
        }
        if mean.iter().any(|(weight, _)| *weight == 0.0) {
            return Vec::new();
        }
        let on = |((&(i, _), carrier), nodes): ((&(usize, f64), &CarrierVelocity), &NodeVelocities)| {
            let relative: Vec<_> = nodes.iter().zip(&mean).map(|((_, v), (w, sum))| v - sum / *w).collect();
            (i, self.guides[i].forces(&relative, h).iter().map(|f| carrier.to_world(f)).collect())
        };
        hairs.iter().zip(&carriers).zip(&nodes).map(on).collect()
    }
}

/// The pose and the velocity of what carries roots, the head or a skin, at one time.
#[derive(Debug, Clone, Copy)]
pub(super) struct CarrierVelocity {
    pose: Isometry3<f64>,
    /// Poses shortly after and before.
    neighbours: [Isometry3<f64>; 2],
}

impl CarrierVelocity {
    /// Half the interval of the difference quotient, s.
    const DELTA: f64 = 1e-4;

    /// Of the head at time `t`, s.
    pub fn of_head(env: &Environment, t: f64) -> Self {
        CarrierVelocity::new(&*env.head, t)
    }

    /// Of what has a pose at a time, s, at time `t`.
    pub fn new(pose: impl Fn(f64) -> Isometry3<f64>, t: f64) -> Self {
        let neighbours = [t + CarrierVelocity::DELTA, t - CarrierVelocity::DELTA].map(&pose);
        CarrierVelocity { pose: pose(t), neighbours }
    }

    /// Velocity `v`, m/s, of a point at `x`, m, relative to the carrier, in its frame.
    pub fn relative_velocity(&self, x: &Vector3<f64>, v: &Vector3<f64>) -> Vector3<f64> {
        self.relative_velocity_at(&self.to_head(x), v)
    }

    /// The same for a point at `place`, m, in its frame.
    pub fn relative_velocity_at(&self, place: &Vector3<f64>, v: &Vector3<f64>) -> Vector3<f64> {
        let local = Point3::from(*place);
        let carried =
            (self.neighbours[0] * local - self.neighbours[1] * local) / (2.0 * CarrierVelocity::DELTA);
        self.pose.rotation.inverse() * (v - carried)
    }

    /// Position of a point at `x`, m, in its frame.
    pub fn to_head(self, x: &Vector3<f64>) -> Vector3<f64> {
        self.pose.inverse_transform_point(&(*x).into()).coords
    }

    /// Rotates a vector from the world to its frame.
    pub fn rotate_to_head(&self, v: &Vector3<f64>) -> Vector3<f64> {
        self.pose.rotation.inverse() * v
    }

    /// Rotates a vector from its frame to the world.
    pub fn to_world(self, v: &Vector3<f64>) -> Vector3<f64> {
        self.pose.rotation * v
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::contact::Bodies;
    use crate::dynamics::guide::{ContactMode, GuideModel, GuideScratch};
    use crate::math::random;
    use crate::rod::RodSource;
    use crate::scene::Tree;
    use crate::scene::anim::Scheme;
    use nalgebra::UnitQuaternion;

    type V = Vector3<f64>;

    fn hair(i: usize, length: f64) -> Rod {
        let root = V::x() * (2e-3 * i as f64);
        Rod::new(&RodSource {
            damping: 1e-3,
            ..RodSource::hair(&[root, root + V::y() * length], &Tree::default_arc(6))
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

    /// One wisp of guides with the given lengths and friction rates; each guide represents one hair more than
    /// the one before.
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
    fn friction_conserves_momentum_and_dissipates_energy() {
        let env = turning_head();
        let Wisp { mut states, friction, .. } = wisp(&[0.1, 0.23, 0.17], &[10.0, 300.0, 0.0], &env, H);
        let head = CarrierVelocity::of_head(&env, 0.0);
        let mut drawn = 0..;
        for guide in &mut states {
            guide.v.fill_with(|| V::from_fn(|_, _| random::unit(5, drawn.next().unwrap()) - 0.5));
        }
        states.iter_mut().for_each(GuideState::clear_hair_force);
        friction.apply(&mut states, |i| i, |_| head, H);
        let (mut force, mut power, mut energy, mut size) = (V::zeros(), 0.0, 0.0, 0.0);
        for (guide, FrictionSampler { hairs, points, .. }) in states.iter().zip(&friction.guides) {
            for ((f, point), (x, v)) in
                guide.hair_force().iter().zip(points).zip(guide.x.iter().zip(&guide.v)).skip(1)
            {
                let v = head.to_world(&head.relative_velocity(x, v));
                force += f * *hairs;
                size += f.norm() * hairs;
                power += f.dot(&v) * hairs;
                energy += 0.5 * point.mass * v.norm_squared() * hairs;
            }
            assert_eq!(guide.hair_force()[0], V::zeros());
        }
        assert!(force.norm() < 1e-12 * size, "{force}");
        // No more than the energy there is, at any rate.
        assert!(power < 0.0 && -power * H < 2.0 * energy, "{power} {energy}");
    }

    #[test]
    fn friction_does_not_act_on_the_common_motion() {
        let env = turning_head();
        let Wisp { mut states, friction, .. } = wisp(&[0.1, 0.23, 0.17], &[50.0; 3], &env, H);
        let head = CarrierVelocity::of_head(&env, 0.0);
        for guide in &mut states {
            for (x, v) in guide.x.iter().zip(&mut guide.v) {
                // The motion of the head plus a common velocity.
                *v = V::new(0.5, -2.0, 0.1)
                    + (turning(1e-5) * turning(0.0).inverse_transform_point(&(*x).into()) - *x).coords / 1e-5;
            }
        }
        states.iter_mut().for_each(GuideState::clear_hair_force);
        friction.apply(&mut states, |i| i, |_| head, H);
        let largest = states.iter().flat_map(GuideState::hair_force).map(|f| f.norm()).fold(0.0, f64::max);
        assert!(largest < 1e-9, "{largest} N");
    }

    /// Mean over time of the kinetic energy relative to the wisp, J, and the highest speed, m/s, of guides of
    /// three lengths released sideways, in steps of `h`, s.
    fn deviation_energy(rate: f64, h: f64, scheme: Scheme) -> (f64, f64) {
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
            let head = CarrierVelocity::of_head(&env, t[0]);
            if rate > 0.0 {
                states.iter_mut().for_each(GuideState::clear_hair_force);
                friction.apply(&mut states, |i| i, |_| head, h);
            }
            for (model, state) in models.iter().zip(&mut states) {
                let record = model.step(&env, state, t, ContactMode::Bodies, &mut scratch);
                assert_eq!(record.unconverged, 0);
                fastest = state.v.iter().map(|v| v.norm()).fold(fastest, f64::max);
            }
            let nodes: Vec<_> = states
                .iter()
                .zip(&friction.guides)
                .map(|(g, r)| (r.hairs, r.node_velocities(g, &head)))
                .collect();
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
    fn relative_motion_decreases_with_friction_and_is_stable_at_any_rate() {
        for (scheme, h) in [
            (Scheme::FourStep, H),
            (Scheme::Bdf2, H),
            (Scheme::BackwardEuler, H),
            (Scheme::FourStep, 1.0 / 24.0),
        ] {
            let runs = [0.0, 5.0, 50.0, 1e6].map(|rate| deviation_energy(rate, h, scheme));
            assert!(runs.windows(2).all(|r| r[1].0 < 0.9 * r[0].0), "{scheme:?} {h}: {runs:?}");
            assert!(runs.iter().all(|(_, fastest)| *fastest < 1.1 * runs[0].1), "{scheme:?} {h}: {runs:?}");
        }
    }
}
