//! Pictures, plots and the report of a bake.

pub mod font;
pub mod picture;
pub mod preview;

pub use picture::Image;
