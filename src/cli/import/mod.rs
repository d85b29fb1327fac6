//! `hairbake import`: converts strands and head motions of other programs.

mod groom;
mod track;

use crate::error::Result;
use clap::Subcommand;
use groom::GroomArguments;
use track::TrackArguments;

/// `hairbake import` as it is typed.
#[derive(Debug, Subcommand)]
pub enum Import {
    /// Convert strands to groom.json: USD basis curves, TressFX .tfx (3 and 4) or Cem Yuksel .hair
    Groom(Box<GroomArguments>),
    /// Convert a head motion and the meshes that the hair collides with to anim.json
    Track(Box<TrackArguments>),
}

/// Imports a groom or a track.
pub fn run(what: Import) -> Result<()> {
    match what {
        Import::Groom(arguments) => groom::run(*arguments),
        Import::Track(arguments) => track::run(&arguments),
    }
}
