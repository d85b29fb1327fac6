//! Ends of a rod and driven places: against beams, twisted rods, and the balance of forces.

use super::planar::PlanarRod;
use hairbake::contact::Bodies;
use hairbake::dynamics::environment::Environment;
use hairbake::dynamics::guide::{ContactMode, GuideModel, GuideScratch, GuideState};
use hairbake::dynamics::load::GuideLoad;
use hairbake::dynamics::reaction::GuideReaction;
use hairbake::dynamics::tie::Tie;
use hairbake::rod::{Rod, RodShape, RodSource, RootJoint, SegmentSize};
use hairbake::scene::anim::{GuideSelection, Keyframes, Load, LoadAxes, LoadPlace, Scheme};
use nalgebra::{Isometry3, Matrix3, UnitQuaternion, Vector3};

const LENGTH: f64 = 0.1;
const BENDING: f64 = 7.8e-9;
const TORSION: f64 = 3.6e-9;

/// A guide through `points` with `nodes` evenly spaced strain nodes and this weight per length, N/m.
fn guide(points: &[Vector3<f64>], nodes: usize, weight: f64) -> GuideModel {
    let arc: Vec<f64> = (0..nodes).map(|i| i as f64 / (nodes - 1) as f64).collect();
    let rod = Rod::new(&RodSource {
        stiffness: [BENDING, BENDING, TORSION],
        line_density: weight / 9.81,
        segment_size: SegmentSize { max_length: 0.005, ..SegmentSize::FINE },
        tip_strain: true,
        ..RodSource::hair(points, &arc)
    });
    let rod = rod.unwrap();
    let drag = vec![0.0; rod.points()];
    GuideModel { scheme: Scheme::BackwardEuler, records_reaction: true, ..GuideModel::new(rod, drag, 0.3) }
}

fn straight(nodes: usize, weight: f64) -> GuideModel {
    guide(&[Vector3::zeros(), Vector3::x() * LENGTH], nodes, weight)
}

/// A tie of the tip of `rod` at `goal`, m.
fn tip_tie(rod: &Rod, goal: Vector3<f64>) -> Tie {
    Tie::new(rod, 2 * rod.points() - 3, 1.0, goal)
}

/// A tie of the middle of `rod` at `goal`, m.
fn middle_tie(rod: &Rod, goal: Vector3<f64>) -> Tie {
    Tie::new(rod, rod.points() - 2, 1.0, goal)
}

fn drawn_tip_frame(rod: &Rod) -> Matrix3<f64> {
    let mut shape = RodShape::default();
    shape.update(rod, &rod.root.r, &rod.initial_q);
    shape.frame(rod.points() - 1)
}

struct Run {
    state: GuideState,
    shape: RodShape,
    held: GuideReaction,
    slack: f64,
    /// Parts of steps without a solution.
    failed: u32,
    /// Largest distance of a point from the x axis on the way, m.
    widest: f64,
}

/// `model` after `steps` steps of `h`, s, all of which have a solution.
fn run(model: &GuideModel, env: &Environment, h: f64, steps: u32) -> Run {
    let run = run_through(model, env, h, steps);
    assert_eq!(run.failed, 0);
    run
}

/// `model` after `steps` steps of `h`, s.
fn run_through(model: &GuideModel, env: &Environment, h: f64, steps: u32) -> Run {
    run_spans(model, env, (0..steps).map(|i| [f64::from(i) * h, f64::from(i + 1) * h]))
}

/// `model` after steps over these spans, s.
fn run_spans(model: &GuideModel, env: &Environment, spans: impl Iterator<Item = [f64; 2]>) -> Run {
    let mut spans = spans.peekable();
    let [start, end] = *spans.peek().unwrap();
    let mut state = GuideState::new(model, &[], env, start, end - start);
    let (mut scratch, mut slack, mut failed, mut widest) = (GuideScratch::default(), 0.0, 0, 0.0);
    for span in spans {
        let record = model.step(env, &mut state, span, ContactMode::Bodies, &mut scratch);
        failed += record.unconverged + record.truncated + record.unsettled;
        slack = record.tie_slack;
        widest = state.x.iter().map(|x| x.yz().norm()).fold(widest, f64::max);
    }
    let mut shape = RodShape::default();
    assert!(shape.update(&model.rod, &model.rod.root.r, &state.q[0]));
    let held = model.reaction(&state).unwrap();
    Run { state, shape, held, slack, failed, widest }
}

/// `model` at rest after its ties have brought it to their goals within a second. The last steps are short: the motion
/// without ties, from which each starts, is then small.
fn gathered(model: &GuideModel) -> Run {
    let steps = [(100, 0.01), (30, 100.0), (100, 0.01)].map(|(n, h)| std::iter::repeat_n(h, n));
    let spans =
        steps.into_iter().flatten().scan(0.0, |end, h| Some([std::mem::replace(end, *end + h), *end]));
    let run = run_spans(model, &Environment::at_rest(Bodies::default()), spans);
    assert_eq!(run.failed, 0);
    run
}

fn quasi_static(model: &GuideModel) -> Run {
    run(model, &Environment::at_rest(Bodies::default()), 100.0, 20)
}

#[test]
fn a_beam_clamped_at_both_ends_sags_as_beams_do() {
    let weight = 1e-3 * BENDING / LENGTH.powi(3);
    let errors = |nodes: usize| {
        let mut model = straight(nodes, weight);
        let frame = Some(drawn_tip_frame(&model.rod));
        model.ties = vec![Tie { frame, slides: true, ..tip_tie(&model.rod, Vector3::x() * LENGTH) }];
        let Run { shape, held, slack, .. } = quasi_static(&model);
        assert!(slack < 1e-15, "{slack}");
        let sag = weight * LENGTH.powi(4) / (384.0 * BENDING);
        let end = weight * LENGTH * LENGTH / 12.0;
        let tie = held.ties[0];
        [
            -shape.x((model.rod.points() - 1) / 2).y / sag - 1.0,
            held.moment.z / end - 1.0,
            -tie.moment.z / end - 1.0,
            tie.force.y / (0.5 * weight * LENGTH) - 1.0,
        ]
    };
    let (coarse, fine) = (errors(17), errors(33));
    println!("{coarse:?} {fine:?}");
    assert!(fine.iter().all(|e| e.abs() < 1e-6), "{fine:?}");
}

#[test]
fn a_propped_beam_rests_on_its_prop_exactly() {
    let weight = 1e-3 * BENDING / LENGTH.powi(3);
    let mut model = straight(33, weight);
    model.ties = vec![Tie { slides: true, ..tip_tie(&model.rod, Vector3::x() * LENGTH) }];
    let Run { held, slack, .. } = quasi_static(&model);
    let borne = held.ties[0].force.y / (0.375 * weight * LENGTH) - 1.0;
    println!("{borne} {slack}");
    assert!(borne.abs() < 1e-6 && slack < 1e-15, "{borne} {slack}");
}

#[test]
fn a_beam_on_three_supports_shares_its_weight_as_the_three_moment_equation_has_it() {
    // A clamp, a ring in the middle and one at the tip: two spans of the length l under the weight w per length bear
    // 13, 32 and 11 times wl/28, and the clamp wl²/14.
    let weight = 1e-3 * BENDING / LENGTH.powi(3);
    let errors = |nodes: usize| {
        let mut model = straight(nodes, weight);
        let rings = [middle_tie, tip_tie].map(|tie| tie(&model.rod, Vector3::zeros()));
        model.ties = rings.map(|ring| Tie { slides: true, goal: ring.drawn, ..ring }).into();
        let Run { state, held, slack, .. } = quasi_static(&model);
        let middle = state.x[(model.rod.points() - 1) / 2];
        assert!(slack < 1e-15 && middle.y.abs() < 1e-12, "{slack} {middle}");
        let [ring, tip] = [0, 1].map(|tie| held.ties[tie].force.y);
        let sum = held.force.y + tip + ring - weight * LENGTH;
        assert!(sum.abs() < 1e-6 * weight * LENGTH, "{sum}");
        let (part, span) = (weight * LENGTH / 56.0, 0.5 * LENGTH);
        [
            held.force.y / (13.0 * part) - 1.0,
            ring / (32.0 * part) - 1.0,
            tip / (11.0 * part) - 1.0,
            held.moment.z / (weight * span * span / 14.0) - 1.0,
        ]
    };
    let (coarse, fine) = (errors(17), errors(33));
    println!("{coarse:?} {fine:?}");
    assert!(fine.iter().all(|e| e.abs() < 1e-4), "{fine:?}");
}

#[test]
fn two_places_are_held_exactly_and_the_ends_bear_the_weight() {
    // Two slack spans from a pinned root, to one place in its middle and one at its tip.
    let weight = 20.0 * BENDING / LENGTH.powi(3);
    let mut model = pinned(Vector3::x(), weight, BENDING);
    model.scheme = Scheme::BackwardEuler;
    let goals = [Vector3::new(0.04, 0.01, 0.005), Vector3::new(0.08, -0.01, -0.005)];
    model.ties = vec![middle_tie(&model.rod, goals[0]), tip_tie(&model.rod, goals[1])];
    let Run { state, held, slack, .. } = gathered(&model);
    let last = state.x.len() - 1;
    let off = [state.x[last / 2] - goals[0], state.x[last] - goals[1]].map(|off| off.norm());
    println!("{off:?} {slack} {held:?}");
    assert!(slack < 1e-9 * LENGTH && off.iter().all(|off| *off < 1e-9 * LENGTH), "{off:?} {slack}");
    let [middle, tip] = [0, 1].map(|tie| held.ties[tie].force);
    let sum = held.force + tip + middle - Vector3::y() * (weight * LENGTH);
    assert!(sum.norm() < 1e-6 * weight * LENGTH, "{sum}");
    // Of a root that turns freely, the ties alone bear the moment of the weight.
    assert!(held.moment.norm() < 1e-6 * weight * LENGTH * LENGTH, "{}", held.moment);
    let mut line = Vec::new();
    state.contact_polyline(&model, &mut line);
    // Simpson's rule over each segment.
    let share = weight * LENGTH / (6 * last) as f64;
    let sum: Vector3<f64> = (0..last).map(|k| line[2 * k] + line[2 * k + 1] * 4.0 + line[2 * k + 2]).sum();
    let of_ties = state.x[last / 2].cross(&middle) + state.x[last].cross(&tip);
    let moment = of_ties - (sum * share).cross(&Vector3::y());
    println!("{moment}");
    assert!(moment.norm() < 1e-6 * weight * LENGTH * LENGTH, "{moment}");
}

#[test]
fn a_tie_out_of_reach_of_another_pulls_the_strand_between_them_nearly_straight() {
    let mut model = straight(33, BENDING / LENGTH.powi(3));
    let goals = [Vector3::new(0.03, 0.0, 0.0), Vector3::new(0.085, 0.02, 0.0)];
    // As if it were drawn with slack.
    let slack = |tie: Tie| Tie { drawn: 0.9 * tie.drawn, ..tie };
    model.ties = vec![slack(middle_tie(&model.rod, goals[0])), slack(tip_tie(&model.rod, goals[1]))];
    let Run { state, held, .. } = gathered(&model);
    let last = state.x.len() - 1;
    let [middle, tip] = [last / 2, last].map(|k| state.x[k]);
    println!("{middle} {tip} {held:?}");
    assert!((middle - goals[0]).norm() < 1e-9 * LENGTH, "{middle}");
    let wanted = goals[0] + (goals[1] - goals[0]).normalize() * (0.4995 * LENGTH);
    assert!((tip - wanted).norm() < 1e-9 * LENGTH, "{tip} {wanted}");
}

/// Turns the tip of a straight rod without weight, pulled by nothing, by `turn`, rad, within 40 s, pushes it
/// aside a little and lets it come to rest; returns it and how far its middle is from the axis, m.
fn twisted(turn: f64) -> (Run, f64) {
    // So heavy, what grows takes seconds to do so. Longer steps would damp it.
    let mut model = straight(33, 5e3 * BENDING / LENGTH.powi(3));
    let frame = Some(drawn_tip_frame(&model.rod));
    model.ties = vec![Tie { frame, slides: true, ..tip_tie(&model.rod, Vector3::x() * LENGTH) }];
    let angle = move |t: f64| turn * (t / 40.0).min(1.0);
    let env = Environment {
        gravity: Box::new(|t| Vector3::y() * if t < 40.0 { -1e-3 } else { 0.0 }),
        carrier: Box::new(move |_, t| {
            Isometry3::from_parts(
                Vector3::zeros().into(),
                UnitQuaternion::from_axis_angle(&Vector3::x_axis(), angle(t)),
            )
        }),
        ..Environment::at_rest(Bodies::default())
    };
    let run = run_through(&model, &env, 0.5, 120);
    let middle = run.shape.x((model.rod.points() - 1) / 2);
    let off = middle.yz().norm();
    (run, off)
}

#[test]
fn a_twisted_rod_between_clamps_buckles_at_the_torque_of_greenhill() {
    // M L / EI = 8.9868 with both ends clamped and no tension (Love 1927, §272; the root of tan(x/2) = x/2).
    let critical = 8.986_818_9 * BENDING / TORSION;
    let (below, off) = twisted(0.97 * critical);
    assert_eq!(below.failed, 0);
    let torque = below.held.ties[0].moment.x / (0.97 * critical * TORSION / LENGTH) - 1.0;
    assert!(torque.abs() < 1e-5 && off < 1e-3 * LENGTH, "{torque} {off}");
    assert!((below.held.moment.x + below.held.ties[0].moment.x).abs() < 1e-9 * BENDING / LENGTH);
    // Beyond, it throws a loop. Nothing holds the ends apart, nor the loop off itself, so that it may pass over an
    // end and take two turns with it.
    let (above, _) = twisted(1.03 * critical);
    println!("{} m aside, {} parts of steps without a solution", above.widest, above.failed);
    println!("turns {}", above.held.ties[0].moment.x * LENGTH / TORSION / std::f64::consts::TAU);
    assert!(above.widest > 0.1 * LENGTH, "{}", above.widest);
}

#[test]
fn a_strand_slides_through_a_ring_without_friction() {
    let points = [Vector3::zeros(), Vector3::new(0.05, 0.01, 0.0), Vector3::new(LENGTH, 0.0, 0.0)];
    let mut model = guide(&points, 33, 2.0 * BENDING / LENGTH.powi(3));
    let goal = Vector3::new(0.06, 0.0, 0.01);
    model.ties = vec![Tie { slides: true, segment: 20, u: 0.5, ..tip_tie(&model.rod, goal) }];
    let Run { state, held, slack, .. } = quasi_static(&model);
    let mut line = Vec::new();
    state.contact_polyline(&model, &mut line);
    let (k, _) = model.ties[0].position(&line, &goal);
    let tangent = (line[k + 1] - line[k]).normalize();
    let force = held.ties[0].force;
    println!("{force} {tangent} {slack}");
    assert!(slack < 1e-12 && force.dot(&tangent).abs() < 1e-5 * force.norm(), "{slack}");
    assert!(force.y > 0.1 * 2.0 * BENDING / LENGTH.powi(2), "{force}");
}

/// When a strand of 10 cm last leans on a ring, s, that its root is drawn away from at 5 cm/s, from 6 to 11 cm, and
/// brought back to.
fn drawn_out_of_a_ring(releases: bool) -> f64 {
    let mut model = straight(33, 1e-2 * BENDING / LENGTH.powi(3));
    let ring = Tie { slides: true, releases, ..tip_tie(&model.rod, Vector3::x() * 0.06) };
    model.ties = vec![ring];
    let env = Environment {
        head: Box::new(|t| Isometry3::translation(-0.05 * (1.0 - (t - 1.0).abs()), 0.0, 0.0)),
        ..Environment::at_rest(Bodies::default())
    };
    let (h, mut scratch, mut leaned) = (0.01, GuideScratch::default(), 0.0);
    let mut state = GuideState::new(&model, &[], &env, 0.0, h);
    for i in 0..200 {
        let span = [f64::from(i) * h, f64::from(i + 1) * h];
        let record = model.step(&env, &mut state, span, ContactMode::Bodies, &mut scratch);
        assert_eq!((record.unconverged, record.truncated, record.unsettled), (0, 0, 0), "{span:?}");
        if model.reaction(&state).unwrap().ties[0].force != Vector3::zeros() {
            leaned = span[1];
        }
    }
    leaned
}

#[test]
fn a_ring_may_let_go_for_good_of_a_strand_that_slides_out() {
    // The tip is at the ring after 0.8 s; it leaves it within a step, and is free from the next.
    let (freed, held) = (drawn_out_of_a_ring(true), drawn_out_of_a_ring(false));
    assert!((0.8..0.8201).contains(&freed), "{freed}");
    assert_eq!(held, 2.0);
}

#[test]
fn a_tie_out_of_reach_pulls_a_strand_nearly_straight() {
    let mut model = straight(17, BENDING / LENGTH.powi(3));
    // As if it were drawn with slack.
    let tie = tip_tie(&model.rod, Vector3::new(LENGTH, 0.02, 0.0));
    model.ties = vec![Tie { drawn: 0.9 * tie.drawn, ..tie }];
    let Run { state, slack, .. } = quasi_static(&model);
    let (tip, goal) = (state.x[state.x.len() - 1], model.ties[0].goal);
    println!("{tip} {slack}");
    assert!((slack - (goal.norm() - 0.999 * LENGTH)).abs() < 1e-6 * LENGTH, "{tip} {slack}");
}

#[test]
fn a_strand_drawn_straight_between_its_ends_stays_so() {
    let mut model = straight(17, BENDING / LENGTH.powi(3));
    model.ties = vec![tip_tie(&model.rod, Vector3::x() * LENGTH)];
    let Run { state, slack, .. } = quasi_static(&model);
    let sag = state.x.iter().map(|x| x.y.abs()).fold(0.0, f64::max);
    println!("{sag} {slack}");
    assert!(sag < 1e-3 * LENGTH && slack < 1e-6 * LENGTH, "{sag} {slack}");
}

/// A straight guide along `direction` with a pinned root, this weight per length, N/m, and bending stiffness, N·m².
fn pinned(direction: Vector3<f64>, weight: f64, bending: f64) -> GuideModel {
    let arc: Vec<f64> = (0..33).map(|i| f64::from(i) / 32.0).collect();
    let mut rod = Rod::new(&RodSource {
        stiffness: [bending, bending, bending],
        line_density: weight / 9.81,
        segment_size: SegmentSize { max_length: 0.005, ..SegmentSize::FINE },
        ..RodSource::hair(&[Vector3::zeros(), direction * LENGTH], &arc)
    })
    .unwrap();
    rod.join_root(RootJoint::Pinned);
    let drag = vec![0.0; rod.points()];
    GuideModel { records_reaction: true, ..GuideModel::new(rod, drag, 0.3) }
}

#[test]
fn a_stiff_rod_on_a_pinned_root_swings_as_a_compound_pendulum() {
    let tilt: f64 = 0.02;
    let model = pinned(Vector3::new(tilt.sin(), -tilt.cos(), 0.0), 1e-3, 1.0);
    let env = Environment::at_rest(Bodies::default());
    let (h, mut scratch) = (5e-4, GuideScratch::default());
    let mut state = GuideState::new(&model, &[], &env, 0.0, h);
    let (mut crossings, mut before, mut largest) = (Vec::new(), 0.0_f64, 0.0_f64);
    for i in 0..6000 {
        let span = [f64::from(i) * h, f64::from(i + 1) * h];
        let record = model.step(&env, &mut state, span, ContactMode::Bodies, &mut scratch);
        assert_eq!((record.unconverged, record.halvings), (0, 0), "step {i}");
        let tip = state.x[state.x.len() - 1];
        if before > 0.0 && tip.x <= 0.0 {
            crossings.push(span[0] + h * before / (before - tip.x));
        }
        before = tip.x;
        largest = if i > 5000 { largest.max(tip.x.abs()) } else { 0.0 };
        let held = model.reaction(&state).unwrap();
        assert!(held.moment.norm() < 1e-4 * 1e-3 * LENGTH * LENGTH, "step {i}: {}", held.moment);
    }
    let periods = crossings.len() - 1;
    let period = (crossings[periods] - crossings[0]) / periods as f64;
    let wanted =
        std::f64::consts::TAU * (2.0 * LENGTH / (3.0 * 9.81_f64)).sqrt() * (1.0 + tilt * tilt / 16.0);
    println!("{} {}", period / wanted - 1.0, largest / (LENGTH * tilt.sin()) - 1.0);
    assert!((period / wanted - 1.0).abs() < 1e-4, "{period} {wanted}");
    assert!((largest / (LENGTH * tilt.sin()) - 1.0).abs() < 1e-3, "{largest}");
}

#[test]
fn an_undamped_rod_on_a_pin_that_swings_beside_its_plane_does_not_spin() {
    // Let go at 100° from hanging, by 0.1 out of a plane; all steps of six seconds have a solution.
    let (sin, cos) = 100.0_f64.to_radians().sin_cos();
    let direction = Vector3::new(sin * 0.1_f64.cos(), -cos, sin * 0.1_f64.sin());
    let model = GuideModel { scheme: Scheme::FourStep, ..pinned(direction, 6.6e-6 * 9.81, BENDING) };
    let Run { state, .. } = run(&model, &Environment::at_rest(Bodies::default()), 1.0 / 192.0, 6 * 192);
    assert!(state.x.iter().all(|x| x.norm() < 1.001 * LENGTH));
}

#[test]
fn a_pinned_rod_falls_and_comes_to_hang() {
    // From beside to below its root, with damping of the air.
    let mut model = pinned(Vector3::x(), 6.6e-6 * 9.81, BENDING);
    model.drag.fill(2e-4);
    let run = run(&model, &Environment::at_rest(Bodies::default()), 1e-3, 4000);
    let tip = run.shape.x(model.rod.points() - 1);
    println!("{tip} {:?}", run.held);
    assert!((tip + Vector3::y() * LENGTH).norm() < 1e-4 * LENGTH, "{tip}");
    let weight = 6.6e-6 * 9.81 * LENGTH;
    assert!((run.held.force - Vector3::y() * weight).norm() < 1e-3 * weight, "{:?}", run.held);
}

#[test]
fn a_catenary_with_bending_between_two_pins_is_that_of_theory() {
    let (weight, goal) = (20.0 * BENDING / LENGTH.powi(3), Vector3::new(0.07, -0.02, 0.0));
    let mut model = pinned(Vector3::x(), weight, BENDING);
    model.scheme = Scheme::BackwardEuler;
    model.ties = vec![tip_tie(&model.rod, goal)];
    let Run { shape, held, slack, .. } = run(&model, &Environment::at_rest(Bodies::default()), 100.0, 60);
    let reference = PlanarRod { length: LENGTH, bending: BENDING, natural: 0.0, weight };
    let (angle, force) = reference.hung(goal.xy());
    let t = shape.tangent(0);
    let off = [t.y.atan2(t.x) - angle, (held.ties[0].force.xy() - force).norm() / (weight * LENGTH)];
    println!("{angle} {force} {off:?} {slack} {:?}", held.moment);
    assert!(off.iter().all(|off| off.abs() < 1e-4) && slack < 1e-10, "{off:?} {slack}");
    assert!(held.moment.norm() < 1e-7 * weight * LENGTH * LENGTH, "{}", held.moment);
    let sum = held.force + held.ties[0].force - Vector3::y() * (weight * LENGTH);
    assert!(sum.norm() < 1e-9 * weight * LENGTH, "{sum}");
}

/// How far aside the middle of a loop between a pinned root and a tie swings after gravity, tilted aside until then, is
/// upright: at these steps of `h`, s, relative to how far it was.
fn swings_of_a_loop(h: f64, steps: u32) -> Vec<f64> {
    let mut model = pinned(Vector3::x(), 1e-3, BENDING);
    model.ties = vec![tip_tie(&model.rod, Vector3::new(0.06, 0.0, 0.0))];
    let env = Environment {
        gravity: Box::new(|t| Vector3::new(0.0, -9.81, if t > 0.0 { 0.0 } else { 1.0 })),
        ..Environment::at_rest(Bodies::default())
    };
    let gather = [(200, 0.01), (60, 10.0), (200, 0.01)].map(|(n, h)| std::iter::repeat_n(h, n));
    let mut state = GuideState::new(&model, &[], &env, -1e3, 0.01);
    let mut scratch = GuideScratch::default();
    let mut take = |model: &GuideModel, state: &mut GuideState, span: [f64; 2]| {
        let record = model.step(&env, state, span, ContactMode::Bodies, &mut scratch);
        assert_eq!((record.unconverged, record.truncated, record.unsettled), (0, 0, 0), "{span:?}");
        state.x[state.x.len() / 2].z
    };
    model.scheme = Scheme::BackwardEuler;
    let mut t = -604.0;
    for h in gather.into_iter().flatten() {
        take(&model, &mut state, [t, t + h]);
        t += h;
    }
    let start = state.x[state.x.len() / 2].z;
    model.scheme = Scheme::FourStep;
    (0..steps).map(|i| take(&model, &mut state, [f64::from(i) * h, f64::from(i + 1) * h]) / start).collect()
}

#[test]
fn a_tied_rod_swings_on_by_the_scheme_of_a_free_one() {
    // Some 1.9 Hz. The greatest swing of the second second; with backward Euler 0.39, 0.62 and 0.79 of it are left.
    let greatest = |rate: u32| {
        let swings = swings_of_a_loop(1.0 / f64::from(rate), 2 * rate);
        swings[rate as usize..].iter().fold(0.0, |a: f64, z| a.max(z.abs()))
    };
    let [coarse, fine, finest] = [192, 384, 768].map(greatest);
    println!("{coarse} {fine} {finest}");
    assert!((coarse / finest - 1.0).abs() < 0.02 && (fine / finest - 1.0).abs() < 0.004);
}

#[test]
fn a_rod_pressed_through_a_ring_finds_rest_in_long_steps() {
    // At 0.9 of the load that buckles it between its clamp and the ring, with a side load: where the middle is.
    let at = |h: f64, steps: u32| {
        let mut model = straight(17, 6.6e-6 * 9.81);
        let buckling = 20.19 * BENDING / LENGTH.powi(2);
        let load = |place: f64, force: Vector3<f64>| Load {
            name: "load".into(),
            guides: GuideSelection::default(),
            place: LoadPlace::Share(place),
            force: Keyframes { times: vec![0.0], values: vec![force] },
            moment: Keyframes { times: vec![0.0], values: vec![Vector3::zeros()] },
            axes: LoadAxes::World,
        };
        let loads = [load(1.0, Vector3::x() * -0.9 * buckling), load(0.5, Vector3::y() * -1e-6 * buckling)];
        model.loads = loads.iter().map(|load| GuideLoad::new(&model.rod, load).unwrap()).collect();
        model.ties = vec![Tie { slides: true, ..tip_tie(&model.rod, Vector3::x() * LENGTH) }];
        let env = Environment {
            gravity: Box::new(|_| Vector3::zeros()),
            ..Environment::at_rest(Bodies::default())
        };
        run(&model, &env, h, steps).state.x[model.rod.points() / 2].y
    };
    let [long, short] = [at(1.0, 20), at(1.0 / 24.0, 480)];
    assert!(short < -1e-8 && (long / short - 1.0).abs() < 1e-3, "{long} {short}");
}

#[test]
fn a_rod_whose_frame_is_held_swings_on_by_the_scheme_of_a_free_one() {
    // The half beyond a place on the way of a bend, undamped, after gravity has gone, some 7.7 Hz: its greatest height in
    // the second half second over that in the first. Backward Euler leaves 0.18.
    let mut model = straight(24, 6.6e-6 * 9.81);
    model.ties =
        vec![Tie { frame: Some(drawn_tip_frame(&model.rod)), ..middle_tie(&model.rod, Vector3::x() * 0.05) }];
    model.scheme = Scheme::FourStep;
    let env = Environment {
        gravity: Box::new(|t| Vector3::y() * if t < 0.05 { -9.81 } else { 0.0 }),
        ..Environment::at_rest(Bodies::default())
    };
    let h = 1.0 / 384.0;
    let (mut state, mut scratch) = (GuideState::new(&model, &[], &env, 0.0, h), GuideScratch::default());
    let mut greatest = [0.0_f64; 2];
    for i in 0..384 {
        let span = [f64::from(i) * h, f64::from(i + 1) * h];
        let record = model.step(&env, &mut state, span, ContactMode::Bodies, &mut scratch);
        assert_eq!((record.unconverged, record.truncated), (0, 0), "{span:?}");
        let half = usize::from(i >= 192);
        greatest[half] = greatest[half].max(state.x.last().unwrap().y.abs());
    }
    assert!(greatest[0] > 1e-3 && greatest[1] > 0.97 * greatest[0], "{greatest:?}");
}

#[test]
fn what_a_tie_lets_go_falls() {
    // Nothing else touches it.
    let mut model = straight(9, 6.6e-6 * 9.81);
    let tie = tip_tie(&model.rod, Vector3::x() * LENGTH);
    model.ties = vec![Tie { times: [f64::NEG_INFINITY, 0.1], ..tie }];
    let env = Environment::at_rest(Bodies::default());
    for scheme in [Scheme::FourStep, Scheme::BackwardEuler] {
        model.scheme = scheme;
        let Run { widest, .. } = run(&model, &env, 1.0 / 192.0, 96);
        assert!(widest > 0.04, "{scheme:?}: {widest}");
    }
}

#[test]
fn ties_that_a_coarse_rod_cannot_follow_keep_it_near() {
    // Six and eight ties on eight nodes, and two within 0.2 mm, at places off the drawn line by 0.1 mm to both sides.
    let sixths: Vec<f64> = (1..=6).map(|i| f64::from(i) / 6.0).collect();
    let eighths: Vec<f64> = (1..=8).map(|i| f64::from(i) / 8.0).collect();
    for shares in [&sixths[..], &eighths, &[0.6, 0.602], &[0.6, 0.65]] {
        for rate in [48, 192] {
            let mut model = straight(8, BENDING / LENGTH.powi(3));
            let last = 2 * (model.rod.points() - 1);
            let tie = |(i, share): (usize, &f64)| {
                let at = share * last as f64;
                let segment = (at as usize).min(last - 1);
                let aside = if i % 2 == 0 { 1e-4 } else { -1e-4 };
                let goal = Vector3::new(share * LENGTH, aside, 0.0);
                Tie::new(&model.rod, segment, at - segment as f64, goal)
            };
            model.ties = shares.iter().enumerate().map(tie).collect();
            let env = Environment::at_rest(Bodies::default());
            let Run { slack, .. } = run(&model, &env, 1.0 / f64::from(rate), rate);
            println!("{shares:?} at {rate}: {slack}");
            assert!(slack < 2e-4, "{shares:?} at {rate}: {slack}");
        }
    }
}
