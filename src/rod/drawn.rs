//! The drawn curve as the natural shape of a rod: exponents and strains of its segments.

use super::segment::GAUSS;
use crate::math::frame::double_reflection;
use crate::math::se3::{self, Pose, Twist};
use crate::math::spline::ArcSpline;
use nalgebra::{Matrix3, Vector3};

/// One segment of the drawn curve.
pub(super) struct DrawnSegment {
    /// log of the pose change over the segment, in the frame at its start.
    pub exponent: Twist,
    /// Strain at the Gauss points in a twist-free frame, 1/m.
    pub strain: [Vector3<f64>; 2],
}

impl DrawnSegment {
    /// Measures the curve over [a, a + h] (arc length, m) and transports `frame` along it without twist.
    pub fn new(spline: &ArcSpline, frame: &mut Matrix3<f64>, a: f64, h: f64) -> Self {
        let start = Pose { r: *frame, p: spline.at(a).x };
        let mut strain = [Vector3::zeros(); 2];
        let mut at = a;
        let mut advance = |to: f64, frame: &mut Matrix3<f64>| {
            // Two short reflections: the error of the transport is of fourth order in their length.
            for i in 1..=2 {
                let (from, next) = (spline.at(at), spline.at(at + (to - at) * i as f64 / 2.0));
                *frame = double_reflection(frame, &from, &next);
            }
            at = to;
            spline.at(to).curvature
        };
        for (g, w) in GAUSS.iter().zip(&mut strain) {
            // d3' = κ2 d1 − κ1 d2.
            let bend = advance(a + g * h, frame);
            *w = Vector3::new(-bend.dot(&frame.column(1)), bend.dot(&frame.column(0)), 0.0);
        }
        advance(a + h, frame);
        let end = Pose { r: *frame, p: spline.at(a + h).x };
        DrawnSegment { exponent: se3::log(&start.inverse().compose(&end)), strain }
    }
}

/// Upper estimate of the rotation of the natural shape over arc lengths [a, b], rad: the largest curvature at
/// samples (at least two per drawn edge), or `natural` (1/m) where that is larger, times the length.
pub(super) fn max_turn(spline: &ArcSpline, natural: f64, a: f64, b: f64) -> f64 {
    let drawn = spline.arc().partition_point(|s| *s < b) - spline.arc().partition_point(|s| *s <= a);
    let samples = 2 * (drawn + 1).max(4);
    (0..=samples)
        .map(|i| spline.at(a + (b - a) * i as f64 / samples as f64).curvature.norm())
        .fold(natural, f64::max)
        * (b - a)
}
