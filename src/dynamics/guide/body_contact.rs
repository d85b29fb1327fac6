//! Contact of a guide with bodies within one step.

use super::model::GuideModel;
use super::scratch::{ContactInputs, GuideScratch};
use super::state::GuideState;
use crate::contact::BodyMotion;
use crate::dynamics::body_contact::{BodyContact, BodyContactScratch};
use crate::dynamics::contact_polyline::with_midpoints;
use crate::dynamics::environment::Environment;
use crate::dynamics::pinch::{Pinch, SEARCH_RADIUS, approaches};
use crate::dynamics::reaction::TieReaction;
use crate::dynamics::tie::Anchor;
use crate::math::se3::Pose;
use crate::rod::newton::Solver;
use nalgebra::Vector3;

/// What changes while contacts are resolved.
pub(in crate::dynamics) struct ContactSolve<'a> {
    /// Unknowns, 1/m.
    pub q: &'a mut Vec<f64>,
    /// Solver with the shape at `q`.
    pub solver: &'a mut Solver,
    /// Where bodies were last found.
    pub contact_cache: &'a mut crate::contact::ContactCache,
    /// Buffers.
    pub scratch: &'a mut BodyContactScratch,
}

/// Distance from a skin up to which a root is on it, m.
const ROOTED: f64 = 2e-3;

impl GuideModel {
    /// Resolves contact from time `t[0]` to `t[1]`, s. `free` says that `scratch` holds the solution without
    /// contact; `last` that the step can no longer be halved. Returns `false` if the result is not admissible
    /// ([`BodyContact::resolve`]); with `last` it is truncated then.
    pub(super) fn resolve_contact(
        &self,
        env: &Environment,
        state: &mut GuideState,
        root: &Pose,
        t: [f64; 2],
        (free, last): (bool, bool),
        scratch: &mut GuideScratch,
    ) -> bool {
        self.prepare_contact(env, state, t, &mut scratch.inputs);
        if env.bodies.is_empty() && scratch.inputs.ties.is_empty() {
            // Loads of ties that held in the last step hold no more.
            scratch.contact.clear();
            return free;
        }
        let GuideState { q: start, v, transient, .. } = state;
        let (contact, solve) = self.body_contact_with(env, v, &mut transient.contact_cache, root, scratch);
        let ContactSolve { q, solver, contact_cache, scratch } = solve;
        let clear = contact.resolve(free, last, q, solver, contact_cache, scratch);
        if !clear && last {
            let stopped = contact.truncate(&start[0], q, solver, contact_cache, scratch);
            scratch.stats.crossed = !stopped;
        }
        clear
    }

    /// Pushes the guide out of bodies by springs at the end of the step from time `t[0]` to `t[1]`, s;
    /// returns whether any spring acts.
    pub(super) fn push_out_by_springs(
        &self,
        env: &Environment,
        state: &mut GuideState,
        root: &Pose,
        t: [f64; 2],
        scratch: &mut GuideScratch,
    ) -> bool {
        self.prepare_contact(env, state, t, &mut scratch.inputs);
        if env.bodies.is_empty() && scratch.inputs.ties.is_empty() {
            return false;
        }
        let (contact, ContactSolve { q, solver, contact_cache, scratch }) =
            self.body_contact(env, state, root, scratch);
        contact.push_away(q, solver, contact_cache, scratch)
    }

    /// Sets the motion of the bodies from time `t0` to `t1`, s, the distances to keep from them, and the
    /// targets of the ties.
    pub(super) fn prepare_contact(
        &self,
        env: &Environment,
        state: &GuideState,
        [t0, t1]: [f64; 2],
        inputs: &mut ContactInputs,
    ) {
        state.contact_polyline(self, &mut inputs.polyline);
        inputs.falling_speed = (env.gravity)(t1).norm() * (t1 - t0);
        inputs.ties.clear();
        if self.ties.iter().any(|tie| tie.frame.is_some()) {
            inputs.shape.update(&self.rod, &self.root(env, t0).r, &state.q[0]);
        }
        let root = (!self.rod.is_free()).then(|| self.root(env, t1));
        let mut anchor = root.map(|root| Anchor { arc: 0.0, drawn: self.rod.root.p, x: root.p });
        inputs.ties.extend(self.holding_ties(state, t1).map(|(_, tie)| {
            let poses = [(env.carrier)(tie.body, t0), (env.carrier)(tie.body, t1)];
            let active = tie.active(t1 - t0, &inputs.polyline, &inputs.shape, anchor.as_ref(), poses);
            if !tie.slides {
                anchor = Some(tie.anchor(active.target));
            }
            active
        }));
        let last = state.contact_loads.iter().filter(|load| load.is_of_tie());
        if last.clone().count() == inputs.ties.len() {
            inputs.ties.iter_mut().zip(last).for_each(|(tie, load)| tie.last = TieReaction::of(load));
        } else {
            inputs.ties.iter_mut().for_each(|tie| tie.steady = false);
        }
        inputs.motions.clear();
        inputs.motions.extend((0..env.bodies.len()).map(|b| BodyMotion {
            times: [t0, t1],
            start: (env.body)(b, t0),
            end: (env.body)(b, t1),
        }));
        let push_out = (env.push_out)(t1);
        inputs.pushed_out = push_out < 1.0;
        state.clearance.at(push_out, &mut inputs.clearance);
        let pinch = Pinch {
            bodies: &env.bodies,
            motions: &inputs.motions,
            x0: &inputs.polyline,
            root: root.as_ref(),
            at_rest: &state.clearance,
        };
        (inputs.pinched, inputs.by_part) = (false, false);
        inputs.slides.clear();
        inputs.slides.resize(env.bodies.len(), false);
        if state.pinched {
            inputs.asked.clone_from(&inputs.clearance);
            let room = pinch.lower(&inputs.asked, &mut inputs.clearance);
            let pinched = room.lacks || state.transient.was_pinched;
            // The push-out raises the distances at its own pace.
            let inside =
                !inputs.pushed_out && pinch.lower_where_inside(pinched, room.by_part, &mut inputs.clearance);
            (inputs.pinched, inputs.by_part) = (room.lacks || room.by_part || inside, room.by_part);
            let segments = inputs.polyline.len() - 1;
            let of_bodies = inputs.asked.chunks_exact(segments).zip(inputs.clearance.chunks_exact(segments));
            for (slides, (asked, left)) in inputs.slides.iter_mut().zip(of_bodies) {
                *slides = state.slides && asked != left;
            }
        }
    }

    /// Whether a body has come so near to the root at time `t`, s, that the hair cannot keep its distance from it
    /// but by a kink, which throws the tip; or whether the skin has closed over the root.
    pub(super) fn is_swallowed(&self, env: &Environment, state: &GuideState, t: f64) -> bool {
        if self.rod.is_free() {
            return false;
        }
        let root = self.root(env, t).p;
        let swallows = |(b, drawn): (usize, &f64)| {
            let local = (env.body)(b, t).inverse_transform_point(&root.into()).coords;
            let solid = &env.bodies.bodies[b].solid;
            if !(solid.deforms() || approaches(solid.distance_lower_bound(&local), *drawn)) {
                return false;
            }
            let Some(on) = solid.closest(t, &local, SEARCH_RADIUS) else { return false };
            let part = || solid.mesh(t).is_some_and(|mesh| mesh.in_other_part(&local, &on));
            approaches(on.distance, *drawn) && on.distance < state.clearance.greatest(b)
                || solid.deforms() && on.distance.abs() < ROOTED && part()
        };
        state.clearance.root_distance().iter().enumerate().any(swallows)
    }

    /// The contact problem of the prepared step, and what its solution changes.
    pub(in crate::dynamics) fn body_contact<'a>(
        &'a self,
        env: &'a Environment,
        state: &'a mut GuideState,
        root: &'a Pose,
        scratch: &'a mut GuideScratch,
    ) -> (BodyContact<'a>, ContactSolve<'a>) {
        self.body_contact_with(env, &state.v, &mut state.transient.contact_cache, root, scratch)
    }

    fn body_contact_with<'a>(
        &'a self,
        env: &'a Environment,
        v: &[Vector3<f64>],
        contact_cache: &'a mut crate::contact::ContactCache,
        root: &'a Pose,
        scratch: &'a mut GuideScratch,
    ) -> (BodyContact<'a>, ContactSolve<'a>) {
        let GuideScratch { solver, load, q, inputs, contact, .. } = scratch;
        let fastest = v.iter().map(|v| v.norm()).fold(0.0, f64::max) + inputs.falling_speed;
        let problem = BodyContact {
            rod: &self.rod,
            bodies: &env.bodies,
            motions: &inputs.motions,
            clearance: &inputs.clearance,
            slides: &inputs.slides,
            by_part: inputs.by_part,
            pushed_out: inputs.pushed_out,
            x0: &inputs.polyline,
            fastest,
            ties: &inputs.ties,
            friction: self.friction,
            across: self.friction_across,
            root,
            load,
        };
        (problem, ContactSolve { q, solver, contact_cache, scratch: contact })
    }

    /// True if no body is crossed when the sub-step from `t[0]` to `t[1]`, s, taken or reopened, ends at rest
    /// on the head ([`GuideState::rest_on_head`]).
    pub(in crate::dynamics) fn may_rest_on_head(
        &self,
        env: &Environment,
        state: &mut GuideState,
        t: [f64; 2],
        scratch: &mut GuideScratch,
    ) -> bool {
        scratch.q.clone_from(&state.q[1]);
        scratch.contact.clear();
        self.prepare_contact(env, state, t, &mut scratch.inputs);
        let [from, root] = t.map(|t| self.root(env, t));
        let GuideScratch { solver, q, inputs, .. } = &mut *scratch;
        let polyline = &mut inputs.polyline;
        solver.shape.update(&self.rod, &from.r, q);
        with_midpoints(&self.rod.arc, |k| solver.shape.x(k) + from.p, |k| solver.shape.tangent(k), polyline);
        solver.shape.update(&self.rod, &root.r, q);
        let (contact, ContactSolve { solver, contact_cache, scratch, .. }) =
            self.body_contact(env, state, &root, scratch);
        contact.find(solver, contact_cache, scratch)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::contact::Bodies;
    use crate::dynamics::guide::ContactMode;
    use crate::dynamics::step_record::StepRecord;
    use crate::geometry::Shape;
    use crate::rod::{Rod, RodSource};
    use crate::scene::Tree;
    use nalgebra::{Isometry3, UnitQuaternion};

    /// What the steps do in which a hair of `length`, m, turns with its root from the middle of a crease between
    /// two planes into one of them.
    fn turned_into_a_crease(length: f64) -> Vec<StepRecord> {
        let planes = [Vector3::x(), Vector3::y()];
        let bodies =
            Bodies::from_shapes(&planes.map(|normal| Shape::Plane { point: Vector3::zeros(), normal }));
        let turn = |t: f64| 0.7 * (10.0 * t).min(1.0);
        let head = move |t| {
            Isometry3::from_parts(
                Vector3::zeros().into(),
                UnitQuaternion::from_axis_angle(&Vector3::z_axis(), turn(t)),
            )
        };
        let env = Environment { head: Box::new(head), ..Environment::at_rest(bodies) };
        let root = Vector3::new(1e-4, 1e-4, 0.0);
        let points = [root, root + Vector3::new(1.0, 1.0, 1.0).normalize() * length];
        let rod = Rod::new(&RodSource { damping: 0.005, ..RodSource::hair(&points, &Tree::default_arc(8)) });
        let rod = rod.unwrap();
        let model = GuideModel::new(rod.clone(), vec![2e-5; rod.points()], 0.3);
        let h = 1.0 / 192.0;
        let mut state = GuideState::new(&model, &[5e-4; 2], &env, 0.0, h);
        let mut scratch = GuideScratch::default();
        let step = |k: u32| {
            let span = [f64::from(k) * h, f64::from(k + 1) * h];
            model.step(&env, &mut state, span, ContactMode::Bodies, &mut scratch)
        };
        (0..30).map(step).collect()
    }

    #[test]
    fn a_hair_is_not_bent_where_it_is_stiffer_than_skin() {
        for length in [5e-4, 1.2e-3, 4e-3, 0.02] {
            let records = turned_into_a_crease(length);
            let sum = |of: fn(&StepRecord) -> u32| records.iter().map(of).sum::<u32>();
            let failed = sum(|r| r.truncated + r.unconverged + r.unsettled);
            assert_eq!((failed, sum(|r| r.halvings)), (0, 0), "{length} m");
            assert_eq!(sum(|r| r.active) > 0, length > 1e-3, "{length} m");
        }
    }

    #[test]
    fn a_pinched_guide_inside_a_body_keeps_its_depth_and_comes_out() {
        let plane = Shape::Plane { point: Vector3::zeros(), normal: Vector3::y() };
        let rod = Rod::new(&RodSource::hair(&[Vector3::zeros(), Vector3::x() * 0.1], &Tree::default_arc(8)));
        let rod = rod.unwrap();
        let model = GuideModel::new(rod.clone(), vec![2e-5; rod.points()], 0.3);
        let (keep, depth, h) = (5e-4, 2e-3, 1e-3);
        let inputs = |pinched: bool, slides: bool, push_out: f64| {
            let env = Environment {
                // Rises through the guide after the groom's pose.
                body: Box::new(move |_, t| {
                    Isometry3::translation(0.0, if t > 0.5 { depth } else { -depth }, 0.0)
                }),
                push_out: Box::new(move |_| push_out),
                ..Environment::at_rest(Bodies::from_shapes(std::slice::from_ref(&plane)))
            };
            let mut state = GuideState::new(&model, &[keep], &env, 0.0, h);
            (state.pinched, state.slides) = (pinched, slides);
            state.begin_substep();
            let mut inputs = ContactInputs::default();
            model.prepare_contact(&env, &state, [1.0, 1.0 + h], &mut inputs);
            inputs
        };
        let tip = |inputs: &ContactInputs| inputs.clearance[inputs.clearance.len() - 1][1];
        assert_eq!((tip(&inputs(false, true, 1.0)), inputs(false, true, 1.0).slides[0]), (keep, false));
        let pinched = inputs(true, false, 1.0);
        assert!(tip(&pinched) > -depth && tip(&pinched) < 0.0 && pinched.pinched && !pinched.slides[0]);
        assert!(inputs(true, true, 1.0).slides[0]);
        // The push-out raises the distances at its own pace.
        assert_eq!(tip(&inputs(true, false, 0.5)), keep);
    }
}
