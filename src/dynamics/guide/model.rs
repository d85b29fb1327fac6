//! The constants of a guide.

use crate::dynamics::environment::Environment;
use crate::dynamics::goal::AnimatedGoal;
use crate::dynamics::load::GuideLoad;
use crate::dynamics::tie::Tie;
use crate::geometry::Friction;
use crate::math::se3::Pose;
use crate::rod::Rod;
use crate::scene::RootBinding;
use crate::scene::anim::Scheme;
use nalgebra::{Isometry3, Vector3};

/// The constants of a guide: its rod and what acts on it.
#[derive(Debug, Clone)]
pub struct GuideModel {
    /// The Kirchhoff rod.
    pub rod: Rod,
    /// Time scheme.
    pub scheme: Scheme,
    /// Drag coefficient at each point: force per length and speed, N·s/m².
    pub drag: Vec<f64>,
    /// Friction along the strand at root and tip, used where a body has none of its own.
    pub friction: [Friction; 2],
    /// Ratio of the friction across the strand to that along it.
    pub friction_across: f64,
    /// Springs that pull the points to the groom's pose, one per point; empty without a goal.
    pub goal: Vec<GoalSpring>,
    /// The animated goal; `None` for a guide without one.
    pub animated_goal: Option<AnimatedGoal>,
    /// Places of the strand that are held to bodies, from root to tip.
    pub ties: Vec<Tie>,
    /// Forces and moments on it.
    pub loads: Vec<GuideLoad>,
    /// Whether its steps record what holds it ([`GuideModel::reaction`]).
    pub records_reaction: bool,
    /// The place of a skin that carries the root; `None` if the head does.
    pub skin: Option<RootBinding>,
    /// Rest space to world where a free root starts; `None` if the root is held.
    pub start_pose: Option<Isometry3<f64>>,
}

/// A spring that pulls one point to its place in the groom's pose.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GoalSpring {
    /// Anchor in the frame of the root, m.
    pub anchor: Vector3<f64>,
    /// Stiffness, N/m.
    pub stiffness: f64,
}

/// How contact constrains the sub-step of a guide.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum ContactMode {
    /// Constraints keep the guide out of bodies; the guide halves its own sub-step where it has to.
    #[default]
    Bodies,
    /// As `Bodies`, but the guide takes its sub-step whole: a coupled sub-step
    /// halves it for all guides at once.
    Coupled,
    /// Springs push the guide out of bodies: fast, without guarantees.
    Springs,
}

impl GuideModel {
    /// A guide without ties and goals, with isotropic friction, under the default time scheme; if its root is free, it
    /// starts as it is drawn. `drag` is per point, N·s/m².
    pub fn new(rod: Rod, drag: Vec<f64>, friction: impl Into<Friction>) -> Self {
        GuideModel {
            start_pose: rod.is_free().then(Isometry3::identity),
            rod,
            scheme: Scheme::default(),
            drag,
            friction: [friction.into(); 2],
            friction_across: 1.0,
            goal: Vec::new(),
            animated_goal: None,
            ties: Vec::new(),
            loads: Vec::new(),
            records_reaction: false,
            skin: None,
        }
    }

    /// Rest space around the root to world at time `t`, s: always that of the start if the root is free.
    pub fn carrier(&self, env: &Environment, t: f64) -> Isometry3<f64> {
        self.start_pose.unwrap_or_else(|| env.carried(self.skin.as_ref(), t))
    }

    /// World pose at which the root is carried at time `t`, s.
    pub fn root(&self, env: &Environment, t: f64) -> Pose {
        Environment::root_on(&self.carrier(env, t), &self.rod.root)
    }
}
