//! How bodies come to where the shot finds them (`docs/theory.md` §5.1, run-up). A groom is drawn with all bodies at
//! rest; where a shot starts with a turned head, long hair that is carried there lies in the shoulders.

use super::clearance::GroomPose;
use super::guide::{GuideModel, GuideState};
use crate::contact::Bodies;
use crate::geometry::{FromRest, Shape, TriMesh};
use crate::math::lanes;
use crate::math::se3::{self, Coefficients, Pose};
use crate::scene::{Anim, Collider};
use nalgebra::{Isometry3, Matrix3, Translation3, UnitQuaternion, Vector3};
use rayon::prelude::*;

/// Places on the way of a body from rest to the start of the shot at which it is looked for in the hair. More find
/// thinner bodies that sweep through it, and take longer.
const LOOKS: u32 = 24;

/// Motion of a root relative to the head, m, up to which its skin may run up: fur on an arm has its root there.
const ROOTED: f64 = 2e-3;

/// How many times as many guides as lie in a body at the start of the shot it may meet on its way there: what sweeps
/// through the head meets far more.
const MOST_MET: f64 = 2.0;

/// Points of a guide at which it is looked for in a body on its way.
const SAMPLES: usize = 4;

/// How each collider comes to where the shot finds it; `None` for those that are there all the time.
#[derive(Debug, Clone)]
pub(super) struct RunUp(Vec<Option<Start>>);

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
pub(super) struct StartLine {
    /// Its polyline, m, world.
    pub x: Vec<Vector3<f64>>,
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
    /// with the indices of these.
    pub fn new(
        anim: &Anim,
        (guides, states): (&[GuideModel], &[GuideState]),
        bodies: &Bodies,
        t: f64,
        troubled: &[(StartLine, Vec<usize>)],
    ) -> Self {
        let sampled = |state: &GuideState| {
            let last = state.x.len() - 1;
            (0..SAMPLES).map(|k| state.x[k * last / (SAMPLES - 1)]).collect::<Vec<_>>()
        };
        let hair: Vec<Vec<Vector3<f64>>> = states.iter().map(sampled).collect();
        let starts = (0..anim.colliders.len()).into_par_iter().map(|c| {
            let of_collider = troubled.iter().filter(|(_, colliders)| colliders.contains(&c));
            let lines: Vec<&StartLine> = of_collider.map(|(line, _)| line).collect();
            if lines.is_empty() || !keeps_its_roots(anim, guides, c, t) {
                return None;
            }
            Way { anim, bodies, c, t, hair: &hair }.start(lines)
        });
        RunUp(starts.collect())
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
    /// Points of each guide, root first, m, world.
    hair: &'a [Vec<Vector3<f64>>],
}

/// A collider somewhere on its way.
struct OnItsWay<'a> {
    bodies: &'a Bodies,
    /// Its index among `bodies`, and among all.
    b: usize,
    c: usize,
    pose: Isometry3<f64>,
    t: f64,
}

impl OnItsWay<'_> {
    /// What `of` tells of a guide among the bodies.
    fn of<T>(&self, line: &StartLine, of: impl FnOnce(&GroomPose) -> T) -> T {
        let StartLine { x, thickness, rooted } = line;
        let thickness = &thickness[self.c - self.b..];
        of(&GroomPose { bodies: self.bodies, t: self.t, poses: &[], thickness, x, rooted: *rooted })
    }

    /// True if a guide lies in the collider, or runs through it.
    fn holds(&self, line: &StartLine) -> bool {
        self.of(line, |pose| pose.lies_in(self.b, &self.pose))
    }

    /// Number of roots, and of guides, in the collider, of which `hair` has points, root first.
    fn met(&self, hair: &[Vec<Vector3<f64>>]) -> [usize; 2] {
        let inside = |x: &Vector3<f64>| {
            let local = self.pose.inverse_transform_point(&(*x).into()).coords;
            self.bodies.contains(self.b, self.t, &local)
        };
        let of_guide = |guide: &Vec<Vector3<f64>>| {
            let root = inside(&guide[0]);
            [root, root || guide[1..].iter().any(inside)].map(usize::from)
        };
        hair.par_iter().map(of_guide).reduce(|| [0; 2], |a, b| [a[0] + b[0], a[1] + b[1]])
    }
}

impl Way<'_> {
    /// Where the collider starts so that guides are free that are `troubled` at its end and free at rest; `None` if
    /// there are none, or no way there. What is drawn in a body, or through it, stays there wherever the body comes
    /// from.
    fn start(&self, troubled: Vec<&StartLine>) -> Option<Start> {
        let mut lines = troubled;
        self.at(Path::FromRest, 0.0, |rest| lines.retain(|line| !rest.holds(line)));
        if lines.is_empty() {
            return None;
        }
        self.along(Path::FromRest, &lines)
            .or_else(|| self.along(Path::Straight(self.outside(&lines)), &lines))
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
        let Way { anim, bodies, c, t, .. } = *self;
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
                then(&OnItsWay { bodies: &Bodies::from_shapes(&[shape]), b: 0, c, pose, t })
            }
            _ => then(&OnItsWay { bodies, b: c, c, pose, t }),
        }
    }
}

/// Where collider `c`, which deforms, is at time `t`, s, having come by a `share` of its way from rest.
fn from_rest(anim: &Anim, c: usize, t: f64, share: f64) -> FromRest {
    let own = anim.bodies[anim.colliders[c].body].track.pose(t);
    FromRest { rest: own.inverse() * anim.head_pose(t), share }
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
