//! Reads a cache: what is in it, and how far each frame moves.
//!
//! ```sh
//! cargo run --release --example read_cache -- out/cache
//! ```

#![allow(clippy::print_stdout)]

use hairbake::cache::{CurveFrame, Reader};
use std::path::Path;

fn main() -> hairbake::Result<()> {
    let Some(folder) = std::env::args_os().nth(1) else {
        println!("usage: read_cache FOLDER");
        return Ok(());
    };
    let reader = Reader::open(Path::new(&folder))?;

    // The header holds what does not change over time: units, rates, the curves and their attributes.
    let header = reader.header();
    let strands = header.hair.as_ref().map_or(0, |hair| hair.counts.len());
    println!("{} guides, {strands} render strands", header.guides.counts.len());
    println!("frames {:?} at {} per second", header.frames, header.fps);
    println!("1 unit = {} m, {} up", header.metres_per_unit, if header.z_up { 'Z' } else { 'Y' });

    // A frame holds points and velocities in world space. A cache without render strands has guides only.
    println!("{:>8} {:>16} {:>16}", "frame", "mean speed, m/s", "top speed, m/s");
    for &number in reader.frames() {
        let frame = reader.read_frame(number)?;
        let curves = frame.hair.as_ref().unwrap_or(&frame.guides);
        let (mean, top) = speeds(curves);
        let [mean, top] = [mean, top].map(|speed| f64::from(speed) * header.metres_per_unit);
        println!("{number:8} {mean:16.3} {top:16.3}");
    }
    Ok(())
}

/// Mean and highest speed of the points, scene units a second.
fn speeds(curves: &CurveFrame) -> (f32, f32) {
    let speeds = curves.velocities.iter().map(|[x, y, z]| (x * x + y * y + z * z).sqrt());
    let (sum, top) = speeds.fold((0.0, 0.0_f32), |(sum, top), speed| (sum + speed, top.max(speed)));
    (sum / curves.velocities.len().max(1) as f32, top)
}
