//! The animation: bodies on tracks, colliders, ties, wind, forces, settings. SI units, Y up, world space.

use super::ends_file::RootHold;
use super::file::LoadAxes;
use super::goal::Goal;
use super::settings::{Resolution, Settings};
use crate::geometry::{Deformation, Friction, Shape};
use crate::scene::keyframes::Keyframes;
use crate::scene::origin::Origin;
use crate::scene::over_target::OverSource;
use crate::scene::root_binding::RootBinding;
use crate::scene::track::Track;
use nalgebra::{Isometry3, Matrix3, Vector3};
use std::sync::Arc;

/// Gravity of the Earth, m/s²: along −Y if an animation gives none.
pub const GRAVITY: f64 = 9.81;

/// Most frames of a shot: bounds memory; far above any real shot.
pub const MAX_FRAMES: i64 = 1_000_000;

/// A validated animation.
#[derive(Debug, Clone)]
pub struct Anim {
    /// Frames per second of the bake.
    pub fps: f64,
    /// First and last frame of the bake, inclusive.
    pub frames: (i32, i32),
    /// The same of the shot: a bake may be of some of its frames.
    pub shot: (i32, i32),
    /// Index into [`Anim::bodies`] of the body that carries the groom.
    pub head: usize,
    /// Rigid bodies; at least the head.
    pub bodies: Vec<Body>,
    /// Shapes that the hair collides with.
    pub colliders: Vec<Collider>,
    /// Those, meshes, that roots grow on: indices into [`Anim::colliders`]; empty if the head carries all
    /// roots.
    pub skins: Vec<usize>,
    /// The motion that stands for that of the head where skins carry the roots of a head without a track.
    pub reference: Option<Track>,
    /// How the roots of some guides are held; the others are clamped.
    pub roots: Vec<Roots>,
    /// Ties that hold guides to bodies: hair ties, clips, ends of braids.
    pub ties: Vec<Tie>,
    /// Forces and moments on guides.
    pub loads: Vec<Load>,
    /// Animated curves that guides are pulled to.
    pub goals: Vec<Goal>,
    /// Gravity, m/s².
    pub gravity: Vector3<f64>,
    /// Wind fields; their velocities add.
    pub wind: Vec<Wind>,
    /// Uniform accelerations over time, m/s², added to gravity.
    pub forces: Vec<Keyframes>,
    /// Curves of a stage that a bake puts the motion over.
    pub over: Option<OverSource>,
    /// Simulation settings.
    pub settings: Settings,
}

impl Anim {
    /// Which guides are simulated; never [`Resolution::Auto`].
    pub fn resolution(&self) -> Resolution {
        match self.settings.resolution {
            // Strands that follow a wisp do not bend at their tips, and their roots are clamped.
            Resolution::Auto if self.has_moments() || self.frees_roots() => Resolution::Full,
            _ => self.settings.resolution(),
        }
    }

    /// True if some roots are pinned or free.
    pub fn frees_roots(&self) -> bool {
        self.roots.iter().any(|roots| roots.hold != RootHold::Clamped)
    }

    /// True if loads or ties exert moments.
    pub fn has_moments(&self) -> bool {
        self.loads.iter().any(Load::has_moment)
            || self.ties.iter().any(|tie| tie.orientation != TieOrientation::Free)
    }
}

/// A rigid body on a track. A point p of rest space is at [`Track::pose`] · p in the world.
#[derive(Debug, Clone)]
pub struct Body {
    /// Name.
    pub name: String,
    /// The pose of rest space in the world, over time.
    pub track: Track,
    /// Where its rest pose comes from.
    pub origin: Option<Origin>,
}

/// A shape that the hair cannot enter.
#[derive(Debug, Clone)]
pub struct Collider {
    /// Unique name; a valid USD prim name.
    pub name: String,
    /// Body that carries it: index into [`Anim::bodies`].
    pub body: usize,
    /// Shape, in the rest space of its body.
    pub shape: Shape,
    /// Motion of the vertices of its mesh in that space; `None` for a rigid shape.
    pub deformation: Option<Arc<Deformation>>,
    /// Its friction; `None` for that of the strand.
    pub friction: Option<Friction>,
    /// Distance kept between the shape and the axes of the strands, m; guides keep at least their radius.
    pub thickness: f64,
}

/// How the roots of some guides are held. Of several for a guide the last one counts.
#[derive(Debug, Clone, PartialEq)]
pub struct Roots {
    /// Unique name.
    pub name: String,
    /// The guides.
    pub guides: GuideSelection,
    /// How they are held.
    pub hold: RootHold,
}

/// Holds one point of each of some guides to a body.
#[derive(Debug, Clone, PartialEq)]
pub struct Tie {
    /// Unique name.
    pub name: String,
    /// Body that holds the guides: index into [`Anim::bodies`].
    pub body: usize,
    /// The guides.
    pub guides: GuideSelection,
    /// The point of each guide that is held.
    pub point: TiePoint,
    /// Bundle in which the held points are gathered: centre and radius, m, rest space of the body; `None`
    /// keeps each where it was drawn.
    pub bundle: Option<(Vector3<f64>, f64)>,
    /// The material frame that it holds.
    pub orientation: TieOrientation,
    /// Whether strands slide along their axes through it.
    pub slides: bool,
    /// Whether it lets strands go for good that slide out of it.
    pub releases: bool,
    /// First and last time at which it holds, s.
    pub times: [f64; 2],
}

/// The material frame that a tie holds: columns d1, d2, d3.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub enum TieOrientation {
    /// None: the place turns freely.
    #[default]
    Free,
    /// That of the groom's pose, carried by the body.
    Drawn,
    /// This one in the rest space of the body.
    Frame(Matrix3<f64>),
}

/// Some guides: those that match all that is given.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct GuideSelection {
    /// Their ids; `None` for all.
    pub ids: Option<Vec<i32>>,
    /// Their group; `None` for all.
    pub group: Option<String>,
    /// A ball that they enter in the groom's pose: centre and radius, m, rest space; `None` for all.
    pub within: Option<(Vector3<f64>, f64)>,
}

/// A force and a moment on each of some guides.
#[derive(Debug, Clone)]
pub struct Load {
    /// Unique name.
    pub name: String,
    /// The guides.
    pub guides: GuideSelection,
    /// Where it acts.
    pub place: LoadPlace,
    /// Force over time, N, or N/m of a spread load.
    pub force: Keyframes,
    /// Moment over time, N·m, or N of a spread load.
    pub moment: Keyframes,
    /// Axes of both.
    pub axes: LoadAxes,
}

impl Load {
    /// True if its moment is not always zero.
    pub fn has_moment(&self) -> bool {
        self.moment.values.iter().any(|value| *value != Vector3::zeros())
    }
}

/// Where on a guide a load acts.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum LoadPlace {
    /// At an arc length from the root, m.
    Arc(f64),
    /// At a share of the length.
    Share(f64),
    /// Spread from one arc length to another, m.
    Span([f64; 2]),
    /// Spread from one share of the length to another.
    SpanShare([f64; 2]),
}

/// The point of a guide that a tie holds.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum TiePoint {
    /// The point drawn nearest to the centre of the bundle, at a length that reaches it; without a bundle, to
    /// the centre of the ball.
    Nearest,
    /// The point at an arc length from the root, m.
    Arc(f64),
    /// The point at a share of the length.
    Share(f64),
    /// The point whose arc length is this multiple of the distance from the root to the centre of the bundle.
    Distance(f64),
}

/// A wind field: a uniform velocity over time plus gusts.
#[derive(Debug, Clone)]
pub struct Wind {
    /// Mean velocity over time, m/s.
    pub velocity: Keyframes,
    /// Root-mean-square speed of the gusts, m/s; 0: steady.
    pub gust_speed: f64,
    /// Size of the gusts, m.
    pub gust_length: f64,
    /// Random seed of the gusts.
    pub seed: u32,
}

impl Anim {
    /// Time of a frame, s: frame 0 is at 0.
    pub fn time(&self, frame: f64) -> f64 {
        frame / self.fps
    }

    /// World pose of rest space on the head at time `t`, s. With skins it is a frame of reference near the
    /// hair.
    pub fn head_pose(&self, t: f64) -> Isometry3<f64> {
        self.reference.as_ref().unwrap_or(&self.bodies[self.head].track).pose(t)
    }

    /// Rest space around a root to world at time `t`, s: by its place on a skin, or by the head.
    pub fn carrier(&self, root: Option<&RootBinding>, t: f64) -> Isometry3<f64> {
        root.map_or_else(|| self.head_pose(t), |root| self.carried(root, t))
    }

    /// The rigid motion of rest space to the world that carries a root on a skin at time `t`, s.
    pub fn carried(&self, root: &RootBinding, t: f64) -> Isometry3<f64> {
        let skin = &self.colliders[root.collider];
        let body = self.bodies[skin.body].track.pose(t);
        skin.deformation.as_ref().map_or(body, |deformation| body * root.place.carry(deformation.at(t)))
    }
}
