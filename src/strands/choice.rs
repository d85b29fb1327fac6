//! Which guides a render strand follows, and by how much.

use super::follow::RestGuide;
use crate::rod::Rod;
use crate::scene::{Curves, Groom};
use nalgebra::Vector3;
use rayon::prelude::*;

/// Guides that one render strand follows, at most.
pub const MAX_GUIDES: usize = 3;

/// The guides that a strand follows, by index, with their weights, whose sum is 1; that of most weight first, and [`MAX_GUIDES`] at most.
pub type GuideWeights = Vec<(usize, f64)>;

/// Guides of nearest root that are compared with a strand along their whole length.
const COMPARED: usize = 24;

/// Guides nearer to a strand than this are followed alone, smoothly, m.
const SOFT: f64 = 1e-4;

/// Where a strand or a guide belongs.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Membership {
    /// Its leaf wisp: (tree, wisp).
    pub leaf: (u32, u32),
    /// Its group.
    pub group: u32,
}

/// How much strands of each group keep to the guides of their own leaf wisp: 1 to them alone, 0 no more than to others (0..=1).
pub fn clumping(groom: &Groom) -> Vec<f64> {
    groom.groups.iter().map(|group| groom.materials[group.material as usize].clumping).collect()
}

/// Guides to choose from.
struct Choice<'a> {
    guides: &'a [RestGuide],
    /// Where they belong.
    homes: &'a [Membership],
    /// Of each group of strands ([`clumping`]).
    clumping: &'a [f64],
}

impl Choice<'_> {
    /// What a strand drawn at `points`, m, follows.
    ///
    /// They are of the strand's group, if that has any. What counts is the mean distance d of the strand from a guide along it, `d / (1 − clumping)` for
    /// guides of other leaf wisps: the three nearest have the weights `(1/d − 1/D)²`, `D` being the distance of the fourth (Franke & Nielson
    /// 1980), so that none jumps from strand to strand as guides come and go.
    fn choose(&self, points: &[Vector3<f64>], home: Membership) -> GuideWeights {
        let all = || 0..self.guides.len();
        let related = |g: &usize| self.homes[*g].group == home.group;
        let grouped = all().any(|g| related(&g));
        let settled = all().any(|g| self.homes[g] == home);
        // Where no guide is at home, none is a stranger.
        let stranger = |g: usize| settled && self.homes[g] != home;
        let clumping = self.clumping[home.group as usize];
        let open = |g: &usize| (!grouped || related(g)) && (clumping < 1.0 || !stranger(*g));
        let mut near: Vec<(f64, usize)> =
            all().filter(open).map(|g| ((self.guides[g].root() - points[0]).norm_squared(), g)).collect();
        let by_distance = |a: &(f64, usize), b: &(f64, usize)| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1));
        if near.len() > COMPARED {
            near.select_nth_unstable_by(COMPARED - 1, |a, b| {
                // Those at home are compared however far their roots are.
                stranger(a.1).cmp(&stranger(b.1)).then_with(|| by_distance(a, b))
            });
            near.truncate(COMPARED);
        }
        for (d, g) in &mut near {
            let keeping = if stranger(*g) { 1.0 - clumping } else { 1.0 };
            *d = (apart(points, &self.guides[*g]) / keeping).max(SOFT);
        }
        near.sort_unstable_by(by_distance);
        let beyond = near.get(MAX_GUIDES).map_or(0.0, |(d, _)| 1.0 / d);
        near.truncate(MAX_GUIDES);
        let weight = |d: f64| (1.0 / d - beyond).powi(2);
        let sum: f64 = near.iter().map(|(d, _)| weight(*d)).sum();
        let alike = 1.0 / near.len() as f64;
        near.iter().map(|(d, g)| (*g, if sum > 0.0 { weight(*d) / sum } else { alike })).collect()
    }
}

/// Mean distance of a strand's vertices from the places beside them on a guide, m.
fn apart(points: &[Vector3<f64>], guide: &RestGuide) -> f64 {
    let length: f64 = points.windows(2).map(|w| (w[1] - w[0]).norm()).sum();
    let pace = (guide.length() / length).min(1.0);
    let mut arc = 0.0;
    let mut sum = (points[0] - guide.root()).norm();
    for w in points.windows(2) {
        arc += (w[1] - w[0]).norm();
        sum += (w[1] - guide.at(guide.place(arc * pace))).norm();
    }
    sum / points.len() as f64
}

/// What each strand of `curves` follows; they belong to `homes`, and keep to their own wisps as `clumping` tells for each group ([`clumping()`]). `guides` are all
/// guides with their homes.
pub fn guide_weights(
    curves: &Curves,
    homes: &[Membership],
    clumping: &[f64],
    guides: &[(&Rod, Membership)],
) -> Vec<GuideWeights> {
    let (rest, of): (Vec<_>, Vec<_>) = guides.iter().map(|(rod, home)| (RestGuide::new(rod), *home)).unzip();
    let choice = Choice { guides: &rest, homes: &of, clumping };
    (0..curves.len()).into_par_iter().map(|c| choice.choose(curves.curve(c), homes[c])).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::strands::follow::tests::drawn;

    /// A strand that stands at `x`, m, leaning by `lean`.
    fn strand(x: f64, lean: f64) -> Vec<Vector3<f64>> {
        (0..5).map(|i| 0.02 * f64::from(i)).map(|s| Vector3::new(x + lean * s, s, 0.0)).collect()
    }

    /// Forty guides 1 cm apart, four to a leaf wisp, the last ten of another group, and the weights of each for a strand.
    fn weights(points: &[Vector3<f64>], home: Membership, clumping: f64) -> Vec<f64> {
        let guides: Vec<RestGuide> = (0..40).map(|i| drawn(&strand(0.01 * f64::from(i), 0.0))).collect();
        let homes: Vec<Membership> =
            (0..40).map(|i| Membership { leaf: (i / 4, 0), group: u32::from(i >= 30) }).collect();
        let choice = Choice { guides: &guides, homes: &homes, clumping: &[clumping; 3] };
        let mut weights = vec![0.0; 40];
        choice.choose(points, home).into_iter().for_each(|(g, weight)| weights[g] += weight);
        weights
    }

    #[test]
    fn weights_change_without_a_jump_over_the_borders_of_wisps() {
        let home = |x: f64| Membership { leaf: ((x / 0.04).round().clamp(0.0, 9.0) as u32, 0), group: 0 };
        let mut last: Option<Vec<f64>> = None;
        for i in 0..2800 {
            let x = 0.005 + 1e-4 * f64::from(i);
            let now = weights(&strand(x, 0.0), home(x), 0.0);
            assert!((now.iter().sum::<f64>() - 1.0).abs() < 1e-12);
            if let Some(last) = last {
                let step = now.iter().zip(last).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
                // A guide is 100 steps from the next.
                assert!(step < 0.05, "{step} at {x} m");
            }
            last = Some(now);
        }
    }

    #[test]
    fn a_strand_beside_a_guide_follows_that() {
        let home = Membership { leaf: (1, 0), group: 0 };
        assert!(weights(&strand(0.05001, 0.0), home, 0.0)[5] > 0.999);
        // Root beside one, most of it beside another.
        let weights = weights(&strand(0.05, 0.5), home, 0.0);
        assert!(weights[7] > weights[5], "{weights:?}");
    }

    #[test]
    fn clumped_strands_keep_to_their_wisp_and_all_to_their_group() {
        let edge = strand(0.0349, 0.0);
        let own = |weights: &[f64], of: std::ops::Range<usize>| weights[of].iter().sum::<f64>();
        let home = Membership { leaf: (0, 0), group: 0 };
        let shares = [0.0, 0.5, 1.0].map(|clumping| own(&weights(&edge, home, clumping), 0..4));
        assert!(shares[0] < 0.6 && shares[0] < shares[1] && shares[1] < shares[2], "{shares:?}");
        assert_eq!(shares[2], 1.0);
        let border = weights(&strand(0.2949, 0.0), Membership { leaf: (7, 0), group: 1 }, 0.0);
        assert!((own(&border, 30..40) - 1.0).abs() < 1e-12);
        // A group without guides takes any.
        assert!(
            (own(&weights(&edge, Membership { leaf: (0, 0), group: 2 }, 0.0), 0..40) - 1.0).abs() < 1e-12
        );
    }
}
