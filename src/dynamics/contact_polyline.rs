//! The polyline in which a guide meets bodies: the points of its rod, and the midpoints of the curve between
//! them.

use nalgebra::Vector3;

/// Segment of the rod and place on it (0..=1) of the place `u` (0..=1) on half segment `half`.
pub(super) fn on_rod(half: usize, u: f64) -> (usize, f64) {
    (half / 2, 0.5 * ((half % 2) as f64 + u))
}

/// Sets `polyline`, m, to the points `x` and, between any two, the midpoint of the cubic with the tangents
/// `t` there; `arc` holds the arc length of each point, m. Midpoints move as
/// [`blend_points`](crate::rod::RodShape::blend_points) at ½.
pub(super) fn with_midpoints(
    arc: &[f64],
    x: impl Fn(usize) -> Vector3<f64>,
    t: impl Fn(usize) -> Vector3<f64>,
    polyline: &mut Vec<Vector3<f64>>,
) {
    polyline.clear();
    polyline.push(x(0));
    for (k, s) in arc.windows(2).enumerate() {
        let next = x(k + 1);
        polyline.push(0.5 * (polyline[2 * k] + next) + (t(k) - t(k + 1)) * (0.125 * (s[1] - s[0])));
        polyline.push(next);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rod::{Rod, RodShape};

    #[test]
    fn polyline_places_are_blended_rod_points() {
        let (rod, q) = Rod::bent_sample();
        let (mut shape, mut line) = (RodShape::default(), Vec::new());
        assert!(shape.update(&rod, &rod.root.r, &q));
        with_midpoints(&rod.arc, |k| shape.x(k), |k| shape.tangent(k), &mut line);
        assert_eq!(line.len(), 2 * rod.points() - 1);
        for half in 0..line.len() - 1 {
            for u in [0.0, 0.3, 1.0] {
                let (k, s) = on_rod(half, u);
                let off = shape.curve_point(&rod, k, s) - line[half].lerp(&line[half + 1], u);
                assert!(off.norm() < 1e-15, "{half} {u}: {off}");
            }
        }
    }
}
