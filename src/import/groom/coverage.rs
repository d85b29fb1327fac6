//! Drawn width of strands that stand for more hairs than there are strands.

use nalgebra::Vector3;

/// Diameter of a hair, m.
const HAIR: f64 = 8e-5;

/// Hairs per area of a scalp, 1/m²: 100,000 on 600 cm².
const SCALP_DENSITY: f64 = 1e5 / 0.06;

/// Largest width, m.
const MAX_WIDTH: f64 = 1e-3;

/// Width at the tip over that at the root.
const TIP: f64 = 0.3;

/// Number of a root's neighbours that its density is taken from.
const NEIGHBOURS: usize = 8;

/// Largest number of roots whose density is measured.
const SAMPLES: usize = 300;

/// Width at root and tip, m, at which strands with these `roots`, m, cover the skin between them as hairs of
/// 80 µm cover a scalp; at least that of a hair and at most 1 mm.
pub fn covering_width(roots: &[Vector3<f64>]) -> [f64; 2] {
    let width = density(roots).map_or(MAX_WIDTH, |density| HAIR * (SCALP_DENSITY / density).sqrt());
    let root = width.clamp(HAIR, MAX_WIDTH);
    [root, TIP * root]
}

/// Roots per area of skin, 1/m²: the median over roots of the density within the circle through their
/// eighth neighbour. `None` for too few roots.
fn density(roots: &[Vector3<f64>]) -> Option<f64> {
    if roots.len() <= NEIGHBOURS {
        return None;
    }
    let density = |root: &Vector3<f64>| {
        let mut squared: Vec<f64> = roots.iter().map(|other| (other - root).norm_squared()).collect();
        // The nearest is the root itself.
        let (_, radius_squared, _) = squared.select_nth_unstable_by(NEIGHBOURS, f64::total_cmp);
        NEIGHBOURS as f64 / (std::f64::consts::PI * *radius_squared)
    };
    let mut each: Vec<f64> = roots.iter().step_by(roots.len().div_ceil(SAMPLES)).map(density).collect();
    let middle = each.len() / 2;
    Some(*each.select_nth_unstable_by(middle, f64::total_cmp).1)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::random;

    /// `count` random roots on a square of `side`, m.
    fn roots(count: u64, side: f64) -> Vec<Vector3<f64>> {
        let along = |i, axis| side * random::unit(axis, i);
        (0..count).map(|i| Vector3::new(along(i, 1), 0.0, along(i, 2))).collect()
    }

    #[test]
    fn the_density_of_random_roots_is_found() {
        for (count, side) in [(2_000, 0.2), (50_000, 1.5)] {
            let expected = count as f64 / (side * side);
            let found = density(&roots(count, side)).unwrap();
            assert!((found / expected - 1.0).abs() < 0.1, "{found} {expected}");
        }
    }

    #[test]
    fn fur_on_a_body_is_wider_than_as_many_hairs_on_a_scalp() {
        let [scalp, body] = [0.245, 1.5].map(|side| covering_width(&roots(50_000, side))[0]);
        assert!((1.0e-4..1.3e-4).contains(&scalp), "{scalp}");
        assert!((body / scalp - 1.5 / 0.245).abs() < 0.4, "{body} {scalp}");
    }

    #[test]
    fn width_is_bounded() {
        assert_eq!(covering_width(&roots(3, 0.1))[0], MAX_WIDTH);
        assert_eq!(covering_width(&vec![Vector3::zeros(); 100])[0], HAIR);
    }
}
