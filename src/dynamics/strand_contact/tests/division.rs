//! Divided sub-steps: only those that fail, and what they touch, take them in parts.

use super::*;

/// The head of a brush that is thrown about in long sub-steps.
fn thrown(t: f64) -> Isometry3<f64> {
    let turn = UnitQuaternion::from_scaled_axis(V::z() * (2.0 * (30.0 * t).sin()));
    Isometry3::from_parts(V::x().scale(0.1 * (40.0 * t).sin()).into(), turn)
}

/// A strand that lies across another, far from the brush.
fn cross_of_two() -> Vec<Rod> {
    let at = V::new(0.0, 0.0, 2.0);
    [(V::new(0.0, -1e-3, -0.03), V::z()), (V::new(-0.03, 0.0, 0.0), V::x())]
        .map(|(from, along)| strand(at + from, at + from + along * 0.06, 30.0))
        .into()
}

#[test]
fn guides_that_do_not_touch_each_other_move_as_if_each_were_alone() {
    let run = |rods: Vec<Rod>| {
        let mut scene = Scene::new(rods);
        scene.h = 1.0 / 24.0;
        scene.head = &thrown;
        let (mut halvings, mut motion) = (Vec::new(), Vec::new());
        scene.run(0.2, |_, m| {
            halvings.push(m.records.iter().map(|r| r.halvings).collect::<Vec<u32>>());
            motion.push(m.guides.iter().map(|g| (g.x.clone(), g.v.clone())).collect::<Vec<_>>());
        });
        (halvings, motion)
    };
    let count = brush().len();
    let [brush_alone, two_alone, together] =
        [brush(), cross_of_two(), [brush(), cross_of_two()].concat()].map(run);
    let divided = |halvings: &[u32]| halvings.iter().any(|&h| h > 0);
    let halved = together.0.iter().filter(|h| divided(&h[..count]) && !divided(&h[count..])).count();
    assert!(halved > 1, "{:?}", together.0);
    for (step, all) in together.1.iter().enumerate() {
        assert!(all[..count] == brush_alone.1[step], "the brush in sub-step {step}");
        assert!(all[count..] == two_alone.1[step], "the two in sub-step {step}");
    }
}

#[test]
fn a_division_takes_no_more_guides_than_it_must() {
    let mut scene = Scene::new(brush());
    scene.h = 1.0 / 48.0;
    scene.head = &thrown;
    let (mut of_some, mut of_all) = (0, 0);
    scene.run(0.25, |_, m| {
        let divided = m.records.iter().filter(|r| r.halvings > 0).count();
        of_some += usize::from(divided > 0 && divided < m.records.len());
        of_all += usize::from(divided == m.records.len());
        assert_eq!(m.records.iter().map(|r| r.crossed + r.strands.crossings).sum::<u32>(), 0);
    });
    assert!(of_some > 0, "{of_some} sub-steps were divided for some, {of_all} for all");
}
