//! Deflections: how the edges of a strand in contact differ from those of its free chain.
//!
//! The deflection of an edge is the rotation that takes its free direction to the one in use, the shorter
//! way: a vector perpendicular to the edge at rest, in rest space, as long as the angle in radians. Seen
//! there it moves with the strand, so that deflections of several frames can be blended.

use nalgebra::Vector3;

/// Deflection of the edge that ends at a vertex; zero for a root.
pub type Deflection = [f32; 3];

/// Number of frames before and after a frame on whose deflections the settled ones depend.
pub(super) const FILTER_SPAN: usize = 1;

fn wide(by: &Deflection) -> Vector3<f64> {
    Vector3::from(by.map(f64::from))
}

/// The deflection from the edge `rest` to the direction of `to`, both in rest space.
pub(super) fn deflection(rest: &Vector3<f64>, to: &Vector3<f64>) -> Vector3<f64> {
    let Some(along) = rest.try_normalize(0.0) else { return Vector3::zeros() };
    let across = to - along * along.dot(to);
    let angle = across.norm().atan2(along.dot(to));
    across.try_normalize(1e-12).unwrap_or_default() * angle
}

/// The edge `rest` after a deflection that changes at `rate`, 1/s, and the edge's rate.
pub(super) fn deflected(rest: &Vector3<f64>, by: &Vector3<f64>, rate: &Vector3<f64>) -> [Vector3<f64>; 2] {
    let length = rest.norm();
    if length == 0.0 {
        return [Vector3::zeros(); 2];
    }
    let along = rest / length;
    let (square, growth) = (by.norm_squared(), by.dot(rate));
    let angle = square.sqrt();
    // sin(a) / a, and its derivative with respect to a, divided by a.
    let (sinc, slope) = if square < 1e-6 {
        (1.0 - square / 6.0, -1.0 / 3.0)
    } else {
        let sinc = angle.sin() / angle;
        (sinc, (angle.cos() - sinc) / square)
    };
    let edge = along * angle.cos() + by * sinc;
    let moved = rate * sinc + by * (slope * growth) - along * (sinc * growth);
    [edge * length, moved * length]
}

/// Weights of the frames around a frame in its filtered deflection.
const FILTER: [f64; 2 * FILTER_SPAN + 1] = [0.25, 0.5, 0.25];

/// Sets `out` to the deflections of one strand, filtered over the frames around a frame.
pub(super) fn filtered(raw: &[&[Deflection]; 2 * FILTER_SPAN + 1], out: &mut Vec<Vector3<f64>>) {
    let blend = |vertex: usize| {
        let frames = raw.iter().zip(FILTER);
        frames.map(|(frame, weight)| wide(&frame[vertex]) * weight).sum::<Vector3<f64>>()
    };
    out.clear();
    out.extend((0..raw[0].len()).map(blend));
}

/// The deflection at `u` (0..1) of the interval between the middle two of four frames, and its derivative per
/// interval (Catmull-Rom).
pub(super) fn between(frames: [Deflection; 4], u: f64) -> [Vector3<f64>; 2] {
    let [before, a, b, after] = frames.map(|by| wide(&by));
    let [slope_a, slope_b] = [(b - before) * 0.5, (after - a) * 0.5];
    let v = 1.0 - u;
    let value = a * (v * v * (1.0 + 2.0 * u)) + b * (u * u * (1.0 + 2.0 * v)) + slope_a * (u * v * v)
        - slope_b * (u * u * v);
    let rate = (b - a) * (6.0 * u * v) + slope_a * (v * (v - 2.0 * u)) + slope_b * (u * (u - 2.0 * v));
    [value, rate]
}
