//! The linearisation of a rod that contacts push: the forces carried along by the rod are part of its stiffness.

use super::newton::Solver;
use super::potential::{Load, gradient, hessian};
use super::{Rod, RodShape, Sensitivity};
use crate::math::cholesky;
use crate::math::lanes::Twist;
use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

/// How much stiffer than the rod itself a place is made along a direction in which it is held, where the rod alone is unstable
/// under what pushes it. The result of the rounds does not depend on it, only how soon they come to it.
const STIFFENING: f64 = 100.0;

/// A force on a place of a rod.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct ContactLoad {
    /// Segment of the place, from point `segment` to the next.
    pub segment: usize,
    /// Place on the segment, 0..=1.
    pub u: f64,
    /// The force, N, world axes.
    pub force: Vector3<f64>,
    /// Unit direction in which the place is held, world axes; zero where it is no surface that holds it.
    pub normal: Vector3<f64>,
    /// Whether it is held in all directions.
    pub sticks: bool,
}

impl ContactLoad {
    /// Adds to `row` what the place moves along the world direction `d`, by unknown.
    fn add_row(&self, d: &Vector3<f64>, shape: &RodShape, sensitivity: &Sensitivity, row: &mut [f64]) {
        for (k, share) in [(self.segment, 1.0 - self.u), (self.segment + 1, self.u)] {
            sensitivity.add_row(k, &shape.x(k), d, share, row);
        }
    }

    /// Directions in which the place is held.
    fn held(&self) -> impl Iterator<Item = Vector3<f64>> {
        let axes = [Vector3::x(), Vector3::y(), Vector3::z()];
        let (all, one) = if self.sticks { (3, 0) } else { (0, 1) };
        axes.into_iter().take(all).chain(std::iter::once(self.normal).take(one))
    }
}

/// Buffers of [`Solver::linearise_loaded`].
#[derive(Debug, Default)]
pub struct ContactLoadBuffers {
    load: Load,
    wrench: Vec<Twist<f64>>,
    hessian: Vec<f64>,
    row: Vec<f64>,
}

impl Solver {
    /// As [`Solver::linearise`], for a rod that `pushes` act on (`docs/theory.md` §5): the Hessian holds their geometric stiffness, while
    /// the direction leaves them out, for they are what is to be solved for. Where they make it indefinite, as in a strand that has
    /// buckled against a wall, it is stiffened along the directions in which the places are held, which changes no motion
    /// that keeps them there; where that does not suffice, the pushes are left out.
    pub fn linearise_loaded(
        &mut self,
        rod: &Rod,
        load: &Load,
        pushes: &[ContactLoad],
        q: &[f64],
        work: &mut ContactLoadBuffers,
    ) -> bool {
        if pushes.is_empty() {
            return self.linearise(rod, load, q);
        }
        let n = q.len();
        work.load.clone_from(load);
        for push in pushes {
            for (k, share) in [(push.segment, 1.0 - push.u), (push.segment + 1, push.u)] {
                work.load.add_force(k, &(push.force * share));
            }
        }
        self.sensitivity.update(rod, &self.shape, q);
        let (beam, shape, sensitivity) = (&rod.beam, &self.shape, &self.sensitivity);
        gradient(beam, &work.load, shape, sensitivity, q, &mut self.direction, &mut work.wrench);
        hessian(beam, &work.load, shape, sensitivity, &work.wrench, 1.0, &mut work.hessian);
        for d in &mut self.direction {
            *d = -*d;
        }
        for push in pushes {
            push.add_row(&-push.force, &self.shape, &self.sensitivity, &mut self.direction);
        }
        self.factor.clone_from(&work.hessian);
        if cholesky::factor(&mut self.factor, n) != 1 {
            for push in pushes {
                for d in push.held() {
                    work.row.clear();
                    work.row.resize(n, 0.0);
                    push.add_row(&d, &self.shape, &self.sensitivity, &mut work.row);
                    add_outer(&work.row, STIFFENING, &mut work.hessian);
                }
            }
            self.factor.clone_from(&work.hessian);
            if cholesky::factor(&mut self.factor, n) != 1 {
                return self.linearise(rod, load, q);
            }
        }
        cholesky::solve_lower(&self.factor, n, &mut self.direction);
        true
    }
}

/// Adds to the lower triangle of `hessian` a spring along `row`, `stiffening` times as stiff as the diagonal is along it.
fn add_outer(row: &[f64], stiffening: f64, hessian: &mut [f64]) {
    let n = row.len();
    let yielding: f64 = (0..n).map(|a| row[a] * row[a] / hessian[a * n + a].abs()).sum();
    // A place that cannot move, as at the root, needs no holding.
    if !(yielding > 0.0 && yielding.is_finite()) {
        return;
    }
    for a in 0..n {
        for b in 0..=a {
            hessian[a * n + b] += stiffening / yielding * row[a] * row[b];
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rod::potential::PointLoad;
    use crate::rod::{RodSource, SegmentSize, Taper};

    fn hair() -> Rod {
        Rod::new(&RodSource {
            points: &[Vector3::zeros(), Vector3::new(0.03, 0.1, 0.0), Vector3::new(0.1, 0.15, 0.03)],
            root_frame: None,
            arc: &[0.0, 0.2, 0.5, 1.0],
            stiffness: [8e-9, 6e-9, 4e-9],
            line_density: 6.6e-6,
            damping: 0.004,
            taper: Taper::NONE,
            natural_strain: None,
            segment_size: SegmentSize { max_length: 0.005, max_turn: 0.8 },
        })
        .unwrap()
    }

    fn at_rest(rod: &Rod, h: f64) -> Load {
        let mut shape = RodShape::default();
        shape.update(rod, &rod.root.r, &rod.initial_q);
        let points = (0..rod.points()).map(|k| PointLoad {
            inertial: shape.x(k),
            previous: shape.x(k),
            air: Vector3::zeros(),
            tangent: shape.tangent(k),
            drag: 2e-5,
        });
        let mut load = Load::default();
        load.set(rod, h, &Vector3::zeros(), &vec![0.0; rod.unknowns()], points);
        load
    }

    /// Factor of the Hessian, and minus the gradient without the pushes.
    fn linearised(rod: &Rod, load: &Load, pushes: &[ContactLoad], q: &[f64]) -> (Solver, Vec<f64>) {
        let mut solver = Solver::default();
        solver.shape.update(rod, &rod.root.r, q);
        assert!(solver.linearise_loaded(rod, load, pushes, q, &mut ContactLoadBuffers::default()));
        let n = q.len();
        // The diagonal of L is stored inverted.
        let l = |a: usize, b: usize| solver.factor[a * n + b];
        let slope = (0..n)
            .map(|a| {
                (0..a).map(|b| l(a, b) * solver.direction[b]).sum::<f64>() + solver.direction[a] / l(a, a)
            })
            .collect();
        (solver, slope)
    }

    #[test]
    fn the_hessian_holds_how_the_pushes_turn() {
        let rod = hair();
        let load = at_rest(&rod, 0.1);
        let q: Vec<f64> = (0..rod.unknowns()).map(|i| (i as f64 * 1.7).cos() * 0.3).collect();
        let n = q.len();
        let force = Vector3::new(1e-7, 2e-7, 1e-7);
        let pushes = [5, 20].map(|segment| ContactLoad {
            segment,
            u: 0.3,
            force,
            normal: Vector3::y(),
            sticks: false,
        });
        // Slope of Φ less the work of the pushes.
        let gradient = |q: &[f64]| {
            let (solver, mut slope) = linearised(&rod, &load, &[], q);
            for push in &pushes {
                push.add_row(&push.force, &solver.shape, &solver.sensitivity, &mut slope);
            }
            slope
        };
        let (solver, slope) = linearised(&rod, &load, &pushes, &q);
        let (_, alone) = linearised(&rod, &load, &[], &q);
        let scale = alone.iter().fold(0.0_f64, |m, x| m.max(x.abs()));
        assert!(slope.iter().zip(&alone).all(|(a, b)| (a - b).abs() < 1e-9 * scale));
        let entry = |a: usize, b: usize| {
            let l = |i: usize, j: usize| match i == j {
                true => 1.0 / solver.factor[i * n + j],
                false => solver.factor[i * n + j],
            };
            (0..=b).map(|k| l(a, k) * l(b, k)).sum::<f64>()
        };
        let (mut worst, mut largest, mut turned) = (0.0_f64, 0.0_f64, 0.0_f64);
        for b in 0..n {
            let moved = |d: f64| {
                let mut p = q.clone();
                p[b] += d;
                (gradient(&p), linearised(&rod, &load, &[], &p).1)
            };
            let ((ahead, ahead_alone), (behind, behind_alone)) = (moved(1e-4), moved(-1e-4));
            for a in b..n {
                let numeric = (behind[a] - ahead[a]) / 2e-4;
                worst = worst.max((numeric - entry(a, b)).abs());
                turned = turned.max((numeric - (behind_alone[a] - ahead_alone[a]) / 2e-4).abs());
                largest = largest.max(numeric.abs());
            }
        }
        assert!(worst < 1e-4 * turned && turned > 1e-3 * largest, "{worst} {turned} {largest}");
    }

    #[test]
    fn a_strand_that_its_load_would_buckle_is_held() {
        let rod = hair();
        let load = at_rest(&rod, 1.0);
        let q = rod.initial_q.clone();
        let tip = rod.points() - 2;
        // More than a column of this length bears with a free end, less than with a pinned one.
        let along = Vector3::new(0.1, 0.15, 0.03).normalize();
        let push = ContactLoad { segment: tip, u: 1.0, force: along * -2e-6, normal: along, sticks: true };
        let (held, _) = linearised(&rod, &load, &[push], &q);
        let (free, _) = linearised(&rod, &load, &[], &q);
        // What the held tip gives way to a force is far less than the rod alone would.
        let yielding = |solver: &Solver| {
            let mut row = vec![0.0; q.len()];
            push.add_row(&Vector3::z(), &solver.shape, &solver.sensitivity, &mut row);
            cholesky::solve_lower(&solver.factor, q.len(), &mut row);
            cholesky::dot(&row, &row)
        };
        assert!(yielding(&held) < 0.1 * yielding(&free), "{} {}", yielding(&held), yielding(&free));
    }
}
