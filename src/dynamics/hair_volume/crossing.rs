//! Hair does not pass through hair that crosses it (`docs/theory.md` §5.3).

use super::grid::{Grid, Stencil};
use super::law::{Assembly, Fibre};
use super::{FRACTION, direction};
use nalgebra::Vector3;

/// k of hair that crosses: that of van Wyk (1946) for random fibres. Higher keeps locks that cross farther
/// apart; swinging locks do not change from a tenth of it to ten times it, but long hair then takes more space.
const STIFFNESS: f64 = 1e-2;

/// Acceleration, m/s², by which hair that crosses a hair stops it, over χ³ less that of the groom's pose. Higher
/// stops faster locks, and stiffens hair whose strands are a little at angles, which then keeps apart. Locks that
/// fall on each other at a right angle (χ = 0.5) are stopped with 600 m/s², strands that are 15° apart (χ = 0.017)
/// with 0.025 m/s².
const STOPPING: f64 = 5e3;

/// Least χ that counts: that of strands that are 15° apart.
const LEAST: f64 = 0.017;

/// Norm of the mean tangent of a turn of hair below which it winds too tightly to have a direction.
const TIGHT: f64 = 0.1;

/// Vector whose product with a mean tangent is 1 for hair along a piece with the mean unit tangent of a turn `axis`:
/// hair that winds as much as this has the direction t̄, not a unit one.
pub(super) fn course(axis: &Vector3<f64>) -> Vector3<f64> {
    axis / axis.norm_squared().max(f64::MIN_POSITIVE)
}

/// The hair that crosses a piece of hair.
pub(super) struct Crossing {
    /// χ: its share of the hair around the piece.
    share: f64,
    /// φ χ: its volume fraction.
    pub fraction: f64,
    /// Gradient of that across the piece, 1/m.
    gradient: Vector3<f64>,
}

impl Crossing {
    /// Where the assembly is `hair`, and the mean unit tangent of a turn of the piece `axis`; `None` where too
    /// little crosses it.
    pub fn of((grid, stencil): (&Grid, &Stencil), hair: &Assembly, axis: &Vector3<f64>) -> Option<Self> {
        let straightness = axis.norm();
        if straightness < TIGHT {
            return None;
        }
        let course = course(axis);
        let share = 1.0 - hair.direction.dot(&course);
        if share < LEAST {
            return None;
        }
        let ahead = grid.gradient(stencil, |node| node[FRACTION] - direction(node).dot(&course));
        let gradient = ahead - course * axis.dot(&ahead);
        Some(Crossing { share, fraction: hair.fraction * share, gradient })
    }

    /// Force per volume of the piece, N/m³, by which it keeps out of the hair that crosses it, where this had
    /// the volume fraction `rest` in the groom's pose. Its wave speed is at most `max_speed`, m/s.
    pub fn repulsion(&self, fibre: &Fibre, rest: f64, max_speed: f64) -> Vector3<f64> {
        let around = self.fraction / self.share;
        let rest = rest.max(LEAST * around);
        if self.fraction <= rest {
            return Vector3::zeros();
        }
        let softest = fibre.density * max_speed * max_speed / around;
        let stiffness = (STIFFNESS * fibre.modulus * around).min(softest);
        self.gradient * (stiffness * (rest / self.fraction - 1.0))
    }

    /// The part of the `slip`, m/s, of the piece that is lost over a step whose η is `eta`, s, because it leads
    /// into the hair that crosses it, where this had the volume fraction `rest` in the groom's pose.
    pub fn stopped(&self, slip: &Vector3<f64>, rest: f64, eta: f64) -> Vector3<f64> {
        let into = self.gradient.try_normalize(0.0).unwrap_or_default();
        let share_at_rest = self.share * (rest / self.fraction).min(1.0);
        let most = STOPPING * (self.share.powi(3) - share_at_rest.powi(3));
        into * slip.dot(&into).clamp(0.0, most * eta)
    }
}

#[cfg(test)]
mod tests {
    use super::super::law::tests::FIBRE;
    use super::*;

    #[test]
    fn what_crosses_as_in_the_pose_of_the_groom_is_neither_repelled_nor_stopped() {
        let crossing = Crossing { share: 0.5, fraction: 0.005, gradient: Vector3::x() };
        let opposed = |rest: f64| {
            let lost = crossing.stopped(&(Vector3::x() * 1e9), rest, 1.0).x / STOPPING;
            [lost, -crossing.repulsion(&FIBRE, rest, f64::INFINITY).x / (STIFFNESS * FIBRE.modulus * 0.01)]
        };
        let close = |a: [f64; 2], b: [f64; 2]| (0..2).all(|i| (a[i] - b[i]).abs() < 1e-12);
        assert!(close(opposed(0.002), [0.125 - 0.008, 0.6]), "{:?}", opposed(0.002));
        assert!(close(opposed(0.0), [0.125, 1.0 - LEAST / 0.5]), "{:?}", opposed(0.0));
        assert_eq!([opposed(0.005), opposed(0.006)], [[0.0; 2]; 2]);
        assert_eq!(crossing.stopped(&-Vector3::x(), 0.0, 1.0), Vector3::zeros());
    }
}
