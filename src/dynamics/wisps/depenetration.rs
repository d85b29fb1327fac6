//! Keeps followers out of bodies: the least strain corrections that restore the distances of their points,
//! continued from frame to frame.

use super::min_correction::{CONSTRAINT_TOLERANCE, MinCorrection};
use super::rest_shape::RestShape;
use super::snapshot::{EnvironmentSnapshot, NearPoint, PosedRod};
use crate::contact::ProximityCache;
use crate::math::se3::Pose;
use crate::rod::Rod;
use nalgebra::Vector3;

/// Most iterations: 12 cm in a frame; a guide that must move farther lags.
const MAX_ITERATIONS: usize = 40;

/// Most iterations after the first full step: surfaces and the paths of the points are curved.
const MAX_FINAL_ITERATIONS: usize = 8;

/// Distance beyond the required one within which points are constrained, and the longest move of an
/// iteration, m: no point passes through a body that is not detected.
const SEARCH_MARGIN: f64 = 0.003;

/// Depth inside a body from which a guide is brought out the nearest way, m: as deep as a strand may be drawn
/// into a round head. From deeper, the nearest way may lead to the wrong side.
const MAX_DIRECT_DEPTH: f64 = 0.02;

/// Shortfall of distance that counts as none, m.
const TOLERANCE: f64 = 2e-5;

/// Shortfall that is accepted if the iteration ends early, m: a fifth of the usual distance.
const ACCEPTABLE_SHORTFALL: f64 = 1e-4;

/// Buffers of one thread.
#[derive(Default)]
pub(super) struct DepenetrationScratch {
    posed: PosedRod,
    /// Points before the last move, m, world.
    previous_x: Vec<Vector3<f64>>,
    /// Distances within which points are constrained, m, indexed as in [`NearPoint`].
    search_distances: Vec<f64>,
    near: Vec<NearPoint>,
    problem: MinCorrection,
    /// Best correction so far, 1/m.
    best: Vec<f64>,
    /// Best correction of the first attempt, 1/m.
    first_best: Vec<f64>,
}

/// The motion that a follower's leaders prescribe.
pub(super) struct Target<'a> {
    pub rod: &'a Rod,
    /// Pose of its root, world.
    pub root: Pose,
    pub rest: &'a RestShape,
    /// Prescribed unknowns, 1/m.
    pub q: &'a [f64],
    /// Its points there, m, world.
    pub points: &'a [Vector3<f64>],
    /// Unknowns at the end of the last frame, 1/m.
    pub previous_q: &'a [f64],
}

/// How far a guide is from being clear; less is better.
#[derive(Clone, Copy, PartialEq, PartialOrd)]
struct Violation {
    /// True if a point is inside a body, deeper than at rest.
    inside: bool,
    /// Largest shortfall of distance, m, at least the acceptable one.
    shortfall: f64,
}

/// The best result of an iteration.
struct Best {
    violation: Violation,
    /// Mean displacement of the points from the target, m.
    displacement: f64,
}

/// Finds the `correction`, 1/m, of a target's unknowns with which its points keep their distances from the
/// bodies, as far as possible. It starts from the correction of the last frame, empty if there was none.
/// Returns the mean displacement of the points, m; `None` without a correction; infinite if the guide is left
/// inside a body, deeper than at rest. `cache` spares searches, as in [`EnvironmentSnapshot::find_near`]; the
/// contents of `scratch` do not affect the result.
pub(super) fn depenetrate(
    now: &EnvironmentSnapshot,
    target: &Target,
    correction: &mut Vec<f64>,
    cache: &mut ProximityCache,
    scratch: &mut DepenetrationScratch,
) -> Option<f64> {
    let required = &target.rest.state.required_distances;
    if correction.is_empty() {
        now.find_near(target.points, required, cache, &mut scratch.near);
        largest_shortfall(&scratch.near)?;
        correction.resize(target.q.len(), 0.0);
    }
    scratch.search_distances.clear();
    scratch.search_distances.extend(required.iter().map(|required| required + SEARCH_MARGIN));
    let mut best = iterate(now, target, correction, MAX_DIRECT_DEPTH, cache, scratch);
    if best.violation.inside {
        // The target is deep in a body or beyond it: retry from the last frame's shape, on its side of the
        // body.
        scratch.first_best.clone_from(&scratch.best);
        correction.clear();
        correction.extend(target.previous_q.iter().zip(target.q).map(|(previous, q)| previous - q));
        let retry = iterate(now, target, correction, f64::INFINITY, cache, scratch);
        if retry.violation < best.violation {
            best = retry;
        } else {
            scratch.best.clone_from(&scratch.first_best);
        }
    }
    correction.clone_from(&scratch.best);
    if best.violation.inside {
        return Some(f64::INFINITY);
    }
    if best.violation.shortfall <= ACCEPTABLE_SHORTFALL && correction.iter().all(|c| *c == 0.0) {
        correction.clear();
        return None;
    }
    Some(best.displacement)
}

/// Iterates from `correction`, which it changes; stops where a point is deeper inside a body than
/// `max_depth`, m. Leaves the best correction in `scratch.best`.
fn iterate(
    now: &EnvironmentSnapshot,
    target: &Target,
    correction: &mut Vec<f64>,
    max_depth: f64,
    cache: &mut ProximityCache,
    scratch: &mut DepenetrationScratch,
) -> Best {
    let required = &target.rest.state.required_distances;
    let metric = target.rest.metric(target.rod);
    let DepenetrationScratch { posed, previous_x, search_distances, near, problem, best, .. } = scratch;
    pose_corrected(posed, target, correction);
    let worst = Violation { inside: true, shortfall: f64::INFINITY };
    let mut found = Best { violation: worst, displacement: 0.0 };
    let (mut full_step, mut stationary, mut final_iterations) = (false, false, 0);
    for iteration in 0..=MAX_ITERATIONS {
        now.find_near(&posed.x, search_distances, cache, near);
        near.iter_mut().for_each(|near| near.shortfall -= SEARCH_MARGIN);
        let shortfall = largest_shortfall(near).unwrap_or(0.0);
        let depths = near.iter().map(|near| near.shortfall - required[near.index].max(0.0));
        let depth = depths.fold(0.0, f64::max);
        let violation = Violation {
            inside: near.iter().any(|n| n.shortfall > required[n.index].max(TOLERANCE)),
            shortfall: shortfall.max(ACCEPTABLE_SHORTFALL),
        };
        if violation <= found.violation {
            let displacements = target.points.iter().zip(&posed.x).map(|(a, b)| (a - b).norm());
            let displacement = displacements.sum::<f64>() / target.points.len() as f64;
            found = Best { violation, displacement };
            best.clone_from(correction);
        }
        let converged = full_step && (shortfall <= TOLERANCE || final_iterations == MAX_FINAL_ITERATIONS);
        if depth > max_depth || stationary || converged || iteration == MAX_ITERATIONS {
            break;
        }
        final_iterations += usize::from(full_step);
        problem.find(target.rod, posed, near, metric, correction);
        previous_x.clone_from(&posed.x);
        pose_corrected(posed, target, &problem.change);
        let moves = previous_x.iter().zip(&posed.x).map(|(a, b)| (a - b).norm());
        let longest = moves.fold(0.0, f64::max);
        let limit = SEARCH_MARGIN.max(2.0 * shortfall);
        (full_step, stationary) = (longest <= limit, longest < CONSTRAINT_TOLERANCE);
        if full_step {
            correction.clone_from(&problem.change);
        } else {
            let share = limit / longest;
            correction.iter_mut().zip(&problem.change).for_each(|(c, to)| *c += share * (to - *c));
            pose_corrected(posed, target, correction);
        }
    }
    found
}

/// Poses a target's rod with its unknowns corrected.
fn pose_corrected(posed: &mut PosedRod, target: &Target, correction: &[f64]) {
    posed.pose(target.rod, &target.root, target.q.iter().zip(correction).map(|(q, c)| q + c));
}

fn largest_shortfall(near: &[NearPoint]) -> Option<f64> {
    near.iter().map(|near| near.shortfall).reduce(f64::max)
}

#[cfg(test)]
mod tests {
    use super::super::rest_shape::RestState;
    use super::*;
    use crate::contact::Bodies;
    use crate::dynamics::environment::Environment;
    use crate::geometry::Shape;
    use crate::rod::RodSource;
    use crate::scene::Tree;
    use nalgebra::UnitQuaternion;

    /// A hair of 10 cm along x, of points 1 cm apart.
    fn hair() -> Rod {
        Rod::new(&RodSource::hair(&[Vector3::zeros(), Vector3::x() * 0.1], &Tree::default_arc(6))).unwrap()
    }

    /// A hair out of the bodies: its mean displacement, its points, and their distances from each body.
    struct Depenetrated {
        displacement: Option<f64>,
        x: Vec<Vector3<f64>>,
        distances: Vec<f64>,
    }

    /// Calls `test` with a function that depenetrates a hair among `shapes`, given its target unknowns, those
    /// of the last frame, and the correction.
    fn with_hair_among(
        shapes: &[Shape],
        test: impl FnOnce(&mut dyn FnMut(&[f64], &[f64], &mut Vec<f64>) -> Depenetrated),
    ) {
        let env = Environment::at_rest(Bodies::from_shapes(shapes));
        let (now, rod) = (EnvironmentSnapshot::new(&env, 0.0), hair());
        let points = 2 * rod.points() - 1;
        let required_distances = vec![5e-4; shapes.len() * points];
        let far = vec![1.0; required_distances.len()];
        let rest = RestShape::new(&rod, RestState { q: vec![0.0; rod.unknowns()], required_distances });
        let (mut cache, mut scratch) = (ProximityCache::default(), DepenetrationScratch::default());
        test(&mut |q, previous_q, correction| {
            let mut posed = PosedRod::default();
            posed.pose(&rod, &rod.root, q.iter().copied());
            let target = Target { rod: &rod, root: rod.root, rest: &rest, q, points: &posed.x, previous_q };
            let displacement = depenetrate(&now, &target, correction, &mut cache, &mut scratch);
            let corrected: Vec<f64> =
                q.iter().enumerate().map(|(n, q)| q + correction.get(n).unwrap_or(&0.0)).collect();
            posed.pose(&rod, &rod.root, corrected.iter().copied());
            Depenetrated {
                displacement,
                distances: now.distances(&rod, &rod.root, &corrected, &far),
                x: posed.x,
            }
        });
    }

    /// Depenetrates a hair that is straight along x from balls: its correction, mean displacement, and the
    /// distances of its points.
    fn straight_hair_beside(balls: &[(Vector3<f64>, f64)]) -> (Vec<f64>, Option<f64>, Vec<f64>) {
        let shapes: Vec<_> = balls.iter().map(|&(centre, radius)| Shape::Sphere { centre, radius }).collect();
        let (straight, mut correction) = (vec![0.0; hair().unknowns()], Vec::new());
        let mut found = (None, Vec::new());
        with_hair_among(&shapes, |depenetrate| {
            let Depenetrated { displacement, distances, .. } =
                depenetrate(&straight, &straight, &mut correction);
            found = (displacement, distances);
        });
        correction.resize(straight.len(), 0.0);
        (correction, found.0, found.1)
    }

    #[test]
    fn points_and_midpoints_are_brought_out() {
        // The first ball contains a point; the second only a midpoint.
        let deep = (Vector3::new(0.04, -0.008, 0.001), 0.01);
        let between = (Vector3::new(0.085, 0.0045, 0.0), 0.005);
        for balls in [&[deep][..], &[between], &[deep, between]] {
            let (correction, displacement, distances) = straight_hair_beside(balls);
            let nearest = distances.iter().copied().fold(1.0, f64::min);
            assert!((5e-4 - TOLERANCE..5e-3).contains(&nearest), "{balls:?}: {nearest}");
            let small = displacement.unwrap() < 0.006 && correction.iter().all(|q| q.abs() < 30.0);
            assert!(small, "{balls:?}: {displacement:?} {correction:?}");
        }
    }

    #[test]
    fn a_guide_left_inside_is_reported() {
        // Between balls with a gap narrower than the required distances, and between overlapping ones.
        let between = |height: f64| {
            straight_hair_beside(&[height, -height].map(|y| (Vector3::new(0.06, y, 0.0), 0.01))).1.unwrap()
        };
        let [pressed, inside] = [0.0103, 0.0098].map(between);
        assert!(pressed < 1e-3 && inside == f64::INFINITY, "{pressed} {inside}");
    }

    #[test]
    fn a_target_beyond_a_thin_body_keeps_the_guide_on_its_side() {
        let (rotation, radii) = (UnitQuaternion::identity(), Vector3::new(0.001, 0.08, 0.08));
        let plate = Shape::Ellipsoid { centre: Vector3::new(0.06, 0.0, 0.0), radii, rotation };
        let straight = vec![0.0; hair().unknowns()];
        with_hair_among(&[plate], |depenetrate| {
            // It was inside before: no side is known.
            assert_eq!(depenetrate(&straight, &straight, &mut Vec::new()).displacement, Some(f64::INFINITY));
            // Before, it was rolled up, short of the plate.
            let rolled: Vec<f64> = (0..straight.len()).map(|n| if n % 3 == 1 { 30.0 } else { 0.0 }).collect();
            let mut correction = Vec::new();
            let first = depenetrate(&straight, &rolled, &mut correction);
            let nearest = first.distances.iter().copied().fold(1.0, f64::min);
            assert!((5e-4 - TOLERANCE..6e-4).contains(&nearest), "{nearest}");
            assert!(first.x.iter().all(|x| x.x < 0.06), "{:?}", first.x);
            // With the same target it stays; with a target short of the plate the correction ends.
            let kept = correction.clone();
            let again = depenetrate(&straight, &kept, &mut correction);
            let moved = first.x.iter().zip(&again.x).map(|(a, b)| (a - b).norm()).fold(0.0, f64::max);
            assert!(moved < 2e-4 && kept != straight, "{moved}");
            let free = depenetrate(&rolled, &kept, &mut correction);
            assert_eq!((free.displacement, correction.is_empty()), (None, true));
        });
    }

    #[test]
    fn correction_is_continuous_over_frames() {
        // The target enters a ball from above and leaves it again.
        let solid = Shape::Sphere { centre: Vector3::new(0.06, -0.03, 0.0), radius: 0.03 };
        let n = hair().unknowns();
        let target = |k: usize| -> Vec<f64> {
            let bend = 6.0 - 0.2 * (60.0 - (k as f64 - 60.0).abs());
            (0..n).map(|n| if n % 3 == 1 { bend } else { 0.0 }).collect()
        };
        with_hair_among(&[solid], |depenetrate| {
            let (mut correction, mut previous) = (Vec::new(), target(0));
            let mut x: Option<Vec<Vector3<f64>>> = None;
            let (mut largest, mut held) = (0.0_f64, 0);
            for k in 0..=120 {
                let now = depenetrate(&target(k), &previous, &mut correction);
                let corrected = |(n, q): (usize, &f64)| q + correction.get(n).unwrap_or(&0.0);
                previous = target(k).iter().enumerate().map(corrected).collect();
                held += u32::from(now.displacement.is_some());
                if let Some(x) = x {
                    let moves = x.iter().zip(&now.x).map(|(a, b)| (a - b).norm());
                    largest = moves.fold(largest, f64::max);
                }
                x = Some(now.x);
            }
            // A free tip moves by ½ 0.2/m (10 cm)² per frame.
            assert!(largest < 1.1e-3, "{largest}");
            assert!(held > 40 && held < 100 && correction.is_empty(), "{held} {correction:?}");
        });
    }

    #[test]
    fn a_guide_with_its_distances_kept_is_not_moved() {
        let (correction, displacement, _) = straight_hair_beside(&[(Vector3::new(0.05, -0.011, 0.0), 0.01)]);
        assert_eq!((displacement, correction.iter().all(|q| *q == 0.0)), (None, true));
    }

    #[test]
    fn correction_is_continuous_in_the_position_of_a_body() {
        let at = |height: f64| straight_hair_beside(&[(Vector3::new(0.06, height, 0.0), 0.01)]).0;
        let corrections: Vec<Vec<f64>> = (0..=60).map(|k| at(-0.011 + 5e-5 * f64::from(k))).collect();
        let step = |w: &[Vec<f64>]| w[0].iter().zip(&w[1]).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        let largest = corrections.windows(2).map(step).fold(0.0, f64::max);
        // No step is more than nine times the mean of sixty: shortfalls within the tolerance are corrected at
        // once.
        let whole = step(&[corrections[0].clone(), corrections[60].clone()]);
        assert!(whole > 1.0 && largest < 0.15 * whole, "{largest} of {whole}");
    }
}
