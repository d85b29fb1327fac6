//! Hairs and ropes that fall on each other: energy and distances at steps of any length.

use super::*;
use crate::dynamics::strand_contact::contact_law::BundlePair;
use crate::rod::RootJoint;
use std::f64::consts::FRAC_PI_2;

/// A level strand of `length`, m, crosswise over one half as long, `gap` above it, m; undamped, in no air and
/// without friction.
fn crossed_cantilevers(
    length: f64,
    gap: f64,
    rods: [&dyn Fn(V, V) -> Rod; 2],
    bundle: BundleProperties,
) -> Scene<'static> {
    let upper = V::new(0.75, 0.0, 0.0) * (0.5 * length) + V::y() * gap;
    let rods = vec![
        rods[0](V::zeros(), V::x() * (0.5 * length)),
        rods[1](upper - V::z() * (0.75 * length), upper + V::z() * (0.25 * length)),
    ];
    Scene { friction: 0.0, bundles: vec![bundle; 2], drag: vec![0.0; 2], ..Scene::new(rods) }
}

/// Two single hairs of 4 cm, half a millimetre apart, with a relaxation time of `damping`, s.
fn crossed_hairs(steps: f64, damping: f64) -> Scene<'static> {
    let rod = |from, to| {
        let (line, arc) = ([from, to], Tree::default_arc(8));
        Rod::new(&RodSource { damping, ..RodSource::hair(&line, &arc) }).unwrap()
    };
    let bundle = BundleProperties { bundle_radius: 5.2e-5, ..BUNDLE };
    Scene { h: 1.0 / steps, ..crossed_cantilevers(0.04, 0.5e-3, [&rod; 2], bundle) }
}

/// Kinetic, elastic and gravitational energy of all strands, J.
pub(super) fn energy(scene: &Scene, motion: &Motion) -> f64 {
    let mut sum = 0.0;
    for (model, state) in motion.models.iter().zip(&motion.guides) {
        let (rod, q) = (&model.rod, &state.q[0]);
        for (q_i, row) in q.iter().zip(rod.elastic_matrix().chunks_exact(q.len())) {
            sum += 0.5 * q_i * row.iter().zip(q).map(|(k, q)| k * q).sum::<f64>();
        }
        for k in 0..rod.points() {
            let potential = -(scene.field)(0.0).dot(&state.x[k]);
            sum += rod.mass[k] * (0.5 * state.v[k].norm_squared() + potential);
        }
    }
    sum
}

/// Least distance of the contacts over that of the law, where they push.
fn least_distance(motion: &Motion) -> f64 {
    let pushing = motion.strand_contacts.pairs.contacts.iter().filter(|p| p.is_active());
    pushing.map(|p| p.contact.distance / p.lawful).fold(f64::INFINITY, f64::min)
}

#[test]
fn hairs_that_fall_on_each_other_gain_no_energy_and_keep_their_distance_at_any_step() {
    for steps in [500.0, 1000.0, 2000.0, 4000.0, 8000.0, 16000.0] {
        let scene = crossed_hairs(steps, 0.0);
        let (mut start, mut last, mut least, mut work, mut pushes) = (None, 0.0, f64::INFINITY, 0.0, 0);
        scene.run(0.1, |t, m| {
            let now = energy(&scene, m);
            let start = *start.get_or_insert(now);
            // Kinetic energy before the impact is two thirds of 1e-9 J.
            assert!(now < start + 1e-12, "{steps} steps a second: {now} J at {t} s after {start} J");
            (last, least) = (now, least_distance(m).min(least));
            work += m.records.iter().map(|r| r.strands.work).sum::<f64>();
            pushes += m.active();
        });
        assert!(pushes > 3, "{steps} steps a second: pushed {pushes} times");
        assert!(least > 0.99, "{steps} steps a second: {least} of the distance");
        assert!(
            work < 0.0 && work > last - start.unwrap() - 1e-12,
            "{steps} steps a second: work of {work} J"
        );
    }
}

#[test]
fn damped_hairs_lose_as_much_in_an_impact_at_any_step() {
    let loss = |steps: f64| {
        let scene = crossed_hairs(steps, 0.005);
        // Time, s, and energy, J, at the end of the last sub-step without contact, and kinetic energy there.
        let (mut before, mut touched, mut left) = ([0.0; 3], false, f64::NAN);
        scene.run(0.015, |t, m| {
            let now = energy(&scene, m);
            touched |= m.active() > 0;
            if !touched {
                let moving =
                    m.models.iter().zip(&m.guides).flat_map(|(model, g)| model.rod.mass.iter().zip(&g.v));
                before = [t, now, moving.map(|(mass, v)| 0.5 * mass * v.norm_squared()).sum()];
            } else if left.is_nan() && t > before[0] + 2e-3 - 1e-9 {
                left = now;
            }
        });
        (before[1] - left) / before[2]
    };
    let losses = [1000.0, 4000.0, 16000.0].map(loss);
    let (least, most) = losses.iter().fold((f64::INFINITY, 0.0_f64), |(a, b), x| (x.min(a), x.max(b)));
    assert!(least > 0.6 && most - least < 0.03, "{losses:?}");
}

#[test]
fn ropes_keep_the_distance_of_the_law() {
    for stiffness in [2.6e-3, 2.6e-4] {
        // The lower one is stiffer, so that the upper one does not slide off its tip.
        let rod = |stiffness: f64| {
            move |from, to| {
                let (line, arc) = ([from, to], Tree::default_arc(8));
                let hair = RodSource::hair(&line, &arc);
                let stiffness = [stiffness, stiffness, 0.5 * stiffness];
                Rod::new(&RodSource { stiffness, line_density: 0.0166, ..hair }).unwrap()
            }
        };
        let bundle = BundleProperties { hair_radius: 2e-3, bundle_radius: 2.6e-3, ..BUNDLE };
        let rods: [&dyn Fn(V, V) -> Rod; 2] = [&rod(30.0 * stiffness), &rod(stiffness)];
        let mut scene = crossed_cantilevers(0.3, 0.02, rods, bundle);
        (scene.drag, scene.friction) = (vec![2e-2; 2], 0.6);
        let end = scene.run(2.0, |_, _| {});
        let pairs = &end.strand_contacts.pairs;
        let pair = pairs.contacts.iter().find(|p| p.is_active()).expect("the upper one lies on the other");
        let x = end.x.last().unwrap().concat();
        let direction = |k: u32| (x[k as usize + 1] - x[k as usize]).normalize();
        let directions = [direction(pair.contact.pair.0), direction(pair.contact.pair.1)];
        let law = BundlePair::new([bundle; 2], directions).required_distance();
        assert!(least_distance(&end) > 0.99, "{stiffness}: {}", least_distance(&end));
        assert!(pair.lawful > 0.99 * law, "{stiffness}: {} of {law} m", pair.lawful);
    }
}

#[test]
fn strands_that_turn_past_each_other_in_long_substeps_keep_apart() {
    // A hair that is thrown about on a stiff strand, across it and at an angle.
    let head = |t: f64| Isometry3::translation(0.0, 0.05 * (20.0 * t).sin(), 0.0);
    for turn in [FRAC_PI_2, 0.5] {
        let along = V::new(turn.cos(), 0.0, turn.sin());
        let root = V::new(0.1, 0.01, 0.0) - along * 0.05;
        let mut scene =
            Scene::new(vec![strand(V::zeros(), V::x() * 0.2, 100.0), strand(root, root + along * 0.2, 1.0)]);
        (scene.h, scene.head) = (1.0 / 24.0, &head);
        let (mut least, mut missing, mut recorded) = (f64::INFINITY, 0.0_f64, 0.0_f64);
        scene.run(1.0, |_, m| {
            // Of the hair with itself, the record of the second.
            recorded = recorded.max(m.records[0].strands.missing);
            let at = |back: usize, g: usize| m.x[m.x.len() - 1 - back][g].windows(2).map(|x| [x[0], x[1]]);
            let segments = |g: usize| at(1, g).zip(at(0, g)).collect::<Vec<_>>();
            for (before, p) in segments(0) {
                for (before, q) in segments(1).iter().map(|(x, q)| ([before, *x], q)) {
                    let (u, v) = segment_segment([&p[0], &p[1]], [&q[0], &q[1]]);
                    let distance = (p[0].lerp(&p[1], u) - q[0].lerp(&q[1], v)).norm();
                    let directions = before.map(|x| (x[1] - x[0]).normalize());
                    let law = BundlePair::new([BUNDLE; 2], directions).required_distance();
                    (least, missing) = (least.min(distance), missing.max(1.0 - distance / law));
                }
            }
        });
        let share = least / (2.0 * BUNDLE.bundle_radius);
        // They meet, and the contacts at the start of a sub-step alone would leave 0.3 and 0.4.
        assert!((0.5..1.0).contains(&share), "{share} of the distance to keep");
        assert!((recorded - missing).abs() < 1e-3, "{turn}: {recorded} recorded, {missing} missing");
    }
}

#[test]
fn a_hair_that_is_drawn_against_another_next_to_their_roots_does_not_pass_it() {
    // Across a stiff one, 6 mm from both roots.
    let root = V::new(0.002, 0.006, -0.006);
    let [stiff, soft] = [strand(V::zeros(), V::y() * 0.1, 100.0), strand(root, root + V::z() * 0.2, 1.0)];
    let mut scene = Scene::new(vec![stiff, soft]);
    scene.field = &|_| V::x() * -30.0;
    let mut crossings = 0;
    let end = scene.run(0.5, |_, m| crossings += m.crossings());
    assert_eq!((crossings, end.fallbacks(), end.active()), (0, 0, 1));
    // There, 6 to 7 mm from a root, they keep that share of a centimetre of the distance of the law.
    let law = 2.0 * (BUNDLE.bundle_radius + BUNDLE.hair_radius);
    let pair = end.strand_contacts.pairs.contacts.iter().find(|p| p.is_active()).unwrap();
    assert!((0.6..0.7).contains(&(pair.lawful / law)) && pair.is_kept(), "{} of {law}", pair.lawful);
}

#[test]
fn hair_that_grows_from_one_place_is_not_torn_apart_there() {
    // They cross 5 mm from there, nearer than a hair's thickness.
    let root = V::new(5e-5, 0.0, 2e-5);
    let [one, other] = [(V::zeros(), V::y()), (root, V::new(-0.01, 1.0, 0.0))]
        .map(|(root, along)| strand(root, root + along * 0.1, 1.0));
    let mut scene = Scene::new(vec![one, other]);
    scene.field = &|_| V::zeros();
    assert!(scene.run(0.2, |_, _| ()).fastest() < 1e-9);
}

#[test]
fn a_loose_hair_slides_freely_along_itself_over_others() {
    // Its points come over two stiff ones, which it lies on or is pushed away from.
    let d = 2.0 * (BUNDLE.hair_radius + BUNDLE.bundle_radius);
    for (share, h) in [(1.0, H), (1.0, H / 4.0), (0.6, H), (0.6, H / 4.0)] {
        let rail = |x: f64| strand(V::new(x, 0.0, -0.05), V::new(x, 0.0, 0.05), 1e6);
        let mut hair = strand(V::new(0.0, share * d, 0.0), V::new(0.16, share * d, 0.0), 1e3);
        hair.join_root(RootJoint::Free);
        let mut scene = Scene::new(vec![rail(0.051), rail(0.109), hair]);
        (scene.h, scene.friction, scene.drag) = (h, 0.0, vec![0.0; 3]);
        // Until it moves at 0.15 m/s.
        scene.field = &|t| V::new(if t < 0.02 { 9.6 } else { 0.0 }, -9.81, 0.0);
        let (mut pushed, mut start, mut end) = (0, 0.0, 0.0);
        scene.run(0.14, |t, m| {
            let mass = &m.models[2].rod.mass;
            let momentum: V = mass.iter().zip(&m.guides[2].v).map(|(m, v)| *m * v).sum();
            end = momentum.x / mass.iter().sum::<f64>();
            if t < 0.03 {
                start = end;
            }
            pushed += m.active();
        });
        assert!(pushed > 20 && start > 0.14, "{pushed} {start}");
        assert!((end / start - 1.0).abs() < 0.01, "{share} d, {h} s: {start} m/s, then {end}");
    }
}
