//! Hair does not pass through hair that crosses it (`docs/theory.md` §5.3).

use super::grid::{Grid, Stencil};
use super::law::Assembly;
use super::{FRACTION, direction};
use nalgebra::Vector3;

/// Acceleration, m/s², by which hair that crosses a hair stops it, over χ³. Higher stops faster locks, and
/// stiffens hair whose strands are a little at angles, which then keeps apart. Locks that fall on each other at
/// a right angle (χ = 0.5) are stopped with 2500 m/s², strands that are 15° apart (χ = 0.017) with 0.1 m/s².
const STOPPING: f64 = 2e4;

/// Least χ that counts, for speed: the acceleration is a hundredth of gravity there.
const LEAST: f64 = 0.017;

/// Norm of the mean tangent of a piece below which it winds too tightly to have a direction.
const TIGHT: f64 = 0.1;

/// The part of the `slip`, m/s, of a piece of hair that is lost over a step whose η is `eta`, s, because it
/// leads into hair that crosses the piece. `tangent` is the piece's mean unit tangent, `hair` what is around it.
pub(super) fn stopped(
    (grid, stencil): (&Grid, &Stencil),
    hair: &Assembly,
    tangent: &Vector3<f64>,
    slip: &Vector3<f64>,
    eta: f64,
) -> Vector3<f64> {
    let straightness = tangent.norm();
    if straightness < TIGHT {
        return Vector3::zeros();
    }
    // Hair that winds as much as this has the direction t̄, not a unit one.
    let course = tangent / (straightness * straightness);
    let crossing = 1.0 - hair.direction.dot(&course);
    if crossing < LEAST {
        return Vector3::zeros();
    }
    let ahead = grid.gradient(stencil, |node| node[FRACTION] - direction(node).dot(&course));
    let across = ahead - course * tangent.dot(&ahead);
    let into = across.try_normalize(0.0).unwrap_or_default();
    into * slip.dot(&into).clamp(0.0, STOPPING * crossing.powi(3) * eta)
}
