//! Keeping guides that follow out of bodies, at each moment by itself: as little as it takes is added to their strains, so that what they do is as
//! continuous as what they follow.

use super::{G, Surroundings};
use crate::contact::Outside;
use crate::math::cholesky;
use crate::math::se3::Pose;
use crate::rod::{Rod, Shape};
use nalgebra::{Isometry3, Matrix3, Vector3};

/// Rounds of looking and moving, at most: surfaces are curved, and so are the ways of the points.
const ROUNDS: usize = 8;

/// Sweeps of a round.
const SWEEPS: usize = 20;

/// Farthest that a point is moved out in a round, m: what is deeper is near to another place of the surface afterwards.
const STRIDE: f64 = 0.01;

/// How near a point must be to be looked after while others are moved, m.
const BESIDE: f64 = 0.002;

/// How much too near to a body a guide may stay, m.
const TOLERANCE: f64 = 1e-4;

/// The bodies and the head at one moment.
pub(super) struct Moment<'a> {
    around: &'a Surroundings<'a>,
    t: f64,
    poses: Vec<Isometry3<f64>>,
}

/// A guide at a moment.
struct Placed {
    shape: Shape,
    /// Points, m, world.
    x: Vec<Vector3<f64>>,
}

/// A point near a body: which, by how much it is too near, m, and the body's outward normal.
struct Near {
    point: usize,
    missing: f64,
    normal: Vector3<f64>,
}

impl<'a> Moment<'a> {
    /// At time `t`, s.
    pub fn new(around: &'a Surroundings<'a>, t: f64) -> Self {
        Moment { around, t, poses: (0..around.bodies.len()).map(|b| (around.body)(b, t)).collect() }
    }

    /// When it is, s.
    pub fn time(&self) -> f64 {
        self.t
    }

    fn place(&self, rod: &Rod, q: &[f64]) -> Placed {
        let root = self.around.root(&rod.root, self.t);
        let mut shape = Shape::default();
        shape.update(rod, &root.r, q);
        let x = (0..rod.points()).map(|k| shape.x(k) + root.p).collect();
        Placed { shape, x }
    }

    /// Distance of each point of a rod at unknowns `q`, 1/m, from each body, m, but no more than `most` says there; at body b and point k at
    /// `b * points + k`.
    pub fn distances(&self, rod: &Rod, q: &[f64], most: &[f64]) -> Vec<f64> {
        let mut distances = most.to_vec();
        let x = self.place(rod, q).x;
        let at = (self.t, &self.poses[..]);
        self.around
            .bodies
            .each_nearer(at, &x, most, &mut Vec::new(), |i, distance, _| distances[i] = distance);
        distances
    }

    /// Moves a rod at unknowns `q`, 1/m, out of the bodies until its points keep the distances `kept`, m, as in [`Moment::distances`], as far as it can;
    /// returns the largest way of a point, m, if there is any. `memory` spares searches and changes no result.
    pub fn bring_out(
        &self,
        rod: &Rod,
        kept: &[f64],
        q: &mut [f64],
        memory: &mut Vec<Outside>,
    ) -> Option<f64> {
        let mut placed = self.place(rod, q);
        if self.near(&placed.x, kept, 0.0, memory).is_empty() {
            return None;
        }
        let start = placed.x.clone();
        let mut metric = None;
        for _ in 0..ROUNDS {
            let near = self.near(&placed.x, kept, BESIDE, memory);
            if near.iter().all(|near| near.missing < TOLERANCE) {
                break;
            }
            let levers = Levers::new(rod, &placed.shape);
            let metric: &Vec<f64> = metric.get_or_insert_with(|| softness(rod, &levers));
            step(&levers, &near, metric, q);
            placed = self.place(rod, q);
        }
        start.iter().zip(&placed.x).map(|(a, b)| (a - b).norm()).reduce(f64::max)
    }

    /// The points `x` that are nearer to a body than `kept` and `more`, m.
    fn near(&self, x: &[Vector3<f64>], kept: &[f64], more: f64, memory: &mut Vec<Outside>) -> Vec<Near> {
        let within: Vec<f64> = kept.iter().map(|kept| kept + more).collect();
        let mut near = Vec::new();
        self.around.bodies.each_nearer((self.t, &self.poses), x, &within, memory, |i, distance, normal| {
            near.push(Near { point: i % x.len(), missing: kept[i] - distance, normal });
        });
        near
    }
}

/// How the points of a rod move with its unknowns, as if it bent at its nodes alone: enough where what is missed is seen in the next round.
struct Levers<'a> {
    rod: &'a Rod,
    shape: &'a Shape,
    /// At each node that has unknowns: the point, its frame times the arc over which it bends, m, and where that arc begins.
    nodes: Vec<(Vector3<f64>, Matrix3<f64>, usize)>,
}

impl<'a> Levers<'a> {
    fn new(rod: &'a Rod, shape: &'a Shape) -> Self {
        let poses: Vec<Pose> = shape.poses().collect();
        let node = |i: usize| {
            let point = rod.node_point(i);
            let arc = 0.5 * (rod.nodes[i + 1] - rod.nodes[i.saturating_sub(1)]);
            (poses[point].p, poses[point].r * arc, point)
        };
        Levers { rod, shape, nodes: (0..rod.nodes.len() - 1).map(node).collect() }
    }

    /// Row of the Jacobian of point `k` along the world direction `d`.
    fn row(&self, k: usize, d: &Vector3<f64>) -> Vec<f64> {
        let mut row = vec![0.0; self.rod.unknowns()];
        let x = self.shape.x(k);
        let upstream = self.nodes.iter().take_while(|(_, _, point)| *point < k);
        for (row, (at, frame, _)) in row.chunks_exact_mut(3).zip(upstream) {
            row.copy_from_slice(frame.tr_mul(&(x - at).cross(d)).as_slice());
        }
        row
    }
}

/// L of L Lᵀ = K + ∫ ρS ω² (∂x/∂q)ᵀ ∂x/∂q ds, ω² = g/L: of all ways out, the one is taken that moves a hair, elastic and hanging, least.
fn softness(rod: &Rod, levers: &Levers) -> Vec<f64> {
    let n = rod.unknowns();
    let mut metric = rod.elastic();
    let last = rod.nodes.len() - 1;
    let mass: f64 = rod.mass.iter().sum();
    for node in 1..=last {
        let span = rod.nodes[(node + 1).min(last)] - rod.nodes[node - 1];
        let weight = 0.5 * span / rod.length() * mass * G / rod.length();
        for axis in [Vector3::x(), Vector3::y(), Vector3::z()] {
            let row = levers.row(rod.node_point(node), &axis);
            for i in 0..n {
                let a = weight * row[i];
                metric[i * n..=i * n + i].iter_mut().zip(&row).for_each(|(m, b)| *m += a * b);
            }
        }
    }
    // It is positive definite as K is.
    cholesky::factor(&mut metric, n);
    metric
}

/// Moves the unknowns `q` least, in the metric whose factor is `metric`, so that no point of `near` is too near, to first order (projected Gauss-Seidel
/// on the dual problem).
fn step(levers: &Levers, near: &[Near], metric: &[f64], q: &mut [f64]) {
    let n = q.len();
    let row = |near: &Near| {
        let mut row = levers.row(near.point, &near.normal);
        cholesky::solve_lower(metric, n, &mut row);
        row
    };
    let rows: Vec<Vec<f64>> = near.iter().map(row).collect();
    let mut push = vec![0.0_f64; near.len()];
    let mut way = vec![0.0; n];
    for _ in 0..SWEEPS {
        for ((row, push), near) in rows.iter().zip(&mut push).zip(near) {
            let size = cholesky::dot(row, row);
            if size == 0.0 {
                continue;
            }
            let pushed = (*push + (near.missing.min(STRIDE) - cholesky::dot(row, &way)) / size).max(0.0);
            let more = pushed - *push;
            *push = pushed;
            way.iter_mut().zip(row).for_each(|(w, r)| *w += more * r);
        }
    }
    cholesky::solve_upper(metric, n, &mut way);
    q.iter_mut().zip(way).for_each(|(q, way)| *q += way);
}
