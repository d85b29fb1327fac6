//! The motion of the head as it excites hair.

use nalgebra::{Isometry3, Matrix3, Matrix3x4, Vector3};
use serde::{Deserialize, Serialize};

/// Excitation of hair by the motion of the head at one moment, in head axes (`docs/theory.md` eq. 8.4): an
/// acceleration field a − A x of gravity and inertia, and a velocity field −(v + ω × x) of the air relative
/// to the head.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct HeadExcitation {
    /// a, m/s².
    acceleration: Vector3<f64>,
    /// A = Rᵀ R̈, 1/s².
    gradient: Matrix3<f64>,
    /// v, m/s.
    velocity: Vector3<f64>,
    /// ω, rad/s.
    angular_velocity: Vector3<f64>,
}

impl HeadExcitation {
    /// Number of components.
    pub(super) const COMPONENTS: usize = 18;

    /// The excitation by `gravity`, m/s², world, and a head at `heads`: its pose now and one to four steps of
    /// `h`, s, ago. Rates are the differences of BDF2 (`docs/theory.md` eq. 4.5).
    pub fn new(heads: &[Isometry3<f64>; 5], h: f64, gravity: &Vector3<f64>) -> Self {
        let poses = heads.map(|head| head.to_homogeneous().fixed_view::<3, 4>(0, 0).into_owned());
        let rate = |p: &[Matrix3x4<f64>]| (p[0] * 3.0 - p[1] * 4.0 + p[2]) / (2.0 * h);
        let rates = [rate(&poses), rate(&poses[1..]), rate(&poses[2..])];
        let to_head = heads[0].rotation.inverse().to_rotation_matrix();
        let (velocity, acceleration) = (to_head.matrix() * rates[0], to_head.matrix() * rate(&rates));
        let spin = velocity.fixed_view::<3, 3>(0, 0);
        let omega = [(2, 1), (0, 2), (1, 0)].map(|(i, j)| 0.5 * (spin[(i, j)] - spin[(j, i)]));
        HeadExcitation {
            acceleration: to_head * gravity - acceleration.column(3),
            gradient: acceleration.fixed_view::<3, 3>(0, 0).into_owned(),
            velocity: velocity.column(3).into_owned(),
            angular_velocity: omega.into(),
        }
    }

    /// The difference from `other`.
    pub fn minus(&self, other: &Self) -> Self {
        HeadExcitation {
            acceleration: self.acceleration - other.acceleration,
            gradient: self.gradient - other.gradient,
            velocity: self.velocity - other.velocity,
            angular_velocity: self.angular_velocity - other.angular_velocity,
        }
    }

    /// The components in the order of the fields, matrices by columns.
    pub(super) fn components(&self) -> impl Iterator<Item = f64> {
        let matrices = self.acceleration.iter().chain(self.gradient.iter());
        matrices.chain(self.velocity.iter()).chain(self.angular_velocity.iter()).copied()
    }

    /// The excitation whose component `k` is 1 and whose others are 0.
    pub(super) fn unit(k: usize) -> Self {
        let numbers: [f64; Self::COMPONENTS] = std::array::from_fn(|i| f64::from(u8::from(i == k)));
        HeadExcitation {
            acceleration: Vector3::from_column_slice(&numbers[..3]),
            gradient: Matrix3::from_column_slice(&numbers[3..12]),
            velocity: Vector3::from_column_slice(&numbers[12..15]),
            angular_velocity: Vector3::from_column_slice(&numbers[15..]),
        }
    }

    /// Force, N, head axes, on a mass, kg, with a drag coefficient, N·s/m, at `x`, m, rest space.
    pub(super) fn force(&self, x: &Vector3<f64>, mass: f64, drag: f64) -> Vector3<f64> {
        (self.acceleration - self.gradient * x) * mass
            - (self.velocity + self.angular_velocity.cross(x)) * drag
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn force_of_a_flying_spinning_head_is_that_felt_by_a_mass_on_it() {
        let pull = Vector3::new(0.0, -9.81, 0.0);
        // A head that flies along a parabola, and spins.
        let (axis, rate) = (Vector3::new(0.3, 0.8, -0.5).normalize(), 3.0);
        let (speed, gain) = (Vector3::new(0.4, 0.0, -1.0), Vector3::new(2.0, 1.0, 0.0));
        let head = |t: f64| Isometry3::new(speed * t + gain * (0.5 * t * t), axis * (rate * t));
        let (h, t) = (1e-4, 0.2);
        let excitation = HeadExcitation::new(&std::array::from_fn(|k| head(t - k as f64 * h)), h, &pull);
        let x = Vector3::new(0.05, 0.1, -0.02);
        let spin = axis * rate;
        let back = head(t).rotation.inverse();
        let felt = back * (pull - gain) - spin.cross(&spin.cross(&x));
        let air = back * (speed + gain * t) + spin.cross(&x);
        for (mass, drag, force) in [(1.0, 0.0, felt), (0.0, 1.0, -air)] {
            let found = excitation.force(&x, mass, drag);
            assert!((found - force).norm() < 1e-4, "{found} {force}");
        }
        assert_eq!(excitation.minus(&excitation).force(&x, 1.0, 1.0), Vector3::zeros());
    }
}
