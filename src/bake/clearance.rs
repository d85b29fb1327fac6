//! What each point of a guide keeps from each body.
//!
//! A strand grows out of the head, so its first stretch is in the head or on it, and production grooms have more of it
//! inside, or drawn through an ear. The rule, body by body, with g the signed distance in the groom's pose and d the body's
//! thickness:
//!
//! - outside (g > 0): keep min(d, g/2), g being the least along the segments beside the point: what was drawn closer
//!   than d stays as close, with room to give;
//! - inside, before the strand has come out for the first time: exempt for good;
//! - a segment drawn through the body with both ends outside: exempt for good, for it has no side;
//! - inside later on: brought out to d during the pre-roll, gently; what cannot be is exempt from then on.

use crate::contact::{Bodies, Contact, Motion, Polyline, Workspace};
use nalgebra::{Isometry3, Vector3};
use serde::{Deserialize, Serialize};

/// How far the groom's pose is searched for a body, m; what lies deeper inside is taken to lie this deep.
const SEARCH: f64 = 0.3;

/// Distances that the points of one guide keep from the bodies.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct Clearance {
    /// At body b and point k, at `b * points + k`, m: in the groom's pose, and once all has been brought out.
    from: Vec<f64>,
    to: Vec<f64>,
}

impl Clearance {
    /// The rule applied to the points `x` (m, world), with the bodies as they are at time `t`, s, at `pose` (rest space to world),
    /// and `thickness`, m.
    pub fn new(
        bodies: &Bodies,
        t: f64,
        pose: &[Isometry3<f64>],
        thickness: &[f64],
        x: &[Vector3<f64>],
    ) -> Self {
        let mut goal = Vec::new();
        let mut depth = Vec::new();
        for (b, (pose, &d)) in pose.iter().zip(thickness).enumerate() {
            let mut rooted = true;
            for p in x {
                let local = pose.inverse_transform_point(&(*p).into()).coords;
                // The winding number, not the nearest triangle's side: it holds on open and dirty meshes.
                let far = bodies.closest(b, t, &local, SEARCH).map_or(SEARCH, |s| s.distance.abs());
                let inside = bodies.inside(b, t, &local);
                rooted &= inside;
                goal.push(match (inside, rooted) {
                    (false, _) => d.min(0.5 * far),
                    (true, true) => f64::NEG_INFINITY,
                    (true, false) => d,
                });
                depth.push(if inside { far } else { 0.0 });
            }
        }
        let mut clearance = Clearance { from: goal.clone(), to: goal };
        for c in clearance.at_rest(bodies, t, pose, thickness, x, &depth) {
            let beside = c.body * x.len() + c.segment..c.body * x.len() + c.segment + 2;
            for i in beside.clone() {
                if beside.clone().any(|j| depth[j] > 0.0) {
                    continue;
                }
                let keep = if c.gap > 0.0 { clearance.to[i].min(0.5 * c.gap) } else { f64::NEG_INFINITY };
                (clearance.from[i], clearance.to[i]) = (keep, keep);
            }
        }
        for (from, depth) in clearance.from.iter_mut().zip(depth) {
            if depth > 0.0 && from.is_finite() {
                *from = -depth;
            }
        }
        clearance
    }

    /// Distances (as the contacts' gaps) in the groom's pose, wherever they are below twice the thickness.
    fn at_rest(
        &self,
        bodies: &Bodies,
        t: f64,
        pose: &[Isometry3<f64>],
        thickness: &[f64],
        x: &[Vector3<f64>],
        depth: &[f64],
    ) -> Vec<Contact> {
        let motions: Vec<Motion> =
            pose.iter().map(|p| Motion { times: [t, t], start: *p, end: *p }).collect();
        let touching: Vec<f64> =
            depth.iter().map(|d| if *d > 0.0 { f64::NEG_INFINITY } else { 0.0 }).collect();
        let line = Polyline { x0: x, x1: x, clearance: &touching };
        let reach = 2.0 * thickness.iter().copied().fold(0.0, f64::max);
        let mut found = Vec::new();
        bodies.candidates(&motions, &line, reach, &mut Workspace::default(), &mut found);
        found
    }

    /// Clearances when `share` (0..=1) of the way out has been gone.
    pub fn at(&self, share: f64, out: &mut Vec<f64>) {
        out.clear();
        out.extend(
            self.from.iter().zip(&self.to).map(|(a, b)| if a == b { *a } else { a + share * (b - a) }),
        );
    }

    /// Number of distances.
    pub(super) fn len(&self) -> usize {
        self.to.len()
    }

    /// Points that are exempt, and points that are being brought out.
    pub fn counts(&self) -> (usize, usize) {
        let exempt = self.to.iter().filter(|d| **d == f64::NEG_INFINITY).count();
        (exempt, self.from.iter().zip(&self.to).filter(|(a, b)| a != b).count())
    }

    /// Ends the way out: points of the segments in `stuck` (body, segment) that were to be brought out are exempt from now on,
    /// all others have arrived. `points` is the number of points of the guide.
    pub fn arrive(&mut self, stuck: &[(usize, usize)], points: usize) {
        for &(body, segment) in stuck {
            for i in body * points + segment..body * points + segment + 2 {
                if self.from[i] != self.to[i] {
                    self.to[i] = f64::NEG_INFINITY;
                }
            }
        }
        self.from.clone_from(&self.to);
    }
}
