//! Ties that hair is too short to reach, known before anything moves.

use super::environment::Environment;
use super::guide_rods::GuideRods;
use super::tie::{self, Anchor, Tie};
use crate::scene::{Anim, Groom};
use nalgebra::{Isometry3, Point3, Vector3};

/// Distance of a place from its goal from which on it counts as out of reach, m: what can be seen.
const OUT_OF_REACH: f64 = 1e-3;

/// A tie that some of its guides do not reach.
#[derive(Debug, Clone, PartialEq)]
pub struct OutOfReach {
    /// The tie: index into [`Anim::ties`].
    pub tie: usize,
    /// Number of guides that it holds.
    pub guides: usize,
    /// Number of those that do not reach it in some frame.
    pub short: usize,
    /// The frames in which some do not, ascending, and how far they stay away from it there at most, m.
    pub frames: Vec<(i32, f64)>,
}

/// The ties that guides do not reach in some frame of the bake: farther from the root, or from the place that the tie
/// before it holds, than the hair between is long. Where the head, skins and bodies are then tells that; bodies in the
/// way, and loose roots, are not looked at. `groom` must have its trees, and `rods` are its own.
pub fn out_of_reach(groom: &Groom, anim: &Anim, rods: &GuideRods) -> Vec<OutOfReach> {
    if anim.ties.is_empty() {
        return Vec::new();
    }
    let ties = tie::ties(groom, anim, &rods.simulated);
    let held = |of: usize| ties.iter().filter(|ties| ties.iter().any(|tie| tie.of == of)).count();
    let unreached = |of: usize| OutOfReach { tie: of, guides: held(of), short: 0, frames: Vec::new() };
    let mut found: Vec<OutOfReach> = (0..anim.ties.len()).map(unreached).collect();
    let mut is_short = vec![vec![false; ties.len()]; found.len()];
    for frame in anim.frames.0..=anim.frames.1 {
        let t = anim.time(f64::from(frame));
        let poses: Vec<Isometry3<f64>> = anim.bodies.iter().map(|body| body.track.pose(t)).collect();
        for (i, ties) in ties.iter().enumerate().filter(|(_, ties)| !ties.is_empty()) {
            let (rod, skin) = (&rods.simulated[i].rod, groom.guides.curves.skin.get(i));
            let root = Environment::root_on(&anim.carrier(skin, t), &rod.root);
            let root = Anchor { arc: 0.0, drawn: rod.root.p, x: root.p };
            for (of, by) in distances(ties, (!rod.is_free()).then_some(root), &poses, t) {
                is_short[of][i] = true;
                match found[of].frames.last_mut().filter(|last| last.0 == frame) {
                    Some(last) => last.1 = last.1.max(by),
                    None => found[of].frames.push((frame, by)),
                }
            }
        }
    }
    for (found, is_short) in found.iter_mut().zip(is_short) {
        found.short = is_short.into_iter().filter(|short| *short).count();
    }
    found.retain(|found| found.short > 0);
    found
}

/// The ties of a guide, from root to tip, that it does not reach at time `t`, s, and how far it stays away, m.
/// `anchor` is its root unless that is free; `poses` are those of the bodies.
fn distances(
    ties: &[Tie],
    mut anchor: Option<Anchor>,
    poses: &[Isometry3<f64>],
    t: f64,
) -> Vec<(usize, f64)> {
    let mut found = Vec::new();
    for tie in ties.iter().filter(|tie| tie.holds_at(t)) {
        let goal: Vector3<f64> = (poses[tie.body] * Point3::from(tie.goal)).coords;
        let place = anchor.map_or(goal, |anchor| tie.within_reach(&anchor, &goal));
        let by = (place - goal).norm();
        if by > OUT_OF_REACH {
            found.push((tie.of, by));
        }
        if !tie.slides {
            anchor = Some(tie.anchor(place));
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rod::{Rod, RodSource};
    use crate::scene::Tree;

    #[test]
    fn the_place_that_the_tie_before_holds_is_where_hair_reaches_from() {
        let ends = [Vector3::zeros(), Vector3::x() * 0.2];
        let rod = Rod::new(&RodSource::hair(&ends, &Tree::default_arc(5))).unwrap();
        let tie = |of: usize, u: f64, y: f64| {
            // The last point of the contact polyline is the tip.
            let segment = 2 * (rod.points() - 1) - 1;
            Tie {
                of,
                slides: y == 9.0,
                ..Tie::new(&rod, (segment as f64 * u) as usize, 1.0, Vector3::y() * y)
            }
        };
        let root = Anchor { arc: 0.0, drawn: Vector3::zeros(), x: Vector3::zeros() };
        let of = |ties: &[Tie], root| distances(ties, root, &[Isometry3::identity()], 0.0);
        let (middle, tip) = (tie(0, 0.5, 0.05), tie(1, 1.0, 0.14));
        assert_eq!(of(&[middle.clone(), tip.clone()], Some(root)), [], "each is in reach of the one before");
        // From the place in the middle, 5 cm up, the tip is 18 cm away.
        let far = tie(1, 1.0, -0.13);
        assert_eq!(of(std::slice::from_ref(&far), Some(root)), []);
        let found = of(&[middle.clone(), far.clone()], Some(root));
        // It is drawn straight, which is as far as it reaches.
        let reach = (tip.drawn - middle.drawn).norm();
        assert!(
            found.len() == 1 && found[0].0 == 1 && (found[0].1 - (0.18 - reach)).abs() < 1e-9,
            "{found:?}"
        );
        // What slides goes on beyond its tip, and holds nothing for what comes after it.
        assert_eq!(of(&[tie(0, 0.5, 9.0), far.clone()], Some(root)), []);
        // A loose root comes along.
        assert_eq!(of(&[tie(0, 0.5, 0.5)], None), []);
        let late = Tie { times: [1.0, 2.0], ..tie(0, 0.5, 0.5) };
        assert_eq!(of(&[late, far], Some(root)), []);
    }
}
