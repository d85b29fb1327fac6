//! The projected chain: edges laid along targets, each rotated until its end is outside of all bodies.

use super::clearances::DistanceBounds;
use super::obstacles::{Keep, Obstacles, Violation};
use nalgebra::Vector3;

/// Largest number of rotations of one edge: a curved surface recedes as the edge rotates.
const MAX_ROTATIONS: usize = 10;

/// Excess of a rotation over the violation, m, against rounding.
const MARGIN: f64 = 1e-6;

/// Largest component of an edge across its direction that leads to its target, as a fraction of its length.
const MAX_APPROACH: f64 = 0.5;

/// The next edge of the chain.
pub(super) struct NextEdge {
    /// Index of the vertex at its end.
    pub vertex: usize,
    /// Length, m.
    pub length: f64,
    /// Unit direction of the targets, or zero.
    pub direction: Vector3<f64>,
    /// Target of its start, m, world.
    pub target: Vector3<f64>,
}

/// The chain up to its last vertex.
#[derive(Debug)]
pub(super) struct ProjectedChain {
    /// Position of that vertex, m, world.
    pub end: Vector3<f64>,
}

impl ProjectedChain {
    /// Appends an edge. It follows its direction and approaches its target, and is then rotated about its
    /// start until its end keeps its clearances. Only the edge itself is rotated: if what follows were
    /// rotated with it, a small push near the root would fling the tip. Returns the remaining violation, m.
    /// No search is needed where `is_clear` holds for the end.
    pub fn append(
        &mut self,
        obstacles: &Obstacles,
        keep: &Keep,
        edge: &NextEdge,
        is_clear: impl Fn(&Vector3<f64>) -> bool,
        bounds: &mut DistanceBounds,
    ) -> f64 {
        let NextEdge { vertex, length, direction: way, target } = edge;
        let offset = target - self.end;
        // Across the direction only: the chain may be ahead of its target or behind it.
        let approach = (offset - way * way.dot(&offset)).cap_magnitude(MAX_APPROACH * length);
        let direction = (way * *length + approach).try_normalize(1e-12).unwrap_or(*way);
        let end = self.end + direction * *length;
        if is_clear(&end) {
            self.end = end;
            bounds.forget();
            return 0.0;
        }
        let (direction, violation) =
            rotate_out(obstacles, keep, (*vertex, &self.end, *length), direction, bounds);
        self.end += direction * *length;
        violation
    }
}

/// Rotates an edge (vertex at its end, start, length) from `direction` until its end keeps its clearances, or
/// as far as possible. Returns the new direction and the remaining violation, m.
fn rotate_out(
    obstacles: &Obstacles,
    keep: &Keep,
    (vertex, x, length): (usize, &Vector3<f64>, f64),
    mut direction: Vector3<f64>,
    bounds: &mut DistanceBounds,
) -> (Vector3<f64>, f64) {
    // Between two surfaces no direction may suffice: the best one counts.
    let mut best = (f64::INFINITY, direction);
    let mut end = *x;
    for _ in 0..MAX_ROTATIONS {
        let next = x + direction * length;
        let Violation { depth: violation, normal, .. } =
            obstacles.violation(keep, vertex, &next, (next - end).norm(), bounds);
        end = next;
        if violation < best.0 {
            best = (violation, direction);
        }
        if violation == 0.0 {
            break;
        }
        let Some(rotated) = raise(&direction, &normal, (violation + MARGIN) / length) else { break };
        direction = rotated;
    }
    bounds.move_by((x + best.1 * length - end).norm());
    (best.1, best.0)
}

/// The unit vector `direction` rotated towards the unit vector `normal` until its component along it has
/// grown by `more`, or to `normal`. The end of an edge then clears a flat surface, and is no closer to one
/// that curves away.
fn raise(direction: &Vector3<f64>, normal: &Vector3<f64>, more: f64) -> Option<Vector3<f64>> {
    let height = direction.dot(normal);
    let along = (direction - normal * height).try_normalize(1e-12)?;
    let height = (height + more).min(1.0);
    Some(normal * height + along * (1.0 - height * height).sqrt())
}
