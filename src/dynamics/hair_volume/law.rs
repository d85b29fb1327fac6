//! The mechanics of a fibre assembly (`docs/theory.md` §5.3).

use nalgebra::Vector3;
use std::f64::consts::PI;

/// k: pressure of randomly oriented fibres over E φ³. Van Wyk (1946) has about 1e-2; hair is curved and
/// nearly parallel. Higher keeps the volume of hair better and rubs more. Chosen so that swinging locks come
/// nearest to those of rigid bundles. As used, k is between 1e-4 for parallel fibres and 1e-3:
/// [`PARALLEL_SHARE`].
const RANDOM_STIFFNESS: f64 = 1e-3;

/// Share of [`RANDOM_STIFFNESS`] that is left to parallel fibres. Real strands of a lock are never quite
/// parallel, and the guides do not show by how much.
const PARALLEL_SHARE: f64 = 0.1;

/// Largest Courant number of a pressure wave over a sub-step. Stiffer hair is made as soft as that, since the
/// pressure is explicit in time.
const MAX_COURANT: f64 = 0.8;

/// Slip at which friction is at 1/√2 of its bound, m/s: it is regularised below.
const STICK_SPEED: f64 = 0.01;

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

    /// k E, Pa: pressure over φ³.
    fn stiffness(&self, fibre: &Fibre) -> f64 {
        RANDOM_STIFFNESS * fibre.modulus * (PARALLEL_SHARE + (1.0 - PARALLEL_SHARE) * self.disorder())
    }

    /// Speed of a pressure wave, m/s. Its square is dp/dφ over the density of the fibres.
    pub fn wave_speed(&self, fibre: &Fibre) -> f64 {
        (3.0 * self.stiffness(fibre) / fibre.density).sqrt() * self.fraction
    }

    /// Derivative u′ of the energy per volume of fibre by the volume fraction, Pa, where the fraction is
    /// `rest` in the groom's pose: p = φ² u′. Zero where the hair is no denser than there. Hair whose
    /// [`Assembly::wave_speed`] is above `max_speed`, m/s, is made as soft as that.
    pub fn energy_slope(&self, fibre: &Fibre, rest: f64, max_speed: f64) -> f64 {
        let square = self.fraction * self.fraction;
        let excess = self.fraction * square - rest.powi(3);
        let softening = (max_speed / self.wave_speed(fibre)).powi(2).min(1.0);
        softening * self.stiffness(fibre) * excess.max(0.0) / square
    }

    /// Bounds of the friction per length on a fibre, N/m, for slip across and along it. Fibres under pressure
    /// p touch each other with the force 3π d p per length: the virial of contacts d/(2φ) apart (van Wyk
    /// 1946).
    fn friction_bounds(&self, fibre: &Fibre) -> [f64; 2] {
        let diameter = 2.0 * (fibre.area / PI).sqrt();
        let pressure = self.stiffness(fibre) * self.fraction.powi(3);
        let load = 3.0 * PI * diameter * pressure + fibre.cohesion * (1.0 - self.disorder());
        let along = fibre.parallel_friction + (1.0 - fibre.parallel_friction) * self.disorder();
        [fibre.friction_across, along].map(|share| share * fibre.friction * load)
    }

    /// Coefficients of friction for slip across and along a fibre that slips at `slip`, m/s: force per length
    /// and speed, N·s/m². Coulomb's law, regularised.
    pub fn friction(&self, fibre: &Fibre, slip: f64) -> [f64; 2] {
        let speed = slip.hypot(STICK_SPEED);
        self.friction_bounds(fibre).map(|bound| bound / speed)
    }
}

/// Largest speed of pressure waves, m/s, on a grid of `spacing`, m, with steps of `h`, s.
pub(super) fn max_wave_speed(spacing: f64, h: f64) -> f64 {
    MAX_COURANT * spacing / h
}

#[cfg(test)]
mod tests {
    use super::*;

    const FIBRE: Fibre = Fibre {
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
            let expected = 1e-3 * 4e9 * (f64::powi(fraction, 3) - 1e-6 * 0.125);
            assert!((pressure(&hair(fraction, 0.0), 0.005) / expected - 1.0).abs() < 1e-12);
        }
        assert_eq!(pressure(&hair(0.004, 0.0), 0.005), 0.0);
    }

    #[test]
    fn parallel_fibres_are_softer_than_crossed_ones_and_slide_along() {
        let [crossed, parallel] = [0.5, 1.0].map(|order| hair(0.01, order));
        assert!(pressure(&crossed, 0.0) > 5.0 * pressure(&parallel, 0.0));
        let [across, along] = parallel.friction(&FIBRE, 1.0);
        assert!((along / across - 0.5).abs() < 1e-12);
        let [across, along] = crossed.friction(&FIBRE, 1.0);
        assert!((along / across - 1.0).abs() < 1e-12);
    }

    #[test]
    fn friction_is_bounded_by_the_load_of_the_contacts() {
        let hair = hair(0.01, 0.0);
        let diameter = 2.0 * (FIBRE.area / PI).sqrt();
        let bound = 0.3 * 3.0 * PI * diameter * pressure(&hair, 0.0);
        for slip in [1e-4, 0.01, 1.0, 100.0] {
            let force = hair.friction(&FIBRE, slip)[0] * slip;
            assert!(force < bound && force > bound * (0.6 * slip / STICK_SPEED).min(0.7), "{slip}");
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
