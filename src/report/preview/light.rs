//! Scattering of light by a fibre.
//!
//! | symbol | meaning |
//! |---|---|
//! | t | fibre tangent, from root to tip |
//! | l, v | unit directions to the light and to the viewer |
//! | θi, θr | inclination of l and v to the fibre's normal plane, positive towards the tip |
//! | θh, θd | half sum and half difference of θi and θr |
//! | φ | angle between l and v seen along the fibre |

use nalgebra::Vector3;

/// Linear red, green, blue.
pub type Rgb = Vector3<f32>;

/// Light scattered from `l` to `v` by a fibre of colour `tint`, relative to the light's colour: the three
/// lobes of Marschner et al. (2003, eq. 8) with Gaussians in θh and simple profiles in φ, plus the diffuse
/// term of Kajiya & Kay (1989, eq. 14). `deep` is `tint` after the light's second way through the pigment
/// ([`deepened`]); `tilt`, rad, rotates all lobes.
pub fn scatter(t: Vector3<f32>, l: Vector3<f32>, v: Vector3<f32>, [tint, deep]: [Rgb; 2], tilt: f32) -> Rgb {
    // Cuticle tilt and roughness of human hair (Marschner et al. 2003, table 1), rad.
    const ALPHA: f32 = -0.105;
    const BETA: f32 = 0.14;
    let (sin_i, sin_r) = (t.dot(&l).clamp(-1.0, 1.0), t.dot(&v).clamp(-1.0, 1.0));
    let (theta_i, theta_r) = (arcsine(sin_i), arcsine(sin_r));
    let theta_h = 0.5 * (theta_i + theta_r);
    let (across_l, across_v) = (l - t * sin_i, v - t * sin_r);
    let cos_phi = across_l.dot(&across_v) / (across_l.norm() * across_v.norm()).max(1e-6);
    let toward = 0.5 * (1.0 + cos_phi).clamp(0.0, 2.0);
    let lobe = |alpha: f32, beta: f32| decay(0.5 * ((theta_h - alpha - tilt) / beta).powi(2));
    let cos_i = (1.0 - sin_i * sin_i).sqrt();
    let reflected = 0.085 * lobe(ALPHA, BETA) * toward.sqrt();
    let twice_through = 0.55 * lobe(-1.5 * ALPHA, 2.0 * BETA) * toward * toward;
    let through = 1.0 * lobe(-0.5 * ALPHA, BETA) * (1.0 - toward).powi(8);
    // cos² of half a difference.
    let cos2_d = 0.5 * (1.0 + cos_i * (1.0 - sin_r * sin_r).sqrt() + sin_i * sin_r);
    let shape = cos_i / cos2_d.max(0.2);
    tint * (BODY * cos_i) + (Rgb::repeat(reflected) + deep * (twice_through + through)) * shape
}

/// The colour of light that passed the pigment of a fibre of colour `tint` twice.
pub fn deepened(tint: Rgb) -> Rgb {
    tint.map(|c| c.powf(0.72))
}

/// Weight of the diffuse term.
const BODY: f32 = 0.7;

/// The diffuse term of [`scatter`] of a white fibre.
pub fn diffuse(t: Vector3<f32>, l: Vector3<f32>) -> f32 {
    let sin_i = t.dot(&l).clamp(-1.0, 1.0);
    BODY * (1.0 - sin_i * sin_i).sqrt()
}

/// exp(−`x`) for x ≥ 0, to 1e-5. Unlike the library's, loops of it become vector instructions.
pub fn decay(x: f32) -> f32 {
    // Adding it rounds to whole numbers, in the lowest bits.
    const ROUND: f32 = 12_582_912.0;
    let power = (-x * std::f32::consts::LOG2_E).max(-126.0);
    let rounded = power + ROUND;
    let f = (power - (rounded - ROUND)) * std::f32::consts::LN_2;
    let series = 1.0 + f * (1.0 + f * (0.5 + f * (1.0 / 6.0 + f * (1.0 / 24.0 + f * (1.0 / 120.0)))));
    let exponent = rounded.to_bits().wrapping_sub(ROUND.to_bits()).wrapping_add(127);
    series * f32::from_bits(exponent << 23)
}

/// The arcsine to 7e-5 rad (Abramowitz & Stegun 1964, 4.4.45).
fn arcsine(x: f32) -> f32 {
    let a = x.abs().min(1.0);
    let series = 1.570_728_8 + a * (-0.212_114_4 + a * (0.074_261 - a * 0.018_729_3));
    (std::f32::consts::FRAC_PI_2 - (1.0 - a).sqrt() * series).copysign(x)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn white_highlight_shifts_towards_the_root() {
        let t = Vector3::x();
        let at = |degrees: f32| {
            let (s, c) = degrees.to_radians().sin_cos();
            scatter(t, Vector3::y(), Vector3::new(s, c, 0.0), [Rgb::zeros(); 2], 0.0).x
        };
        let best = (-40..=40).max_by(|a, b| at(*a as f32).total_cmp(&at(*b as f32))).unwrap();
        assert!((-16..=-8).contains(&best), "peak of R at {best}°, twice the tilt of −6°");
    }

    #[test]
    fn approximations_keep_to_their_errors() {
        for i in 0..2000 {
            let x = i as f32 * 0.01;
            assert!((decay(x) - (-x).exp()).abs() < 1e-5, "{x}");
            let y = i as f32 * 1e-3 - 1.0;
            assert!((arcsine(y) - y.asin()).abs() < 7e-5, "{y}");
        }
        assert!(decay(1e9) < 1e-37 && decay(f32::INFINITY) < 1e-37);
    }
}
