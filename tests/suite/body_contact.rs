//! A strand against a ball (S17): it rests on it, slides round it, and a fast ball does not pass through it.

use crate::strand::hair;
use hairbake::contact::Bodies;
use hairbake::dynamics::environment::Environment;
use hairbake::dynamics::guide::{ContactMode, GuideModel, GuideScratch, GuideState};
use hairbake::dynamics::guide_rods::GuideRods;
use hairbake::dynamics::step_record::StepRecord;
use hairbake::dynamics::tie::{self, Tie};
use hairbake::geometry::Shape;
use hairbake::rod::{Rod, RodSource, SegmentSize};
use hairbake::sample::{self, Size, Style};
use hairbake::scene;
use hairbake::scene::anim::{GuideSelection, TieOrientation, TiePoint};
use nalgebra::{Isometry3, Vector3};

const RADIUS: f64 = 0.04;

/// A hair of 20 cm.
fn model() -> GuideModel {
    let rod = hair(0.2, SegmentSize::FINE);
    let drag = vec![2e-5; rod.points()];
    GuideModel::new(rod, drag, 0.3)
}

/// Simulates `seconds` at `rate` steps a second; the ball's centre moves as `centre`. Calls `each` after
/// every step with the guide, the centre and the record.
fn run(
    balls: bool,
    centre: &(dyn Fn(f64) -> Vector3<f64> + Sync),
    seconds: f64,
    rate: f64,
    each: impl FnMut(&GuideState, Vector3<f64>, StepRecord),
) -> GuideState {
    run_as(balls, ContactMode::Bodies, centre, seconds, rate, each)
}

/// The same with a contact mode.
fn run_as(
    balls: bool,
    mode: ContactMode,
    centre: &(dyn Fn(f64) -> Vector3<f64> + Sync),
    seconds: f64,
    rate: f64,
    mut each: impl FnMut(&GuideState, Vector3<f64>, StepRecord),
) -> GuideState {
    let ball = Shape::Sphere { centre: Vector3::zeros(), radius: RADIUS };
    let bodies = Bodies::from_shapes(if balls { std::slice::from_ref(&ball) } else { &[] });
    let env = Environment {
        body: Box::new(|_, t| Isometry3::from_parts(centre(t).into(), nalgebra::UnitQuaternion::identity())),
        ..Environment::at_rest(bodies)
    };
    let (model, h) = (model(), 1.0 / rate);
    let mut state = GuideState::new(&model, &[5e-4], &env, 0.0, h);
    let mut scratch = GuideScratch::default();
    for i in 0..(seconds * rate) as u32 {
        let (t0, t1) = (f64::from(i) * h, f64::from(i + 1) * h);
        let record = model.step(&env, &mut state, [t0, t1], mode, &mut scratch);
        each(&state, centre(t1), record);
    }
    state
}

/// Takes `steps` steps of `h`, s, from time 0, with contact with bodies.
fn take_steps(model: &GuideModel, env: &Environment, state: &mut GuideState, h: f64, steps: u32) {
    let mut scratch = GuideScratch::default();
    for i in 0..steps {
        let span = [f64::from(i) * h, f64::from(i + 1) * h];
        model.step(env, state, span, ContactMode::Bodies, &mut scratch);
    }
}

/// The polyline in which a guide meets bodies, m.
fn line(model: &GuideModel, state: &GuideState) -> Vec<Vector3<f64>> {
    let mut line = Vec::new();
    state.contact_polyline(model, &mut line);
    line
}

/// Least distance of a polyline to the ball's surface, m; negative inside.
fn least(x: &[Vector3<f64>], centre: Vector3<f64>) -> f64 {
    let of = |a: Vector3<f64>, b: Vector3<f64>| {
        let u = ((centre - a).dot(&(b - a)) / (b - a).norm_squared()).clamp(0.0, 1.0);
        (a + (b - a) * u - centre).norm() - RADIUS
    };
    x.windows(2).map(|w| of(w[0], w[1])).fold(f64::INFINITY, f64::min)
}

/// The same at worst on the straight way of points and ball through a step.
fn least_on_the_way(x: [&[Vector3<f64>]; 2], centre: [Vector3<f64>; 2]) -> f64 {
    let at = |u: f64| {
        let x: Vec<_> = x[0].iter().zip(x[1]).map(|(a, b)| a.lerp(b, u)).collect();
        least(&x, centre[0].lerp(&centre[1], u))
    };
    (0..=200).map(|i| at(f64::from(i) / 200.0)).fold(f64::INFINITY, f64::min)
}

#[test]
fn a_falling_strand_comes_to_rest_on_a_ball() {
    // A ball where the strand would hang without it.
    let nowhere = |_: f64| Vector3::zeros();
    let free = run(false, &nowhere, 3.0, 192.0, |_, _, _| {});
    let hung = *free.x.iter().find(|x| x.y < -0.06).unwrap();
    let place = move |_: f64| hung + Vector3::new(0.02, 0.0, 0.003);
    assert!(least(&free.x, place(0.0)) < -0.01);
    let mut deepest = f64::INFINITY;
    let mut active = 0;
    let guide = run(true, &place, 3.0, 192.0, |g, c, r| {
        deepest = deepest.min(least(&g.x, c));
        active = r.active;
        assert_eq!((r.unconverged, r.truncated), (0, 0));
    });
    assert!(deepest > 0.0, "inside by {} mm", -1e3 * deepest);
    assert!(active > 0, "does not touch the ball");
    let fastest = guide.v.iter().map(|v| v.norm()).fold(0.0, f64::max);
    assert!(fastest < 2e-3, "still moves at {fastest} m/s");
}

#[test]
fn springs_hold_a_strand_about_where_constraints_do_and_never_throw_it() {
    let place = |_: f64| Vector3::new(0.08, -0.09, 0.003);
    for rate in [24.0, 192.0] {
        let ends = [ContactMode::Bodies, ContactMode::Springs].map(|mode| {
            let mut fastest = 0.0_f64;
            let guide = run_as(true, mode, &place, 3.0, rate, |g, _, r| {
                fastest = g.v.iter().map(|v| v.norm()).fold(fastest, f64::max);
                assert_eq!((r.unconverged, r.halvings * u32::from(mode == ContactMode::Springs)), (0, 0));
            });
            let still = guide.v.iter().map(|v| v.norm()).fold(0.0, f64::max);
            assert!(still < 1e-2, "{rate} steps a second: still moves at {still} m/s");
            (line(&model(), &guide), fastest)
        });
        let [(held, fast), (pushed, sprung_fast)] = &ends;
        assert!(*sprung_fast < 1.2 * fast, "{rate} steps a second: {sprung_fast} of {fast} m/s");
        // At a step a frame it falls by 17 mm into the ball before that pushes, and may slide off.
        if rate < 100.0 {
            continue;
        }
        let nearest = [held, pushed].map(|x| least(x, place(0.0)));
        // The clearance is half a millimetre, of which the spring gives way by less than a fifth.
        assert!(nearest[0] > 0.0 && (4e-4..5e-4).contains(&nearest[1]), "{nearest:?}");
        let off = held.iter().zip(pushed).map(|(a, b)| (a - b).norm()).fold(0.0, f64::max);
        assert!(off < 3e-3, "{off} m apart");
    }
}

#[test]
fn a_curve_that_bulges_over_its_points_is_held_by_what_bulges() {
    // A half circle that hangs from its root, whose lowest place is between two of its points.
    let radius = 0.02;
    let points: Vec<_> = (0..=40)
        .map(|i| std::f64::consts::PI * f64::from(i) / 40.0)
        .map(|a| Vector3::new(-radius * a.cos(), -radius * a.sin(), 0.0))
        .collect();
    let rod = Rod::new(&RodSource {
        damping: 0.02,
        segment_size: SegmentSize { max_length: 0.02, max_turn: 1.3 },
        ..RodSource::hair(&points, &[0.0, 0.4, 0.8, 1.0])
    })
    .unwrap();
    let plane = Shape::Plane { point: Vector3::y() * -0.03, normal: Vector3::y() };
    let bodies = Bodies::from_shapes(&[plane]);
    // Up by 15 mm in 0.3 s, from 1 cm below.
    let height = |t: f64| 0.015 * (t / 0.3).min(1.0);
    let env = Environment {
        gravity: Box::new(|_| Vector3::zeros()),
        body: Box::new(|_, t| Isometry3::translation(0.0, height(t), 0.0)),
        ..Environment::at_rest(bodies)
    };
    let (drag, h) = (vec![2e-5; rod.points()], 1.0 / 96.0);
    let model = GuideModel::new(rod, drag, 0.3);
    let mut state = GuideState::new(&model, &[5e-4], &env, 0.0, h);
    let (mut scratch, mut shape) = (GuideScratch::default(), hairbake::rod::RodShape::default());
    let (mut least, mut bulge) = (f64::INFINITY, 0.0_f64);
    for i in 0..60 {
        let (t0, t1) = (f64::from(i) * h, f64::from(i + 1) * h);
        let record = model.step(&env, &mut state, [t0, t1], ContactMode::Bodies, &mut scratch);
        assert_eq!((record.unconverged, record.truncated, record.unsettled), (0, 0, 0), "at {t1} s");
        assert!(shape.update(&model.rod, &model.rod.root.r, &state.q[0]));
        let lowest = |x: &mut dyn Iterator<Item = Vector3<f64>>| x.map(|x| x.y).fold(f64::INFINITY, f64::min);
        let curve = lowest(&mut shape.refined_curve(&model.rod, &state.q[0]).map(|x| x + model.rod.root.p));
        least = least.min(curve - (height(t1) - 0.03));
        bulge = bulge.max(lowest(&mut state.x.iter().copied()) - curve);
    }
    assert!(bulge > 8e-4, "its points are as low: {bulge} m");
    assert!((4.5e-4..6e-4).contains(&least), "{least} m from the plane");
}

#[test]
fn a_rising_ball_takes_the_strand_along() {
    // Up to a ball's diameter a step: 2 m/s at one step a film frame, 10 m/s at eight.
    for (rate, speed) in [(24.0, 1.0), (24.0, 2.0), (192.0, 1.0), (192.0, 4.0), (192.0, 10.0)] {
        let rise = move |t: f64| Vector3::new(0.12, -0.3 + speed * t, 0.003);
        let mut deepest = f64::INFINITY;
        let mut before: Option<(Vec<Vector3<f64>>, Vector3<f64>)> = None;
        let mut through = f64::INFINITY;
        let mut top = f64::MIN;
        let seconds = 0.34 / speed;
        let guide = run(true, &rise, seconds, rate, |g, c, r| {
            // Of a divided step the way is not known.
            if let Some((x, from)) = before.take().filter(|_| r.halvings == 0) {
                through = through.min(least_on_the_way([&x, &g.x], [from, c]));
            }
            before = Some((g.x.clone(), c));
            deepest = deepest.min(least(&g.x, c));
            top = c.y;
            assert_eq!((r.unconverged, r.truncated), (0, 0));
        });
        assert!(deepest > 0.0, "{speed} m/s, {rate} steps a second: inside by {} mm", -1e3 * deepest);
        assert!(through > 0.0, "{speed} m/s, {rate} steps a second: went through by {} mm", -1e3 * through);
        let highest = guide.x.iter().map(|x| x.y).fold(f64::MIN, f64::max);
        // Where a step is as long as the ball, the strand may slide off its side.
        assert!(
            highest > top || speed / rate > RADIUS,
            "{speed} m/s, {rate} steps a second: the ball is past"
        );
    }
}

/// The place of the first tie of a guide, m.
fn tied(model: &GuideModel, state: &GuideState) -> Vector3<f64> {
    let (line, tie) = (line(model, state), &model.ties[0]);
    let (k, u) = tie.position(&line, &tie.goal);
    line[k].lerp(&line[k + 1], u)
}

#[test]
fn a_tie_brings_a_place_to_a_body_and_holds_it_until_it_is_opened() {
    // The body stands, then moves sideways at up to 0.3 m/s.
    let carrier =
        |_: usize, t: f64| Isometry3::translation(0.0, 0.0, 0.05 * (6.0 * (t - 1.0).max(0.0)).sin());
    let env = Environment { carrier: Box::new(&carrier), ..Environment::at_rest(Bodies::default()) };
    let rod = hair(0.2, SegmentSize::FINE);
    let drag = vec![2e-5; rod.points()];
    let h = 1.0 / 96.0;
    let mut model = GuideModel::new(rod, drag, 0.3);
    let mut state = GuideState::new(&model, &[], &env, 0.0, h);
    let goal = Vector3::new(0.04, -0.05, 0.02);
    model.ties = vec![Tie { times: [0.0, 2.0], ..Tie::new(&model.rod, 28, 0.6, goal) }];
    let (mut scratch, mut farthest) = (GuideScratch::default(), 0.0_f64);
    let away = |state: &GuideState, t: f64| {
        (tied(&model, state) - (carrier(0, t) * nalgebra::Point3::from(goal)).coords).norm()
    };
    for i in 0..288 {
        let (t0, t1) = (f64::from(i) * h, f64::from(i + 1) * h);
        let record = model.step(&env, &mut state, [t0, t1], ContactMode::Bodies, &mut scratch);
        assert_eq!((record.unconverged, record.unsettled, record.truncated), (0, 0, 0), "{t1} s");
        if (0.5..2.0).contains(&t1) {
            assert!(away(&state, t1) < 1e-7, "{t1} s: {} m away", away(&state, t1));
            assert!(record.tie_slack < 1e-7);
        }
        farthest = farthest.max(away(&state, t1) * f64::from(u8::from(t1 > 2.0)));
    }
    assert!(farthest > 0.05, "not let go: {farthest} m");
}

#[test]
fn a_tie_holds_hair_at_a_length_that_reaches_it() {
    let folder = tempfile::tempdir().unwrap();
    let size = Size { wisps: Some(40), strands: Some(0), head_subdivisions: 4 };
    sample::write(Style::Long, size, folder.path()).unwrap();
    let load = scene::load(&folder.path().join("groom.json"), &folder.path().join("turn.json"));
    let (groom, mut anim) = load.unwrap();
    let groom = groom.with_default_trees(anim.settings.nodes);
    // Hair of the nape, and of the other side, passes nearest to it close to its roots.
    let bundle = (Vector3::new(0.0, 0.15, -0.125), 0.012);
    anim.ties = vec![hairbake::scene::anim::Tie {
        name: "ponytail".into(),
        body: 0,
        guides: GuideSelection::default(),
        point: TiePoint::Nearest,
        bundle: Some(bundle),
        orientation: TieOrientation::Free,
        slides: false,
        releases: false,
        times: [f64::NEG_INFINITY, f64::INFINITY],
    }];
    let rods = GuideRods::new(&groom, &anim);
    let ties = tie::ties(&groom, &anim, &rods.simulated);
    let mut nearest = Vec::new();
    for (rod, ties) in rods.simulated.iter().zip(&ties) {
        let (arc, Tie { segment, u, goal, .. }) = (&rod.rod.arc, &ties[0]);
        let share = 0.5 * ((segment % 2) as f64 + u);
        let held = arc[segment / 2] + share * (arc[segment / 2 + 1] - arc[segment / 2]);
        nearest.push(held / (rod.rod.root.p - goal).norm());
    }
    assert_eq!(nearest.len(), 40);
    assert!(nearest.iter().all(|reach| *reach > 1.0999), "{nearest:?}");
    // What reaches it as drawn is held there.
    assert!(nearest.iter().any(|reach| *reach > 1.2), "{nearest:?}");
}

/// A strand whose tip is pressed on a plate, with friction at root and tip: how far the tip creeps from where
/// it first touched, and how far the strand comes to stand aside, m, and the rounds of the last step.
fn pressed_on_a_plate(friction: [f64; 2]) -> (f64, f64, u32) {
    let plate = Shape::Plane { point: Vector3::x() * 0.21, normal: -Vector3::x() };
    let bodies = Bodies::from_shapes(&[plate]);
    // Clamped at the origin, pointing at the plate; pushed towards it by a fifth of its length in two
    // seconds.
    let head = |t: f64| Isometry3::translation(0.02 * t, 0.0, 0.0);
    let env = Environment {
        head: Box::new(&head),
        gravity: Box::new(|_| Vector3::new(0.0, -1e-4, 1e-4)),
        ..Environment::at_rest(bodies)
    };
    let rod = hair(0.2, SegmentSize::FINE);
    let drag = vec![2e-5; rod.points()];
    let h = 1.0 / 48.0;
    let mut model = GuideModel::new(rod, drag, 0.0);
    let mut state = GuideState::new(&model, &[5e-4], &env, 0.0, h);
    model.friction = friction.map(Into::into);
    let mut scratch = GuideScratch::default();
    let mut stuck = None;
    let (mut crept, mut rounds) = (0.0_f64, 0);
    for i in 0..120 {
        let record = model.step(
            &env,
            &mut state,
            [f64::from(i) * h, f64::from(i + 1) * h],
            ContactMode::Bodies,
            &mut scratch,
        );
        assert_eq!((record.unconverged, record.truncated, record.halvings), (0, 0, 0), "step {i}");
        let tip = state.x.last().unwrap();
        if record.active > 0 {
            let start = *stuck.get_or_insert(*tip);
            crept = crept.max((tip - start).yz().norm());
            rounds = record.rounds;
        }
    }
    let aside = state.x.iter().map(|x| x.yz().norm()).fold(0.0, f64::max);
    (crept, aside, rounds)
}

#[test]
fn a_strand_pressed_on_a_plate_buckles_and_its_tip_stays_where_it_stuck() {
    let (crept, aside, rounds) = pressed_on_a_plate([10.0; 2]);
    assert!(crept < 1e-9, "{crept}");
    assert!(aside > 0.03, "{aside}");
    assert!(rounds <= 3, "{rounds}");
}

#[test]
fn friction_changes_from_root_to_tip() {
    // It is the tip that touches.
    let ((held, ..), (slid, ..)) = (pressed_on_a_plate([0.0, 10.0]), pressed_on_a_plate([10.0, 0.0]));
    assert!(held < 1e-9 && slid > 0.01, "{held} {slid}");
}

/// Steps in which a strand did not come to rest, or that were divided, and the largest residual, while it
/// hangs over a ball under `gravity`, m/s², and another comes down on it until there is `room`, m, between
/// the two.
fn over_a_ball(gravity: f64, room: f64) -> (u32, f64) {
    let ball = |y: f64| Shape::Sphere { centre: Vector3::new(0.1, y, 0.0), radius: RADIUS };
    let bodies = Bodies::from_shapes(&[ball(-RADIUS - 1e-3), ball(RADIUS - 1e-3)]);
    let down = |t: f64| Vector3::y() * (room + 0.01 * (1.0 - t).max(0.0));
    let env = Environment {
        gravity: Box::new(|_| Vector3::y() * -gravity),
        body: Box::new(|b, t| {
            Isometry3::from_parts((down(t) * b as f64).into(), nalgebra::UnitQuaternion::identity())
        }),
        ..Environment::at_rest(bodies)
    };
    let rod = hair(0.2, SegmentSize::FINE);
    let (h, drag) = (1.0 / 192.0, vec![2e-5; rod.points()]);
    let model = GuideModel::new(rod, drag, 0.3);
    let mut state = GuideState::new(&model, &[5e-4; 2], &env, 0.0, h);
    let mut scratch = GuideScratch::default();
    let (mut restless, mut residual) = (0, 0.0_f64);
    for i in 0..384 {
        let record = model.step(
            &env,
            &mut state,
            [f64::from(i) * h, f64::from(i + 1) * h],
            ContactMode::Bodies,
            &mut scratch,
        );
        restless += record.unsettled + record.halvings;
        residual = residual.max(record.residual);
        assert_eq!((record.unconverged, record.crossed), (0, 0), "step {i}");
    }
    (restless, residual)
}

#[test]
fn every_step_comes_to_rest() {
    // Ever tauter, and wedged where it cannot keep its distance from both balls.
    let free = [9.81, 300.0, 1000.0].map(|gravity| (gravity, 0.1));
    let wedged = [(9.81, 8e-4), (300.0, 8e-4), (275.5, 8e-4), (338.5, 8e-4), (275.5, 9e-4), (293.5, 7e-4)];
    for (gravity, room) in free.into_iter().chain(wedged) {
        let (restless, residual) = over_a_ball(gravity, room);
        assert!(restless == 0 && residual < 1e-5, "{gravity} {room}: {restless}, {residual}");
    }
}

#[test]
fn a_strand_drawn_deep_into_a_ball_is_brought_out() {
    let (radius, model, h) = (0.06, model(), 1.0 / 192.0);
    // Heads for the ball, beside its middle, and ends 4 cm deep; its weight pulls it on.
    let centre = Vector3::new(0.21, 0.015, 0.0);
    let bodies = Bodies::from_shapes(&[Shape::Mesh(Shape::Sphere { centre, radius }.tessellate())]);
    let env = Environment {
        gravity: Box::new(|_| Vector3::x() * 9.81),
        push_out: Box::new(|t| (t / 0.5).clamp(0.0, 1.0)),
        ..Environment::at_rest(bodies)
    };
    let mut state = GuideState::new(&model, &[5e-4], &env, 0.0, h);
    let nearest = |x: Vec<Vector3<f64>>| x.iter().map(|x| (x - centre).norm()).fold(f64::INFINITY, f64::min);
    let deepest = |state: &GuideState| radius - nearest(line(&model, state));
    assert!(deepest(&state) > 0.04 && state.clearance.counts().0 == 0);
    take_steps(&model, &env, &mut state, h, 192);
    assert!(deepest(&state) < -4e-4, "{}", deepest(&state));
    assert_eq!(state.clearance.counts(), (0, 0));
}
