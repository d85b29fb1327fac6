//! Pops: samples of a track that jump as no head can move.
//!
//! The test compares a jump with the motion around it, not only with an absolute limit: the head of a runner
//! moves 0.25 m per frame, but it moves as far in the neighbouring frames.

use nalgebra::Isometry3;

/// Largest change of velocity of a head, m/s², with a margin: a violent shake or a landing.
const MAX_ACCELERATION: f64 = 80.0;
/// Largest change of angular velocity of a head, rad/s², with a margin.
const MAX_ANGULAR_ACCELERATION: f64 = 400.0;
/// Noise of a tracker, m: the filter removes smaller jumps.
const NOISE: f64 = 0.03;
/// Angular noise of a tracker, rad.
const ANGULAR_NOISE: f64 = 0.26;
/// Smallest ratio of a jump to the motion around it.
const MIN_CONTRAST: f64 = 3.0;

/// A jump in a track.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pop {
    /// The sample that is off, or the first sample after a jump.
    pub sample: usize,
    /// True if only this sample is off (its neighbours agree); false if the track continues from it.
    pub isolated: bool,
    /// True if `size`, `limit` and `nearby` are angles, rad; false if they are lengths, m.
    pub angular: bool,
    /// Size of the jump.
    pub size: f64,
    /// Largest size allowed.
    pub limit: f64,
    /// Largest motion between two of the neighbouring samples.
    pub nearby: f64,
}

/// The pops in poses sampled at `rate`, 1/s; at most one per sample.
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

/// The pop at sample `i` of `n`, by a measure of the distance between two samples.
fn jump(n: usize, i: usize, limit: f64, distance: &impl Fn(usize, usize) -> f64) -> Option<Pop> {
    let size = distance(i - 1, i);
    // The neighbouring steps, without those to sample i.
    let before = if i >= 2 { distance(i - 2, i - 1) } else { 0.0 };
    let mut nearby = before;
    let mut isolated = false;
    if i + 1 < n {
        let back = distance(i, i + 1);
        // The neighbours are two steps apart.
        let across = distance(i - 1, i + 1) / 2.0;
        isolated = back.min(size) > MIN_CONTRAST * across;
        nearby = nearby.max(if isolated { across } else { back });
        if isolated && i + 2 < n {
            nearby = nearby.max(distance(i + 1, i + 2));
        }
    }
    // With samples on one side only, a jump looks like the start of a motion.
    let surrounded = n > 2;
    (surrounded && size > limit && size > MIN_CONTRAST * nearby).then_some(Pop {
        sample: i,
        isolated,
        angular: true,
        size,
        limit,
        nearby,
    })
}
