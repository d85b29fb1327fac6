//! Guides that stand for different numbers of hairs, and for those of others that follow them.

use super::*;

/// The ways of two equal strands that the swinging head throws together, where they stand for so many `hairs`, m.
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
    scene.skins.iter_mut().zip(hairs).for_each(|(skin, hairs)| skin.hairs = hairs);
    let mut ways = [Vec::new(), Vec::new()];
    let mut touched = 0;
    scene.run(0.3, |_, m| {
        touched += m.active();
        ways.iter_mut().zip(&m.guides).for_each(|(way, guide)| way.extend_from_slice(&guide.x));
    });
    assert!(touched > 0);
    ways
}

/// Farthest that two ways are from each other, m.
fn apart(a: &[V], b: &[V]) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b).norm()).fold(0.0, f64::max)
}

#[test]
fn the_light_is_moved_aside_and_the_heavy_hardly() {
    // Against nothing that weighs: as if it were alone.
    let [alone, _] = thrown_together([1.0, 1e-9]);
    let [even, _] = thrown_together([1.0, 1.0]);
    let [heavy, _] = thrown_together([1000.0, 1.0]);
    let [light, _] = thrown_together([1.0, 1000.0]);
    let [light, even, heavy] = [light, even, heavy].map(|way| apart(&way, &alone));
    assert!(light > 1.3 * even && even > 3e-3, "{light} {even}");
    // By a thousandth, as momentum has it.
    assert!(heavy > 2e-4 * light && heavy < 3e-3 * light, "{heavy} {light}");
    // What they have in common does not matter.
    let [one, other] = [[3.0, 1.0], [300.0, 100.0]].map(thrown_together);
    assert!((0..2).all(|g| apart(&one[g], &other[g]) < 1e-6));
}

#[test]
fn what_stands_for_many_hairs_moves_as_what_is_so_much_stiffer_and_heavier() {
    let n = 6.0;
    let field = |t: f64| V::y() * (20.0 * (25.0 * t).sin()) + V::z() * (5.0 * (40.0 * t).cos());
    let run = |hairs: f64, as_one: f64| {
        let rods = vec![
            strand(V::zeros(), V::new(0.11, 0.0, 0.0), 3.0),
            bundle(V::new(0.2, 0.001, 0.03), V::new(0.09, 0.001, -0.005), 3.0 * as_one, as_one),
        ];
        let mut scene = Scene { field: &field, ..Scene::new(rods) };
        (scene.skins[1].hairs, scene.drag[1]) = (hairs, 1e-4 * as_one);
        // They cling with the same force in all runs.
        let girth = 2.0 / (1.0 + 1.0 / hairs.sqrt());
        scene.skins.iter_mut().for_each(|skin| skin.cohesion = 0.02 / girth);
        // Under the tip of the other; so what is between guides is balanced by what bodies do.
        scene.bodies = vec![Shape::Sphere { centre: V::new(0.1, -0.025, 0.0), radius: 0.02 }];
        let (mut ways, mut touched, mut both) = (Vec::new(), 0, 0);
        scene.run(0.6, |_, m| {
            touched += u32::from(m.active() > 0);
            both += u32::from(m.active() > 0 && m.records.iter().any(|r| r.active > 0));
            m.guides.iter().for_each(|g| ways.extend_from_slice(&g.x));
        });
        assert!(touched > 5 && both > 0, "{touched} {both}");
        ways
    };
    let (many, one, light) = (run(n, 1.0), run(1.0, n), run(1.0, 1.0));
    let (same, other) = (apart(&many, &one), apart(&light, &one));
    assert!(same < 1e-4 && other > 20.0 * same, "{same} {other}");
}

/// A shaken brush where one of its strands pushes another, with the time and these two.
fn tangled() -> (f64, Motion, [usize; 2]) {
    let mut scene = Scene::new(brush());
    scene.head = &shaken;
    for (g, skin) in scene.skins.iter_mut().enumerate() {
        (skin.bundle, skin.hairs) = (3e-4 + 1e-6 * g as f64, 1.0 + g as f64);
    }
    let mut now = 0.0;
    let motion = scene.run(0.3, |t, _| now = t);
    let place = motion.strand_contacts.places.found.iter().find(|p| p.pushes()).expect("something pushes");
    let two = motion.strand_contacts.places.guides(&place.contact);
    (now, motion, two)
}

fn shaken_about() -> Environment<'static> {
    let gravity = Box::new(|_| V::zeros());
    Environment { head: Box::new(shaken), gravity, ..Environment::at_rest(Bodies::default()) }
}

/// The guides of the places that are known to push, with the forces, N, were nothing to move.
fn pushed(strand_contacts: &mut StrandContacts) -> Vec<([usize; 2], V)> {
    strand_contacts.places.x[1] = strand_contacts.places.x[0].clone();
    strand_contacts.places.begin();
    let pushing = strand_contacts.places.found.iter().filter(|p| p.pushes());
    pushing.map(|p| (strand_contacts.places.guides(&p.contact), p.reaction)).collect()
}

#[test]
fn what_follows_leaves_and_what_it_follows_is_as_thick_and_heavy_as_both() {
    let (t, Motion { models, guides, mut strand_contacts, .. }, [stays, goes]) = tangled();
    let env = shaken_about();
    let (own, before) = (strand_contacts.places.skin.clone(), strand_contacts.places.x[0].clone());
    strand_contacts.rebuild(&models, &guides, |g| if g == goes { stays } else { g }, &env, t);
    assert!(!strand_contacts.active().contains(&goes) && strand_contacts.active().len() == guides.len() - 1);
    assert_eq!(strand_contacts.places.x[0].len(), before.len() - (2 * models[goes].rod.points() - 1));
    let skin = &strand_contacts.places.skin[stays];
    let squares = own[stays].bundle.powi(2) + own[goes].bundle.powi(2);
    assert!((skin.bundle.powi(2) - squares).abs() < 1e-12 * squares);
    assert_eq!(skin.hairs, own[stays].hairs + own[goes].hairs);
    assert!(!strand_contacts.pushed[goes]);
    // Comes back, and nothing is known of it.
    strand_contacts.rebuild(&models, &guides, |g| g, &env, t);
    assert_eq!(strand_contacts.places.skin, own);
    assert_eq!(strand_contacts.active().len(), guides.len());
    let off =
        strand_contacts.places.x[0].iter().zip(&before).map(|(a, b)| (a - b).norm()).fold(0.0, f64::max);
    assert!(off < 1e-15, "{off}");
    let still = pushed(&mut strand_contacts);
    assert!(!still.is_empty() && still.iter().all(|(guides, _)| !guides.contains(&goes)), "{still:?}");
}

#[test]
fn what_is_known_of_contacts_stays_known_when_another_guide_leaves() {
    let (t, Motion { models, guides, mut strand_contacts, .. }, _) = tangled();
    let env = shaken_about();
    // All behind it are numbered otherwise then.
    let mut wanted = pushed(&mut strand_contacts);
    wanted.retain(|(guides, _)| !guides.contains(&0));
    assert!(wanted.len() > 5, "{}", wanted.len());
    strand_contacts.rebuild(&models, &guides, |g| g.max(1), &env, t);
    let mut found = pushed(&mut strand_contacts);
    // The thicker one may meet more.
    found.retain(|(guides, _)| !guides.contains(&1));
    wanted.retain(|(guides, _)| !guides.contains(&1));
    assert_eq!(found, wanted);
}

#[test]
fn what_thickens_pushes_nothing_aside_at_once() {
    let mut places = ContactPairs::new(
        &[&[0.02, 0.12], &[0.02, 0.12]],
        vec![BundleProperties { bundle: 3e-3, ..SKIN }; 2],
    );
    // Across each other, 1 mm apart: a sixth of what they were to keep.
    let with_middle = |a: V, b: V| [a, a.lerp(&b, 0.5), b];
    let x = [
        with_middle(V::zeros(), V::x() * 0.1),
        with_middle(V::new(0.049, 1e-3, -0.05), V::new(0.049, 1e-3, 0.04)),
    ];
    places.x = [x.concat(), x.concat()];
    places.begin();
    assert_eq!(places.found.len(), 1);
    assert!(places.found[0].gap() >= 0.0 && !places.found[0].acts());
    // As far as they part they keep it.
    places.end_of(1).iter_mut().for_each(|x| x.y = 2e-3);
    places.look();
    places.end();
    places.x[1] = places.x[0].clone();
    places.begin();
    assert!((places.found[0].keep - 2e-3).abs() < 1e-12, "{}", places.found[0].keep);
}
