//! Points of the cache in single precision, and their bounds.

use nalgebra::Vector3;

/// Lowest and highest corner of the points, each padded by half its width.
pub(super) fn extent(points: &[[f32; 3]], widths: &[f32]) -> [[f32; 3]; 2] {
    let mut e = [[f32::INFINITY; 3], [f32::NEG_INFINITY; 3]];
    for (p, w) in points.iter().zip(widths) {
        for c in 0..3 {
            e[0][c] = e[0][c].min(p[c] - 0.5 * w);
            e[1][c] = e[1][c].max(p[c] + 0.5 * w);
        }
    }
    e
}

/// A point in single precision.
pub(super) fn single(v: &Vector3<f64>) -> [f32; 3] {
    v.cast::<f32>().into()
}
