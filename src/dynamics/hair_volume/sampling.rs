//! How many hairs the strands of a groom stand for.

use crate::dynamics::air_drag::HairDensity;
use crate::wisp::GuideRod;

/// Mean volume fraction of human hair on a head. A groom with fewer strands is taken as a sample of as much
/// hair.
const HAIR_FRACTION: f64 = 0.005;

/// The most hairs that one hair of a groom stands for. Strands that are sparser are single ones, which do not
/// meet.
const MAX_SAMPLING: f64 = 100.0;

/// Largest mean distance of strands, m, at which they stand for a head of hair: the density of strands that
/// are farther apart than its cells does not tell how far.
const MAX_DISTANCE: f64 = 0.02;

/// Hairs that grow on a scalp, 1/m²: what guides without strands stand for.
const ROOT_DENSITY: f64 = 2e6;

/// Roots whose distance to the nearest other one is measured.
const SPACING_SAMPLES: usize = 300;

/// How many hairs each hair of a groom stands for; `None` if its strands are too sparse to meet. `density` is
/// that of the guides `rods` with their strands, of which there are none if `guides_only`.
pub(in crate::dynamics) fn sampling(
    rods: &[GuideRod],
    density: &HairDensity,
    guides_only: bool,
) -> Option<f64> {
    let mean = |of: fn(&GuideRod) -> f64| rods.iter().map(of).sum::<f64>() / rods.len() as f64;
    let hairs = mean(|r| r.hairs);
    let distance = root_spacing(rods) / hairs.sqrt();
    let sampling = if guides_only && hairs <= 1.0 {
        Some(ROOT_DENSITY * distance * distance)
    } else {
        let area = mean(|r| r.material.section.area());
        Some(HAIR_FRACTION / (density.mean() * area)).filter(|sampling| *sampling <= MAX_SAMPLING)
    };
    sampling.filter(|_| rods.len() > 1 && distance <= MAX_DISTANCE).map(|sampling| sampling.max(1.0))
}

/// Mean distance of a root to the nearest other one, m; 0 for a single root.
pub(super) fn root_spacing(rods: &[GuideRod]) -> f64 {
    let root = |i: usize| rods[i].rod.root.p;
    let nearest = |i: usize| {
        let others = (0..rods.len()).filter(|j| *j != i);
        others.map(|j| (root(i) - root(j)).norm_squared()).fold(f64::INFINITY, f64::min).sqrt()
    };
    let sampled = (0..rods.len()).step_by(rods.len().div_ceil(SPACING_SAMPLES).max(1));
    let distances: Vec<f64> = sampled.map(nearest).filter(|d| d.is_finite()).collect();
    distances.iter().sum::<f64>() / distances.len().max(1) as f64
}
