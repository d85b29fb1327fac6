//! The coefficient of the modal correction, estimated from how well the leaders' modal responses predict
//! their motion (`docs/theory.md` eqs. 8.3 to 8.5).

use crate::wisp::Deflection;
use serde::{Deserialize, Serialize};

/// Time constant of the running sums, s. A longer one gives a steadier coefficient, which reacts later when
/// hair meets a body.
const WINDOW: f64 = 0.5;

/// Weight of the follower's own modal deviation in the variance. A larger one trusts the leaders less where
/// they are more like each other than like the follower. With 0, some long hair whose leaders meet bodies is
/// thrown about (points above 100 m/s² where its leaders have 20).
const OWN_WEIGHT: f64 = 3.0;

/// Weighted means over the leaders of a guide.
#[derive(Default)]
pub(super) struct LeaderMeans {
    /// Mean deflection.
    pub deflection: Deflection,
    /// Mean modal response.
    pub modal: Deflection,
}

/// The control variate of a follower: running sums over its leaders and over time, dimensionless.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub(super) struct ControlVariate {
    /// Covariance of the leaders' deflections and modal responses, both relative to their means.
    covariance: f64,
    /// Variance of the modal responses, plus the follower's own modal deviation squared.
    variance: f64,
}

impl ControlVariate {
    /// The coefficient ν, from 0 to 1: the share of its modal deviation that the follower receives.
    pub fn coefficient(&self) -> f64 {
        if self.covariance > 0.0 { (self.covariance / self.variance).min(1.0) } else { 0.0 }
    }

    /// Adds one frame of duration `frame`, s, to the sums: of leaders with (share, deflection, modal
    /// response), and of the guide's `own` modal response.
    pub fn update<'a>(
        &mut self,
        frame: f64,
        leaders: impl Iterator<Item = (f64, &'a Deflection, &'a Deflection)>,
        own: &Deflection,
        means: &LeaderMeans,
    ) {
        let decay = (-frame / WINDOW).exp();
        (self.covariance, self.variance) = (decay * self.covariance, decay * self.variance);
        let difference = |of: &Deflection, mean: &Deflection| {
            let numbers = of.displacement().iter().zip(mean.displacement());
            numbers.map(|(of, mean)| of - mean).collect::<Vec<f64>>()
        };
        self.variance += OWN_WEIGHT * difference(own, &means.modal).iter().map(|x| x * x).sum::<f64>();
        for (share, deflection, modal) in leaders {
            let modal = difference(modal, &means.modal);
            for (deflection, modal) in difference(deflection, &means.deflection).iter().zip(&modal) {
                self.covariance += share * deflection * modal;
                self.variance += share * modal * modal;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::wisp::LinearKinematics;
    use nalgebra::Vector3;

    /// The coefficient after 48 frames. Two leaders deviate from their means by ±`deflected` and, modally, by
    /// ±`modal`; the guide's modal response deviates by `own`.
    fn coefficient(deflected: f64, modal: f64, own: f64) -> f64 {
        // Two nodes with equal strain about x at three moments, of a straight guide along y.
        let kinematics = LinearKinematics::new(&[0.0, 1.0, 2.0].map(|y| Vector3::y() * y), &[0.0, 1.0, 2.0]);
        let bent = |mean: f64, by: f64| {
            let mut deflection = Deflection::default();
            deflection.set(std::iter::repeat_n(Vector3::x() * (mean + by), 6), &kinematics);
            deflection
        };
        let leaders = [1.0, -1.0].map(|side| (0.5, bent(3.0, side * deflected), bent(2.0, side * modal)));
        let means = LeaderMeans { deflection: bent(3.0, 0.0), modal: bent(2.0, 0.0) };
        let mut variate = ControlVariate::default();
        for _ in 0..48 {
            let leaders = leaders.iter().map(|(share, deflection, modal)| (*share, deflection, modal));
            variate.update(1.0 / 24.0, leaders, &bent(2.0, own), &means);
        }
        variate.coefficient()
    }

    #[test]
    fn coefficient_is_the_share_of_the_leaders_motion_that_their_modes_predict() {
        assert!((coefficient(0.1, 0.1, 0.0) - 1.0).abs() < 1e-12);
        assert!((coefficient(0.04, 0.1, 0.0) - 0.4).abs() < 1e-12);
        // Opposite or no correlation gives 0.
        let none = [coefficient(-0.1, 0.1, 0.0), coefficient(0.0, 0.1, 0.0), coefficient(0.1, 0.0, 0.1)];
        assert_eq!(none, [0.0; 3]);
        // At most 1, and less where the guide differs from its leaders more than they differ from each other.
        assert_eq!(coefficient(0.5, 0.1, 0.0), 1.0);
        assert!((coefficient(0.1, 0.1, 0.1) - 1.0 / (1.0 + OWN_WEIGHT)).abs() < 1e-12);
    }
}
