//! How bodies come to where the shot finds them (`docs/theory.md` §5.1, run-up). A groom is drawn with all bodies at rest;
//! where a shot starts with a turned head, long hair that is carried there lies in the shoulders.

use super::clearance::GroomPose;
use super::guide::GuideModel;
use crate::contact::Bodies;
use crate::geometry::{FromRest, Shape, TriMesh};
use crate::math::lanes;
use crate::math::se3::{self, Coefficients, Pose};
use crate::scene::{Anim, Collider};
use nalgebra::{Isometry3, Matrix3, UnitQuaternion, Vector3};
use rayon::prelude::*;

/// Places on the way of a body from rest to the start of the shot at which it is looked for in the hair. More find
/// thinner bodies that sweep through it, and take longer.
const LOOKS: u32 = 24;

/// Motion relative to the head, m and rad, that counts as none.
const STILL: f64 = 1e-6;

/// Motion of a root relative to the head, m, up to which its skin may run up: fur on an arm has its root there.
const ROOTED: f64 = 2e-3;

/// Where on its way from rest to the start of the shot each body is when the pre-roll starts, as a share: 1 for those
/// that are where the shot has them.
#[derive(Debug, Clone)]
pub(super) struct RunUp(Vec<f64>);

/// A guide as it starts.
pub(super) struct StartLine {
    /// Its polyline, m, world.
    pub x: Vec<Vector3<f64>>,
    /// Distance to keep from each collider, m.
    pub thickness: Vec<f64>,
    /// True if its root is held.
    pub rooted: bool,
}

impl RunUp {
    /// All bodies are where the shot has them.
    pub fn none(anim: &Anim) -> Self {
        RunUp(vec![1.0; anim.bodies.len()])
    }

    /// The run-up of `guides` whose pre-roll starts at time `t`, s, among the colliders `bodies` of the animation.
    /// `troubled` are those that start in a collider, or through it, which they do not grow out of, each with the
    /// indices of these.
    pub fn new(
        anim: &Anim,
        guides: &[GuideModel],
        bodies: &Bodies,
        t: f64,
        troubled: &[(StartLine, Vec<usize>)],
    ) -> Self {
        let starts = (0..anim.bodies.len()).into_par_iter().map(|body| {
            let colliders: Vec<usize> =
                (0..anim.colliders.len()).filter(|c| anim.colliders[*c].body == body).collect();
            if !colliders.iter().all(|c| keeps_its_roots(anim, guides, *c, t)) {
                return 1.0;
            }
            let of = |c: usize| Way { anim, bodies, c, t };
            colliders.into_iter().map(|c| of(c).start(troubled)).fold(1.0, f64::min)
        });
        RunUp(starts.collect())
    }

    /// True if no body runs up.
    pub fn is_none(&self) -> bool {
        self.0.iter().all(|share| *share == 1.0)
    }

    /// World pose of collider `c` at time `t`, s, where the run-up has come by the share `progress`.
    pub fn pose(&self, anim: &Anim, c: usize, t: f64, progress: f64) -> Isometry3<f64> {
        let Collider { body, ref deformation, .. } = anim.colliders[c];
        match self.share(body, progress) {
            Some(share) if deformation.is_none() => between_rest_and(anim, body, t, share),
            _ => anim.bodies[body].track.pose(t),
        }
    }

    /// Where collider `c`, if it deforms, is on its way from rest at time `t`, s, where the run-up has come by the share
    /// `progress`.
    pub fn mesh_from_rest(&self, anim: &Anim, c: usize, t: f64, progress: f64) -> Option<FromRest> {
        let body = anim.colliders[c].body;
        let share = self.share(body, progress)?;
        Some(FromRest { rest: anim.bodies[body].track.pose(t).inverse() * anim.head_pose(t), share })
    }

    /// The share of its way that a body has come; `None` if it is where the animation has it.
    fn share(&self, body: usize, progress: f64) -> Option<f64> {
        let start = self.0[body];
        // Starts and ends at rest.
        let eased = progress * progress * progress * (10.0 - progress * (15.0 - 6.0 * progress));
        (start < 1.0 && progress < 1.0).then_some(start + (1.0 - start) * eased)
    }
}

/// The way of collider `c` from rest to where it is at time `t`, s.
struct Way<'a> {
    anim: &'a Anim,
    /// The colliders at that time.
    bodies: &'a Bodies,
    c: usize,
    t: f64,
}

impl Way<'_> {
    /// The share of the way up to which guides are free that are `troubled` at its end and free at rest; 1 if there are
    /// none. What is drawn in a body, or through it, stays there wherever the body comes from.
    fn start(&self, troubled: &[(StartLine, Vec<usize>)]) -> f64 {
        let of_collider = troubled.iter().filter(|(_, colliders)| colliders.contains(&self.c));
        let mut lines: Vec<&StartLine> = of_collider.map(|(line, _)| line).collect();
        if lines.is_empty() || self.is_still() {
            return 1.0;
        }
        self.at(0.0, |lies_in| lines.retain(|line| !lies_in(line)));
        if lines.is_empty() {
            return 1.0;
        }
        let share = |look: u32| f64::from(look) / f64::from(LOOKS);
        let meets = |look: &u32| self.at(share(*look), |lies_in| lines.iter().any(|line| lies_in(line)));
        share((1..LOOKS).find(meets).unwrap_or(LOOKS) - 1)
    }

    /// True if it is at rest, and does not deform.
    fn is_still(&self) -> bool {
        let Collider { body, ref deformation, .. } = self.anim.colliders[self.c];
        let way = self.anim.head_pose(self.t).inverse() * self.anim.bodies[body].track.pose(self.t);
        deformation.is_none() && way.translation.vector.norm() < STILL && way.rotation.angle() < STILL
    }

    /// What `then` makes of a test whether a guide lies in the collider where it has come by a `share` of its way.
    fn at<T>(&self, share: f64, then: impl FnOnce(&dyn Fn(&StartLine) -> bool) -> T) -> T {
        let Way { anim, bodies, c, t } = *self;
        let Collider { body, ref shape, ref deformation, .. } = anim.colliders[c];
        let lies_in = |bodies: &Bodies, b: usize, pose: Isometry3<f64>, line: &StartLine| {
            let StartLine { x, thickness, rooted } = line;
            GroomPose { bodies, t, poses: &[], thickness: &thickness[c - b..], x, rooted: *rooted }
                .lies_in(b, &pose)
        };
        let (Some(deformation), Shape::Mesh(mesh)) = (deformation, shape) else {
            let pose = between_rest_and(anim, body, t, share);
            return then(&|line| lies_in(bodies, c, pose, line));
        };
        let pose = anim.bodies[body].track.pose(t);
        let from_rest = FromRest { rest: pose.inverse() * anim.head_pose(t), share };
        let vertices = from_rest.between(&mesh.vertices, &deformation.vertices(t));
        let shape = Shape::Mesh(TriMesh { vertices, triangles: mesh.triangles.clone() });
        let alone = Bodies::from_shapes(&[shape]);
        then(&|line| lies_in(&alone, 0, pose, line))
    }
}

/// True if the roots on collider `c`, if any, are carried as by the head at time `t`, s: on its way from rest the
/// collider stays where they are.
fn keeps_its_roots(anim: &Anim, guides: &[GuideModel], c: usize, t: f64) -> bool {
    let to_rest = anim.head_pose(t).inverse();
    guides.par_iter().filter_map(|guide| Some((guide.skin.as_ref()?, &guide.rod.root.p))).all(
        |(skin, root)| {
            let moved = to_rest * anim.carried(skin, t) * nalgebra::Point3::from(*root);
            skin.collider != c || (moved.coords - root).norm() < ROOTED
        },
    )
}

/// World pose of a `body` that has come by a `share` of its way from rest, where it is carried by the head, to where the
/// animation has it at time `t`, s: on a screw in the space of the head.
fn between_rest_and(anim: &Anim, body: usize, t: f64, share: f64) -> Isometry3<f64> {
    let (head, pose) = (anim.head_pose(t), anim.bodies[body].track.pose(t));
    let way = head.inverse() * pose;
    let turn = way.rotation.to_rotation_matrix();
    let whole = se3::log(&Pose { r: *turn.matrix(), p: way.translation.vector });
    let part = lanes::Twist { w: (whole.w * share).into(), v: (whole.v * share).into() };
    let lanes::Pose { r, p } = se3::exp(&part, &Coefficients::of(&part));
    let (r, p): (Matrix3<f64>, Vector3<f64>) = (r.into(), p.into());
    head * Isometry3::from_parts(p.into(), UnitQuaternion::from_matrix(&r))
}
