//! Time schemes of the guides: how velocities follow from positions (`docs/theory.md` §4.6).

use crate::scene::anim::Scheme;

/// Largest ratio of successive steps at which BDF2 is used; it is stable below 1 + √2.
const MAX_RATIO: f64 = 2.0;

/// Largest difference between steps that count as equal, as a share of them: times are rounded.
const EQUAL_STEPS: f64 = 1e-6;

/// Largest second difference ∇²x of the positions of a rod's points, as a share of its length, over which a
/// formula looks back further than to the previous step. A rod that turns by a radian or more per step may
/// go on so for ever with the formulas of three and four steps; it comes to rest with BDF2.
pub(super) const MAX_BEND: f64 = 0.2;

/// Weights of ∇³ and ∇⁴ in h D = ∇ + ∇²/2 + b₃ ∇³ + b₄ ∇⁴, where ∇y = y − yⁿ, by the number of steps behind,
/// from one: BDF2, then the formulas of three and four steps.
const HIGHER_DIFFERENCES: [[f64; 2]; DifferenceFormula::PAST - 1] = [[0.0, 0.0], [0.16, 0.0], [0.2, 0.07]];

/// Values at the starts of the steps before this one, newest first.
pub(super) type Past<T> = [T; DifferenceFormula::PAST - 1];

/// The difference formula of one step: the rate of any quantity y at its end is (y − y*)/η, with y* a sum of
/// values of y at the starts of this step and of those before.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct DifferenceFormula {
    /// η, s: the step for backward Euler, two thirds of the step for BDF2 at equal steps.
    pub eta: f64,
    /// Ratio of the step to the previous one; 0 without history.
    pub ratio: f64,
    /// Weights of the past values in y*, newest first.
    weights: [f64; Self::PAST],
}

impl DifferenceFormula {
    /// Number of past values that a formula may use.
    pub const PAST: usize = 4;

    /// The formula of a step of `h`, s, after steps of `last`, s, newest first. A step of 0 and those before
    /// it are not used: with none, as at the start, the formula is backward Euler's.
    pub fn new(scheme: Scheme, h: f64, last: &Past<f64>) -> Self {
        let equal = last.iter().take_while(|last| (*last - h).abs() <= EQUAL_STEPS * h).count();
        match scheme {
            Scheme::BackwardEuler => Self::two_step(h, 0.0),
            Scheme::FourStep if equal > 1 => Self::of_equal_steps(h, equal),
            Scheme::Bdf2 | Scheme::FourStep if h <= MAX_RATIO * last[0] => Self::two_step(h, h / last[0]),
            Scheme::Bdf2 | Scheme::FourStep => Self::two_step(h, 0.0),
        }
    }

    /// Backward Euler.
    pub fn backward_euler(h: f64) -> Self {
        Self::two_step(h, 0.0)
    }

    /// BDF2 for steps of any ratio (Hairer, Nørsett & Wanner 1993, §III.5); backward Euler at ratio 0.
    fn two_step(h: f64, ratio: f64) -> Self {
        let w = 1.0 + 2.0 * ratio;
        DifferenceFormula {
            eta: h * (1.0 + ratio) / w,
            ratio,
            weights: [(1.0 + ratio).powi(2) / w, -ratio * ratio / w, 0.0, 0.0],
        }
    }

    /// The formula of `steps` equal steps, one behind the other, before this one (`docs/theory.md` §4.6).
    fn of_equal_steps(h: f64, steps: usize) -> Self {
        let [b3, b4] = HIGHER_DIFFERENCES[steps - 1];
        let now = 1.5 + b3 + b4;
        let past = [2.0 + 3.0 * b3 + 4.0 * b4, -0.5 - 3.0 * b3 - 6.0 * b4, b3 + 4.0 * b4, -b4];
        DifferenceFormula { eta: h / now, ratio: 1.0, weights: past.map(|weight| weight / now) }
    }

    /// True if the formula uses the previous step.
    pub fn looks_back(&self) -> bool {
        self.ratio > 0.0
    }

    /// True if the formula uses more steps than the previous one.
    pub fn looks_far_back(&self) -> bool {
        self.weights[2] != 0.0
    }

    /// y*, from y at the start of this step and of those before, newest first.
    pub fn y_star<T: std::ops::Mul<f64, Output = T> + std::ops::Add<Output = T>>(
        &self,
        past: [T; Self::PAST],
    ) -> T {
        let [now, one, two, three] = past;
        let [a, b, c, d] = self.weights;
        now * a + one * b + two * c + three * d
    }
}

/// Second-order rate at the newest of three values, newest first, `h`, s, apart.
pub(super) fn backward_difference([now, one, two]: [f64; 3], h: f64) -> f64 {
    (3.0 * now - 4.0 * one + two) / (2.0 * h)
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Complex;

    const H: f64 = 0.1;

    /// The formulas of equal steps, by the steps behind.
    fn of_equal_steps() -> [DifferenceFormula; 4] {
        [0, 1, 2, 3].map(|steps| {
            let last = std::array::from_fn(|k| if k < steps { H } else { 0.0 });
            DifferenceFormula::new(Scheme::FourStep, H, &last)
        })
    }

    /// h D at z⁻¹ = `zeta`: the rate of zⁿ over its value, per step.
    fn symbol(f: &DifferenceFormula, zeta: Complex<f64>) -> Complex<f64> {
        let one = Complex::new(1.0, 0.0);
        (one - f.y_star([zeta, zeta.powi(2), zeta.powi(3), zeta.powi(4)])) * (H / f.eta)
    }

    #[test]
    fn bdf2_is_exact_for_parabolas_at_any_ratio() {
        for (scheme, h, last) in [
            (Scheme::Bdf2, 0.1, [0.1; 3]),
            (Scheme::Bdf2, 0.1, [0.07, 0.1, 0.1]),
            (Scheme::FourStep, 0.1, [0.07, 0.1, 0.1]),
            (Scheme::FourStep, 0.1, [0.2; 3]),
            (Scheme::FourStep, 0.1, [0.1, 0.05, 0.05]),
        ] {
            let f = DifferenceFormula::new(scheme, h, &last);
            let y = |t: f64| 2.0 - 3.0 * t + 5.0 * t * t;
            let rate = (y(h) - f.y_star([y(0.0), y(-last[0]), f64::MAX, f64::MAX])) / f.eta;
            assert!((rate - (10.0 * h - 3.0)).abs() < 1e-12, "{rate}");
            assert!(f.looks_back());
        }
    }

    #[test]
    fn formulas_of_equal_steps_are_exact_for_parabolas() {
        let y = |t: f64| 2.0 - 3.0 * t + 5.0 * t * t;
        for f in &of_equal_steps()[1..] {
            let rate = (y(H) - f.y_star([0.0, -1.0, -2.0, -3.0].map(|k| y(k * H)))) / f.eta;
            assert!((rate - (10.0 * H - 3.0)).abs() < 1e-12, "{rate}");
        }
    }

    #[test]
    fn formulas_of_equal_steps_are_stable_for_all_decay_and_any_step() {
        for f in of_equal_steps() {
            // A-stable: a root outside the unit circle belongs to growth. On the circle itself, and beyond.
            for k in 0..3600 {
                let phi = std::f64::consts::TAU * f64::from(k) / 3600.0;
                for size in [1.0, 0.99, 0.8, 0.3, 0.0] {
                    let rate = symbol(&f, Complex::from_polar(size, phi));
                    assert!(rate.re > -1e-14, "{f:?} {phi} {size}: {rate}");
                }
            }
            // L-stable: what decays at once leaves nothing, for no rate but infinity has all roots at 0.
            assert!(f.weights.iter().all(|weight| weight.is_finite()) && f.eta > 0.0);
        }
    }

    #[test]
    fn formulas_of_equal_steps_have_the_errors_of_the_theory() {
        let theta: f64 = 1e-2;
        let all = of_equal_steps();
        // Relative error of the phase over θ², and loss of amplitude per radian over θ³.
        for (f, [phase, loss]) in
            all[1..].iter().zip([[1.0 / 3.0, 0.25], [0.52 / 3.0, 0.01], [0.4 / 3.0, 0.02]])
        {
            let rate = symbol(f, Complex::from_polar(1.0, -theta));
            let (found_phase, found_loss) =
                ((1.0 - rate.im / theta) / -theta.powi(2), rate.re / theta.powi(4));
            assert!((found_phase - phase).abs() < 1e-3, "{found_phase} {phase}");
            assert!((found_loss - loss).abs() < 1e-3, "{found_loss} {loss}");
        }
    }

    #[test]
    fn without_history_it_is_backward_euler() {
        for f in [
            DifferenceFormula::new(Scheme::Bdf2, 0.1, &[0.0; 3]),
            DifferenceFormula::new(Scheme::FourStep, 0.1, &[0.0; 3]),
            DifferenceFormula::new(Scheme::Bdf2, 0.1, &[0.04; 3]),
            DifferenceFormula::new(Scheme::FourStep, 0.1, &[0.04; 3]),
            DifferenceFormula::new(Scheme::BackwardEuler, 0.1, &[0.1; 3]),
            DifferenceFormula::backward_euler(0.1),
        ] {
            assert!(!f.looks_back());
            assert_eq!((f.eta, f.y_star([3.0, 7.0, 8.0, 9.0])), (0.1, 3.0));
        }
    }
}
