//! Material frames at places of a rod, and moments that hold them (`docs/theory.md` §4.10).

use super::potential::PointMoment;
use super::sensitivity::Sensitivity;
use super::shape::RodShape;
use crate::math::lanes::M3;
use nalgebra::{Matrix3, Rotation3, UnitQuaternion, Vector3};
use serde::{Deserialize, Serialize};

/// A moment that holds the frame at a place of a rod.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct HoldingMoment {
    /// The frame that it holds: columns d1, d2, d3, world axes.
    pub frame: Matrix3<f64>,
    /// Moment, N·m, world axes: the force that belongs to the rotation vector from that frame.
    pub moment: Vector3<f64>,
}

impl HoldingMoment {
    fn at_point(&self) -> PointMoment<f64> {
        PointMoment { frame: M3::from(self.frame), moment: self.moment.into() }
    }
}

impl RodShape {
    /// The frame at fraction `s` (0..=1) of segment `k`: on the way from that at its start to that at its end.
    pub fn frame_between(&self, k: usize, s: f64) -> Matrix3<f64> {
        let [a, b] = [k, k + 1]
            .map(|k| UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(self.frame(k))));
        *a.slerp(&b, s).to_rotation_matrix().matrix()
    }

    /// Rotation vector from `frame` to the frame at fraction `s` of segment `k`, world axes: the mean of those
    /// to the frames at its ends. Within 1 % of the angle up to 1.5 rad, and exact where it is zero.
    pub fn rotation_from(&self, k: usize, s: f64, frame: &Matrix3<f64>) -> Vector3<f64> {
        let from = PointMoment { frame: M3::from(*frame), moment: Vector3::zeros().into() };
        let to = |k: usize| Vector3::from(from.at(&self.pose[k].r).rotation());
        to(k) * (1.0 - s) + to(k + 1) * s
    }

    /// The moment, N·m, that `holding` exerts at fraction `s` of segment `k`, world axes.
    pub fn moment_of(&self, k: usize, s: f64, holding: &HoldingMoment) -> Vector3<f64> {
        let at = |k: usize| Vector3::from(holding.at_point().at(&self.pose[k].r).moment());
        at(k) * (1.0 - s) + at(k + 1) * s
    }
}

impl Sensitivity {
    /// Adds the derivative by the unknowns of component `d` of [`RodShape::rotation_from`] to `row`.
    pub fn add_rotation_row(
        &self,
        shape: &RodShape,
        (k, s): (usize, f64),
        frame: &Matrix3<f64>,
        d: &Vector3<f64>,
        row: &mut [f64],
    ) {
        let along = HoldingMoment { frame: *frame, moment: *d }.at_point();
        for (k, weight) in [(k, 1.0 - s), (k + 1, s)] {
            self.add_turn_row(k, &along.at(&shape.pose[k].r).moment().into(), weight, row);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rod::Rod;

    #[test]
    fn rows_of_rotations_are_their_derivatives() {
        let (rod, q) = Rod::bent_sample();
        let shape_at = |q: &[f64]| {
            let mut shape = RodShape::default();
            assert!(shape.update(&rod, &rod.root.r, q));
            shape
        };
        let shape = shape_at(&q);
        let mut sensitivity = Sensitivity::default();
        sensitivity.update(&rod, &shape, &q);
        let d = Vector3::new(0.3, -0.8, 0.5);
        for k in [0, rod.points() / 2, rod.points() - 2] {
            for s in [0.0, 0.3, 1.0] {
                let between = shape.frame_between(k, s);
                assert!(shape.rotation_from(k, s, &between).norm() < 1e-9);
                let frame = Rotation3::from_scaled_axis(Vector3::new(0.2, 0.1, -0.15)) * between;
                let turned = shape.rotation_from(k, s, &frame) + Vector3::new(0.2, 0.1, -0.15);
                assert!(turned.norm() < 0.02, "{turned}");
                let mut row = vec![0.0; q.len()];
                sensitivity.add_rotation_row(&shape, (k, s), &frame, &d, &mut row);
                for (a, row) in row.iter().enumerate() {
                    let moved = |by: f64| {
                        let mut q = q.clone();
                        q[a] += by;
                        d.dot(&shape_at(&q).rotation_from(k, s, &frame))
                    };
                    let slope = (moved(1e-3) - moved(-1e-3)) / 2e-3;
                    assert!((slope - row).abs() < 1e-7, "{k} {s} {a}: {slope} {row}");
                }
            }
        }
    }
}
