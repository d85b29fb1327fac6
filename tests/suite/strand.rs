//! The strand that tests use.

use hairbake::rod::{Rod, RodSource, SegmentSize, Taper};
use hairbake::scene::Tree;
use nalgebra::Vector3;

/// A straight horizontal hair of `length`, m, clamped at the origin.
pub fn hair(length: f64, segment_size: SegmentSize) -> Rod {
    Rod::new(&RodSource {
        points: &[Vector3::zeros(), Vector3::x() * length],
        root_frame: None,
        arc: &Tree::default_arc(8),
        stiffness: [7.8e-9, 7.8e-9, 3.6e-9],
        line_density: 6.6e-6,
        damping: 0.005,
        taper: Taper::NONE,
        natural_strain: None,
        segment_size,
    })
    .unwrap()
}
