use super::problem::target_distance;
use super::tolerances::{MAX_COMPRESSION, MAX_TIP_SPEED, MIN_DISTANCE_SHARE, PUSH_OUT_SPEED};
use super::*;
use crate::contact::{Bodies, BodyMotion, Contact, MovingPolyline};
use crate::dynamics::contact_polyline::{on_rod, with_midpoints};
use crate::geometry::{Feature, Shape as SceneShape};
use crate::math::se3::Pose;
use crate::rod::potential::Load;
use crate::rod::{Rod, RodSource};
use nalgebra::{Isometry3, Vector3};

const KEEP: f64 = 5e-4;

/// A straight rod along x of 0.1 m.
fn straight() -> Rod {
    Rod::new(&RodSource {
        stiffness: [1e-9; 3],
        line_density: 1e-5,
        ..RodSource::hair(&[Vector3::zeros(), Vector3::x() * 0.1], &[0.0, 0.25, 0.5, 0.75, 1.0])
    })
    .unwrap()
}

/// Calls `of` with the contact problem of a step of `rod` from `x0` among moving bodies.
fn in_step<R>(
    rod: &Rod,
    bodies: &Bodies,
    motions: &[BodyMotion],
    clearance: &[[f64; 2]],
    x0: &[Vector3<f64>],
    of: impl FnOnce(&BodyContact) -> R,
) -> R {
    of(&BodyContact {
        rod,
        bodies,
        motions,
        clearance,
        slides: &vec![false; bodies.bodies.len()],
        by_part: false,
        pushed_out: false,
        x0,
        fastest: 0.0,
        ties: &[],
        friction: [0.3.into(); 2],
        across: 1.0,
        root: &Pose { r: rod.root.r, p: Vector3::zeros() },
        load: &Load::default(),
    })
}

/// Calls `of` with a contact near the tip of a polyline at height `before` above the plane y = 0 at the start
/// of a step of `h`, s, and `now` at its end, which keeps the distance `keep`.
fn over_a_plane<R>(
    h: f64,
    keep: f64,
    heights: [f64; 2],
    of: impl FnOnce(&BodyContact, &MovingPolyline, Contact) -> R,
) -> R {
    over_a_plane_at(2 * (straight().points() - 2), h, keep, heights, of)
}

/// [`over_a_plane`] in the middle of a segment of the contact polyline.
fn over_a_plane_at<R>(
    segment: usize,
    h: f64,
    keep: f64,
    [before, now]: [f64; 2],
    of: impl FnOnce(&BodyContact, &MovingPolyline, Contact) -> R,
) -> R {
    let motion = BodyMotion { times: [0.0, h], start: Isometry3::identity(), end: Isometry3::identity() };
    let at = |y: f64| -> Vec<_> { (0..segment + 2).map(|k| Vector3::new(0.01 * k as f64, y, 0.0)).collect() };
    let (x0, x1, clearance) = (at(before), at(now), vec![[keep; 2]; segment + 1]);
    let line = MovingPolyline { x0: &x0, x1: &x1, clearance: &clearance, by_part: false };
    let mut contact = Contact {
        segment,
        u: 0.5,
        body: 0,
        feature: Feature::Face(0),
        normal: Vector3::y(),
        point: [Vector3::zeros(); 2],
        gap: 0.0,
        friction: None,
    };
    in_step(&straight(), &Bodies::default(), &[motion], line.clearance, &x0, |problem| {
        contact.gap = line.gap(&contact) - problem.tolerated(&line, &contact);
        of(problem, &line, contact)
    })
}

#[test]
fn compression_never_reaches_the_surface() {
    for h in [1e-6, 1e-4, 5e-3] {
        for before in [1e-6, 2e-5, 2e-4, 5e-4, 1e-3] {
            over_a_plane(h, KEEP, [before, before], |problem, line, contact| {
                let target = target_distance(line, &contact);
                let compressible = problem.compressible(line, &contact);
                assert!(
                    target - MAX_COMPRESSION * compressible > MIN_DISTANCE_SHARE * target,
                    "{h} {before}: {compressible} of {target}"
                );
                // In a long step it is a share of the clearance.
                assert!(
                    h < 1e-3 || (compressible / KEEP - 1.0).abs() < 1e-12,
                    "{h} {before}: {compressible}"
                );
            });
        }
    }
}

#[test]
fn a_wedged_strand_keeps_a_share_of_the_target_distance() {
    let shortfall =
        |before, now| over_a_plane(5e-3, KEEP, [before, now], |problem, line, c| problem.shortfall(line, &c));
    assert_eq!(shortfall(KEEP, 0.12 * KEEP), 0.0);
    assert!((shortfall(KEEP, 0.0) - MIN_DISTANCE_SHARE * KEEP).abs() < 1e-12);
    // A strand that starts nearer, or inside, may stay there.
    assert_eq!([0.02 * KEEP, -1e-4].map(|y| shortfall(y, y)), [0.0; 2]);
    assert!([0.02 * KEEP, -1e-4].iter().all(|&y| shortfall(y, y - 1e-5) > 0.9e-5));
}

#[test]
fn what_is_brought_out_of_a_body_keeps_up_with_its_distance() {
    // The distance rises by 0.4 mm: slower than a point is pushed out.
    let gap = |h: f64| over_a_plane(h, -0.02, [-0.0204, -0.0204], |_, _, contact| contact.gap);
    assert!((gap(5e-3) + 4e-4).abs() < 1e-12, "{}", gap(5e-3));
    // In a short step only as far as that speed takes it.
    assert!((gap(1e-3) + 3e-4).abs() < 1e-12, "{}", gap(1e-3));
}

#[test]
fn what_is_near_the_root_is_pushed_out_slowly_for_the_tip_has_the_longer_arm() {
    let speed = |segment: usize, keep: f64, pushed_out: bool| {
        let h = 1e-3;
        let target = |problem: &BodyContact, line: &MovingPolyline, mut c: Contact| {
            let problem = BodyContact { pushed_out, ..*problem };
            c.gap = line.gap(&c) - problem.tolerated(line, &c);
            let (k, u) = on_rod(segment, 0.5);
            (problem.rod.arc_fraction(k, u), target_distance(line, &c))
        };
        let (share, target) = over_a_plane_at(segment, h, keep, [-5e-3; 2], target);
        (share, (target + 5e-3) / h)
    };
    let (share, at_root) = speed(0, KEEP, false);
    assert!(share < 0.1 && (at_root - MAX_TIP_SPEED * share).abs() < 1e-9, "{at_root} at {share}");
    let (_, at_tip) = speed(2 * (straight().points() - 2), KEEP, false);
    assert!((at_tip - PUSH_OUT_SPEED).abs() < 1e-9, "{at_tip}");
    // What the groom is drawn in follows its clearance, which rises slowly.
    let (_, drawn) = speed(0, -1e-3, true);
    assert!((drawn - PUSH_OUT_SPEED).abs() < 1e-9, "{drawn}");
    // Other hair does not, while that comes out.
    assert_eq!(speed(0, KEEP, true), (share, at_root));
}

#[test]
fn a_violation_within_the_gap_tolerance_is_no_shortfall() {
    over_a_plane(1.6e-5, KEEP, [2e-6, 3e-7], |problem, line, contact| {
        assert!(
            line.gap(&contact) + KEEP < MIN_DISTANCE_SHARE * target_distance(line, &contact)
                && contact.gap < 0.0
        );
        assert_eq!(problem.shortfall(line, &contact), 0.0);
    });
}

const SHARES: [f64; 5] = [0.0, 0.125, 0.25, 0.5, 1.0];

/// Truncates a motion of [`straight`] that bends it by 14/m in a step of `h`, s, among balls of radius 2 cm
/// at x = 0.04 m: heights of their centres at the start, and their rise. Returns whether each of [`SHARES`]
/// crosses a ball and its shortfall, the chosen share, and whether it gains no speed.
fn truncated(h: f64, balls: &[[f64; 2]]) -> ([(bool, f64); 5], f64, bool) {
    let rod = straight();
    let mut bent = rod.initial_q.clone();
    let mut solver = Solver::default();
    bent.iter_mut().step_by(3).for_each(|q| *q += 14.0);
    solver.shape.update(&rod, &rod.root.r, &bent);
    let tip = solver.shape.x(rod.points() - 1);
    let up = (tip - Vector3::x() * tip.x).normalize();
    let ball = |[y, _]: &[f64; 2]| SceneShape::Sphere { centre: Vector3::x() * 0.04 + up * *y, radius: 0.02 };
    let bodies = Bodies::from_shapes(&balls.iter().map(ball).collect::<Vec<_>>());
    let motion = |[_, by]: &[f64; 2]| BodyMotion {
        times: [0.0, h],
        start: Isometry3::identity(),
        end: Isometry3::from(nalgebra::Translation3::from(up * *by)),
    };
    let motions: Vec<_> = balls.iter().map(motion).collect();
    let mut x0 = Vec::new();
    solver.shape.update(&rod, &rod.root.r, &rod.initial_q);
    with_midpoints(&rod.arc, |k| solver.shape.x(k), |k| solver.shape.tangent(k), &mut x0);
    let clearance = vec![[KEEP; 2]; balls.len() * (x0.len() - 1)];
    in_step(&rod, &bodies, &motions, &clearance, &x0, |problem| {
        let (mut contact_cache, mut scratch) = (ContactCache::default(), BodyContactScratch::default());
        let tried = SHARES.map(|share| {
            let q: Vec<_> = rod.initial_q.iter().zip(&bent).map(|(a, b)| a + share * (b - a)).collect();
            solver.shape.update(&rod, &rod.root.r, &q);
            let mut scratch = BodyContactScratch::default();
            let clear = problem.find(&solver, &mut contact_cache, &mut scratch);
            (!clear, scratch.detection.shortfall)
        });
        let mut q = bent.clone();
        problem.truncate(&rod.initial_q, &mut q, &mut solver, &mut contact_cache, &mut scratch);
        (tried, (q[0] - rod.initial_q[0]) / 14.0, problem.gains_no_speed(&scratch))
    })
}

#[test]
fn a_share_that_gains_speed_is_rejected() {
    // One ball rises by 4 mm from below, the other is above: they close on the strand.
    let (tried, share, gains_no_speed) = truncated(1e-3, &[[-0.0206, 4e-3], [0.029, 0.0]]);
    assert_eq!(tried.map(|(crosses, _)| crosses), [true, true, true, false, true]);
    assert!(share == 0.0 && gains_no_speed, "{share}");
    // The full motion is taken if it crosses nothing.
    let (tried, share, gains_no_speed) = truncated(1e-3, &[[-0.0206, 4e-3]]);
    assert_eq!(tried.map(|(crosses, _)| crosses), [true, true, true, false, false]);
    assert!((share - 1.0).abs() < 1e-12 && !gains_no_speed, "{share}");
}

#[test]
fn truncation_prefers_a_share_without_shortfall() {
    // A ball above, just high enough that half of the motion does not touch it.
    let at = |height: f64| truncated(1.0, &[[height, 0.0]]);
    let height = (0..400).map(|k| 0.025 + 1e-5 * f64::from(k)).find(|y| !at(*y).0[3].0).unwrap();
    let (tried, share, gains_no_speed) = at(height);
    assert!(tried[3].1 > 0.0 && tried[2] == (false, 0.0) && gains_no_speed);
    assert!((share - 0.25).abs() < 1e-12, "{share}");
    // A share with shortfall is taken if it is the only one that crosses nothing.
    let (tried, share, _) = truncated(1.0, &[[-0.0206, 4e-3], [height, 0.0]]);
    assert_eq!(tried.map(|(crosses, _)| crosses), [true, true, true, false, true]);
    assert!((share - 0.5).abs() < 1e-12 && tried[3].1 > 0.0, "{share}");
}
