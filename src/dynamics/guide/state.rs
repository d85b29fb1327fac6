//! The state of a guide.

use super::midway;
use super::model::GuideModel;
use crate::dynamics::checkpoint::{Checkpoint, StateMismatch};
use crate::dynamics::clearance::{Clearance, GroomPose};
use crate::dynamics::contact_polyline::with_midpoints;
use crate::dynamics::environment::{Environment, SkinsAtRest};
use crate::dynamics::integrator::{DifferenceFormula, Past};
use crate::dynamics::reaction::GuideReaction;
use crate::math::se3::Pose;
use crate::rod::contact_load::ContactLoad;
use crate::rod::{Rod, RodShape};
use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

/// The state of a guide between two sub-steps.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct GuideState {
    /// Unknowns now, one and two sub-steps ago, 1/m.
    pub q: [Vec<f64>; 3],
    /// Unknowns half-way through the frame that ends now, or the part of them that is known so far, 1/m.
    pub midway: Vec<f64>,
    /// Points, m, world.
    pub x: Vec<Vector3<f64>>,
    /// Velocities of the points, m/s.
    pub v: Vec<Vector3<f64>>,
    /// Unit tangents at the points.
    pub tangent: Vec<Vector3<f64>>,
    /// Distances to keep from each body.
    pub clearance: Clearance,
    /// What the next solve is extrapolated from.
    history: History,
    /// Reactions of bodies at the end of the last step: the next step starts from them.
    pub(super) contact_loads: Vec<ContactLoad>,
    /// True if no part of the last sub-step was admissible: halving does not help.
    pub(in crate::dynamics) stuck: bool,
    /// True while bodies leave no room for the distances that the guide keeps from them ([`Pinch`]).
    ///
    /// [`Pinch`]: crate::dynamics::pinch::Pinch
    pub(in crate::dynamics) pinched: bool,
    /// True while it slides on these bodies without friction: with friction a step has had no solution.
    pub(super) slides: bool,
    /// Indices of the ties that have let the strand go for good.
    pub(super) released: Vec<usize>,
    /// Values that speed up or feed one sub-step; no later sub-step depends on them.
    #[serde(skip)]
    pub(super) transient: Transient,
}

/// The solves that led to a state.
#[derive(Debug, Clone, Serialize, Deserialize)]
struct History {
    /// The configurations at the starts of the last solves, newest first.
    previous: Past<Configuration>,
    /// Unit tangents at the start of the last solve.
    tangent: Vec<Vector3<f64>>,
    /// Lengths of the steps that led here from `previous`, s, newest first; 0 from the first that the next
    /// step must not look back over. All are 0 where the scheme starts anew, with backward Euler.
    steps: Past<f64>,
    /// The last solve and the one before it.
    rates: [SolveRate; 2],
}

/// What a time scheme remembers of a configuration.
#[derive(Debug, Clone, Serialize, Deserialize)]
struct Configuration {
    q: Vec<f64>,
    x: Vec<Vector3<f64>>,
    v: Vec<Vector3<f64>>,
}

/// Mean rate of the unknowns over one solve.
#[derive(Debug, Clone, Serialize, Deserialize)]
struct SolveRate {
    /// Duration of the solve's step, s.
    step: f64,
    /// Rate of the unknowns, 1/(m·s).
    rate: Vec<f64>,
}

/// Values that no later sub-step depends on.
#[derive(Debug, Clone, Default)]
pub(super) struct Transient {
    /// Force of other hair on each point over the coming sub-step, N, world; empty if there is none.
    pub hair_force: Vec<Vector3<f64>>,
    /// What holds the guide at the end of the last step, if that is recorded and known.
    pub reaction: Option<GuideReaction>,
    /// Where bodies were last found: shortens searches and changes no result.
    pub contact_cache: crate::contact::ContactCache,
    /// [`GuideState::is_pinched`] at the start of the sub-step.
    pub was_pinched: bool,
}

/// A pose in which a guide may start.
struct StartPose {
    /// The rod's unknowns, 1/m.
    q: Vec<f64>,
    /// Pose of each point, world.
    poses: Vec<Pose>,
}

impl StartPose {
    /// The pose with the unknowns `q`, carried by what carries the guide, at time `t`, s.
    fn new(model: &GuideModel, env: &Environment, t: f64, q: Vec<f64>) -> Self {
        let (root, mut shape) = (model.root(env, t), RodShape::default());
        shape.update(&model.rod, &root.r, &q);
        let poses = shape.poses().map(|g| Pose { r: g.r, p: g.p + root.p }).collect();
        StartPose { q, poses }
    }

    /// The contact polyline, m, world.
    fn polyline(&self, model: &GuideModel) -> Vec<Vector3<f64>> {
        let (poses, mut polyline) = (&self.poses, Vec::new());
        with_midpoints(&model.rod.arc, |k| poses[k].p, |k| poses[k].r.column(2).into(), &mut polyline);
        polyline
    }
}

impl GuideState {
    /// The groom's pose, carried rigidly by the head, or that of an animated goal, at time `t`, s. `h` is the
    /// sub-step, s, and `thickness` the distance to keep from each body, m.
    pub fn new(model: &GuideModel, thickness: &[f64], env: &Environment, t: f64, h: f64) -> Self {
        Self::on_skins(model, thickness, env, None, [t, h])
    }

    /// The same, carried by the head or a skin. Distances from `skins` are those for which the groom was
    /// drawn.
    pub fn on_skins(
        model: &GuideModel,
        thickness: &[f64],
        env: &Environment,
        skins: Option<&SkinsAtRest>,
        [t, h]: [f64; 2],
    ) -> Self {
        let start = StartPose::new(model, env, t, model.start_unknowns(t));
        let x = start.polyline(model);
        let poses = env.body_poses(t);
        let rooted = !model.rod.is_free();
        let in_bodies = GroomPose { bodies: &env.bodies, t, poses: &poses, thickness, x: &x, rooted };
        // What is inside a body as it is drawn is not told by where a goal first holds it.
        let drawn = (start.q != model.rod.initial_q)
            .then(|| StartPose::new(model, env, t, model.rod.initial_q.clone()).polyline(model));
        let (led, drawn_x) = (drawn.is_some(), drawn.as_ref().unwrap_or(&x));
        let mut clearance = match (skins, &model.skin) {
            (Some(skins), Some(_)) => {
                let poses = skins.poses_around(&model.carrier(env, t), &poses);
                let as_drawn = GroomPose { bodies: &skins.bodies, poses: &poses, x: drawn_x, ..in_bodies };
                let mut clearance = Clearance::carried(&in_bodies, &as_drawn, led);
                clearance.measure_folds(&as_drawn);
                clearance
            }
            _ if led => Clearance::carried(&in_bodies, &GroomPose { x: drawn_x, ..in_bodies }, led),
            _ => Clearance::new(&in_bodies),
        };
        clearance.hold(segments_within(model.rod.held_length(), &x));
        let before = StartPose::new(model, env, t - h, model.start_unknowns(t - h));
        Self::between(before, start, clearance, h)
    }

    /// The contact polyline in which the guide starts at time `t`, s; m, world.
    pub fn start_polyline(model: &GuideModel, env: &Environment, t: f64) -> Vec<Vector3<f64>> {
        StartPose::new(model, env, t, model.start_unknowns(t)).polyline(model)
    }

    /// The groom's pose, carried rigidly, at time `t`, s, without distances from bodies.
    pub fn drawn(model: &GuideModel, env: &Environment, t: f64, h: f64) -> Self {
        let [before, now] = [t - h, t].map(|t| StartPose::new(model, env, t, model.rod.initial_q.clone()));
        Self::between(before, now, Clearance::default(), h)
    }

    /// The state in the pose `now`, with the velocity from the pose `before` it by `h`, s.
    fn between(before: StartPose, now: StartPose, clearance: Clearance, h: f64) -> Self {
        let StartPose { q, poses } = now;
        let x: Vec<Vector3<f64>> = poses.iter().map(|g| g.p).collect();
        let v: Vec<Vector3<f64>> = poses.iter().zip(&before.poses).map(|(a, b)| (a.p - b.p) / h).collect();
        let tangent: Vec<Vector3<f64>> = poses.iter().map(|g| g.r.column(2).into()).collect();
        let rate: Vec<f64> = q.iter().zip(&before.q).map(|(q, before)| (q - before) / h).collect();
        let rates = std::array::from_fn(|_| SolveRate { step: h, rate: rate.clone() });
        let previous = std::array::from_fn(|_| Configuration { q: q.clone(), x: x.clone(), v: v.clone() });
        GuideState {
            clearance,
            x,
            v,
            history: History { previous, tangent: tangent.clone(), steps: Default::default(), rates },
            tangent,
            q: [q.clone(), q.clone(), q.clone()],
            midway: q,
            contact_loads: Vec::new(),
            stuck: false,
            pinched: false,
            slides: false,
            released: Vec::new(),
            transient: Transient::default(),
        }
    }

    /// Mean rate of the unknowns over the last solve, 1/(m·s).
    pub(in crate::dynamics) fn rate(&self) -> &[f64] {
        &self.history.rates[0].rate
    }

    /// Duration of the last solve's step, s.
    pub(super) fn solve_step(&self) -> f64 {
        self.history.rates[0].step
    }

    /// Lengths of the steps that the next one may look back over, s, newest first; 0 from the first that it
    /// must not.
    pub(super) fn last_steps(&self) -> &Past<f64> {
        &self.history.steps
    }

    /// Makes the next step start anew with backward Euler.
    pub(super) fn restart_scheme(&mut self) {
        self.history.steps.fill(0.0);
    }

    /// Largest second difference of the positions of a point, m, over a step to `shape` on the root's pose `root`
    /// and the step before.
    pub(super) fn second_difference(&self, root: &Pose, shape: &RodShape) -> f64 {
        let before = self.history.previous[0].x.iter().zip(&self.x);
        let bends =
            before.enumerate().map(|(k, (one, x))| (root.p + shape.x(k) - x * 2.0 + one).norm_squared());
        bends.fold(0.0, f64::max).sqrt()
    }

    /// Makes the next step look back over the last step alone.
    pub(super) fn shorten_history(&mut self) {
        self.history.steps[1..].fill(0.0);
    }

    /// True if bodies have closed on the strand and leave it less room than it is to keep.
    pub fn is_pinched(&self) -> bool {
        self.pinched
    }

    /// Forgets what holds the guide.
    pub(in crate::dynamics) fn clear_reaction(&mut self) {
        self.transient.reaction = None;
    }

    /// Forgets the forces of other hair.
    pub(in crate::dynamics) fn clear_hair_force(&mut self) {
        self.transient.hair_force.clear();
    }

    /// Adds forces of other hair over the coming sub-step, N, world, one per point.
    pub(in crate::dynamics) fn add_hair_force(&mut self, force: impl Iterator<Item = Vector3<f64>>) {
        self.hair_force_mut().iter_mut().zip(force).for_each(|(sum, f)| *sum += f);
    }

    /// Forces of other hair over the coming sub-step, N, world, one per point.
    pub(in crate::dynamics) fn hair_force_mut(&mut self) -> &mut [Vector3<f64>] {
        self.transient.hair_force.resize(self.x.len(), Vector3::zeros());
        &mut self.transient.hair_force
    }

    /// Forces of other hair over the coming sub-step, N, world, per point; empty if there are none.
    #[cfg(test)]
    pub(in crate::dynamics) fn hair_force(&self) -> &[Vector3<f64>] {
        &self.transient.hair_force
    }

    /// The polyline that meets bodies, m, world: the points, with the midpoints of the curve between them.
    pub fn contact_polyline(&self, model: &GuideModel, polyline: &mut Vec<Vector3<f64>>) {
        with_midpoints(&model.rod.arc, |k| self.x[k], |k| self.tangent[k], polyline);
    }

    /// Shifts the sub-step history of the unknowns.
    pub(super) fn begin_substep(&mut self) {
        let [now, one, two] = &mut self.q;
        two.copy_from_slice(one);
        one.copy_from_slice(now);
        self.transient.was_pinched = self.pinched;
    }

    /// Adds the end of sub-step `k` of the `n` of a frame, from 1, to the unknowns half-way through it. At the end of
    /// the frame a root of `rod` that has turned far is unwound.
    pub(in crate::dynamics) fn record_midway(&mut self, rod: &Rod, k: i64, n: i64) {
        let GuideState { q: [now, before, _], midway, .. } = self;
        let (start, end) = (midway::weight(0, n), midway::weight(k, n));
        for ((midway, now), before) in midway.iter_mut().zip(now).zip(before) {
            let so_far = if k == 1 { start * *before } else { *midway };
            *midway = so_far + end * *now;
        }
        if k == n {
            self.unwind(rod);
        }
    }

    /// Describes the turn of a free root the other way round, in the past as well, once it is more than half a turn.
    fn unwind(&mut self, rod: &Rod) {
        let GuideState { q: [now, one, two], midway, history: History { previous, rates, .. }, .. } = self;
        if !rod.unwind(now) {
            return;
        }
        for q in [one, two, midway].into_iter().chain(previous.iter_mut().map(|before| &mut before.q)) {
            rod.unwind_towards(now, q, &mut []);
        }
        let [first, second, _] = &*previous;
        for (SolveRate { step, rate }, [from, to]) in
            rates.iter_mut().zip([[&first.q, &*now], [&second.q, &first.q]])
        {
            (0..3).for_each(|i| rate[i] = (to[i] - from[i]) / *step);
        }
    }

    /// Values of point `k` that enter a step with a difference formula (docs/theory.md §4.6): x* + η v*, x*,
    /// both relative to `root`, m, and the extrapolated unit tangent.
    pub(super) fn formula_values(
        &self,
        k: usize,
        formula: &DifferenceFormula,
        root: &Vector3<f64>,
    ) -> (Vector3<f64>, Vector3<f64>, Vector3<f64>) {
        let History { previous: [one, two, three], tangent: before, .. } = &self.history;
        let x_star = formula.y_star([self.x[k], one.x[k], two.x[k], three.x[k]]) - root;
        let v_star = formula.y_star([self.v[k], one.v[k], two.v[k], three.v[k]]);
        let inertial = x_star + v_star * formula.eta;
        let tangent = (self.tangent[k] + (self.tangent[k] - before[k]) * formula.ratio).normalize();
        (inertial, x_star, tangent)
    }

    /// q* of a difference formula, 1/m.
    pub(super) fn q_star(&self, formula: &DifferenceFormula) -> impl Iterator<Item = f64> {
        let [one, two, three] = &self.history.previous;
        let past = self.q[0].iter().zip(&one.q).zip(&two.q).zip(&three.q);
        past.map(|(((now, one), two), three)| formula.y_star([*now, *one, *two, *three]))
    }

    /// Extrapolates the unknowns by `h`, s, with the parabola through the last three states (Newton's divided
    /// differences).
    pub(super) fn extrapolate(&self, h: f64, q: &mut Vec<f64>) {
        let [SolveRate { step: h1, rate: r1 }, SolveRate { step: h2, rate: r2 }] = &self.history.rates;
        let bend = h * (h + h1) / (h1 + h2);
        q.clear();
        let ahead = self.q[0].iter().zip(r1).zip(r2);
        q.extend(ahead.map(|((q, r1), r2)| q + r1 * h + (r1 - r2) * bend));
    }

    /// Ends a step of `h`, s: takes over the solved unknowns `q` and their `shape` on the root's pose `root`.
    pub(super) fn commit(
        &mut self,
        root: &Pose,
        h: f64,
        formula: &DifferenceFormula,
        (q, shape): (&[f64], &RodShape),
    ) {
        let History { previous, tangent, rates, steps } = &mut self.history;
        rates.swap(0, 1);
        let SolveRate { step, rate } = &mut rates[0];
        *step = h;
        for ((rate, before), new) in rate.iter_mut().zip(&self.q[0]).zip(q) {
            *rate = (new - before) / h;
        }
        // The new configuration takes the place of the oldest, then that of the current one.
        let [one, two, oldest] = previous;
        oldest.q.copy_from_slice(q);
        for (k, tangent) in tangent.iter_mut().enumerate() {
            let x = root.p + shape.x(k);
            let x_star = formula.y_star([self.x[k], one.x[k], two.x[k], oldest.x[k]]);
            (oldest.x[k], oldest.v[k]) = (x, (x - x_star) / formula.eta);
            *tangent = std::mem::replace(&mut self.tangent[k], shape.tangent(k));
        }
        previous.rotate_right(1);
        std::mem::swap(&mut self.q[0], &mut previous[0].q);
        std::mem::swap(&mut self.x, &mut previous[0].x);
        std::mem::swap(&mut self.v, &mut previous[0].v);
        steps.rotate_right(1);
        steps[0] = h;
    }

    /// Returns to the start of the last step; `history.previous[0]` then holds its end. Only valid directly
    /// after a step that was taken whole.
    pub(super) fn swap_with_previous(&mut self) {
        let History { previous, tangent, rates, .. } = &mut self.history;
        std::mem::swap(&mut self.q[0], &mut previous[0].q);
        std::mem::swap(&mut self.x, &mut previous[0].x);
        std::mem::swap(&mut self.v, &mut previous[0].v);
        std::mem::swap(&mut self.tangent, tangent);
        rates.swap(0, 1);
    }

    /// Unknowns of the previous configuration, 1/m.
    pub(super) fn previous_q(&self) -> &Vec<f64> {
        &self.history.previous[0].q
    }

    /// Carries the rod rigidly with its root from one pose to another, with its velocity rotated and halved:
    /// the fallback where no solve converges, as when the head jumps. Unsolvable motion dies out.
    pub(super) fn carry_rigidly(&mut self, from: &Pose, to: &Pose) {
        let turn = to.r * from.r.transpose();
        for k in 0..self.x.len() {
            self.x[k] = to.p + turn * (self.x[k] - from.p);
            self.v[k] = turn * self.v[k] * 0.5;
            self.tangent[k] = turn * self.tangent[k];
        }
        self.forget_history();
    }

    /// Ends the sub-step from `t[0]` to `t[1]`, s, as it began, at rest relative to the head.
    pub(in crate::dynamics) fn rest_on_head(
        &mut self,
        model: &GuideModel,
        env: &Environment,
        [t0, t1]: [f64; 2],
    ) {
        let mut shape = RodShape::default();
        self.q[0] = self.q[1].clone();
        for t in [t0, t1] {
            let root = model.root(env, t);
            shape.update(&model.rod, &root.r, &self.q[0]);
            for k in 0..self.x.len() {
                let x = shape.x(k) + root.p;
                self.v[k] = (x - self.x[k]) / (t1 - t0);
                self.x[k] = x;
                self.tangent[k] = shape.tangent(k);
            }
        }
        self.forget_history();
    }

    fn forget_history(&mut self) {
        self.clear_reaction();
        for SolveRate { rate, .. } in &mut self.history.rates {
            rate.fill(0.0);
        }
        for Configuration { q, x, v } in &mut self.history.previous {
            q.clone_from(&self.q[0]);
            x.clone_from(&self.x);
            v.clone_from(&self.v);
        }
        self.history.tangent.clone_from(&self.tangent);
        self.contact_loads.clear();
        self.restart_scheme();
    }

    /// Places the points, with their velocities, at time `t`, s, by the unknowns `q` for now and for one and
    /// two sub-steps of `h`, s, ago.
    pub(in crate::dynamics) fn place(&mut self, model: &GuideModel, env: &Environment, t: f64, h: f64) {
        let mut shape = RodShape::default();
        let mut poses = |back: usize| -> Vec<Pose> {
            let root = model.root(env, t - back as f64 * h);
            shape.update(&model.rod, &root.r, &self.q[back]);
            shape.poses().map(|g| Pose { r: g.r, p: g.p + root.p }).collect()
        };
        let [now, one, two] = [0, 1, 2].map(&mut poses);
        let History { previous: [previous, ..], tangent, .. } = &mut self.history;
        for k in 0..self.x.len() {
            let [x, x1, x2] = [now[k].p, one[k].p, two[k].p];
            (self.x[k], self.v[k]) = (x, (x * 3.0 - x1 * 4.0 + x2) / (2.0 * h));
            self.tangent[k] = now[k].r.column(2).into();
            (previous.x[k], previous.v[k]) = (x1, (x - x2) / (2.0 * h));
            tangent[k] = one[k].r.column(2).into();
        }
    }

    /// Starts to move actively at time `t`, s, from the unknowns `q` set for now and for one and two
    /// sub-steps of `h`, s, ago.
    pub(in crate::dynamics) fn resume(&mut self, model: &GuideModel, env: &Environment, t: f64, h: f64) {
        self.place(model, env, t, h);
        let rate = |a: &[f64], b: &[f64]| {
            let rate = a.iter().zip(b).map(|(a, b)| (a - b) / h).collect();
            SolveRate { step: h, rate }
        };
        self.history.rates = [rate(&self.q[0], &self.q[1]), rate(&self.q[1], &self.q[2])];
        self.history.previous[0].q.clone_from(&self.q[1]);
        self.history.steps = [h, 0.0, 0.0];
        self.contact_loads.clear();
        self.transient.hair_force.clear();
        (self.stuck, self.pinched, self.slides) = (false, false, false);
    }

    /// Distance that each place must keep from each body, m, −∞ if exempt; at body b and place k at `b *
    /// places + k`, the points first, then the midpoints.
    pub(in crate::dynamics) fn required_distances(&self) -> Vec<f64> {
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

impl Checkpoint for GuideState {
    type State = GuideState;

    fn state(&self) -> GuideState {
        // All fields by name: whoever adds one decides here whether a later sub-step depends on it.
        let GuideState {
            q,
            midway,
            x,
            v,
            tangent,
            clearance,
            history,
            contact_loads,
            stuck,
            pinched,
            slides,
            released,
            transient: _,
        } = self;
        GuideState {
            q: q.clone(),
            midway: midway.clone(),
            x: x.clone(),
            v: v.clone(),
            tangent: tangent.clone(),
            clearance: clearance.clone(),
            history: history.clone(),
            contact_loads: contact_loads.clone(),
            stuck: *stuck,
            pinched: *pinched,
            slides: *slides,
            released: released.clone(),
            transient: Transient::default(),
        }
    }

    fn restore(&mut self, state: GuideState) -> Result<(), StateMismatch> {
        let (points, unknowns) = (self.x.len(), self.q[0].len());
        let History { previous: [one, two, three], tangent, rates, .. } = &state.history;
        for (what, found, expected) in [
            ("clearances", state.clearance.len(), self.clearance.len()),
            ("unknowns", state.q[0].len(), unknowns),
            ("unknowns one step back", state.q[1].len(), unknowns),
            ("unknowns two steps back", state.q[2].len(), unknowns),
            ("unknowns half-way through the frame", state.midway.len(), unknowns),
            ("points", state.x.len(), points),
            ("velocities", state.v.len(), points),
            ("tangents", state.tangent.len(), points),
            ("unknowns one solve back", one.q.len(), unknowns),
            ("unknowns two solves back", two.q.len(), unknowns),
            ("unknowns three solves back", three.q.len(), unknowns),
            ("points one solve back", one.x.len(), points),
            ("points two solves back", two.x.len(), points),
            ("points three solves back", three.x.len(), points),
            ("velocities one solve back", one.v.len(), points),
            ("velocities two solves back", two.v.len(), points),
            ("velocities three solves back", three.v.len(), points),
            ("previous tangents", tangent.len(), points),
            ("rates", rates[0].rate.len(), unknowns),
            ("previous rates", rates[1].rate.len(), unknowns),
        ] {
            StateMismatch::unless_same(what, found, expected)?;
        }
        let transient = std::mem::take(&mut self.transient);
        *self = GuideState { transient, ..state };
        Ok(())
    }
}

/// Number of the segments of the polyline `x` that end within the arc length `s` of its start, m.
fn segments_within(s: f64, x: &[Vector3<f64>]) -> usize {
    let lengths = x.windows(2).map(|ends| (ends[1] - ends[0]).norm());
    let ends = lengths.scan(0.0, |arc, length| {
        *arc += length;
        Some(*arc)
    });
    ends.take_while(|end| *end <= s).count()
}
