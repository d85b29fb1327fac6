//! One picture: lighting of curves and meshes.

use nalgebra::Vector3;
use rayon::prelude::*;

use super::camera::{Axes, Camera};
use super::light::{Fields, Rgb, Volume, decay, deepened, scatter};
use super::raster::{self, Ribbon, Triangle};
use super::strand::{self, Piece};
use crate::cache::{Basis, CurveSet};
use crate::math::random;
use crate::report::picture::Image;
use crate::report::space::finite_box;

/// Style of a set of curves.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Style {
    /// Hair with its true width.
    Hair,
    /// Flat colours by group, with a visible minimum width.
    Guides,
}

/// Curves to draw, in picture space.
pub struct DrawnCurves<'a> {
    /// Their constant part.
    pub set: &'a CurveSet,
    /// Their basis.
    pub basis: Basis,
    /// Their points.
    pub points: Vec<Vector3<f32>>,
    /// Their style.
    pub style: Style,
    /// Level of each curve, if colours show it.
    pub level: Option<&'a [i32]>,
    /// Crowding at each point, if colours show it.
    pub crowding: Option<Vec<f32>>,
    /// Factor on all widths.
    pub width_scale: f32,
}

/// A collider to draw, in picture space.
pub struct DrawnMesh<'a> {
    /// Vertices.
    pub points: Vec<Vector3<f32>>,
    /// Vertex indices of each triangle, all valid.
    pub triangles: &'a [[i32; 3]],
}

/// Cells along the longest side of the shading volume.
const CELLS: usize = 88;
/// Optical depth of the surface of a mesh: dark with soft shadow edges.
const SOLID: f32 = 3.0;
/// Fraction of the extinction that darkens: forward-scattered light continues through hair of this colour.
const GAIN: f32 = 0.55;

/// Draws one picture of `size` pixels, supersampled `fine` times; `camera` projects to fine pixels.
pub fn draw(
    camera: &Camera,
    size: (u32, u32),
    fine: u32,
    strands: &[DrawnCurves],
    meshes: &[DrawnMesh],
) -> Image {
    let cut: Vec<Vec<Piece>> =
        strands.iter().map(|s| strand::pieces(s.set, s.basis, &s.points, camera, fine as f32)).collect();
    let light = Lighting::new(camera.axes, strands, &cut, meshes);
    let mut ribbons: Vec<Ribbon> = Vec::new();
    for (s, pieces) in strands.iter().zip(&cut) {
        let looks: Vec<Look> = s.set.id.iter().map(|id| Look::own(*id)).collect();
        ribbons.par_extend(pieces.par_iter().map(|p| ribbon(s, &looks, p, camera, fine, &light)));
    }
    let triangles: Vec<Triangle> = meshes.iter().flat_map(|m| lit_triangles(m, camera, &light)).collect();
    raster::draw(size, fine, backdrop, &triangles, &ribbons)
}

struct Light {
    direction: Vector3<f32>,
    colour: Rgb,
}

struct Lighting {
    volume: Volume,
    lights: [Light; 2],
    /// Optical depths towards the lights, and the visibility of the sky.
    fields: Fields<3>,
}

impl Lighting {
    /// A key light over the left shoulder of the viewer, a cooler rim light from behind on the right, and a
    /// sky.
    fn new(axes: Axes, strands: &[DrawnCurves], cut: &[Vec<Piece>], meshes: &[DrawnMesh]) -> Self {
        let [low, high] = finite_box(strands.iter().flat_map(|s| &s.points)).unwrap_or_default();
        let mut volume = Volume::new(low, high, CELLS);
        for (s, pieces) in strands.iter().zip(cut) {
            for p in pieces {
                volume.add((p.from + p.to) * 0.5, (p.to - p.from).norm() * p.width * s.width_scale);
            }
        }
        for mesh in meshes {
            for t in mesh.triangles {
                block(&mut volume, t.map(|i| mesh.points[i as usize]));
            }
        }
        let lamp = |right: f32, up: f32, back: f32, colour: [f32; 3]| Light {
            direction: axes.vector(Vector3::new(right, up, back)).normalize(),
            colour: colour.into(),
        };
        let lights = [lamp(-0.6, 0.7, 0.6, [1.9, 1.8, 1.66]), lamp(0.65, 0.5, -0.6, [0.9, 1.0, 1.15])];
        let up = Vector3::y();
        let mut sky = vec![up];
        sky.extend((0..6).map(|k| {
            let (s, c) = (std::f32::consts::FRAC_PI_3 * k as f32).sin_cos();
            Vector3::new(c, if k % 2 == 0 { 0.6 } else { -0.1 }, s).normalize()
        }));
        let [key, rim] = [0, 1].map(|i| lights[i].direction);
        let (sky, (key, rim)) = rayon::join(
            || volume.openness(&sky, GAIN),
            || rayon::join(|| volume.depths(key), || volume.depths(rim)),
        );
        Lighting { fields: Fields::new([key, rim, sky]), volume, lights }
    }

    /// Light arriving at `p`: direction and colour from each lamp, and colour from the sky.
    fn arriving(&self, p: Vector3<f32>) -> ([(Vector3<f32>, Rgb); 2], Rgb) {
        let [key, rim, sky] = self.volume.at(&self.fields, p);
        let lamp = |light: &Light, depth: f32| (light.direction, light.colour * decay(GAIN * depth));
        let lamps = [lamp(&self.lights[0], key), lamp(&self.lights[1], rim)];
        (lamps, Rgb::new(0.52, 0.56, 0.62) * sky)
    }
}

/// Adds a triangle to the extinction of the cells that it crosses.
fn block(volume: &mut Volume, [a, b, c]: [Vector3<f32>; 3]) {
    let (u, v) = (b - a, c - a);
    let longest = u.norm().max(v.norm()).max((c - b).norm());
    // Far larger triangles are floors and walls, whose shadows are unimportant.
    let n = (longest / volume.cell()).ceil().clamp(1.0, 128.0) as usize;
    let area = 0.5 * u.cross(&v).norm() / (n * n) as f32;
    for i in 0..n {
        for j in 0..n {
            // Centroids of the n² equal subtriangles: the upright ones, then the inverted ones by reflection.
            let (s, t) = ((i as f32 + 1.0 / 3.0) / n as f32, (j as f32 + 1.0 / 3.0) / n as f32);
            let (s, t) = if i + j < n { (s, t) } else { (1.0 - t, 1.0 - s) };
            volume.add(a + u * s + v * t, SOLID * area);
        }
    }
}

fn ribbon(
    strands: &DrawnCurves,
    looks: &[Look],
    p: &Piece,
    camera: &Camera,
    fine: u32,
    light: &Lighting,
) -> Ribbon {
    let curve = p.curve as usize;
    let middle = (p.from + p.to) * 0.5;
    let level = || strands.level.map(|level| level_colour(level[curve]));
    let crowding = || {
        let crowding = strands.crowding.as_ref()?;
        let (before, beyond) = (p.place as usize, p.place.fract());
        let next = (before + 1).min(crowding.len() - 1);
        Some(crowding_colour(crowding[before] * (1.0 - beyond) + crowding[next] * beyond))
    };
    let shown = level().or_else(crowding);
    let colour = match strands.style {
        Style::Hair => {
            let tangent = (p.to - p.from).try_normalize(0.0).unwrap_or_else(Vector3::zeros);
            let viewer = (camera.eye - middle).normalize();
            let Look { tints, tilt } = match shown {
                None => looks[curve],
                Some(colour) => Look { tints: [colour * 0.5, deepened(colour * 0.5)], ..looks[curve] },
            };
            let (lamps, sky) = light.arriving(middle);
            let lit = lamps.map(|(l, c)| scatter(tangent, l, viewer, tints, tilt).component_mul(&c));
            lit[0] + lit[1] + tints[0].component_mul(&sky)
        }
        Style::Guides => {
            let group = || group_colour(strands.set.group.get(curve).copied().unwrap_or(0));
            let colour = shown.unwrap_or_else(group);
            let [.., sky] = light.volume.at(&light.fields, middle);
            colour * (0.4 + 0.6 * sky)
        }
    };
    let scale = camera.focal * 0.5 * (p.ends[0].inverse_depth + p.ends[1].inverse_depth);
    let seen = p.width * strands.width_scale * scale;
    let width = match strands.style {
        Style::Hair => seen,
        Style::Guides => seen.max(1.3 * fine as f32),
    };
    Ribbon { ends: p.ends, width, colour }
}

/// How a strand scatters light.
#[derive(Debug, Clone, Copy)]
struct Look {
    /// Its colour after the light's first and second way through it.
    tints: [Rgb; 2],
    /// Tilt of its highlights, rad.
    tilt: f32,
}

impl Look {
    /// Chestnut, with variation between strands.
    fn own(id: i32) -> Self {
        let [a, b, c] = noise(id as u32);
        let tint = Rgb::new(0.165, 0.083, 0.044).lerp(&Rgb::new(0.085, 0.04, 0.022), a) * (0.75 + 0.5 * b);
        Look { tints: [tint, deepened(tint)], tilt: 0.09 * (c - 0.5) }
    }
}

/// A hue for each group, spaced by the golden ratio.
fn group_colour(group: i32) -> Rgb {
    colour((f64::from(group) * 0.618_033_988_749_895).rem_euclid(1.0) as f32)
}

/// Blue for coarse wisps, warmer colours for finer ones.
fn level_colour(level: i32) -> Rgb {
    colour(0.6 * 0.55_f32.powi(level.max(0)) - if level > 0 { 0.16 } else { 0.0 })
}

/// Blue for loose hair, green for hair as dense as the densest of the groom, yellow at 1.5 times and red from
/// twice that.
fn crowding_colour(crowding: f32) -> Rgb {
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

/// Triangles of a mesh in neutral clay, softly lit at the vertices.
fn lit_triangles(mesh: &DrawnMesh, camera: &Camera, light: &Lighting) -> Vec<Triangle> {
    let clay = Rgb::new(0.40, 0.335, 0.30);
    let mut normals = vec![Vector3::zeros(); mesh.points.len()];
    for t in mesh.triangles {
        let [a, b, c] = t.map(|i| mesh.points[i as usize]);
        t.iter().for_each(|i| normals[*i as usize] += (b - a).cross(&(c - a)));
    }
    let colour = |(p, n): (&Vector3<f32>, &Vector3<f32>)| {
        let n = n.try_normalize(0.0).unwrap_or_else(Vector3::zeros);
        // Offset from the surface against self-shadowing.
        let (lamps, sky) = light.arriving(p + n * (2.0 * light.volume.cell()));
        let lit = lamps.map(|(l, c)| c * (0.25 + 0.75 * n.dot(&l)).max(0.0) * 0.6);
        (lit[0] + lit[1] + sky).component_mul(&clay)
    };
    let colours: Vec<Rgb> = mesh.points.par_iter().zip(&normals).map(colour).collect();
    let seen: Vec<_> = mesh.points.iter().map(|p| camera.project(*p)).collect();
    let triangle = |t: &[i32; 3]| {
        let [a, b, c] = t.map(|i| i as usize);
        Some(Triangle {
            corners: [seen[a]?, seen[b]?, seen[c]?],
            colours: [colours[a], colours[b], colours[c]],
        })
    };
    mesh.triangles.iter().filter_map(triangle).collect()
}

/// A neutral grey gradient, lighter at the top and in the middle.
fn backdrop(u: f32, v: f32) -> Rgb {
    let fall = 1.0 - 0.5 * ((u - 0.5).powi(2) + (v - 0.45).powi(2));
    Rgb::new(0.40, 0.43, 0.47).lerp(&Rgb::new(0.21, 0.225, 0.25), v) * fall
}
