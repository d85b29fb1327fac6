//! How the hair around a place turns (`docs/theory.md` §5.3).

use super::grid::{Grid, Node, Stencil};
use super::{FRACTION, PLACE, VELOCITY};
use nalgebra::{Matrix3, Vector3};

/// Share of its trace that is added to the inertia: hair along a line has none about it.
const ROUNDING: f64 = 1e-12;

/// The motion of the hair around a place that leaves it as it is: that of a rigid body with its momentum and angular
/// momentum.
pub(super) struct RigidMotion {
    /// Centre of the hair, m.
    centre: Vector3<f64>,
    /// Velocity there, m/s.
    velocity: Vector3<f64>,
    /// Angular velocity, rad/s.
    spin: Vector3<f64>,
}

impl RigidMotion {
    /// Of the hair around the point of a stencil, where the grid has these `values`. Each node stands for the hair around it, at its centre and with its
    /// mean velocity: what is rigid stays so.
    pub fn around(grid: &Grid, stencil: &Stencil, values: &Node) -> Self {
        let at = |node: &Node, entry: usize| Vector3::new(node[entry], node[entry + 1], node[entry + 2]);
        let fraction = values[FRACTION];
        let [centre, velocity] = [PLACE, VELOCITY].map(|entry| at(values, entry) / fraction);
        let (mut momentum, mut inertia) = (Vector3::zeros(), Matrix3::zeros());
        grid.for_each(stencil, |weight, node| {
            let share = node[FRACTION];
            if share > 0.0 {
                let arm = at(node, PLACE) - centre * share;
                let relative = at(node, VELOCITY) - velocity * share;
                let weight = weight / share;
                momentum += arm.cross(&relative) * weight;
                inertia +=
                    (Matrix3::from_diagonal_element(arm.norm_squared()) - arm * arm.transpose()) * weight;
            }
        });
        let rounding = Matrix3::from_diagonal_element(ROUNDING * inertia.trace());
        let spin = (inertia + rounding).cholesky().map_or(Vector3::zeros(), |factor| factor.solve(&momentum));
        RigidMotion { centre, velocity, spin }
    }

    /// Its velocity at `x`, m/s.
    pub fn at(&self, x: &Vector3<f64>) -> Vector3<f64> {
        self.velocity + self.spin.cross(&(x - self.centre))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Hair of random places and volumes, some of it along a line, that moves as a rigid body.
    #[test]
    fn what_moves_as_a_rigid_body_is_left_as_it_is() {
        let draw = |a: u64, i: usize| crate::math::random::unit(a, i as u64) - 0.5;
        let [turn, shift] = [Vector3::new(3.0, -20.0, 7.0), Vector3::new(1.0, 2.0, -0.3)];
        for thickness in [1.0, 1e-3, 0.0] {
            let point =
                |i: usize| Vector3::new(draw(1, i), thickness * draw(2, i), thickness * draw(3, i)) * 0.06;
            let points: Vec<Vector3<f64>> = (0..60).map(point).collect();
            let mut grid = Grid::new(0.01, [Vector3::repeat(-0.1), Vector3::repeat(0.1)]);
            let velocity = |x: &Vector3<f64>| shift + turn.cross(x);
            let deposit = |(i, x): (usize, &Vector3<f64>)| {
                let share = 0.6 + draw(4, i);
                let [v, place] = [velocity(x), *x].map(|of| of * share);
                let mut node = Node::default();
                node[FRACTION] = share;
                for (entry, of) in [(VELOCITY, v), (PLACE, place)] {
                    node[entry..entry + 3].copy_from_slice(of.as_slice());
                }
                node
            };
            let deposits: Vec<Node> = points.iter().enumerate().map(deposit).collect();
            let mut stencils: Vec<Stencil> = points.iter().map(|x| grid.stencil(x)).collect();
            grid.make_blocks(&mut stencils);
            grid.sum(&stencils, &deposits);
            for (stencil, x) in stencils.iter().zip(&points) {
                let found = RigidMotion::around(&grid, stencil, &grid.values(stencil)).at(x);
                assert!((found - velocity(x)).norm() < 1e-5, "{thickness}: {found}");
            }
        }
    }
}
