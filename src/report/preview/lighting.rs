//! The light of a picture: a key light, a fill light, a rim light and a sky, with their shadows.

use nalgebra::Vector3;

use super::camera::Axes;
use super::light::{Rgb, decay};
use super::shadow_map::{GOLDEN, ShadowMap};
use super::volume::{Fields, Volume};

/// How finely light is sampled.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Sampling {
    /// Cells of the volume of shadows.
    pub cells: usize,
    /// Directions to a lamp: more of them make soft shadows.
    pub lamp: usize,
    /// Directions to the sky.
    pub sky: usize,
    /// Texels along the longer side of a map of the shadows that bodies cast on bodies.
    pub map: usize,
}

/// A distant lamp.
#[derive(Debug, Clone, Copy)]
pub struct Lamp {
    /// Unit direction to its middle.
    pub direction: Vector3<f32>,
    /// Its light.
    pub colour: Rgb,
}

/// Optical depths towards the key light, the rim light and the sky; the fill light is shaded as the sky is.
#[derive(Debug, Clone, Copy)]
pub struct Shade {
    /// Towards the key, the fill and the rim light.
    pub lamps: [f32; 3],
    /// Towards the sky.
    pub sky: f32,
}

impl Shade {
    fn new([key, rim, sky]: [f32; 3]) -> Self {
        Shade { lamps: [key, 0.6 * sky, rim], sky }
    }
}

/// The light of a picture.
pub struct Lighting {
    /// Key, fill and rim light.
    pub lamps: [Lamp; 3],
    grid: Volume,
    /// Depths by hair and bodies, by hair alone, and by bodies alone.
    fields: [Fields<3>; 3],
    /// What each lamp sees of bodies.
    maps: [ShadowMap; 3],
}

/// What casts shadows.
pub struct Casters<T> {
    /// Extinction of hair and of bodies, on the same cells.
    pub hair: Volume,
    pub bodies: Volume,
    /// Triangles of bodies, in the box in which they are to cast shadows on each other.
    pub triangles: T,
    pub around: [Vector3<f32>; 2],
}

/// Half the angle at which the key and the rim light are seen, rad, where they have several directions.
const LAMP: f32 = 0.13;
/// The same of the fill light.
const FILL: f32 = 0.4;
/// Share of a lamp that shines through bodies: light that goes around within them.
const THROUGH: f32 = 0.04;

impl Lighting {
    /// The key light is over the left shoulder of the viewer, the fill light on the other side, the rim light
    /// behind the subject.
    pub fn new<T>(axes: Axes, casters: Casters<T>, sampling: Sampling) -> Self
    where
        T: Iterator<Item = [Vector3<f32>; 3]> + Clone + Sync,
    {
        let Casters { hair, bodies, triangles, around } = casters;
        let lamp = |right: f32, up: f32, back: f32, colour: [f32; 3]| Lamp {
            direction: axes.vector(Vector3::new(right, up, back)).normalize(),
            colour: colour.into(),
        };
        let lamps = [
            lamp(-0.6, 0.7, 0.6, [1.75, 1.64, 1.48]),
            lamp(0.8, 0.15, 0.65, [0.61, 0.57, 0.55]),
            lamp(0.65, 0.5, -0.6, [0.95, 1.02, 1.15]),
        ];
        let towards = [
            cone(lamps[0].direction, LAMP, sampling.lamp),
            cone(lamps[2].direction, LAMP, sampling.lamp),
            dome(sampling.sky),
        ];
        let depths = |volume: &Volume| {
            let (sky, (key, rim)) = rayon::join(
                || volume.mean_depths(&towards[2]),
                || rayon::join(|| volume.mean_depths(&towards[0]), || volume.mean_depths(&towards[1])),
            );
            [key, rim, sky]
        };
        let (by_hair, by_bodies) = rayon::join(|| depths(&hair), || depths(&bodies));
        let together = std::array::from_fn(|k| by_hair[k].with(&by_bodies[k]));
        let fields = [together, by_hair, by_bodies].map(Fields::new);
        let maps = std::array::from_fn(|k| {
            let reach = if k == 1 { FILL } else { LAMP };
            ShadowMap::new(lamps[k].direction, reach.tan(), around, sampling.map, triangles.clone())
        });
        Lighting { lamps, grid: hair, fields, maps }
    }

    /// The shade of hair and bodies at `p`.
    pub fn shade(&self, p: Vector3<f32>) -> Shade {
        Shade::new(self.grid.at(&self.fields[0], p))
    }

    /// The share of the sky that is seen from `p`.
    pub fn openness(&self, p: Vector3<f32>) -> f32 {
        decay(self.shade(p).sky)
    }

    /// The shade at `p` of a body with normal `n`. Maps tell which lamps it sees past bodies, for cells are
    /// coarser than a face; only the sky is shaded by cells, from above the surface, against shadows of its
    /// own.
    pub fn shade_on_body(&self, p: Vector3<f32>, n: Vector3<f32>) -> Shade {
        let [_, hair, bodies] = &self.fields;
        let [by_hair, above] = [(hair, p), (bodies, p + n * (2.0 * self.grid.cell()))]
            .map(|(fields, p)| Shade::new(self.grid.at(fields, p)));
        let past_bodies = |map: &ShadowMap| -map.light(p, n).max(THROUGH).ln();
        Shade {
            lamps: std::array::from_fn(|k| by_hair.lamps[k] + past_bodies(&self.maps[k])),
            // Half of the sky is below the surface.
            sky: by_hair.sky + 0.5 * above.sky,
        }
    }
}

/// `n` directions, evenly in a cone of half angle `reach` rad around `axis`; the axis for one.
fn cone(axis: Vector3<f32>, reach: f32, n: usize) -> Vec<Vector3<f32>> {
    let right = axis.cross(&Vector3::ith(axis.iamin(), 1.0)).normalize();
    let up = axis.cross(&right);
    let direction = |i: usize| {
        let (s, c) = (GOLDEN * i as f32).sin_cos();
        let out = reach * (i as f32 / n as f32).sqrt();
        (axis + (right * c + up * s) * out).normalize()
    };
    (0..n).map(direction).collect()
}

/// `n` directions, evenly over the sky and a little below the horizon.
fn dome(n: usize) -> Vec<Vector3<f32>> {
    const LOWEST: f32 = -0.3;
    let direction = |i: usize| {
        let y = 1.0 - (1.0 - LOWEST) * (i as f32 + 0.25) / n as f32;
        let (s, c) = (GOLDEN * i as f32).sin_cos();
        let out = (1.0 - y * y).sqrt();
        Vector3::new(out * c, y, out * s)
    };
    (0..n).map(direction).collect()
}
