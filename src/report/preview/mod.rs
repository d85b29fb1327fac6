//! Pictures of a cache without a GPU, in seconds: contact sheets and animations.

mod camera;
mod crowding;
mod frame_range;
mod light;
mod options;
mod raster;
mod renderer;
mod scene;
mod sheet;
mod shot;
mod strand;
#[cfg(test)]
mod tests;

pub use crowding::Crowding;
pub use frame_range::spread;
pub use options::{Colours, CurveSelection, Follow, Options};
pub use renderer::Renderer;
pub use sheet::{animate, sheet, sheet_of_shots};
pub use shot::Shot;
#[cfg(test)]
pub use shot::tests::Memory;
