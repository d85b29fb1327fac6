//! The unknowns at which a rod passes near given points.

use super::model::Rod;
use super::newton::Solver;
use super::potential::{Load, PointLoad};
use nalgebra::{Matrix3, Vector3};

/// Lengths over which the rod's own stiffness competes with the points, as shares of its length, one solve
/// after the other: shapes that are longer follow the points, with an error of the fourth power of the ratio.
/// A pose far from the start is approached from its coarse shape to its details.
const BENDING_LENGTHS: [f64; 3] = [1.0 / 3.0, 1.0 / 20.0, 1.0 / 200.0];

/// Finds unknowns at which a rod passes near points (`docs/theory.md` §4.1, animated goals).
#[derive(Debug, Default)]
pub struct Fit {
    solver: Solver,
    load: Load,
    start: Vec<f64>,
}

impl Fit {
    /// Changes `q`, 1/m, in which the search starts, so that the points of `rod` are near `points`, one for
    /// each of them, in the frame of the root, m. Where the points say nothing, such as on twist of a straight
    /// rod, its natural shape decides.
    pub fn fit(&mut self, rod: &Rod, points: &[Vector3<f64>], q: &mut [f64]) {
        self.start.clear();
        self.start.extend_from_slice(q);
        // From a neighbouring pose the details are near.
        if !self.approach(rod, points, BENDING_LENGTHS[2], q) {
            q.copy_from_slice(&self.start);
            for length in BENDING_LENGTHS {
                self.approach(rod, points, length, q);
            }
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
        let stiffness = rod.core.stiffness[0].max(rod.core.stiffness[1]) / (bending * rod.length()).powi(4);
        for (k, (p, weight)) in points.iter().zip(&rod.weight).enumerate() {
            self.load.add_spring(k, p, weight * stiffness);
        }
        let other = q.to_vec();
        self.solver.minimise(rod, &Matrix3::identity(), &self.load, q, &other).converged
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rod::{RodShape, RodSource};

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
        fit.fit(&rod, &target, &mut q);
        let off = |a: &[Vector3<f64>]| a.iter().zip(&target).map(|(a, b)| (a - b).norm()).fold(0.0, f64::max);
        assert!(off(&at(&rod.initial_q)) > 0.05);
        assert!(off(&at(&q)) < 2e-5, "{}", off(&at(&q)));
        // The fit of the same points from there changes next to nothing.
        let before = q.clone();
        fit.fit(&rod, &target, &mut q);
        let moved: Vec<f64> = at(&q).iter().zip(at(&before)).map(|(a, b)| (a - b).norm()).collect();
        assert!(moved.iter().all(|d| *d < 2e-6), "{moved:?}");
    }
}
