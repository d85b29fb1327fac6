//! Sag-free start (`docs/theory.md` §6): makes the groom's pose a stable equilibrium under gravity and the
//! reactions of what the hair lies on.

mod support;

use crate::contact::{Bodies, Body};
use crate::math::cholesky;
use crate::rod::{Rod, RodShape, RootJoint, Sensitivity};
use crate::scene::{Anim, Collider};
use crate::wisp::GuideRod;
use nalgebra::Vector3;
use rayon::prelude::*;
use serde::Serialize;
use support::Support;

/// Largest natural offset of the strain at a node, 1/m: a curl of 4 cm diameter.
const MAX_STRAIN_OFFSET: f64 = 50.0;

/// Multiple of gravity under which the pose must still be stable.
const STABILITY_MARGIN: f64 = 2.0;

/// Largest stiffening factor: the stiffness per weight of a fibre ten times as thick, a bristle.
const MAX_STIFFENING: f64 = 100.0;

/// Ratio of successive trial stiffening factors.
const STIFFENING_RATIO: f64 = 1.1;

/// Arc-length fractions at which stiffening may end.
const REACHES: [f64; 5] = [0.1, 0.25, 0.5, 1.0, f64::INFINITY];

/// Strain increment of the difference quotient of gravity's load, 1/m.
const STRAIN_INCREMENT: f64 = 1e-3;

/// Result of the sag-free start.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize)]
pub struct SagFreeReport {
    /// Guides with a sag-free material.
    pub guides: u32,
    /// Number of them that were stiffened.
    pub stiffened: u32,
    /// Largest stiffening factor at a root.
    pub stiffest: f64,
    /// Guides that still sag because a bound was reached.
    pub sagging: u32,
}

/// Makes the groom's pose an equilibrium, by the share that each clamped guide's material sets, among the bodies of `anim`
/// at rest, for which the groom was drawn: hair has the same natural shape in all shots.
pub fn apply(rods: &mut [GuideRod], anim: &Anim) -> SagFreeReport {
    let at_rest = |c: &Collider| Body::new(&c.shape, None, c.friction);
    let bodies = Bodies::new(anim.colliders.iter().map(at_rest));
    let each = rods.par_iter_mut().filter_map(|r| {
        let (share, mu) = (r.material.sag_free, r.material.friction.mu_s);
        // No pose of a pinned guide but hanging is at rest.
        (share > 0.0 && r.rod.joint() == RootJoint::Clamped).then(|| {
            let supports = support::supports(&bodies, &r.rod, mu);
            apply_to_rod(&mut r.rod, share, &anim.gravity, &supports)
        })
    });
    let mut report = SagFreeReport { stiffest: 1.0, ..SagFreeReport::default() };
    for (stiffening, at_rest) in each.collect::<Vec<_>>() {
        report.guides += 1;
        report.stiffened += u32::from(stiffening > 1.0);
        report.stiffest = report.stiffest.max(stiffening);
        report.sagging += u32::from(!at_rest);
    }
    report
}

/// Applies the sag-free start to one rod against a share of `gravity`, m/s², on its `supports`. Returns the
/// stiffening factor at the root and whether the pose is a stable equilibrium.
fn apply_to_rod(rod: &mut Rod, share: f64, gravity: &Vector3<f64>, supports: &[Support]) -> (f64, bool) {
    let weight: Vec<Vector3<f64>> = rod.mass.iter().map(|m| gravity * (m * share)).collect();
    let reactions = support::reactions(rod, &load(rod, &rod.initial_q, &weight), supports);
    let mut forces = weight;
    for (support, reaction) in supports.iter().zip(&reactions) {
        forces[support.point] += reaction;
    }
    let load = load(rod, &rod.initial_q, &forces);
    let softening = softening(rod, &forces);
    let held = support::stiffness(rod, supports, &reactions);
    let holds = |rod: &Rod| {
        let mut hessian: Vec<f64> = (rod.elastic_matrix().iter().zip(&softening).zip(&held))
            .map(|((k, s), held)| k + held - STABILITY_MARGIN * s)
            .collect();
        largest(&rod.static_strain(&load)) <= MAX_STRAIN_OFFSET
            && cholesky::factor(&mut hessian, rod.unknowns()) == 1
    };
    let stiffening = Stiffening::least(rod, holds);
    stiffening.apply(rod);
    let at_rest = holds(rod);
    let mut moved: Vec<f64> = rod
        .initial_q
        .iter()
        .zip(rod.static_strain(&load))
        .map(|(start, offset)| share * start - offset)
        .collect();
    for node in moved.chunks_exact_mut(3) {
        let within = MAX_STRAIN_OFFSET / largest(node).max(MAX_STRAIN_OFFSET);
        node.iter_mut().for_each(|w| *w *= within);
    }
    rod.set_natural_offset(&moved);
    (stiffening.at_root, at_rest)
}

/// Stiffening of a rod from its root on.
#[derive(Debug, Clone, Copy)]
struct Stiffening {
    /// Factor at the root.
    at_root: f64,
    /// Arc-length fraction at which it has fallen to 1; infinite for the same factor everywhere.
    reach: f64,
}

impl Stiffening {
    const NONE: Self = Stiffening { at_root: 1.0, reach: f64::INFINITY };

    /// The stiffening with which `rod` holds that changes it least, by the mean of its logarithm: with the
    /// least factor for each reach. That to the bound everywhere if none is enough.
    fn least(rod: &Rod, holds: impl Fn(&Rod) -> bool) -> Self {
        let enough = |stiffening: &Stiffening| {
            let mut trial = rod.clone();
            stiffening.apply(&mut trial);
            holds(&trial)
        };
        if enough(&Stiffening::NONE) {
            return Stiffening::NONE;
        }
        let steps = (MAX_STIFFENING.ln() / STIFFENING_RATIO.ln()).ceil() as i32;
        let least = |reach: f64| {
            let with = |step| Stiffening { at_root: STIFFENING_RATIO.powi(step).min(MAX_STIFFENING), reach };
            let (mut below, mut above) = (0, steps);
            if !enough(&with(above)) {
                return None;
            }
            while above - below > 1 {
                let middle = (below + above) / 2;
                if enough(&with(middle)) { above = middle } else { below = middle }
            }
            Some(with(above))
        };
        let candidates = REACHES.into_iter().filter_map(least);
        let best = candidates.min_by(|a, b| a.size().total_cmp(&b.size()));
        best.unwrap_or(Stiffening { at_root: MAX_STIFFENING, reach: f64::INFINITY })
    }

    /// Factor at arc-length fraction `u`: falls from the root like a cubic that is smooth at both ends.
    fn factor(&self, u: f64) -> f64 {
        let u = (u / self.reach).min(1.0);
        1.0 + (self.at_root - 1.0) * (1.0 - u) * (1.0 - u) * (1.0 + 2.0 * u)
    }

    /// Mean logarithm of the factor along the rod.
    fn size(&self) -> f64 {
        const SAMPLES: usize = 50;
        (0..SAMPLES).map(|i| self.factor((i as f64 + 0.5) / SAMPLES as f64).ln()).sum::<f64>()
            / SAMPLES as f64
    }

    fn apply(&self, rod: &mut Rod) {
        rod.stiffen(|u| self.factor(u));
    }
}

/// Largest norm of the strain at a node, 1/m; three entries each.
fn largest(strain: &[f64]) -> f64 {
    strain.chunks_exact(3).map(|w| Vector3::from_column_slice(w).norm()).fold(0.0, f64::max)
}

/// Generalised force of `forces` on the points, N, on a rod at unknowns `q`, N·m².
fn load(rod: &Rod, q: &[f64], forces: &[Vector3<f64>]) -> Vec<f64> {
    let (mut shape, mut sensitivity) = (RodShape::default(), Sensitivity::default());
    shape.update(rod, &rod.root.r, q);
    sensitivity.update(rod, &shape, q);
    let mut load = vec![0.0; rod.unknowns()];
    for (k, force) in forces.iter().enumerate().skip(1) {
        sensitivity.add_row(k, &shape.x(k), force, 1.0, &mut load);
    }
    load
}

/// Geometric softening by `forces` on the points, N, in the initial pose: the derivative of [`load`],
/// row-major n × n.
fn softening(rod: &Rod, forces: &[Vector3<f64>]) -> Vec<f64> {
    let mut q = rod.initial_q.clone();
    let mut rows = Vec::with_capacity(q.len() * q.len());
    for i in 0..q.len() {
        let at = q[i];
        let [up, down] = [STRAIN_INCREMENT, -STRAIN_INCREMENT].map(|d| {
            q[i] = at + d;
            load(rod, &q, forces)
        });
        q[i] = at;
        rows.extend(up.iter().zip(down).map(|(up, down)| (up - down) / (2.0 * STRAIN_INCREMENT)));
    }
    rows
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rod::RodSource;
    use crate::rod::newton::Solver;
    use crate::rod::potential::{Load, PointLoad};

    const GRAVITY: Vector3<f64> = Vector3::new(0.0, -9.81, 0.0);

    /// A hair that stands out from its root, rising by `slope`, and waves.
    fn rod(length: f64, slope: f64) -> Rod {
        let at = |s: f64| Vector3::new(s, slope * s, 0.01 * (40.0 * s).sin());
        let points: Vec<_> = (0..40).map(|i| at(length * f64::from(i) / 39.0)).collect();
        let arc: Vec<f64> = (0..8).map(|i| (f64::from(i) / 7.0).powf(1.5)).collect();
        Rod::new(&RodSource::hair(&points, &arc)).unwrap()
    }

    /// Largest displacement of a point from the groom, over the rod's length, at rest under `gravity`, from
    /// `start`.
    fn settled_displacement(rod: &Rod, start: &[f64], gravity: &Vector3<f64>) -> f64 {
        let (mut q, mut solver, mut load) = (start.to_vec(), Solver::default(), Load::default());
        for h in [0.02; 40].into_iter().chain([1e3; 3]) {
            let mut at = RodShape::default();
            at.update(rod, &rod.root.r, &q);
            let rest = |x| PointLoad {
                inertial: x,
                previous: x,
                air: Vector3::zeros(),
                tangent: Vector3::x(),
                drag: 0.0,
            };
            let past = q.clone();
            load.set(rod, h, gravity, &past, (0..rod.points()).map(|k| rest(at.x(k))));
            assert!(solver.minimise(rod, &rod.root.r, &load, &mut q, &past).converged);
        }
        let mut groom = RodShape::default();
        groom.update(rod, &rod.root.r, &rod.initial_q);
        (0..rod.points()).map(|k| (solver.shape.x(k) - groom.x(k)).norm()).fold(0.0, f64::max) / rod.length()
    }

    #[test]
    fn the_pose_is_a_stable_equilibrium() {
        // Short enough to need no stiffening; long and horizontal; long and steep, which buckles.
        for (length, slope, stiffer) in [(0.04, 0.0, false), (0.2, 0.0, true), (0.08, 2.0, true)] {
            let plain = rod(length, slope);
            let mut held = plain.clone();
            let (stiffening, at_rest) = apply_to_rod(&mut held, 1.0, &GRAVITY, &[]);
            assert!(at_rest && (stiffening > 1.0) == stiffer && stiffening < MAX_STIFFENING, "{stiffening}");
            assert!(settled_displacement(&plain, &plain.initial_q, &GRAVITY) > 0.02);
            assert!(settled_displacement(&held, &held.initial_q, &GRAVITY) < 1e-8);
            // It returns after a uniform strain perturbation of 1 /m.
            let disturbed: Vec<f64> = held.initial_q.iter().map(|q| q + 1.0).collect();
            assert!(settled_displacement(&held, &disturbed, &GRAVITY) < 1e-6);
        }
    }

    /// Supports under all points of a rod but the root.
    fn floor(rod: &Rod, mu: f64) -> Vec<Support> {
        (1..rod.points()).map(|point| Support { point, normal: Vector3::y(), mu }).collect()
    }

    #[test]
    fn hair_that_lies_on_a_body_stores_no_energy_against_gravity() {
        let plain = rod(0.2, 0.0);
        let [mut free, mut lying] = [plain.clone(), plain.clone()];
        apply_to_rod(&mut free, 1.0, &GRAVITY, &[]);
        let (stiffening, at_rest) = apply_to_rod(&mut lying, 1.0, &GRAVITY, &floor(&plain, 0.3));
        assert!(at_rest && stiffening == 1.0, "{stiffening}");
        // In free fall what was bent against gravity springs up.
        let [free, lying] =
            [free, lying].map(|rod| settled_displacement(&rod, &rod.initial_q, &Vector3::zeros()));
        assert!(free > 0.2 && lying < 2e-3, "{free} {lying}");
    }

    #[test]
    fn reactions_are_in_their_cones_and_carry_the_weight() {
        let rod = rod(0.2, 0.0);
        let weight: Vec<Vector3<f64>> = rod.mass.iter().map(|m| GRAVITY * *m).collect();
        for mu in [0.0, 0.3] {
            let reactions = support::reactions(&rod, &load(&rod, &rod.initial_q, &weight), &floor(&rod, mu));
            for r in &reactions {
                assert!(r.y >= 0.0 && r.xz().norm() <= mu * r.y * (1.0 + 1e-9) + 1e-18, "{r}");
            }
            // The clamp carries the rest.
            let carried =
                reactions.iter().map(|r| r.y).sum::<f64>() / -weight.iter().map(|w| w.y).sum::<f64>();
            assert!((0.9..1.1).contains(&carried), "{carried}");
        }
    }

    #[test]
    fn hair_that_arches_and_hangs_is_stiffened_near_its_root_only() {
        // Up by 2 cm, over by 4 cm, down by 25 cm.
        let arch = |i: u32| {
            let (turn, r) = (std::f64::consts::PI * f64::from(i) / 20.0, 0.02);
            Vector3::new(r * (1.0 - turn.cos()), r * turn.sin(), 0.0)
        };
        let hanging = (1..=25).map(|i| Vector3::new(0.04, -0.01 * f64::from(i), 0.0));
        let points: Vec<_> = (0..=20).map(arch).chain(hanging).collect();
        let arc: Vec<f64> = (0..10).map(|i| f64::from(i) / 9.0).collect();
        let mut held = Rod::new(&RodSource::hair(&points, &arc)).unwrap();
        let n = held.unknowns();
        let plain = held.elastic_matrix();
        let (stiffening, at_rest) = apply_to_rod(&mut held, 1.0, &GRAVITY, &[]);
        assert!(at_rest && stiffening > 2.0, "{stiffening}");
        assert!(settled_displacement(&held, &held.initial_q, &GRAVITY) < 1e-8);
        let stiff = held.elastic_matrix();
        let factor = |node: usize| stiff[3 * node * (n + 1)] / plain[3 * node * (n + 1)];
        assert!(factor(0) > 2.0 && factor(6) < 1.01, "{} {}", factor(0), factor(6));
    }

    #[test]
    fn half_a_share_sags_partially() {
        let plain = rod(0.06, 0.3);
        let mut half = plain.clone();
        apply_to_rod(&mut half, 0.5, &GRAVITY, &[]);
        let [plain, half] = [&plain, &half].map(|rod| settled_displacement(rod, &rod.initial_q, &GRAVITY));
        assert!((0.2..0.8).contains(&(half / plain)), "{half} of {plain}");
    }

    #[test]
    fn a_reached_bound_is_kept_and_reported() {
        // A thousand times as heavy.
        let mut heavy = rod(0.2, 0.0);
        let (stiffening, at_rest) = apply_to_rod(&mut heavy, 1.0, &(GRAVITY * 1e3), &[]);
        assert_eq!((stiffening, at_rest), (MAX_STIFFENING, false));
    }

    #[test]
    fn the_pose_replaces_a_given_natural_strain() {
        let line = [Vector3::zeros(), Vector3::x() * 0.03];
        let mut curl = Rod::new(&RodSource {
            natural_strain: Some(Vector3::new(0.0, 20.0, 0.0)),
            ..RodSource::hair(&line, &[0.0, 0.3, 0.6, 1.0])
        })
        .unwrap();
        assert!(settled_displacement(&curl, &curl.initial_q, &GRAVITY) > 0.02);
        assert!(apply_to_rod(&mut curl, 1.0, &GRAVITY, &[]).1);
        assert!(settled_displacement(&curl, &curl.initial_q, &GRAVITY) < 1e-8);
    }
}
