//! What each point of a guide keeps from each body.
//!
//! A strand grows out of the head, so its first stretch is in the head or on it, and production grooms have more of it
//! inside. The rule, body by body, with g the signed distance of a point in the groom's pose and d the body's thickness:
//!
//! - outside (g > 0): keep min(d, g/2): what lies closer than d stays as close, with room to give;
//! - inside, before the strand has come out for the first time: exempt for good;
//! - inside later on: brought out to d during the pre-roll, gently.

use crate::contact::Bodies;
use nalgebra::{Isometry3, Vector3};

/// How far the groom's pose is searched for a body, m; what lies deeper inside is taken to lie this deep.
const SEARCH: f64 = 0.3;

/// Distances that the points of one guide keep from the bodies.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Clearance {
    /// At body b and point k, at `b * points + k`, m: in the groom's pose, and once all has been brought out.
    from: Vec<f64>,
    to: Vec<f64>,
}

impl Clearance {
    /// The rule applied to the points `x` (m, world), with the bodies at `pose` (rest space to world) and `thickness`, m.
    pub fn new(bodies: &Bodies, pose: &[Isometry3<f64>], thickness: &[f64], x: &[Vector3<f64>]) -> Self {
        let mut clearance = Clearance::default();
        for ((body, pose), &d) in bodies.bodies.iter().zip(pose).zip(thickness) {
            let mut rooted = true;
            for p in x {
                let local = pose.inverse_transform_point(&(*p).into()).coords;
                // The winding number, not the nearest triangle's side: it holds on open and dirty meshes.
                let far = body.shape.closest(&local, SEARCH).map_or(SEARCH, |s| s.distance.abs());
                let g = if body.shape.inside(&local) { -far } else { far };
                rooted &= g <= 0.0;
                let (from, to) = if g > 0.0 {
                    (d.min(0.5 * g), d.min(0.5 * g))
                } else if rooted {
                    (f64::NEG_INFINITY, f64::NEG_INFINITY)
                } else {
                    (g, d)
                };
                clearance.from.push(from);
                clearance.to.push(to);
            }
        }
        clearance
    }

    /// Clearances when `share` (0..=1) of the way out has been gone.
    pub fn at(&self, share: f64, out: &mut Vec<f64>) {
        out.clear();
        out.extend(self.from.iter().zip(&self.to).map(|(a, b)| if a == b { *a } else { a + share * (b - a) }));
    }

    /// Points that start exempt and points that are brought out: (rooted inside, overlapping).
    pub fn counts(&self) -> (usize, usize) {
        let rooted = self.from.iter().filter(|d| **d == f64::NEG_INFINITY).count();
        (rooted, self.from.iter().zip(&self.to).filter(|(a, b)| a != b).count())
    }
}
