//! The linear model of a guide: small motions about a pose in which it hangs.

use crate::rod::{LumpedSensitivity, Rod, RodShape};
use nalgebra::{Matrix3, Vector3};

/// Mass, damping and stiffness matrices of a guide's unknowns for small motions about a pose, without contact
/// (`docs/theory.md` §8.1, "linear model"). Row-major n × n.
pub(super) struct LinearModel<'a> {
    rod: &'a Rod,
    drag: &'a [f64],
    sensitivity: LumpedSensitivity,
    /// For every node with unknowns, the map from its unknowns to its normalised strain: L R.
    normalise: Vec<Matrix3<f64>>,
    /// 𝐌, kg·m⁴.
    pub mass: Vec<f64>,
    /// 𝐂, kg·m⁴/s: internal damping and drag.
    pub damping: Vec<f64>,
    /// 𝐊, kg·m⁴/s²: elasticity and geometric stiffness of the weight.
    pub stiffness: Vec<f64>,
}

impl<'a> LinearModel<'a> {
    /// Of `rod` at unknowns `q`, 1/m, with drag coefficients `drag` at its points, N·s/m², under `gravity`,
    /// m/s², rest space.
    pub fn new(rod: &'a Rod, q: &[f64], drag: &'a [f64], gravity: &Vector3<f64>) -> Self {
        let mut shape = RodShape::default();
        shape.update(rod, &rod.root.r, q);
        let sensitivity = LumpedSensitivity::new(rod, &shape);
        let add = |mut a: Vec<f64>, b: Vec<f64>| {
            a.iter_mut().zip(b).for_each(|(a, b)| *a += b);
            a
        };
        let air = sensitivity.mass_matrix(|node| drag[rod.node_point(node)] * rod.lumped_length(node));
        let weight = sensitivity.geometric_stiffness(|node| gravity * rod.lumped_mass(node));
        let poses: Vec<_> = shape.poses().collect();
        LinearModel {
            normalise: (0..q.len() / 3).map(|node| poses[rod.node_point(node)].r * rod.length()).collect(),
            mass: sensitivity.mass_matrix(|node| rod.lumped_mass(node)),
            damping: add(rod.damping_matrix(), air),
            stiffness: add(rod.elastic_matrix(), weight),
            rod,
            drag,
            sensitivity,
        }
    }

    /// Number of unknowns.
    pub fn unknowns(&self) -> usize {
        self.rod.unknowns()
    }

    /// Lumped mass of a node, kg.
    pub fn node_mass(&self, node: usize) -> f64 {
        self.rod.lumped_mass(node)
    }

    /// Length of the guide, m.
    pub fn length(&self) -> f64 {
        self.rod.length()
    }

    /// Generalised force, N·m², of `force(x, mass, drag)`, N, at every node but the root: position, m, rest
    /// space, lumped mass, kg, and lumped drag, N·s/m.
    pub fn generalised_force(&self, force: impl Fn(&Vector3<f64>, f64, f64) -> Vector3<f64>) -> Vec<f64> {
        let mut sum = vec![0.0; self.unknowns()];
        for node in 1..self.rod.nodes.len() {
            let (x, point) = (self.sensitivity.node(node), self.rod.node_point(node));
            let drag = self.drag[point] * self.rod.lumped_length(node);
            let force = force(&(x + self.rod.root.p), self.rod.lumped_mass(node), drag);
            let row = self.sensitivity.row(point, &x, &force);
            sum.iter_mut().zip(row).for_each(|(sum, row)| *sum += row);
        }
        sum
    }

    /// Normalised strain of every node with unknowns (see
    /// [`LinearKinematics`](super::linear_kinematics::LinearKinematics)) for changes `q` of the unknowns,
    /// 1/m.
    pub fn normalised_strain(&self, q: &[f64]) -> Vec<Vector3<f64>> {
        self.normalise
            .iter()
            .zip(q.chunks_exact(3))
            .map(|(normalise, q)| normalise * Vector3::from_column_slice(q))
            .collect()
    }
}
