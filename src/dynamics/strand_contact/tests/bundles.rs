//! Guides that represent different numbers of hairs, and the hairs of their followers.

use super::*;

/// Paths, m, of two equal strands thrown together by the swinging head; each represents as many `hairs`.
fn thrown_together(hairs: [f64; 2]) -> [Vec<V>; 2] {
    let swing = |t: f64| {
        let turn = UnitQuaternion::from_scaled_axis(V::x() * (0.3 * (25.0 * t).sin()));
        let middle = V::z() * 0.07;
        Isometry3::from_parts((middle - turn * middle).into(), turn)
    };
    let rods = vec![
        strand(V::new(0.0, 0.003, 0.0), V::new(0.14, 0.003, 0.14), 1.0),
        strand(V::new(0.0, -0.003, 0.14), V::new(0.14, -0.003, 0.0), 1.0),
    ];
    let mut scene = Scene { head: &swing, field: &|_| V::zeros(), ..Scene::new(rods) };
    scene.bundles.iter_mut().zip(hairs).for_each(|(bundle, hairs)| bundle.hairs = hairs);
    let mut ways = [Vec::new(), Vec::new()];
    let mut touched = 0;
    scene.run(0.3, |_, m| {
        touched += m.active();
        ways.iter_mut().zip(&m.guides).for_each(|(way, guide)| way.extend_from_slice(&guide.x));
    });
    assert!(touched > 0);
    ways
}

/// Largest distance of two paths, m.
fn apart(a: &[V], b: &[V]) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b).norm()).fold(0.0, f64::max)
}

#[test]
fn a_light_bundle_is_deflected_in_proportion_to_the_mass_ratio() {
    // Against a massless bundle it moves as if uncoupled.
    let [alone, _] = thrown_together([1.0, 1e-9]);
    let [even, _] = thrown_together([1.0, 1.0]);
    let [heavy, _] = thrown_together([1000.0, 1.0]);
    let [light, _] = thrown_together([1.0, 1000.0]);
    let [light, even, heavy] = [light, even, heavy].map(|way| apart(&way, &alone));
    assert!(light > 1.3 * even && even > 3e-3, "{light} {even}");
    // By a thousandth, from the conservation of momentum.
    assert!(heavy > 2e-4 * light && heavy < 3e-3 * light, "{heavy} {light}");
    // Only the ratio matters.
    let [one, other] = [[3.0, 1.0], [300.0, 100.0]].map(thrown_together);
    assert!((0..2).all(|g| apart(&one[g], &other[g]) < 1e-6));
}

#[test]
fn a_bundle_of_n_hairs_moves_like_one_rod_n_times_as_stiff_and_heavy() {
    let n = 6.0;
    let field = |t: f64| V::y() * (20.0 * (25.0 * t).sin()) + V::z() * (5.0 * (40.0 * t).cos());
    let run = |hairs: f64, as_one: f64| {
        let rods = vec![
            strand(V::zeros(), V::new(0.11, 0.0, 0.0), 3.0),
            bundle(V::new(0.2, 0.001, 0.03), V::new(0.09, 0.001, -0.005), 3.0 * as_one, as_one),
        ];
        let mut scene = Scene { field: &field, ..Scene::new(rods) };
        (scene.bundles[1].hairs, scene.drag[1]) = (hairs, 1e-4 * as_one);
        // The same cohesive force in all runs.
        let girth = 2.0 / (1.0 + 1.0 / hairs.sqrt());
        scene.bundles.iter_mut().for_each(|bundle| bundle.cohesion = 0.02 / girth);
        // Under the tip of the other, so that contact forces between guides are balanced by bodies.
        scene.bodies = vec![Shape::Sphere { centre: V::new(0.1, -0.025, 0.0), radius: 0.02 }];
        let (mut ways, mut touched, mut both) = (Vec::new(), 0, 0);
        scene.run(0.6, |t, m| {
            touched += u32::from(m.active() > 0);
            both += u32::from(m.active() > 0 && m.records.iter().any(|r| r.active > 0));
            // Later, a nudge of 1e-9 moves them as far apart.
            if t < 0.45 {
                m.guides.iter().for_each(|g| ways.extend_from_slice(&g.x));
            }
        });
        assert!(touched > 5 && both > 0, "{touched} {both}");
        ways
    };
    let (many, one, light) = (run(n, 1.0), run(1.0, n), run(1.0, 1.0));
    let (same, other) = (apart(&many, &one), apart(&light, &one));
    assert!(same < 1e-5 && other > 1e3 * same, "{same} {other}");
}

/// A shaken brush in which one strand pushes another, with the time and these two.
fn brush_in_contact() -> (f64, Motion, [usize; 2]) {
    let mut scene = Scene::new(brush());
    scene.head = &shaken;
    for (g, bundle) in scene.bundles.iter_mut().enumerate() {
        (bundle.bundle_radius, bundle.hairs) = (3e-4 + 1e-6 * g as f64, 1.0 + g as f64);
    }
    let mut now = 0.0;
    let motion = scene.run(0.3, |t, _| now = t);
    let pair =
        motion.strand_contacts.pairs.contacts.iter().find(|p| p.is_active()).expect("something pushes");
    let two = motion.strand_contacts.pairs.guides(&pair.contact);
    (now, motion, two)
}

fn shaken_about() -> Environment<'static> {
    let gravity = Box::new(|_| V::zeros());
    Environment { head: Box::new(shaken), gravity, ..Environment::at_rest(Bodies::default()) }
}

/// The guides and reactions, N, of the active contacts in the history, found again without motion.
fn pushed(strand_contacts: &mut StrandContacts) -> Vec<([usize; 2], V)> {
    strand_contacts.pairs.x[1] = strand_contacts.pairs.x[0].clone();
    strand_contacts.pairs.begin(H, |_| true);
    let pushing = strand_contacts.pairs.contacts.iter().filter(|p| p.is_active());
    pushing.map(|p| (strand_contacts.pairs.guides(&p.contact), p.reaction)).collect()
}

#[test]
fn a_follower_leaves_the_contact_and_its_leader_takes_its_hairs() {
    let (t, Motion { models, guides, mut strand_contacts, .. }, [stays, goes]) = brush_in_contact();
    let env = shaken_about();
    let (own, before) = (strand_contacts.pairs.bundles.clone(), strand_contacts.pairs.x[0].clone());
    strand_contacts.rebuild(&models, &guides, |g| if g == goes { stays } else { g }, &env, t);
    assert!(!strand_contacts.active().contains(&goes) && strand_contacts.active().len() == guides.len() - 1);
    assert_eq!(strand_contacts.pairs.x[0].len(), before.len() - (2 * models[goes].rod.points() - 1));
    let bundle = &strand_contacts.pairs.bundles[stays];
    let squares = own[stays].bundle_radius.powi(2) + own[goes].bundle_radius.powi(2);
    assert!((bundle.bundle_radius.powi(2) - squares).abs() < 1e-12 * squares);
    assert_eq!(bundle.hairs, own[stays].hairs + own[goes].hairs);
    assert!(!strand_contacts.pushed[goes]);
    // It comes back without history.
    strand_contacts.rebuild(&models, &guides, |g| g, &env, t);
    assert_eq!(strand_contacts.pairs.bundles, own);
    assert_eq!(strand_contacts.active().len(), guides.len());
    let off = strand_contacts.pairs.x[0].iter().zip(&before).map(|(a, b)| (a - b).norm()).fold(0.0, f64::max);
    assert!(off < 1e-15, "{off}");
    let still = pushed(&mut strand_contacts);
    assert!(!still.is_empty() && still.iter().all(|(guides, _)| !guides.contains(&goes)), "{still:?}");
}

#[test]
fn contact_history_survives_the_departure_of_another_guide() {
    let (t, Motion { models, guides, mut strand_contacts, .. }, _) = brush_in_contact();
    let env = shaken_about();
    // The points of all later guides are renumbered.
    let mut wanted = pushed(&mut strand_contacts);
    wanted.retain(|(guides, _)| !guides.contains(&0));
    assert!(wanted.len() > 5, "{}", wanted.len());
    strand_contacts.rebuild(&models, &guides, |g| g.max(1), &env, t);
    let mut found = pushed(&mut strand_contacts);
    // The thicker leader may have more contacts.
    found.retain(|(guides, _)| !guides.contains(&1));
    wanted.retain(|(guides, _)| !guides.contains(&1));
    assert_eq!(found, wanted);
}

#[test]
fn a_thickened_bundle_recovers_no_distance_that_the_pair_never_had() {
    let mut pairs = ContactPairs::new(
        &[&[0.02, 0.12], &[0.02, 0.12]],
        vec![BundleProperties { bundle_radius: 3e-3, ..BUNDLE }; 2],
    );
    // Crossing, 1 mm apart: a sixth of the required distance.
    let with_middle = |a: V, b: V| [a, a.lerp(&b, 0.5), b];
    let x = [
        with_middle(V::zeros(), V::x() * 0.1),
        with_middle(V::new(0.049, 1e-3, -0.05), V::new(0.049, 1e-3, 0.04)),
    ];
    pairs.x = [x.concat(), x.concat()];
    pairs.begin(H, |_| true);
    assert_eq!(pairs.contacts.len(), 1);
    assert!(pairs.contacts[0].gap() >= 0.0 && !pairs.contacts[0].needs_coupling());
    // They keep the distance that they reach.
    pairs.end_mut(1).iter_mut().for_each(|x| x.y = 2e-3);
    pairs.detect(|_| true);
    pairs.end();
    pairs.x[1] = pairs.x[0].clone();
    pairs.begin(H, |_| true);
    assert!((pairs.contacts[0].required - 2e-3).abs() < 1e-12, "{}", pairs.contacts[0].required);
}

#[test]
fn missing_distance_is_regained_per_time() {
    let with_middle = |a: V, b: V| [a, a.lerp(&b, 0.5), b];
    let apart = |y: f64| {
        let across = with_middle(V::new(0.049, y, -0.05), V::new(0.049, y, 0.04));
        [with_middle(V::zeros(), V::x() * 0.1), across].concat()
    };
    let speed = |duration: f64, [had, left]: [f64; 2]| {
        let bundle = BundleProperties { bundle_radius: 3e-3, ..BUNDLE };
        let mut pairs = ContactPairs::new(&[&[0.02, 0.12], &[0.02, 0.12]], vec![bundle; 2]);
        pairs.x = [apart(had), apart(had)];
        pairs.begin(duration, |_| true);
        pairs.end();
        pairs.x = [apart(left), apart(left)];
        pairs.begin(duration, |_| true);
        (pairs.contacts[0].required - left) / duration
    };
    // A twentieth of a second for 0.2 mm; at most 5 cm/s for 4 mm.
    for steps in [200.0, 500.0, 16000.0] {
        let [slow, fast] = [[1.2e-3, 1e-3], [5e-3, 1e-3]].map(|way| speed(1.0 / steps, way));
        assert!((slow / 4e-3 - 1.0).abs() < 0.06, "{steps} steps a second: {slow} m/s");
        assert!((fast - 0.05).abs() < 1e-9, "{steps} steps a second: {fast} m/s");
    }
}

#[test]
fn guides_that_come_too_close_within_a_step_are_in_contact() {
    let bundle = BundleProperties { bundle_radius: 3e-3, ..BUNDLE };
    let d = 2.0 * (bundle.hair_radius + bundle.bundle_radius);
    let mut pairs = ContactPairs::new(&[&[0.02, 0.12], &[0.02, 0.12]], vec![bundle; 2]);
    let with_middle = |a: V, b: V| [a, a.lerp(&b, 0.5), b];
    pairs.x = [2.2 * d, 0.8 * d].map(|y| {
        let across = with_middle(V::new(0.049, y, -0.05), V::new(0.049, y, 0.04));
        [with_middle(V::zeros(), V::x() * 0.1), across].concat()
    });
    pairs.begin(H, |_| true);
    assert_eq!(pairs.contacts.len(), 1);
    assert!(pairs.contacts[0].needs_coupling() && (pairs.contacts[0].required / d - 1.0).abs() < 1e-9);
}
