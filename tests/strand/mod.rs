//! The strand that tests of contact start from.

use hairbake::rod::{Cut, Rod, RodSource};
use hairbake::scene::Tree;
use nalgebra::Vector3;

/// A straight horizontal hair of 20 cm, clamped at the origin.
pub fn hair() -> Rod {
    Rod::new(&RodSource {
        points: &[Vector3::zeros(), Vector3::x() * 0.2],
        root_frame: None,
        arc: &Tree::default_arc(8),
        stiffness: [7.8e-9, 7.8e-9, 3.6e-9],
        line_density: 6.6e-6,
        damping: 0.005,
        natural: None,
        cut: Cut::FINE,
    })
    .unwrap()
}
