//! How guides answer small motions of the head: hair that answers alike moves alike.

use super::GuideRod;
use crate::rod::{Levers, Shape};
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

/// How guide `r`, with `drag` at its points, N·s/m², in the groom's pose turns at its nodes as the head is accelerated by g back and forth along each axis
/// and about each, at each frequency: real and imaginary parts one after the other, in rest space, per share of its length, rad. Linear, with gravity as
/// a spring of g/L per mass, without bodies.
pub(super) fn response(r: &GuideRod, drag: &[f64], scalp: &Scalp) -> Vec<Vec<Vector3<f64>>> {
    let rod = &r.rod;
    let mut shape = Shape::default();
    shape.update(rod, &rod.root.r, &rod.start);
    let levers = Levers::new(rod, &shape);
    let n = rod.unknowns();
    let mass = levers.squares(|node| rod.mass_at(node));
    let air = levers.squares(|node| drag[rod.node_point(node)] * rod.span_at(node));
    let elastic = rod.elastic();
    let shaken = |k: usize| {
        let axis = Vector3::ith(k % 3, 1.0);
        let mut force = vec![0.0; n];
        for node in 1..rod.nodes.len() {
            let x = levers.node(node);
            let from = x + rod.root.p - scalp.centre;
            let way = if k < 3 { axis } else { axis.cross(&from) / scalp.radius.max(f64::MIN_POSITIVE) };
            let row = levers.row(rod.node_point(node), &x, &way);
            force.iter_mut().zip(&row).for_each(|(f, row)| *f += rod.mass_at(node) * G * row);
        }
        force
    };
    let forces: Vec<Vec<f64>> = (0..6).map(shaken).collect();
    let forces = DMatrix::from_fn(n, forces.len(), |i, k| Complex::from(forces[k][i]));
    let frames: Vec<_> = {
        let poses: Vec<_> = shape.poses().collect();
        (0..n / 3).map(|node| poses[rod.node_point(node)].r * rod.length()).collect()
    };
    let mut answers = Vec::new();
    for frequency in FREQUENCIES {
        let omega = TAU * frequency;
        let system = DMatrix::from_fn(n, n, |i, j| {
            let at = i * n + j;
            let held = elastic[at] + (G / rod.length() - omega * omega) * mass[at];
            Complex::new(held, omega * (air[at] + r.material.damping * elastic[at]))
        });
        let Some(q) = system.lu().solve(&forces) else { continue };
        for column in q.column_iter() {
            for part in [|c: &Complex<f64>| c.re, |c: &Complex<f64>| c.im] {
                let q = |node: usize| Vector3::from_fn(|axis, _| part(&column[3 * node + axis]));
                answers.push(frames.iter().enumerate().map(|(node, frame)| frame * q(node)).collect());
            }
        }
    }
    answers
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rod::{Cut, Rod, RodSource, Taper};
    use crate::scene::{Material, Tree};
    use crate::wisp::Reach;

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
            natural: None,
            cut: Cut::COARSE,
        })
        .unwrap();
        let drag = vec![0.0; rod.points()];
        let places: Vec<_> = arc.iter().map(|s| Vector3::y() * (-length * s)).collect();
        let reach = Reach::new(&places, &rod.nodes);
        let guide = GuideRod { guide: 0, leaf: (0, 0), hairs: 1.0, material: Material::default(), rod };
        let answers = response(&guide, &drag, &Scalp { centre: Vector3::zeros(), radius: 0.1 });
        assert_eq!(answers.len(), 12 * FREQUENCIES.len());
        // Slowly accelerated along x, the real part: w L⁴/(8 E I) at the tip.
        let (tip, _) = reach.ways(answers[0].iter().copied()).last().unwrap();
        let beam = density * G * length.powi(3) / (8.0 * stiffness);
        assert!((tip.norm() / beam - 1.0).abs() < 0.05 && tip.x > 0.99 * tip.norm(), "{tip} {beam}");
        // Along itself it cannot be bent.
        let (along, _) = reach.ways(answers[2].iter().copied()).last().unwrap();
        assert!(along.norm() < 1e-9, "{along}");
    }
}
