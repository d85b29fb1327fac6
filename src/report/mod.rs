//! Pictures, plots and the report of a bake.

mod bake_report;
pub mod font;
pub mod picture;
pub mod plot;
pub mod preview;
pub mod text;

pub use bake_report::{BakeReport, Chart, Picture, Series};
pub use picture::Image;
