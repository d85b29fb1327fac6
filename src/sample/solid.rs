//! Solids given by their signed distance, m: negative inside. Distances are exact for spheres and of first
//! order near the surface for the rest. Unions and differences have the fillets of a polynomial smooth
//! minimum (Quilez 2013), which changes nothing farther from the edge than the width of the fillet.

use nalgebra::{Rotation3, Vector3};

type V = Vector3<f64>;

/// Step of the differences that give a gradient, m.
const STEP: f64 = 1e-5;

/// Least slope of a distance: where it is less, as on the middle of a thin solid, heights are not
/// extrapolated.
const LEAST_STEEPNESS: f64 = 0.5;

/// Distance to a sphere.
pub(super) fn sphere(x: V, centre: [f64; 3], radius: f64) -> f64 {
    (x - V::from(centre)).norm() - radius
}

/// Distance to an ellipsoid with axes along those of space.
pub(super) fn ellipsoid(x: V, centre: [f64; 3], radii: [f64; 3]) -> f64 {
    let (from, radii) = (x - V::from(centre), V::from(radii));
    let scaled = from.component_div(&radii);
    let slope = scaled.component_div(&radii).norm();
    if slope < 1e-9 { -radii.min() } else { scaled.norm() * (scaled.norm() - 1.0) / slope }
}

/// Distance to a limb: a cone with round ends, with the radii `radii` at `ends`.
pub(super) fn limb(x: V, ends: [[f64; 3]; 2], radii: [f64; 2]) -> f64 {
    let [from, to] = ends.map(V::from);
    let axis = to - from;
    let u = ((x - from).dot(&axis) / axis.norm_squared()).clamp(0.0, 1.0);
    (x - from - axis * u).norm() - (radii[0] + (radii[1] - radii[0]) * u)
}

/// Distance to a line between `ends`.
pub(super) fn line(x: V, ends: [[f64; 3]; 2]) -> f64 {
    limb(x, ends, [0.0; 2])
}

/// A solid with a smooth groove of the depth `depth`, m, within `width`, m, of a line of its surface from
/// which `x` is `from`: without edges or undercuts, which a mesh would tear.
pub(super) fn dented(solid: f64, from: f64, width: f64, depth: f64) -> f64 {
    let beside = 1.0 - (from / width).min(1.0).powi(2);
    solid + depth * beside * beside
}

/// Union of two solids, with a fillet of the width `fillet`, m.
pub(super) fn union(a: f64, b: f64, fillet: f64) -> f64 {
    let h = (0.5 + 0.5 * (b - a) / fillet).clamp(0.0, 1.0);
    b + (a - b) * h - fillet * h * (1.0 - h)
}

/// The solid `a` without the solid `b`, with edges rounded over the width `fillet`, m.
pub(super) fn difference(a: f64, b: f64, fillet: f64) -> f64 {
    -union(-a, b, fillet)
}

/// `x` as seen by a solid that is turned about `pivot` by a rotation vector, rad.
pub(super) fn turned(x: V, pivot: [f64; 3], by: [f64; 3]) -> V {
    let pivot = V::from(pivot);
    pivot + Rotation3::new(V::from(by)).inverse() * (x - pivot)
}

/// Height of `x` above the surface of a solid, m, to first order, and the outward unit normal. The gradient
/// is that of four distances at the corners of a tetrahedron.
pub(super) fn height(solid: impl Fn(V) -> f64, x: V) -> (f64, V) {
    const CORNERS: [[f64; 3]; 4] = [[1.0, -1.0, -1.0], [-1.0, -1.0, 1.0], [-1.0, 1.0, -1.0], [1.0, 1.0, 1.0]];
    let (mut sum, mut mean) = (V::zeros(), 0.0);
    for corner in CORNERS.map(V::from) {
        let distance = solid(x + corner * STEP);
        sum += corner * distance;
        mean += 0.25 * distance;
    }
    let gradient = sum / (4.0 * STEP);
    let steepness = gradient.norm();
    (mean / steepness.max(LEAST_STEEPNESS), gradient / steepness.max(f64::MIN_POSITIVE))
}
