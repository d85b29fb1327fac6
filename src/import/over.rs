//! The curves that a bake overrides.

use super::formats::usd;
use super::source::Source;
use crate::scene::{OverSource, OverTarget};
use crate::{Diagnostic, Result};

/// Reads the curves at and below the prims of `source` at rest, which is at `time` if they are animated; and
/// where the stage places them at `offsets` after each of the frames.
///
/// # Errors
/// A file that is not USD, or cannot be read, or of unknown unit; closed curves, and curves inside instances.
pub fn over_target(
    source: &OverSource,
    time: Option<f64>,
    frames: [i32; 2],
    offsets: &[f64],
) -> Result<OverTarget> {
    let OverSource { file, prims, metres_per_unit, up } = source;
    let (metres_per_unit, up) = (*metres_per_unit, *up);
    let source = Source { time, metres_per_unit, up, ..Source::new(file) };
    if !source.is_usd() {
        let help = "name the stage that shows the groom";
        let allowed = ".usd, .usda, .usdc or .usdz";
        return Err(Diagnostic::new(&source.path, "--over", "not a USD file", allowed, help).into());
    }
    usd::over::read(&source, prims, frames, offsets)
}
