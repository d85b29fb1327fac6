//! The strand that tests use.

use hairbake::rod::{Rod, RodSource, SegmentSize};
use hairbake::scene::Tree;
use nalgebra::Vector3;

/// A straight horizontal hair of `length`, m, clamped at the origin.
pub fn hair(length: f64, segment_size: SegmentSize) -> Rod {
    Rod::new(&RodSource {
        damping: 0.005,
        segment_size,
        ..RodSource::hair(&[Vector3::zeros(), Vector3::x() * length], &Tree::default_arc(8))
    })
    .unwrap()
}
