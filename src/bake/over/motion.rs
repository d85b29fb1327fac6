//! How control points move: with what carries their root, and in the space of their prim.

use crate::scene::{Anim, Convention, RootBinding};
use crate::strands::RigidMotion;
use nalgebra::{Matrix3, Matrix4, SVector, Vector3};

/// Step of the differences that give the acceleration of a carrier, s. Rounding, ε |x| / STEP², stays below
/// 1e-9 m/s² for places in metres, and truncation, STEP² a'' / 12, below 1e-3 of an acceleration that changes
/// at ten hertz.
const STEP: f64 = 1e-3;

/// Position, velocity and acceleration of a point.
pub(super) type Motion = SVector<f64, 9>;

/// A [`Motion`] of its parts.
pub(super) fn joined(parts: [Vector3<f64>; 3]) -> Motion {
    Motion::from_fn(|i, _| parts[i / 3][i % 3])
}

/// The parts of a [`Motion`].
pub(super) fn parts(motion: &Motion) -> [Vector3<f64>; 3] {
    [0, 3, 6].map(|i| motion.fixed_rows::<3>(i).into_owned())
}

/// The first three rows of a matrix times a point.
pub(super) fn affine(matrix: &Matrix4<f64>, p: &Vector3<f64>) -> Vector3<f64> {
    (matrix * p.push(1.0)).xyz()
}

/// The part of a matrix that turns and scales.
pub(super) fn linear(matrix: &Matrix4<f64>) -> Matrix3<f64> {
    matrix.fixed_view::<3, 3>(0, 0).into_owned()
}

/// How the head, or a place on a skin, carries points of rest space at one moment.
pub(super) struct Carrier {
    rigid: RigidMotion,
    /// Second derivative of its pose.
    second: Matrix4<f64>,
}

impl Carrier {
    /// What carries a root on a skin, or the head, at time `t`, s.
    pub fn at(anim: &Anim, root: Option<&RootBinding>, t: f64) -> Self {
        let pose = |t: f64| anim.carrier(root, t).to_homogeneous();
        let second = (pose(t + STEP) + pose(t - STEP) - pose(t) * 2.0) / STEP.powi(2);
        Carrier { rigid: RigidMotion::of(|t| anim.carrier(root, t), t), second }
    }

    /// Motion of a point that is carried.
    pub fn motion(&self, rest: &Vector3<f64>) -> Motion {
        let (position, velocity) = self.rigid.carry(rest);
        joined([position, velocity, affine(&self.second, rest)])
    }

    /// A direction of rest space in the world.
    pub fn turn(&self, direction: &Vector3<f64>) -> Vector3<f64> {
        self.rigid.rotation * direction
    }
}

/// Where a stage places a prim at one moment: matrices to the world in metres, Y up.
pub(super) struct Placement {
    to_world: Matrix4<f64>,
    to_local: Matrix4<f64>,
    /// First derivative of `to_world`, per second.
    rate: Matrix4<f64>,
    /// Its second derivative.
    second: Matrix4<f64>,
}

impl Placement {
    /// Of a prim with these matrices to the world of a stage: at the moment, and at two places after it,
    /// `step`, s, apart.
    pub fn new(convention: &Convention, to_world: [Matrix4<f64>; 3], step: f64) -> Self {
        let [at, near, far] = to_world.map(|matrix| convention.matrix_in() * matrix);
        Placement {
            to_world: at,
            // The reader of the stage refuses matrices without inverse.
            to_local: at.try_inverse().unwrap_or_else(Matrix4::identity),
            rate: (near * 4.0 - at * 3.0 - far) / (2.0 * step),
            second: (at + far - near * 2.0) / (step * step),
        }
    }

    /// Position, velocity and acceleration in the space of the prim of a motion in the world. The prim moves
    /// as well, and the velocity of its space is not that of the point in it.
    pub fn local(&self, world: &Motion) -> [Vector3<f64>; 3] {
        let [position, velocity, acceleration] = parts(world);
        let turn = linear(&self.to_local);
        let p = affine(&self.to_local, &position);
        let v = turn * (velocity - affine(&self.rate, &p));
        let a = turn * (acceleration - linear(&self.rate) * v * 2.0 - affine(&self.second, &p));
        [p, v, a]
    }

    /// A normal in the space of the prim.
    pub fn normal(&self, world: &Vector3<f64>) -> Vector3<f64> {
        linear(&self.to_world).transpose() * world
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::UpAxis;
    use approx::assert_abs_diff_eq;
    use nalgebra::Rotation3;

    #[test]
    fn a_point_at_rest_in_the_world_moves_backwards_in_a_space_that_moves() {
        // It moves along x at 2, and at a rate of 6 that grows, in centimetres.
        let (fps, speed, growth) = (24.0, 2.0, 6.0);
        let at = |t: f64| {
            let x = 3.0 + speed * t + 0.5 * growth * t * t;
            Matrix4::new_translation(&Vector3::new(x, 0.0, 0.0)) * Matrix4::new_scaling(1.0)
        };
        let step = 0.25 / fps;
        let convention = Convention { metres_per_unit: 0.01, up: UpAxis::Y };
        let placement = Placement::new(&convention, [at(0.0), at(step), at(2.0 * step)], step);
        let world = joined([Vector3::new(0.05, 0.01, 0.0), Vector3::zeros(), Vector3::zeros()]);
        let [p, v, a] = placement.local(&world);
        assert_abs_diff_eq!(p, Vector3::new(2.0, 1.0, 0.0), epsilon = 1e-12);
        assert_abs_diff_eq!(v, Vector3::new(-speed, 0.0, 0.0), epsilon = 1e-10);
        assert_abs_diff_eq!(a, Vector3::new(-growth, 0.0, 0.0), epsilon = 1e-8);
    }

    #[test]
    fn motion_in_a_space_that_turns_and_scales_is_the_derivative_of_the_place_in_it() {
        let convention = Convention { metres_per_unit: 0.01, up: UpAxis::Z };
        let to_world = |t: f64| {
            let turn = Rotation3::from_scaled_axis(Vector3::new(0.5, -1.0, 2.0) * t + Vector3::z() * t * t);
            let scale = Matrix4::new_nonuniform_scaling(&Vector3::new(1.0, 2.0, 0.5)) * (1.0 + 0.1 * t);
            Matrix4::new_translation(&Vector3::new(30.0 * t, 0.0, 20.0 * t * t))
                * turn.to_homogeneous()
                * scale.map_with_location(|row, column, x| if (row, column) == (3, 3) { 1.0 } else { x })
        };
        let world = |t: f64| Vector3::new(0.3, 1.0 + 0.4 * t, 0.2 * (3.0 * t).sin());
        let local = |t: f64| {
            let inverse = (convention.matrix_in() * to_world(t)).try_inverse().unwrap();
            affine(&inverse, &world(t))
        };
        let (t, h) = (0.7, 1e-4);
        let rate = (world(t + h) - world(t - h)) / (2.0 * h);
        let second = (world(t + h) + world(t - h) - world(t) * 2.0) / (h * h);
        let found = Placement::new(&convention, [t, t + h, t + 2.0 * h].map(to_world), h).local(&joined([
            world(t),
            rate,
            second,
        ]));
        let expected = [
            local(t),
            (local(t + h) - local(t - h)) / (2.0 * h),
            (local(t + h) + local(t - h) - local(t) * 2.0) / (h * h),
        ];
        // One-sided differences of the placement are of second order in h for the rate, of first for the
        // other.
        for (i, tolerance) in [1e-12, 1e-6, 1e-2].into_iter().enumerate() {
            let off = (found[i] - expected[i]).norm();
            assert!(off < tolerance * (1.0 + expected[i].norm()), "{i}: {off}, {}", expected[i]);
        }
    }

    #[test]
    fn motions_keep_their_parts() {
        let each = [Vector3::new(1.0, 2.0, 3.0), Vector3::new(4.0, 5.0, 6.0), Vector3::new(7.0, 8.0, 9.0)];
        assert_eq!(parts(&joined(each)), each);
    }
}
