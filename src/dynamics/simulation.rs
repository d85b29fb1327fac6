//! All guides in time: the groom's pose settled in a pre-roll, then sub-step by sub-step.

use super::air_drag::{self, Bulk};
use super::batch::Batches;
use super::checkpoint::{Checkpoint, StateMismatch};
use super::coupled_substep::CoupledSubstep;
use super::environment::Environment;
use super::guide::Guide;
use super::guide_frame::{GuideFrame, SolverStep};
use super::guide_rods::GuideRods;
use super::step_record::StepRecord;
use super::strand_contact::{BundleProperties, StrandContacts};
use super::wisp_friction::{FrictionSampler, Moving, WispFriction};
use super::wisps::{Changes, Wisps};
use crate::contact::{Bodies, Body};
use crate::rod::{Rod, RodShape};
use crate::scene::anim::{Contact, Resolution, Written};
use crate::scene::{Anim, Groom};
use crate::wisp::{GuideRod, Hierarchy};
use nalgebra::Vector3;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

/// Share of the section of a pressed bundle of hair that is hair: between loose (0.4) and hexagonal (0.9).
const PACKING: f64 = 0.6;

/// What a sub-step did.
#[derive(Debug, Clone, Copy)]
pub struct SubStep<'a> {
    /// To each guide.
    pub records: &'a [StepRecord],
    /// Which guides moved by themselves; there are no figures of the others.
    pub stepped: &'a [bool],
    /// Whether guides met each other, and took what parts it was taken in all at once.
    pub coupled: bool,
    /// Strain nodes with unknowns of the guides that move by themselves from now on.
    pub nodes: u32,
    /// To wisps.
    pub changes: Changes,
    /// Guides that came away from their wisps at the start of the frame that ends now, and what each sub-step of it did to them.
    pub caught_up: &'a [(usize, StepRecord)],
}

/// The guides of a groom in motion.
pub struct Simulation<'a> {
    anim: &'a Anim,
    /// What the guides collide with, one per collider of the animation.
    pub bodies: Bodies,
    /// The guides, in the groom's order.
    pub guides: Vec<Guide>,
    /// What the last sub-step did, guide by guide.
    records: Vec<StepRecord>,
    /// Which guides moved by themselves in it.
    stepped: Vec<bool>,
    /// Which guides move at all.
    moved: Vec<bool>,
    batches: Batches,
    /// The guides as they touch each other, if they do.
    strand_contacts: Option<StrandContacts>,
    /// The friction of guides within their wisps, if there is any.
    wisp_friction: Option<WispFriction>,
    /// The guides as wisps, where not all move by themselves.
    wisps: Option<Wisps>,
    /// See [`SubStep::caught_up`].
    caught_up: Vec<(usize, StepRecord)>,
    /// Where the guides were brought since the last frame, where that is written.
    steps: Vec<SolverStep>,
    /// Sub-steps taken since the start of the pre-roll.
    taken: i64,
    /// Sub-steps of the pre-roll.
    preroll: i64,
}

impl<'a> Simulation<'a> {
    /// The groom at the start of its pre-roll. `groom` must have its trees, `rods` are its own.
    pub fn new(groom: &Groom, anim: &'a Anim, rods: &GuideRods) -> Self {
        let step = 1.0 / (anim.fps * f64::from(anim.settings.substeps));
        let preroll = preroll(anim);
        let moved = rods.moved.clone();
        let rods = &rods.simulated;
        let bulk = Bulk::new(rods.iter().map(|r| (groom.guides.curves.curve(r.guide), r.hairs)));
        let ties = super::tie::ties(groom, anim, rods);
        let bodies = Bodies::new(anim.colliders.iter().map(Body::from));
        let mut simulation = Simulation {
            anim,
            bodies,
            guides: Vec::new(),
            records: vec![StepRecord::default(); rods.len()],
            stepped: moved.clone(),
            moved,
            batches: Batches::default(),
            strand_contacts: (anim.settings.contact == Contact::Full)
                .then(|| StrandContacts::new(skins(rods))),
            wisp_friction: wisp_friction(rods),
            wisps: None,
            caught_up: Vec::new(),
            steps: Vec::new(),
            taken: 0,
            preroll,
        };
        let t = simulation.time();
        simulation.bodies.prepare([t, t]);
        simulation.guides =
            simulation.env(|env| rods.par_iter().map(|r| start(anim, &bulk, r, env, t, step)).collect());
        for (guide, ties) in simulation.guides.iter_mut().zip(ties) {
            guide.ties = ties;
        }
        simulation.wisps = match anim.settings.resolution() {
            Resolution::Full => None,
            resolution => {
                let parting = (resolution == Resolution::Adaptive).then_some(anim.settings.parting);
                let pull = simulation.env(|env| (env.head)(t).rotation.inverse() * (env.gravity)(t));
                let mut hierarchy = Hierarchy::new(groom, rods, &pull, |i| &simulation.guides[i].drag);
                hierarchy.restrict_to(&mut simulation.moved);
                Some(Wisps::new(hierarchy, parting, step, 1.0 / anim.fps))
            }
        };
        simulation.rebuild();
        // Where there is no pre-roll it has ended.
        simulation.adapt();
        simulation
    }

    /// Length of a sub-step, s.
    pub fn step(&self) -> f64 {
        1.0 / (self.anim.fps * f64::from(self.anim.settings.substeps))
    }

    /// Time now, s. The pre-roll ends one frame before the first, on the handle frame.
    pub fn time(&self) -> f64 {
        self.time_after(self.taken)
    }

    fn time_after(&self, taken: i64) -> f64 {
        let substeps = i64::from(self.anim.settings.substeps);
        let first = (i64::from(self.anim.frames.0) - 1) * substeps;
        (first + taken - self.preroll) as f64 / (self.anim.fps * substeps as f64)
    }

    /// Sub-steps taken since the start of the pre-roll.
    pub fn taken(&self) -> i64 {
        self.taken
    }

    /// Whether guide `i` moves by itself.
    pub fn is_free(&self, i: usize) -> bool {
        self.moved[i] && self.wisps.as_ref().is_none_or(|wisps| wisps.is_free(i))
    }

    /// The guides that move by themselves.
    pub fn free(&self) -> impl Iterator<Item = &Guide> {
        self.guides.iter().enumerate().filter(|(i, _)| self.is_free(*i)).map(|(_, guide)| guide)
    }

    /// The guides now, in the groom's order; what follows others is where it was at the end of the last frame.
    pub fn states(&self) -> Vec<GuideFrame> {
        let h = self.step();
        let level = |i: usize| self.wisps.as_ref().map_or(0, |wisps| wisps.level(i));
        let state =
            |(i, guide): (usize, &Guide)| GuideFrame::new(guide.q.each_ref().map(|q| &q[..]), h, level(i));
        self.guides.par_iter().enumerate().map(state).collect()
    }

    /// Where the solver brought the guides since the last frame, if that is written; forgets it.
    pub fn steps(&mut self) -> Vec<SolverStep> {
        std::mem::take(&mut self.steps)
    }

    /// The guide with which guide `i` moves: itself, or one that it follows.
    fn mover(&self, i: usize) -> usize {
        self.wisps.as_ref().map_or(i, |wisps| wisps.mover(i))
    }

    /// Takes over which guides move by themselves from now on.
    fn rebuild(&mut self) {
        self.batches = Batches::rebuild(&self.guides, |i| self.is_free(i));
        self.strand_contacts = self.strand_contacts.take().map(|mut strand_contacts| {
            self.env(|env| strand_contacts.rebuild(&self.guides, |i| self.mover(i), env, self.time()));
            strand_contacts
        });
    }

    /// Takes one sub-step; returns what it did.
    pub fn advance(&mut self) -> SubStep<'_> {
        for i in 0..self.stepped.len() {
            self.stepped[i] = self.is_free(i);
        }
        let (t0, t1) = (self.time_after(self.taken), self.time_after(self.taken + 1));
        self.bodies.prepare([t0, t1]);
        let (mut guides, mut records) = (std::mem::take(&mut self.guides), std::mem::take(&mut self.records));
        records.fill(StepRecord::default());
        if let Some(wisp_friction) = &self.wisp_friction {
            let mover = |i: usize| self.mover(i);
            self.env(|env| wisp_friction.act(&mut guides, mover, &Moving::new(env, t0), t1 - t0));
        }
        let (mut strand_contacts, mut steps) = (self.strand_contacts.take(), std::mem::take(&mut self.steps));
        let mut note = |t: f64, guides: &[Guide]| {
            if self.anim.settings.curves == Written::Steps && self.taken >= self.preroll {
                steps.push(SolverStep::new(t, guides));
            }
        };
        self.env(|env| match &mut strand_contacts {
            None => {
                self.batches.advance(&mut guides, env, [t0, t1], &mut records);
                note(t1, &guides);
            }
            Some(strand_contacts) => {
                let (batches, guides) = (&self.batches, &mut guides);
                CoupledSubstep { guides, strand_contacts, batches, env, note: &mut note }
                    .advance([t0, t1], &mut records);
            }
        });
        (self.guides, self.records, self.strand_contacts, self.steps) =
            (guides, records, strand_contacts, steps);
        self.taken += 1;
        if self.is_at_frame() {
            // That is the frame's own state.
            self.steps.pop();
        }
        let changes = self.adapt();
        let nodes = self.free().map(|g| g.rod.unknowns() as u32 / 3).sum();
        let coupled = self.strand_contacts.is_some();
        let (records, stepped, caught_up) = (&self.records, &self.stepped, &self.caught_up);
        SubStep { records, stepped, coupled, nodes, changes, caught_up }
    }

    /// Whether a sub-step has just ended at a frame.
    fn is_at_frame(&self) -> bool {
        let moved = self.taken - self.preroll;
        moved >= 0 && moved % i64::from(self.anim.settings.substeps) == 0
    }

    /// Gathers the wisps at the end of the pre-roll; from then on, at the end of every frame, moves what follows, and lets guides come away and join.
    fn adapt(&mut self) -> Changes {
        self.caught_up.clear();
        let mut changes = Changes::default();
        if !self.is_at_frame() {
            return changes;
        }
        let starts = self.taken == self.preroll;
        let Some(mut wisps) = self.wisps.take() else { return changes };
        let mut guides = std::mem::take(&mut self.guides);
        if starts {
            self.env(|env| wisps.gather(&guides, env, self.time()));
        } else {
            let first = self.taken - i64::from(self.anim.settings.substeps);
            let frame = [first, self.taken].map(|taken| self.time_after(taken));
            self.env(|env| wisps.swing(env, frame));
            for level in 0..wisps.levels() {
                let away = self.env(|env| wisps.lead(level, &mut guides, env, frame));
                self.catch_up(first, &away, &mut guides);
                wisps.note(level, &guides);
                changes.splits += away.len() as u32;
            }
            changes.merges = wisps.join(&guides, frame[1]);
        }
        (self.guides, self.wisps) = (guides, Some(wisps));
        if starts || changes != Changes::default() {
            self.rebuild();
        }
        changes
    }

    /// Takes the guides `away` from the end of the sub-step before number `first` to now, each by itself and past other guides, which have gone
    /// there already; those they meet from then on.
    fn catch_up(&mut self, first: i64, away: &[usize], guides: &mut [Guide]) {
        let away: Vec<usize> = away.iter().copied().filter(|i| self.moved[*i]).collect();
        if away.is_empty() {
            return;
        }
        away.iter().for_each(|&i| guides[i].coupled = false);
        let batches = Batches::rebuild(guides, |i| away.binary_search(&i).is_ok());
        let mut records = vec![StepRecord::default(); guides.len()];
        for taken in first..self.taken {
            let span = [taken, taken + 1].map(|taken| self.time_after(taken));
            self.bodies.prepare(span);
            self.env(|env| batches.advance(guides, env, span, &mut records));
            self.caught_up.extend(away.iter().map(|&i| (i, records[i])));
        }
        away.iter().for_each(|&i| guides[i].coupled = self.strand_contacts.is_some());
    }

    fn env<T>(&self, f: impl FnOnce(&Environment) -> T) -> T {
        let anim = self.anim;
        let out = self.time_after(self.preroll);
        f(&Environment {
            bodies: &self.bodies,
            body: &|b, t| anim.bodies[anim.colliders[b].body].track.pose(t),
            brought_out: &|t| match anim.settings.preroll {
                // Half of the pre-roll to come out, half to settle.
                p if p > 0.0 => ((t - out + p) / (0.5 * p)).clamp(0.0, 1.0),
                _ => 1.0,
            },
            carrier: &|b, t| anim.bodies[b].track.pose(t),
            head: &|t| anim.head_pose(t),
            gravity: &|t| anim.gravity + anim.forces.iter().map(|k| k.at(t)).sum::<Vector3<f64>>(),
            wind: &anim.wind,
        })
    }
}

/// Sub-steps of the pre-roll.
fn preroll(anim: &Anim) -> i64 {
    let step = 1.0 / (anim.fps * f64::from(anim.settings.substeps));
    (anim.settings.preroll / step).ceil() as i64
}

/// Sub-steps from the start of the pre-roll to a frame, which is not before the handle frame.
pub fn steps_to(anim: &Anim, frame: i32) -> i64 {
    let frames = i64::from(frame) - i64::from(anim.frames.0) + 1;
    preroll(anim) + frames * i64::from(anim.settings.substeps)
}

/// All guides in time, between two sub-steps.
#[derive(Serialize, Deserialize)]
pub struct Saved {
    /// Sub-steps taken.
    pub taken: i64,
    /// The guides.
    pub guides: <Vec<Guide> as Checkpoint>::State,
    strand_contacts: <Option<StrandContacts> as Checkpoint>::State,
    wisps: Option<super::wisps::Saved>,
    steps: Vec<SolverStep>,
}

impl Checkpoint for Simulation<'_> {
    type State = Saved;

    fn state(&self) -> Saved {
        Saved {
            taken: self.taken,
            guides: self.guides.state(),
            strand_contacts: self.strand_contacts.state(),
            wisps: self.wisps.as_ref().map(Wisps::state),
            steps: self.steps.clone(),
        }
    }

    fn restore(&mut self, state: Saved) -> Result<(), StateMismatch> {
        (self.taken, self.steps) = (state.taken, state.steps);
        self.guides.restore(state.guides)?;
        let found = state.wisps.iter().count();
        StateMismatch::unless_same("hierarchies", found, self.wisps.iter().count())?;
        if let (Some(wisps), Some(state)) = (&mut self.wisps, state.wisps) {
            wisps.restore(state, &self.guides)?;
            self.rebuild();
        }
        self.strand_contacts.restore(state.strand_contacts)
    }
}

/// What guides are to others that they touch, each with its own hairs: how many those are counts as a share of what the median guide stands for.
fn skins(rods: &[GuideRod]) -> Vec<BundleProperties> {
    let mut hairs: Vec<f64> = rods.iter().map(|r| r.hairs).collect();
    hairs.sort_by(f64::total_cmp);
    let skin = |r: &GuideRod| {
        let material = &r.material;
        let area = material.section.area();
        let radius = |area: f64| (area / std::f64::consts::PI).sqrt();
        BundleProperties {
            hair: radius(area),
            bundle: radius(area * r.hairs / PACKING),
            parallel: material.friction_parallel,
            cohesion: material.cohesion,
            hairs: r.hairs / hairs[hairs.len() / 2],
        }
    };
    rods.iter().map(skin).collect()
}

/// How guides rub within their coarse wisps, if they do.
fn wisp_friction(rods: &[GuideRod]) -> Option<WispFriction> {
    let friction_force = |r: &GuideRod| FrictionSampler::new(&r.rod, r.hairs, r.material.wisp_friction);
    let wisps: Vec<usize> = rods.iter().map(|r| r.leaf.0).collect();
    WispFriction::new(rods.iter().map(friction_force).collect(), &wisps)
}

/// One guide at rest on the head, shielded from the air.
fn start(anim: &Anim, bulk: &Bulk, r: &GuideRod, env: &Environment, t: f64, step: f64) -> Guide {
    let mut shape = RodShape::default();
    shape.update(&r.rod, &r.rod.root.r, &r.rod.initial_q);
    let place = |k: usize| shape.x(k) + r.rod.root.p;
    let drag = (0..r.rod.points()).map(|k| air_drag::drag(&r.material, bulk, &place(k))).collect();
    let thickness: Vec<f64> = anim.colliders.iter().map(|c| c.thickness).collect();
    let mut guide = Guide::new(r.rod.clone(), drag, r.material.friction, &thickness, env, t, step);
    guide.scheme = anim.settings.scheme;
    guide.sprung = anim.settings.contact == Contact::Penalty;
    guide.coupled = anim.settings.contact == Contact::Full;
    guide.friction[1] = r.material.friction.scaled(r.material.friction_at_tip);
    guide.across = r.material.friction_across;
    guide.goal = goal(&r.rod, &shape, r.material.goal);
    guide
}

/// What pulls the points of a rod that starts as `shape` to where they start, at frequencies `hz` from root to tip.
fn goal(rod: &Rod, shape: &RodShape, hz: [f64; 2]) -> Vec<(Vector3<f64>, f64)> {
    if hz == [0.0; 2] {
        return Vec::new();
    }
    let at = |(k, s): (usize, f64)| {
        let omega = std::f64::consts::TAU * (hz[0] + (hz[1] - hz[0]) * (s / rod.length()));
        (rod.root.r.transpose() * shape.x(k), rod.mass[k] * omega * omega)
    };
    rod.arc.iter().copied().enumerate().map(at).collect()
}
