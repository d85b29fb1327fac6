//! What hair looks like: natural colours, and colours with a meaning.

use nalgebra::Vector3;

use super::light::{Rgb, decay, deepened, diffuse, scatter};
use super::lighting::{Lighting, Shade};
use crate::math::random;

/// How a strand scatters light.
#[derive(Debug, Clone, Copy)]
pub struct Look {
    /// Its colour after the light's first and second way through it.
    tints: [Rgb; 2],
    /// Optical depth of hair of this colour, over that of the volume of shadows: light that goes on through
    /// hair takes on its colour.
    filter: Rgb,
    /// Tilt of its highlights, rad.
    tilt: f32,
}

/// Lightest and darkest chestnut.
const LIGHT: Rgb = Rgb::new(0.118, 0.054, 0.026);
const DARK: Rgb = Rgb::new(0.055, 0.023, 0.0115);
/// Light of the sky.
const SKY: Rgb = Rgb::new(0.46, 0.49, 0.54);

impl Look {
    /// Chestnut, with variation between strands.
    pub fn own(id: i32) -> Self {
        let [a, b, c] = noise(id as u32);
        let tint = LIGHT.lerp(&DARK, a) * (0.75 + 0.5 * b);
        Look { tilt: 0.09 * (c - 0.5), ..Look::of(tint) }
    }

    fn of(tint: Rgb) -> Self {
        Look { tints: [tint, deepened(tint)], filter: tint.map(|c| 1.45 - 1.2 * c.sqrt()), tilt: 0.0 }
    }

    /// The same in another colour.
    pub fn dyed(self, tint: Rgb) -> Self {
        Look { tilt: self.tilt, ..Look::of(tint) }
    }

    /// The light that it sends to the viewer from `p`.
    pub fn lit(&self, p: Vector3<f32>, tangent: Vector3<f32>, viewer: Vector3<f32>, light: &Lighting) -> Rgb {
        let Shade { lamps: [key, _, rim], sky } = light.shade(p);
        let passed = |depth: f32| self.filter.map(|f| decay(f * depth));
        // The fill light is large: it makes no highlights.
        let [key_light, fill_light, rim_light] = &light.lamps;
        let around = SKY + fill_light.colour * diffuse(tangent, fill_light.direction);
        let mut sum = self.tints[0].component_mul(&around).component_mul(&passed(sky));
        for (lamp, depth) in [(key_light, key), (rim_light, rim)] {
            let scattered = scatter(tangent, lamp.direction, viewer, self.tints, self.tilt);
            sum += scattered.component_mul(&lamp.colour).component_mul(&passed(depth));
        }
        sum
    }
}

/// The colour of a scalp under dense hair, as bodies are lit.
pub fn mean_colour() -> Rgb {
    LIGHT.lerp(&DARK, 0.5) * 0.75
}

/// A hue for each group, spaced by the golden ratio.
pub fn group_colour(group: i32) -> Rgb {
    colour((f64::from(group) * 0.618_033_988_749_895).rem_euclid(1.0) as f32)
}

/// Blue for coarse wisps, warmer colours for finer ones.
pub fn level_colour(level: i32) -> Rgb {
    colour(0.6 * 0.55_f32.powi(level.max(0)) - if level > 0 { 0.16 } else { 0.0 })
}

/// Blue for loose hair, green for hair as dense as the densest of the groom, yellow at 1.5 times and red from
/// twice that.
pub fn crowding_colour(crowding: f32) -> Rgb {
    colour(0.6 * (1.0 - 0.5 * crowding.clamp(0.0, 2.0)))
}

/// The colour of a hue (0..1 around the circle from red).
fn colour(hue: f32) -> Rgb {
    Rgb::from_fn(|k, _| {
        let x = (hue * 6.0 + [0.0, 4.0, 2.0][k]).rem_euclid(6.0);
        0.12 + 0.6 * ((x - 3.0).abs() - 1.0).clamp(0.0, 1.0).powi(2)
    })
}

/// Three random numbers in [0, 1) for an id.
fn noise(id: u32) -> [f32; 3] {
    let x = random::bits(0, u64::from(id));
    [0, 20, 40].map(|shift| (x >> shift & 0xf_ffff) as f32 / (1u32 << 20) as f32)
}
