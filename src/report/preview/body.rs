//! Bodies: skin, and the scalp under hair.

use nalgebra::Vector3;

use super::light::{Rgb, decay};
use super::lighting::{Lighting, Shade};
use super::volume::{Fields, Volume};

/// Colour of skin.
const SKIN: Rgb = Rgb::new(0.53, 0.355, 0.27);
/// Colour of planes.
const GROUND: Rgb = Rgb::new(0.25, 0.26, 0.28);
/// Half the width of the border of light and shade on skin, as cosines of the inclination of the light: over
/// a curved surface light spreads within skin, red the farthest (E. Penner, "Pre-integrated skin shading",
/// 2011).
const SPREAD: Rgb = Rgb::new(0.20, 0.12, 0.09);
/// Light of the sky, and what comes back from below.
const SKY: Rgb = Rgb::new(0.44, 0.43, 0.43);
const BELOW: Rgb = Rgb::new(0.21, 0.175, 0.155);

/// A point of a body, as it is seen.
pub struct Surface {
    /// Where it is.
    pub point: Vector3<f32>,
    /// Its unit normal, towards the viewer.
    pub normal: Vector3<f32>,
    /// Unit direction to the viewer.
    pub viewer: Vector3<f32>,
}

/// The light that skin, the ground, or a scalp of this colour sends to the viewer.
pub fn lit(surface: &Surface, colour: Rgb, light: &Lighting) -> Rgb {
    let Surface { point, normal: n, viewer } = surface;
    let Shade { lamps, sky } = light.shade_on_body(*point, *n);
    let mut sum = Rgb::zeros();
    for (lamp, depth) in light.lamps.iter().zip(lamps) {
        let l = lamp.direction;
        let diffuse = SPREAD.map(|spread| spread_cosine(n.dot(&l), spread));
        let half = (l + viewer).try_normalize(0.0).unwrap_or_else(Vector3::zeros);
        // A faint sheen, stronger at grazing angles.
        let grazing = (1.0 - half.dot(viewer)).max(0.0).powi(5);
        let sheen = (0.05 + 0.5 * grazing) * n.dot(&half).max(0.0).powi(14) * n.dot(&l).clamp(0.0, 1.0);
        let arriving = lamp.colour * decay(depth);
        sum += arriving.component_mul(&(colour.component_mul(&diffuse) * 0.72 + Rgb::repeat(sheen)));
    }
    let around = BELOW.lerp(&SKY, 0.5 + 0.5 * n.y) * decay(sky);
    sum + around.component_mul(&colour)
}

/// The part of `cosine` above zero, averaged over `spread` to either side.
fn spread_cosine(cosine: f32, spread: f32) -> f32 {
    let within = (cosine + spread).clamp(0.0, 2.0 * spread);
    within * within / (4.0 * spread) + (cosine - spread).max(0.0)
}

/// How densely hair grows, on a grid around its roots.
pub struct Roots {
    grid: Volume,
    density: Fields<1>,
    /// Median of the density at the roots.
    median: f32,
    /// Colour of the scalp under dense hair.
    colour: Rgb,
}

/// Cells of the grid of roots.
const CELLS: usize = 250_000;
/// Most roots of which neighbours are sought.
const PROBES: usize = 128;
/// The neighbour that tells how far roots are apart: beyond the tufts in which strands often grow.
const NEIGHBOUR: usize = 16;

impl Roots {
    /// Of the roots of hair whose mean colour is `hair`; `None` for less than two places.
    pub fn new(roots: &[Vector3<f32>], hair: Rgb) -> Option<Self> {
        let finite: Vec<Vector3<f32>> =
            roots.iter().filter(|p| p.iter().all(|x| x.is_finite())).copied().collect();
        let reach = spacing(&finite).filter(|reach| *reach > 0.0)?;
        let [low, high] = finite.iter().fold([finite[0]; 2], |[low, high], p| [low.inf(p), high.sup(p)]);
        // Zero at the border, whose values go on beyond it.
        let margin = Vector3::repeat(3.0 * reach + 0.1 * (high - low).max());
        let mut grid = Volume::new(low - margin, high + margin, CELLS);
        finite.iter().for_each(|p| grid.add(*p, 1.0));
        let density = Fields::new([grid.blurred(reach.max(1.5 * grid.cell()))]);
        let mut at: Vec<f32> = finite.iter().map(|p| grid.at(&density, *p)[0]).collect();
        let middle = at.len() / 2;
        let median = *at.select_nth_unstable_by(middle, f32::total_cmp).1;
        Some(Roots { grid, density, median, colour: hair })
    }

    /// `bare` tinted towards the colour of the hair, by how densely it grows at `p`.
    pub fn tinted(&self, bare: Rgb, p: Vector3<f32>) -> Rgb {
        let [density] = self.grid.at(&self.density, p);
        let t = ((density / self.median - 0.12) / 0.5).clamp(0.0, 1.0);
        bare.lerp(&self.colour, 0.92 * t * t * (3.0 - 2.0 * t))
    }
}

/// About how far a root is from its neighbours; `None` for less than two roots.
fn spacing(roots: &[Vector3<f32>]) -> Option<f32> {
    let probes = roots.iter().step_by(roots.len().div_ceil(PROBES).max(1));
    let mut reaches: Vec<f32> = probes
        .map(|p| {
            let mut far: Vec<f32> = roots.iter().map(|q| (q - p).norm_squared()).collect();
            let k = NEIGHBOUR.min(far.len() - 1);
            far.select_nth_unstable_by(k, f32::total_cmp).1.sqrt()
        })
        .collect();
    let middle = reaches.len() / 2;
    (roots.len() > 1).then(|| *reaches.select_nth_unstable_by(middle, f32::total_cmp).1)
}

/// The colour of a body without hair.
pub fn bare(is_plane: bool) -> Rgb {
    if is_plane { GROUND } else { SKIN }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Hair on a quarter of a plane, in tufts of twelve, five millimetres apart.
    fn roots() -> Vec<Vector3<f32>> {
        let tuft = |i: usize, k: usize| {
            let (s, c) = (k as f32).sin_cos();
            let (x, z) = (0.005 * (i % 20) as f32, 0.005 * (i / 20) as f32);
            Vector3::new(x + 5e-4 * c, 0.0, z + 5e-4 * s)
        };
        (0..400).flat_map(|i| (0..12).map(move |k| tuft(i, k))).collect()
    }

    #[test]
    fn scalp_is_tinted_where_hair_grows_and_between_its_tufts() {
        let (bare, hair) = (Rgb::repeat(1.0), Rgb::zeros());
        let scalp = Roots::new(&roots(), hair).unwrap();
        let at = |x: f32, z: f32| scalp.tinted(bare, Vector3::new(x, 0.0, z)).x;
        for (x, z) in [(0.05, 0.05), (0.0525, 0.0475), (0.03, 0.062)] {
            assert!(at(x, z) < 0.15, "{x} {z}: {}", at(x, z));
        }
        // Over the border it fades, evenly.
        let over: Vec<f32> = (0..10).map(|i| at(0.05, 0.09 + 0.003 * i as f32)).collect();
        assert!(over.is_sorted() && over.windows(2).all(|pair| pair[1] - pair[0] < 0.6), "{over:?}");
        assert!(at(0.05, 0.13) > 0.98 && at(0.5, 0.5) == 1.0 && at(0.05, -9.0) == 1.0);
    }

    #[test]
    fn light_on_skin_fades_without_an_edge_and_is_the_cosine_away_from_the_border() {
        for spread in [0.05, 0.2] {
            assert_eq!((spread_cosine(-spread, spread), spread_cosine(-1.0, spread)), (0.0, 0.0));
            assert!((spread_cosine(0.7, spread) - 0.7).abs() < 1e-6);
            let slope = |x: f32| (spread_cosine(x + 1e-3, spread) - spread_cosine(x - 1e-3, spread)) / 2e-3;
            let slopes: Vec<f32> = (-40..=40).map(|i| slope(0.01 * i as f32)).collect();
            assert!(slopes.windows(2).all(|pair| (-1e-3..0.11).contains(&(pair[1] - pair[0]))), "{slopes:?}");
        }
    }

    #[test]
    fn a_single_root_tints_nothing() {
        let root = Vector3::zeros();
        assert!(Roots::new(&[], SKIN).is_none() && Roots::new(&[root], SKIN).is_none());
        let nowhere = Vector3::repeat(f32::NAN);
        assert!(Roots::new(&[root, nowhere], SKIN).is_none());
        assert!(Roots::new(&[root, root], SKIN).is_none(), "at one place");
    }
}
