//! A vector over time.

use nalgebra::Vector3;

/// A vector over time: constant, or keys interpolated smoothly.
#[derive(Debug, Clone, PartialEq)]
pub struct Keyed {
    /// Times of the keys, s, increasing; one key is a constant.
    pub times: Vec<f64>,
    /// Values at the keys.
    pub values: Vec<Vector3<f64>>,
}

impl Keyed {
    /// A vector that does not change.
    pub fn constant(value: Vector3<f64>) -> Self {
        Keyed { times: vec![0.0], values: vec![value] }
    }
}
