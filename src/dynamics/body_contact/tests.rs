use super::*;
use crate::contact::ContactCache;
use crate::geometry::{Feature, Shape as SceneShape};
use crate::rod::{RodSource, SegmentSize, Taper};
use nalgebra::Isometry3;

const KEEP: f64 = 5e-4;

/// A straight rod along x of 0.1 m.
fn straight() -> Rod {
    Rod::new(&RodSource {
        points: &[Vector3::zeros(), Vector3::x() * 0.1],
        root_frame: None,
        arc: &[0.0, 0.25, 0.5, 0.75, 1.0],
        stiffness: [1e-9; 3],
        line_density: 1e-5,
        damping: 0.0,
        taper: Taper::NONE,
        natural_strain: None,
        segment_size: SegmentSize::FINE,
    })
    .unwrap()
}

/// Hands `of` a step of `rod` from `x0`, among bodies that move as told.
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
        x0,
        fastest: 0.0,
        ties: &[],
        friction: [0.3.into(); 2],
        across: 1.0,
        root: &Pose { r: rod.root.r, p: Vector3::zeros() },
        load: &Load::default(),
    })
}

/// A contact in the middle of a polyline that runs `before` above the plane y = 0 at the start of a step of `h`, s, and `now` at its end.
fn over_a_plane<R>(
    h: f64,
    before: f64,
    now: f64,
    of: impl FnOnce(&BodyContact, &MovingPolyline, Contact) -> R,
) -> R {
    let motion = BodyMotion { times: [0.0, h], start: Isometry3::identity(), end: Isometry3::identity() };
    let at = |y: f64| [Vector3::new(0.0, y, 0.0), Vector3::new(0.01, y, 0.0)];
    let (x0, x1) = (at(before), at(now));
    let line = MovingPolyline { x0: &x0, x1: &x1, clearance: &[[KEEP; 2]] };
    let mut contact = Contact {
        segment: 0,
        u: 0.5,
        body: 0,
        feature: Feature::Face(0),
        normal: Vector3::y(),
        point: [Vector3::zeros(); 2],
        gap: 0.0,
        friction: None,
    };
    in_step(&straight(), &Bodies::default(), &[motion], line.clearance, &x0, |touch| {
        contact.gap = line.gap(&contact) - touch.tolerated(&line, &contact);
        of(touch, &line, contact)
    })
}

#[test]
fn no_force_takes_what_is_asked_of_a_contact_down_to_the_surface() {
    for h in [1e-6, 1e-4, 5e-3] {
        for before in [1e-6, 2e-5, 2e-4, 5e-4, 1e-3] {
            over_a_plane(h, before, before, |touch, line, contact| {
                let (asked, yielding) = (asked(line, &contact), touch.yielding(line, &contact));
                assert!(asked - PRESSED * yielding > LEFT * asked, "{h} {before}: {yielding} of {asked}");
                // Where the step has the time it is a share of what is kept.
                assert!(h < 1e-3 || (yielding / KEEP - 1.0).abs() < 1e-12, "{h} {before}: {yielding}");
            });
        }
    }
}

#[test]
fn what_is_pinched_keeps_some_of_the_distance_that_is_asked_of_it() {
    let lacking = |before, now| over_a_plane(5e-3, before, now, |touch, line, c| touch.lacking(line, &c));
    assert_eq!(lacking(KEEP, 0.12 * KEEP), 0.0);
    assert!((lacking(KEEP, 0.0) - LEFT * KEEP).abs() < 1e-12);
    // What lies nearer already, or inside, may stay there.
    assert_eq!([0.02 * KEEP, -1e-4].map(|y| lacking(y, y)), [0.0; 2]);
    assert!([0.02 * KEEP, -1e-4].iter().all(|&y| lacking(y, y - 1e-5) > 0.9e-5));
}

#[test]
fn what_misses_no_more_than_is_tolerated_lacks_nothing_however_little_is_asked() {
    over_a_plane(1.6e-5, 2e-6, 3e-7, |touch, line, contact| {
        assert!(line.gap(&contact) + KEEP < LEFT * asked(line, &contact) && contact.gap < 0.0);
        assert_eq!(touch.lacking(line, &contact), 0.0);
    });
}

const SHARES: [f64; 5] = [0.0, 0.125, 0.25, 0.5, 1.0];

/// Cuts short a motion of [`straight`] that bends it by 14/m, among balls of 2 cm over or under it at 0.04 m: the heights of their centres at the start, and how
/// much higher they are after the step of `h`, s. Returns which of [`SHARES`] cross a ball and what each lacks, the share that is chosen and whether it gains no speed.
fn cut_short(h: f64, balls: &[[f64; 2]]) -> ([(bool, f64); 5], f64, bool) {
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
    in_step(&rod, &bodies, &motions, &clearance, &x0, |touch| {
        let (mut memory, mut work) = (ContactCache::default(), BodyContactScratch::default());
        let tried = SHARES.map(|share| {
            let q: Vec<_> = rod.initial_q.iter().zip(&bent).map(|(a, b)| a + share * (b - a)).collect();
            solver.shape.update(&rod, &rod.root.r, &q);
            let mut work = BodyContactScratch::default();
            let clear = touch.find(&solver, &mut memory, &mut work);
            (!clear, work.lacking)
        });
        let mut q = bent.clone();
        touch.truncate(&rod.initial_q, &mut q, &mut solver, &mut memory, &mut work);
        (tried, (q[0] - rod.initial_q[0]) / 14.0, touch.gains_none(&work))
    })
}

#[test]
fn what_would_be_thrown_is_not_cut_to_where_it_crosses_nothing() {
    // One ball comes up by 4 mm from below, the other is above: they close on it.
    let (tried, share, gains_none) = cut_short(1e-3, &[[-0.0206, 4e-3], [0.029, 0.0]]);
    assert_eq!(tried.map(|(crosses, _)| crosses), [true, true, true, false, true]);
    assert!(share == 0.0 && gains_none, "{share}");
    // But if the whole motion crosses nothing, it is taken.
    let (tried, share, gains_none) = cut_short(1e-3, &[[-0.0206, 4e-3]]);
    assert_eq!(tried.map(|(crosses, _)| crosses), [true, true, true, false, false]);
    assert!((share - 1.0).abs() < 1e-12 && !gains_none, "{share}");
}

#[test]
fn a_motion_is_cut_to_a_share_that_does_not_come_too_near() {
    // A ball above, so high that half of the motion just does not touch it.
    let at = |height: f64| cut_short(1.0, &[[height, 0.0]]);
    let height = (0..400).map(|k| 0.025 + 1e-5 * f64::from(k)).find(|y| !at(*y).0[3].0).unwrap();
    let (tried, share, gains_none) = at(height);
    assert!(tried[3].1 > 0.0 && tried[2] == (false, 0.0) && gains_none);
    assert!((share - 0.25).abs() < 1e-12, "{share}");
    // Unless that is the only one that crosses nothing.
    let (tried, share, _) = cut_short(1.0, &[[-0.0206, 4e-3], [height, 0.0]]);
    assert_eq!(tried.map(|(crosses, _)| crosses), [true, true, true, false, true]);
    assert!((share - 0.5).abs() < 1e-12 && tried[3].1 > 0.0, "{share}");
}
