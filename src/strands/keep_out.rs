//! Keeping render strands out of the bodies that their guides are kept out of.
//!
//! A strand repeats what its guides deviate, from a root of its own and with a shape of its own, so it may run into a body that
//! its guides clear. Edge by edge from the root, an edge whose end would come too close is turned, about its start, until
//! it does not; what follows is turned with it. Lengths stay exact.

use crate::contact::Bodies;
use crate::math::frame::transport;
use nalgebra::{Isometry3, Matrix3, Vector3};

/// How far a search for a surface reaches beyond the next edge, m.
const REACH: f64 = 0.02;

/// Turns of one edge, at most: the surface turns away under it as it goes.
const TURNS: usize = 4;

/// The bodies at one moment.
#[derive(Debug, Clone, Copy)]
pub struct KeepOut<'a> {
    /// The bodies, prepared for `time`.
    pub bodies: &'a Bodies,
    /// The moment, s.
    pub time: f64,
    /// Rest space to world, one per body.
    pub poses: &'a [Isometry3<f64>],
}

/// Distances that one strand keeps, at body b and vertex k at `b * vertices + k`, m: as the groom was drawn, but no more than the
/// body's thickness. −∞ along the first stretch where that is drawn inside; deeper down negative where it is drawn inside.
#[derive(Debug, Clone)]
pub(super) struct Kept(Vec<f32>);

impl Kept {
    /// For a strand drawn at `points` (m, rest space of bodies at their rest, which are not prepared for any step).
    pub fn new(bodies: &Bodies, thickness: &[f64], points: &[Vector3<f64>]) -> Self {
        let mut kept = Vec::with_capacity(bodies.len() * points.len());
        for (b, &d) in thickness.iter().enumerate() {
            let mut rooted = true;
            for p in points {
                let far = REACH.max(2.0 * d);
                let g = bodies.closest(b, 0.0, p, far).map_or(far, |s| s.distance);
                rooted &= g <= 0.0;
                let keep = if rooted {
                    f64::NEG_INFINITY
                } else if g > 0.0 {
                    d.min(0.5 * g)
                } else {
                    g
                };
                kept.push(keep as f32);
            }
        }
        Kept(kept)
    }
}

impl KeepOut<'_> {
    /// Turns the edge from `x` of `length`, whose frame is `frame`, out of the bodies; `vertex` of `vertices` is its end. `spare`
    /// holds, per body, how far the edge's start is at least from wherever it has to stay out. Whether it was turned.
    pub(super) fn turn(
        &self,
        kept: &Kept,
        (vertex, vertices): (usize, usize),
        x: &Vector3<f64>,
        length: f64,
        frame: &mut Matrix3<f64>,
        spare: &mut [f64],
    ) -> bool {
        let mut turned = false;
        for (b, pose) in self.poses.iter().enumerate() {
            let keep = f64::from(kept.0[b * vertices + vertex]);
            spare[b] -= length;
            if keep == f64::NEG_INFINITY || spare[b] > 0.0 {
                continue;
            }
            let horizon = length + REACH;
            for _ in 0..TURNS {
                let end = x + frame.column(2) * length;
                let local = pose.inverse_transform_point(&end.into()).coords;
                let Some(surface) = self.bodies.closest(b, self.time, &local, horizon) else {
                    spare[b] = horizon - keep.max(0.0);
                    break;
                };
                spare[b] = surface.distance - keep;
                if spare[b] >= 0.0 {
                    break;
                }
                let wanted = end - pose.rotation * surface.normal * spare[b] - x;
                let Some(direction) = wanted.try_normalize(1e-12) else { break };
                *frame = transport(&frame.column(2).into(), &direction) * *frame;
                turned = true;
            }
        }
        turned
    }
}
