//! The report of a bake, and pictures of a cache.

mod bake_report;
mod font;
pub mod picture;
mod plot;
pub mod preview;
mod text;

pub use bake_report::{BakeReport, Chart, Picture, Series};
pub use picture::Image;
