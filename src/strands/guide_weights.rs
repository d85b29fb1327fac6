//! The guides that each render strand follows, and their weights.

use super::rest_guide::RestGuide;
use crate::rod::Rod;
use crate::scene::{Curves, Groom};
use nalgebra::Vector3;
use rayon::prelude::*;

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
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
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
}

impl Candidates<'_> {
    /// Weights of the guides of a strand with `points` in the groom, m (`docs/theory.md` eq. 7.3; Franke &
    /// Nielson 1980).
    ///
    /// Guides are those of the strand's group, if there are any. The distance d of a guide is its mean
    /// distance along the strand, divided by (1 − clumping) for guides of other leaf wisps. The three nearest
    /// have weights proportional to `(1/d − 1/D)²` with D the distance of the fourth, so that weights are
    /// continuous where guides enter or leave the three.
    fn weights(&self, points: &[Vector3<f64>], member: Membership) -> GuideWeights {
        let all = || 0..self.guides.len();
        let same_group = |g: &usize| self.members[*g].group == member.group;
        let group_has_guides = all().any(|g| same_group(&g));
        let wisp_has_guides = all().any(|g| self.members[g] == member);
        // In a wisp without guides no guide is foreign.
        let foreign = |g: usize| wisp_has_guides && self.members[g] != member;
        let clumping = self.clumping[member.group as usize];
        let eligible = |g: &usize| (!group_has_guides || same_group(g)) && (clumping < 1.0 || !foreign(*g));
        let mut near: Vec<(f64, usize)> =
            all().filter(eligible).map(|g| ((self.guides[g].root() - points[0]).norm_squared(), g)).collect();
        let by_distance = |a: &(f64, usize), b: &(f64, usize)| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1));
        if near.len() > COMPARED {
            near.select_nth_unstable_by(COMPARED - 1, |a, b| {
                // Guides of the own wisp come first, however far their roots are.
                foreign(a.1).cmp(&foreign(b.1)).then_with(|| by_distance(a, b))
            });
            near.truncate(COMPARED);
        }
        for (d, g) in &mut near {
            let preference = if foreign(*g) { 1.0 - clumping } else { 1.0 };
            *d = (mean_distance(points, &self.guides[*g]) / preference).max(MIN_DISTANCE);
        }
        near.sort_unstable_by(by_distance);
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
    let candidates = Candidates { guides: &rest, members: &of, clumping };
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
        let candidates = Candidates { guides: &guides, members: &members, clumping: &[clumping; 3] };
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
