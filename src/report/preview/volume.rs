//! A volume of extinction, and the optical depths through it: shadows of hair and bodies.
//!
//! | symbol | meaning |
//! |---|---|
//! | l | unit direction to the light |
//! | σ | extinction, 1/scene unit |
//! | τ | optical depth |

use nalgebra::Vector3;
use rayon::prelude::*;
use std::ops::Range;

use super::light::decay;

/// Extinction on a grid of cubic cells.
pub struct Volume {
    origin: Vector3<f32>,
    cell: f32,
    size: [usize; 3],
    sigma: Vec<f32>,
}

/// A quantity at the cell centres of a [`Volume`], such as the optical depth towards a light.
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

/// Directions of a task of [`Volume::mean_depths`]: a bound on its memory.
const DIRECTIONS: usize = 8;

impl Depths {
    /// What two occluders do together.
    pub fn with(&self, other: &Depths) -> Depths {
        Depths(self.0.iter().zip(&other.0).map(|(a, b)| a + b).collect())
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
    /// An empty volume over the box from `low` to `high` of about `cells` cells.
    pub fn new(low: Vector3<f32>, high: Vector3<f32>, cells: usize) -> Self {
        let sides = high - low;
        // As if a flat box were thick: it has fewer cells then.
        let thick = sides.map(|side| side.max(0.1 * sides.max()));
        let cell = (thick.product() / cells as f32).cbrt().max(1e-12);
        let size = std::array::from_fn(|k| (sides[k] / cell).ceil().max(1.0) as usize + 2);
        Volume { origin: low - Vector3::repeat(cell), cell, size, sigma: vec![0.0; size.iter().product()] }
    }

    /// An empty volume of the same cells.
    pub fn emptied(&self) -> Self {
        Volume { sigma: vec![0.0; self.sigma.len()], ..*self }
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

    /// Optical depth for light that comes evenly from `directions`: −ln of the mean transmittance.
    pub fn mean_depths(&self, directions: &[Vector3<f32>]) -> Depths {
        if let [l] = directions {
            return self.depths(*l);
        }
        let mut passed = vec![0.0f32; self.sigma.len()];
        for some in directions.chunks(DIRECTIONS) {
            let depths: Vec<Depths> = some.par_iter().map(|l| self.depths(*l)).collect();
            for Depths(depths) in &depths {
                passed.iter_mut().zip(depths).for_each(|(sum, depth)| *sum += decay(*depth));
            }
        }
        let n = directions.len() as f32;
        passed.iter_mut().for_each(|sum| *sum = -(*sum / n).max(f32::MIN_POSITIVE).ln());
        Depths(passed)
    }

    /// A mean over a ball of radius `radius`, nearly: three means over cubes.
    pub fn blurred(&self, radius: f32) -> Depths {
        let reach = (radius / self.cell).round() as usize;
        let mut values = self.sigma.clone();
        let strides = [1, self.size[0], self.size[0] * self.size[1]];
        let mut line = Vec::new();
        for (axis, stride) in strides.into_iter().enumerate() {
            let n = self.size[axis];
            let starts = (0..values.len()).filter(|i| i / stride % n == 0);
            for start in starts {
                for _ in 0..3 {
                    line.clear();
                    line.extend((0..n).map(|k| values[start + k * stride]));
                    let mut sum: f32 = line[..reach.min(n)].iter().sum();
                    for k in 0..n {
                        sum += line.get(k + reach).copied().unwrap_or(0.0);
                        values[start + k * stride] = sum.max(0.0) / (2 * reach + 1) as f32;
                        sum -= if k >= reach { line[k - reach] } else { 0.0 };
                    }
                }
            }
        }
        Depths(values)
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
        let mut volume = Volume::new(Vector3::zeros(), Vector3::repeat(1.0), 40 * 40 * 40);
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
}
