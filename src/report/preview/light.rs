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
use rayon::prelude::*;

/// Linear red, green, blue.
pub type Rgb = Vector3<f32>;

/// Light scattered from `l` to `v` by a fibre of colour `tint`, relative to the light's colour: the three
/// lobes of Marschner et al. (2003, eq. 8) with Gaussians in θh and simple profiles in φ, plus the diffuse
/// term of Kajiya & Kay (1989, eq. 14). `tilt`, rad, rotates all lobes.
pub fn scatter(t: Vector3<f32>, l: Vector3<f32>, v: Vector3<f32>, tint: Rgb, tilt: f32) -> Rgb {
    // Cuticle tilt and roughness of human hair (Marschner et al. 2003, table 1), rad.
    const ALPHA: f32 = -0.105;
    const BETA: f32 = 0.14;
    let (sin_i, sin_r) = (t.dot(&l).clamp(-1.0, 1.0), t.dot(&v).clamp(-1.0, 1.0));
    let (theta_i, theta_r) = (sin_i.asin(), sin_r.asin());
    let (theta_h, theta_d) = (0.5 * (theta_i + theta_r), 0.5 * (theta_r - theta_i));
    let (across_l, across_v) = (l - t * sin_i, v - t * sin_r);
    let cos_phi = across_l.dot(&across_v) / (across_l.norm() * across_v.norm()).max(1e-6);
    let toward = 0.5 * (1.0 + cos_phi).clamp(0.0, 2.0);
    let lobe = |alpha: f32, beta: f32| (-0.5 * ((theta_h - alpha - tilt) / beta).powi(2)).exp();
    let cos_i = theta_i.cos();
    let reflected = 0.14 * lobe(ALPHA, BETA) * toward.sqrt();
    let twice_through = 0.75 * lobe(-1.5 * ALPHA, 2.0 * BETA) * toward * toward;
    let through = 1.3 * lobe(-0.5 * ALPHA, BETA) * (1.0 - toward).powi(8);
    let shape = cos_i / theta_d.cos().powi(2).max(0.2);
    let body = tint * (0.75 * cos_i);
    // The second highlight passes the pigment twice.
    let deep = tint.map(|c| c.powf(0.9));
    body + (Rgb::repeat(reflected) + deep * (twice_through + through)) * shape
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
        let mut tau = vec![0.0f32; self.sigma.len()];
        let n = self.size[main];
        let strides = [1, self.size[0], self.size[0] * self.size[1]];
        for s in 1..n {
            let (slice, source) = if l[main] > 0.0 { (n - 1 - s, n - s) } else { (s, s - 1) };
            for b in 0..self.size[w] {
                for a in 0..self.size[u] {
                    let (x, y) = (a as f32 + step[u], b as f32 + step[w]);
                    let (x0, y0) = (x.floor(), y.floor());
                    let (fx, fy) = (x - x0, y - y0);
                    let mut sum = 0.0;
                    for (dx, dy, weight) in [
                        (0, 0, (1.0 - fx) * (1.0 - fy)),
                        (1, 0, fx * (1.0 - fy)),
                        (0, 1, (1.0 - fx) * fy),
                        (1, 1, fx * fy),
                    ] {
                        let (i, j) = (x0 as isize + dx, y0 as isize + dy);
                        if i >= 0 && j >= 0 && (i as usize) < self.size[u] && (j as usize) < self.size[w] {
                            let k =
                                source * strides[main] + i as usize * strides[u] + j as usize * strides[w];
                            sum += weight * (tau[k] + self.sigma[k] * length);
                        }
                    }
                    tau[slice * strides[main] + a * strides[u] + b * strides[w]] = sum;
                }
            }
        }
        Depths(tau)
    }

    /// Mean over `directions` of the transmittance to each cell, exp(−`gain`·τ).
    pub fn openness(&self, directions: &[Vector3<f32>], gain: f32) -> Depths {
        let each: Vec<Depths> = directions.par_iter().map(|l| self.depths(*l)).collect();
        let mean = |i: usize| each.iter().map(|d| (-gain * d.0[i]).exp()).sum::<f32>() / each.len() as f32;
        Depths((0..self.sigma.len()).into_par_iter().map(mean).collect())
    }

    /// Trilinear interpolation of `field` at `p`, clamped to the grid.
    pub fn at(&self, field: &Depths, p: Vector3<f32>) -> f32 {
        let c = (p - self.origin) / self.cell - Vector3::repeat(0.5);
        let mut base = [0; 3];
        let mut f = [0.0; 3];
        for k in 0..3 {
            let x = c[k].clamp(0.0, (self.size[k] - 2) as f32 + 0.999);
            base[k] = x as usize;
            f[k] = x - base[k] as f32;
        }
        let mut sum = 0.0;
        for corner in 0..8 {
            let bit = |k: usize| corner >> k & 1;
            let weight: f32 = (0..3).map(|k| if bit(k) == 1 { f[k] } else { 1.0 - f[k] }).product();
            sum += weight * field.0[self.index(base[0] + bit(0), base[1] + bit(1), base[2] + bit(2))];
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
            let depths = volume.depths(l);
            assert_relative_eq!(
                volume.at(&depths, Vector3::new(0.5, 0.3, 0.5)),
                expected,
                max_relative = 0.02
            );
            assert_eq!(volume.at(&depths, Vector3::new(0.5, 0.9, 0.5)), 0.0, "in front of the slab");
        }
        assert_eq!(volume.at(&volume.depths(-Vector3::y()), Vector3::new(0.5, 0.3, 0.5)), 0.0);
    }

    #[test]
    fn white_highlight_shifts_towards_the_root() {
        let t = Vector3::x();
        let at = |degrees: f32| {
            let (s, c) = degrees.to_radians().sin_cos();
            scatter(t, Vector3::y(), Vector3::new(s, c, 0.0), Rgb::zeros(), 0.0).x
        };
        let best = (-40..=40).max_by(|a, b| at(*a as f32).total_cmp(&at(*b as f32))).unwrap();
        assert!((-16..=-8).contains(&best), "peak of R at {best}°, twice the tilt of −6°");
    }
}
