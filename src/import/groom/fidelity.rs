//! Fit of a hierarchy to its strands, and their curvature.

use super::sections::{Sections, perpendicular_distance};
use crate::math::percentile;
use crate::math::spline::ArcSpline;
use crate::scene::{Curves, Tree};
use nalgebra::Vector3;
use rayon::prelude::*;
use std::collections::BTreeSet;
use std::f64::consts::TAU;
use std::fmt;

/// Samples of the curvature along a strand.
const CURVATURE_SAMPLES: usize = 24;

/// Fit of the wisps of one level to their strands.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct LevelFit {
    /// Number of wisps on the level.
    pub wisps: usize,
    /// Mean radius over wisps and sections, m.
    pub radius: f64,
    /// Perpendicular distance of the strands from the centre line of their wisp, m: mean and 95th percentile
    /// over strands and sections.
    pub distance: [f64; 2],
    /// Mean distance relative to the radius of the section.
    pub distance_per_radius: f64,
    /// Mean distance relative to the length of the strand.
    pub distance_per_length: f64,
    /// Share of strands within the radius of their wisp at every section.
    pub inside: f64,
}

/// Curvature and torsion of strands.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Curl {
    /// Mean curvature, 1/m.
    pub mean_curvature: f64,
    /// 95th percentile of the curvature, 1/m.
    pub p95_curvature: f64,
    /// Largest curvature, 1/m.
    pub max_curvature: f64,
    /// Median absolute torsion where the curvature is above its mean, 1/m.
    pub torsion: f64,
    /// Mean number of turns of the tangent along a strand: curvature × length / 2π.
    pub turns: f64,
    /// Diameter of the helix with the mean curvature κ and the torsion τ, 2κ/(κ² + τ²), m; `None` for fewer
    /// turns than one.
    pub curl_diameter: Option<f64>,
}

/// Measures the fit of `strands` to the wisps of every level, from the coarse one; `leaf` is the leaf wisp
/// (tree, wisp) of each strand.
pub(super) fn levels(trees: &[Tree], strands: &Sections, leaf: &[(u32, u32)]) -> Vec<LevelFit> {
    let lineages: Vec<Vec<usize>> =
        leaf.iter().map(|&(tree, wisp)| lineage(&trees[tree as usize], wisp)).collect();
    let depth = lineages.iter().map(Vec::len).max().unwrap_or(0);
    (0..depth).map(|level| level_fit(level, trees, strands, leaf, &lineages)).collect()
}

/// The wisps from the root of a tree to `wisp`.
fn lineage(tree: &Tree, wisp: u32) -> Vec<usize> {
    let mut line: Vec<usize> =
        std::iter::successors(Some(wisp), |&w| tree.wisps[w as usize].parent).map(|w| w as usize).collect();
    line.reverse();
    line
}

fn level_fit(
    level: usize,
    trees: &[Tree],
    strands: &Sections,
    leaf: &[(u32, u32)],
    lineages: &[Vec<usize>],
) -> LevelFit {
    let mut fit = LevelFit::default();
    let mut used = BTreeSet::new();
    let mut distances = Vec::with_capacity(strands.point.len());
    for (i, (line, &(tree, _))) in lineages.iter().zip(leaf).enumerate() {
        let Some(&wisp) = line.get(level) else { continue };
        used.insert((tree, wisp));
        let mut inside = true;
        for (x, section) in strands.points(i).iter().zip(&trees[tree as usize].wisps[wisp].sections) {
            let d = perpendicular_distance(x - section.centre, section.frame * Vector3::z());
            // The outermost strand lies on the radius itself.
            inside &= d <= section.radius * (1.0 + 1e-9);
            fit.distance_per_radius += d / section.radius;
            fit.distance_per_length += d / strands.length[i];
            distances.push(d);
        }
        fit.inside += f64::from(u8::from(inside)) / strands.len() as f64;
    }
    let samples = distances.len().max(1) as f64;
    let radii = || used.iter().flat_map(|&(t, w)| &trees[t as usize].wisps[w].sections).map(|s| s.radius);
    fit.wisps = used.len();
    fit.radius = radii().sum::<f64>() / radii().count().max(1) as f64;
    fit.distance_per_radius /= samples;
    fit.distance_per_length /= samples;
    fit.distance[0] = distances.iter().sum::<f64>() / samples;
    fit.distance[1] = if distances.is_empty() { 0.0 } else { percentile(distances, 0.95) };
    fit
}

/// A sample of curvature and torsion.
struct CurlSample {
    /// Curvature, 1/m.
    curvature: f64,
    /// Absolute torsion, 1/m; `None` where the curve is straight or at the last sample.
    torsion: Option<f64>,
    /// Arc length that the sample covers, m.
    length: f64,
}

/// Curvature and torsion of `curves` along smooth curves through their vertices.
pub(super) fn curl(curves: &Curves) -> Curl {
    let samples: Vec<CurlSample> =
        (0..curves.len()).into_par_iter().flat_map_iter(|c| curl_samples(curves.curve(c))).collect();
    if samples.is_empty() {
        return Curl::default();
    }
    let curvature = || samples.iter().map(|s| s.curvature);
    let mean = curvature().sum::<f64>() / samples.len() as f64;
    let torsions: Vec<f64> =
        samples.iter().filter(|s| s.curvature >= mean).filter_map(|s| s.torsion).collect();
    let torsion = if torsions.is_empty() { 0.0 } else { percentile(torsions, 0.5) };
    let turns = samples.iter().map(|s| s.curvature * s.length).sum::<f64>() / (curves.len() as f64 * TAU);
    Curl {
        mean_curvature: mean,
        p95_curvature: percentile(curvature().collect(), 0.95),
        max_curvature: curvature().fold(0.0, f64::max),
        torsion,
        turns,
        curl_diameter: (turns >= 1.0).then(|| 2.0 * mean / (mean * mean + torsion * torsion)),
    }
}

/// Samples of one strand. The torsion is the angle between consecutive binormals over their distance.
fn curl_samples(points: &[Vector3<f64>]) -> Vec<CurlSample> {
    let Some(spline) = ArcSpline::through(points) else { return Vec::new() };
    let step = spline.length() / CURVATURE_SAMPLES as f64;
    let at: Vec<_> = (0..CURVATURE_SAMPLES).map(|i| spline.at((i as f64 + 0.5) * step)).collect();
    let torsion = |i: usize| {
        let [a, b] = [i, i + 1].map(|k| at[k].tangent.cross(&at[k].curvature).try_normalize(1e-9));
        Some(a?.dot(&b?).clamp(-1.0, 1.0).acos() / step)
    };
    (0..CURVATURE_SAMPLES)
        .map(|i| CurlSample {
            curvature: at[i].curvature.norm(),
            torsion: if i + 1 < CURVATURE_SAMPLES { torsion(i) } else { None },
            length: step,
        })
        .collect()
}

impl fmt::Display for LevelFit {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "{} wisps, mean radius {:.1} mm; strands are {:.1} mm from the centre line on average \
             (95 % below {:.1} mm), {:.0} % of the radius, {:.1} % of the length; {:.0} % stay within the radius",
            self.wisps,
            self.radius * 1e3,
            self.distance[0] * 1e3,
            self.distance[1] * 1e3,
            self.distance_per_radius * 100.0,
            self.distance_per_length * 100.0,
            self.inside * 100.0
        )
    }
}

impl fmt::Display for Curl {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "curvature {:.1}/m on average, 95 % below {:.1}/m, {:.0}/m at most; {:.1} turns per strand",
            self.mean_curvature, self.p95_curvature, self.max_curvature, self.turns
        )?;
        match self.curl_diameter {
            Some(d) => {
                write!(f, ", torsion {:.1}/m, curl diameter about {:.0} mm", self.torsion, d * 1e3)
            }
            None => Ok(()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn curvature_torsion_and_diameter_of_a_helix_are_measured() {
        let (r, rise) = (0.01_f64, 0.004_f64);
        let points: Vec<_> = (0..240)
            .map(|i| f64::from(i) * 0.1)
            .map(|a| Vector3::new(r * a.cos(), -rise * a, r * a.sin()))
            .collect();
        let curves = Curves {
            offsets: vec![0, points.len()],
            points,
            id: vec![0],
            group: vec![0],
            root_uv: vec![[0.0; 2]],
            skin: Vec::new(),
        };
        let curl = curl(&curves);
        let norm = r * r + rise * rise;
        assert!((curl.mean_curvature / (r / norm) - 1.0).abs() < 0.01, "{curl:?}");
        // The torsion is a finite difference over 1/24 of the strand, which is a few per cent off.
        assert!((curl.torsion / (rise / norm) - 1.0).abs() < 0.1, "{curl:?} {}", rise / norm);
        assert!((curl.curl_diameter.unwrap() - 0.02).abs() < 2e-3, "{curl:?}");
    }
}
