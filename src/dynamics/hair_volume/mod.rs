//! Hair against hair as a fibre assembly (`docs/theory.md` §5.3), the default. All hair is deposited on a
//! grid in the frame of the head; where it is denser than in the groom's pose it is under pressure, and what
//! slips past its neighbours is dragged along with them by friction and by the air between them.
//!
//! The forces of a sub-step follow from the state at its start.

mod grid;
mod law;
#[cfg(test)]
mod tests;

use super::air_drag::{self, HairDensity};
use super::environment::Environment;
use super::guide::{GuideModel, GuideState};
use super::step_record::HairRecord;
use super::wisp_friction::CarrierVelocity;
use crate::rod::Rod;
use crate::wisp::GuideRod;
use grid::{Grid, Node, Stencil};
use law::{Assembly, Fibre};
use nalgebra::Vector3;
use rayon::prelude::*;
use std::ops::Range;

/// Mean volume fraction of human hair on a head. A groom with fewer strands is taken as a sample of as much
/// hair.
const HAIR_FRACTION: f64 = 0.005;

/// The most hairs that one hair of a groom stands for. Strands that are sparser are single ones, which do not
/// meet.
const MAX_SAMPLING: f64 = 100.0;

/// Largest mean distance of strands, m, at which they stand for a head of hair: the density of strands that
/// are farther apart than its cells does not tell how far.
const MAX_DISTANCE: f64 = 0.02;

/// Hairs that grow on a scalp, 1/m²: what guides without strands stand for.
const ROOT_DENSITY: f64 = 2e6;

/// Smallest distance between nodes of the grid, m.
const MIN_SPACING: f64 = 0.01;

/// Roots whose distance to the nearest other one is measured.
const SPACING_SAMPLES: usize = 300;

/// Root mean square speed of hair in head space, m/s, below which its slip is not recorded.
const SLOW: f64 = 0.05;

/// Least length of a piece of a guide, in distances between nodes of the grid.
const PIECE: f64 = 0.6;

/// The hair of a groom as a fibre assembly, in pieces: consecutive points of a guide, with all its hairs.
pub(super) struct HairVolume {
    hairs: Vec<Hairs>,
    parts: Vec<Part>,
    /// Index of the first piece of each guide, then the number of pieces.
    first: Vec<usize>,
    /// Volume fraction around each piece in the groom's pose.
    rest: Vec<f64>,
    /// 95th percentile of it, by volume.
    dense: f64,
    /// Places of the pieces at the end of the last frame, head space, m.
    framed: Vec<Vector3<f64>>,
    followers: Vec<Follower>,
    pieces: Vec<Piece>,
    /// The nodes around each piece.
    stencils: Vec<Stencil>,
    /// Volume fraction and volume of each piece, in the order in which the percentile was looked for.
    ranked: Vec<[f64; 2]>,
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

/// What does not change of a piece.
struct Part {
    guide: usize,
    points: Range<usize>,
    /// The length that each point stands for, as a share of that of the piece.
    shares: Vec<f64>,
    /// m
    length: f64,
    /// Mass of one hair, kg.
    mass: f64,
}

/// A guide that moves with another.
struct Follower {
    guide: usize,
    leader: usize,
    /// For each piece, the leader's piece before it at the same share of the length, and how far (0..=1) it
    /// is towards the next.
    places: Vec<(usize, f64)>,
}

/// A piece of a guide with all its hairs, in head space.
#[derive(Debug, Clone, Copy, Default)]
struct Piece {
    /// Mean position, m.
    x: Vector3<f64>,
    /// Mean velocity relative to the head, m/s.
    v: Vector3<f64>,
    /// Mean unit tangent.
    tangent: Vector3<f64>,
    /// Volume of the hairs, m³.
    volume: f64,
    /// u′ of [`Assembly::energy_slope`], Pa.
    energy_slope: f64,
    /// Whether its pressure is less than the law's because of the sub-step.
    softened: bool,
    /// Volume fraction of the hair around it.
    fraction: f64,
    /// Mean of the unit tangents of the hair around it.
    direction: Vector3<f64>,
    /// Velocity against that of the hair around it, m/s.
    slip: Vector3<f64>,
}

/// Entry of a node for φ, and for the sum of φ u′, Pa. Between them are φ v and φ times the tangent.
const FRACTION: usize = 0;
const PRESSURE: usize = 7;

/// How many hairs each hair of a groom stands for; `None` if its strands are too sparse to meet. `density` is
/// that of the guides `rods` with their strands, of which there are none if `guides_only`.
pub(super) fn sampling(rods: &[GuideRod], density: &HairDensity, guides_only: bool) -> Option<f64> {
    let mean = |of: fn(&GuideRod) -> f64| rods.iter().map(of).sum::<f64>() / rods.len() as f64;
    let hairs = mean(|r| r.hairs);
    let distance = root_spacing(rods) / hairs.sqrt();
    let sampling = if guides_only && hairs <= 1.0 {
        Some(ROOT_DENSITY * distance * distance)
    } else {
        let area = mean(|r| r.material.section.area());
        Some(HAIR_FRACTION / (density.mean() * area)).filter(|sampling| *sampling <= MAX_SAMPLING)
    };
    sampling.filter(|_| rods.len() > 1 && distance <= MAX_DISTANCE).map(|sampling| sampling.max(1.0))
}

impl HairVolume {
    /// The hair of guides with the rods `rods`, whose `states` are the groom's pose at time `t`, s. Each hair
    /// stands for `sampling` hairs.
    pub fn new(
        rods: &[GuideRod],
        sampling: f64,
        models: &[GuideModel],
        states: &[GuideState],
        env: &Environment,
        t: f64,
    ) -> Self {
        let grid = Grid::new(root_spacing(rods).max(MIN_SPACING), reach(rods));
        let (mut parts, mut first) = (Vec::new(), vec![0]);
        for (guide, model) in models.iter().enumerate() {
            let pieces = pieces_of(&model.rod.weight, PIECE * grid.spacing());
            parts.extend(pieces.into_iter().map(|points| Part::new(guide, &model.rod, points)));
            first.push(parts.len());
        }
        let mut volume = HairVolume {
            hairs: rods.iter().map(|r| Hairs::new(r, sampling)).collect(),
            first,
            rest: Vec::new(),
            dense: 0.0,
            framed: vec![Vector3::zeros(); parts.len()],
            followers: Vec::new(),
            pieces: vec![Piece::default(); parts.len()],
            stencils: vec![Stencil::default(); parts.len()],
            ranked: Vec::with_capacity(parts.len()),
            parts,
            grid,
        };
        volume.deposit(states, env, t);
        volume.rest = (0..volume.parts.len()).map(|i| volume.assembly(i).fraction).collect();
        volume.pieces.iter_mut().zip(&volume.rest).for_each(|(piece, rest)| piece.fraction = *rest);
        volume.dense = volume.fraction_p95();
        volume
    }

    /// Notes where the guides are at the end of a frame, at time `t`, s, and which active guide each moves
    /// with: `leader`.
    pub fn end_frame(
        &mut self,
        models: &[GuideModel],
        states: &[GuideState],
        leader: impl Fn(usize) -> usize,
        env: &Environment,
        t: f64,
    ) {
        self.locate(states, env, t);
        self.framed.iter_mut().zip(&self.pieces).for_each(|(framed, piece)| *framed = piece.x);
        self.set_leaders(models, leader);
    }

    /// Sets which active guide each guide moves with: `leader`.
    fn set_leaders(&mut self, models: &[GuideModel], leader: impl Fn(usize) -> usize) {
        // Arc length in the middle of each piece of a guide, as a share of the guide's length.
        let middles = |i: usize| {
            let rod = &models[i].rod;
            let middle = |Part { points, .. }: &Part| {
                0.5 * (rod.arc[points.start] + rod.arc[points.end - 1]) / rod.length()
            };
            self.parts[self.first[i]..self.first[i + 1]].iter().map(middle).collect::<Vec<f64>>()
        };
        let follower = |(guide, leader): (usize, usize)| {
            let other = middles(leader);
            let place = |s: &f64| {
                let k = other.partition_point(|o| o <= s).clamp(1, (other.len() - 1).max(1)) - 1;
                let next = other.get(k + 1).unwrap_or(&f64::INFINITY);
                (k, ((s - other[k]) / (next - other[k])).clamp(0.0, 1.0))
            };
            Follower { guide, leader, places: middles(guide).iter().map(place).collect() }
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

    /// Adds to the guides for which `active` holds the forces of the hair around them over a step of `h`, s,
    /// from time `t`, s. Returns how the hair is at its start.
    pub fn apply(
        &mut self,
        models: &[GuideModel],
        states: &mut [GuideState],
        active: impl Fn(usize) -> bool + Sync,
        env: &Environment,
        [t, h]: [f64; 2],
    ) -> HairRecord {
        self.deposit(states, env, t);
        self.pressurise(h);
        let to_world = (env.head)(t).rotation;
        let volume = &*self;
        states.par_iter_mut().enumerate().filter(|(i, _)| active(*i)).for_each(|(i, state)| {
            let (rod, forces) = (&models[i].rod, state.hair_force_mut());
            for piece in volume.first[i]..volume.first[i + 1] {
                let [pressure, acceleration] = volume.force(piece, h).map(|f| to_world * f);
                for k in volume.parts[piece].points.clone() {
                    forces[k] += pressure * rod.weight[k] + acceleration * rod.mass[k];
                }
            }
        });
        self.record()
    }

    /// How the hair is, once its pressure is found.
    fn record(&mut self) -> HairRecord {
        let fraction_p95 = self.fraction_p95();
        let (mut volume, mut softened, mut slip, mut square_speed) = (0.0, 0.0, 0.0, 0.0);
        let mut largest: f64 = 0.0;
        for piece in &self.pieces {
            volume += piece.volume;
            softened += f64::from(u8::from(piece.softened)) * piece.volume;
            slip += piece.slip.norm_squared() * piece.volume;
            square_speed += piece.v.norm_squared() * piece.volume;
            largest = largest.max(piece.fraction);
        }
        let (slip, speed) = (slip.sqrt(), square_speed.sqrt());
        HairRecord {
            softened: softened / volume,
            crowding_p95: fraction_p95 / self.dense,
            crowding_max: largest / self.dense,
            slip: if speed > SLOW * volume.sqrt() { slip / speed } else { 0.0 },
        }
    }

    /// The 95th percentile, by volume, of the volume fraction around the pieces.
    fn fraction_p95(&mut self) -> f64 {
        let HairVolume { pieces, ranked, .. } = self;
        ranked.clear();
        ranked.extend(pieces.iter().map(|piece| [piece.fraction, piece.volume]));
        let mut above = 0.05 * ranked.iter().map(|[_, volume]| volume).sum::<f64>();
        // Halves it until one piece is left, where sorting all would take a good part of the sub-step.
        let mut part = &mut ranked[..];
        while part.len() > 1 {
            let middle = part.len() / 2;
            part.select_nth_unstable_by(middle, |a, b| a[0].total_cmp(&b[0]).then(a[1].total_cmp(&b[1])));
            let (lower, upper) = part.split_at_mut(middle);
            let volume: f64 = upper.iter().map(|[_, volume]| volume).sum();
            if volume > above {
                part = upper;
            } else {
                above -= volume;
                part = lower;
            }
        }
        part.first().map_or(0.0, |[fraction, _]| *fraction)
    }

    /// Finds the pieces of all guides as they are at time `t`, s.
    fn locate(&mut self, states: &[GuideState], env: &Environment, t: f64) {
        let HairVolume { hairs, parts, pieces, .. } = self;
        let head = CarrierVelocity::of_head(env, t);
        for (piece, Part { guide, points, shares, length, .. }) in pieces.iter_mut().zip(parts) {
            let state = &states[*guide];
            let mean = |of: &[Vector3<f64>]| {
                of[points.clone()].iter().zip(&*shares).map(|(v, share)| v * *share).sum::<Vector3<f64>>()
            };
            let (x, v, tangent) = (mean(&state.x), mean(&state.v), mean(&state.tangent));
            let x = head.to_head(&x);
            *piece = Piece {
                x,
                v: head.relative_velocity_at(&x, &v),
                tangent: head.rotate_to_head(&tangent),
                volume: hairs[*guide].area * *length,
                ..Piece::default()
            };
        }
    }

    /// Puts all hair on the grid as it is at time `t`, s.
    fn deposit(&mut self, states: &[GuideState], env: &Environment, t: f64) {
        self.locate(states, env, t);
        let HairVolume { first, framed, followers, pieces, stencils, grid, .. } = self;
        // Since the end of the frame followers have moved as their leaders.
        for Follower { guide, leader, places } in followers {
            for (k, (before, beyond)) in places.iter().enumerate() {
                let own = first[*guide] + k;
                let other = first[*leader] + before;
                let next = (other + 1).min(first[*leader + 1] - 1);
                let between = |of: &dyn Fn(usize) -> Vector3<f64>| of(other).lerp(&of(next), *beyond);
                let moved = between(&|j| pieces[j].x - framed[j]);
                let (v, tangent) = (between(&|j| pieces[j].v), between(&|j| pieces[j].tangent));
                pieces[own] = Piece { x: framed[own] + moved, v, tangent, ..pieces[own] };
            }
        }
        grid.clear();
        let cell_volume = grid.cell_volume();
        for (piece, stencil) in pieces.iter().zip(stencils) {
            let fraction = piece.volume / cell_volume;
            let (v, d) = (piece.v * fraction, piece.tangent * fraction);
            *stencil = grid.touch(&piece.x);
            grid.add(stencil, &[fraction, v.x, v.y, v.z, d.x, d.y, d.z, 0.0]);
        }
    }

    /// Finds the pressure of the hair on the grid for a step of `h`, s.
    fn pressurise(&mut self, h: f64) {
        let max_speed = law::max_wave_speed(self.grid.spacing(), h);
        let HairVolume { hairs, parts, rest, pieces, stencils, grid, .. } = self;
        let constants = parts.par_iter().zip(&*rest).zip(&*stencils);
        pieces.par_iter_mut().zip(constants).for_each(|(piece, ((part, rest), stencil))| {
            let (fibre, values) = (&hairs[part.guide].fibre, grid.values(stencil));
            let assembly = assembly(&values);
            piece.slip = piece.v - Vector3::new(values[1], values[2], values[3]) / assembly.fraction;
            piece.energy_slope = assembly.energy_slope(fibre, *rest, max_speed);
            piece.softened = piece.energy_slope > 0.0 && assembly.wave_speed(fibre) > max_speed;
            (piece.fraction, piece.direction) = (assembly.fraction, assembly.direction);
        });
        let cell_volume = grid.cell_volume();
        for (piece, stencil) in pieces.iter().zip(stencils).filter(|(piece, _)| piece.energy_slope > 0.0) {
            grid.add_entry(stencil, PRESSURE, piece.energy_slope * piece.volume / cell_volume);
        }
    }

    /// The hair around piece `i`.
    fn assembly(&self, i: usize) -> Assembly {
        assembly(&self.grid.values(&self.stencils[i]))
    }

    /// Pressure per length, N/m, and friction per mass, m/s², on a hair in piece `i` over a step of `h`, s;
    /// head axes.
    fn force(&self, i: usize, h: f64) -> [Vector3<f64>; 2] {
        let (part, piece) = (&self.parts[i], &self.pieces[i]);
        let hairs = &self.hairs[part.guide];
        let hair = Assembly { fraction: piece.fraction, direction: piece.direction };
        let slip = piece.slip;
        // The air between hairs moves with them.
        let shielded = air_drag::shielded_share(hair.fraction * hairs.length_density);
        let air = hairs.drag * hairs.shielding * shielded;
        let [across, along] = hair.friction(&hairs.fibre, slip.norm());
        // Share of the slip that is lost: exact for a constant coefficient, so that friction never reverses
        // it.
        let loss = |coefficient: f64| -(-coefficient * part.length / part.mass * h).exp_m1();
        let tangent = piece.tangent.try_normalize(0.0).unwrap_or_default();
        let slip_along = tangent * tangent.dot(&slip);
        let lost = (slip - slip_along) * loss(across + air) + slip_along * loss(along + 0.5 * air);
        // −∂/∂x of the energy Σ V u(φ), as deposited.
        let energy = |node: &Node| node[FRACTION] * piece.energy_slope + node[PRESSURE];
        let gradient = self.grid.gradient(&self.stencils[i], energy);
        [gradient * -hairs.fibre.area, lost * (-1.0 / h)]
    }
}

impl Part {
    /// The piece of a guide with these points of its `rod`.
    fn new(guide: usize, rod: &Rod, points: Range<usize>) -> Self {
        let weight = &rod.weight[points.clone()];
        let length: f64 = weight.iter().sum();
        let shares = weight.iter().map(|w| w / length).collect();
        Part { guide, shares, length, mass: rod.mass[points.clone()].iter().sum(), points }
    }
}

/// The points of the pieces of a guide whose points stand for the lengths `weight`, m: each piece is at least
/// `least` long, m, if the guide is.
fn pieces_of(weight: &[f64], least: f64) -> Vec<Range<usize>> {
    let mut pieces = Vec::new();
    let (mut start, mut length, mut left) = (0, 0.0, weight.iter().sum::<f64>());
    for (k, w) in weight.iter().enumerate() {
        length += w;
        left -= w;
        if length >= least && left >= least || k + 1 == weight.len() {
            pieces.push(start..k + 1);
            (start, length) = (k + 1, 0.0);
        }
    }
    pieces
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

/// The box, in head space, m, that hair cannot leave: no point is farther from its root than the guide is
/// long.
fn reach(rods: &[GuideRod]) -> [Vector3<f64>; 2] {
    let [low, high] = [1.0, -1.0].map(|sign| Vector3::repeat(sign * f64::INFINITY));
    rods.iter().fold([low, high], |[low, high], r| {
        let (root, length) = (r.rod.root.p, Vector3::repeat(r.rod.length()));
        [low.inf(&(root - length)), high.sup(&(root + length))]
    })
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
