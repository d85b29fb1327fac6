//! Divided sub-steps: only those that fail, and what they touch, take them in parts.

use super::super::island::Island;
use super::*;
use std::collections::BTreeSet;

/// A strand that lies across another, `far`, m, above the brush.
fn cross_of_two(far: f64) -> Vec<Rod> {
    let at = V::new(0.0, 0.0, far);
    [(V::new(0.0, -1e-3, -0.03), V::z()), (V::new(-0.03, 0.0, 0.0), V::x())]
        .map(|(from, along)| strand(at + from, at + from + along * 0.06, 30.0))
        .into()
}

#[test]
fn a_brush_thrown_about_in_long_substeps_halves_them_and_does_not_cross_itself() {
    let mut scene = Scene::new(brush());
    scene.h = 1.0 / 24.0;
    scene.head = &thrown;
    let ball = Shape::Sphere { centre: V::new(0.02, 0.07, 0.0), radius: 0.015 };
    scene.bodies = vec![ball];
    let mut divided = 0;
    scene.run(0.13, |t, m| {
        divided += usize::from(m.records.iter().any(|r| r.halvings > 0));
        // Every part of every guide is observed.
        let parts: Vec<usize> = m.records.iter().map(|r| r.halvings as usize + 1).collect();
        assert_eq!(m.arrivals, parts, "at {t} s");
        assert_eq!(m.crossings(), 0, "at {t} s");
        assert_eq!(m.records.iter().map(|r| r.crossed + r.strands.crossings).sum::<u32>(), 0);
    });
    assert!(divided > 0);
}

#[test]
fn guides_that_do_not_touch_each_other_move_as_if_each_were_alone() {
    let run = |rods: Vec<Rod>| {
        let mut scene = Scene::new(rods);
        scene.h = 1.0 / 24.0;
        scene.head = &thrown;
        let (mut halvings, mut motion) = (Vec::new(), Vec::new());
        scene.run(0.09, |_, m| {
            halvings.push(m.records.iter().map(|r| r.halvings).collect::<Vec<u32>>());
            motion.push(m.guides.iter().map(|g| (g.x.clone(), g.v.clone())).collect::<Vec<_>>());
        });
        (halvings, motion)
    };
    let (brush, second) = (brush(), brush_at(V::new(1.0, 0.0, 0.0)));
    let count = brush.len();
    let [alone, second_alone, two_alone] = [brush.clone(), second.clone(), cross_of_two(2.0)].map(run);
    let together = run([brush, second, cross_of_two(2.0)].concat());
    let divided = |halvings: &[u32]| halvings.iter().any(|&h| h > 0);
    let parts =
        |h: &Vec<u32>| [0..count, count..2 * count, 2 * count..2 * count + 2].map(|of| divided(&h[of]));
    let seen: BTreeSet<[bool; 3]> = together.0.iter().map(parts).collect();
    assert!(seen.contains(&[true, true, false]), "{:?}", together.0);
    for (step, all) in together.1.iter().enumerate() {
        assert!(all[..count] == alone.1[step], "the brush in sub-step {step}");
        assert!(all[count..2 * count] == second_alone.1[step], "the second in sub-step {step}");
        assert!(all[2 * count..] == two_alone.1[step], "the two in sub-step {step}");
    }
}

#[test]
fn a_part_of_a_brush_takes_parts_without_the_rest_and_nothing_crosses() {
    let mut scene = Scene::new(brush());
    scene.h = 1.0 / 48.0;
    scene.head = &thrown;
    let mut of_some = 0;
    scene.run(0.25, |t, m| {
        let divided = m.records.iter().filter(|r| r.halvings > 0).count();
        of_some += usize::from(divided > 0 && divided < m.records.len());
        assert_eq!(m.arrivals, m.records.iter().map(|r| r.halvings as usize + 1).collect::<Vec<_>>());
        assert_eq!(m.crossings(), 0, "at {t} s");
        // What a guide that took parts pushes took parts with it: else it would not give way.
        for known in m.strand_contacts.pairs.history.iter().filter(|k| k.reaction != V::zeros()) {
            let [a, b] = known.guides.map(|g| m.records[g as usize].halvings > 0);
            assert_eq!(a, b, "{:?} at {t} s", known.guides);
        }
    });
    assert!(of_some > 0);
}

#[test]
fn what_does_not_come_to_rest_is_given_up_with_what_takes_parts_with_it_alone() {
    // Side by side, each within reach of the next alone; nothing pushes.
    let side_by_side = |i: usize| {
        let from = V::x() * (4e-4 * i as f64);
        strand(from, from + V::z() * 0.06, 30.0)
    };
    let mut scene = Scene::new((0..4).map(side_by_side).collect());
    scene.field = &|_| V::zeros();
    let Motion { guides, strand_contacts: mut contacts, records, .. } = scene.run(H, |_, _| {});
    let found = [0, 1, 2, 3].map(|g| (records[g].strands.found, records[g].strands.active));
    assert!(found[..3].iter().all(|(found, active)| *found > 0 && *active == 0), "{found:?}");
    let thrown_about = &mut contacts.guides[0];
    (thrown_about.needs_round, thrown_about.rounds, thrown_about.displacement) = (true, 20, 0.1);
    contacts.give_up(&guides, &[Island { guides: vec![0, 1, 2, 3], contacts: Vec::new() }]);
    let given_up: Vec<bool> = contacts.guides.iter().map(|guide| guide.given_up).collect();
    // The second is near it, and would be pushed by it in parts.
    assert_eq!(given_up, [true, true, false, false]);
}

#[test]
fn threads_change_no_bit() {
    let run = |threads: usize, head: &(dyn Fn(f64) -> Isometry3<f64> + Sync), h: f64| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| {
            let mut scene = Scene::new(brush());
            (scene.head, scene.h) = (head, h);
            let mut divided = BTreeSet::new();
            let end = scene.run(0.2, |_, m| divided.extend(m.records.iter().map(|r| r.halvings > 0)));
            assert!(end.active() > 0);
            (end.guides.into_iter().map(|g| (g.x, g.v)).collect::<Vec<_>>(), divided)
        })
    };
    assert!(run(1, &shaken, H) == run(2, &shaken, H));
    let [one, two] = [1, 2].map(|threads| run(threads, &thrown, 1.0 / 48.0));
    // For some of them.
    assert!(one == two && one.1.len() == 2);
}
