//! The guides that each render strand follows, and their weights.

use super::rest_guide::RestGuide;
use crate::math::point_tree::PointTree;
use crate::rod::Rod;
use crate::scene::{Curves, Groom};
use nalgebra::Vector3;
use rayon::prelude::*;
use std::collections::BTreeMap;

/// Largest number of guides that a render strand follows.
pub const MAX_GUIDES: usize = 3;

/// The guides that a strand follows, at most [`MAX_GUIDES`]: their indices with weights of sum 1, the largest
/// first.
pub type GuideWeights = Vec<(usize, f64)>;

/// Number of guides with the nearest roots that are compared with a strand along its length.
const COMPARED: usize = 24;

/// Lower bound on the distance of a guide from a strand, m: avoids the singularity for a strand on a guide.
const MIN_DISTANCE: f64 = 1e-4;

/// Leaf wisp and group of a strand or guide.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub struct Membership {
    /// Leaf wisp: index of the tree, and of the wisp in the tree.
    pub leaf: (u32, u32),
    /// Index of the group.
    pub group: u32,
}

/// Clumping of each group of a groom (0..=1): how strongly strands prefer the guides of their own leaf wisp.
/// At 1 they follow no others; at 0 they have no preference.
pub fn clumping(groom: &Groom) -> Vec<f64> {
    groom.groups.iter().map(|group| groom.materials[group.material as usize].clumping).collect()
}

/// The guides to choose from.
struct Candidates<'a> {
    guides: &'a [RestGuide],
    /// Their memberships.
    members: &'a [Membership],
    /// Clumping of each group of strands.
    clumping: &'a [f64],
    /// The guides of each leaf wisp and group.
    of_wisp: BTreeMap<Membership, Vec<usize>>,
    /// The guides of each group, and all.
    of_group: BTreeMap<u32, Pool>,
    all: Pool,
}

/// Guides with the tree of their roots.
struct Pool {
    guides: Vec<usize>,
    roots: PointTree,
}

impl Pool {
    fn new(guides: Vec<usize>, all: &[RestGuide]) -> Self {
        Pool { roots: PointTree::new(guides.iter().map(|g| all[*g].root()).collect()), guides }
    }
}

impl<'a> Candidates<'a> {
    fn new(guides: &'a [RestGuide], members: &'a [Membership], clumping: &'a [f64]) -> Self {
        let mut of_wisp: BTreeMap<Membership, Vec<usize>> = BTreeMap::new();
        let mut of_group: BTreeMap<u32, Vec<usize>> = BTreeMap::new();
        for (g, member) in members.iter().enumerate() {
            of_wisp.entry(*member).or_default().push(g);
            of_group.entry(member.group).or_default().push(g);
        }
        Candidates {
            of_wisp,
            of_group: of_group.into_iter().map(|(group, of)| (group, Pool::new(of, guides))).collect(),
            all: Pool::new((0..guides.len()).collect(), guides),
            guides,
            members,
            clumping,
        }
    }

    /// Weights of the guides of a strand with `points` in the groom, m (`docs/theory.md` eq. 7.3; Franke &
    /// Nielson 1980).
    ///
    /// Guides are those of the strand's group, if there are any. The distance d of a guide is its mean
    /// distance along the strand, divided by (1 − clumping) for guides of other leaf wisps. The three nearest
    /// have weights proportional to `(1/d − 1/D)²` with D the distance of the fourth, so that weights are
    /// continuous where guides enter or leave the three.
    fn weights(&self, points: &[Vector3<f64>], member: Membership) -> GuideWeights {
        let pool = self.of_group.get(&member.group).unwrap_or(&self.all);
        let own = self.of_wisp.get(&member).map_or(&[][..], Vec::as_slice);
        // In a wisp without guides no guide is foreign.
        let foreign = |g: usize| !own.is_empty() && self.members[g] != member;
        let clumping = self.clumping[member.group as usize];
        let nearest = |count: usize, wanted: &dyn Fn(usize) -> bool| {
            let distance = |k: usize, squared: f64| wanted(pool.guides[k]).then_some(squared);
            let found = pool.roots.least(&points[0], count, distance).into_iter();
            found.map(|(_, k)| pool.guides[k]).collect::<Vec<_>>()
        };
        // Guides of the own wisp come first, however far their roots are.
        let mut compared =
            if own.len() > COMPARED { nearest(COMPARED, &|g| !foreign(g)) } else { own.to_vec() };
        if clumping < 1.0 || own.is_empty() {
            let more = COMPARED - compared.len();
            compared.extend(nearest(more, &|g| own.is_empty() || foreign(g)));
        }
        let preferred = |g: usize| {
            let preference = if foreign(g) { 1.0 - clumping } else { 1.0 };
            ((mean_distance(points, &self.guides[g]) / preference).max(MIN_DISTANCE), g)
        };
        let mut near: Vec<(f64, usize)> = compared.into_iter().map(preferred).collect();
        near.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        let beyond = near.get(MAX_GUIDES).map_or(0.0, |(d, _)| 1.0 / d);
        near.truncate(MAX_GUIDES);
        let weight = |d: f64| (1.0 / d - beyond).powi(2);
        let sum: f64 = near.iter().map(|(d, _)| weight(*d)).sum();
        let equal = 1.0 / near.len() as f64;
        near.iter().map(|(d, g)| (*g, if sum > 0.0 { weight(*d) / sum } else { equal })).collect()
    }
}

/// Mean distance of a strand's vertices from the corresponding places on a guide, m.
fn mean_distance(points: &[Vector3<f64>], guide: &RestGuide) -> f64 {
    let length: f64 = points.windows(2).map(|w| (w[1] - w[0]).norm()).sum();
    let pace = (guide.length() / length).min(1.0);
    let mut arc = 0.0;
    let mut sum = (points[0] - guide.root()).norm();
    for w in points.windows(2) {
        arc += (w[1] - w[0]).norm();
        sum += (w[1] - guide.position(guide.place(arc * pace))).norm();
    }
    sum / points.len() as f64
}

/// Guides and weights of each strand of `curves`, which belong to `members`. `clumping` is that of each group
/// ([`clumping()`]); `guides` are all guides with their memberships.
pub fn guide_weights(
    curves: &Curves,
    members: &[Membership],
    clumping: &[f64],
    guides: &[(&Rod, Membership)],
) -> Vec<GuideWeights> {
    let (rest, of): (Vec<_>, Vec<_>) =
        guides.iter().map(|(rod, member)| (RestGuide::new(rod), *member)).unzip();
    let candidates = Candidates::new(&rest, &of, clumping);
    (0..curves.len()).into_par_iter().map(|c| candidates.weights(curves.curve(c), members[c])).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::strands::rest_guide::tests::guide_through;

    /// A strand from `x`, m, along y, sheared by `lean`.
    fn strand(x: f64, lean: f64) -> Vec<Vector3<f64>> {
        (0..5).map(|i| 0.02 * f64::from(i)).map(|s| Vector3::new(x + lean * s, s, 0.0)).collect()
    }

    /// Weights of forty guides for a strand. The guides are 1 cm apart, four to a leaf wisp, the last ten of
    /// another group.
    fn weights(points: &[Vector3<f64>], member: Membership, clumping: f64) -> Vec<f64> {
        let guides: Vec<RestGuide> =
            (0..40).map(|i| guide_through(&strand(0.01 * f64::from(i), 0.0))).collect();
        let members: Vec<Membership> =
            (0..40).map(|i| Membership { leaf: (i / 4, 0), group: u32::from(i >= 30) }).collect();
        let clumping = [clumping; 3];
        let candidates = Candidates::new(&guides, &members, &clumping);
        let mut weights = vec![0.0; 40];
        candidates.weights(points, member).into_iter().for_each(|(g, weight)| weights[g] += weight);
        weights
    }

    #[test]
    fn weights_are_continuous_across_the_borders_of_wisps() {
        let member = |x: f64| Membership { leaf: ((x / 0.04).round().clamp(0.0, 9.0) as u32, 0), group: 0 };
        let mut last: Option<Vec<f64>> = None;
        for i in 0..2800 {
            let x = 0.005 + 1e-4 * f64::from(i);
            let now = weights(&strand(x, 0.0), member(x), 0.0);
            assert!((now.iter().sum::<f64>() - 1.0).abs() < 1e-12);
            if let Some(last) = last {
                let step = now.iter().zip(last).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
                // Guides are 100 steps apart.
                assert!(step < 0.05, "{step} at {x} m");
            }
            last = Some(now);
        }
    }

    #[test]
    fn strand_on_a_guide_follows_that_guide() {
        let member = Membership { leaf: (1, 0), group: 0 };
        assert!(weights(&strand(0.05001, 0.0), member, 0.0)[5] > 0.999);
        // Its root is near one guide, most of it near another.
        let weights = weights(&strand(0.05, 0.5), member, 0.0);
        assert!(weights[7] > weights[5], "{weights:?}");
    }

    #[test]
    fn clumping_keeps_strands_to_their_wisp_and_all_keep_to_their_group() {
        let edge = strand(0.0349, 0.0);
        let own = |weights: &[f64], of: std::ops::Range<usize>| weights[of].iter().sum::<f64>();
        let member = Membership { leaf: (0, 0), group: 0 };
        let shares = [0.0, 0.5, 1.0].map(|clumping| own(&weights(&edge, member, clumping), 0..4));
        assert!(shares[0] < 0.6 && shares[0] < shares[1] && shares[1] < shares[2], "{shares:?}");
        assert_eq!(shares[2], 1.0);
        let border = weights(&strand(0.2949, 0.0), Membership { leaf: (7, 0), group: 1 }, 0.0);
        assert!((own(&border, 30..40) - 1.0).abs() < 1e-12);
        // A group without guides follows those of any group.
        assert!(
            (own(&weights(&edge, Membership { leaf: (0, 0), group: 2 }, 0.0), 0..40) - 1.0).abs() < 1e-12
        );
    }
}
