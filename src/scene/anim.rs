//! The animation: bodies on tracks, colliders, wind, forces, settings. SI units, Y up, world space.

pub mod file;
pub(super) mod read;

use crate::geometry::{Deformation, Friction, Shape};
use nalgebra::{Isometry3, Vector3};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::sync::Arc;

pub use super::keyed::Keyed;
pub use super::track::Track;
pub use file::AnimFile;

/// Most frames of a shot: a limit against memory without bound, far above any real one.
pub const MAX_FRAMES: i64 = 1_000_000;

/// An animation, validated.
#[derive(Debug, Clone)]
pub struct Anim {
    /// Frames a second of the bake.
    pub fps: f64,
    /// First and last frame, inclusive.
    pub frames: (i32, i32),
    /// Index into [`Anim::bodies`] of the body that carries the groom.
    pub head: usize,
    /// Rigid bodies; at least the head.
    pub bodies: Vec<Body>,
    /// What the hair collides with.
    pub colliders: Vec<Collider>,
    /// What holds strands to bodies: hair ties, clips, braids.
    pub ties: Vec<Tie>,
    /// Gravity, m/s².
    pub gravity: Vector3<f64>,
    /// Wind fields; their velocities add.
    pub wind: Vec<Wind>,
    /// Uniform accelerations over time, m/s², added to gravity.
    pub forces: Vec<Keyed>,
    /// Simulation settings.
    pub settings: Settings,
}

/// A rigid body on a track. A point p of rest space is at `pose(t) · rest⁻¹ · p` in the world;
/// [`Track::pose`] already includes the `rest⁻¹`.
#[derive(Debug, Clone)]
pub struct Body {
    /// Name.
    pub name: String,
    /// Rest space to world, over time.
    pub track: Track,
}

/// Something the hair cannot enter.
#[derive(Debug, Clone)]
pub struct Collider {
    /// Name, unique; a valid USD prim name.
    pub name: String,
    /// Body that carries it, index into [`Anim::bodies`].
    pub body: usize,
    /// Its shape, in the rest space of its body.
    pub shape: Shape,
    /// How the vertices of its mesh move there; `None` for a rigid shape.
    pub deformation: Option<Arc<Deformation>>,
    /// Its friction, or `None` to take the strand's own.
    pub friction: Option<Friction>,
    /// Distance kept between the shape and the strands, m.
    pub thickness: f64,
}

/// Holds a place of each of some guides to a body, in all directions.
#[derive(Debug, Clone, PartialEq)]
pub struct Tie {
    /// Name, unique.
    pub name: String,
    /// Body that holds them, index into [`Anim::bodies`].
    pub body: usize,
    /// Ids of the guides that it may hold; `None` for all.
    pub ids: Option<Vec<i32>>,
    /// Group of the guides that it may hold; `None` for all.
    pub group: Option<String>,
    /// Of those, it holds the ones that come into this ball in the groom's pose: centre and radius, m, rest space; `None` for all.
    pub within: Option<(Vector3<f64>, f64)>,
    /// Which place of a guide.
    pub place: TiePlace,
    /// Where the places are gathered, rest space of the body, m, and within which distance of it, m; `None` leaves each where it
    /// was drawn.
    pub gathered: Option<(Vector3<f64>, f64)>,
    /// First and last time at which it holds, s.
    pub times: [f64; 2],
}

/// Which place of a guide a tie holds.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum TiePlace {
    /// The one drawn nearest to where the tie gathers, or to the centre of its ball.
    Nearest,
    /// At an arc length from the root, m.
    Arc(f64),
    /// At so many times the distance of the root from where the tie gathers.
    Distance(f64),
}

/// A wind field: a uniform velocity over time plus gusts.
#[derive(Debug, Clone)]
pub struct Wind {
    /// Mean velocity over time, m/s.
    pub velocity: Keyed,
    /// Root-mean-square speed of the gusts, m/s; 0 = steady.
    pub gust_speed: f64,
    /// Size of the gusts, m.
    pub gust_length: f64,
    /// Seed of the gusts.
    pub seed: u32,
}

/// Simulation settings; the command line may override them.
#[derive(Debug, Clone, PartialEq)]
pub struct Settings {
    /// Steps of the solver in one frame.
    pub substeps: u32,
    /// Simulated time before the first frame, s, in which the groom settles and overlaps are worked out.
    pub preroll: f64,
    /// Strain nodes on a guide that belongs to no wisp of the groom's own.
    pub nodes: u32,
    /// Time scheme of the solver.
    pub scheme: Scheme,
    /// What hair touches.
    pub contact: Contact,
    /// What is asked to move by itself; see [`Settings::resolution`].
    pub resolution: Resolution,
    /// Where the resolution is adaptive: share of its length by which a guide may be off where those that lead it put it, as estimated by what they
    /// differ on, and bodies push it from there, before it comes away.
    pub parting: f64,
    /// Which curves are written.
    pub curves: Written,
    /// Share of the render strands that is written (above 0, to 1); those are wider, so that they cover as much.
    pub keep: f64,
    /// Moments of a frame that are written: the frame itself, and the others evenly over the shutter, at its end the last.
    pub samples: u32,
    /// How long the shutter is open from a frame on, frames (0..1).
    pub shutter: f64,
    /// Whether accelerations are written beside velocities.
    pub accelerations: bool,
}

/// What moves by itself.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Resolution {
    /// `adaptive` where hair touches bodies only; `full` where it touches other hair too, for what follows a wisp passes through that, and where the moments of the
    /// solver are written.
    #[default]
    Auto,
    /// Coarse wisps, and what comes away from them where they are stirred, until it is calm again.
    Adaptive,
    /// Every guide.
    Full,
    /// Coarse wisps only: for quick looks.
    Coarse,
}

/// Which curves a bake writes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Written {
    /// The simulated guides only.
    Guides,
    /// The simulated guides only, and where the solver brought them between frames: whatever is between two of these moments went straight. For whoever
    /// checks the solver.
    Steps,
    /// The render strands only.
    Strands,
    /// Both.
    #[default]
    Both,
}

/// What hair touches.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Contact {
    /// Bodies and other hair: strands rest on each other, slide with friction, and do not pass through each other. What follows a wisp passes through other hair.
    Full,
    /// Bodies only: quicker, and right where strands hang side by side.
    #[default]
    Bodies,
    /// Bodies only, which push hair away by springs once it is in them: for a quick look. It guarantees nothing: hair sinks in, and what is quick goes
    /// through.
    Penalty,
}

/// How the solver steps in time. Both are stable at any step and cost nearly the same.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Scheme {
    /// First order. Damps all that swings, quick motion most: per radian of an oscillation half the radians that it turns in a step.
    BackwardEuler,
    /// Second order, the two-step backward differentiation formula. Damps slow swings hardly, and quick ones that the
    /// step cannot follow as backward Euler does. A step in which hair touches something is backward Euler's.
    #[default]
    Bdf2,
}

impl Settings {
    /// What moves by itself: never [`Resolution::Auto`].
    pub fn resolution(&self) -> Resolution {
        match self.resolution {
            Resolution::Auto if self.contact == Contact::Full || self.curves == Written::Steps => {
                Resolution::Full
            }
            Resolution::Auto => Resolution::Adaptive,
            asked => asked,
        }
    }
}

impl Default for Settings {
    fn default() -> Self {
        Settings {
            substeps: 8,
            preroll: 1.0,
            nodes: 8,
            scheme: Scheme::default(),
            contact: Contact::default(),
            resolution: Resolution::default(),
            // Strands are off by some tenths of a percent of their length then, about as much as by steps of 1/96 s in place of shorter ones.
            parting: 0.005,
            curves: Written::default(),
            keep: 1.0,
            samples: 1,
            shutter: 0.5,
            accelerations: false,
        }
    }
}

impl Settings {
    /// When the moments of a frame that are written lie, frames after it.
    pub fn offsets(&self) -> impl Iterator<Item = f64> + use<> {
        let (shutter, last) = (self.shutter, f64::from(self.samples.max(2) - 1));
        (0..self.samples).map(move |i| shutter * f64::from(i) / last)
    }
}

impl Anim {
    /// Time of a frame, s: frame 0 is at 0.
    pub fn time(&self, frame: f64) -> f64 {
        frame / self.fps
    }

    /// World pose of rest space on the head at time `t`, s.
    pub fn head_pose(&self, t: f64) -> Isometry3<f64> {
        self.bodies[self.head].track.pose(t)
    }
}
