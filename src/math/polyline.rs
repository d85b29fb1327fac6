//! Segments and polylines.

use nalgebra::Vector3;

/// Length of the polyline through `points`, m.
pub fn length(points: &[Vector3<f64>]) -> f64 {
    points.windows(2).map(|w| (w[1] - w[0]).norm()).sum()
}

/// Parameter, 0..=1, of the point of segment `ab` closest to `p`; 0 for a segment of zero length.
pub fn closest_on_segment(p: &Vector3<f64>, a: &Vector3<f64>, b: &Vector3<f64>) -> f64 {
    let d = b - a;
    let len2 = d.norm_squared();
    if len2 > 0.0 { ((p - a).dot(&d) / len2).clamp(0.0, 1.0) } else { 0.0 }
}

/// Distance of `p` from the polyline through `points`, m; infinite for fewer than two points.
pub fn distance(p: &Vector3<f64>, points: &[Vector3<f64>]) -> f64 {
    let to_segment =
        |ab: &[Vector3<f64>]| (p - ab[0].lerp(&ab[1], closest_on_segment(p, &ab[0], &ab[1]))).norm();
    points.windows(2).map(to_segment).fold(f64::INFINITY, f64::min)
}
