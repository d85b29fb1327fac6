//! What distances bodies leave room for (`docs/theory.md` §5.1).
//!
//! Bodies of an animation close on hair and overlap where it is: a head nods into its neck, shoulders press
//! into the ground. No place then keeps its distance from both.
//!
//! - Between opposite surfaces, at signed distances g₁ and g₂ of a place, the room is g₁ + g₂, wherever
//!   between them the place is. What it lacks of the distances that hair keeps is taken from both in equal
//!   parts. Hair lies in the middle of an overlap, and as the bodies part it moves at half their speed.
//! - A root moves with its skin, and may be carried into another body. The hair then leaves that body along a
//!   curve of least radius.
//!
//! Both depend only on where the bodies are, and continuously so: nothing snaps when a body closes or opens.

use crate::math::smoothstep;
use nalgebra::Vector3;

/// Cosine of the angle between two outward normals, negated: surfaces that hair can leave sideways, as in a
/// groove, up to the first, and opposite surfaces from the second.
const OPPOSITE: [f64; 2] = [0.5, 0.87];

/// Room beyond the distances that hair keeps, m: facets and chords between the places that are looked at.
pub const PLAY: f64 = 1e-4;

/// Distance between opposite surfaces, m, below which what is written of hair counts as pinched: points lie a
/// step of the strand apart.
pub const ROOM: f64 = 2e-3;

/// Depth of what is written of hair, m, from which it is looked at.
pub const MIN_DEPTH: f64 = 1e-4;

/// Cosine of the angle between two outward normals, negated, above which surfaces face each other.
pub const FACING: f64 = OPPOSITE[0];

/// Least radius in which a hair turns away from a body that has swallowed its root, m.
const RADIUS: f64 = 0.01;

/// Sine of the angle to the surface at which it then leaves.
const RISE: f64 = 0.5;

/// Least share of a unit normal across the strand that counts as a direction: what is pressed on its tip has
/// none.
const ACROSS: f64 = 0.3;

/// Cosine of the angle between two unit `normals`, or between them as seen along a strand in the direction
/// `along`, of any length, whichever is less: a strand that runs out of a groove cannot leave it that way.
pub fn cosine(along: &Vector3<f64>, normals: [&Vector3<f64>; 2]) -> f64 {
    let t = along.try_normalize(0.0).unwrap_or_default();
    let [a, b] = normals.map(|n| n - t * n.dot(&t));
    let across = a.dot(&b) / (a.norm().max(ACROSS) * b.norm().max(ACROSS));
    across.min(normals[0].dot(normals[1]))
}

/// What each of two surfaces yields of the distances to `keep` from them, m, ≥ 0, at a place with these
/// signed distances, m. `cosine` is that of the angle between their outward normals ([`cosine`]).
pub fn yielded(keep: [f64; 2], distance: [f64; 2], cosine: f64) -> f64 {
    let lack = keep[0] + keep[1] + PLAY - distance[0] - distance[1];
    0.5 * lack.max(0.0) * smoothstep(OPPOSITE, -cosine)
}

/// Distance from a body, m, that a hair need not fall below at the arc length `s`, m, from a root at the
/// signed distance `root`, m. `sine` is that of the angle between the surface there and the hair at its root.
pub fn leaving(root: f64, sine: f64, s: f64) -> f64 {
    let turn = (RADIUS * (RISE - sine)).max(0.0);
    let curved = s.min(turn);
    root + sine.min(RISE) * curved + 0.5 * curved * curved / RADIUS + RISE * (s - curved)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn opposite_surfaces_yield_what_the_room_lacks() {
        let keep = [5e-4, 3e-4 - PLAY];
        // A gap of 2 mm, of 0.4 mm, and an overlap of 1 cm.
        for (room, each) in [(2e-3, 0.0), (4e-4, 2e-4), (-0.01, 5.4e-3)] {
            for at in [0.0, 0.3, 1.0] {
                let found = yielded(keep, [at * room, (1.0 - at) * room], -1.0);
                assert!((found - each).abs() < 1e-12, "{room} {at}: {found}");
            }
        }
        // A place in both of two bodies that face the same way has a way out.
        assert_eq!(yielded(keep, [-0.01, -0.01], 0.3), 0.0);
    }

    #[test]
    fn a_strand_does_not_leave_a_groove_that_it_runs_out_of() {
        let (a, b) = (Vector3::new(0.8, 0.6, 0.0), Vector3::new(0.8, -0.6, 0.0));
        let of = |along: Vector3<f64>| cosine(&along, [&a, &b]);
        // Out of the groove between the two, in it, and in no direction.
        assert!((of(Vector3::x() * 3.0) + 1.0).abs() < 1e-12);
        assert!((of(Vector3::z()) - 0.28).abs() < 1e-12);
        assert_eq!(of(Vector3::zeros()), a.dot(&b));
        // From one surface to the other, which has no direction across it.
        assert_eq!(cosine(&Vector3::x(), [&Vector3::x(), &-Vector3::x()]), -1.0);
        // Pressed on its tip, it has next to none.
        let end_on = [Vector3::new(0.999, 0.045, 0.0), Vector3::new(0.999, -0.045, 0.0)];
        assert!(cosine(&Vector3::x(), [&end_on[0], &end_on[1]]) > -0.03);
    }

    #[test]
    fn a_hair_leaves_a_body_in_a_curve_without_kinks() {
        for (root, sine) in [(-0.007, -1.0), (-0.007, 0.1), (0.003, -0.4), (-0.001, 0.9)] {
            let h = 1e-6;
            let slope = |s: f64| (leaving(root, sine, s + h) - leaving(root, sine, s)) / h;
            assert_eq!(leaving(root, sine, 0.0), root);
            assert!((slope(0.0) - sine.min(RISE)).abs() < 1e-3);
            assert!((slope(0.1) - RISE).abs() < 1e-6);
            for k in 0..100 {
                let s = 4e-4 * f64::from(k);
                let turn = (slope(s + 4e-4) - slope(s)) / 4e-4;
                assert!((-1e-3..1.001 / RADIUS).contains(&turn), "{root} {sine} {s}: {turn}");
            }
        }
    }
}
