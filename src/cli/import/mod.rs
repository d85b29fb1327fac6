//! `hairbake import`: converts strands and head motions of other programs.

mod groom;
mod track;

use crate::error::{Error, Result};
use clap::Subcommand;
use groom::GroomArguments;
use std::path::Path;
use track::TrackArguments;

/// `hairbake import` as it is typed.
#[derive(Debug, Subcommand)]
pub enum Import {
    /// Convert strands to groom.json: USD basis curves, TressFX .tfx or Cem Yuksel .hair
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

/// Parses a number from `least` to `most`.
fn count(least: i64, most: i64) -> impl clap::builder::TypedValueParser<Value = u32> {
    clap::value_parser!(u32).range(least..=most)
}

/// Parses the path of a USD prim.
fn prim(text: &str) -> std::result::Result<String, String> {
    text.starts_with('/')
        .then(|| text.into())
        .ok_or_else(|| "expected an absolute prim path, such as /groom/hair".into())
}

/// The folder that holds `file`.
fn folder_of(file: &Path) -> &Path {
    file.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."))
}

fn create_folder_of(file: &Path) -> Result<()> {
    let folder = folder_of(file);
    std::fs::create_dir_all(folder).map_err(|e| Error::io(folder, e))
}
