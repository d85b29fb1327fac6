//! Offline hair baker: grooms and head tracks in, Cosserat rods in wisps, USD curve caches out.
//!
//! The modules follow the way of the data: [`import`] makes scenes from plain strands, [`scene`] is
//! the validated input (its shapes and meshes are [`geometry`]), [`bake`] runs the frames over [`rod`], [`wisp`] and [`contact`], [`strands`]
//! turns guides into render strands, [`cache`] lays them out as USD through [`usd`], [`report`]
//! shows the result, [`farm`] divides a bake for schedulers, and [`cli`] is the only module that prints. `docs/theory.md` holds the equations.

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

/// Which build this is: a hash of the sources that bake. What one build has begun, another of other sources begins anew.
pub const BUILD: &str = env!("HAIRBAKE_BUILD");
