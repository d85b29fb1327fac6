//! How guides answer small motions of the head: hair that answers alike moves alike.

use super::GuideRod;
use super::linear::Linear;
use nalgebra::{Complex, DMatrix, Vector3};
use std::f64::consts::TAU;

/// Frequencies at which the head is thought to move, Hz: what heads do, and what hair does.
const FREQUENCIES: [f64; 4] = [1.0, 2.0, 3.5, 6.0];

const G: f64 = 9.81;

/// How roots lie, to measure turns of the head by.
#[derive(Debug, Clone, Copy)]
pub(super) struct Scalp {
    centre: Vector3<f64>,
    /// Root mean square of their distances from it, m.
    radius: f64,
}

impl Scalp {
    pub fn new(rods: &[GuideRod]) -> Self {
        let roots = || rods.iter().map(|r| r.rod.root.p);
        let centre = roots().sum::<Vector3<f64>>() / rods.len().max(1) as f64;
        let square = roots().map(|p| (p - centre).norm_squared()).sum::<f64>() / rods.len().max(1) as f64;
        Scalp { centre, radius: square.sqrt() }
    }
}

/// How guide `r`, with `drag` at its points, N·s/m², in the groom's pose and pulled by `pull`, m/s², turns at its nodes as the head is accelerated by g back
/// and forth along each axis and about each, at each frequency: real and imaginary parts one after the other, in rest space, per share of its length, rad.
pub(super) fn response(
    r: &GuideRod,
    drag: &[f64],
    pull: &Vector3<f64>,
    scalp: &Scalp,
) -> Vec<Vec<Vector3<f64>>> {
    let linear = Linear::new(&r.rod, &r.rod.initial_q, drag, pull);
    let n = linear.unknowns();
    let shaken = |k: usize| {
        let axis = Vector3::ith(k % 3, G);
        linear.forces(|x, mass, _| match k {
            0..3 => axis * mass,
            _ => axis.cross(&(x - scalp.centre)) * (mass / scalp.radius.max(f64::MIN_POSITIVE)),
        })
    };
    let forces: Vec<Vec<f64>> = (0..6).map(shaken).collect();
    let forces = DMatrix::from_fn(n, forces.len(), |i, k| Complex::from(forces[k][i]));
    let mut answers = Vec::new();
    for frequency in FREQUENCIES {
        let omega = TAU * frequency;
        let system = DMatrix::from_fn(n, n, |i, j| {
            let at = i * n + j;
            Complex::new(linear.stiffness[at] - omega * omega * linear.mass[at], omega * linear.damping[at])
        });
        // Where nothing damps what is shaken in step with itself there is no answer.
        let q = system.lu().solve(&forces).unwrap_or_else(|| DMatrix::zeros(n, forces.ncols()));
        for column in q.column_iter() {
            for part in [|c: &Complex<f64>| c.re, |c: &Complex<f64>| c.im] {
                answers.push(linear.turning(&column.iter().map(part).collect::<Vec<_>>()));
            }
        }
    }
    answers
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rod::{Rod, RodSource, SegmentSize, Taper};
    use crate::scene::{Material, Tree};
    use crate::wisp::LinearKinematics;

    #[test]
    fn stiff_hair_bends_as_a_beam_does_that_its_weight_pulls_aside() {
        let (length, stiffness, density) = (0.05, 1e-6, 6.6e-6);
        // A turn is taken from the node before it, to first order in their spacing.
        let arc = Tree::default_arc(49);
        let rod = Rod::new(&RodSource {
            points: &[Vector3::zeros(), Vector3::y() * -length],
            root_frame: None,
            arc: &arc,
            stiffness: [stiffness; 3],
            line_density: density,
            damping: 0.0,
            taper: Taper::NONE,
            natural_strain: None,
            segment_size: SegmentSize::COARSE,
        })
        .unwrap();
        let drag = vec![0.0; rod.points()];
        let places: Vec<_> = arc.iter().map(|s| Vector3::y() * (-length * s)).collect();
        let reach = LinearKinematics::new(&places, &rod.nodes);
        let guide = GuideRod { guide: 0, leaf: (0, 0), hairs: 1.0, material: Material::default(), rod };
        let answers =
            response(&guide, &drag, &Vector3::zeros(), &Scalp { centre: Vector3::zeros(), radius: 0.1 });
        assert_eq!(answers.len(), 12 * FREQUENCIES.len());
        // Slowly accelerated along x, the real part: w L⁴/(8 E I) at the tip.
        let (tip, _) = reach.displacements(answers[0].iter().copied()).last().unwrap();
        let beam = density * G * length.powi(3) / (8.0 * stiffness);
        assert!((tip.norm() / beam - 1.0).abs() < 0.05 && tip.x > 0.99 * tip.norm(), "{tip} {beam}");
        // Along itself it cannot be bent.
        let (along, _) = reach.displacements(answers[2].iter().copied()).last().unwrap();
        assert!(along.norm() < 1e-9, "{along}");
    }
}
