//! Frequency response of guides to small motions of the head: guides that respond alike move alike.

use super::guide_rod::GuideRod;
use super::linear_model::LinearModel;
use crate::scene::anim::GRAVITY;
use nalgebra::{Complex, DMatrix, Vector3};
use std::f64::consts::TAU;

/// Frequencies of the response, Hz: the range of head motion and of swinging hair.
const FREQUENCIES: [f64; 4] = [1.0, 2.0, 3.5, 6.0];

/// Extent of the roots, which scales rotations of the head.
#[derive(Debug, Clone, Copy)]
pub(super) struct RootExtent {
    /// Mean of the roots, m, rest space.
    centre: Vector3<f64>,
    /// Root mean square of their distances from it, m.
    radius: f64,
}

impl RootExtent {
    pub fn new(rods: &[GuideRod]) -> Self {
        let roots = || rods.iter().map(|r| r.rod.root.p);
        let centre = roots().sum::<Vector3<f64>>() / rods.len().max(1) as f64;
        let square = roots().map(|p| (p - centre).norm_squared()).sum::<f64>() / rods.len().max(1) as f64;
        RootExtent { centre, radius: square.sqrt() }
    }
}

/// Frequency response of guide `r` in the groom's pose (`docs/theory.md` eq. 8.2) to harmonic accelerations
/// of amplitude g along each axis and about each axis, at each of [`FREQUENCIES`]. Real and imaginary parts
/// are separate entries, each the normalised strain of the nodes. `drag` holds the drag coefficients at the
/// points of the rod, N·s/m²; `gravity`, m/s², is in rest space.
pub(super) fn frequency_response(
    r: &GuideRod,
    drag: &[f64],
    gravity: &Vector3<f64>,
    roots: &RootExtent,
) -> Vec<Vec<Vector3<f64>>> {
    let linear = LinearModel::new(&r.rod, &r.rod.initial_q, drag, gravity);
    let n = linear.unknowns();
    let excitation = |k: usize| {
        let axis = Vector3::ith(k % 3, GRAVITY);
        linear.generalised_force(|x, mass, _| match k {
            0..3 => axis * mass,
            _ => axis.cross(&(x - roots.centre)) * (mass / roots.radius.max(f64::MIN_POSITIVE)),
        })
    };
    let forces: Vec<Vec<f64>> = (0..6).map(excitation).collect();
    let forces = DMatrix::from_fn(n, forces.len(), |i, k| Complex::from(forces[k][i]));
    let mut responses = Vec::new();
    for frequency in FREQUENCIES {
        let omega = TAU * frequency;
        let system = DMatrix::from_fn(n, n, |i, j| {
            let at = i * n + j;
            Complex::new(linear.stiffness[at] - omega * omega * linear.mass[at], omega * linear.damping[at])
        });
        // An undamped resonance has no response.
        let q = system.lu().solve(&forces).unwrap_or_else(|| DMatrix::zeros(n, forces.ncols()));
        for column in q.column_iter() {
            for part in [|c: &Complex<f64>| c.re, |c: &Complex<f64>| c.im] {
                responses.push(linear.normalised_strain(&column.iter().map(part).collect::<Vec<_>>()));
            }
        }
    }
    responses
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rod::{Rod, RodSource, SegmentSize};
    use crate::scene::{Material, Tree};
    use crate::wisp::linear_kinematics::LinearKinematics;

    #[test]
    fn stiff_hair_responds_as_a_beam_under_its_weight() {
        let (length, stiffness, density) = (0.05, 1e-6, 6.6e-6);
        // The error is of first order in the spacing of the nodes.
        let arc = Tree::default_arc(49);
        let rod = Rod::new(&RodSource {
            stiffness: [stiffness; 3],
            line_density: density,
            segment_size: SegmentSize::COARSE,
            ..RodSource::hair(&[Vector3::zeros(), Vector3::y() * -length], &arc)
        })
        .unwrap();
        let drag = vec![0.0; rod.points()];
        let nodes: Vec<_> = arc.iter().map(|s| Vector3::y() * (-length * s)).collect();
        let kinematics = LinearKinematics::new(&nodes, &rod.nodes);
        let guide = GuideRod { guide: 0, leaf: (0, 0), hairs: 1.0, material: Material::default(), rod };
        let roots = RootExtent { centre: Vector3::zeros(), radius: 0.1 };
        let responses = frequency_response(&guide, &drag, &Vector3::zeros(), &roots);
        assert_eq!(responses.len(), 12 * FREQUENCIES.len());
        // Real part at the lowest frequency along x: w L⁴/(8 E I) at the tip.
        let (tip, _) = kinematics.displacements(responses[0].iter().copied()).last().unwrap();
        let beam = density * GRAVITY * length.powi(3) / (8.0 * stiffness);
        assert!((tip.norm() / beam - 1.0).abs() < 0.05 && tip.x > 0.99 * tip.norm(), "{tip} {beam}");
        // Acceleration along the rod bends nothing.
        let (along, _) = kinematics.displacements(responses[2].iter().copied()).last().unwrap();
        assert!(along.norm() < 1e-9, "{along}");
    }
}
