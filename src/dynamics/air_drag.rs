//! Air drag (`docs/theory.md` §4.2): wind with gusts, and the shielding of strands inside the hair volume.
//!
//! The coefficient of each point of a rod is constant: it follows from the groom when `dynamics::model` is
//! built. The velocity of the air is evaluated in every step.

use crate::math::random;
use crate::scene::anim::Wind;
use crate::scene::groom::Material;
use nalgebra::Vector3;
use std::collections::BTreeMap;

/// Drag per length and speed c of one isolated hair across the flow, N·s/m²: 0.91 · 4πμ, with the viscosity
/// μ = 1.81e-5 Pa·s of air at 20 °C. The drag coefficient 2c/(μ Re) of a cylinder is then 4.6 at Re = 5, a
/// hair at 1 m/s; measured: about 4 (Tritton 1959). The logarithmic dependence on Re is neglected.
pub const ISOLATED_DRAG: f64 = 2.07e-4;

/// Length of hair per volume at which half of the drag is lost, m/m³: hairs 3 mm apart. A closure, chosen
/// rather than measured.
const HALF_SHIELDING_DENSITY: f64 = 1e5;

/// Cell size of the density grid, m.
const CELL: f64 = 0.01;

/// Length of hair per volume, m/m³, in the pose of the groom (rest space), on a grid.
#[derive(Debug, Clone, Default)]
pub struct HairDensity {
    /// By the indices of the cell; cells without hair are absent.
    cells: BTreeMap<[i64; 3], f64>,
}

impl HairDensity {
    /// Of polylines, m, rest space, each with the number of hairs that it represents. Each segment is cut
    /// into parts no longer than a cell, and the length of a part is shared among the cells around its
    /// midpoint.
    pub fn new<'a>(polylines: impl Iterator<Item = (&'a [Vector3<f64>], f64)>) -> Self {
        let mut density = HairDensity::default();
        for (points, hairs) in polylines {
            for w in points.windows(2) {
                let length = (w[1] - w[0]).norm();
                let parts = (length / CELL).ceil();
                let share = length / parts * hairs / (CELL * CELL * CELL);
                for i in 0..parts as usize {
                    for (cell, part) in corners(&w[0].lerp(&w[1], (i as f64 + 0.5) / parts)) {
                        *density.cells.entry(cell).or_default() += share * part;
                    }
                }
            }
        }
        density
    }

    /// Share (0..1) of the drag in free air that is lost at point `p`, m, rest space.
    pub fn shielding(&self, p: &Vector3<f64>) -> f64 {
        let length: f64 = corners(p)
            .map(|(cell, part)| part * self.cells.get(&cell).copied().unwrap_or(0.0))
            .into_iter()
            .sum();
        shielded_share(length)
    }

    /// Mean over all hair, m/m³; 0 without hair.
    pub fn mean(&self) -> f64 {
        let [length, square] = self.cells.values().fold([0.0, 0.0], |[a, b], l| [a + l, b + l * l]);
        if length > 0.0 { square / length } else { 0.0 }
    }
}

/// Share (0..1) of the drag in free air that is lost among hair of `density`, m/m³.
pub fn shielded_share(density: f64) -> f64 {
    density / (density + HALF_SHIELDING_DENSITY)
}

/// The eight cells around a point and their trilinear weights.
fn corners(p: &Vector3<f64>) -> [([i64; 3], f64); 8] {
    let u = p / CELL;
    let base = u.map(f64::floor);
    let f = u - base;
    std::array::from_fn(|i| {
        let bit = |c: usize| (i >> c) & 1;
        let part = |c: usize| if bit(c) == 1 { f[c] } else { 1.0 - f[c] };
        (std::array::from_fn(|c| base[c] as i64 + bit(c) as i64), part(0) * part(1) * part(2))
    })
}

/// Velocity of the air, m/s, at point `x` of the world, m, at time `t`, s.
pub fn velocity(wind: &[Wind], x: &Vector3<f64>, t: f64) -> Vector3<f64> {
    wind.iter().map(|w| w.velocity.at(t) + gust(w, x, t)).sum()
}

/// Velocity of the gusts, m/s, at point `x` of the world, m, at time `t`, s: a sum of random plane waves
/// (Kraichnan 1970), divergence-free because each oscillates across its direction. Wavelengths are half to
/// twice the gust length; the mean square is that of the gust speed.
fn gust(wind: &Wind, x: &Vector3<f64>, t: f64) -> Vector3<f64> {
    const WAVES: u32 = 12;
    if wind.gust_speed == 0.0 {
        return Vector3::zeros();
    }
    let k0 = std::f64::consts::TAU / wind.gust_length;
    let mean = wind.velocity.at(t);
    // The mean wind carries the waves (Taylor 1938); besides, each turns over at its own rate.
    let carried = x - mean * t;
    let mut sum = Vector3::zeros();
    for i in 0..WAVES {
        // Each wave has eight random numbers, and uses seven.
        let draw = |j: u32| unit_draw(wind.seed, i * 8 + j);
        // The unit vector of two numbers, uniform on the sphere.
        let sphere = |a: f64, b: f64| {
            let (z, phi) = (2.0 * a - 1.0, std::f64::consts::TAU * b);
            let r = (1.0 - z * z).max(0.0).sqrt();
            Vector3::new(r * phi.cos(), r * phi.sin(), z)
        };
        let direction = sphere(draw(0), draw(1));
        let k = direction * (k0 * (0.5 + 1.5 * draw(2)));
        let across = direction.cross(&sphere(draw(3), draw(4)));
        let phase = k.dot(&carried) + wind.gust_speed * k0 * t * draw(5) + std::f64::consts::TAU * draw(6);
        sum += across * phase.cos();
    }
    // ⟨|direction × u|²⟩ = 2/3 for a random unit vector u, and ⟨cos²⟩ = 1/2: the sum's mean square is
    // WAVES/3.
    sum * (wind.gust_speed * (3.0 / f64::from(WAVES)).sqrt())
}

/// Random number `index` of a seed, in 0..1.
fn unit_draw(seed: u32, index: u32) -> f64 {
    random::unit(u64::from(seed) << 32 | u64::from(index), 0)
}

/// Drag per length and speed, N·s/m², of a strand of material `m` across the flow at point `p`, m, rest
/// space.
pub fn coefficient(m: &Material, density: &HairDensity, p: &Vector3<f64>) -> f64 {
    ISOLATED_DRAG * m.drag * (1.0 - m.shielding * density.shielding(p))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::anim::Keyframes;

    #[test]
    fn gusts_have_the_given_rms_speed_and_zero_mean() {
        let wind = Wind {
            velocity: Keyframes::constant(Vector3::x() * 2.0),
            gust_speed: 1.5,
            gust_length: 0.3,
            seed: 7,
        };
        let n = 40_000_u32;
        let (mut mean, mut square) = (Vector3::zeros(), 0.0);
        for i in 0..n {
            let r = |j| unit_draw(99, i * 4 + j) * 20.0;
            let u = velocity(std::slice::from_ref(&wind), &Vector3::new(r(0), r(1), r(2)), r(3))
                - Vector3::x() * 2.0;
            mean += u / f64::from(n);
            square += u.norm_squared() / f64::from(n);
        }
        assert!(mean.norm() < 0.05, "{mean}");
        assert!((square.sqrt() - 1.5).abs() < 0.3, "{}", square.sqrt());
    }

    #[test]
    fn a_single_strand_is_unshielded_and_a_dense_volume_is_shielded() {
        let line: Vec<_> = (0..20).map(|i| Vector3::new(0.05, 0.01 * f64::from(i), 0.05)).collect();
        let lone = HairDensity::new([(&line[..], 1.0)].into_iter());
        let thick = HairDensity::new([(&line[..], 1000.0)].into_iter());
        assert!(lone.shielding(&line[5]) < 0.1);
        assert!(thick.shielding(&line[5]) > 0.9);
        assert_eq!(thick.shielding(&Vector3::new(1.0, 1.0, 1.0)), 0.0);
    }
}
