//! Hair against hair as a fibre assembly (`docs/theory.md` §5.3), the default. All hair is deposited on a grid in
//! the frame of the head; where it is denser than in the groom's pose it is under pressure, and what slips past
//! its neighbours is dragged along with them by friction and by the air between them.
//!
//! The forces of a sub-step follow from the state at its start.

mod grid;
mod law;
#[cfg(test)]
mod tests;

use super::air_drag::{self, HairDensity};
use super::environment::Environment;
use super::guide::{GuideModel, GuideState};
use super::wisp_friction::HeadVelocity;
use crate::wisp::GuideRod;
use grid::{Grid, Node};
use law::{Assembly, Fibre};
use nalgebra::{Point3, Vector3};
use rayon::prelude::*;

/// Mean volume fraction of human hair on a head. A groom with fewer strands is taken as a sample of as much hair.
const HAIR_FRACTION: f64 = 0.005;

/// The most hairs that one hair of a groom stands for. Strands that are sparser are single ones, which do not meet.
const MAX_SAMPLING: f64 = 30.0;

/// Smallest distance between nodes of the grid, m.
const MIN_SPACING: f64 = 0.01;

/// Roots whose distance to the nearest other one is measured.
const SPACING_SAMPLES: usize = 300;

/// The hair of a groom as a fibre assembly.
pub(super) struct HairVolume {
    hairs: Vec<Hairs>,
    /// Index of the first point of each guide, then the number of points.
    first: Vec<usize>,
    /// Volume fraction around each point in the groom's pose.
    rest: Vec<f64>,
    /// Places of the points at the end of the last frame, head space, m.
    framed: Vec<Vector3<f64>>,
    followers: Vec<Follower>,
    points: Vec<HairPoint>,
    grid: Grid,
}

/// The hairs of one guide.
struct Hairs {
    fibre: Fibre,
    /// Volume per length of all that they stand for, m².
    area: f64,
    /// Length of the groom's hairs per volume, m/m³, at volume fraction 1.
    length_density: f64,
    /// Share of the drag that dense hair shields.
    shielding: f64,
    /// Drag of an isolated hair, N·s/m².
    drag: f64,
}

/// A guide that moves with another.
struct Follower {
    guide: usize,
    leader: usize,
    /// For each point, the leader's point before it at the same share of the length, and how far (0..=1) it is
    /// towards the next.
    places: Vec<(usize, f64)>,
}

/// The hairs around a point of a guide, in head space.
#[derive(Debug, Clone, Copy, Default)]
struct HairPoint {
    /// Position, m.
    x: Vector3<f64>,
    /// Velocity relative to the head, m/s.
    v: Vector3<f64>,
    tangent: Vector3<f64>,
    /// Volume of the hairs, m³.
    volume: f64,
    /// u′ of [`Assembly::energy_slope`], Pa.
    energy_slope: f64,
}

/// Entry of a node for φ, and for the sum of φ u′, Pa. Between them are φ v and φ times the tangent.
const FRACTION: usize = 0;
const PRESSURE: usize = 7;

/// How many hairs each hair of a groom of `density` stands for; `None` if its strands are too sparse to meet.
pub(super) fn sampling(density: &HairDensity, hair_area: f64) -> Option<f64> {
    let sampling = HAIR_FRACTION / (density.mean() * hair_area);
    (sampling <= MAX_SAMPLING).then_some(sampling.max(1.0))
}

impl HairVolume {
    /// The hair of guides with the rods `rods`, whose `states` are the groom's pose at time `t`, s. Each hair stands
    /// for `sampling` hairs.
    pub fn new(
        rods: &[GuideRod],
        sampling: f64,
        models: &[GuideModel],
        states: &[GuideState],
        env: &Environment,
        t: f64,
    ) -> Self {
        let mut first = vec![0];
        for model in models {
            first.push(first[first.len() - 1] + model.rod.points());
        }
        let points = first[first.len() - 1];
        let mut volume = HairVolume {
            hairs: rods.iter().map(|r| Hairs::new(r, sampling)).collect(),
            first,
            rest: Vec::new(),
            framed: vec![Vector3::zeros(); points],
            followers: Vec::new(),
            points: vec![HairPoint::default(); points],
            grid: Grid::new(root_spacing(rods).max(MIN_SPACING)),
        };
        volume.deposit(models, states, env, t);
        volume.rest = volume.points.iter().map(|point| volume.assembly(point).fraction).collect();
        volume
    }

    /// Notes where the guides are at the end of a frame, at time `t`, s, and which active guide each moves with:
    /// `leader`.
    pub fn end_frame(
        &mut self,
        models: &[GuideModel],
        states: &[GuideState],
        leader: impl Fn(usize) -> usize,
        env: &Environment,
        t: f64,
    ) {
        let to_head = (env.head)(t).inverse();
        let positions = states.iter().flat_map(|state| &state.x);
        for (framed, x) in self.framed.iter_mut().zip(positions) {
            *framed = (to_head * Point3::from(*x)).coords;
        }
        self.set_leaders(models, leader);
    }

    /// Sets which active guide each guide moves with: `leader`.
    fn set_leaders(&mut self, models: &[GuideModel], leader: impl Fn(usize) -> usize) {
        let follower = |(guide, leader): (usize, usize)| {
            let [own, other] = [guide, leader].map(|i| &models[i].rod);
            let place = |s: &f64| {
                let s = s / own.length() * other.length();
                let k = other.arc.partition_point(|a| *a <= s).clamp(1, other.arc.len() - 1) - 1;
                (k, ((s - other.arc[k]) / (other.arc[k + 1] - other.arc[k])).clamp(0.0, 1.0))
            };
            Follower { guide, leader, places: own.arc.iter().map(place).collect() }
        };
        let leaders = (0..models.len()).map(|i| (i, leader(i)));
        self.followers = leaders.filter(|(guide, leader)| guide != leader).map(follower).collect();
    }

    /// Places at the end of the last frame, for a checkpoint.
    pub fn framed(&self) -> &[Vector3<f64>] {
        &self.framed
    }

    /// Returns to a checkpoint with the places `framed` at the end of the last frame.
    pub fn restore(
        &mut self,
        framed: Vec<Vector3<f64>>,
        models: &[GuideModel],
        leader: impl Fn(usize) -> usize,
    ) {
        self.framed = framed;
        self.set_leaders(models, leader);
    }

    /// Adds to the guides for which `active` holds the forces of the hair around them over a step of `h`, s, from
    /// time `t`, s.
    pub fn apply(
        &mut self,
        models: &[GuideModel],
        states: &mut [GuideState],
        active: impl Fn(usize) -> bool + Sync,
        env: &Environment,
        [t, h]: [f64; 2],
    ) {
        self.deposit(models, states, env, t);
        self.pressurise(h);
        let to_world = (env.head)(t).rotation;
        let volume = &*self;
        states.par_iter_mut().enumerate().filter(|(i, _)| active(*i)).for_each(|(i, state)| {
            let force = |k: usize| to_world * volume.force(i, k, &models[i], h);
            state.add_hair_force((0..models[i].rod.points()).map(force));
        });
    }

    /// Puts all hair on the grid as it is at time `t`, s.
    fn deposit(&mut self, models: &[GuideModel], states: &[GuideState], env: &Environment, t: f64) {
        let HairVolume { hairs, first, framed, followers, points, grid, .. } = self;
        let head = HeadVelocity::new(env, t);
        for (i, (model, state)) in models.iter().zip(states).enumerate() {
            for (k, point) in points[first[i]..first[i + 1]].iter_mut().enumerate() {
                *point = HairPoint {
                    x: head.to_head(&state.x[k]),
                    v: head.relative_velocity(&state.x[k], &state.v[k]),
                    tangent: head.rotate_to_head(&state.tangent[k]),
                    volume: hairs[i].area * model.rod.weight[k],
                    energy_slope: 0.0,
                };
            }
        }
        // Since the end of the frame followers have moved as their leaders.
        for Follower { guide, leader, places } in followers {
            for (k, (before, beyond)) in places.iter().enumerate() {
                let (own, other) = (first[*guide] + k, first[*leader] + before);
                let between = |of: &dyn Fn(usize) -> Vector3<f64>| of(other).lerp(&of(other + 1), *beyond);
                let moved = between(&|j| points[j].x - framed[j]);
                let (v, tangent) = (between(&|j| points[j].v), between(&|j| points[j].tangent));
                points[own] = HairPoint { x: framed[own] + moved, v, tangent, ..points[own] };
            }
        }
        let bounds =
            |[low, high]: [Vector3<f64>; 2], point: &HairPoint| [low.inf(&point.x), high.sup(&point.x)];
        let start = [1.0, -1.0].map(|sign| Vector3::repeat(sign * f64::INFINITY));
        let [low, high] = points.iter().fold(start, bounds);
        grid.clear(&low, &high);
        for point in points {
            let fraction = point.volume / grid.cell_volume();
            let (v, d) = (point.v * fraction, point.tangent * fraction);
            let stencil = grid.touch(&point.x);
            grid.add(&stencil, &[fraction, v.x, v.y, v.z, d.x, d.y, d.z, 0.0]);
        }
    }

    /// Finds the pressure of the hair on the grid for a step of `h`, s.
    fn pressurise(&mut self, h: f64) {
        let max_speed = law::max_wave_speed(self.grid.spacing(), h);
        let HairVolume { hairs, first, rest, points, grid, .. } = self;
        let fibre = |i: usize| &hairs[first.partition_point(|first| *first <= i) - 1].fibre;
        points.par_iter_mut().zip(&*rest).enumerate().for_each(|(i, (point, rest))| {
            let assembly = assembly(&grid.values(&grid.stencil(&point.x)));
            point.energy_slope = assembly.energy_slope(fibre(i), *rest, max_speed);
        });
        for point in points.iter().filter(|point| point.energy_slope > 0.0) {
            let stencil = grid.stencil(&point.x);
            grid.add_entry(&stencil, PRESSURE, point.energy_slope * point.volume / grid.cell_volume());
        }
    }

    /// The hair around a point.
    fn assembly(&self, point: &HairPoint) -> Assembly {
        assembly(&self.grid.values(&self.grid.stencil(&point.x)))
    }

    /// Force on point `k` of guide `i` over a step of `h`, s, N, head axes.
    fn force(&self, i: usize, k: usize, model: &GuideModel, h: f64) -> Vector3<f64> {
        let (hairs, point) = (&self.hairs[i], &self.points[self.first[i] + k]);
        let (length, mass) = (model.rod.weight[k], model.rod.mass[k]);
        let stencil = self.grid.stencil(&point.x);
        let values = self.grid.values(&stencil);
        let hair = assembly(&values);
        let slip = point.v - Vector3::new(values[1], values[2], values[3]) / hair.fraction;
        // The air between hairs moves with them.
        let shielded = air_drag::shielded_share(hair.fraction * hairs.length_density);
        let air = hairs.drag * hairs.shielding * shielded;
        let [across, along] = hair.friction(&hairs.fibre, slip.norm());
        // Share of the slip that is lost: exact for a constant coefficient, so that friction never reverses it.
        let loss = |coefficient: f64| -(-coefficient * length / mass * h).exp_m1();
        let slip_along = point.tangent * point.tangent.dot(&slip);
        let lost = (slip - slip_along) * loss(across + air) + slip_along * loss(along + 0.5 * air);
        // −∂/∂x of the energy Σ V u(φ), as deposited.
        let gradient = self.grid.gradient(&stencil, [(FRACTION, point.energy_slope), (PRESSURE, 1.0)]);
        gradient * (-hairs.fibre.area * length) - lost * (mass / h)
    }
}

impl Hairs {
    fn new(r: &GuideRod, sampling: f64) -> Self {
        let material = &r.material;
        let area = material.section.area();
        Hairs {
            fibre: Fibre {
                modulus: material.young_modulus,
                density: material.density,
                area,
                friction: material.friction.mu_k,
                parallel_friction: material.friction_parallel,
                friction_across: material.friction_across,
                cohesion: material.cohesion,
            },
            area: sampling * r.hairs * area,
            length_density: 1.0 / (sampling * area),
            shielding: material.shielding,
            drag: air_drag::ISOLATED_DRAG * material.drag,
        }
    }
}

/// The hair at a place with these values of the grid.
fn assembly(values: &Node) -> Assembly {
    let fraction = values[FRACTION];
    Assembly { fraction, direction: Vector3::new(values[4], values[5], values[6]) / fraction }
}

/// Mean distance of a root to the nearest other one, m; 0 for a single root.
fn root_spacing(rods: &[GuideRod]) -> f64 {
    let root = |i: usize| rods[i].rod.root.p;
    let nearest = |i: usize| {
        let others = (0..rods.len()).filter(|j| *j != i);
        others.map(|j| (root(i) - root(j)).norm_squared()).fold(f64::INFINITY, f64::min).sqrt()
    };
    let sampled = (0..rods.len()).step_by(rods.len().div_ceil(SPACING_SAMPLES).max(1));
    let distances: Vec<f64> = sampled.map(nearest).filter(|d| d.is_finite()).collect();
    distances.iter().sum::<f64>() / distances.len().max(1) as f64
}
