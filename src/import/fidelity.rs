//! How well a hierarchy represents the strands, and how curly they are.

use super::hierarchy::across;
use super::sections::Sections;
use crate::math::percentile;
use crate::math::spline::ArcSpline;
use crate::scene::{Curves, Tree};
use nalgebra::Vector3;
use rayon::prelude::*;
use std::f64::consts::TAU;
use std::fmt;

/// Places along a strand at which its curvature is taken.
const CURVATURE_SAMPLES: usize = 24;

/// How the strands lie in the wisps of one level.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct LevelFit {
    /// Wisps on the level.
    pub wisps: usize,
    /// Mean radius over wisps and sections, m.
    pub radius: f64,
    /// Distance of the strands from the centre line of their wisp, square to it, over strands and sections, m: mean and 95th
    /// percentile.
    pub distance: [f64; 2],
    /// Mean distance as a share of the wisp's radius there.
    pub of_radius: f64,
    /// Mean distance as a share of the strand's length.
    pub of_length: f64,
    /// Share of strands inside their wisp's radius at every section.
    pub inside: f64,
}

/// Curvature and torsion of strands as drawn.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Curl {
    /// Mean curvature, 1/m.
    pub mean_curvature: f64,
    /// 95th percentile of the curvature, 1/m.
    pub p95_curvature: f64,
    /// Largest curvature, 1/m.
    pub max_curvature: f64,
    /// Median size of the torsion where the curvature is above its mean (a straight piece has none), 1/m.
    pub torsion: f64,
    /// Turns of the tangent along a strand, mean: curvature × length / 2π.
    pub turns: f64,
    /// Where strands turn once or more: diameter of the helix with the mean curvature κ and that torsion τ,
    /// 2κ/(κ² + τ²), m.
    pub curl_diameter: Option<f64>,
}

/// Measures `strands`, of which each lies in the leaf (tree, wisp), level by level from the coarse one.
pub(super) fn levels(trees: &[Tree], strands: &Sections, leaf: &[(u32, u32)]) -> Vec<LevelFit> {
    // From a leaf to the coarse wisp, then turned round: the wisp on each level.
    let lineage = |(tree, wisp): (u32, u32)| {
        let wisps = &trees[tree as usize].wisps;
        let mut line: Vec<usize> =
            std::iter::successors(Some(wisp), |&w| wisps[w as usize].parent).map(|w| w as usize).collect();
        line.reverse();
        line
    };
    let lineages: Vec<Vec<usize>> = leaf.iter().map(|&l| lineage(l)).collect();
    let depth = lineages.iter().map(Vec::len).max().unwrap_or(0);
    (0..depth)
        .map(|level| {
            let mut fit = LevelFit::default();
            let mut used = std::collections::BTreeSet::new();
            let mut distances = Vec::with_capacity(strands.point.len());
            for (i, (line, &(tree, _))) in lineages.iter().zip(leaf).enumerate() {
                let Some(&wisp) = line.get(level) else { continue };
                used.insert((tree, wisp));
                let mut inside = true;
                for (x, section) in strands.points(i).iter().zip(&trees[tree as usize].wisps[wisp].sections) {
                    let d = across(x - section.centre, section.frame * Vector3::z());
                    // A hair's breadth of slack: the outermost strand lies on the radius itself.
                    inside &= d <= section.radius * (1.0 + 1e-9);
                    fit.of_radius += d / section.radius;
                    fit.of_length += d / strands.length[i];
                    distances.push(d);
                }
                fit.inside += f64::from(u8::from(inside)) / strands.len() as f64;
            }
            let samples = distances.len().max(1) as f64;
            let radii =
                || used.iter().flat_map(|&(t, w)| &trees[t as usize].wisps[w].sections).map(|s| s.radius);
            fit.wisps = used.len();
            fit.radius = radii().sum::<f64>() / radii().count().max(1) as f64;
            fit.of_radius /= samples;
            fit.of_length /= samples;
            fit.distance[0] = distances.iter().sum::<f64>() / samples;
            fit.distance[1] = if distances.is_empty() { 0.0 } else { percentile(distances, 0.95) };
            fit
        })
        .collect()
}

/// Curvature and torsion of `curves` along smooth curves through their vertices.
pub(super) fn curl(curves: &Curves) -> Curl {
    // (curvature, torsion where it can be told, arc length) at each place.
    let strand = |c: usize| -> Vec<(f64, Option<f64>, f64)> {
        let Some(spline) = ArcSpline::through(curves.curve(c)) else { return Vec::new() };
        let step = spline.length() / CURVATURE_SAMPLES as f64;
        let at: Vec<_> = (0..CURVATURE_SAMPLES).map(|i| spline.at((i as f64 + 0.5) * step)).collect();
        let turn = |i: usize| {
            let [a, b] = [i, i + 1].map(|k| at[k].tangent.cross(&at[k].curvature).try_normalize(1e-9));
            Some(a?.dot(&b?).clamp(-1.0, 1.0).acos() / step)
        };
        (0..CURVATURE_SAMPLES)
            .map(|i| (at[i].curvature.norm(), if i + 1 < CURVATURE_SAMPLES { turn(i) } else { None }, step))
            .collect()
    };
    let samples: Vec<_> = (0..curves.len()).into_par_iter().flat_map_iter(strand).collect();
    if samples.is_empty() {
        return Curl::default();
    }
    let curvature = || samples.iter().map(|s| s.0);
    let mean = curvature().sum::<f64>() / samples.len() as f64;
    let torsions: Vec<f64> = samples.iter().filter(|s| s.0 >= mean).filter_map(|s| s.1).collect();
    let torsion = if torsions.is_empty() { 0.0 } else { percentile(torsions, 0.5) };
    let turns = samples.iter().map(|s| s.0 * s.2).sum::<f64>() / (curves.len() as f64 * TAU);
    Curl {
        mean_curvature: mean,
        p95_curvature: percentile(curvature().collect(), 0.95),
        max_curvature: curvature().fold(0.0, f64::max),
        torsion,
        turns,
        curl_diameter: (turns >= 1.0).then(|| 2.0 * mean / (mean * mean + torsion * torsion)),
    }
}

impl fmt::Display for LevelFit {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "{} wisps, radius {:.1} mm; strands {:.1} mm from the centre (95 %: {:.1} mm), {:.0} % of the radius, {:.1} % of \
             the length; {:.0} % wholly inside",
            self.wisps,
            self.radius * 1e3,
            self.distance[0] * 1e3,
            self.distance[1] * 1e3,
            self.of_radius * 100.0,
            self.of_length * 100.0,
            self.inside * 100.0
        )
    }
}

impl fmt::Display for Curl {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "curvature mean {:.1}, 95 % {:.1}, largest {:.0} per metre; {:.1} turns a strand",
            self.mean_curvature, self.p95_curvature, self.max_curvature, self.turns
        )?;
        match self.curl_diameter {
            Some(d) => {
                write!(f, ", torsion {:.1} per metre, curls about {:.0} mm across", self.torsion, d * 1e3)
            }
            None => Ok(()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_helix_is_recognised() {
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
        };
        let curl = curl(&curves);
        let norm = r * r + rise * rise;
        assert!((curl.mean_curvature / (r / norm) - 1.0).abs() < 0.01, "{curl:?}");
        // The binormal is compared over steps of a fortieth of a metre, which cuts corners by a few per cent.
        assert!((curl.torsion / (rise / norm) - 1.0).abs() < 0.1, "{curl:?} {}", rise / norm);
        assert!((curl.curl_diameter.unwrap() - 0.02).abs() < 2e-3, "{curl:?}");
    }
}
