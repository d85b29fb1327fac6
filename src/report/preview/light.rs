//! Lighting of hair: scattering by a fibre, and a volume of optical depths for shadows.
//!
//! | symbol | meaning |
//! |---|---|
//! | t | fibre tangent, from root to tip |
//! | l, v | unit directions to the light and to the viewer |
//! | θi, θr | inclination of l and v to the fibre's normal plane, positive towards the tip |
//! | θh, θd | half sum and half difference of θi and θr |
//! | φ | angle between l and v seen along the fibre |
//! | σ | extinction, 1/scene unit |
//! | τ | optical depth |

use nalgebra::Vector3;
use std::ops::Range;

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
    let reflected = 0.14 * lobe(ALPHA, BETA) * toward.sqrt();
    let twice_through = 0.75 * lobe(-1.5 * ALPHA, 2.0 * BETA) * toward * toward;
    let through = 1.3 * lobe(-0.5 * ALPHA, BETA) * (1.0 - toward).powi(8);
    // cos² of half a difference.
    let cos2_d = 0.5 * (1.0 + cos_i * (1.0 - sin_r * sin_r).sqrt() + sin_i * sin_r);
    let shape = cos_i / cos2_d.max(0.2);
    let body = tint * (0.75 * cos_i);
    body + (Rgb::repeat(reflected) + deep * (twice_through + through)) * shape
}

/// The colour of light that passed the pigment of a fibre of colour `tint` twice.
pub fn deepened(tint: Rgb) -> Rgb {
    tint.map(|c| c.powf(0.9))
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

/// Extinction on a grid of cubic cells.
pub struct Volume {
    origin: Vector3<f32>,
    cell: f32,
    size: [usize; 3],
    sigma: Vec<f32>,
}

/// Optical depth towards one direction, at the cell centres of a [`Volume`].
pub struct Depths(Vec<f32>);

/// Several quantities at the cell centres of a [`Volume`], side by side.
pub struct Fields<const N: usize>(Vec<[f32; N]>);

impl<const N: usize> Fields<N> {
    /// Puts quantities side by side.
    pub fn new(each: [Depths; N]) -> Self {
        let cells = each.first().map_or(0, |depths| depths.0.len());
        Fields((0..cells).map(|i| std::array::from_fn(|k| each[k].0[i])).collect())
    }
}

/// Of a row of `n` cells, those whose neighbours `shift` cells away are in the row, and these neighbours.
fn overlap(n: usize, shift: isize) -> [Range<usize>; 2] {
    let first = (-shift).clamp(0, n as isize) as usize;
    let end = (n as isize - shift).clamp(first as isize, n as isize) as usize;
    let moved = |i: usize| (i as isize + shift).clamp(0, n as isize) as usize;
    [first..end, moved(first)..moved(end)]
}

impl Volume {
    /// An empty volume over the box from `low` to `high` with `cells` cells along its longest side.
    pub fn new(low: Vector3<f32>, high: Vector3<f32>, cells: usize) -> Self {
        let cell = ((high - low).max() / cells as f32).max(f32::MIN_POSITIVE);
        let size = std::array::from_fn(|k| ((high[k] - low[k]) / cell).ceil().max(1.0) as usize + 2);
        Volume { origin: low - Vector3::repeat(cell), cell, size, sigma: vec![0.0; size.iter().product()] }
    }

    /// Side of a cell.
    pub fn cell(&self) -> f32 {
        self.cell
    }

    /// Adds an occluder with cross section `shadow` at `p`; ignored outside the box.
    pub fn add(&mut self, p: Vector3<f32>, shadow: f32) {
        let c = (p - self.origin) / self.cell;
        if (0..3).all(|k| c[k] >= 0.0 && c[k] < self.size[k] as f32) {
            let i = self.index(c.x as usize, c.y as usize, c.z as usize);
            self.sigma[i] += shadow / self.cell.powi(3);
        }
    }

    /// Optical depth from every cell towards a distant light in direction `l`, by a sweep over slices from
    /// the side of the light: τ(p) = τ(p + d) + σ(p + d) |d| with d along `l` to the next slice. A cell does
    /// not shade itself.
    pub fn depths(&self, l: Vector3<f32>) -> Depths {
        let main = l.iamax();
        let (u, w) = ((main + 1) % 3, (main + 2) % 3);
        let step = l / l[main].abs();
        let length = self.cell * step.norm();
        // Where a cell's light comes from in the slice before, relative to the cell: the same for all cells.
        let shift = [step[u].floor(), step[w].floor()];
        let [fu, fw] = [step[u] - shift[0], step[w] - shift[1]];
        let [shift_u, shift_w] = shift.map(|x| x as isize);
        let corners = [
            (0, 0, (1.0 - fu) * (1.0 - fw)),
            (1, 0, fu * (1.0 - fw)),
            (0, 1, (1.0 - fu) * fw),
            (1, 1, fu * fw),
        ];
        let mut tau = vec![0.0f32; self.sigma.len()];
        let (n, nu, nw) = (self.size[main], self.size[u], self.size[w]);
        let strides = [1, self.size[0], self.size[0] * self.size[1]];
        // One slice of depths beyond its cells, and the next one's depths, without gaps.
        let mut beyond = vec![0.0f32; nu * nw];
        let mut next = vec![0.0f32; nu * nw];
        for s in 1..n {
            let (slice, source) = if l[main] > 0.0 { (n - 1 - s, n - s) } else { (s, s - 1) };
            for (b, row) in beyond.chunks_exact_mut(nu).enumerate() {
                let start = source * strides[main] + b * strides[w];
                for (a, value) in row.iter_mut().enumerate() {
                    let k = start + a * strides[u];
                    *value = tau[k] + self.sigma[k] * length;
                }
            }
            next.fill(0.0);
            for (du, dw, weight) in corners {
                let [cells, lit] = overlap(nu, shift_u + du);
                let [rows, lit_rows] = overlap(nw, shift_w + dw);
                for (row, from) in rows.zip(lit_rows) {
                    let values = &beyond[from * nu..][lit.clone()];
                    for (sum, value) in next[row * nu..][cells.clone()].iter_mut().zip(values) {
                        *sum += weight * value;
                    }
                }
            }
            for (b, row) in next.chunks_exact(nu).enumerate() {
                let start = slice * strides[main] + b * strides[w];
                row.iter().enumerate().for_each(|(a, value)| tau[start + a * strides[u]] = *value);
            }
        }
        Depths(tau)
    }

    /// Mean over `directions` of the transmittance to each cell, exp(−`gain`·τ).
    pub fn openness(&self, directions: &[Vector3<f32>], gain: f32) -> Depths {
        let mut mean = vec![0.0f32; self.sigma.len()];
        for l in directions {
            for (sum, depth) in mean.iter_mut().zip(&self.depths(*l).0) {
                *sum += decay(gain * depth);
            }
        }
        mean.iter_mut().for_each(|sum| *sum /= directions.len() as f32);
        Depths(mean)
    }

    /// Trilinear interpolation of `fields` at `p`, clamped to the grid.
    pub fn at<const N: usize>(&self, fields: &Fields<N>, p: Vector3<f32>) -> [f32; N] {
        let c = (p - self.origin) / self.cell - Vector3::repeat(0.5);
        let mut base = [0; 3];
        let mut f = [0.0; 3];
        for k in 0..3 {
            let x = c[k].clamp(0.0, (self.size[k] - 2) as f32 + 0.999);
            base[k] = x as usize;
            f[k] = x - base[k] as f32;
        }
        let mut sum = [0.0; N];
        for corner in 0..8 {
            let bit = |k: usize| corner >> k & 1;
            let part = |k: usize| if bit(k) == 1 { f[k] } else { 1.0 - f[k] };
            let weight = part(0) * part(1) * part(2);
            let values = &fields.0[self.index(base[0] + bit(0), base[1] + bit(1), base[2] + bit(2))];
            sum.iter_mut().zip(values).for_each(|(sum, value)| *sum += weight * value);
        }
        sum
    }

    fn index(&self, x: usize, y: usize, z: usize) -> usize {
        x + self.size[0] * (y + self.size[1] * z)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;

    /// The shadow of a slab has its optical depth, also at an angle.
    #[test]
    fn slab_has_its_optical_depth() {
        let mut volume = Volume::new(Vector3::zeros(), Vector3::repeat(1.0), 40);
        let tau = 0.8;
        let spacing = 0.0125;
        for i in 0..80 {
            for j in 0..80 {
                let p = Vector3::new((i as f32 + 0.5) * spacing, 0.6, (j as f32 + 0.5) * spacing);
                volume.add(p, tau * spacing * spacing);
            }
        }
        for (l, expected) in [(Vector3::y(), tau), (Vector3::new(0.6, 0.8, 0.0), tau / 0.8)] {
            let depths = Fields::new([volume.depths(l), volume.depths(-l)]);
            let [behind, turned] = volume.at(&depths, Vector3::new(0.5, 0.3, 0.5));
            assert_relative_eq!(behind, expected, max_relative = 0.02);
            assert_eq!(turned, 0.0, "in front of the slab for a light from below");
            assert_eq!(volume.at(&depths, Vector3::new(0.5, 0.9, 0.5))[0], 0.0, "in front of the slab");
        }
    }

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
