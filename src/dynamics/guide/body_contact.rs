//! A guide and the bodies within one step.

use super::{Environment, Guide, Workspace};
use crate::contact::{Bodies, BodyMotion};
use crate::dynamics::body_contact::{BodyContact, BodyContactScratch, with_midpoints};
use crate::math::se3::Pose;
use crate::rod::newton::Solver;

/// What changes while a guide's contacts are resolved.
pub(in crate::dynamics) struct Moving<'a> {
    pub q: &'a mut Vec<f64>,
    pub solver: &'a mut Solver,
    pub memory: &'a mut crate::contact::ContactCache,
    pub touching: &'a mut BodyContactScratch,
}

impl Guide {
    /// Resolves contact from time `t[0]` to `t[1]`; `false` where it cannot be taken as it is ([`BodyContact::resolve`]), in which case it has been cut
    /// short if this is the `last` resort.
    pub(super) fn touch(
        &mut self,
        env: &Environment,
        root: &Pose,
        t: [f64; 2],
        free: bool,
        last: bool,
        work: &mut Workspace,
    ) -> bool {
        self.meet(env, t, work);
        if env.bodies.is_empty() && work.ties.is_empty() {
            return true;
        }
        let start = std::mem::take(&mut self.q[0]);
        let clear = self.with_touch(env.bodies, root, work, |touch, moving| {
            let Moving { q, solver, memory, touching } = moving;
            let clear = touch.resolve(free, last, q, solver, memory, touching);
            if !clear && last {
                let stopped = touch.truncate(&start, q, solver, memory, touching);
                touching.stats.crossed = !stopped;
            }
            clear
        });
        self.q[0] = start;
        clear
    }

    /// Lets springs of bodies push it away that it is in at the end of the step from time `t[0]` to `t[1]`; whether any did.
    pub(super) fn push_away(
        &mut self,
        env: &Environment,
        root: &Pose,
        t: [f64; 2],
        work: &mut Workspace,
    ) -> bool {
        self.meet(env, t, work);
        if env.bodies.is_empty() && work.ties.is_empty() {
            return false;
        }
        self.with_touch(env.bodies, root, work, |touch, moving| {
            let Moving { q, solver, memory, touching } = moving;
            touch.push_away(q, solver, memory, touching)
        })
    }

    /// Notes how the bodies move from time `t[0]` to `t[1]`, s, what the guide keeps from them, and where its ties have to be.
    pub(super) fn meet(&self, env: &Environment, [t0, t1]: [f64; 2], work: &mut Workspace) {
        self.trace(&mut work.line);
        work.falling = (env.gravity)(t1).norm() * (t1 - t0);
        work.ties.clear();
        work.ties.extend(self.ties.iter().filter_map(|tie| {
            let poses = [(env.carrier)(tie.body, t0), (env.carrier)(tie.body, t1)];
            Some((tie.clone(), tie.target(t1, t1 - t0, &tie.place(&work.line), poses)?))
        }));
        work.motions.clear();
        work.motions.extend((0..env.bodies.len()).map(|b| BodyMotion {
            times: [t0, t1],
            start: (env.body)(b, t0),
            end: (env.body)(b, t1),
        }));
        self.clearance.at((env.brought_out)(t1), &mut work.clearance);
    }

    /// Passes the contact problem with the bodies to `f`.
    pub(in crate::dynamics) fn with_touch<T>(
        &mut self,
        bodies: &Bodies,
        root: &Pose,
        work: &mut Workspace,
        f: impl FnOnce(&BodyContact, Moving) -> T,
    ) -> T {
        let touch = BodyContact {
            rod: &self.rod,
            bodies,
            motions: &work.motions,
            clearance: &work.clearance,
            x0: &work.line,
            fastest: self.v.iter().map(|v| v.norm()).fold(0.0, f64::max) + work.falling,
            ties: &work.ties,
            friction: self.friction,
            across: self.across,
            root,
            load: &work.load,
        };
        let moving = Moving {
            q: &mut work.q,
            solver: &mut work.solver,
            memory: &mut self.memory,
            touching: &mut work.touch,
        };
        f(&touch, moving)
    }

    /// Whether nothing crosses a body if the sub-step from `t[0]` to `t[1]`, s, that was taken or opened again, ends as [`Guide::hold`] ends it.
    pub(in crate::dynamics) fn may_hold(
        &mut self,
        env: &Environment,
        t: [f64; 2],
        work: &mut Workspace,
    ) -> bool {
        work.q.clone_from(&self.q[1]);
        work.touch.clear();
        self.meet(env, t, work);
        let [from, root] = t.map(|t| env.root(&self.rod.root, t));
        let Workspace { solver, q, line, .. } = &mut *work;
        solver.shape.update(&self.rod, &from.r, q);
        with_midpoints(&self.rod.arc, |k| solver.shape.x(k) + from.p, |k| solver.shape.tangent(k), line);
        solver.shape.update(&self.rod, &root.r, q);
        self.with_touch(env.bodies, &root, work, |touch, moving| {
            touch.find(moving.solver, moving.memory, moving.touching)
        })
    }
}
