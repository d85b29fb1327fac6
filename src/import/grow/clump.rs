//! Draws strands together to clumps.

use crate::math::point_tree::PointTree;
use nalgebra::Vector3;

/// The strands that others are drawn to.
pub(super) struct Centres {
    roots: PointTree,
    /// Normals of the surface at the roots.
    normals: Vec<Vector3<f64>>,
    /// Vertices of the strands.
    curves: Vec<Vec<Vector3<f64>>>,
    lengths: Vec<f64>,
    strength: f64,
}

/// Cosine of the angle between the normals at two roots from which on they are of one clump.
const ONE_SIDE: f64 = 0.3;

/// Smallest share of its strength by which a clump draws a strand.
const WEAKEST: f64 = 0.5;

/// Distance of a centre, as a share of the strand's length, from which on it draws less: a strand does not
/// lie down to reach a tip that is far away.
const REACH: f64 = 0.5;

/// A strand as it grows.
pub(super) struct Strand {
    pub(super) points: Vec<Vector3<f64>>,
    pub(super) length: f64,
    /// Normal of the surface at the root.
    pub(super) normal: Vector3<f64>,
}

impl Centres {
    pub(super) fn new(strands: Vec<Strand>, strength: f64) -> Self {
        Centres {
            roots: PointTree::new(strands.iter().map(|strand| strand.points[0]).collect()),
            normals: strands.iter().map(|strand| strand.normal).collect(),
            lengths: strands.iter().map(|strand| strand.length).collect(),
            curves: strands.into_iter().map(|strand| strand.points).collect(),
            strength,
        }
    }

    /// Draws a strand to the nearest centre, the more the nearer to the tip. It keeps its length. `random`, 0 to 1,
    /// tells how much of the strength the strand takes.
    pub(super) fn draw(&self, strand: &mut Strand, random: f64) {
        if self.strength == 0.0 {
            return;
        }
        let normal = strand.normal;
        let on_one_side =
            |i: usize, squared: f64| (self.normals[i].dot(&normal) > ONE_SIDE).then_some(squared);
        let nearest = self.roots.least(&strand.points[0], 1, on_one_side);
        let Some(&(squared, nearest)) = nearest.first() else { return };
        let (curve, last) = (&self.curves[nearest], strand.points.len() - 1);
        let most = (REACH * strand.length / squared.sqrt().max(f64::MIN_POSITIVE)).min(1.0);
        let strength = self.strength * (WEAKEST + (1.0 - WEAKEST) * random) * most;
        let pace = (strand.length / self.lengths[nearest]).min(1.0);
        let mut drawn = strand.points[0];
        for v in 1..=last {
            let u = v as f64 / last as f64;
            let x = strand.points[v];
            let next = x + (at(curve, u * pace) - x) * (strength * u);
            let along = (next - drawn).try_normalize(0.0).unwrap_or(strand.normal);
            strand.points[v] = strand.points[v - 1] + along * (strand.length / last as f64);
            drawn = next;
        }
    }
}

/// The place at a share of a curve with even vertices, m.
fn at(curve: &[Vector3<f64>], share: f64) -> Vector3<f64> {
    let last = curve.len() - 1;
    let s = share * last as f64;
    let k = (s as usize).min(last - 1);
    curve[k].lerp(&curve[k + 1], s - k as f64)
}
