//! Sag-free start (`docs/theory.md` §6): makes the groom's pose a stable equilibrium under gravity.

use crate::math::cholesky;
use crate::rod::{Rod, RodShape, Sensitivity};
use crate::scene::Anim;
use crate::wisp::GuideRod;
use nalgebra::Vector3;
use rayon::prelude::*;
use serde::Serialize;

/// Largest natural offset of the strain at a node, 1/m: a curl of 4 cm diameter.
const MAX_STRAIN_OFFSET: f64 = 50.0;

/// Multiple of gravity under which the pose must still be stable.
const STABILITY_MARGIN: f64 = 2.0;

/// Largest stiffening factor: the stiffness per weight of a fibre ten times as thick, a bristle.
const MAX_STIFFENING: f64 = 100.0;

/// Ratio of successive trial stiffening factors.
const STIFFENING_RATIO: f64 = 1.1;

/// Strain increment of the difference quotient of gravity's load, 1/m.
const STRAIN_INCREMENT: f64 = 1e-3;

/// Result of the sag-free start.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize)]
pub struct SagFreeReport {
    /// Guides with a sag-free material.
    pub guides: u32,
    /// Number of them that were stiffened.
    pub stiffened: u32,
    /// Largest stiffening factor.
    pub stiffest: f64,
    /// Guides that still sag because a bound was reached.
    pub sagging: u32,
}

/// Makes the groom's pose an equilibrium, by the share that each guide's material sets.
pub fn apply(rods: &mut [GuideRod], anim: &Anim) -> SagFreeReport {
    let each = rods.par_iter_mut().filter_map(|r| {
        let share = r.material.sag_free;
        (share > 0.0).then(|| apply_to_rod(&mut r.rod, share, &anim.gravity))
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

/// Applies the sag-free start to one rod against a share of `gravity`, m/s². Returns the stiffening factor
/// and whether the pose is a stable equilibrium.
fn apply_to_rod(rod: &mut Rod, share: f64, gravity: &Vector3<f64>) -> (f64, bool) {
    let gravity = gravity * share;
    let load = load(rod, &rod.initial_q, &gravity);
    let offset = largest(&rod.static_strain(&load));
    let (elastic, softening) = (rod.elastic_matrix(), softening(rod, &gravity));
    let holds = |c: f64| {
        let mut hessian: Vec<f64> =
            elastic.iter().zip(&softening).map(|(k, s)| c * k - STABILITY_MARGIN * s).collect();
        c * MAX_STRAIN_OFFSET >= offset && cholesky::factor(&mut hessian, rod.unknowns()) == 1
    };
    let mut stiffening = 1.0;
    while stiffening < MAX_STIFFENING && !holds(stiffening) {
        stiffening = (stiffening * STIFFENING_RATIO).min(MAX_STIFFENING);
    }
    let at_rest = holds(stiffening);
    rod.scale_stiffness(stiffening);
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
    (stiffening, at_rest)
}

/// Largest norm of the strain at a node, 1/m; three entries each.
fn largest(strain: &[f64]) -> f64 {
    strain.chunks_exact(3).map(|w| Vector3::from_column_slice(w).norm()).fold(0.0, f64::max)
}

/// Generalised force of gravity, m/s², on a rod at unknowns `q`, N·m².
fn load(rod: &Rod, q: &[f64], gravity: &Vector3<f64>) -> Vec<f64> {
    let (mut shape, mut sensitivity) = (RodShape::default(), Sensitivity::default());
    shape.update(rod, &rod.root.r, q);
    sensitivity.update(rod, &shape, q);
    let mut load = vec![0.0; rod.unknowns()];
    for k in 1..rod.points() {
        sensitivity.add_row(k, &shape.x(k), gravity, rod.mass[k], &mut load);
    }
    load
}

/// Geometric softening by gravity in the initial pose: the derivative of [`load`], row-major n × n.
fn softening(rod: &Rod, gravity: &Vector3<f64>) -> Vec<f64> {
    let mut q = rod.initial_q.clone();
    let mut rows = Vec::with_capacity(q.len() * q.len());
    for i in 0..q.len() {
        let at = q[i];
        let [up, down] = [STRAIN_INCREMENT, -STRAIN_INCREMENT].map(|d| {
            q[i] = at + d;
            load(rod, &q, gravity)
        });
        q[i] = at;
        rows.extend(up.iter().zip(down).map(|(up, down)| (up - down) / (2.0 * STRAIN_INCREMENT)));
    }
    rows
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rod::newton::Solver;
    use crate::rod::potential::{Load, PointLoad};
    use crate::rod::{RodSource, SegmentSize, Taper};

    const GRAVITY: Vector3<f64> = Vector3::new(0.0, -9.81, 0.0);

    /// A hair that stands out from its root, rising by `slope`, and waves.
    fn rod(length: f64, slope: f64) -> Rod {
        let at = |s: f64| Vector3::new(s, slope * s, 0.01 * (40.0 * s).sin());
        let points: Vec<_> = (0..40).map(|i| at(length * f64::from(i) / 39.0)).collect();
        let arc: Vec<f64> = (0..8).map(|i| (f64::from(i) / 7.0).powf(1.5)).collect();
        Rod::new(&RodSource {
            points: &points,
            root_frame: None,
            arc: &arc,
            stiffness: [7.8e-9, 7.8e-9, 3.6e-9],
            line_density: 6.6e-6,
            damping: 0.0,
            taper: Taper::NONE,
            natural_strain: None,
            segment_size: SegmentSize::FINE,
        })
        .unwrap()
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
            let (stiffening, at_rest) = apply_to_rod(&mut held, 1.0, &GRAVITY);
            assert!(at_rest && (stiffening > 1.0) == stiffer && stiffening < 20.0, "{stiffening}");
            assert!(settled_displacement(&plain, &plain.initial_q, &GRAVITY) > 0.02);
            assert!(settled_displacement(&held, &held.initial_q, &GRAVITY) < 1e-8);
            // It returns after a uniform strain perturbation of 1 /m.
            let disturbed: Vec<f64> = held.initial_q.iter().map(|q| q + 1.0).collect();
            assert!(settled_displacement(&held, &disturbed, &GRAVITY) < 1e-6);
        }
    }

    #[test]
    fn half_a_share_sags_partially() {
        let plain = rod(0.06, 0.3);
        let mut half = plain.clone();
        apply_to_rod(&mut half, 0.5, &GRAVITY);
        let [plain, half] = [&plain, &half].map(|rod| settled_displacement(rod, &rod.initial_q, &GRAVITY));
        assert!((0.2..0.8).contains(&(half / plain)), "{half} of {plain}");
    }

    #[test]
    fn a_reached_bound_is_kept_and_reported() {
        // A thousand times as heavy.
        let mut heavy = rod(0.2, 0.0);
        let (stiffening, at_rest) = apply_to_rod(&mut heavy, 1.0, &(GRAVITY * 1e3));
        assert_eq!((stiffening, at_rest), (MAX_STIFFENING, false));
    }

    #[test]
    fn the_pose_replaces_a_given_natural_strain() {
        let line = [Vector3::zeros(), Vector3::x() * 0.03];
        let mut curl = Rod::new(&RodSource {
            points: &line,
            root_frame: None,
            arc: &[0.0, 0.3, 0.6, 1.0],
            stiffness: [7.8e-9, 7.8e-9, 3.6e-9],
            line_density: 6.6e-6,
            damping: 0.0,
            taper: Taper::NONE,
            natural_strain: Some(Vector3::new(0.0, 20.0, 0.0)),
            segment_size: SegmentSize::FINE,
        })
        .unwrap();
        assert!(settled_displacement(&curl, &curl.initial_q, &GRAVITY) > 0.02);
        assert!(apply_to_rod(&mut curl, 1.0, &GRAVITY).1);
        assert!(settled_displacement(&curl, &curl.initial_q, &GRAVITY) < 1e-8);
    }
}
