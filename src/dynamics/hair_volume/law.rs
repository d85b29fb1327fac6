//! The mechanics of a fibre assembly (`docs/theory.md` §5.3).

use nalgebra::Vector3;
use std::f64::consts::PI;

/// k: pressure of hair over E φ³. Van Wyk (1946) has about 1e-2 for random fibres; hair is nearly parallel, if
/// never quite. Higher keeps the volume of hair better and rubs more. Chosen so that swinging locks come nearest
/// to those of rigid bundles. It is the same for hair that crosses: its contacts press along the normal of both
/// hairs and not to all sides, as pressure does, which would tear locks that cross open.
const STIFFNESS: f64 = 1e-4;

/// Load of the contacts between random fibres over that between parallel ones, which are fewer.
const RANDOM_LOAD: f64 = 10.0;

/// Largest Courant number of a pressure wave over a sub-step. Stiffer hair is made as soft as that, since the
/// pressure is explicit in time.
const MAX_COURANT: f64 = 0.8;

/// Most Newton iterations for the speed of a slip. Each comes nearer, and is exact where friction is the same
/// along and across.
const MAX_ITERATIONS: usize = 20;

/// The hair around a point.
pub(super) struct Assembly {
    /// Volume fraction φ of the fibres.
    pub fraction: f64,
    /// Mean of their unit tangents: its norm is 1 for parallel fibres.
    pub direction: Vector3<f64>,
}

/// A fibre of an assembly: one hair.
pub(super) struct Fibre {
    /// Young's modulus, Pa.
    pub modulus: f64,
    /// Density, kg/m³.
    pub density: f64,
    /// Cross-section, m².
    pub area: f64,
    /// Coefficient of kinetic friction.
    pub friction: f64,
    /// Friction between parallel fibres, for slip along them, over that between crossing ones.
    pub parallel_friction: f64,
    /// Friction for slip across the fibre over that along it.
    pub friction_across: f64,
    /// Force per length between parallel fibres, N/m.
    pub cohesion: f64,
}

impl Assembly {
    /// How far the fibres are from parallel (0) to random (1).
    fn disorder(&self) -> f64 {
        (2.0 * (1.0 - self.direction.norm_squared())).clamp(0.0, 1.0)
    }

    /// Speed of a pressure wave, m/s. Its square is dp/dφ over the density of the fibres.
    pub fn wave_speed(&self, fibre: &Fibre) -> f64 {
        (3.0 * fibre.stiffness() / fibre.density).sqrt() * self.fraction
    }

    /// Derivative u′ of the energy per volume of fibre by the volume fraction, Pa, where the fraction is
    /// `rest` in the groom's pose: p = φ² u′. Zero where the hair is no denser than there. Hair whose
    /// [`Assembly::wave_speed`] is above `max_speed`, m/s, is made as soft as that.
    pub fn energy_slope(&self, fibre: &Fibre, rest: f64, max_speed: f64) -> f64 {
        let square = self.fraction * self.fraction;
        let excess = self.fraction * square - rest.powi(3);
        let softening = (max_speed / self.wave_speed(fibre)).powi(2).min(1.0);
        softening * fibre.stiffness() * excess.max(0.0) / square
    }

    /// Bounds of the friction per length on a fibre, N/m, for slip across and along it (5.17): pressure p loads
    /// its contacts with 3π d p per length where it is parallel to its neighbours.
    pub fn friction_bounds(&self, fibre: &Fibre) -> [f64; 2] {
        let diameter = 2.0 * (fibre.area / PI).sqrt();
        let pressure = fibre.stiffness() * self.fraction.powi(3);
        let disorder = 1.0 + (RANDOM_LOAD - 1.0) * self.disorder();
        let load = 3.0 * PI * diameter * pressure * disorder + fibre.cohesion * (1.0 - self.disorder());
        let along = fibre.parallel_friction + (1.0 - fibre.parallel_friction) * self.disorder();
        [fibre.friction_across, along].map(|share| share * fibre.friction * load)
    }
}

impl Fibre {
    /// k E, Pa: pressure over φ³.
    fn stiffness(&self) -> f64 {
        STIFFNESS * self.modulus
    }
}

/// What opposes slip over a step: across a fibre, and along it.
pub(super) struct Resistance {
    /// Slip that friction takes away at most, m/s.
    pub friction: [f64; 2],
    /// Share of what is left of the slip that drag takes away.
    pub drag: [f64; 2],
}

impl Resistance {
    /// Adds friction that takes away this much slip, m/s, in any direction.
    pub fn press(&mut self, friction: f64) {
        self.friction.iter_mut().for_each(|of| *of += friction);
    }

    /// What is left of the `slip`, m/s, of a hair along `tangent`.
    pub fn slip_left(&self, slip: &Vector3<f64>, tangent: &Vector3<f64>) -> Vector3<f64> {
        let tangent = tangent.try_normalize(0.0).unwrap_or_default();
        let along = tangent * tangent.dot(slip);
        let across = slip - along;
        let [share_across, share_along] = self.left([across.norm(), along.norm()]);
        across * share_across + along * share_along
    }

    /// The shares that are left of slips across and along a fibre, m/s, that would be without the resistance
    /// (5.19); zero where friction holds.
    fn left(&self, slip: [f64; 2]) -> [f64; 2] {
        let Resistance { friction, drag } = self;
        // The components at σ are slip · σ/(…); their squares add up to σ².
        let pull = |c: usize| (slip[c].abs() - friction[c]) / (1.0 + drag[c]);
        let mut speed = pull(0).max(pull(1)).max(0.0);
        let sums = |speed: f64| {
            let term = |c: usize| {
                let (slope, whole) = (1.0 + drag[c], (1.0 + drag[c]) * speed + friction[c]);
                let square = if slip[c] == 0.0 { 0.0 } else { (slip[c] / whole).powi(2) };
                [square, if square == 0.0 { 0.0 } else { square * slope / whole }]
            };
            let [[a, a_slope], [b, b_slope]] = [0, 1].map(term);
            [a + b, a_slope + b_slope]
        };
        for _ in 0..MAX_ITERATIONS {
            let [sum, slope] = sums(speed);
            if sum <= 1.0 {
                break;
            }
            // Newton's method on 1/√sum − 1, which is concave: it does not overshoot.
            let step = sum * (sum.sqrt() - 1.0) / slope;
            speed += step;
            if step <= 1e-12 * speed {
                break;
            }
        }
        [0, 1].map(|c| if speed == 0.0 { 0.0 } else { 1.0 / (1.0 + drag[c] + friction[c] / speed) })
    }
}

/// Largest speed of pressure waves, m/s, on a grid of `spacing`, m, with steps of `h`, s.
pub(super) fn max_wave_speed(spacing: f64, h: f64) -> f64 {
    MAX_COURANT * spacing / h
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;

    pub(in crate::dynamics::hair_volume) const FIBRE: Fibre = Fibre {
        modulus: 4e9,
        density: 1320.0,
        area: 5e-9,
        friction: 0.3,
        parallel_friction: 0.5,
        friction_across: 1.0,
        cohesion: 0.0,
    };

    fn hair(fraction: f64, order: f64) -> Assembly {
        Assembly { fraction, direction: Vector3::x() * order }
    }

    /// The pressure, Pa, without the limit of the time step.
    fn pressure(hair: &Assembly, rest: f64) -> f64 {
        hair.energy_slope(&FIBRE, rest, f64::INFINITY) * hair.fraction * hair.fraction
    }

    #[test]
    fn pressure_grows_as_the_cube_of_the_fraction() {
        for fraction in [0.01, 0.02, 0.1] {
            let expected = 1e-4 * 4e9 * (f64::powi(fraction, 3) - 1e-6 * 0.125);
            assert!((pressure(&hair(fraction, 0.0), 0.005) / expected - 1.0).abs() < 1e-12);
        }
        assert_eq!(pressure(&hair(0.004, 0.0), 0.005), 0.0);
    }

    #[test]
    fn parallel_fibres_rub_less_than_crossed_ones_and_slide_along() {
        let [crossed, parallel] = [0.5, 1.0].map(|order| hair(0.01, order));
        let [across, along] = parallel.friction_bounds(&FIBRE);
        assert!((along / across - 0.5).abs() < 1e-12);
        let [crossed_across, crossed_along] = crossed.friction_bounds(&FIBRE);
        assert!((crossed_along / crossed_across - 1.0).abs() < 1e-12);
        assert!((crossed_across / across - RANDOM_LOAD).abs() < 1e-9);
    }

    #[test]
    fn friction_is_bounded_by_the_load_of_the_contacts() {
        let hair = hair(0.01, 0.0);
        let diameter = 2.0 * (FIBRE.area / PI).sqrt();
        let bound = 0.3 * 3.0 * PI * diameter * pressure(&hair, 0.0) * RANDOM_LOAD;
        assert!(hair.friction_bounds(&FIBRE).iter().all(|b| (b / bound - 1.0).abs() < 1e-12));
    }

    #[test]
    fn slip_is_held_up_to_the_bound_of_friction_and_loses_it_beyond() {
        let dry = Resistance { friction: [0.2, 0.1], drag: [0.0; 2] };
        // In the ellipse of the bounds.
        assert_eq!(dry.left([0.12, 0.079]), [0.0; 2]);
        assert_eq!(dry.left([0.0; 2]), [0.0; 2]);
        assert!((dry.left([0.5, 0.0])[0] - 0.6).abs() < 1e-12);
        assert!((dry.left([0.0, -0.5])[1] - 0.8).abs() < 1e-12);
        let air = Resistance { friction: [0.0; 2], drag: [0.5, 1.0] };
        let [across, along] = air.left([1e-3, 7.0]);
        assert!((across - 1.0 / 1.5).abs() < 1e-12 && (along - 0.5).abs() < 1e-12);
    }

    /// Friction has the direction of the slip that is left, and drag is in proportion to it.
    #[test]
    fn what_is_left_of_a_slip_balances_what_it_lost() {
        let draw = |i: u64, n: u64| crate::math::random::unit(n, i);
        for i in 0..2000 {
            let wide = |n: u64| 10_f64.powf(8.0 * draw(i, n) - 6.0);
            let resistance = Resistance { friction: [wide(0), wide(1)], drag: [wide(2), wide(3)] };
            let slip = [wide(4), -wide(5)];
            let left = resistance.left(slip);
            let end = [slip[0] * left[0], slip[1] * left[1]];
            let speed = end[0].hypot(end[1]);
            if speed == 0.0 {
                let share = (slip[0] / resistance.friction[0]).hypot(slip[1] / resistance.friction[1]);
                assert!(share <= 1.0 + 1e-12, "{share}");
                continue;
            }
            for c in 0..2 {
                let lost = resistance.friction[c] * end[c] / speed + resistance.drag[c] * end[c];
                assert!((slip[c] - end[c] - lost).abs() < 1e-9 * slip[c].abs(), "{i}: {slip:?} {left:?}");
            }
        }
    }

    #[test]
    fn waves_are_no_faster_than_the_step_allows() {
        let hair = hair(0.2, 0.0);
        let slope = hair.energy_slope(&FIBRE, 0.0, 0.7);
        // c² = 3 k E φ²/ρ, with p = k E φ³.
        let stiffness = slope / hair.fraction;
        assert!((3.0 * stiffness * 0.04 / FIBRE.density - 0.49).abs() < 1e-9);
    }
}
