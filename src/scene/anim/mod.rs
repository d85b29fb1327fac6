//! The animation and its formats, `anim.json` and motion files.

pub mod ends_file;
pub mod file;
pub mod goal;
pub mod model;
pub mod motion_file;
pub(super) mod read;
pub mod settings;
pub mod settings_file;

pub use super::keyframes::Keyframes;
pub use super::track::Track;
pub use ends_file::RootHold;
pub use file::{AnimFile, GoalSpace, LoadAxes};
pub use goal::{Goal, GoalCurves, GoalPull};
pub use model::{
    Anim, Body, Collider, GRAVITY, GuideSelection, Load, LoadPlace, MAX_FRAMES, Roots, Tie, TieOrientation,
    TiePoint, Wind,
};
pub use settings::{ContactSetting, OutputCurves, Resolution, Scheme, Settings};
