//! Forces and moments on guides (`docs/theory.md` §4.9).

use super::tie;
use crate::rod::potential::Load;
use crate::rod::{Rod, RodShape};
use crate::scene::anim::{self, Keyframes, LoadAxes, LoadPlace, Resolution};
use crate::scene::{Anim, Groom};
use crate::wisp::GuideRod;
use nalgebra::Vector3;

/// Points that the polynomials through points of a rod interpolate, by which loads are shared among them.
const STENCIL: usize = 4;

/// A load on one guide.
#[derive(Debug, Clone)]
pub struct GuideLoad {
    /// Shares of it that act on points of the rod; of a spread load, m.
    shares: Vec<(usize, f64)>,
    force: Keyframes,
    moment: Keyframes,
    axes: LoadAxes,
    /// True if its moment is not always zero.
    turns: bool,
}

impl GuideLoad {
    /// The load `load` on `rod`; `None` if the rod is too short.
    pub fn new(rod: &Rod, load: &anim::Load) -> Option<Self> {
        let length = rod.length();
        let mut shares = match load.place {
            LoadPlace::Arc(arc) if arc > length * (1.0 + tie::ROUNDING) => return None,
            LoadPlace::Arc(arc) => at(rod, arc.min(length)),
            LoadPlace::Share(share) => at(rod, share * length),
            LoadPlace::Span([from, _]) if from >= length => return None,
            LoadPlace::Span(span) => over(rod, span),
            LoadPlace::SpanShare(span) => over(rod, span.map(|share| share * length)),
        };
        shares.retain(|(_, share)| *share != 0.0);
        let turns = load.has_moment();
        let (force, moment, axes) = (load.force.clone(), load.moment.clone(), load.axes);
        Some(GuideLoad { shares, force, moment, axes, turns })
    }

    /// True if it depends on the frames of the rod.
    pub fn needs_frames(&self) -> bool {
        self.turns || self.axes == LoadAxes::Material
    }

    /// Adds it to the load of a step that ends at time `t`, s. Where it depends on frames, they are those of
    /// `shape`.
    pub fn add(&self, t: f64, shape: &RodShape, load: &mut Load) {
        let [force, moment] = [&self.force, &self.moment].map(|keys| keys.linear_at(t));
        for &(k, share) in &self.shares {
            if !self.needs_frames() {
                load.add_force(k, &(force * share));
                continue;
            }
            let frame = shape.frame(k);
            let world = |v: Vector3<f64>| match self.axes {
                LoadAxes::World => v * share,
                LoadAxes::Material => frame * v * share,
            };
            load.add_force(k, &world(force));
            if self.turns {
                load.add_moment(k, &frame, &world(moment));
            }
        }
    }
}

/// Shares of the points of `rod` in a place at the arc length `s`, m: the values there of the polynomials that
/// are 1 at one of the points around and 0 at the others.
fn at(rod: &Rod, s: f64) -> Vec<(usize, f64)> {
    let arc = &rod.arc;
    let segment = arc.partition_point(|end| *end < s).saturating_sub(1).min(arc.len() - 2);
    stencil(rod, segment).map(|k| (k, basis(arc, stencil(rod, segment), k, s))).collect()
}

/// Integrals of the same over a part of the arc length, m; segment by segment, by a Gauss rule that is exact.
fn over(rod: &Rod, [from, to]: [f64; 2]) -> Vec<(usize, f64)> {
    let mut sums = vec![0.0; rod.points()];
    for (segment, ends) in rod.arc.windows(2).enumerate() {
        let (a, b) = (ends[0].max(from), ends[1].min(to));
        if a < b {
            let offset = (b - a) / 12.0_f64.sqrt();
            for s in [0.5 * (a + b) - offset, 0.5 * (a + b) + offset] {
                for k in stencil(rod, segment) {
                    sums[k] += 0.5 * (b - a) * basis(&rod.arc, stencil(rod, segment), k, s);
                }
            }
        }
    }
    sums.into_iter().enumerate().collect()
}

/// The points around a segment that share what acts on it.
fn stencil(rod: &Rod, segment: usize) -> std::ops::Range<usize> {
    let size = STENCIL.min(rod.points());
    let first = segment.saturating_sub(1).min(rod.points() - size);
    first..first + size
}

/// The polynomial through the points `around` that is 1 at point `k` and 0 at the others, at arc length `s`, m.
fn basis(arc: &[f64], around: std::ops::Range<usize>, k: usize, s: f64) -> f64 {
    around.filter(|j| *j != k).map(|j| (s - arc[j]) / (arc[k] - arc[j])).product()
}

/// True if a load or a tie exerts a moment, which may act at a tip. Followers and their leaders have no unknowns
/// there.
pub fn bends_tips(anim: &Anim) -> bool {
    anim.resolution() == Resolution::Full && anim.has_moments()
}

/// The loads of each of `rods`.
pub fn loads(groom: &Groom, anim: &Anim, rods: &[GuideRod]) -> Vec<Vec<GuideLoad>> {
    let of = |r: &GuideRod| {
        let drawn = tie::drawn(&r.rod);
        let chosen = anim.loads.iter().filter(|load| tie::selects(&load.guides, groom, r, &drawn));
        chosen.filter_map(|load| GuideLoad::new(&r.rod, load)).collect()
    };
    match anim.loads.is_empty() {
        true => vec![Vec::new(); rods.len()],
        false => rods.iter().map(of).collect(),
    }
}
