//! Pictures of a cache without a GPU, in seconds: contact sheets and animations.

mod body;
mod camera;
mod crowding;
mod frame_range;
mod hair;
mod light;
mod lighting;
mod options;
mod raster;
mod renderer;
mod scene;
mod shadow_map;
mod sheet;
mod shot;
mod strand;
#[cfg(test)]
mod tests;
mod volume;

pub use crowding::Crowding;
pub use frame_range::spread;
pub use options::{Colours, CurveSelection, Follow, Options, Quality};
pub use renderer::Renderer;
pub use sheet::{Views, animate, sheet, sheet_of_shots};
pub use shot::Shot;
#[cfg(test)]
pub use shot::tests::Memory;
