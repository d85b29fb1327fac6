use super::*;
use crate::contact::{Feature, Workspace};
use crate::rod::{Cut, RodSource, Taper};
use crate::scene::Shape as SceneShape;
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
        natural: None,
        cut: Cut::FINE,
    })
    .unwrap()
}

/// Hands `of` a step of `rod` from `x0`, among bodies that move as told.
fn in_step<R>(
    rod: &Rod,
    bodies: &Bodies,
    motions: &[Motion],
    clearance: &[[f64; 2]],
    x0: &[Vector3<f64>],
    of: impl FnOnce(&Touch) -> R,
) -> R {
    of(&Touch {
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
fn over_a_plane<R>(h: f64, before: f64, now: f64, of: impl FnOnce(&Touch, &Polyline, Contact) -> R) -> R {
    let motion = Motion { times: [0.0, h], start: Isometry3::identity(), end: Isometry3::identity() };
    let at = |y: f64| [Vector3::new(0.0, y, 0.0), Vector3::new(0.01, y, 0.0)];
    let (x0, x1) = (at(before), at(now));
    let line = Polyline { x0: &x0, x1: &x1, clearance: &[[KEEP; 2]] };
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
    let bearable =
        |before, now| over_a_plane(5e-3, before, now, |touch, line, c| touch.is_bearable(line, &c));
    assert!(bearable(KEEP, 0.12 * KEEP) && !bearable(KEEP, 0.08 * KEEP));
    // What lies nearer already, or inside, may stay there.
    assert!(bearable(0.01 * KEEP, 0.01 * KEEP) && !bearable(0.01 * KEEP, -0.01 * KEEP));
    assert!(bearable(-1e-4, -1e-4) && !bearable(-1e-4, -2e-4));
}

#[test]
fn a_motion_is_cut_to_a_share_that_crosses_nothing_though_it_gains_speed() {
    let rod = straight();
    let mut bent = rod.start.clone();
    let mut solver = Solver::default();
    // Below it a ball that comes up by 4 mm at 0.04 m, above it one that does not move; a bend by 14/m takes it by 11 mm up there.
    bent.iter_mut().step_by(3).for_each(|q| *q += 14.0);
    solver.shape.update(&rod, &rod.root.r, &bent);
    let tip = solver.shape.x(rod.points() - 1);
    let up = (tip - Vector3::x() * tip.x).normalize();
    let ball = |y: f64| SceneShape::Sphere { centre: Vector3::x() * 0.04 + up * y, radius: 0.02 };
    let bodies = Bodies::from_shapes(&[ball(-0.0206), ball(0.029)]);
    let motion = |by: f64| Motion {
        times: [0.0, 1e-3],
        start: Isometry3::identity(),
        end: Isometry3::from(nalgebra::Translation3::from(up * by)),
    };
    let motions = [motion(4e-3), motion(0.0)];
    let mut x0 = Vec::new();
    solver.shape.update(&rod, &rod.root.r, &rod.start);
    with_middles(&rod.arc, |k| solver.shape.x(k), |k| solver.shape.tangent(k), &mut x0);
    let clearance = vec![[KEEP; 2]; 2 * (x0.len() - 1)];
    in_step(&rod, &bodies, &motions, &clearance, &x0, |touch| {
        let (mut memory, mut work) = (Workspace::default(), TouchWork::default());
        let crosses = |share: f64, solver: &mut Solver| {
            let q: Vec<_> = rod.start.iter().zip(&bent).map(|(a, b)| a + share * (b - a)).collect();
            solver.shape.update(&rod, &rod.root.r, &q);
            !touch.find(solver, &mut Workspace::default(), &mut TouchWork::default())
        };
        assert_eq!([0.0, 0.25, 0.5, 1.0].map(|share| crosses(share, &mut solver)), [true, true, false, true]);
        let mut q = bent.clone();
        assert!(touch.shorten(&rod.start, &mut q, &mut solver, &mut memory, &mut work));
        assert!(!touch.gains_none(&work));
        for ((q, a), b) in q.iter().zip(&rod.start).zip(&bent) {
            assert!((q - 0.5 * (a + b)).abs() < 1e-12);
        }
    });
}
