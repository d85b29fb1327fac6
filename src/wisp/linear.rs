//! A guide that swings, to first order about a pose in which it hangs.

use crate::rod::{LumpedSensitivity, Rod, RodShape};
use nalgebra::{Matrix3, Vector3};

/// Mass, damping and stiffness of a guide's unknowns for small motions about a pose, without bodies (`docs/theory.md` eq. 8.2); matrices are row-major.
pub(super) struct Linear<'a> {
    rod: &'a Rod,
    drag: &'a [f64],
    levers: LumpedSensitivity,
    /// Turn of each node in rest space by its unknowns, per share of the length.
    turns: Vec<Matrix3<f64>>,
    /// 𝐌, kg·m⁴.
    pub mass: Vec<f64>,
    /// 𝐂, kg·m⁴/s: internal, and of the air.
    pub damping: Vec<f64>,
    /// 𝐊, kg·m⁴/s²: elasticity and what hangs.
    pub stiffness: Vec<f64>,
}

impl<'a> Linear<'a> {
    /// Of `rod` at unknowns `q`, 1/m, with `drag` at its points, N·s/m², pulled by `pull`, m/s², rest space.
    pub fn new(rod: &'a Rod, q: &[f64], drag: &'a [f64], pull: &Vector3<f64>) -> Self {
        let mut shape = RodShape::default();
        shape.update(rod, &rod.root.r, q);
        let levers = LumpedSensitivity::new(rod, &shape);
        let add = |mut a: Vec<f64>, b: Vec<f64>| {
            a.iter_mut().zip(b).for_each(|(a, b)| *a += b);
            a
        };
        let air = levers.mass_matrix(|node| drag[rod.node_point(node)] * rod.lumped_length(node));
        let poses: Vec<_> = shape.poses().collect();
        Linear {
            turns: (0..q.len() / 3).map(|node| poses[rod.node_point(node)].r * rod.length()).collect(),
            mass: levers.mass_matrix(|node| rod.lumped_mass(node)),
            damping: add(rod.damping_matrix(), air),
            stiffness: add(
                rod.elastic_matrix(),
                levers.geometric_stiffness(|node| pull * rod.lumped_mass(node)),
            ),
            rod,
            drag,
            levers,
        }
    }

    /// Number of unknowns.
    pub fn unknowns(&self) -> usize {
        self.rod.unknowns()
    }

    /// Length of the guide, m.
    pub fn length(&self) -> f64 {
        self.rod.length()
    }

    /// What forces do along the unknowns, N·m²; `force` tells that at a place, m, rest space, of a node's mass, kg, and drag, N·s/m.
    pub fn forces(&self, force: impl Fn(&Vector3<f64>, f64, f64) -> Vector3<f64>) -> Vec<f64> {
        let mut sum = vec![0.0; self.unknowns()];
        for node in 1..self.rod.nodes.len() {
            let (x, point) = (self.levers.node(node), self.rod.node_point(node));
            let drag = self.drag[point] * self.rod.lumped_length(node);
            let force = force(&(x + self.rod.root.p), self.rod.lumped_mass(node), drag);
            let row = self.levers.row(point, &x, &force);
            sum.iter_mut().zip(row).for_each(|(sum, row)| *sum += row);
        }
        sum
    }

    /// How changes of the unknowns, 1/m, turn each node in rest space, per share of the length, rad.
    pub fn turning(&self, q: &[f64]) -> Vec<Vector3<f64>> {
        self.turns
            .iter()
            .zip(q.chunks_exact(3))
            .map(|(turn, q)| turn * Vector3::from_column_slice(q))
            .collect()
    }
}
