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

/// Weight of the value after `k` of `n` equal steps in the one half-way: a step's own end, or the cubic
/// through the four values around the middle. A single step has the mean of its ends.
pub(super) fn midway_weight(k: i64, n: i64) -> f64 {
    match (n, (2 * k - n).abs()) {
        (1, _) => 0.5,
        (_, 0) => 1.0,
        (_, 1) => 9.0 / 16.0,
        (_, 3) if n % 2 == 1 => -1.0 / 16.0,
        _ => 0.0,
    }
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
    fn the_value_half_way_is_exact_for_cubics_and_for_lines_with_one_step() {
        let cubic = |x: f64| 2.0 - 3.0 * x + 5.0 * x * x - 4.0 * x * x * x;
        for n in 1..=9_i64 {
            let of = |y: &dyn Fn(f64) -> f64| -> f64 {
                (0..=n).map(|k| midway_weight(k, n) * y(k as f64 / n as f64)).sum()
            };
            assert!((of(&|x| 1.0 + x) - 1.5).abs() < 1e-12, "{n}");
            assert!(n == 1 || (of(&cubic) - cubic(0.5)).abs() < 1e-12, "{n}");
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
