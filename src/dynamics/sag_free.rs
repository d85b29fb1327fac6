//! Sag-free start (`docs/theory.md` §6): rods whose pose in the groom is one of rest under gravity.

use crate::math::cholesky;
use crate::rod::{Rod, RodShape, Sensitivity};
use crate::scene::Anim;
use crate::wisp::GuideRod;
use nalgebra::Vector3;
use rayon::prelude::*;
use serde::Serialize;

/// Largest change of the natural strain at a node, 1/m: a curl of 4 cm diameter.
const BEND: f64 = 50.0;

/// Times gravity under which the pose must still be a stable one.
const MARGIN: f64 = 2.0;

/// Largest stiffening: what holds its shape so is a fibre ten times as thick, a bristle.
const STIFFEST: f64 = 100.0;

/// Ratio of the stiffenings that are tried.
const RUNG: f64 = 1.1;

/// Difference of strain by which the change of gravity's load is measured, 1/m.
const DIFFERENCE: f64 = 1e-3;

/// How the guides are held in the groom's pose.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize)]
pub struct SagFreeReport {
    /// Guides of materials that ask for it.
    pub guides: u32,
    /// Those of them that had to be made stiffer.
    pub stiffened: u32,
    /// The largest factor on a stiffness.
    pub stiffest: f64,
    /// Guides that sag nevertheless, for a bound does not allow what would hold them.
    pub sagging: u32,
}

/// Makes the groom's pose one of rest, as far as the guides' materials ask for it.
pub fn hold(rods: &mut [GuideRod], anim: &Anim) -> SagFreeReport {
    let each = rods.par_iter_mut().filter_map(|r| {
        let share = r.material.sag_free;
        (share > 0.0).then(|| hold_one(&mut r.rod, share, &anim.gravity))
    });
    let mut held = SagFreeReport { stiffest: 1.0, ..SagFreeReport::default() };
    for (stiffening, at_rest) in each.collect::<Vec<_>>() {
        held.guides += 1;
        held.stiffened += u32::from(stiffening > 1.0);
        held.stiffest = held.stiffest.max(stiffening);
        held.sagging += u32::from(!at_rest);
    }
    held
}

/// The same of one rod, against a share of `gravity`, m/s²: by how much it was stiffened, and whether it is at rest.
fn hold_one(rod: &mut Rod, share: f64, gravity: &Vector3<f64>) -> (f64, bool) {
    let gravity = gravity * share;
    let load = load(rod, &rod.initial_q, &gravity);
    let bend = largest(&rod.static_strain(&load));
    let (elastic, softening) = (rod.elastic_matrix(), softening(rod, &gravity));
    let holds = |c: f64| {
        let mut hessian: Vec<f64> = elastic.iter().zip(&softening).map(|(k, s)| c * k - MARGIN * s).collect();
        c * BEND >= bend && cholesky::factor(&mut hessian, rod.unknowns()) == 1
    };
    let mut stiffening = 1.0;
    while stiffening < STIFFEST && !holds(stiffening) {
        stiffening = (stiffening * RUNG).min(STIFFEST);
    }
    let at_rest = holds(stiffening);
    rod.scale_stiffness(stiffening);
    let mut moved: Vec<f64> = rod
        .initial_q
        .iter()
        .zip(rod.static_strain(&load))
        .map(|(start, bend)| share * start - bend)
        .collect();
    for node in moved.chunks_exact_mut(3) {
        let within = BEND / largest(node).max(BEND);
        node.iter_mut().for_each(|w| *w *= within);
    }
    rod.set_natural_offset(&moved);
    (stiffening, at_rest)
}

/// The largest strain at a node, 1/m, three entries each.
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

/// By how much gravity makes the rod less stiff in its starting pose: the derivative of [`load`], row-major n × n.
fn softening(rod: &Rod, gravity: &Vector3<f64>) -> Vec<f64> {
    let mut q = rod.initial_q.clone();
    let mut rows = Vec::with_capacity(q.len() * q.len());
    for i in 0..q.len() {
        let at = q[i];
        let [up, down] = [DIFFERENCE, -DIFFERENCE].map(|d| {
            q[i] = at + d;
            load(rod, &q, gravity)
        });
        q[i] = at;
        rows.extend(up.iter().zip(down).map(|(up, down)| (up - down) / (2.0 * DIFFERENCE)));
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

    /// How far its points go, as a share of its length, until it is at rest under `gravity`, from `start`.
    fn goes(rod: &Rod, start: &[f64], gravity: &Vector3<f64>) -> f64 {
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
    fn the_pose_is_one_of_rest_that_is_come_back_to() {
        // Short and soft enough as it is; long and horizontal; long and rising steeply, which buckles.
        for (length, slope, stiffer) in [(0.04, 0.0, false), (0.2, 0.0, true), (0.08, 2.0, true)] {
            let plain = rod(length, slope);
            let mut held = plain.clone();
            let (stiffening, at_rest) = hold_one(&mut held, 1.0, &GRAVITY);
            assert!(at_rest && (stiffening > 1.0) == stiffer && stiffening < 20.0, "{stiffening}");
            assert!(goes(&plain, &plain.initial_q, &GRAVITY) > 0.02);
            assert!(goes(&held, &held.initial_q, &GRAVITY) < 1e-8);
            // Disturbed by a strain of 1 /m all along, it comes back.
            let disturbed: Vec<f64> = held.initial_q.iter().map(|q| q + 1.0).collect();
            assert!(goes(&held, &disturbed, &GRAVITY) < 1e-6);
        }
    }

    #[test]
    fn half_a_share_sags_less_than_half_way_and_more_than_not() {
        let plain = rod(0.06, 0.3);
        let mut half = plain.clone();
        hold_one(&mut half, 0.5, &GRAVITY);
        let [plain, half] = [&plain, &half].map(|rod| goes(rod, &rod.initial_q, &GRAVITY));
        assert!((0.2..0.8).contains(&(half / plain)), "{half} of {plain}");
    }

    #[test]
    fn a_bound_that_binds_is_told_and_kept() {
        // A thousand times as heavy.
        let mut heavy = rod(0.2, 0.0);
        let (stiffening, at_rest) = hold_one(&mut heavy, 1.0, &(GRAVITY * 1e3));
        assert_eq!((stiffening, at_rest), (STIFFEST, false));
    }

    #[test]
    fn a_natural_strain_that_was_given_is_left_for_the_pose() {
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
        assert!(goes(&curl, &curl.initial_q, &GRAVITY) > 0.02);
        assert!(hold_one(&mut curl, 1.0, &GRAVITY).1);
        assert!(goes(&curl, &curl.initial_q, &GRAVITY) < 1e-8);
    }
}
