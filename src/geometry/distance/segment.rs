//! Closest points of two segments.

use nalgebra::Vector3;

/// Parameters (s, t), each in 0..=1, of the closest points of segments `p` and `q`.
///
/// The unconstrained minimiser of |p(s) − q(t)|² is clamped in s, then in t, and s is recomputed for that t;
/// this is exact for a convex quadratic on a square (Ericson 2005, §5.1.9). Parallel segments give one of
/// their closest pairs.
pub fn segment_segment(p: [&Vector3<f64>; 2], q: [&Vector3<f64>; 2]) -> (f64, f64) {
    let (d1, d2, r) = (p[1] - p[0], q[1] - q[0], p[0] - q[0]);
    let (a, b, e) = (d1.norm_squared(), d1.dot(&d2), d2.norm_squared());
    let (c, f) = (d1.dot(&r), d2.dot(&r));
    let det = a * e - b * b;
    // Below this the determinant is rounding: the segments are parallel, and any s is valid.
    let s = if det > 1e-14 * a * e { ((b * f - c * e) / det).clamp(0.0, 1.0) } else { 0.0 };
    let t = if e > 0.0 { ((b * s + f) / e).clamp(0.0, 1.0) } else { 0.0 };
    let s = if a > 0.0 { ((b * t - c) / a).clamp(0.0, 1.0) } else { 0.0 };
    (s, t)
}
