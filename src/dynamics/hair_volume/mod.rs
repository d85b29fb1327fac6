//! Hair against hair as a fibre assembly (`docs/theory.md` §5.3), the default. All hair is deposited on a
//! grid in the frame of the head; where it is denser than in the groom's pose it is under pressure, what slips
//! past its neighbours is dragged along with them by friction and by the air between them, and it does not move
//! into hair that crosses it.
//!
//! The forces of a sub-step follow from the state at its start, and from what the last one did.

mod crossing;
mod follower;
mod forces_apart;
mod grid;
mod law;
mod part;
mod piece;
mod reach;
mod record;
mod sampling;
mod spin;
#[cfg(test)]
mod tests;

use super::air_drag;
use super::checkpoint::StateMismatch;
use super::environment::Environment;
use super::guide::{GuideModel, GuideState};
use super::integrator::Past;
use super::step_record::HairRecord;
use super::wisp_friction::CarrierVelocity;
use crate::wisp::{GuideRod, NeighbourDrag};
use crossing::Crossing;
use follower::{Between, Beyond, Led};
use grid::{Grid, Node, Stencil};
use law::{Assembly, Fibre, Resistance};
use nalgebra::{Matrix3, UnitQuaternion, Vector3};
use part::Part;
use piece::Piece;
use rayon::prelude::*;
use reach::reach;
use record::Work;
use sampling::root_spacing;
pub(super) use sampling::sampling;
use serde::{Deserialize, Serialize};
use spin::RigidMotion;
use std::ops::Range;

/// Smallest distance between nodes of the grid, m.
const MIN_SPACING: f64 = 0.01;

/// Least length of a piece of a guide, in distances between nodes of the grid.
const PIECE: f64 = 0.6;

/// Fewest pieces that a thread takes at once.
const MIN_PIECES: usize = 512;

/// The hair of a groom as a fibre assembly, in pieces: consecutive points of a guide, with all its hairs.
pub(super) struct HairVolume {
    parts: Vec<Part>,
    /// The hairs of each piece.
    hairs: Vec<Hairs>,
    /// Index of the first piece of each guide, then the number of pieces.
    first: Vec<usize>,
    /// The hair around each piece in the groom's pose.
    rest: Vec<Rest>,
    /// 95th percentile of its volume fraction, by volume.
    dense: f64,
    /// The pieces at the end of the last frame.
    framed: Vec<Placed>,
    /// Of each piece; without meaning for those of followers.
    history: Vec<History>,
    /// Of pieces of followers, where on its leader each is.
    between: Vec<Option<Between>>,
    led: Led,
    /// The active guide that each guide moves with.
    leaders: Vec<usize>,
    pieces: Vec<Piece>,
    /// What pieces of active guides did since the end of the last frame.
    moved: Vec<Moved>,
    /// Of pieces of followers, what acts on each beyond what acts on its leader.
    beyond: Vec<Beyond>,
    /// Mean unit tangent of each piece over a turn.
    axes: Vec<Vector3<f64>>,
    /// The nodes around each piece, and what it adds to them.
    stencils: Vec<Stencil>,
    deposits: Vec<Node>,
    /// Volume fraction and volume of each piece, in the order in which the percentile was looked for.
    ranked: Vec<[f64; 2]>,
    grid: Grid,
    work: Work,
}

/// The hairs of a piece of a guide.
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
    /// True if nothing holds their roots.
    loose: bool,
}

/// What a checkpoint holds of a [`HairVolume`], per piece.
#[derive(Serialize, Deserialize)]
pub(super) struct HairVolumeState {
    framed: Vec<Placed>,
    history: Vec<History>,
    work: Work,
}

/// Where a piece is, head space.
#[derive(Debug, Clone, Copy, Default, Serialize, Deserialize)]
struct Placed {
    /// Mean position, m.
    x: Vector3<f64>,
    /// Mean unit tangent.
    tangent: Vector3<f64>,
}

/// What the next sub-step needs of the last one, of a piece, relative to the head.
#[derive(Debug, Clone, Copy, Serialize, Deserialize)]
struct History {
    /// Velocities at its start and at those of the sub-steps before, newest first, m/s.
    before: Past<Vector3<f64>>,
    /// Velocity at its end if [`Piece::load`] alone had acted, m/s.
    unforced: Vector3<f64>,
    /// η of its difference formula, s.
    eta: f64,
    /// Of a follower: acceleration that its neighbours' drag balanced when it began to follow, beyond that of
    /// its leader, m/s²: it keeps its own shape, and the load that this takes.
    beyond_leader: Vector3<f64>,
    /// Of a follower: force per length of the pressure when it began to follow, beyond that of its leader, N/m.
    pressure_beyond_leader: Vector3<f64>,
}

/// The hair around a piece in the groom's pose.
#[derive(Default)]
struct Rest {
    /// Volume fraction.
    fraction: f64,
    /// Volume fraction of what crosses the piece.
    crossing: f64,
}

/// How a piece moved since the end of the last frame, head space.
#[derive(Debug, Clone, Copy, Default)]
struct Moved {
    /// m
    by: Vector3<f64>,
    /// Change of the tangent.
    turned: Vector3<f64>,
    /// [`Piece::v`], m/s.
    v: Vector3<f64>,
    /// [`Piece::acceleration`], m/s².
    acceleration: Vector3<f64>,
}

/// Entries of a node: for φ; from which on for φ v, for φ times the tangent, and for φ x; and for the sum of φ u′, Pa.
const FRACTION: usize = 0;
const VELOCITY: usize = 1;
const TANGENT: usize = 4;
const PRESSURE: usize = 7;
const PLACE: usize = 8;

impl HairVolume {
    /// The hair of guides with the rods `rods`, whose `states` are the groom's pose at time `t`, s. Each hair
    /// of guide i stands for `sampling[i]` hairs; `h`, s, is the sub-step. `shot` are the times of all frames, s.
    pub fn new(
        rods: &[GuideRod],
        sampling: &[f64],
        models: &[GuideModel],
        states: &[GuideState],
        env: &Environment,
        ([t, h], shot): ([f64; 2], &[f64]),
    ) -> Self {
        let grid = Grid::new(root_spacing(rods).max(MIN_SPACING), reach(models, env, shot));
        let (parts, first) = Part::of_guides(models, PIECE * grid.spacing());
        let mut volume = HairVolume {
            hairs: parts
                .iter()
                .map(|part| Hairs::new(&rods[part.guide], sampling[part.guide], part))
                .collect(),
            first,
            rest: Vec::new(),
            dense: 0.0,
            framed: vec![Placed::default(); parts.len()],
            history: Vec::new(),
            between: vec![None; parts.len()],
            led: Led::default(),
            leaders: (0..models.len()).collect(),
            pieces: vec![Piece::default(); parts.len()],
            moved: vec![Moved::default(); parts.len()],
            beyond: vec![Beyond::default(); parts.len()],
            axes: vec![Vector3::zeros(); parts.len()],
            stencils: vec![Stencil::default(); parts.len()],
            deposits: vec![Node::default(); parts.len()],
            ranked: Vec::with_capacity(parts.len()),
            parts,
            grid,
            work: Work::default(),
        };
        volume.set_leaders(models, |i| i);
        volume.locate(states, env, t);
        let at_rest = |piece: &Piece| History {
            before: [piece.v; 3],
            unforced: piece.v,
            eta: h,
            beyond_leader: Vector3::zeros(),
            pressure_beyond_leader: Vector3::zeros(),
        };
        volume.history = volume.pieces.iter().map(at_rest).collect();
        volume.deposit(models, states, env, [t, h]);
        volume.rest = (0..volume.parts.len()).map(|i| volume.rest_of(i)).collect();
        volume.pieces.iter_mut().zip(&volume.rest).for_each(|(piece, rest)| piece.fraction = rest.fraction);
        volume.dense = volume.fraction_p95();
        volume
    }

    /// Notes where the guides, followers included, are at the end of a frame, at time `t`, s, and which active
    /// guide each moves with: `leader`.
    pub fn end_frame(
        &mut self,
        models: &[GuideModel],
        states: &[GuideState],
        leader: impl Fn(usize) -> usize,
        env: &Environment,
        t: f64,
    ) {
        // What each bears of the hair around it, as drag and as pressure.
        let [borne, pressed]: [fn(&Piece) -> Vector3<f64>; 2] = [|piece| -piece.load, |piece| piece.pressure];
        let own_and_led = |of: fn(&Piece) -> Vector3<f64>, beyond: fn(&History) -> Vector3<f64>| {
            let of_piece = |i: usize| match &self.between[i] {
                None => of(&self.pieces[i]),
                Some(between) => between.mean(|j| of(&self.pieces[j])) + beyond(&self.history[i]),
            };
            (0..self.parts.len()).map(of_piece).collect::<Vec<_>>()
        };
        let borne = own_and_led(borne, |history| history.beyond_leader);
        let pressed = own_and_led(pressed, |history| history.pressure_beyond_leader);
        self.follow(states, env, t);
        let followed = self.pieces.clone();
        let pasts: Vec<Past<Vector3<f64>>> =
            (0..self.parts.len()).map(|i| past(&self.history, &self.between, i)).collect();
        self.set_leaders(models, leader);
        self.locate(states, env, t);
        // What follows now, or does no more, keeps the acceleration that it had.
        let HairVolume { framed, history, pieces, between, .. } = self;
        let all = pieces.iter().zip(followed.iter().zip(&pasts)).zip(framed.iter_mut().zip(&mut *history));
        for ((piece, (followed, past)), (framed, history)) in all {
            *framed = Placed { x: piece.x, tangent: piece.tangent };
            history.before = past.map(|before| piece.v + (before - followed.v));
            history.unforced = piece.v - followed.acceleration * history.eta;
        }
        for (own, (between, history)) in between.iter().zip(history).enumerate() {
            if let Some(between) = between {
                history.beyond_leader = borne[own] - between.mean(|j| borne[j]);
                history.pressure_beyond_leader = pressed[own] - between.mean(|j| pressed[j]);
            }
        }
    }

    /// Sets which active guide each guide moves with: `leader`.
    fn set_leaders(&mut self, models: &[GuideModel], leader: impl Fn(usize) -> usize) {
        self.leaders = (0..models.len()).map(leader).collect();
        let middles =
            |i: usize| self.parts[self.pieces_of(i)].iter().map(|part| part.middle).collect::<Vec<f64>>();
        let mut places = vec![None; self.parts.len()];
        for (guide, &leader) in self.leaders.iter().enumerate().filter(|(guide, leader)| guide != *leader) {
            let (own, of_leader) = (middles(guide), middles(leader));
            for (piece, s) in self.pieces_of(guide).zip(own) {
                places[piece] = Some(Between::new(s, &of_leader, self.pieces_of(leader)));
            }
        }
        self.led = Led::new(&places);
        self.between = places;
    }

    /// The pieces of guide `i`.
    fn pieces_of(&self, i: usize) -> Range<usize> {
        self.first[i]..self.first[i + 1]
    }

    /// What a checkpoint holds.
    pub fn state(&self) -> HairVolumeState {
        HairVolumeState { framed: self.framed.clone(), history: self.history.clone(), work: self.work }
    }

    /// Returns to a checkpoint.
    pub fn restore(
        &mut self,
        saved: HairVolumeState,
        models: &[GuideModel],
        leader: impl Fn(usize) -> usize,
    ) -> Result<(), StateMismatch> {
        for found in [saved.framed.len(), saved.history.len()] {
            StateMismatch::unless_same("hair points", found, self.parts.len())?;
        }
        (self.framed, self.history, self.work) = (saved.framed, saved.history, saved.work);
        self.set_leaders(models, leader);
        Ok(())
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
        self.deposit(models, states, env, [t, h]);
        self.press_and_drag(h);
        let volume = &*self;
        let of_active = states.par_iter_mut().enumerate().filter(|(i, _)| active(*i));
        let to_world = (env.head)(t).rotation;
        of_active.for_each(|(i, state)| volume.add_force(i, &models[i], state, &to_world));
        self.record()
    }

    /// Adds to guide `i` the forces of the last sub-step of the hair around it and, where it leads, around what
    /// follows it; `to_world` turns from head axes.
    fn add_force(
        &self,
        i: usize,
        model: &GuideModel,
        state: &mut GuideState,
        to_world: &UnitQuaternion<f64>,
    ) {
        let forces = state.hair_force_mut();
        for piece in self.pieces_of(i) {
            let Piece { pressure, load, .. } = &self.pieces[piece];
            self.parts[piece].push(&model.rod, &[pressure, load].map(|of| to_world * of), forces);
        }
    }

    /// What opposed slip across guide `i` in the last sub-step, in the mean along it.
    pub fn opposition(&self, i: usize) -> NeighbourDrag {
        let pieces = self.pieces_of(i);
        let of_guide = || self.pieces[pieces.clone()].iter().zip(&self.parts[pieces.clone()]);
        let mass: f64 = of_guide().map(|(_, part)| part.mass).sum();
        let mean = |of: fn(&NeighbourDrag) -> f64| {
            of_guide().map(|(piece, part)| of(&piece.opposition) * part.mass).sum::<f64>() / mass
        };
        NeighbourDrag { friction: mean(|of| of.friction), air: mean(|of| of.air) }
    }

    /// Finds the pieces of all guides as they are at time `t`, s.
    fn locate(&mut self, states: &[GuideState], env: &Environment, t: f64) {
        let HairVolume { hairs, parts, pieces, grid, .. } = self;
        let head = CarrierVelocity::of_head(env, t);
        let all = pieces.par_iter_mut().zip(&*parts).zip(&*hairs).with_min_len(MIN_PIECES);
        all.for_each(|((piece, part), hairs)| {
            *piece = Piece::of(&states[part.guide], part, hairs, &head, grid);
        });
    }

    /// Finds the pieces as they are at time `t`, s; since the end of the frame followers have moved as their
    /// leaders.
    fn follow(&mut self, states: &[GuideState], env: &Environment, t: f64) {
        let HairVolume { hairs, parts, framed, history, between, pieces, moved, grid, .. } = self;
        let head = CarrierVelocity::of_head(env, t);
        let constants = parts.par_iter().zip(&*hairs).zip(&*between).zip(framed.par_iter().zip(&*history));
        let all = pieces.par_iter_mut().zip(&mut *moved).zip(constants).with_min_len(MIN_PIECES);
        all.filter(|(_, ((_, between), _))| between.is_none()).for_each(
            |((piece, moved), (((part, hairs), _), (framed, history)))| {
                *piece = Piece::of(&states[part.guide], part, hairs, &head, grid);
                piece.acceleration = (piece.v - history.unforced) / history.eta;
                let (by, turned) = (piece.x - framed.x, piece.tangent - framed.tangent);
                *moved = Moved { by, turned, v: piece.v, acceleration: piece.acceleration };
            },
        );
        let constants = parts.par_iter().zip(&*hairs).zip(&*between).zip(framed.par_iter().zip(&*history));
        let all = pieces.par_iter_mut().zip(constants).with_min_len(MIN_PIECES);
        all.for_each(|(piece, (((part, hairs), between), (framed, history)))| {
            let Some(between) = between else { return };
            let x = framed.x + between.mean(|j| moved[j].by);
            let v = between.mean(|j| moved[j].v);
            let tangent = framed.tangent + between.mean(|j| moved[j].turned);
            *piece = Piece::new([x, v, tangent], part, hairs, grid);
            piece.acceleration = between.mean(|j| moved[j].acceleration) + history.beyond_leader;
        });
    }

    /// Puts all hair on the grid as it is at time `t`, s, with the velocities that it would have at the end of a
    /// step of `h`, s, without its neighbours' drag.
    fn deposit(&mut self, models: &[GuideModel], states: &[GuideState], env: &Environment, [t, h]: [f64; 2]) {
        self.follow(states, env, t);
        let HairVolume { leaders, parts, history, between, pieces, axes, stencils, deposits, grid, .. } =
            self;
        let constants = axes.par_iter_mut().zip(&*parts).with_min_len(MIN_PIECES);
        constants.for_each(|(axis, part)| *axis = part.mean_over_turn(|piece| pieces[piece].tangent));
        let cell_volume = grid.cell_volume();
        let places = stencils.par_iter_mut().zip(&mut *deposits);
        let all = pieces.par_iter_mut().zip(places).zip(&*parts).enumerate().with_min_len(MIN_PIECES);
        all.for_each(|(i, ((piece, (stencil, deposit)), part))| {
            let leader = leaders[part.guide];
            let formula = models[leader].difference_formula(&states[leader], h);
            piece.eta = formula.eta;
            let [one, two, three] = past(history, between, i);
            piece.undragged = formula.y_star([piece.v, one, two, three]) + piece.acceleration * piece.eta;
            *stencil = grid.stencil(&piece.x);
            let fraction = piece.volume / cell_volume;
            let [v, d, x] = [piece.undragged, piece.tangent, piece.x].map(|of| of * fraction);
            *deposit = [fraction, v.x, v.y, v.z, d.x, d.y, d.z, 0.0, x.x, x.y, x.z, 0.0];
        });
        grid.make_blocks(stencils);
        grid.sum(stencils, deposits);
    }

    /// Finds the pressure of the hair on the grid and the drag of neighbours over a step of `h`, s.
    fn press_and_drag(&mut self, h: f64) {
        let max_speed = law::max_wave_speed(self.grid.spacing(), h);
        let HairVolume { hairs, parts, rest, pieces, axes, stencils, deposits, grid, .. } = self;
        let cell_volume = grid.cell_volume();
        let constants = parts.par_iter().zip(&*hairs).zip(&*rest).zip(&*stencils).zip(&*axes);
        let all = pieces.par_iter_mut().zip(&mut *deposits).zip(constants).with_min_len(MIN_PIECES);
        all.filter(|((piece, _), _)| !piece.absent).for_each(
            |((piece, deposit), ((((part, hairs), rest), stencil), axis))| {
                let values = grid.values(stencil);
                let assembly = assembly(&values);
                piece.energy_slope = assembly.energy_slope(&hairs.fibre, rest.fraction, max_speed);
                piece.softened = piece.energy_slope > 0.0 && assembly.wave_speed(&hairs.fibre) > max_speed;
                piece.fraction = assembly.fraction;
                let mut slip = piece.undragged - RigidMotion::around(grid, stencil, &values).at(&piece.x);
                let mobility = piece.eta * part.length / part.mass;
                let mut resistance = hairs.resistance(&assembly, mobility);
                let [friction, air] = [resistance.friction[0], resistance.drag[0]].map(|of| of / piece.eta);
                piece.opposition = NeighbourDrag { friction, air };
                let unopposed = slip;
                if let Some(crossing) = Crossing::of((grid, stencil), &assembly, axis) {
                    piece.repulsion = crossing.repulsion(&hairs.fibre, rest.crossing, max_speed);
                    piece.crossing = crossing.fraction;
                    let stopped = crossing.stopped(&slip, rest.crossing, piece.eta);
                    let pressed = stopped.norm() + mobility * hairs.fibre.area * piece.repulsion.norm();
                    resistance.press(pressed * hairs.fibre.friction);
                    slip -= stopped;
                }
                piece.slip = resistance.slip_left(&slip, &piece.tangent);
                piece.drag = (piece.slip - unopposed) / piece.eta;
                deposit[PRESSURE] = piece.energy_slope * piece.volume / cell_volume;
            },
        );
        grid.add_entry(stencils, PRESSURE, deposits);
        let all = pieces.par_iter_mut().zip(&*hairs).zip(&*stencils).with_min_len(MIN_PIECES);
        all.filter(|((piece, _), _)| !piece.absent).for_each(|((piece, hairs), stencil)| {
            // −∂/∂x of the energy Σ V u(φ), as deposited.
            let energy = |node: &Node| node[FRACTION] * piece.energy_slope + node[PRESSURE];
            piece.pressure = -grid.gradient(stencil, energy) * hairs.fibre.area;
        });
        self.push_apart();
        self.sum_wisps();
    }

    /// Adds to the pressure the repulsion of hair that crosses: half by each piece's own law, and half by the laws of
    /// the pieces around it, so that what pushes is pushed back. The grid holds these pushes then.
    fn push_apart(&mut self) {
        let HairVolume { hairs, pieces, axes, stencils, deposits, grid, .. } = self;
        if pieces.iter().all(|piece| piece.repulsion == Vector3::zeros()) {
            return;
        }
        // A piece is pushed by what crosses it, each in proportion to its part of the sum that `crossing` is.
        let all = pieces.par_iter().zip(&mut *deposits).zip(&*axes).with_min_len(MIN_PIECES);
        all.for_each(|((piece, deposit), axis)| {
            let force = piece.repulsion * (piece.volume / piece.crossing.max(f64::MIN_POSITIVE));
            let by_course = force * crossing::course(axis).transpose();
            deposit[..3].copy_from_slice(force.as_slice());
            deposit[3..].copy_from_slice(by_course.as_slice());
        });
        grid.sum(stencils, deposits);
        let cell_volume = grid.cell_volume();
        let all = pieces.par_iter_mut().zip(&*hairs).zip(&*stencils).with_min_len(MIN_PIECES);
        all.filter(|((piece, _), _)| !piece.absent).for_each(|((piece, hairs), stencil)| {
            let values = grid.values(stencil);
            let pushed = Vector3::from_column_slice(&values[..3])
                - Matrix3::from_column_slice(&values[3..]) * piece.tangent;
            piece.repulsion = 0.5 * (piece.repulsion - pushed / cell_volume);
            piece.pressure += piece.repulsion * hairs.fibre.area;
        });
    }

    /// Finds the forces on wisps: a guide that leads others moves as they do on average, under the mean of
    /// the forces on all of them.
    fn sum_wisps(&mut self) {
        let HairVolume { history, between, pieces, beyond, .. } = self;
        let constants = pieces.par_iter().zip(&*between).zip(&*history);
        let all = beyond.par_iter_mut().zip(constants).with_min_len(MIN_PIECES);
        all.for_each(|(beyond, ((piece, between), history))| {
            let Some(between) = between else { return };
            let borne = between.mean(|j| pieces[j].pressure) + history.pressure_beyond_leader;
            *beyond = Beyond {
                volume: piece.volume,
                pressure: piece.pressure - borne,
                load: piece.drag + history.beyond_leader - between.mean(|j| pieces[j].drag),
            };
        });
        let HairVolume { history, led, pieces, beyond, .. } = self;
        let all = pieces.par_iter_mut().zip(history).enumerate().with_min_len(MIN_PIECES);
        all.for_each(|(i, (piece, history))| {
            if !piece.absent {
                let ([pressure, load], moving) = led.mean(i, piece.volume, beyond);
                (piece.pressure, piece.load) = (piece.pressure + pressure, piece.drag + load);
                piece.moving = moving;
            }
            history.before = [piece.v, history.before[0], history.before[1]];
            history.unforced = piece.undragged + (piece.load - piece.acceleration) * piece.eta;
            history.eta = piece.eta;
        });
    }

    /// The hair around piece `i`, in the groom's pose.
    fn rest_of(&self, i: usize) -> Rest {
        let hair = self.assembly(i);
        let crossing = Crossing::of((&self.grid, &self.stencils[i]), &hair, &self.axes[i]);
        Rest { fraction: hair.fraction, crossing: crossing.map_or(0.0, |crossing| crossing.fraction) }
    }

    /// The hair around piece `i`.
    fn assembly(&self, i: usize) -> Assembly {
        assembly(&self.grid.values(&self.stencils[i]))
    }
}

impl Hairs {
    fn new(r: &GuideRod, sampling: f64, part: &Part) -> Self {
        let material = &r.material;
        let area = part.section * material.section.area();
        // Profiles are linear in arc length.
        let towards_tip = |at_tip: f64| 1.0 + (at_tip - 1.0) * part.middle;
        Hairs {
            fibre: Fibre {
                modulus: towards_tip(material.stiffness_at_tip) * material.young_modulus,
                density: material.density,
                area,
                friction: towards_tip(material.friction_at_tip) * material.friction.mu_k,
                parallel_friction: material.friction_parallel,
                friction_across: material.friction_across,
                cohesion: material.cohesion,
            },
            area: sampling * r.hairs * area,
            length_density: 1.0 / (sampling * area),
            shielding: material.shielding,
            drag: air_drag::ISOLATED_DRAG * material.drag,
            loose: r.rod.is_free(),
        }
    }

    /// What opposes the slip of a hair in an assembly over a step: friction and the air. `mobility` is η over
    /// the mass per length, s·m/kg.
    fn resistance(&self, assembly: &Assembly, mobility: f64) -> Resistance {
        // The air between hairs moves with them.
        let shielded = air_drag::shielded_share(assembly.fraction * self.length_density);
        let air = mobility * self.drag * self.shielding * shielded;
        let friction = assembly.friction_bounds(&self.fibre).map(|bound| mobility * bound);
        Resistance { friction, drag: [air, 0.5 * air] }
    }
}

/// [`History::before`] of piece `i`: that of a follower is its leader's.
fn past(history: &[History], between: &[Option<Between>], i: usize) -> Past<Vector3<f64>> {
    match &between[i] {
        None => history[i].before,
        Some(between) => std::array::from_fn(|back| between.mean(|j| history[j].before[back])),
    }
}

/// The hair at a place with these values of the grid.
fn assembly(values: &Node) -> Assembly {
    let fraction = values[FRACTION];
    Assembly { fraction, direction: direction(values) / fraction }
}

/// φ times the mean tangent, of a node or of the values at a place.
fn direction(values: &Node) -> Vector3<f64> {
    Vector3::new(values[TANGENT], values[TANGENT + 1], values[TANGENT + 2])
}
