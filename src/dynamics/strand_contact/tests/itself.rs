//! Guides that meet themselves.

use super::impacts::energy;
use super::*;
use crate::dynamics::strand_contact::contact_pair::ContactPair;
use crate::scene::anim::{GuideSelection, Keyframes, Load, LoadAxes, LoadPlace};
use std::f64::consts::{PI, TAU};

/// Thickness of the ropes, m, at any angle to themselves.
const D: f64 = 4e-3;

const ROPE: BundleProperties = BundleProperties { hair_radius: 0.5 * D, bundle_radius: 0.0, ..BUNDLE };

/// A rope along `line`, m, with nodes every 12.5 mm and the bending stiffness `stiffness`, N·m².
fn rope(line: &[V], stiffness: f64) -> Rod {
    let length: f64 = line.windows(2).map(|x| (x[1] - x[0]).norm()).sum();
    let elements = (length / 0.0125).round() as u32;
    let arc: Vec<f64> = (0..=elements).map(|k| f64::from(k) / f64::from(elements)).collect();
    let stiffness = [stiffness, stiffness, 0.7 * stiffness];
    let hair = RodSource::hair(line, &arc);
    let rope = RodSource { stiffness, line_density: 0.0166, damping: 0.02, tip_strain: true, ..hair };
    Rod::new(&rope).unwrap()
}

/// A scene of one rope with itself, weightless.
fn alone(rod: Rod) -> Scene<'static> {
    Scene { bundles: vec![ROPE], drag: vec![1e-3], field: &|_| V::zeros(), ..Scene::new(vec![rod]) }
}

/// A force, N, and a moment, N·m, at the tip over time.
fn at_tip(rod: &Rod, force: Keyframes, moment: Keyframes) -> GuideLoad {
    let (name, guides, place) = (String::new(), GuideSelection::default(), LoadPlace::Share(1.0));
    GuideLoad::new(rod, &Load { name, guides, place, force, moment, axes: LoadAxes::World }).unwrap()
}

/// A curve from the origin along x for `length`, m, through a half circle of `radius`, m, and back above it.
fn hairpin(length: f64, radius: f64) -> Vec<V> {
    let turn = (0..=16).map(|k| PI * f64::from(k) / 16.0);
    let turn = turn.map(|a| V::new(length + radius * a.sin(), radius * (1.0 - a.cos()), 0.0));
    let leg = |y: f64| (0..16).map(move |k| V::new(length * f64::from(k) / 16.0, y, 0.0));
    leg(0.0).chain(turn).chain(leg(2.0 * radius).collect::<Vec<_>>().into_iter().rev()).collect()
}

/// Arc length of each point of a curve, m.
fn arc(x: &[V]) -> Vec<f64> {
    let mut arc = vec![0.0];
    x.windows(2).for_each(|x| arc.push(arc[arc.len() - 1] + (x[1] - x[0]).norm()));
    arc
}

/// Least distance, over [`D`], of the segments of a curve that are three times that apart along it.
fn thickness(x: &[V]) -> f64 {
    let arc = arc(x);
    let mut least = f64::INFINITY;
    for i in 0..x.len() - 1 {
        for j in (i + 1..x.len() - 1).filter(|&j| arc[j] - arc[i + 1] > 3.0 * D) {
            let (u, v) = segment_segment([&x[i], &x[i + 1]], [&x[j], &x[j + 1]]);
            least = least.min((x[i].lerp(&x[i + 1], u) - x[j].lerp(&x[j + 1], v)).norm());
        }
    }
    least / D
}

/// The curve of the first guide now.
fn curve(motion: &Motion) -> &[V] {
    &motion.x.last().unwrap()[0]
}

/// The contacts of a guide on the way from `x[0]` to `x[1]`, as long as the latter and drawn as `drawn`; all
/// have as many points.
fn pairs(x: [&[V]; 2], drawn: &[V]) -> ContactPairs {
    // Not near the root.
    let arc: Vec<f64> = arc(x[1]).iter().step_by(2).map(|s| 0.02 + s).collect();
    let mut pairs = ContactPairs::new(&[&arc], vec![ROPE]);
    pairs.drawn = drawn.to_vec();
    pairs.x = x.map(<[V]>::to_vec);
    pairs.begin(H, |_| true);
    pairs
}

#[test]
fn the_tightest_bend_is_no_contact_and_what_closes_behind_it_is() {
    let straight: Vec<V> = (0..49).map(|k| V::x() * (2e-3 * f64::from(k))).collect();
    let [open, tight, shut] = [0.7, 0.5, 0.45].map(|radius| hairpin(0.04, radius * D));
    let coupled = |x: [&[V]; 2], drawn: &[V]| {
        pairs(x, drawn).contacts.iter().filter(|contact| contact.needs_coupling()).count()
    };
    assert_eq!(coupled([&open, &tight], &straight), 0);
    assert!(coupled([&open, &shut], &straight) > 0);
    // As it is drawn it is at rest.
    assert_eq!(coupled([&open, &shut], &shut), 0);
}

#[test]
fn a_guide_that_sweeps_through_itself_crosses() {
    let above = hairpin(0.04, 2.0 * D);
    // The end turned about the root part, which it passes at right angles in space.
    let mut end = [above.clone(), above.clone()];
    for (sign, x) in [1.0, -1.0].into_iter().zip(&mut end) {
        for x in &mut x[40..] {
            *x = V::new(0.02, sign * 2.0 * D, 0.02 - (0.04 - x.x));
        }
    }
    let straight: Vec<V> = (0..49).map(|k| V::x() * (2e-3 * f64::from(k))).collect();
    let pairs = pairs([&end[0], &end[1]], &straight);
    assert!(!pairs.contacts.is_empty() && !pairs.crossing.is_empty());
    assert!(pairs.contacts.iter().all(|contact| pairs.guides(&contact.contact) == [0, 0]));
}

/// A loop in a level plane whose end crosses above its beginning.
fn crossed_loop() -> Vec<V> {
    let (straight, radius, beyond) = (0.06, 0.02, 0.008);
    let arc = (0..=48).map(|k| f64::from(k) / 48.0).map(|u| {
        let (sin, cos) = (1.5 * PI * u).sin_cos();
        V::new(straight + radius * sin, 2.0 * D * u, radius * (1.0 - cos))
    });
    let end = V::new(straight - radius, 2.0 * D, radius);
    let last = (1..=8).map(|k| end - V::z() * ((radius + beyond) * f64::from(k) / 8.0));
    std::iter::once(V::zeros()).chain(arc).chain(last).collect()
}

/// Force that presses the end of a loop on its beginning, N.
const PRESS: f64 = 0.02;

/// A rope in such a loop, pressed together at the tip, which is pulled by `pull`, N, along the beginning from
/// one second on.
fn pressed(pull: f64, friction: f64, seconds: f64, each: impl FnMut(f64, &Motion)) -> Motion {
    let rod = rope(&crossed_loop(), 1e-4);
    let force = [V::y() * -PRESS, V::new(pull, -PRESS, 0.0)];
    let force = Keyframes { times: vec![1.0, 1.2], values: force.to_vec() };
    let loads = vec![at_tip(&rod, force, Keyframes::constant(V::zeros()))];
    Scene { friction, loads, ..alone(rod) }.run(seconds, each)
}

/// Derivative of `f` by each unknown of the first guide.
fn derivative(motion: &Motion, f: impl Fn(&RodShape, &[f64]) -> f64) -> Vec<f64> {
    let (rod, mut q, mut shape) = (&motion.models[0].rod, motion.guides[0].q[0].clone(), RodShape::default());
    let step = 1e-3;
    let mut of = |i: usize| {
        let [more, less] = [step, -2.0 * step].map(|by| {
            q[i] += by;
            shape.update(rod, &rod.root.r, &q);
            f(&shape, &q)
        });
        q[i] += step;
        (more - less) / (2.0 * step)
    };
    (0..rod.unknowns()).map(&mut of).collect()
}

fn norm(x: &[f64]) -> f64 {
    x.iter().map(|x| x * x).sum::<f64>().sqrt()
}

#[test]
fn the_force_of_a_guide_on_itself_balances_its_load_and_its_rows_are_derivatives() {
    let end = pressed(0.0, 0.4, 2.0, |_, _| {});
    let (rod, contacts) = (&end.models[0].rod, &end.strand_contacts.pairs);
    let stiffness = rod.elastic_matrix();
    let n = rod.unknowns();
    let potential = |shape: &RodShape, q: &[f64]| {
        let rows = stiffness.chunks_exact(n).zip(q);
        let bent: f64 =
            rows.map(|(row, q_i)| 0.5 * q_i * row.iter().zip(q).map(|(k, q)| k * q).sum::<f64>()).sum();
        bent + PRESS * shape.x(rod.points() - 1).y
    };
    let work = |shape: &RodShape, _: &[f64]| {
        let of = |contact: &ContactPair| {
            let at = |side: usize| contacts.position_on_rod(&contact.contact, side);
            let [a, b] = [0, 1].map(at).map(|(k, u)| shape.curve_point(rod, k, u));
            contact.force().dot(&(a - b))
        };
        contacts.contacts.iter().map(of).sum()
    };
    let (wanted, found) = (derivative(&end, potential), derivative(&end, work));
    let off: Vec<f64> = wanted.iter().zip(&found).map(|(a, b)| a - b).collect();
    assert!(end.active() > 0 && norm(&off) < 1e-3 * norm(&found), "{} of {}", norm(&off), norm(&found));

    let guide = &end.strand_contacts.guides[0];
    // Contacts that cannot act take no part in the last round.
    let acts = |i: &usize| guide.sides.iter().any(|(contact, _)| contact == i);
    assert!(contacts.contacts.iter().enumerate().all(|(i, contact)| !contact.is_active() || acts(&i)));
    for (i, contact) in contacts.contacts.iter().enumerate().filter(|(i, _)| acts(i)) {
        for (d, axis) in contact.local_axes.iter().enumerate() {
            // L⁻¹Jᵀ of both sides.
            let mut y = vec![0.0; n];
            for ((_, _), rows) in
                guide.sides.iter().zip(guide.rows.chunks_exact(3 * n)).filter(|((c, _), _)| *c == i)
            {
                y.iter_mut().zip(&rows[d * n..]).for_each(|(y, row)| *y += row);
            }
            let factor = guide.scratch.solver.factor.chunks_exact(n).enumerate();
            let row = factor.map(|(j, l)| (0..j).map(|k| l[k] * y[k]).sum::<f64>() + y[j] / l[j]);
            let along = |shape: &RodShape, q: &[f64]| {
                let x: Vec<V> = shape.refined_curve(rod, q).collect();
                let (pair, u) = (contact.contact.pair, contact.contact.u);
                let on = |k: u32, u: f64| x[k as usize].lerp(&x[k as usize + 1], u);
                axis.dot(&(on(pair.0, u[0]) - on(pair.1, u[1])))
            };
            let wanted = derivative(&end, along);
            let off: Vec<f64> = row.zip(&wanted).map(|(a, b)| a - b).collect();
            assert!(norm(&off) < 1e-3 * norm(&wanted), "{i} {d}: {} of {}", norm(&off), norm(&wanted));
        }
    }
}

#[test]
fn friction_holds_a_guide_on_itself() {
    // How far the contact has moved along the beginning, in segments of the rod, and how it slips at last, m in
    // a sub-step.
    let pulled = |friction: f64| {
        let (mut at, mut slip) = ([0.0; 2], 0.0_f64);
        pressed(0.002, friction, 2.5, |t, m| {
            let pairs = &m.strand_contacts.pairs;
            for pair in pairs.contacts.iter().filter(|pair| pair.is_active()) {
                let n = pair.local_axes[0];
                let aside = |v: V| (v - n * n.dot(&v)).norm();
                let bound = friction * n.dot(&pair.reaction);
                assert!(aside(pair.reaction) <= bound * (1.0 + 1e-6) + 1e-12, "at {t} s");
                let (k, u) = pairs.position_on_rod(&pair.contact, 0);
                at[usize::from(t > 1.0)] = k as f64 + u;
                if t > 2.0 {
                    slip = slip.max(aside(pairs.last_slip(pair)));
                }
            }
        });
        (at[1] - at[0], slip)
    };
    let ((held, slip), (slid, _)) = (pulled(0.4), pulled(0.0));
    assert!(slip < 1e-8 && held.abs() < 0.1, "moved by {held} segments, slips by {slip} m");
    assert!(slid.abs() > 3.0 * held.abs(), "{slid} {held}");
}

#[test]
fn a_twisted_rope_winds_up_and_keeps_its_thickness() {
    let (stiffness, tension) = (2e-6, 0.005);
    let line = |s: f64| V::new(s, 0.002 * (PI * s / 0.5).sin(), 0.0);
    let rod = rope(&(0..=80).map(|k| line(0.5 * f64::from(k) / 80.0)).collect::<Vec<_>>(), stiffness);
    // Greenhill's moment, at which a long rod under tension leaves the straight line, is 2 √(EI T).
    let moment = V::x() * (1.15 * 2.0 * (stiffness * tension).sqrt());
    let moment = Keyframes { times: vec![0.0, 1.0], values: vec![V::zeros(), moment] };
    let loads = vec![at_tip(&rod, Keyframes::constant(V::x() * tension), moment)];
    let scene = Scene { h: 1.0 / 500.0, loads, ..alone(rod) };
    let (mut least, mut most) = (f64::INFINITY, 0);
    let end = scene.run(2.6, |t, m| {
        (least, most) = (thickness(curve(m)).min(least), m.active().max(most));
        assert!(m.fallbacks() == 0 && (m.active() == 0 || m.crossings() == 0), "at {t} s");
    });
    let tip = curve(&end).last().unwrap().x;
    assert!(most >= 8 && tip < 0.35, "{most} contacts, tip at {tip} m");
    assert!(least > 0.95, "{least} of the thickness");
}

#[test]
fn a_rope_lowered_into_a_smooth_pit_piles_up() {
    let length = 0.3;
    let line = |s: f64| V::new(0.004 * (9.0 * s).sin(), -s, 0.003 * (7.0 * s).sin());
    let rod = rope(&(0..=80).map(|k| line(length * f64::from(k) / 80.0)).collect::<Vec<_>>(), 5e-7);
    let side = |x: f64, z: f64| Shape::Plane { point: V::zeros(), normal: V::new(x, 1.0, z).normalize() };
    let rise = |t: f64| Isometry3::translation(0.0, -length - 0.01 + 0.3 * t, 0.0);
    let scene = Scene {
        h: 1.0 / 250.0,
        bodies: vec![side(1.0, 0.0), side(-1.0, 0.0), side(0.0, 1.0), side(0.0, -1.0)],
        body: Some(&rise),
        body_friction: Some(0.0),
        field: &|_| V::y() * -9.81,
        ..alone(rod)
    };
    let (mut least, mut most) = (f64::INFINITY, 0);
    scene.run(0.8, |t, m| {
        (least, most) = (thickness(curve(m)).min(least), m.active().max(most));
        assert_eq!(m.crossings(), 0, "at {t} s");
    });
    assert!(most >= 4, "{most} contacts");
    assert!(least > 0.95, "{least} of the thickness");
}

#[test]
fn a_coil_drawn_within_its_thickness_is_at_rest_and_returns_to_its_shape() {
    let turn = |a: f64| V::new(0.01 * a.sin(), -0.5 * D * a / TAU, 0.01 * (1.0 - a.cos()));
    let rod = rope(&(0..=160).map(|k| turn(2.0 * TAU * f64::from(k) / 160.0)).collect::<Vec<_>>(), 1e-5);
    let shaken = |t: f64| Isometry3::translation(0.0, 0.01 * (40.0 * (t.clamp(0.1, 0.4) - 0.1)).sin(), 0.0);
    let scene = Scene { head: &shaken, ..alone(rod) };
    let (mut drawn, mut off, mut pushed) = (Vec::new(), 0.0, 0);
    scene.run(1.6, |t, m| {
        if drawn.is_empty() {
            drawn = curve(m).to_vec();
        }
        off = curve(m).iter().zip(&drawn).map(|(a, b)| (a - b).norm()).fold(0.0, f64::max);
        assert!(t > 0.1 || off < 1e-12 && m.active() == 0, "off by {off} m at {t} s");
        pushed += m.active();
    });
    assert!(pushed > 0 && off < 1e-4, "off by {off} m after {pushed} contacts");
}

#[test]
fn a_hairpin_that_falls_shut_gains_no_energy_and_keeps_its_distance() {
    for steps in [500.0, 2000.0, 8000.0] {
        let rod = Rod::new(&RodSource::hair(&hairpin(0.03, 4e-4), &Tree::default_arc(8))).unwrap();
        let bundle = BundleProperties { bundle_radius: 5.2e-5, ..BUNDLE };
        let scene = Scene {
            h: 1.0 / steps,
            friction: 0.0,
            bundles: vec![bundle],
            drag: vec![0.0],
            ..Scene::new(vec![rod])
        };
        let (mut start, mut pushed, mut work, mut least) = (None, 0, 0.0, f64::INFINITY);
        scene.run(0.06, |t, m| {
            let now = energy(&scene, m);
            let start = *start.get_or_insert(now);
            // Kinetic energy before the impact is 1.4e-9 J.
            assert!(now < start + 1e-12, "{steps} steps a second: {now} J at {t} s after {start} J");
            let close = m.strand_contacts.pairs.contacts.iter().filter(|contact| contact.is_active());
            least = close.map(|contact| contact.contact.distance / contact.lawful).fold(least, f64::min);
            pushed += m.active();
            work += m.records[0].strands.work;
            assert_eq!(m.crossings(), 0, "{steps} steps a second, at {t} s");
        });
        assert!(pushed > 3, "{steps} steps a second: pushed {pushed} times");
        assert!(least > 0.95, "{steps} steps a second: {least} of the distance");
        assert!(work < 0.0, "{steps} steps a second: work of {work} J");
    }
}
