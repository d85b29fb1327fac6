//! Pops: places where a track jumps as no head can move.
//!
//! A jump is told from fast motion by its surroundings as much as by its size: a runner's head moves 0.25 m
//! in a frame, but as far in the frames around it.

use nalgebra::Isometry3;

/// Largest change of velocity of a head, m/s², with room to spare: a violent shake or a landing.
const MAX_ACCELERATION: f64 = 80.0;
/// The same for rotation, rad/s².
const MAX_ANGULAR_ACCELERATION: f64 = 400.0;
/// Noise of a tracker, m: jumps below it are left to the filter.
const NOISE: f64 = 0.03;
/// The same for rotation, rad.
const ANGULAR_NOISE: f64 = 0.26;
/// How many times as far as the motion around it a sample must jump.
const CONTRAST: f64 = 3.0;

/// A jump in a track.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pop {
    /// Sample that is far from where its neighbours put it, or the first after a jump.
    pub sample: usize,
    /// Whether the sample alone is off (its neighbours agree); otherwise the track goes on from there.
    pub alone: bool,
    /// Whether `size`, `limit` and `around` are angles in rad; otherwise they are lengths in m.
    pub angular: bool,
    /// How far it jumps.
    pub size: f64,
    /// How far it may.
    pub limit: f64,
    /// How far the samples around it move at most in one step.
    pub around: f64,
}

/// The pops in poses sampled at `rate`, 1/s; at most one a sample.
pub fn find_pops(poses: &[Isometry3<f64>], rate: f64) -> Vec<Pop> {
    let step2 = 1.0 / (rate * rate);
    let distance = |i: usize, j: usize| (poses[i].translation.vector - poses[j].translation.vector).norm();
    let angle = |i: usize, j: usize| poses[i].rotation.angle_to(&poses[j].rotation);
    let limit = NOISE.max(MAX_ACCELERATION * step2);
    let angular_limit = ANGULAR_NOISE.max(MAX_ANGULAR_ACCELERATION * step2);
    let at = |sample: usize| {
        jump(poses.len(), sample, limit, &distance)
            .map(|pop| Pop { angular: false, ..pop })
            .or_else(|| jump(poses.len(), sample, angular_limit, &angle))
    };
    (1..poses.len()).filter_map(at).collect()
}

/// The pop at sample `i` of `n` by a measure of distance between two samples.
fn jump(n: usize, i: usize, limit: f64, distance: &impl Fn(usize, usize) -> f64) -> Option<Pop> {
    let size = distance(i - 1, i);
    // Steps around, those to sample i left out.
    let before = if i >= 2 { distance(i - 2, i - 1) } else { 0.0 };
    let mut around = before;
    let mut alone = false;
    if i + 1 < n {
        let back = distance(i, i + 1);
        // The neighbours are two steps apart.
        let across = distance(i - 1, i + 1) / 2.0;
        alone = back.min(size) > CONTRAST * across;
        around = around.max(if alone { across } else { back });
        if alone && i + 2 < n {
            around = around.max(distance(i + 1, i + 2));
        }
    }
    // With nothing on one side a jump cannot be told from a start.
    let surrounded = n > 2;
    (surrounded && size > limit && size > CONTRAST * around).then_some(Pop {
        sample: i,
        alone,
        angular: true,
        size,
        limit,
        around,
    })
}
