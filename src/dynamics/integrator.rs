//! Time schemes of the guides: how velocities follow from positions (`docs/theory.md` §4.6).

use crate::scene::anim::Scheme;

/// Largest ratio of successive steps at which BDF2 is used; it is stable below 1 + √2.
const MAX_RATIO: f64 = 2.0;

/// The difference formula of one step: the rate of any quantity y at its end is (y − y*)/η, with y* = a yⁿ +
/// b yⁿ⁻¹.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct DifferenceFormula {
    /// η, s: the step for backward Euler, two thirds of the step for BDF2 at equal steps.
    pub eta: f64,
    /// Ratio of the step to the previous one; 0 without history.
    pub ratio: f64,
    a: f64,
    b: f64,
}

impl DifferenceFormula {
    /// The formula of a step of `h`, s, after one of `last`, s. With `last` = 0, as at the start, there is no
    /// history and the formula is backward Euler's.
    pub fn new(scheme: Scheme, h: f64, last: f64) -> Self {
        let ratio = match scheme {
            Scheme::Bdf2 if h <= MAX_RATIO * last => h / last,
            _ => 0.0,
        };
        // Variable-step BDF2 (Hairer, Nørsett & Wanner 1993, §III.5); backward Euler at ratio 0.
        let w = 1.0 + 2.0 * ratio;
        DifferenceFormula {
            eta: h * (1.0 + ratio) / w,
            ratio,
            a: (1.0 + ratio).powi(2) / w,
            b: -ratio * ratio / w,
        }
    }

    /// True if the formula uses the previous step.
    pub fn looks_back(&self) -> bool {
        self.ratio > 0.0
    }

    /// y*, from y at the start of this step and of the previous one.
    pub fn y_star<T: std::ops::Mul<f64, Output = T> + std::ops::Add<Output = T>>(
        &self,
        now: T,
        before: T,
    ) -> T {
        now * self.a + before * self.b
    }
}

/// Second-order rate at the newest of three values, newest first, `h`, s, apart.
pub(super) fn backward_difference([now, one, two]: [f64; 3], h: f64) -> f64 {
    (3.0 * now - 4.0 * one + two) / (2.0 * h)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bdf2_is_exact_for_parabolas_at_any_ratio() {
        for (h, last) in [(0.1, 0.1), (0.1, 0.07), (0.1, 0.2)] {
            let f = DifferenceFormula::new(Scheme::Bdf2, h, last);
            let y = |t: f64| 2.0 - 3.0 * t + 5.0 * t * t;
            let rate = (y(h) - f.y_star(y(0.0), y(-last))) / f.eta;
            assert!((rate - (10.0 * h - 3.0)).abs() < 1e-12, "{rate}");
            assert!(f.looks_back());
        }
    }

    #[test]
    fn without_history_it_is_backward_euler() {
        for f in [
            DifferenceFormula::new(Scheme::Bdf2, 0.1, 0.0),
            DifferenceFormula::new(Scheme::Bdf2, 0.1, 0.04),
            DifferenceFormula::new(Scheme::BackwardEuler, 0.1, 0.1),
        ] {
            assert!(!f.looks_back());
            assert_eq!((f.eta, f.y_star(3.0, 7.0)), (0.1, 3.0));
        }
    }
}
