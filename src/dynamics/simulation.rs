//! All guides in time: the groom's pose settles in a pre-roll, then sub-step follows sub-step.
//!
//! [`step`] takes the model, the environment and the state, and returns a record.

use super::batch::Batches;
use super::checkpoint::{Checkpoint, StateMismatch};
use super::coupled_substep::CoupledSubstep;
use super::environment::{Environment, SkinsAtRest};
use super::guide::{ContactMode, GuideModel, GuideState};
use super::guide_frame::{GuideFrame, SolverStep};
use super::guide_rods::GuideRods;
use super::hair_volume::{HairVolume, HairVolumeState};
use super::model::Model;
use super::run_up::{RunUp, StartLine, StartedIn};
use super::step_record::{HairRecord, StepRecord};
use super::strand_contact::{BundleProperties, RECOVERY_SPEED, StrandContacts};
use super::wisp_friction::CarrierVelocity;
use super::wisps::{AdaptiveTree, WispChanges};
use crate::contact::friction::Interrupt;
use crate::contact::{Bodies, Body};
use crate::rod::Rod;
use crate::scene::anim::{ContactSetting, Resolution};
use crate::scene::{Anim, Collider, Groom};
use crate::wisp::{Hierarchy, NeighbourDrag};
use nalgebra::Vector3;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::ops::Range;
use std::sync::Arc;

pub use super::coupled_substep::Interrupted;

/// The guides of a groom in motion.
pub struct Simulation<'a> {
    /// What does not change.
    pub model: Model<'a>,
    /// What acts on the guides.
    pub env: Environment<'a>,
    /// Where the guides are.
    pub state: State,
    /// The colliders in which guides start that are not in them as they are drawn.
    pub started_in: Vec<StartedIn>,
}

/// The state of all guides between two sub-steps.
pub struct State {
    /// The guides, in the groom's order; followers are where they were at the end of the last frame.
    pub guides: Vec<GuideState>,
    /// Contact between guides, with `--contact full`.
    strand_contacts: Option<StrandContacts>,
    /// The hair as a fibre assembly, with `--contact volume`.
    hair_volume: Option<HairVolume>,
    /// The guides as wisps, unless the resolution is full.
    wisps: Option<AdaptiveTree>,
    /// The active guides in batches; follows from `wisps`.
    batches: Batches,
    /// Configurations that the solver reached since the last frame, if they are written.
    path: Vec<SolverStep>,
    /// Sub-steps taken since the start of the pre-roll.
    taken: i64,
    /// What the last sub-step did.
    record: SubstepRecord,
}

/// What one sub-step did.
#[derive(Debug, Clone, Default)]
pub struct SubstepRecord {
    /// Records of the guides; default for followers.
    pub guides: Vec<StepRecord>,
    /// The hair as a volume.
    pub hair: HairRecord,
    /// Whether each guide was active.
    pub active: Vec<bool>,
    /// True if the guides took the sub-step coupled: no guide halved it without those that it touches.
    pub coupled: bool,
    /// Strain nodes with unknowns of the guides that are active from now on.
    pub active_nodes: u32,
    /// Splits and merges.
    pub changes: WispChanges,
    /// Sub-steps of the current frame taken by guides that split at its start.
    pub catch_up: Vec<(usize, StepRecord)>,
}

impl State {
    /// Whether guide `i` is active: simulated, and not a follower.
    pub fn is_active(&self, model: &Model, i: usize) -> bool {
        model.simulated[i] && self.wisps.as_ref().is_none_or(|wisps| wisps.is_active(i))
    }

    /// Rebuilds what depends on which guides are active.
    fn rebuild(&mut self, model: &Model, env: &Environment) {
        self.batches = Batches::new(&model.guides, |i| self.is_active(model, i));
        let State { guides, strand_contacts, wisps, taken, .. } = self;
        if let Some(contacts) = strand_contacts {
            contacts.rebuild(&model.guides, guides, |i| leader(wisps, i), env, model.time_after(*taken));
        }
    }
}

/// The active guide that guide `i` moves with: itself, or the guide that it follows.
fn leader(wisps: &Option<AdaptiveTree>, i: usize) -> usize {
    wisps.as_ref().map_or(i, |wisps| wisps.leader(i))
}

/// Takes one sub-step of all guides; returns what it did.
///
/// # Errors
/// [`Interrupted`] if the environment asks to abandon it, which only a coupled sub-step does; all that a checkpoint
/// holds is then as it was.
pub fn step<'s>(
    model: &Model,
    env: &mut Environment,
    state: &'s mut State,
) -> Result<&'s SubstepRecord, Interrupted> {
    for i in 0..state.guides.len() {
        state.record.active[i] = state.is_active(model, i);
    }
    let span = [state.taken, state.taken + 1].map(|taken| model.time_after(taken));
    env.prepare_bodies(span);
    state.guides.iter_mut().for_each(GuideState::clear_hair_force);
    // What is not stepped has none.
    state.guides.iter_mut().for_each(GuideState::clear_reaction);
    if let Some(friction) = &model.wisp_friction {
        let (head, wisps) = (CarrierVelocity::of_head(env, span[0]), &state.wisps);
        let carrier = |i: usize| match &model.guides[i].skin {
            None => head,
            Some(root) => CarrierVelocity::new(|t| (env.skin)(root, t), span[0]),
        };
        friction.apply(&mut state.guides, |i| leader(wisps, i), carrier, span[1] - span[0]);
    }
    if let Some(volume) = &mut state.hair_volume {
        let step = [span[0], span[1] - span[0]];
        let active = |i: usize| state.record.active[i];
        state.record.hair = volume.apply(&model.guides, &mut state.guides, active, env, step);
    }
    advance(model, env, state, span)?;
    if let Some(volume) = &mut state.hair_volume {
        state.record.hair.work = volume.add_work(&state.guides, env, span[1]);
    }
    state.taken += 1;
    let rods = model.guides.iter().map(|guide| &guide.rod);
    for ((guide, rod), active) in state.guides.iter_mut().zip(rods).zip(&state.record.active) {
        if *active {
            record_midway(model, rod, guide, state.taken);
        }
    }
    if model.is_at_frame(state.taken) {
        // The last configuration is the frame's own.
        state.path.pop();
    }
    adapt(model, env, state);
    let active = (0..state.guides.len()).filter(|&i| state.is_active(model, i));
    state.record.active_nodes = active.map(|i| model.guides[i].rod.unknowns() as u32 / 3).sum();
    Ok(&state.record)
}

/// Adds the end of a sub-step, after `taken` of them, to the unknowns of a guide half-way through its frame.
fn record_midway(model: &Model, rod: &Rod, guide: &mut GuideState, taken: i64) {
    if let Some(k) = model.substep_of_frame(taken) {
        guide.record_midway(rod, k, i64::from(model.anim.settings.substeps));
    }
}

/// Advances the active guides over `span`, s.
fn advance(model: &Model, env: &Environment, state: &mut State, span: [f64; 2]) -> Result<(), Interrupted> {
    let writes = model.writes_steps(state.taken);
    let State { guides, strand_contacts, batches, path, record, .. } = state;
    let records = &mut record.guides[..];
    records.fill(StepRecord::default());
    let path = writes.then_some(path);
    match strand_contacts {
        None => {
            batches.step(&model.guides, env, guides, span, model.contact_mode(), records);
            if let Some(path) = path {
                path.push(SolverStep::new(span[1], &model.guides, guides));
            }
            Ok(())
        }
        Some(strand_contacts) => {
            let (models, states) = (&model.guides[..], &mut guides[..]);
            CoupledSubstep { models, states, strand_contacts, batches, env, path }.step(span, records)
        }
    }
}

/// Makes the followers at the end of the pre-roll; from then on, at the end of every frame, places them, and
/// splits and merges guides.
fn adapt(model: &Model, env: &mut Environment, state: &mut State) {
    let State { guides, hair_volume, wisps, taken, record, .. } = state;
    let SubstepRecord { changes, catch_up, .. } = record;
    *changes = WispChanges::default();
    catch_up.clear();
    let Some(wisps) = wisps.as_mut().filter(|_| model.is_at_frame(*taken)) else { return };
    let starts = model.is_preroll_end(*taken);
    if starts {
        wisps.make_followers(&model.guides, guides, env, model.time_after(*taken));
    } else {
        let first = *taken - i64::from(model.anim.settings.substeps);
        let frame = [first, *taken].map(|taken| model.time_after(taken));
        let hair_volume = hair_volume.as_ref();
        let hair = |i: usize| hair_volume.map_or_else(NeighbourDrag::default, |volume| volume.opposition(i));
        let none = || vec![Vec::new(); guides.len()];
        let apart = hair_volume.map_or_else(none, |volume| volume.forces_apart(&model.guides, env, frame[1]));
        wisps.advance_modes(&model.guides, hair, &apart, env, frame);
        for level in 0..wisps.levels() {
            let split = wisps.place_and_split(level, &model.guides, guides, env, frame);
            catch_up_split(model, env, guides, hair_volume, &split, first..*taken, catch_up);
            wisps.record_level(level, &model.guides, guides);
            changes.splits += split.len() as u32;
        }
        changes.merges = wisps.merge(&model.guides, guides, frame[1]);
    }
    if starts || *changes != WispChanges::default() {
        state.rebuild(model, env);
    }
    let State { guides, hair_volume, wisps, taken, .. } = state;
    if let Some(volume) = hair_volume {
        let t = model.time_after(*taken);
        let following = guides
            .par_iter_mut()
            .zip(&model.guides)
            .enumerate()
            .filter(|(i, _)| !wisps.as_ref().is_none_or(|wisps| wisps.is_active(*i)));
        following.for_each(|(_, (guide, of_model))| guide.place(of_model, env, t, model.substep()));
        volume.end_frame(&model.guides, guides, |i| leader(wisps, i), env, t);
    }
}

/// Steps the guides `split` through the sub-steps of a frame that the active guides have already taken.
/// Each is stepped alone: it meets other guides, and the hair around it, from the next frame on; until then `hair`
/// acts on it as on its leader in the last sub-step. Adds to `records` what each sub-step did.
fn catch_up_split(
    model: &Model,
    env: &mut Environment,
    guides: &mut [GuideState],
    hair: Option<&HairVolume>,
    split: &[usize],
    substeps: Range<i64>,
    records: &mut Vec<(usize, StepRecord)>,
) {
    let split: Vec<usize> = split.iter().copied().filter(|i| model.simulated[*i]).collect();
    if split.is_empty() {
        return;
    }
    let mode = match model.contact_mode() {
        ContactMode::Coupled => ContactMode::Bodies,
        mode => mode,
    };
    let batches = Batches::new(&model.guides, |i| split.binary_search(&i).is_ok());
    let mut of_all = vec![StepRecord::default(); guides.len()];
    for substep in substeps {
        let span = [substep, substep + 1].map(|taken| model.time_after(taken));
        env.prepare_bodies(span);
        if let Some(hair) = hair {
            for &i in &split {
                guides[i].clear_hair_force();
                hair.add_force_of_leader(i, &model.guides[i], &mut guides[i], env, span[0]);
            }
        }
        batches.step(&model.guides, env, guides, span, mode, &mut of_all);
        for &i in &split {
            record_midway(model, &model.guides[i].rod, &mut guides[i], substep + 1);
            records.push((i, of_all[i]));
        }
    }
}

impl<'a> Simulation<'a> {
    /// The groom at the start of its pre-roll. `groom` must have its trees, `rods` are its own.
    pub fn new(groom: &Groom, anim: &'a Anim, rods: &GuideRods) -> Self {
        let mut model = Model::new(groom, anim, rods);
        let (t, h) = (model.time_after(0), model.substep());
        let mut env = environment(&model, RunUp::none(anim));
        env.prepare_bodies([t, t]);
        let thickness: Vec<f64> = anim.colliders.iter().map(|c| c.thickness).collect();
        let skins = skins_at_rest(anim, t);
        // The axis of a hair is never nearer than its surface allows.
        let kept = |bundle: &BundleProperties| {
            thickness.iter().map(|d| d.max(bundle.hair_radius)).collect::<Vec<f64>>()
        };
        let start = |env: &Environment| {
            let guides = model.guides.par_iter().zip(&model.bundles);
            let start = |(guide, bundle): (&GuideModel, &BundleProperties)| {
                GuideState::on_skins(guide, &kept(bundle), env, skins.as_ref(), [t, h])
            };
            guides.map(start).collect::<Vec<GuideState>>()
        };
        let mut guides = start(&env);
        let all = guides.par_iter().zip(model.guides.par_iter().zip(&model.bundles));
        let troubled = all.filter_map(|(state, (guide, bundle))| {
            let colliders: Vec<usize> =
                (0..thickness.len()).filter(|c| state.clearance.starts_in(*c)).collect();
            if colliders.is_empty() {
                return None;
            }
            let (x, skin) = (GuideState::start_polyline(guide, &env, t), guide.skin.as_ref());
            let rooted = !guide.rod.is_free();
            Some((StartLine { x, skin, thickness: kept(bundle), rooted }, colliders))
        });
        let troubled: Vec<_> = troubled.collect();
        let (run_up, started_in) = RunUp::new(anim, (&model.guides, &guides), &env.bodies, t, &troubled);
        if !run_up.is_none() {
            env = environment(&model, run_up);
            env.prepare_bodies([t, t]);
            guides = start(&env);
        }
        let wisps = match anim.resolution() {
            Resolution::Full => None,
            _ => {
                let pull = (env.head)(t).rotation.inverse() * (env.gravity)(t);
                let mut hierarchy = Hierarchy::new(groom, &rods.simulated, &pull, |i| &model.guides[i].drag);
                hierarchy.restrict_to(&mut model.simulated);
                Some(AdaptiveTree::new(hierarchy, model.split_tolerance, h, 1.0 / anim.fps))
            }
        };
        let full = anim.settings.contact == ContactSetting::Full;
        let record = SubstepRecord {
            guides: vec![StepRecord::default(); guides.len()],
            active: vec![false; guides.len()],
            coupled: full,
            ..SubstepRecord::default()
        };
        let hair_volume = rods.sampling.as_ref().map(|sampling| {
            // Hair is at rest at the groom's own density, wherever a goal first holds it.
            let drawn = |guide| GuideState::drawn(guide, &env, t, h);
            let drawn: Vec<GuideState> = model.guides.par_iter().map(drawn).collect();
            HairVolume::new(
                &rods.simulated,
                sampling,
                &model.guides,
                &drawn,
                &env,
                ([t, h], &model.frame_times()),
            )
        });
        let mut state = State {
            guides,
            hair_volume,
            strand_contacts: full.then(|| StrandContacts::new(model.bundles.clone())),
            wisps,
            batches: Batches::default(),
            path: Vec::new(),
            taken: 0,
            record,
        };
        state.rebuild(&model, &env);
        // Without a pre-roll it has ended already.
        adapt(&model, &mut env, &mut state);
        Simulation { model, env, state, started_in }
    }

    /// Takes one sub-step, which nothing interrupts; returns what it did.
    pub fn step(&mut self) -> &SubstepRecord {
        // Without an interrupt there is no error.
        let _ = self.step_unless(&Interrupt::default());
        &self.state.record
    }

    /// Takes one sub-step, unless `interrupt` is asked for; returns what it did.
    ///
    /// # Errors
    /// Those of [`step`].
    pub fn step_unless(&mut self, interrupt: &Interrupt) -> Result<&SubstepRecord, Interrupted> {
        self.env.interrupt = interrupt.clone();
        step(&self.model, &mut self.env, &mut self.state)
    }

    /// Time now, s.
    pub fn time(&self) -> f64 {
        self.model.time_after(self.state.taken)
    }

    /// Sub-steps taken since the start of the pre-roll.
    pub fn taken(&self) -> i64 {
        self.state.taken
    }

    /// Indices of the active guides.
    pub fn active(&self) -> impl Iterator<Item = usize> {
        (0..self.state.guides.len()).filter(|&i| self.state.is_active(&self.model, i))
    }

    /// What the `work`, J, of contact between guides over a frame adds to their energy at its end: a share of
    /// their kinetic energy and what they would have at the speed at which contact may push them apart.
    pub fn strand_gain(&self, work: f64) -> f64 {
        let Some(contacts) = &self.state.strand_contacts else { return 0.0 };
        let energy = contacts.kinetic_energy(&self.model.guides, &self.state.guides, RECOVERY_SPEED);
        (work / energy.iter().sum::<f64>().max(f64::MIN_POSITIVE)).max(0.0)
    }

    /// What the work of hair on hair, as a volume, has added to its energy since the start: a share of its kinetic
    /// energy and of what it would have at 5 cm/s.
    pub fn hair_gain(&self) -> f64 {
        self.state.hair_volume.as_ref().map_or(0.0, HairVolume::gain)
    }

    /// The guides now, in the groom's order; followers are where they were at the end of the last frame.
    pub fn frame(&self) -> Vec<GuideFrame> {
        let level = |i: usize| self.state.wisps.as_ref().map_or(0, |wisps| wisps.level(i));
        let frame = |(i, state): (usize, &GuideState)| GuideFrame {
            q: state.q[0].clone(),
            midway: state.midway.clone(),
            level: level(i),
            reaction: self.model.guides[i].reaction(state),
        };
        self.state.guides.iter().enumerate().map(frame).collect()
    }

    /// Takes the configurations that the solver reached since the last frame, if they are written.
    pub fn take_path(&mut self) -> Vec<SolverStep> {
        std::mem::take(&mut self.state.path)
    }
}

/// The bodies at time `t`, s, with the skins that deform at rest; `None` if there are no such skins.
fn skins_at_rest(anim: &Anim, t: f64) -> Option<SkinsAtRest> {
    let deforms = |(i, c): (usize, &Collider)| anim.skins.contains(&i) && c.deformation.is_some();
    let at_rest: Vec<bool> = anim.colliders.iter().enumerate().map(deforms).collect();
    let body = |(c, at_rest): (&Collider, &bool)| match at_rest {
        true => Body::new(&c.shape, None, c.friction),
        false => Body::from(c),
    };
    at_rest.contains(&true).then(|| {
        let mut bodies = Bodies::new(anim.colliders.iter().zip(&at_rest).map(body));
        bodies.prepare([t, t]);
        SkinsAtRest { bodies, at_rest }
    })
}

/// The environment of an animation whose bodies come from rest as in `run_up`, while guides are pushed out of bodies.
fn environment<'a>(model: &Model<'a>, run_up: RunUp) -> Environment<'a> {
    let anim = model.anim;
    let progress = || model.push_out();
    let (of_poses, of_meshes, of_skins) = (progress(), progress(), progress());
    let run_up = Arc::new(run_up);
    let (of_deforming, of_rooted) = (run_up.clone(), run_up.clone());
    Environment {
        bodies: Bodies::new(anim.colliders.iter().map(Body::from)),
        body: Box::new(move |c, t| run_up.pose(anim, c, t, of_poses(t))),
        from_rest: Box::new(move |c, t| of_deforming.mesh_from_rest(anim, c, t, of_meshes(t))),
        push_out: Box::new(progress()),
        carrier: Box::new(|b, t| anim.bodies[b].track.pose(t)),
        head: Box::new(|t| anim.head_pose(t)),
        skin: Box::new(move |root, t| of_rooted.carried(anim, root, t, of_skins(t))),
        gravity: Box::new(|t| anim.gravity + anim.forces.iter().map(|k| k.at(t)).sum::<Vector3<f64>>()),
        wind: &anim.wind,
        interrupt: Interrupt::default(),
    }
}

/// What a checkpoint holds of a simulation.
#[derive(Serialize, Deserialize)]
pub struct SimulationState {
    /// Sub-steps taken.
    pub taken: i64,
    /// The guides.
    pub guides: Vec<GuideState>,
    strand_contacts: <Option<StrandContacts> as Checkpoint>::State,
    wisps: Option<super::wisps::WispsState>,
    hair_volume: Option<HairVolumeState>,
    path: Vec<SolverStep>,
}

impl Checkpoint for Simulation<'_> {
    type State = SimulationState;

    fn state(&self) -> SimulationState {
        let State { guides, strand_contacts, hair_volume, wisps, batches: _, path, taken, record: _ } =
            &self.state;
        SimulationState {
            taken: *taken,
            guides: guides.state(),
            strand_contacts: strand_contacts.state(),
            wisps: wisps.as_ref().map(AdaptiveTree::state),
            hair_volume: hair_volume.as_ref().map(HairVolume::state),
            path: path.clone(),
        }
    }

    fn restore(&mut self, saved: SimulationState) -> Result<(), StateMismatch> {
        let Simulation { model, env, state, started_in: _ } = self;
        (state.taken, state.path) = (saved.taken, saved.path);
        state.guides.restore(saved.guides)?;
        let found = saved.wisps.iter().count();
        StateMismatch::unless_same("hierarchies", found, state.wisps.iter().count())?;
        if let (Some(wisps), Some(saved)) = (&mut state.wisps, saved.wisps) {
            wisps.restore(saved, &model.guides, &state.guides)?;
            state.rebuild(model, env);
        }
        let found = saved.hair_volume.iter().count();
        StateMismatch::unless_same("volumes of hair", found, state.hair_volume.iter().count())?;
        if let (Some(volume), Some(saved)) = (&mut state.hair_volume, saved.hair_volume) {
            volume.restore(saved, &model.guides, |i| leader(&state.wisps, i))?;
        }
        state.strand_contacts.restore(saved.strand_contacts)
    }
}
