//! How many hairs the strands of a groom stand for.

use crate::dynamics::air_drag::HairDensity;
use crate::math::percentile;
use crate::math::point_tree::PointTree;
use crate::wisp::GuideRod;
use nalgebra::Vector3;
use rayon::prelude::*;
use std::f64::consts::PI;

/// Mean volume fraction of human hair on a head. A groom with fewer strands is taken as a sample of as much
/// hair.
const HAIR_FRACTION: f64 = 0.005;

/// The most hairs that one hair of a groom stands for. Strands that are sparser are single ones, which do not
/// meet.
const MAX_SAMPLING: f64 = 100.0;

/// Largest distance of strands, m, in the median, at which they stand for a head of hair: the density of strands that
/// are farther apart than its cells does not tell how far. A guide alone stands for hair on the square of it at most.
const MAX_DISTANCE: f64 = 0.02;

/// Distance of a root from others, in [`MAX_DISTANCE`], beyond which a guide is a single hair among those that are
/// none.
const SINGLE: f64 = 2.0;

/// Hairs that grow on a scalp, 1/m²: what guides without strands stand for.
const ROOT_DENSITY: f64 = 2e6;

/// Nearest roots that tell the area around one.
const NEIGHBOURS: usize = 8;

/// How many times the area around it a root in the corner of a square appears to have.
const CORNER: f64 = 4.0;

/// Share by which distances are the same but for rounding.
const SAME: f64 = 1e-6;

/// How many hairs a hair of each guide stands for; `None` if the strands are too sparse to meet. `density` is
/// that of the guides `rods` with their strands, of which there are none if `guides_only`.
pub(in crate::dynamics) fn sampling(
    rods: &[GuideRod],
    density: &HairDensity,
    guides_only: bool,
) -> Option<Vec<f64>> {
    let areas = Roots::new(rods).areas();
    let distances: Vec<f64> =
        areas.iter().zip(rods).map(|(area, r)| (area / r.hairs.max(1.0)).sqrt()).collect();
    let single = |distance: &f64| *distance > SINGLE * MAX_DISTANCE;
    let of_guide = |distance: &f64| match single(distance) {
        true => 1.0,
        false => (ROOT_DENSITY * distance.min(MAX_DISTANCE).powi(2)).max(1.0),
    };
    let mean = |of: fn(&GuideRod) -> f64| rods.iter().map(of).sum::<f64>() / rods.len() as f64;
    let sampling = if guides_only && mean(|r| r.hairs) <= 1.0 {
        Some(distances.iter().map(of_guide).collect())
    } else {
        let sampling = HAIR_FRACTION / (density.mean() * mean(|r| r.material.section.area()));
        (sampling <= MAX_SAMPLING).then(|| vec![sampling.max(1.0); rods.len()])
    };
    sampling.filter(|_| rods.len() > 1 && percentile(distances, 0.5) <= MAX_DISTANCE)
}

/// Distance of a root to the nearest other one, m, in the median; 0 for a single root.
pub(super) fn root_spacing(rods: &[GuideRod]) -> f64 {
    let nearest = |near: &Vec<f64>| near.first().map_or(0.0, |square| square.sqrt());
    percentile(Roots::new(rods).nearest.iter().map(nearest).collect(), 0.5)
}

/// The roots of guides.
struct Roots {
    tree: PointTree,
    /// Squared distances, m², of each to the [`NEIGHBOURS`] nearest others, ascending.
    nearest: Vec<Vec<f64>>,
}

impl Roots {
    fn new(rods: &[GuideRod]) -> Self {
        let tree = PointTree::new(rods.iter().map(|r| r.rod.root.p).collect());
        let others = |(own, x): (usize, &Vector3<f64>)| {
            let found = tree.least(x, NEIGHBOURS, |i, square| (i != own).then_some(square));
            found.into_iter().map(|(square, _)| square).collect()
        };
        let nearest = tree.points().par_iter().enumerate().map(others).collect();
        Roots { tree, nearest }
    }

    /// The area that each guide has to itself, m²; infinite for a single root. It is that at which evenly random roots
    /// have as many as near, in the median over the root and its neighbours: those at an edge have fewer near, in
    /// a corner as few as in [`CORNER`] times the area.
    fn areas(&self) -> Vec<f64> {
        let area = |near: &Vec<f64>| match near.len() {
            0 => f64::INFINITY,
            // The square of the distance of the k-th is k times the area over π in the mean.
            n => PI * near.iter().sum::<f64>() / (n * (n + 1) / 2) as f64,
        };
        let own: Vec<f64> = self.nearest.iter().map(area).collect();
        let smooth = |(x, near): (&Vector3<f64>, &Vec<f64>)| {
            let reach = near.last().map_or(0.0, |square| square * (1.0 + SAME));
            let mut around = Vec::with_capacity(NEIGHBOURS + 1);
            self.tree.visit(x, reach, |i, _| {
                around.push(own[i]);
                reach
            });
            percentile(around, 0.5)
        };
        let of_place: Vec<f64> = self.tree.points().par_iter().zip(&self.nearest).map(smooth).collect();
        of_place.iter().zip(own).map(|(smooth, own)| smooth.max(own / CORNER)).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests::{guide, square};
    use super::*;
    use crate::scene::Material;

    type V = Vector3<f64>;

    #[test]
    fn single_strands_do_not_meet() {
        let sampling = |apart: f64, hairs: f64, guides_only: bool| {
            let rods: Vec<GuideRod> =
                square(5, apart).iter().map(|root| guide(root, hairs, Material::default())).collect();
            let lines: Vec<[V; 2]> =
                rods.iter().map(|r| [0.0, 0.2].map(|y| r.rod.root.p - V::y() * y)).collect();
            let density = HairDensity::new(lines.iter().map(|l| (&l[..], hairs)));
            sampling(&rods, &density, guides_only)
        };
        let all = |sampling: Option<Vec<f64>>| {
            sampling.map(|of| [percentile(of.clone(), 0.0), percentile(of, 1.0)])
        };
        // With strands around them; the last are so sparse that their density in cells of a centimetre does not
        // show it.
        assert_eq!(sampling(0.015, 1.0, false), None);
        assert_eq!(sampling(0.07, 4.0, false), None);
        let sample = sampling(0.015, 10.0, false);
        assert!(all(sample.clone()).is_some_and(|[least, most]| least > 10.0 && most < 50.0), "{sample:?}");
        assert_eq!(all(sampling(0.015, 1e5, false)), Some([1.0; 2]));
        // Guides alone: 200 roots of hair grow on a square centimetre.
        let alone = sampling(0.015, 1.0, true);
        assert!(all(alone.clone()).is_some_and(|[least, most]| least > 440.0 && most < 760.0), "{alone:?}");
        assert_eq!(sampling(0.03, 1.0, true), None);
        assert_eq!(sampling(0.015, 10.0, true), sample);
    }

    /// How many hairs guides alone with these roots stand for.
    fn sampling_of(roots: &[V]) -> Vec<f64> {
        let rods: Vec<GuideRod> = roots.iter().map(|root| guide(root, 1.0, Material::default())).collect();
        let lines: Vec<[V; 2]> = roots.iter().map(|root| [*root, root - V::y() * 0.2]).collect();
        sampling(&rods, &HairDensity::new(lines.iter().map(|line| (&line[..], 1.0))), true).unwrap()
    }

    #[test]
    fn a_guide_stands_for_the_hair_that_grows_around_it() {
        let draw = |n: u64, i: u64| crate::math::random::unit(n, i);
        // Roots at random, five on four square centimetres.
        let random: Vec<V> = (0..500).map(|i| V::new(draw(0, i), 0.0, draw(1, i)) * 0.2).collect();
        let mean = sampling_of(&random).iter().sum::<f64>() / 500.0;
        assert!((mean / 160.0 - 1.0).abs() < 0.1, "{mean}");
        // A denser patch far away, and a single hair, change nothing, whatever the order of the guides.
        let dense: Vec<V> = square(12, 0.003).iter().map(|root| root + V::x()).collect();
        let both: Vec<V> = random.iter().chain(&dense).copied().chain([V::new(0.0, -1.0, 0.0)]).collect();
        let of_both = sampling_of(&both);
        assert_eq!(of_both[..500], sampling_of(&random));
        assert_eq!(of_both[500..644], sampling_of(&dense));
        assert_eq!(of_both[644], 1.0);
        let shuffled: Vec<usize> = (0..645).map(|i| i * 64 % 645).collect();
        let again = sampling_of(&shuffled.iter().map(|i| both[*i]).collect::<Vec<_>>());
        assert!(shuffled.iter().zip(again).all(|(i, found)| of_both[*i] == found));
    }
}
