//! The report of a bake, pictures of a cache, and a cache as a page that plays.

mod bake_report;
mod font;
mod in_order;
pub mod picture;
mod plot;
pub mod preview;
mod space;
mod text;
pub mod view;
mod warning;

pub use bake_report::{BakeReport, Chart, Picture, Series};
pub use picture::Image;
pub use warning::Warning;
