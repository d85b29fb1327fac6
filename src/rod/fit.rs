//! The unknowns at which a rod passes near given points.

use super::model::Rod;
use super::newton::Solver;
use super::potential::{Load, PointLoad, StrainSpring};
use super::shape::RodShape;
use nalgebra::{Matrix3, Vector3};
use std::f64::consts::TAU;

/// Lengths over which the rod's own stiffness competes with the points, as shares of its length, one solve
/// after the other: shapes that are longer follow the points, with an error of the fourth power of the ratio.
/// A pose far from the start is approached from its coarse shape to its details.
const BENDING_LENGTHS: [f64; 3] = [1.0 / 3.0, 1.0 / 20.0, 1.0 / 200.0];

/// Distance from the points, as a share of the length, that a turn of twist may save. A rod that is bent by
/// nature would wind itself up for less, and unwind at the next moment.
const WORTH_A_TURN: f64 = 2e-3;

/// Steps in which the points move where a solve from the pose before them fails.
const STEPS: usize = 8;

/// Finds unknowns at which a rod passes near points (`docs/theory.md` §4.1, animated goals).
#[derive(Debug, Default)]
pub struct Fit {
    solver: Solver,
    load: Load,
    start: Vec<f64>,
}

impl Fit {
    /// Changes `q`, 1/m, so that the points of `rod` are near `points`, one for each of them, in the frame of
    /// the root, m; the search starts from any pose. Where the points say nothing, such as on twist of a
    /// straight rod, its natural shape decides.
    pub fn find(&mut self, rod: &Rod, points: &[Vector3<f64>], q: &mut [f64]) {
        for length in BENDING_LENGTHS {
            self.approach(rod, points, length, q);
        }
    }

    /// The same from a pose that is near, that of a moment before: of several poses it keeps to the one next
    /// to it.
    pub fn follow(&mut self, rod: &Rod, points: &[Vector3<f64>], q: &mut [f64]) {
        self.start.clear();
        self.start.extend_from_slice(q);
        let finest = BENDING_LENGTHS[BENDING_LENGTHS.len() - 1];
        if self.approach(rod, points, finest, q) {
            return;
        }
        q.copy_from_slice(&self.start);
        let mut shape = RodShape::default();
        shape.update(rod, &Matrix3::identity(), q);
        for step in 1..=STEPS {
            let share = step as f64 / STEPS as f64;
            let between = |(k, p): (usize, &Vector3<f64>)| shape.x(k).lerp(p, share);
            let between: Vec<Vector3<f64>> = points.iter().enumerate().map(between).collect();
            self.approach(rod, &between, finest, q);
        }
    }

    /// One solve with the bending length `bending`, as a share of the rod's; returns whether it converged.
    fn approach(&mut self, rod: &Rod, points: &[Vector3<f64>], bending: f64, q: &mut [f64]) -> bool {
        // A step of a second: inertia is next to nothing against the springs.
        let still = points.iter().map(|p| PointLoad {
            inertial: *p,
            previous: *p,
            air: Vector3::zeros(),
            tangent: Vector3::z(),
            drag: 0.0,
        });
        self.load.set(rod, 1.0, &Vector3::zeros(), q, still);
        let length = rod.length();
        let stiffness = rod.core.stiffness[0].max(rod.core.stiffness[1]) / (bending * length).powi(4);
        for (k, (p, weight)) in points.iter().zip(&rod.weight).enumerate() {
            self.load.add_spring(k, p, weight * stiffness);
        }
        let turn = stiffness * (WORTH_A_TURN * length).powi(2) * (length / TAU).powi(2);
        let hold = |a: usize| StrainSpring {
            stiffness: if a % 3 == 2 { turn * rod.lumped_length(a / 3) } else { 0.0 },
            target: 0.0,
        };
        self.load.hold((0..q.len()).map(hold));
        let other = q.to_vec();
        self.solver.minimise(rod, &Matrix3::identity(), &self.load, q, &other).converged
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::spline::ArcSpline;
    use crate::rod::RodSource;

    #[test]
    fn a_rod_finds_a_pose_of_its_own_and_a_curve_nearby() {
        let points = [Vector3::zeros(), Vector3::new(0.1, 0.0, 0.02), Vector3::new(0.2, 0.0, 0.0)];
        let arc: Vec<f64> = (0..9).map(|i| f64::from(i) / 8.0).collect();
        let rod = Rod::new(&RodSource::hair(&points, &arc)).unwrap();
        let mut shape = RodShape::default();
        let mut at = |q: &[f64]| -> Vec<Vector3<f64>> {
            shape.update(&rod, &Matrix3::identity(), q);
            (0..rod.points()).map(|k| shape.x(k)).collect()
        };
        // Far from the natural shape: it turns by more than a right angle.
        let sought: Vec<f64> =
            (0..rod.unknowns()).map(|i| [20.0, 9.0, 0.0][i % 3] * (0.4 * (i / 3) as f64).cos()).collect();
        let target = at(&sought);
        let mut q = rod.initial_q.clone();
        let mut fit = Fit::default();
        fit.find(&rod, &target, &mut q);
        let off = |a: &[Vector3<f64>]| a.iter().zip(&target).map(|(a, b)| (a - b).norm()).fold(0.0, f64::max);
        assert!(off(&at(&rod.initial_q)) > 0.05);
        assert!(off(&at(&q)) < 2e-5, "{}", off(&at(&q)));
        // The fit of the same points from there changes next to nothing.
        let before = q.clone();
        fit.follow(&rod, &target, &mut q);
        let moved: Vec<f64> = at(&q).iter().zip(at(&before)).map(|(a, b)| (a - b).norm()).collect();
        assert!(moved.iter().all(|d| *d < 2e-6), "{moved:?}");
    }

    #[test]
    fn a_rod_that_is_bent_by_nature_does_not_wind_itself_up() {
        // A ponytail: around the head, sharply down at the tie, and down.
        let drawn = |swing: f64| -> Vec<Vector3<f64>> {
            let (mut x, mut points) = (Vector3::zeros(), vec![Vector3::zeros()]);
            for k in 0..48 {
                let s = f64::from(k) / 48.0;
                let along = match s {
                    s if s < 0.2 => Vector3::new(0.0, 0.3 - 2.0 * s, -1.0),
                    s if s < 0.24 => Vector3::new(0.2, 0.3, -0.5),
                    _ => {
                        let (sin, cos) = (swing * ((s - 0.24) / 0.3).min(1.0)).sin_cos();
                        Vector3::new(sin, -cos, 0.4 * sin)
                    }
                };
                x += along.normalize() * 0.01;
                points.push(x);
            }
            points
        };
        let rest = drawn(0.0);
        let arc: Vec<f64> = (0..8).map(|i| (f64::from(i) / 7.0).powf(1.5)).collect();
        let rod = Rod::new(&RodSource::hair(&rest, &arc)).unwrap();
        let (mut fit, mut q, mut shape) = (Fit::default(), rod.initial_q.clone(), RodShape::default());
        let (mut jump, mut off) = (0.0_f64, 0.0_f64);
        for frame in 0..48 {
            let curve = ArcSpline::through(&drawn(1.2 * (0.26 * f64::from(frame)).sin())).unwrap();
            let root = |x: Vector3<f64>| rod.root.r.transpose() * (x - rod.root.p);
            let points: Vec<Vector3<f64>> = rod.arc.iter().map(|s| root(curve.at(*s).x)).collect();
            let before = q.clone();
            if frame == 0 {
                fit.find(&rod, &points, &mut q);
            } else {
                fit.follow(&rod, &points, &mut q);
                jump = q.iter().zip(&before).map(|(a, b)| (a - b).abs()).fold(jump, f64::max);
            }
            shape.update(&rod, &Matrix3::identity(), &q);
            off = points.iter().enumerate().map(|(k, x)| (shape.x(k) - x).norm()).fold(off, f64::max);
        }
        // The bend of 8/m swings within some twelve frames.
        assert!(jump < 8.0 && off < 0.01, "{jump} {off}");
    }
}
