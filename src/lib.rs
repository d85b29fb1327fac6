//! Offline hair baking: the guides of a groom are simulated as elastic rods on a moving head, and the render
//! strands are written as a USD curve cache.
//!
//! | module | task |
//! |---|---|
//! | [`import`], [`sample`] | convert strands and head motions of other programs to scenes; make scenes from
//! nothing |
//! | [`scene`], [`geometry`] | read `groom.json` and `anim.json` into validated data; shapes, meshes and
//! distances |
//! | [`rod`] | one Kirchhoff rod: inextensible, unshearable, implicit in time |
//! | [`wisp`], [`contact`] | the hierarchy of wisps; collision detection and friction |
//! | [`dynamics`] | step all guides in time |
//! | [`strands`] | interpolate render strands from guides |
//! | [`bake`] | run a job in stages that can be stopped, resumed and divided |
//! | [`cache`], [`usd`] | write and read the cache; USD layers and crate files |
//! | [`report`] | pictures and reports of a bake |
//! | [`farm`] | divide a bake into tasks for schedulers |
//! | [`cli`] | the command line, the only module that prints |
//!
//! `docs/theory.md` has the equations.

pub mod bake;
pub mod cache;
pub mod cli;
pub mod contact;
pub mod dynamics;
pub mod error;
pub mod farm;
mod file;
pub mod geometry;
pub mod import;
pub mod math;
mod python;
pub mod report;
pub mod rod;
pub mod sample;
pub mod scene;
pub mod strands;
#[cfg(test)]
mod test_data;
pub mod usd;
pub mod wisp;

pub use error::{Diagnostic, Error, Result};

/// The build: a hash of the sources that affect the bytes of a cache. A bake is resumed only by the same
/// build.
pub const BUILD: &str = env!("HAIRBAKE_BUILD");
