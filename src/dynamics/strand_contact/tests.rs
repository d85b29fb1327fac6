//! Contact between guides: no crossings, by an independent check; Coulomb friction; rest; reproducible bits.

mod bundles;
mod detection;
mod division;
mod impacts;
mod itself;

use super::contact_pairs::ContactPairs;
use super::coupled_guide::{CoupledGuide, EndState, RESIDUAL_TOLERANCE};
use super::{BundleProperties, StrandContacts};
use crate::contact::{Bodies, Body};
use crate::dynamics::batch::Batches;
use crate::dynamics::coupled_substep::CoupledSubstep;
use crate::dynamics::environment::Environment;
use crate::dynamics::guide::{ContactMode, ContactSolve, GuideModel, GuideScratch, GuideState};
use crate::dynamics::guide_frame::{MovingGuide, SolverStep};
use crate::dynamics::load::GuideLoad;
use crate::dynamics::step_record::StepRecord;
use crate::geometry::{Shape, segment_segment};
use crate::math::random;
use crate::rod::{Rod, RodShape, RodSource};
use crate::scene::Tree;
use nalgebra::{Isometry3, UnitQuaternion, Vector2, Vector3};

type V = Vector3<f64>;

const H: f64 = 1.0 / 192.0;

const BUNDLE: BundleProperties = BundleProperties {
    hair_radius: 4e-5,
    bundle_radius: 3e-4,
    parallel_friction: 1.0,
    cohesion: 0.0,
    hairs: 1.0,
};

/// A straight strand, `stiff` times as stiff as a hair, and as heavy as one.
fn strand(from: V, to: V, stiff: f64) -> Rod {
    bundle(from, to, stiff, 1.0)
}

/// A straight strand, `stiff` times as stiff as a hair and `heavy` times as heavy.
fn bundle(from: V, to: V, stiff: f64, heavy: f64) -> Rod {
    let (line, arc) = ([from, to], Tree::default_arc(8));
    let hair = RodSource::hair(&line, &arc);
    Rod::new(&RodSource {
        stiffness: hair.stiffness.map(|k| k * stiff),
        line_density: hair.line_density * heavy,
        damping: 0.005,
        ..hair
    })
    .unwrap()
}

/// Strands on a moving head in a force field, stepped by `h`, s.
struct Scene<'a> {
    h: f64,
    rods: Vec<Rod>,
    friction: f64,
    /// Bundle of each strand.
    bundles: Vec<BundleProperties>,
    /// Drag of each strand, N·s/m².
    drag: Vec<f64>,
    head: &'a (dyn Fn(f64) -> Isometry3<f64> + Sync),
    field: &'a (dyn Fn(f64) -> V + Sync),
    bodies: Vec<Shape>,
    /// Motion of the bodies; without it they are attached to the head.
    body: Option<&'a (dyn Fn(f64) -> Isometry3<f64> + Sync)>,
    /// Friction of the bodies; without it that of the strands.
    body_friction: Option<f64>,
    /// Loads of each strand.
    loads: Vec<GuideLoad>,
}

/// A scene in motion.
struct Motion {
    models: Vec<GuideModel>,
    guides: Vec<GuideState>,
    strand_contacts: StrandContacts,
    records: Vec<StepRecord>,
    /// Curves at the start of the last sub-step and at every time that some guides reached in it, in the frame of the head,
    /// with the midpoints between the rods' points.
    x: Vec<Vec<Vec<V>>>,
    /// Number of times in the last sub-step at which each guide arrived.
    arrivals: Vec<usize>,
}

const STILL: &(dyn Fn(f64) -> Isometry3<f64> + Sync) = &|_| Isometry3::identity();

impl Scene<'_> {
    fn new(rods: Vec<Rod>) -> Self {
        Scene {
            h: H,
            friction: 0.3,
            bundles: vec![BUNDLE; rods.len()],
            drag: vec![1e-4; rods.len()],
            rods,
            head: STILL,
            field: &|_| V::y() * -9.81,
            bodies: Vec::new(),
            body: None,
            body_friction: None,
            loads: Vec::new(),
        }
    }

    /// Steps through `seconds`, calling `each` after every sub-step with the time.
    fn run(&self, seconds: f64, mut each: impl FnMut(f64, &Motion)) -> Motion {
        let body = |shape| Body::new(shape, None, self.body_friction.map(Into::into));
        let env = Environment {
            head: Box::new(self.head),
            gravity: Box::new(self.field),
            body: Box::new(|_, t| self.body.unwrap_or(self.head)(t)),
            ..Environment::at_rest(Bodies::new(self.bodies.iter().map(body)))
        };
        let model = |(rod, drag): (&Rod, &f64)| {
            let loads = self.loads.clone();
            GuideModel { loads, ..GuideModel::new(rod.clone(), vec![*drag; rod.points()], self.friction) }
        };
        let models: Vec<GuideModel> = self.rods.iter().zip(&self.drag).map(model).collect();
        let state =
            |model: &GuideModel| GuideState::new(model, &vec![5e-4; self.bodies.len()], &env, 0.0, self.h);
        let guides: Vec<GuideState> = models.iter().map(state).collect();
        let batches = Batches::new(&models, |_| true);
        let mut strand_contacts = StrandContacts::new(self.bundles.clone());
        strand_contacts.rebuild(&models, &guides, |g| g, &env, 0.0);
        let local = |models: &[GuideModel], step: &SolverStep| -> Vec<Vec<V>> {
            let head = (self.head)(step.time).inverse();
            let of = |(model, g): (&GuideModel, &MovingGuide)| {
                let (root, mut shape) = (model.root(&env, step.time), RodShape::default());
                shape.update(&model.rod, &root.r, &g.q);
                shape
                    .refined_curve(&model.rod, &g.q)
                    .map(|x| head.transform_point(&(x + root.p).into()).coords)
                    .collect()
            };
            models.iter().zip(&step.guides).map(of).collect()
        };
        let mut path = vec![SolverStep::new(0.0, &models, &guides)];
        let x = vec![local(&models, &path[0])];
        let records = vec![StepRecord::default(); guides.len()];
        let mut motion = Motion { models, guides, strand_contacts, records, x, arrivals: Vec::new() };
        for step in 0..(seconds / self.h) as u32 {
            let t = [f64::from(step) * self.h, f64::from(step + 1) * self.h];
            let Motion { models, guides: states, strand_contacts, records, x, arrivals } = &mut motion;
            path.drain(..path.len() - 1);
            let (batches, env) = (&batches, &env);
            CoupledSubstep { models, states, strand_contacts, batches, env, path: Some(&mut path) }
                .step(t, records)
                .unwrap();
            *x = path.iter().map(|step| local(models, step)).collect();
            place_between(x, &path);
            assert!(path.is_sorted_by(|a, b| a.time < b.time) && path.last().unwrap().time == t[1]);
            assert!(path.last().unwrap().arrived.iter().all(|arrived| *arrived));
            let of = |g: usize| path[1..].iter().filter(|step| step.arrived[g]).count();
            *arrivals = (0..models.len()).map(of).collect();
            each(t[1], &motion);
        }
        motion
    }
}

/// Places the curves `x` of guides that have not arrived at a time evenly between the times at which they have.
fn place_between(x: &mut [Vec<Vec<V>>], path: &[SolverStep]) {
    for g in 0..path[0].guides.len() {
        let arrivals: Vec<usize> = (0..path.len()).filter(|&i| path[i].arrived[g]).collect();
        for ends in arrivals.windows(2) {
            let [start, end] = [ends[0], ends[1]].map(|i| (path[i].time, x[i][g].clone()));
            let between = x[..ends[1]].iter_mut().zip(path).skip(ends[0] + 1);
            for (x, step) in between {
                let share = (step.time - start.0) / (end.0 - start.0);
                x[g] = start.1.iter().zip(&end.1).map(|(a, b)| a.lerp(b, share)).collect();
            }
        }
    }
}

impl Motion {
    fn active(&self) -> u32 {
        self.records.iter().map(|r| r.strands.active).sum()
    }

    fn fallbacks(&self) -> u32 {
        self.records.iter().map(|r| r.strands.truncated + r.strands.uncoupled).sum()
    }

    /// Pairs of segments that cross in the last sub-step.
    fn crossings(&self) -> usize {
        self.x.windows(2).map(|x| self.crossings_between([&x[0], &x[1]])).sum()
    }

    fn crossings_between(&self, x: [&[Vec<V>]; 2]) -> usize {
        let mut count = 0;
        for a in 0..self.guides.len() {
            for b in a..self.guides.len() {
                for i in 0..x[0][a].len() - 1 {
                    // Segments next to each other share a point.
                    let first = if a == b { i + 2 } else { 0 };
                    for j in first..x[0][b].len() - 1 {
                        let of = |s: usize| [x[s][a][i], x[s][a][i + 1], x[s][b][j], x[s][b][j + 1]];
                        count += usize::from(cross(of(0), of(1)));
                    }
                }
            }
        }
        count
    }

    fn fastest(&self) -> f64 {
        self.guides.iter().flat_map(|g| &g.v).map(|v| v.norm()).fold(0.0, f64::max)
    }
}

/// Whether segments ab and cd cross while their ends move linearly: at a time when the ends are coplanar and
/// the lines intersect within both. The volume of the ends is a cubic in time; its sign changes are sought in
/// 64 intervals.
fn cross(start: [V; 4], end: [V; 4]) -> bool {
    let at = |t: f64| [0, 1, 2, 3].map(|i: usize| start[i].lerp(&end[i], t));
    let volume = |t: f64| {
        let [a, b, c, d] = at(t);
        (b - a).cross(&(d - c)).dot(&(c - a))
    };
    // Rejects disjoint swept boxes.
    let extent = |i: usize, d: usize| {
        let x = [start[i][d], start[i + 1][d], end[i][d], end[i + 1][d]];
        (x.iter().copied().fold(f64::INFINITY, f64::min), x.iter().copied().fold(f64::NEG_INFINITY, f64::max))
    };
    if (0..3).any(|d| extent(0, d).0 > extent(2, d).1 || extent(2, d).0 > extent(0, d).1) {
        return false;
    }
    let parts = 64;
    (0..parts).any(|k| {
        let (mut lo, mut hi) = (f64::from(k) / f64::from(parts), f64::from(k + 1) / f64::from(parts));
        // Where segments become parallel, the volume and the normal both change sign without a crossing.
        let normal = |t: f64| {
            let [a, b, c, d] = at(t);
            (b - a).cross(&(d - c))
        };
        if volume(lo).signum() == volume(hi).signum() || normal(lo).dot(&normal(hi)) < 0.0 {
            return false;
        }
        for _ in 0..50 {
            let middle = 0.5 * (lo + hi);
            if volume(middle).signum() == volume(lo).signum() { lo = middle } else { hi = middle }
        }
        let [a, b, c, d] = at(lo);
        let n = (b - a).cross(&(d - c));
        let within = |x: V, other: V| {
            let s = x.cross(&other).dot(&n) / n.norm_squared();
            (0.0..=1.0).contains(&s)
        };
        within(c - a, d - c) && within(c - a, b - a)
    })
}

#[test]
fn crossing_check_detects_crossings() {
    let a = [V::new(-1.0, 0.0, 0.0), V::new(1.0, 0.0, 0.0)];
    let b = |y: f64, x: f64| [V::new(x, y, -1.0), V::new(x, y, 1.0)];
    let ends = |b: [V; 2]| [a[0], a[1], b[0], b[1]];
    assert!(cross(ends(b(1.0, 0.3)), ends(b(-1.0, 0.3))));
    assert!(!cross(ends(b(1.0, 0.3)), ends(b(0.1, 0.3))));
    assert!(!cross(ends(b(1.0, 1.5)), ends(b(-1.0, 1.5))));
}

#[test]
fn a_crossing_beside_a_kept_contact_is_detected() {
    // Nearly parallel, 20 µm apart at the closest point, the middle.
    let (a, b) = ([V::zeros(), V::x() * 0.1], [V::new(0.0, 2e-5, -1e-3), V::new(0.1, 2e-5, 1e-3)]);
    let with_middle = |[a, b]: [V; 2]| [a, a.lerp(&b, 0.5), b];
    let mut pairs = ContactPairs::new(&[&[0.02, 0.12], &[0.02, 0.12]], vec![BUNDLE; 2]);
    pairs.x = [[a, b].map(with_middle).concat(), [a, b].map(with_middle).concat()];
    pairs.begin(H, |_| true);
    assert_eq!((pairs.contacts.len(), pairs.crossing.len()), (1, 0));
    // The middle is pushed away; the closest point slides to where the second has tilted through the first.
    pairs
        .end_mut(1)
        .copy_from_slice(&with_middle([V::new(0.0, -2.7e-4, -8e-4), V::new(0.1, 3.3e-4, 1.2e-3)]));
    pairs.detect(|_| true);
    assert!(pairs.contacts[0].is_kept());
    assert_eq!((pairs.contacts.len(), pairs.crossing.len()), (2, 1));
}

#[test]
fn equivalent_contacts_are_kept_once() {
    // Parallel, the second wavy, its points shifted by a millimetre.
    let points =
        |x: f64, y: [f64; 2]| (0..11).map(move |k| V::new(x + 0.01 * f64::from(k), y[k as usize % 2], 0.0));
    let arc: Vec<f64> = (0..6).map(|k| 0.02 + 0.02 * f64::from(k)).collect();
    let mut pairs = ContactPairs::new(&[&arc, &arc], vec![BUNDLE; 2]);
    let x: Vec<V> = points(0.0, [0.0; 2]).chain(points(1e-3, [4e-4, 4.2e-4])).collect();
    pairs.x = [x.clone(), x];
    pairs.begin(H, |_| true);
    let along = |m| [0, 1].map(|side| pairs.position_on_rod(m, side)).map(|(k, u)| k as f64 + u);
    let mut at: Vec<_> = pairs.contacts.iter().map(|p| along(&p.contact)).collect();
    at.sort_by(|a, b| a[0].total_cmp(&b[0]));
    assert!(at.len() >= 5, "{at:?}");
    for two in at.windows(2) {
        let slid: f64 = (0..2).map(|side| (two[1][side] - two[0][side]).abs()).sum();
        assert!(slid > 0.3, "{at:?}");
    }
}

/// A level strand that has taken a sub-step over a ball that rises by `rise`, m, from half a millimetre
/// beneath it. Calls `each` with the coupled guide.
fn over_a_ball(
    rise: f64,
    each: impl FnOnce(&mut CoupledGuide, (&GuideModel, &mut GuideState), &Environment, &mut StepRecord),
) {
    let ball = move |_: usize, t: f64| Isometry3::translation(0.1, -0.0215 + rise * t / H, 0.0);
    let bodies = Bodies::from_shapes(&[Shape::Sphere { centre: V::zeros(), radius: 0.02 }]);
    let env = Environment {
        gravity: Box::new(|_| V::zeros()),
        body: Box::new(ball),
        ..Environment::at_rest(bodies)
    };
    let rod = strand(V::zeros(), V::x() * 0.2, 1.0);
    let drag = vec![1e-4; rod.points()];
    let model = GuideModel::new(rod, drag, 0.3);
    let mut state = GuideState::new(&model, &[5e-4], &env, 0.0, H);
    let mut record =
        model.step(&env, &mut state, [0.0, H], ContactMode::Bodies, &mut GuideScratch::default());
    let mut guide = CoupledGuide::new();
    guide.begin(true);
    assert!(guide.converged && record.penetration < 1e-5, "{record:?}");
    guide.couple(&model, &mut state, &env, [0.0, H]);
    each(&mut guide, (&model, &mut state), &env, &mut record);
}

#[test]
fn a_truncated_motion_is_taken_whole_if_every_part_of_it_crosses_an_approaching_body() {
    for (rise, whole) in [(1.2e-3, false), (2.5e-3, true)] {
        over_a_ball(rise, |guide, (model, state), env, _| {
            let (root, start, end) = (guide.root, state.q[0].clone(), guide.scratch.q.clone());
            let mut truncate = |q: &[f64]| {
                guide.scratch.q = q.to_vec();
                let (contact, ContactSolve { q, solver, contact_cache, scratch }) =
                    model.body_contact(env, state, &root, &mut guide.scratch);
                solver.shape.update(contact.rod, &root.r, q);
                let stopped = contact.truncate(&start, q, solver, contact_cache, scratch);
                (stopped, q.clone())
            };
            let (stopped, q) = truncate(&end);
            assert!(stopped && (q == end) == whole, "rise {rise}: {stopped}");
            // From the start there is no motion to truncate.
            let (stopped, q) = truncate(&start);
            assert!(stopped != whole && q == start, "rise {rise}: {stopped}");
        });
    }
}

#[test]
fn a_fully_truncated_guide_ends_uncoupled_if_a_body_approaches() {
    for (rise, end_state) in [(-1e-3, EndState::AtRestOnHead), (2.5e-3, EndState::Uncoupled)] {
        over_a_ball(rise, |guide, (model, state), env, _| {
            while !guide.is_fully_truncated() {
                guide.truncate_motion(model, state, env, [0.0, H]);
            }
            assert_eq!(guide.end_state, end_state);
        });
    }
}

#[test]
fn a_guide_that_is_next_to_rest_is_unsettled_but_no_reason_to_halve_the_substep() {
    over_a_ball(2.5e-3, |guide, (model, state), env, record| {
        let mut ends = |displacement: f64, loses_contact: bool| {
            (guide.needs_round, guide.displacement) = (true, displacement);
            let mut record = StepRecord { unsettled: 0, ..*record };
            guide.record(model, state, env, loses_contact, &mut record);
            (record.strands.unsettled, record.failed())
        };
        assert_eq!(ends(5e-4, false), (1, false));
        assert_eq!([ends(2e-3, false), ends(5e-4, true)], [(1, true); 2]);
    });
}

#[test]
fn a_rejected_motion_leaves_nothing_in_the_record() {
    over_a_ball(2.5e-3, |guide, (model, state), env, record| {
        let alone = record.penetration;
        // Straight through the ball.
        guide.scratch.q.fill(0.0);
        guide.scratch.solver.shape.update(&model.rod, &guide.root.r, &guide.scratch.q);
        guide.find_body_contacts(model, state, env);
        let mut through = *record;
        guide.record(model, state, env, false, &mut through);
        assert!(through.penetration > 5e-4, "{through:?}");
        assert!(guide.violates_bodies());
        guide.end_uncoupled(model);
        guide.record(model, state, env, false, record);
        assert_eq!((record.penetration, record.strands.uncoupled), (alone, 1));
    });
}

/// A hair that falls across a stiff one, at an angle `turn`, rad.
fn falls_across(turn: f64) -> Vec<Rod> {
    let across = V::new(turn.cos(), 0.0, turn.sin());
    let middle = V::new(0.1, 0.006, 0.0);
    vec![strand(V::zeros(), V::x() * 0.2, 300.0), strand(middle - across * 0.07, middle + across * 0.13, 1.0)]
}

#[test]
fn a_strand_comes_to_rest_on_another() {
    for turn in [std::f64::consts::FRAC_PI_2, 0.6, 0.03] {
        let mut scene = Scene::new(falls_across(turn));
        let alone = Scene { field: scene.field, ..Scene::new(scene.rods[1..].to_vec()) }.run(1.0, |_, _| {});
        let lowest = |m: &Motion, g: usize| m.guides[g].x.iter().map(|x| x.y).fold(0.0, f64::min);
        scene.friction = 0.5;
        let (mut touched, mut held) = (0, 0);
        let end = scene.run(1.5, |t, m| {
            assert_eq!(m.crossings(), 0, "turned by {turn}, at {t} s");
            touched += u32::from(m.active() > 0);
            held += m.fallbacks();
        });
        assert!(touched > 150, "turned by {turn}: touched in {touched} sub-steps");
        assert!(held <= 2, "turned by {turn}: {held} fallbacks");
        // A nearly parallel one may roll off.
        assert!(turn < 0.1 || lowest(&end, 1) > lowest(&alone, 0) + 0.01, "turned by {turn}: not held up");
        assert!(end.fastest() < 2e-3, "turned by {turn}: still moves at {} m/s", end.fastest());
    }
}

#[test]
fn tips_that_swing_towards_each_other_do_not_cross() {
    let field = |t: f64| V::y() * (20.0 * (25.0 * t).sin()) + V::z() * (5.0 * (40.0 * t).cos());
    let mut scene = Scene::new(vec![
        strand(V::zeros(), V::new(0.11, 0.0, 0.0), 30.0),
        strand(V::new(0.2, 0.001, 0.03), V::new(0.09, 0.001, -0.005), 3.0),
    ]);
    scene.field = &field;
    let (mut touched, mut held) = (0, 0);
    scene.run(2.0, |t, m| {
        assert_eq!(m.crossings(), 0, "at {t} s");
        touched += u32::from(m.active() > 0);
        held += m.fallbacks();
    });
    assert!(touched > 10, "touched in {touched} sub-steps");
    assert!(held <= 2, "{held} fallbacks");
}

#[test]
fn mirrored_strands_stay_mirrored() {
    // Two equal strands thrown together push each other with equal and opposite forces.
    let mut scene = Scene::new(vec![
        strand(V::new(0.0, 0.003, 0.0), V::new(0.14, 0.003, 0.14), 1.0),
        strand(V::new(0.0, -0.003, 0.14), V::new(0.14, -0.003, 0.0), 1.0),
    ]);
    // The mirror is a half turn about the axis about which the head swings.
    let middle = V::z() * 0.07;
    let mirror = |x: &V| V::new(x.x, -x.y, 0.14 - x.z);
    let swing = |t: f64| {
        let turn = UnitQuaternion::from_scaled_axis(V::x() * (0.3 * (25.0 * t).sin()));
        Isometry3::from_parts((middle - turn * middle).into(), turn)
    };
    scene.head = &swing;
    scene.field = &|_| V::zeros();
    let mut touched = 0;
    scene.run(1.0, |t, m| {
        touched += u32::from(m.active() > 0);
        let off = m.guides[0].x.iter().zip(&m.guides[1].x).map(|(a, b)| (mirror(a) - b).norm());
        let off = off.fold(0.0, f64::max);
        assert!(off < 2e-5, "at {t} s: {off} m");
    });
    assert!(touched > 10, "touched in {touched} sub-steps");
}

/// Checks the friction law at all active contacts while a strand slides on another, drawn at an angle `turn`,
/// rad; friction along parallel strands is the share `parallel` of that across.
fn obeys_coulomb(turn: f64, parallel: f64) {
    let (mut stuck, mut slid, mut along, mut weakest) = (0, 0, 0, 1.0_f64);
    for friction in [0.1, 0.6] {
        let mut scene = Scene::new(falls_across(turn));
        scene.friction = friction;
        scene.bundles.iter_mut().for_each(|bundle| bundle.parallel_friction = parallel);
        let sway = |t: f64| V::new(3.0 * (6.0 * t).sin(), -9.81, 0.0);
        scene.field = &sway;
        scene.run(2.0, |t, m| {
            for pair in m.strand_contacts.pairs.contacts.iter().filter(|p| p.is_active()) {
                let [n, a, b] = pair.axes(&UnitQuaternion::identity());
                // In the axes in which the cone is round.
                let force = Vector2::new(pair.reaction.dot(&a) / a.norm_squared(), pair.reaction.dot(&b));
                let slip = m.strand_contacts.pairs.last_slip(pair);
                let slip = Vector2::new(slip.dot(&a), slip.dot(&b));
                let normal = pair.reaction.dot(&n);
                let bound = friction * normal;
                assert!((b.norm() - 1.0).abs() < 1e-12);
                assert!(a.norm() > parallel - 1e-12 && a.norm() < 1.0 + 1e-12);
                weakest = a.norm().min(weakest);
                assert!(normal > 0.0 && force.norm() < bound * (1.0 + 1e-6), "at {t} s");
                if force.norm() < 0.9 * bound {
                    stuck += 1;
                    assert!(slip.norm() < 3e-6, "slides by {} m at {t} s below the bound", slip.norm());
                } else if slip.norm() > 2e-5 {
                    slid += 1;
                    along += u32::from(slip.x.abs() > slip.y.abs());
                    assert!(force.norm() > bound * (1.0 - 1e-3) && force.dot(&slip) < 0.0, "at {t} s");
                }
            }
        });
    }
    assert!(stuck > 100 && slid > 20 && along > 0, "{stuck} {slid} {along}");
    // The falling strand bends, which changes the angle.
    let drawn = parallel + (1.0 - parallel) * turn.sin().powi(2);
    assert!((weakest - drawn).abs() < 0.5 * (1.0 - parallel) + 1e-9, "{weakest}");
}

#[test]
fn friction_obeys_coulomb() {
    obeys_coulomb(1.2, 1.0);
}

#[test]
fn friction_is_weaker_along_parallel_strands_than_across() {
    obeys_coulomb(0.6, 0.3);
}

#[test]
fn cohesion_holds_strands_together_up_to_their_weight() {
    // A soft strand beside a stiff one, both horizontal: uncoupled it hangs down by centimetres.
    let rods = vec![
        strand(V::zeros(), V::x() * 0.1, 30.0),
        strand(V::new(0.0, -1.5e-4, 0.0), V::new(0.1, -1.5e-4, 0.0), 1.0),
    ];
    let weight = 6.6e-6 * 9.81;
    let apart = |cohesion: f64| {
        let mut scene = Scene::new(rods.clone());
        scene.bundles.iter_mut().for_each(|bundle| bundle.cohesion = cohesion);
        let end = scene.run(1.5, |t, m| assert_eq!(m.crossings(), 0, "at {t} s"));
        let [a, b] = [0, 1].map(|g| *end.guides[g].x.last().unwrap());
        assert!(end.fastest() < 2e-3, "{cohesion} N/m: still moves at {} m/s", end.fastest());
        (a - b).norm()
    };
    let [alone, little, enough] = [0.0, 0.1, 20.0].map(|times| apart(times * weight));
    assert!(alone > 0.02 && little > 0.02, "{alone} {little}");
    assert!(enough < 6e-4, "{enough}");
}

/// Forty strands on a plate, in random directions.
fn brush() -> Vec<Rod> {
    brush_at(V::zeros())
}

/// A brush that is alike, at another place, m.
fn brush_at(place: V) -> Vec<Rod> {
    let mut drawn = 0..;
    let mut within = |scale: f64| (random::unit(7, drawn.next().unwrap()) - 0.5) * scale;
    (0..40)
        .map(|_| {
            let root = place + V::new(within(0.05), 0.0, within(0.05));
            strand(root, root + V::new(within(0.05), 0.11 + within(0.04), within(0.05)), 1.0)
        })
        .collect()
}

/// The head of hair that is thrown about.
fn thrown(t: f64) -> Isometry3<f64> {
    let turn = UnitQuaternion::from_scaled_axis(V::z() * (2.0 * (30.0 * t).sin()));
    Isometry3::from_parts(V::x().scale(0.1 * (40.0 * t).sin()).into(), turn)
}

fn shaken(t: f64) -> Isometry3<f64> {
    let s = if t < 0.75 { (25.0 * t).sin() } else { (25.0_f64 * 0.75).sin() };
    Isometry3::from_parts(
        V::new(0.04 * s, 0.0, 0.0).into(),
        UnitQuaternion::from_scaled_axis(V::new(0.2, 0.0, 0.6) * s),
    )
}

#[test]
fn a_shaken_brush_does_not_cross_itself_and_comes_to_rest() {
    let mut scene = Scene::new(brush());
    scene.head = &shaken;
    let ball = Shape::Sphere { centre: V::new(0.02, 0.07, 0.0), radius: 0.015 };
    scene.bodies = vec![ball];
    let (mut most, mut held) = (0, 0);
    let end = scene.run(4.5, |t, m| {
        most = most.max(m.active());
        held += m.fallbacks();
        // What rounds on the way leave is solved for in the end.
        assert!(m.records.iter().all(|r| r.strands.residual <= RESIDUAL_TOLERANCE), "at {t} s");
        assert_eq!(m.crossings(), 0, "at {t} s");
    });
    assert!(most > 20, "at most {most} active contacts");
    // For 40 strands in 864 sub-steps.
    assert!(held < 100, "{held} fallbacks");
    assert!(end.active() > 20 && end.fastest() < 0.01, "{} m/s, {} contacts", end.fastest(), end.active());
    let speeds: Vec<f64> = end.guides.iter().flat_map(|g| &g.v).map(|v| v.norm()).collect();
    let mean = speeds.iter().sum::<f64>() / speeds.len() as f64;
    assert!(mean < 5e-4, "{mean} m/s");
}
