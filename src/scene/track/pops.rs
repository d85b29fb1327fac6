//! Pops: samples of a track that jump as no head can move.
//!
//! A head has inertia, so the velocities before and after a step between two samples account for the step: it
//! lies between the two. A jump is what they leave over, the distance of the step from the segment between
//! v⁻ h and v⁺ h, with v⁻ and v⁺ the mean velocities over a few steps on either side. It is a pop if it
//! exceeds what a head can do within a sample, the steps of a capture that holds its samples, and the jumps
//! around it: the track's own jitter.
//!
//! Two opposite jumps within [`MAX_RUN`] have the samples between them off. A jump next to an end of the
//! track has the samples up to that end off: a T-pose before the motion starts. Any other jump lasts.

use crate::math::polyline::closest_on_segment;
use nalgebra::{Isometry3, Vector3};
use std::ops::Range;

/// Largest change of velocity of a head, m/s², with a margin: a violent shake or a landing.
const MAX_ACCELERATION: f64 = 80.0;
/// Largest change of angular velocity of a head, rad/s², with a margin.
const MAX_ANGULAR_ACCELERATION: f64 = 400.0;
/// Noise of a tracker, m: the filter removes smaller jumps.
const NOISE: f64 = 0.03;
/// Angular noise of a tracker, rad.
const ANGULAR_NOISE: f64 = 0.26;
/// Lowest rate of a capture, 1/s. If its samples are held, the track moves in stairs of this rate; a velocity
/// is the mean over one stair.
const MIN_CAPTURE_RATE: f64 = 12.0;
/// Smallest ratio of a pop to the median jump within [`NEARBY`] of it.
const MIN_CONTRAST: f64 = 4.0;
/// Time to either side within which the jumps of the track itself are measured, s.
const NEARBY: f64 = 0.5;
/// Longest time for which samples may be off, s; at least one sample.
const MAX_RUN: f64 = 0.25;

/// A jump in a track.
#[derive(Debug, Clone, PartialEq)]
pub struct Pop {
    /// The samples that are off. Empty if the jump lasts; it then starts at the first sample after it.
    pub off: Range<usize>,
    /// True if `size`, `limit` and `nearby` are angles, rad; false if they are lengths, m.
    pub angular: bool,
    /// Size of the jump: the part of the step that the velocities around it do not account for.
    pub size: f64,
    /// Largest size allowed.
    pub limit: f64,
    /// Median jump of the samples around.
    pub nearby: f64,
}

impl Pop {
    /// The first sample that is off, or the first after a lasting jump.
    pub fn sample(&self) -> usize {
        self.off.start
    }

    /// True if the track continues from the jump; false if only some samples are off.
    pub fn lasts(&self) -> bool {
        self.off.is_empty()
    }
}

/// The pops in poses sampled at `rate`, 1/s, in the order of their samples.
pub fn find_pops(poses: &[Isometry3<f64>], rate: f64) -> Vec<Pop> {
    let steps = Steps::new(poses, rate);
    let jumps = steps.jumps();
    let max_run = ((MAX_RUN * rate).round() as usize).max(1);
    let mut pops = Vec::new();
    let mut k = 0;
    while let Some((at, jump)) = jumps.get(k) {
        let returns = jumps.get(k + 1).filter(|(next, back)| next - at <= max_run && jump.cancels(back));
        let off = match returns {
            Some((next, _)) => at + 1..next + 1,
            None => run_at_end(*at, poses.len(), max_run).unwrap_or(at + 1..at + 1),
        };
        k += if returns.is_some() { 2 } else { 1 };
        let Jump { size, limit, nearby, .. } = *jump;
        let angular = jump.angular();
        let k = usize::from(angular);
        pops.push(Pop { off, angular, size: size[k].norm(), limit: limit[k], nearby: nearby[k] });
    }
    pops.sort_by_key(Pop::sample);
    pops
}

/// The samples on the shorter side of a jump in step `at`, if that side is an end of the track of at most
/// `max_run` samples.
fn run_at_end(at: usize, samples: usize, max_run: usize) -> Option<Range<usize>> {
    let (before, after) = (at + 1, samples - at - 1);
    let is_short = |n: usize| n <= max_run && 2 * n < samples;
    match (is_short(before), is_short(after)) {
        (true, _) => Some(0..before),
        (_, true) => Some(before..samples),
        _ => None,
    }
}

/// The jump in one step. Each array has a translation, m, and a rotation, rad.
struct Jump {
    size: [Vector3<f64>; 2],
    /// Largest size allowed.
    limit: [f64; 2],
    /// Median size around.
    nearby: [f64; 2],
}

impl Jump {
    /// Size over the largest allowed, for translation and rotation.
    fn ratios(&self) -> [f64; 2] {
        [0, 1].map(|k| self.size[k].norm() / self.limit[k])
    }

    fn is_pop(&self) -> bool {
        self.ratios().iter().any(|ratio| *ratio > 1.0)
    }

    /// Whether the rotation is the part that jumps most.
    fn angular(&self) -> bool {
        let [translation, rotation] = self.ratios();
        rotation > translation
    }

    /// Whether the other jump undoes this one.
    fn cancels(&self, other: &Jump) -> bool {
        (0..2).all(|k| {
            let larger = self.size[k].norm().max(other.size[k].norm());
            let limit = self.limit[k].max(other.limit[k]);
            (self.size[k] + other.size[k]).norm() <= (0.5 * larger).max(limit)
        })
    }
}

/// The steps from sample to sample.
struct Steps {
    /// Translation, m, and rotation vector, rad, of each step.
    delta: Vec<[Vector3<f64>; 2]>,
    /// Steps that are pops: they tell nothing of the velocity.
    is_pop: Vec<bool>,
    /// What a head can do within a sample: m and rad.
    limit: [f64; 2],
    /// Most steps for which a capture holds a sample; a velocity is the mean over as many.
    hold: usize,
    /// Steps to either side with which a jump is compared.
    nearby: usize,
}

impl Steps {
    fn new(poses: &[Isometry3<f64>], rate: f64) -> Self {
        let delta: Vec<_> = poses
            .windows(2)
            .map(|pair| {
                let translation = pair[1].translation.vector - pair[0].translation.vector;
                [translation, (pair[1].rotation / pair[0].rotation).scaled_axis()]
            })
            .collect();
        Steps {
            is_pop: vec![false; delta.len()],
            delta,
            limit: [(NOISE, MAX_ACCELERATION), (ANGULAR_NOISE, MAX_ANGULAR_ACCELERATION)]
                .map(|(noise, acceleration)| noise.max(acceleration / (rate * rate))),
            hold: ((rate / MIN_CAPTURE_RATE).ceil() as usize).max(2),
            nearby: ((NEARBY * rate).round() as usize).max(2),
        }
    }

    /// The steps that are pops, in order. The largest is found first and is left out of the velocities of
    /// the others, which a pop nearby distorts.
    fn jumps(mut self) -> Vec<(usize, Jump)> {
        // With fewer steps there is no telling which of them is the motion.
        if self.delta.len() < 3 {
            return Vec::new();
        }
        let mut found = Vec::new();
        loop {
            let mut candidates: Vec<(usize, f64)> = (0..self.delta.len())
                .filter(|&i| !self.is_pop[i] && self.exceeds(i))
                .map(|i| (i, self.jump(i)))
                .filter(|(_, jump)| jump.is_pop())
                .map(|(i, jump)| (i, jump.ratios().into_iter().fold(0.0, f64::max)))
                .collect();
            candidates.sort_by(|a, b| b.1.total_cmp(&a.1).then(a.0.cmp(&b.0)));
            let before = found.len();
            for (i, _) in candidates {
                let jump = self.jump(i);
                if jump.is_pop() {
                    self.is_pop[i] = true;
                    found.push((i, jump));
                }
            }
            if found.len() == before {
                found.sort_by_key(|(i, _)| *i);
                return found;
            }
        }
    }

    /// The mean of up to [`Self::hold`] of these steps that are no pops and not `doubted`; `None` if there
    /// are none.
    fn velocity(
        &self,
        steps: impl Iterator<Item = usize>,
        doubted: &Range<usize>,
        k: usize,
    ) -> Option<Vector3<f64>> {
        let valid = steps.filter(|j| !doubted.contains(j) && !self.is_pop[*j]).take(self.hold);
        let valid: Vec<_> = valid.map(|j| self.delta[j][k]).collect();
        (!valid.is_empty()).then(|| valid.iter().sum::<Vector3<f64>>() / valid.len() as f64)
    }

    /// Jump of step `i` in translation (`k` = 0) or rotation (1), and how far a held sample moves on; both
    /// as if the `doubted` steps were not known.
    fn part(&self, i: usize, doubted: &Range<usize>, k: usize) -> (Vector3<f64>, f64) {
        let before = self.velocity((0..i).rev(), doubted, k);
        let after = self.velocity(i + 1..self.delta.len(), doubted, k);
        let (before, after) = match (before, after) {
            (Some(before), Some(after)) => (before, after),
            (Some(one), None) | (None, Some(one)) => (one, one),
            (None, None) => return (Vector3::zeros(), 0.0),
        };
        let step = self.delta[i][k];
        let size = step - before.lerp(&after, closest_on_segment(&step, &before, &after));
        let along = size.try_normalize(1e-12).unwrap_or_default();
        (size, (self.hold - 1) as f64 * before.dot(&along).max(after.dot(&along)).max(0.0))
    }

    /// Whether step `i` is more than a head, or a capture that holds its samples, can do.
    fn exceeds(&self, i: usize) -> bool {
        (0..2).any(|k| {
            let (size, held) = self.part(i, &(i..i), k);
            size.norm() > self.limit[k] + held
        })
    }

    fn jump(&self, i: usize) -> Jump {
        // The step itself, and the one that may undo it, tell nothing of the others.
        let doubted = i.saturating_sub(1)..i + 2;
        let around = i.saturating_sub(self.nearby)..(i + self.nearby + 1).min(self.delta.len());
        let [translation, rotation] = [0, 1].map(|k| {
            let (size, held) = self.part(i, &(i..i), k);
            let others = around.clone().filter(|j| !doubted.contains(j) && !self.is_pop[*j]);
            let mut others: Vec<f64> = others.map(|j| self.part(j, &doubted, k).0.norm()).collect();
            others.sort_by(f64::total_cmp);
            let nearby = if others.is_empty() { 0.0 } else { others[(others.len() - 1) / 2] };
            (size, (self.limit[k] + held).max(MIN_CONTRAST * nearby), nearby)
        });
        Jump {
            size: [translation.0, rotation.0],
            limit: [translation.1, rotation.1],
            nearby: [translation.2, rotation.2],
        }
    }
}
