//! Shadows that bodies cast on bodies: the surfaces nearest to a distant lamp.
//!
//! Penumbrae are as wide as the lamp demands (R. Fernando, "Percentage-closer soft shadows", 2005).

use nalgebra::Vector3;

/// The heights of the surfaces nearest to a distant lamp, on a grid across its direction. Lengths are in
/// texels.
pub struct ShadowMap {
    /// Two unit vectors across the direction of the lamp, and that direction.
    axes: [Vector3<f32>; 3],
    /// Place of the first texel.
    low: [f32; 2],
    texel: f32,
    size: [usize; 2],
    /// Tangent of half the angle at which the lamp is seen.
    spread: f32,
    heights: Vec<f32>,
    /// Places of [`SAMPLES`] in the unit disc.
    discs: [Vec<[f32; 2]>; 2],
}

/// How far above a surface its light is measured: facets must not shade each other, nor themselves.
const RAISED: f32 = 4.0;
/// Least height of what casts a shadow over what it falls on.
const LEAST: f32 = 1.0;
/// Widest penumbra to either side, as a share of the map.
const WIDEST: f32 = 0.03;
/// Least inclination of the ray to a surface for which its slope is compensated.
const LEAST_SINE: f32 = 0.25;
/// Inclination of the ray to a surface from which no light arrives.
const AWAY: f32 = -0.2;
/// Samples that look for what casts a shadow, and that measure its penumbra.
const SAMPLES: [usize; 2] = [16, 32];

impl ShadowMap {
    /// Of `triangles`, over the box from `low` to `high`, with `texels` along its longer side, for a lamp in
    /// the unit direction `lamp` that is seen at twice the angle with the tangent `spread`.
    pub fn new(
        lamp: Vector3<f32>,
        spread: f32,
        [low, high]: [Vector3<f32>; 2],
        texels: usize,
        triangles: impl Iterator<Item = [Vector3<f32>; 3]>,
    ) -> Self {
        let right = lamp.cross(&Vector3::ith(lamp.iamin(), 1.0)).normalize();
        let axes = [right, lamp.cross(&right), lamp];
        let (mut least, mut most) = ([f32::INFINITY; 2], [f32::NEG_INFINITY; 2]);
        for corner in 0..8 {
            let p = Vector3::from_fn(|k, _| if corner >> k & 1 == 1 { high[k] } else { low[k] });
            for k in 0..2 {
                (least[k], most[k]) = (least[k].min(p.dot(&axes[k])), most[k].max(p.dot(&axes[k])));
            }
        }
        let sides = [most[0] - least[0], most[1] - least[1]];
        let texel = (sides[0].max(sides[1]) / texels as f32).max(1e-12);
        let size = sides.map(|side| (side / texel).ceil().max(1.0) as usize);
        let heights = vec![f32::NEG_INFINITY; size[0] * size[1]];
        let discs = SAMPLES.map(disc);
        let mut map = ShadowMap { axes, low: least, texel, size, spread, heights, discs };
        triangles.for_each(|corners| map.add(corners));
        map
    }

    /// Place of a point on the map, and its height.
    fn place(&self, p: Vector3<f32>) -> [f32; 3] {
        let [u, w, h] = self.axes.map(|axis| p.dot(&axis));
        [(u - self.low[0]) / self.texel, (w - self.low[1]) / self.texel, h / self.texel]
    }

    fn add(&mut self, corners: [Vector3<f32>; 3]) {
        let [a, b, c] = corners.map(|p| self.place(p));
        let edges = [[b[0] - a[0], b[1] - a[1]], [c[0] - a[0], c[1] - a[1]]];
        let area = edges[0][0] * edges[1][1] - edges[0][1] * edges[1][0];
        // Also of no finite area.
        if !(area.abs() > 1e-9 && area.is_finite()) {
            return;
        }
        let range = |k: usize| {
            let low = (a[k].min(b[k]).min(c[k]) - 0.5).ceil().max(0.0) as usize;
            let high = (a[k].max(b[k]).max(c[k]) - 0.5).floor().min(self.size[k] as f32 - 1.0);
            low..(high + 1.0).max(0.0) as usize
        };
        for row in range(1) {
            for column in range(0) {
                let from = [column as f32 + 0.5 - a[0], row as f32 + 0.5 - a[1]];
                let to_b = (from[0] * edges[1][1] - from[1] * edges[1][0]) / area;
                let to_c = (edges[0][0] * from[1] - edges[0][1] * from[0]) / area;
                // Rounding shall leave no gap between triangles.
                if to_b.min(to_c).min(1.0 - to_b - to_c) >= -1e-4 {
                    let height = a[2] + to_b * (b[2] - a[2]) + to_c * (c[2] - a[2]);
                    let nearest = &mut self.heights[row * self.size[0] + column];
                    *nearest = nearest.max(height);
                }
            }
        }
    }

    /// The height at the texel with these indices; nothing is outside the map.
    fn height(&self, column: i32, row: i32) -> f32 {
        let (column, row) = (column as usize, row as usize);
        if column < self.size[0] && row < self.size[1] {
            self.heights[row * self.size[0] + column]
        } else {
            f32::NEG_INFINITY
        }
    }

    /// The share of the lamp that is seen from a point of a surface with the unit normal `n`; 0 where it faces
    /// away from it, farther than light goes around the surface of skin.
    pub fn light(&self, p: Vector3<f32>, n: Vector3<f32>) -> f32 {
        let [u, w, h] = self.place(p + n * (RAISED * self.texel));
        // The tangent plane shades no point of itself.
        let [nu, nw, sine] = self.axes.map(|axis| n.dot(&axis));
        if sine < AWAY {
            return 0.0;
        }
        let slope = [nu, nw].map(|n| -n / sine.max(LEAST_SINE));
        let plane = |[du, dw]: [f32; 2]| h + LEAST + slope[0] * du + slope[1] * dw;
        let widest = WIDEST * self.size[0].max(self.size[1]) as f32;
        let (mut over, mut found) = (0.0, 0.0);
        for [du, dw] in self.discs[0].iter().map(|at| at.map(|x| x * widest)) {
            let height = self.height(floor(u + du), floor(w + dw)) - plane([du, dw]);
            if height > 0.0 {
                over += height;
                found += 1.0;
            }
        }
        if found == 0.0 {
            return 1.0;
        }
        let penumbra = (self.spread * over / found).clamp(1.0, widest);
        let mut seen = 0.0;
        for [du, dw] in self.discs[1].iter().map(|at| at.map(|x| x * penumbra)) {
            // Between the centres of four texels.
            let (x, y, above) = (u + du - 0.5, w + dw - 0.5, plane([du, dw]));
            let (column, row) = (floor(x), floor(y));
            let (right, up) = (x - column as f32, y - row as f32);
            let lit = |c: i32, r: i32| if self.height(column + c, row + r) > above { 0.0 } else { 1.0 };
            seen += (lit(0, 0) * (1.0 - right) + lit(1, 0) * right) * (1.0 - up)
                + (lit(0, 1) * (1.0 - right) + lit(1, 1) * right) * up;
        }
        seen / SAMPLES[1] as f32
    }
}

/// The whole number below. Faster than `f32::floor`, which is a call where the processor is not known to have
/// an instruction for it.
fn floor(x: f32) -> i32 {
    let towards_zero = x as i32;
    towards_zero - i32::from(x < towards_zero as f32)
}

/// The golden angle, rad.
pub const GOLDEN: f32 = 2.399_963_2;

/// `n` points, evenly in the unit disc.
fn disc(n: usize) -> Vec<[f32; 2]> {
    let point = |i: usize| {
        let (s, c) = (GOLDEN * i as f32).sin_cos();
        let out = ((i as f32 + 0.5) / n as f32).sqrt();
        [out * c, out * s]
    };
    (0..n).map(point).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    const FLOOR: f32 = 4.0;

    /// A map of a floor at y = 0, and of a square plate from x = −0.5 to 0.5 at `height` over it, lit from above.
    fn plate(height: f32, spread: f32) -> ShadowMap {
        let square = |half: f32, y: f32| {
            let at = |x: f32, z: f32| Vector3::new(x * half, y, z * half);
            let [a, b, c, d] = [at(-1.0, -1.0), at(1.0, -1.0), at(1.0, 1.0), at(-1.0, 1.0)];
            [[a, b, c], [a, c, d]]
        };
        let triangles = square(0.5 * FLOOR, 0.0).into_iter().chain(square(0.5, height));
        let far = Vector3::repeat(0.5 * FLOOR);
        ShadowMap::new(Vector3::y(), spread, [-far, far], 512, triangles)
    }

    fn on_floor(map: &ShadowMap, x: f32) -> f32 {
        map.light(Vector3::new(x, 0.0, 0.1), Vector3::y())
    }

    #[test]
    fn shadow_is_where_the_lamp_is_hidden_and_as_soft_as_the_lamp_is_large() {
        for spread in [0.05, 0.1] {
            for height in [0.3, 0.8] {
                let map = plate(height, spread);
                assert_eq!((on_floor(&map, 0.0), on_floor(&map, 0.9)), (0.0, 1.0));
                assert!((on_floor(&map, 0.5) - 0.5).abs() < 0.1, "{}", on_floor(&map, 0.5));
                // Light 0.25 and 0.75 of a disc are 0.808 of its radius apart.
                let first = |light: f32| {
                    (0..2000).map(|i| 0.3 + 2e-4 * i as f32).find(|x| on_floor(&map, *x) > light).unwrap()
                };
                let (width, expected) = (first(0.75) - first(0.25), 0.808 * height * spread);
                assert!((width - expected).abs() < 0.012, "{width} instead of {expected}");
            }
        }
    }

    #[test]
    fn what_is_lit_does_not_shade_itself() {
        // A ball of 12 by 24 facets.
        let at = |i: usize, k: usize| {
            let (theta, phi) = (i as f32 * std::f32::consts::PI / 12.0, k as f32 * 0.2618);
            Vector3::new(theta.sin() * phi.cos(), theta.cos(), theta.sin() * phi.sin())
        };
        let facets = |i: usize, k: usize| {
            let [a, b, c, d] = [at(i, k), at(i + 1, k), at(i + 1, k + 1), at(i, k + 1)];
            [[a, c, b], [a, d, c]]
        };
        let ball: Vec<_> = (0..12).flat_map(|i| (0..24).flat_map(move |k| facets(i, k))).collect();
        let far = Vector3::repeat(1.0);
        let lamp = Vector3::new(0.3, 0.8, 0.5).normalize();
        let map = ShadowMap::new(lamp, 0.1, [-far, far], 512, ball.iter().copied());
        let light = |[a, b, c]: [Vector3<f32>; 3]| {
            let middle = (a + b + c) / 3.0;
            (middle.normalize().dot(&lamp), map.light(middle, middle.normalize()))
        };
        for (sine, light) in ball.iter().map(|t| light(*t)) {
            assert!(sine < 0.2 || light > 0.98, "{sine}: {light}");
            assert!(sine > -0.5 || light < 0.02, "{sine}: {light}");
        }
    }

    #[test]
    fn nothing_and_nonsense_cast_no_shadow() {
        let bad = [Vector3::repeat(f32::NAN), Vector3::zeros(), Vector3::repeat(f32::INFINITY)];
        let box_of = [Vector3::zeros(); 2];
        for triangles in [vec![], vec![bad], vec![[Vector3::zeros(); 3]]] {
            let map = ShadowMap::new(Vector3::z(), 0.1, box_of, 64, triangles.into_iter());
            assert_eq!(map.light(Vector3::zeros(), Vector3::z()), 1.0);
        }
    }
}
