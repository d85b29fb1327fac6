//! Free roots that turn by more than half a turn: the rotation vector of the other way round takes over.

use super::model::Rod;
use nalgebra::Vector3;
use std::f64::consts::{PI, TAU};

impl Rod {
    /// Replaces the rotation vector among the unknowns `q` of a free root that has turned by more than half a turn from
    /// where it is carried, by that of the same rotation the other way round. Returns whether it has.
    pub fn unwind(&self, q: &mut [f64]) -> bool {
        let theta = Vector3::from_column_slice(&q[..3]);
        let winds = self.is_free() && theta.norm() > PI;
        if winds {
            q[..3].copy_from_slice(other_way(&theta).as_slice());
        }
        winds
    }

    /// Replaces the rotation vector among the unknowns `q` of a free root by that of the same rotation which is
    /// nearest to that in `near`; and the rate of it in `rate`, unless that is empty.
    pub fn unwind_towards(&self, near: &[f64], q: &mut [f64], rate: &mut [f64]) {
        if !self.is_free() {
            return;
        }
        let [near, theta] = [near, &*q].map(|q| Vector3::from_column_slice(&q[..3]));
        let other = other_way(&theta);
        if theta == Vector3::zeros() || (theta - near).norm() <= (other - near).norm() {
            return;
        }
        q[..3].copy_from_slice(other.as_slice());
        if let Some(rate) = rate.get_mut(..3) {
            let (of, angle) = (Vector3::from_column_slice(rate), theta.norm());
            let turned = of * (1.0 - TAU / angle) + theta * (TAU * theta.dot(&of) / angle.powi(3));
            rate.copy_from_slice(turned.as_slice());
        }
    }
}

/// The rotation vector of the same rotation as that of `theta`, rad, the other way round.
fn other_way(theta: &Vector3<f64>) -> Vector3<f64> {
    theta * (1.0 - TAU / theta.norm())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rod::{RodShape, RootJoint};

    #[test]
    fn a_rod_is_the_same_after_it_is_unwound() {
        let (mut rod, _) = Rod::bent_sample();
        rod.join_root(RootJoint::Free);
        let at = |t: f64| {
            let mut q = vec![3.0; rod.unknowns()];
            q[..6].copy_from_slice(&[2.0 + t, 2.5 - 0.5 * t, 1.0 + 2.0 * t, 0.1, 0.2, 0.3]);
            q
        };
        let tip = |q: &[f64]| {
            let mut shape = RodShape::default();
            assert!(shape.update(&rod, &rod.root.r, q));
            (shape.x(rod.points() - 1), shape.frame(rod.points() - 1))
        };
        let (mut q, before) = (at(0.0), tip(&at(0.0)));
        assert!(rod.unwind(&mut q));
        assert!((tip(&q).0 - before.0).norm() < 1e-14 && (tip(&q).1 - before.1).norm() < 1e-13);
        assert!(!rod.unwind(&mut q.clone()));
        // Values nearby follow it, with their rates.
        let near = q;
        let unwound = |t: f64| {
            let (mut q, mut rate) = (at(t), vec![0.0; rod.unknowns()]);
            rate[..3].copy_from_slice(&[1.0, -0.5, 2.0]);
            rod.unwind_towards(&near, &mut q, &mut rate);
            (q, rate)
        };
        let h = 1e-5;
        let [(behind, _), (now, rate), (ahead, _)] = [-h, 0.0, h].map(|t| unwound(0.01 + t));
        assert!(now[..3].iter().zip(&near).all(|(a, b)| (a - b).abs() < 0.1));
        for i in 0..3 {
            assert!((rate[i] - (ahead[i] - behind[i]) / (2.0 * h)).abs() < 1e-8, "{i}");
        }
        let mut same = now.clone();
        rod.unwind_towards(&near, &mut same, &mut []);
        assert_eq!(same, now);
    }
}
