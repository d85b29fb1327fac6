//! One guide in motion: its state, and one implicit step of it.

mod body_contact;
mod checkpoint;
mod follower;

use super::air_drag;
use super::body_contact::{BodyContactScratch, with_midpoints};
use super::clearance::Clearance;
use super::environment::Environment;
use super::integrator::DifferenceFormula;
use super::step_record::StepRecord;
use super::tie::Tie;
use crate::contact::BodyMotion;
use crate::geometry::Friction;
use crate::math::se3::Pose;
use crate::rod::contact_load::ContactLoad;
use crate::rod::newton::{NewtonOutcome, Solver};
use crate::rod::potential::{Load, PointLoad};
use crate::rod::{Rod, RodShape};
use crate::scene::anim::Scheme;
use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

/// How often a step is halved before a rod whose solve does not converge is carried along, or a motion that still crosses a surface is cut short, and
/// reported.
pub(super) const MAX_HALVINGS: u32 = 5;

/// Most that a strand in touch may move in a step that starts from where it is foreseen, m: what moves farther soon meets other things than
/// those that pushed it last.
const FORESEEABLE: f64 = 0.02;

/// A guide and where it is.
#[derive(Debug, Clone)]
pub struct Guide {
    /// The rod.
    pub rod: Rod,
    /// What each half of a sub-step keeps from each body.
    pub clearance: Clearance,
    /// Friction of the strand, along it, at root and tip.
    pub friction: [Friction; 2],
    /// Friction across the strand over that along it.
    pub across: f64,
    /// Places of it that bodies hold.
    pub ties: Vec<Tie>,
    /// What pulls each point to the groom's pose: where that is, in the frame of the root, m, and how stiffly, N/m; empty where nothing does.
    pub goal: Vec<(Vector3<f64>, f64)>,
    /// Force of the friction within its wisp on each point over the sub-step to come, N; empty where there is none.
    pub(super) friction_force: Vec<Vector3<f64>>,
    /// Drag per length and speed at each point, N·s/m².
    pub drag: Vec<f64>,
    /// Unknowns now, and one and two sub-steps ago, 1/m.
    pub q: [Vec<f64>; 3],
    /// Points, m, world.
    pub x: Vec<Vector3<f64>>,
    /// Velocity of each point, m/s.
    pub v: Vec<Vector3<f64>>,
    /// Tangent at each point.
    pub tangent: Vec<Vector3<f64>>,
    /// Whether it takes its sub-steps together with the guides that it touches: what needs them in parts is not its own affair then.
    pub coupled: bool,
    /// Whether bodies push it away by springs once it is in them, which is quick and guarantees nothing, in place of holding it out.
    pub sprung: bool,
    /// Time scheme; the default one for a new guide.
    pub scheme: Scheme,
    /// The state one step back.
    before: State,
    /// Length of the step that led here, s; 0 where nothing may be built on what was before it.
    last: f64,
    /// Lengths of the segments at the start, as [`Guide::segment_lengths`] measures them, m.
    lengths: Vec<f64>,
    /// The last solve and the one before: its length, s, and the rate of the unknowns over it, 1/(m·s). The next starts from them.
    past: [(f64, Vec<f64>); 2],
    /// Where the bodies were last seen.
    memory: crate::contact::ContactCache,
    /// What bodies pushed it with at the end of the last step.
    pushes: Vec<ContactLoad>,
    /// Whether no part of the last sub-step went as it should: bodies have closed on the strand, and no division helps.
    pub(super) pinched: bool,
}

/// What a time scheme remembers of a guide.
#[derive(Debug, Clone, Default, Serialize, Deserialize)]
struct State {
    q: Vec<f64>,
    x: Vec<Vector3<f64>>,
    v: Vec<Vector3<f64>>,
    tangent: Vec<Vector3<f64>>,
}

/// The solved free motion of a step.
#[derive(Debug, Clone, Copy)]
pub(super) struct Solved {
    /// Root at the end of the step, world.
    pub root: Pose,
    /// How the solve went.
    pub outcome: NewtonOutcome,
}

/// Workspace of the steps of one thread.
#[derive(Debug, Default)]
pub struct Workspace {
    pub(super) solver: Solver,
    pub(super) load: Load,
    pub(super) q: Vec<f64>,
    past: Vec<f64>,
    free: Vec<f64>,
    motions: Vec<BodyMotion>,
    clearance: Vec<[f64; 2]>,
    line: Vec<Vector3<f64>>,
    /// Speed that gravity and force fields give in the step, m/s.
    falling: f64,
    ties: Vec<(Tie, Vector3<f64>)>,
    pub(super) touch: BodyContactScratch,
}

impl Guide {
    /// The guide in the groom's pose at time `t`, s, carried rigidly by the head; `h` is the sub-step, s, and `thickness`, m,
    /// what is kept from each body.
    pub fn new(
        rod: Rod,
        drag: Vec<f64>,
        friction: impl Into<Friction>,
        thickness: &[f64],
        env: &Environment,
        t: f64,
        h: f64,
    ) -> Self {
        let q = rod.initial_q.clone();
        let mut shape = RodShape::default();
        let mut place = |t: f64| -> Vec<Pose> {
            let root = env.root(&rod.root, t);
            shape.update(&rod, &root.r, &q);
            shape.poses().map(|g| Pose { r: g.r, p: g.p + root.p }).collect()
        };
        let (now, before) = (place(t), place(t - h));
        let x: Vec<Vector3<f64>> = now.iter().map(|g| g.p).collect();
        let poses: Vec<_> = (0..env.bodies.len()).map(|b| (env.body)(b, t)).collect();
        let mut line = Vec::new();
        with_midpoints(&rod.arc, |k| x[k], |k| now[k].r.column(2).into(), &mut line);
        let clearance = Clearance::new(env.bodies, t, &poses, thickness, &line);
        let mut guide = Guide {
            lengths: Vec::new(),
            clearance,
            x,
            tangent: now.iter().map(|g| g.r.column(2).into()).collect(),
            v: now.iter().zip(&before).map(|(a, b)| (a.p - b.p) / h).collect(),
            past: [(h, vec![0.0; q.len()]), (h, vec![0.0; q.len()])],
            coupled: false,
            sprung: false,
            scheme: Scheme::default(),
            before: State::default(),
            last: 0.0,
            q: [q.clone(), q.clone(), q],
            friction: [friction.into(); 2],
            across: 1.0,
            ties: Vec::new(),
            goal: Vec::new(),
            friction_force: Vec::new(),
            drag,
            rod,
            memory: crate::contact::ContactCache::default(),
            pushes: Vec::new(),
            pinched: false,
        };
        guide.lengths = guide.segment_lengths();
        guide.before = guide.state();
        guide
    }

    /// Moves the guide from time `t0` to `t1`, s: one sub-step, halved where the solver asks for it.
    pub fn advance(&mut self, env: &Environment, t0: f64, t1: f64, work: &mut Workspace) -> StepRecord {
        self.complete(env, [t0, t1], None, work)
    }

    /// What is left of [`Guide::advance`] over `span` once the free motion of the whole step has been solved for.
    pub(super) fn complete(
        &mut self,
        env: &Environment,
        span: [f64; 2],
        solved: Option<Solved>,
        work: &mut Workspace,
    ) -> StepRecord {
        let [now, one, two] = &mut self.q;
        two.copy_from_slice(one);
        one.copy_from_slice(now);
        let mut record = StepRecord::default();
        let depth = if self.coupled { MAX_HALVINGS } else { 0 };
        self.advance_part(env, span, depth, solved, work, &mut record);
        if !self.coupled {
            self.pinched = record.shortened > record.halvings;
        }
        if self.clearance.counts().1 > 0 && (env.brought_out)(span[1]) >= 1.0 {
            // What could not be brought out by now is drawn in a knot with the body, and stays so.
            let poses: Vec<_> = (0..env.bodies.len()).map(|b| (env.body)(b, span[1])).collect();
            self.trace(&mut work.line);
            self.clearance.arrive(env.bodies, span[1], &poses, &work.line);
        }
        record
    }

    fn advance_part(
        &mut self,
        env: &Environment,
        [t0, t1]: [f64; 2],
        depth: u32,
        mut solved: Option<Solved>,
        work: &mut Workspace,
        record: &mut StepRecord,
    ) {
        let last = self.pinched || depth >= MAX_HALVINGS;
        let mut formula = self.formula(t1 - t0);
        let (mut root, mut outcome, mut clear);
        loop {
            Solved { root, outcome } = match solved.take() {
                Some(solved) => solved,
                None => {
                    let root = self.prepare(env, [t0, t1], &formula, work);
                    let Workspace { solver, load, q, .. } = work;
                    Solved { root, outcome: solver.minimise(&self.rod, &root.r, load, q, &self.q[0]) }
                }
            };
            record.iterations += outcome.iterations;
            if self.sprung {
                clear = outcome.converged;
                work.touch.clear();
                if clear && self.push_away(env, &root, [t0, t1], work) {
                    formula = DifferenceFormula::new(self.scheme, t1 - t0, 0.0);
                }
                break;
            }
            if self.stays(env, &root, [t0, t1], work) {
                (clear, outcome.converged) = (true, true);
                break;
            }
            work.touch.clear();
            clear = outcome.converged && self.touch(env, &root, [t0, t1], true, last, work);
            // A contact stops a motion within one step; a formula that looks further back would throw it back.
            if !(formula.looks_back() && work.touch.stats.touched()) {
                break;
            }
            formula = DifferenceFormula::new(self.scheme, t1 - t0, 0.0);
        }
        let whole = clear || self.coupled || depth >= MAX_HALVINGS || self.pinched && outcome.converged;
        if !whole {
            record.halvings += 1;
            let middle = 0.5 * (t0 + t1);
            self.advance_part(env, [t0, middle], depth + 1, None, work, record);
            self.advance_part(env, [middle, t1], depth + 1, None, work, record);
            return;
        }
        record.unconverged += u32::from(!outcome.converged);
        record.shortened += u32::from(outcome.converged && !clear);
        work.touch.stats.enter(record);
        if outcome.converged {
            self.commit(&root, t1 - t0, &formula, work);
            self.pushes.clear();
            if clear {
                self.pushes.extend_from_slice(&work.touch.pushes);
            }
            if work.touch.stats.touched() {
                self.last = 0.0;
            }
        } else {
            self.carry(&env.root(&self.rod.root, t0), &root);
        }
    }

    /// Solves a step of a strand that was in touch, from where it is foreseen with what pushed it; `false` where that fails. The free
    /// motion would take it through what holds it, and where it is bent hard against that, away from its shape.
    fn stays(&mut self, env: &Environment, root: &Pose, t: [f64; 2], work: &mut Workspace) -> bool {
        if self.pushes.is_empty() {
            return false;
        }
        work.free.clone_from(&work.q);
        self.foresee(t[1] - t[0], &mut work.q);
        if !work.solver.shape.update(&self.rod, &root.r, &work.q) {
            work.q.clone_from(&self.q[0]);
            work.solver.shape.update(&self.rod, &root.r, &work.q);
        }
        let far = |(k, x): (usize, &Vector3<f64>)| (work.solver.shape.x(k) + root.p - x).norm() > FORESEEABLE;
        work.touch.clear();
        work.touch.pushes.clone_from(&self.pushes);
        if !self.x.iter().enumerate().any(far) && self.touch(env, root, t, false, false, work) {
            return true;
        }
        work.q.clone_from(&work.free);
        work.solver.shape.update(&self.rod, &root.r, &work.q);
        false
    }

    /// Goes back to the start of the sub-step from `t[0]` to `t[1]`, s, that was just taken in one piece, and opens it again as one
    /// step of backward Euler; the solver then holds the end that it had. Returns the root's pose there.
    pub(super) fn reopen(&mut self, env: &Environment, t: [f64; 2], work: &mut Workspace) -> Pose {
        let before = &mut self.before;
        std::mem::swap(&mut self.q[0], &mut before.q);
        std::mem::swap(&mut self.x, &mut before.x);
        std::mem::swap(&mut self.v, &mut before.v);
        std::mem::swap(&mut self.tangent, &mut before.tangent);
        self.past.swap(0, 1);
        let root =
            self.prepare(env, t, &DifferenceFormula::new(Scheme::BackwardEuler, t[1] - t[0], 0.0), work);
        work.q.clone_from(&self.before.q);
        work.solver.shape.update(&self.rod, &root.r, &work.q);
        work.touch.clear();
        self.meet(env, t, work);
        root
    }

    /// Ends a sub-step of `h`, s, that was opened again.
    pub(super) fn close(&mut self, root: &Pose, h: f64, work: &Workspace) {
        self.commit(root, h, &DifferenceFormula::new(Scheme::BackwardEuler, h, 0.0), work);
        // What pushed it alone is not what pushes it among others.
        self.pushes.clear();
        self.last = 0.0;
    }

    /// Ends the sub-step from `t[0]` to `t[1]`, s, as it began: at rest on the head.
    pub(super) fn hold(&mut self, env: &Environment, [t0, t1]: [f64; 2]) {
        let mut shape = RodShape::default();
        self.q[0] = self.q[1].clone();
        for t in [t0, t1] {
            let root = env.root(&self.rod.root, t);
            shape.update(&self.rod, &root.r, &self.q[0]);
            for k in 0..self.x.len() {
                let x = shape.x(k) + root.p;
                self.v[k] = (x - self.x[k]) / (t1 - t0);
                self.x[k] = x;
                self.tangent[k] = shape.tangent(k);
            }
        }
        self.rest();
    }

    /// Forgets what led here.
    fn rest(&mut self) {
        for (_, rate) in &mut self.past {
            rate.fill(0.0);
        }
        self.before = self.state();
        self.pushes.clear();
        self.last = 0.0;
    }

    /// The difference formula of the next step, of `h`, s.
    pub(super) fn formula(&self, h: f64) -> DifferenceFormula {
        DifferenceFormula::new(self.scheme, h, self.last)
    }

    /// Fills the load of a step and where to start its solve from, and returns the root's pose at its end.
    pub(super) fn prepare(
        &self,
        env: &Environment,
        [t0, t1]: [f64; 2],
        formula: &DifferenceFormula,
        work: &mut Workspace,
    ) -> Pose {
        let (root, before) = (env.root(&self.rod.root, t1), &self.before);
        let points = (0..self.x.len()).map(|k| {
            let previous = formula.past(self.x[k], before.x[k]) - root.p;
            PointLoad {
                inertial: previous + formula.past(self.v[k], before.v[k]) * formula.eta,
                previous,
                air: air_drag::velocity(env.wind, &self.x[k], t1),
                tangent: (self.tangent[k] + (self.tangent[k] - before.tangent[k]) * formula.ratio)
                    .normalize(),
                drag: self.drag[k],
            }
        });
        work.past.clear();
        work.past.extend(self.q[0].iter().zip(&before.q).map(|(q, b)| formula.past(*q, *b)));
        work.load.set(&self.rod, formula.eta, &(env.gravity)(t1), &work.past, points);
        for (k, (goal, stiffness)) in self.goal.iter().enumerate() {
            work.load.add_spring(k, &(root.r * goal), *stiffness);
        }
        self.friction_force.iter().enumerate().for_each(|(k, f)| work.load.add_force(k, f));
        self.foresee(t1 - t0, &mut work.q);
        root
    }

    /// Where the unknowns will be in `h`, s, by the parabola through the last three states (Newton's divided differences).
    fn foresee(&self, h: f64, q: &mut Vec<f64>) {
        let [(h1, r1), (h2, r2)] = &self.past;
        let bend = h * (h + h1) / (h1 + h2);
        q.clear();
        let ahead = self.q[0].iter().zip(r1).zip(r2);
        q.extend(ahead.map(|((q, r1), r2)| q + r1 * h + (r1 - r2) * bend));
    }

    /// Rate of the unknowns over the last solve, 1/(m·s).
    pub(super) fn rate(&self) -> &[f64] {
        &self.past[0].1
    }

    /// The polyline in which it meets bodies, as it is now, world, m.
    pub fn trace(&self, line: &mut Vec<Vector3<f64>>) {
        with_midpoints(&self.rod.arc, |k| self.x[k], |k| self.tangent[k], line);
    }

    fn state(&self) -> State {
        State { q: self.q[0].clone(), x: self.x.clone(), v: self.v.clone(), tangent: self.tangent.clone() }
    }

    /// Carries the rod rigidly with its root from one pose to another, its motion turned along and halved: what is left where no
    /// solve converges, as when the head jumps. What no solve can follow so dies out.
    fn carry(&mut self, from: &Pose, to: &Pose) {
        let turn = to.r * from.r.transpose();
        for k in 0..self.x.len() {
            self.x[k] = to.p + turn * (self.x[k] - from.p);
            self.v[k] = turn * self.v[k] * 0.5;
            self.tangent[k] = turn * self.tangent[k];
        }
        self.rest();
    }

    fn commit(&mut self, root: &Pose, h: f64, formula: &DifferenceFormula, work: &Workspace) {
        let before = &mut self.before;
        before.q.clone_from(&self.q[0]);
        self.past.swap(0, 1);
        let (length, rate) = &mut self.past[0];
        *length = h;
        for ((rate, q), new) in rate.iter_mut().zip(&mut self.q[0]).zip(&work.q) {
            *rate = (new - *q) / h;
            *q = *new;
        }
        for k in 0..self.x.len() {
            let x = root.p + work.solver.shape.x(k);
            let v = (x - formula.past(self.x[k], before.x[k])) / formula.eta;
            before.v[k] = std::mem::replace(&mut self.v[k], v);
            before.x[k] = std::mem::replace(&mut self.x[k], x);
            before.tangent[k] = std::mem::replace(&mut self.tangent[k], work.solver.shape.tangent(k));
        }
        self.last = h;
    }

    /// Largest relative change of the length of a segment since the start.
    pub fn length_drift(&self) -> f64 {
        let now = self.segment_lengths();
        now.iter().zip(&self.lengths).map(|(a, b)| (a / b - 1.0).abs()).fold(0.0, f64::max)
    }

    /// Arc length of each segment, m: of the cubic through its ends with their tangents, by three-point Gauss quadrature.
    fn segment_lengths(&self) -> Vec<f64> {
        let s = &self.rod.arc;
        (0..s.len() - 1)
            .map(|k| {
                let (h, chord) = (s[k + 1] - s[k], self.x[k + 1] - self.x[k]);
                let (ta, tb) = (self.tangent[k] * h, self.tangent[k + 1] * h);
                let speed = |u: f64| {
                    let (d, e, f) = (6.0 * u * (1.0 - u), 1.0 - 4.0 * u + 3.0 * u * u, 3.0 * u * u - 2.0 * u);
                    (chord * d + ta * e + tb * f).norm()
                };
                let r = 0.5 * 0.6_f64.sqrt();
                (5.0 * speed(0.5 - r) + 8.0 * speed(0.5) + 5.0 * speed(0.5 + r)) / 18.0
            })
            .collect()
    }
}
