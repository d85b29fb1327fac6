//! How bodies come to where the shot finds them (`docs/theory.md` §5.1, run-up). A groom is drawn with all bodies at
//! rest; where a shot starts with a turned head, long hair that is carried there lies in the shoulders.

use super::clearance::GroomPose;
use super::guide::{GuideModel, GuideState};
use crate::contact::Bodies;
use crate::geometry::{FromRest, Shape, TriMesh};
use crate::math::lanes;
use crate::math::se3::{self, Coefficients, Pose};
use crate::scene::{Anim, Collider, RootBinding};
use nalgebra::{Isometry3, Matrix3, Translation3, UnitQuaternion, Vector3};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::borrow::Cow;
use std::f64::consts::PI;

/// Places on the way of a body from rest to the start of the shot at which it is looked for in the hair. More find
/// thinner bodies that sweep through it, and take longer.
const LOOKS: u32 = 24;

/// Turn of a root relative to the head, rad, up to which its skin may run up. Vertices come straight, which shrinks a
/// limb on its way by 1 − cos of half its turn.
const MOST_TURNED: f64 = PI / 3.0;

/// Depth of a point of a guide in its skin beyond that in which it is drawn, m, from which the skin runs up. What is less
/// deep, as fur in a crease, the skin brings out from where the shot has it.
const DEEP: f64 = 5e-3;

/// How many times as many guides as lie in a body at the start of the shot it may meet on its way there: what sweeps
/// through the head meets far more.
const MOST_MET: f64 = 2.0;

/// Points of a guide at which it is looked for in a body on its way.
const SAMPLES: usize = 4;

/// How each collider comes to where the shot finds it; `None` for those that are there all the time.
#[derive(Debug, Clone)]
pub(super) struct RunUp(Vec<Option<Start>>);

/// A collider in which guides start that are not in it as they are drawn.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct StartedIn {
    /// Its place in the scene.
    pub collider: u32,
    /// Number of these guides.
    pub guides: u32,
    /// Whether it comes there in the pre-roll, which pushes them aside. They stay in one that does not.
    pub runs_up: bool,
}

/// Where a collider is when the pre-roll starts.
#[derive(Debug, Clone, Copy)]
struct Start {
    path: Path,
    /// The share of the path that it has come by then.
    share: f64,
}

/// The path of a collider to where the shot finds it.
#[derive(Debug, Clone, Copy)]
enum Path {
    /// From where it is at rest, carried by the head.
    FromRest,
    /// Straight, from this displacement, m, in the frame of its body.
    Straight(Vector3<f64>),
}

/// A guide as it starts.
pub(super) struct StartLine<'a> {
    /// Its polyline, m, world.
    pub x: Vec<Vector3<f64>>,
    /// Where its root is on a skin, if it is.
    pub skin: Option<&'a RootBinding>,
    /// Distance to keep from each collider, m.
    pub thickness: Vec<f64>,
    /// True if its root is held.
    pub rooted: bool,
}

impl RunUp {
    /// All colliders are where the shot has them.
    pub fn none(anim: &Anim) -> Self {
        RunUp(vec![None; anim.colliders.len()])
    }

    /// The run-up of guides whose pre-roll starts at time `t`, s, in these `states`, among the colliders `bodies` of
    /// the animation. `troubled` are those that start in a collider, or through it, which they do not grow out of, each
    /// with the indices of these. Also the colliders of which this is not so as the groom is drawn.
    pub fn new(
        anim: &Anim,
        (guides, states): (&[GuideModel], &[GuideState]),
        bodies: &Bodies,
        t: f64,
        troubled: &[(StartLine, Vec<usize>)],
    ) -> (Self, Vec<StartedIn>) {
        let sampled = |state: &GuideState| {
            let last = state.x.len() - 1;
            (0..SAMPLES).map(|k| state.x[k * last / (SAMPLES - 1)]).collect::<Vec<_>>()
        };
        let skins = guides.iter().map(|guide| guide.skin.as_ref());
        let hair: Vec<Sampled> = skins.zip(states.iter().map(sampled)).collect();
        let start = |c: usize| {
            let of_collider = troubled.iter().filter(|(_, colliders)| colliders.contains(&c));
            let lines: Vec<&StartLine> = of_collider.map(|(line, _)| line).collect();
            if lines.is_empty() {
                return (None, None);
            }
            let carries = guides.iter().any(|guide| is_on(guide.skin.as_ref(), c));
            let way = Way { anim, bodies, c, t, hair: &hair, carries };
            let lines = way.free_at_rest(lines);
            if lines.is_empty() {
                return (None, None);
            }
            let has_time = anim.settings.preroll > 0.0;
            let start =
                if has_time && may_carry_its_roots(anim, guides, c, t) { way.start(&lines) } else { None };
            if carries && has_time && start.is_none() {
                // A skin brings out what starts in it.
                return (None, None);
            }
            let (collider, guides) = (c as u32, lines.len() as u32);
            (start, Some(StartedIn { collider, guides, runs_up: start.is_some() }))
        };
        let (starts, started_in): (_, Vec<_>) = (0..anim.colliders.len()).into_par_iter().map(start).unzip();
        (RunUp(starts), started_in.into_iter().flatten().collect())
    }

    /// True if no collider runs up.
    pub fn is_none(&self) -> bool {
        self.0.iter().all(Option::is_none)
    }

    /// World pose of collider `c` at time `t`, s, where the run-up has come by the share `progress`.
    pub fn pose(&self, anim: &Anim, c: usize, t: f64, progress: f64) -> Isometry3<f64> {
        let Collider { body, ref deformation, .. } = anim.colliders[c];
        let own = anim.bodies[body].track.pose(t);
        match self.at(c, progress) {
            Some((Path::FromRest, share)) if deformation.is_none() => between_rest_and(anim, body, t, share),
            Some((Path::Straight(from), share)) => own * Translation3::from(from * (1.0 - share)),
            _ => own,
        }
    }

    /// Rest space around a root on a skin to world at time `t`, s, where the run-up has come by the share `progress`: a
    /// skin on its way carries its roots.
    pub fn carried(&self, anim: &Anim, root: &RootBinding, t: f64, progress: f64) -> Isometry3<f64> {
        match self.at(root.collider, progress) {
            Some((Path::FromRest, share)) => carried_on_the_way(anim, root, t, share),
            _ => anim.carried(root, t),
        }
    }

    /// Where collider `c`, if it deforms, is on its way from rest at time `t`, s, where the run-up has come by the
    /// share `progress`.
    pub fn mesh_from_rest(&self, anim: &Anim, c: usize, t: f64, progress: f64) -> Option<FromRest> {
        match self.at(c, progress)? {
            (Path::FromRest, share) => Some(from_rest(anim, c, t, share)),
            (Path::Straight(_), _) => None,
        }
    }

    /// The path of collider `c` and the share of it that it has come; `None` if it is where the animation has it.
    fn at(&self, c: usize, progress: f64) -> Option<(Path, f64)> {
        let Start { path, share } = self.0[c]?;
        // Starts and ends at rest.
        let eased = progress * progress * progress * (10.0 - progress * (15.0 - 6.0 * progress));
        (progress < 1.0).then_some((path, share + (1.0 - share) * eased))
    }
}

/// The way of collider `c` to where it is at time `t`, s.
struct Way<'a> {
    anim: &'a Anim,
    /// The colliders at that time.
    bodies: &'a Bodies,
    c: usize,
    t: f64,
    hair: &'a [Sampled<'a>],
    /// True if roots of guides are on it.
    carries: bool,
}

/// Where the root of a guide is on a skin, if it is, and points of the guide, root first, m, world.
type Sampled<'a> = (Option<&'a RootBinding>, Vec<Vector3<f64>>);

/// A collider somewhere on its way.
struct OnItsWay<'a> {
    bodies: &'a Bodies,
    /// Its index among `bodies`, and among all.
    b: usize,
    c: usize,
    pose: Isometry3<f64>,
    t: f64,
    anim: &'a Anim,
    /// The share of the path that it has come, if it carries roots.
    carried: Option<f64>,
}

impl OnItsWay<'_> {
    /// The points `x`, m, world, of a guide as they are then, if the guide's root is there on a `skin`.
    fn carry<'x>(&self, skin: Option<&RootBinding>, x: &'x [Vector3<f64>]) -> Cow<'x, [Vector3<f64>]> {
        let Some((root, share)) = skin.filter(|root| is_on(Some(root), self.c)).zip(self.carried) else {
            return Cow::Borrowed(x);
        };
        let end = self.anim.carried(root, self.t);
        let back = carried_on_the_way(self.anim, root, self.t, share) * end.inverse();
        x.iter().map(|x| back.transform_point(&(*x).into()).coords).collect()
    }

    /// What `of` tells of a guide among the bodies.
    fn of<T>(&self, line: &StartLine, of: impl FnOnce(&GroomPose) -> T) -> T {
        let StartLine { x, thickness, rooted, skin } = line;
        let (x, thickness) = (&self.carry(*skin, x)[..], &thickness[self.c - self.b..]);
        of(&GroomPose { bodies: self.bodies, t: self.t, poses: &[], thickness, x, rooted: *rooted })
    }

    /// True if a guide lies in the collider, or runs through it.
    fn holds(&self, line: &StartLine) -> bool {
        self.of(line, |pose| pose.lies_in(self.b, &self.pose))
    }

    /// Depth of each point of a guide in the collider, m.
    fn depths(&self, line: &StartLine) -> Vec<f64> {
        self.of(line, |pose| pose.depths(self.b, &self.pose))
    }

    /// Number of roots that are not on the collider, and of guides, in it.
    fn met(&self, hair: &[Sampled]) -> [usize; 2] {
        let inside = |x: &Vector3<f64>| {
            let local = self.pose.inverse_transform_point(&(*x).into()).coords;
            self.bodies.contains(self.b, self.t, &local)
        };
        let of_guide = |(skin, x): &Sampled| {
            let x = self.carry(*skin, x);
            let root = !is_on(*skin, self.c) && inside(&x[0]);
            [root, root || x[1..].iter().any(inside)].map(usize::from)
        };
        hair.par_iter().map(of_guide).reduce(|| [0; 2], |a, b| [a[0] + b[0], a[1] + b[1]])
    }
}

impl Way<'_> {
    /// The guides of `troubled` that are free at rest, in a skin of those that are deep in it. What is drawn in a body, or
    /// through it, stays there wherever the body comes from.
    fn free_at_rest<'l>(&self, mut troubled: Vec<&'l StartLine<'l>>) -> Vec<&'l StartLine<'l>> {
        self.at(Path::FromRest, 0.0, |rest| troubled.retain(|line| !rest.holds(line)));
        if !self.carries {
            return troubled;
        }
        let depths =
            |there: &OnItsWay| troubled.par_iter().map(|line| there.depths(line)).collect::<Vec<_>>();
        let [drawn, start] = [0.0, 1.0].map(|share| self.at(Path::FromRest, share, depths));
        let deep = |(drawn, start): (Vec<f64>, Vec<f64>)| {
            drawn.iter().zip(start).any(|(drawn, start)| start > drawn + DEEP)
        };
        let deep = drawn.into_iter().zip(start).map(deep);
        troubled.into_iter().zip(deep).filter_map(|(line, deep)| deep.then_some(line)).collect()
    }

    /// Where the collider starts so that the guides `lines` are free, which are in it at its end; `None` if there is no
    /// way there.
    fn start(&self, lines: &[&StartLine]) -> Option<Start> {
        let straight = || {
            let path = Path::Straight(self.outside(lines));
            if self.carries { None } else { self.along(path, lines) }
        };
        self.along(Path::FromRest, lines).or_else(straight)
    }

    /// The start on a path on which it first meets one of the guides `lines`; `None` if they are not free at its start,
    /// or if it sweeps through other hair.
    fn along(&self, path: Path, lines: &[&StartLine]) -> Option<Start> {
        let share = |look: u32| f64::from(look) / f64::from(LOOKS);
        let meets =
            |look: &u32| self.at(path, share(*look), |body| lines.par_iter().any(|line| body.holds(line)));
        let start = (0..LOOKS).find(meets).unwrap_or(LOOKS).checked_sub(1)?;
        let met = |look: u32| self.at(path, share(look), |body| body.met(self.hair));
        let [roots, guides] = met(LOOKS);
        let most = (MOST_MET * guides.max(lines.len()) as f64) as usize;
        (start..LOOKS)
            .map(met)
            .all(|met| met[0] <= roots && met[1] <= most)
            .then_some(Start { path, share: share(start) })
    }

    /// A displacement, m, body frame, from which the collider comes straight at the guides `lines` that lie in it:
    /// along the mean of its normals there, and as far as the longest guide is long.
    fn outside(&self, lines: &[&StartLine]) -> Vector3<f64> {
        let out: Vector3<f64> = self.at(Path::FromRest, 1.0, |end| {
            lines.iter().map(|line| end.of(line, |pose| pose.way_out(end.b, &end.pose))).sum()
        });
        let length = |line: &&StartLine| line.x.windows(2).map(|w| (w[1] - w[0]).norm()).sum::<f64>();
        -out.try_normalize(0.0).unwrap_or_default() * lines.iter().map(length).fold(0.0, f64::max)
    }

    /// What `then` makes of the collider where it has come by a `share` of its path.
    fn at<T>(&self, path: Path, share: f64, then: impl FnOnce(&OnItsWay) -> T) -> T {
        let Way { anim, bodies, c, t, carries, .. } = *self;
        let carried = carries.then_some(share);
        let Collider { body, ref shape, ref deformation, .. } = anim.colliders[c];
        let own = anim.bodies[body].track.pose(t);
        let pose = match path {
            Path::Straight(from) => own * Translation3::from(from * (1.0 - share)),
            Path::FromRest if deformation.is_none() => between_rest_and(anim, body, t, share),
            Path::FromRest => own,
        };
        match (path, deformation, shape) {
            (Path::FromRest, Some(deformation), Shape::Mesh(mesh)) => {
                let from_rest = from_rest(anim, c, t, share);
                let vertices = from_rest.between(&mesh.vertices, &deformation.vertices(t));
                let shape = Shape::Mesh(TriMesh { vertices, triangles: mesh.triangles.clone() });
                then(&OnItsWay { bodies: &Bodies::from_shapes(&[shape]), b: 0, c, pose, t, anim, carried })
            }
            _ => then(&OnItsWay { bodies, b: c, c, pose, t, anim, carried }),
        }
    }
}

/// Where collider `c`, which deforms, is at time `t`, s, having come by a `share` of its way from rest.
fn from_rest(anim: &Anim, c: usize, t: f64, share: f64) -> FromRest {
    let own = anim.bodies[anim.colliders[c].body].track.pose(t);
    FromRest { rest: own.inverse() * anim.head_pose(t), share }
}

/// Whether a root is on collider `c`.
fn is_on(skin: Option<&RootBinding>, c: usize) -> bool {
    skin.is_some_and(|root| root.collider == c)
}

/// True if the roots on collider `c`, if any, are not turned far against the head at time `t`, s.
fn may_carry_its_roots(anim: &Anim, guides: &[GuideModel], c: usize, t: f64) -> bool {
    let to_rest = anim.head_pose(t).rotation.inverse();
    let skins = guides.par_iter().filter_map(|guide| guide.skin.as_ref());
    skins.filter(|root| is_on(Some(root), c)).all(|root| {
        let turn = to_rest * anim.carried(root, t).rotation;
        turn.angle() <= MOST_TURNED
    })
}

/// Rest space around a root to world at time `t`, s, whose skin has come by a `share` of its way from rest.
fn carried_on_the_way(anim: &Anim, root: &RootBinding, t: f64, share: f64) -> Isometry3<f64> {
    let Collider { body, ref shape, ref deformation, .. } = anim.colliders[root.collider];
    match (deformation, shape) {
        (Some(deformation), Shape::Mesh(mesh)) => {
            let (from_rest, deformed) = (from_rest(anim, root.collider, t, share), deformation.at(t));
            let place = |v: u32| from_rest.place(&mesh.vertices[v as usize], &deformed(v));
            anim.bodies[body].track.pose(t) * root.place.carry(place)
        }
        _ => between_rest_and(anim, body, t, share),
    }
}

/// World pose of a `body` that has come by a `share` of its way from rest, where it is carried by the head, to where
/// the animation has it at time `t`, s: on a screw in the space of the head.
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
