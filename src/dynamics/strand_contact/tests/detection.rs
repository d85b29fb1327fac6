//! Detection after some guides have moved, against that of all of them.

use super::super::contact_pairs::MARGIN;
use super::*;
use std::collections::BTreeSet;

#[test]
fn detection_of_guides_that_have_moved_finds_what_detection_of_all_does() {
    let (guides, points) = (30, 9);
    let arc: Vec<f64> = (0..5).map(|k| 0.02 + 0.02 * f64::from(k)).collect();
    let mut drawn = 0..;
    let mut within = |scale: f64| (random::unit(11, drawn.next().unwrap()) - 0.5) * scale;
    let mut vector = |scale: f64| V::new(within(scale), within(scale), within(scale));
    let line = |from: V, along: V| (0..points).map(move |k| from + along * (f64::from(k) / 8.0));
    let x: Vec<V> = (0..guides).flat_map(|_| line(vector(0.06), vector(0.12))).collect();
    let mut ends: Vec<V> = x.iter().map(|x| x + vector(4e-3)).collect();
    let [mut local, mut all] = [0, 1].map(|_| {
        let mut pairs = ContactPairs::new(&vec![&arc[..]; guides], vec![BUNDLE; guides]);
        pairs.drawn.clone_from(&x);
        pairs.x = [x.clone(), ends.clone()];
        pairs.begin(H, |_| true);
        pairs
    });
    let before = all.contacts.len();
    for round in 0..6 {
        // Some move far, or all a little.
        let far = |g: usize| round % 2 == 0 && g % 4 == round / 2;
        let moves = |g: usize| round % 2 == 1 || far(g);
        for (k, end) in ends.iter_mut().enumerate().filter(|(k, _)| moves(k / points as usize)) {
            *end += vector(if far(k / points as usize) { 0.01 } else { 0.3 * MARGIN });
        }
        local.x[1].clone_from(&ends);
        all.x[1].clone_from(&ends);
        if round % 2 == 0 {
            local.add_candidates(far);
        }
        local.detect(moves);
        all.find_candidates(|_| true);
        all.detect(|_| true);
        let contacts = |pairs: &ContactPairs| pairs.contacts.iter().map(|p| p.contact).collect::<Vec<_>>();
        assert_eq!(contacts(&local), contacts(&all), "round {round}");
        let crossing = |pairs: &ContactPairs| pairs.crossing.iter().copied().collect::<BTreeSet<_>>();
        assert_eq!(crossing(&local), crossing(&all), "round {round}");
        assert!(!all.crossing.is_empty());
    }
    assert!(all.contacts.len() > before + 5, "{before} {}", all.contacts.len());
}
