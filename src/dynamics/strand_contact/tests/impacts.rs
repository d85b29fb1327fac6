//! Hairs that fall on each other: energy, distances and impacts at steps of any length.

use super::*;

/// A hair that falls on the tip of a shorter, stiffer one, crosswise; both undamped, in no air.
fn crossed_cantilevers(steps: f64) -> Scene<'static> {
    let upper = V::new(0.015, 0.5e-3, 0.0);
    let rods = vec![
        strand_undamped(V::zeros(), V::x() * 0.02),
        strand_undamped(upper - V::z() * 0.03, upper + V::z() * 0.01),
    ];
    let bundles = vec![BundleProperties { bundle_radius: 5.2e-5, ..BUNDLE }; 2];
    Scene { h: 1.0 / steps, friction: 0.0, bundles, drag: vec![0.0; 2], ..Scene::new(rods) }
}

fn strand_undamped(from: V, to: V) -> Rod {
    Rod::new(&RodSource::hair(&[from, to], &Tree::default_arc(8))).unwrap()
}

/// Kinetic, elastic and gravitational energy of all strands, J.
fn energy(scene: &Scene, motion: &Motion) -> [f64; 3] {
    let mut sum = [0.0; 3];
    for (model, state) in motion.models.iter().zip(&motion.guides) {
        let (rod, q) = (&model.rod, &state.q[0]);
        let elastic = rod.elastic_matrix();
        for (i, row) in elastic.chunks_exact(q.len()).enumerate() {
            sum[1] += 0.5 * q[i] * row.iter().zip(q).map(|(k, q)| k * q).sum::<f64>();
        }
        for k in 0..rod.points() {
            sum[0] += 0.5 * rod.mass[k] * state.v[k].norm_squared();
            sum[2] -= rod.mass[k] * (scene.field)(0.0).dot(&state.x[k]);
        }
    }
    sum
}

#[test]
fn impacts_gain_no_energy() {
    for steps in [500.0, 1000.0, 2000.0, 4000.0, 8000.0, 16000.0] {
        let scene = crossed_cantilevers(steps);
        let mut before: Option<[f64; 3]> = None;
        let mut last = [0.0; 3];
        let mut start = None;
        let mut least = f64::INFINITY;
        let mut first = None;
        let mut most = f64::NEG_INFINITY;
        let mut halvings = 0;
        scene.run(0.1, |t, m| {
            let e = energy(&scene, m);
            let total: f64 = e.iter().sum();
            start.get_or_insert(total);
            if m.active() > 0 && before.is_none() {
                before = Some(last);
                first = Some((t, total - last.iter().sum::<f64>()));
            }
            most = most.max(total);
            halvings += m.records.iter().map(|r| r.halvings).sum::<u32>();
            let closest = m.strand_contacts.pairs.contacts.iter().map(|p| p.contact.distance).fold(f64::INFINITY, f64::min);
            let required = m.strand_contacts.pairs.contacts.iter().map(|p| p.limit).fold(0.0, f64::max);
            let _ = required;
            least = least.min(closest);
            last = e;
        });
        let total: f64 = last.iter().sum();
        println!("{steps}: start {:.3e} before {:?} first {:?} end change {:.3e} most {:.3e} least {:.3e} halvings {halvings} tip {:?}", start.unwrap(), before, first, total - start.unwrap(), most - start.unwrap(), least, 0);
    }
}
