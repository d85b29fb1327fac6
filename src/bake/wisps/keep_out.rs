//! Keeping guides that follow out of bodies, at each moment by itself: as little as it takes is added to their strains, so that what they do is as
//! continuous as what they follow.

use super::{G, Surroundings};
use crate::contact::Outside;
use crate::math::cholesky;
use crate::rod::{Levers, Rod, Shape};
use nalgebra::{Isometry3, Vector3};

/// Rounds of looking and moving, at most: surfaces are curved, and so are the ways of the points.
const ROUNDS: usize = 8;

/// Sweeps of a round.
const SWEEPS: usize = 20;

/// Farthest that a point is moved out in a round, m: what is deeper is near to another place of the surface afterwards.
const STRIDE: f64 = 0.01;

/// How near a place must be to be looked after while others are moved, m.
const BESIDE: f64 = 0.002;

/// How much too near to a body a guide may stay, m.
const TOLERANCE: f64 = 2e-5;

/// The bodies and the head at one moment.
pub(super) struct Moment<'a> {
    around: &'a Surroundings<'a>,
    t: f64,
    head: Isometry3<f64>,
    poses: Vec<Isometry3<f64>>,
}

/// A guide at a moment.
#[derive(Default)]
pub(super) struct Placed {
    shape: Shape,
    /// Its places, m, world: the points, then the middles of the curve between any two.
    x: Vec<Vector3<f64>>,
}

/// A place near a body: which, by how much it is too near, m, and the body's outward normal.
struct Near {
    place: usize,
    missing: f64,
    normal: Vector3<f64>,
}

impl Placed {
    /// Puts a rod where unknowns `q`, 1/m, bend it at a moment.
    fn put(&mut self, rod: &Rod, q: &[f64], now: &Moment) {
        let root = Surroundings::rooted(&now.head, &rod.root);
        self.shape.update(rod, &root.r, q);
        self.x.clear();
        self.x.extend((0..rod.points()).map(|k| self.shape.x(k) + root.p));
        for (k, arc) in rod.arc.windows(2).enumerate() {
            // Of the cubic with the tangents of both ends.
            let bulge = (self.shape.tangent(k) - self.shape.tangent(k + 1)) * (0.125 * (arc[1] - arc[0]));
            self.x.push(0.5 * (self.x[k] + self.x[k + 1]) + bulge);
        }
    }
}

impl<'a> Moment<'a> {
    /// At time `t`, s.
    pub fn new(around: &'a Surroundings<'a>, t: f64) -> Self {
        let poses = (0..around.bodies.len()).map(|b| (around.body)(b, t)).collect();
        Moment { around, t, head: (around.head)(t), poses }
    }

    /// When it is, s.
    pub fn time(&self) -> f64 {
        self.t
    }

    /// Distance of each place of a rod at unknowns `q`, 1/m, from each body, m, but no more than `most` says there; at body b and place k at
    /// `b * places + k`, the points first, then the middles between any two.
    pub fn distances(&self, rod: &Rod, q: &[f64], most: &[f64]) -> Vec<f64> {
        let mut distances = most.to_vec();
        let mut placed = Placed::default();
        placed.put(rod, q, self);
        let at = (self.t, &self.poses[..]);
        self.around
            .bodies
            .each_nearer(at, &placed.x, most, &mut Vec::new(), |i, distance, _| distances[i] = distance);
        distances
    }

    /// Moves a rod at unknowns `q`, 1/m, out of the bodies until its places keep the distances `kept`, m, as in [`Moment::distances`], as far as it can;
    /// returns the mean way of its places, m, if there is any. `memory` spares searches and changes no result, nor does what is in `placed`.
    pub fn bring_out(
        &self,
        rod: &Rod,
        kept: &[f64],
        q: &mut [f64],
        memory: &mut Vec<Outside>,
        placed: &mut Placed,
    ) -> Option<f64> {
        placed.put(rod, q, self);
        if self.near(&placed.x, kept, memory).is_empty() {
            return None;
        }
        let start = placed.x.clone();
        let beside: Vec<f64> = kept.iter().map(|kept| kept + BESIDE).collect();
        let mut metric = None;
        for _ in 0..ROUNDS {
            let mut near = self.near(&placed.x, &beside, memory);
            near.iter_mut().for_each(|near| near.missing -= BESIDE);
            if near.iter().all(|near| near.missing < TOLERANCE) {
                break;
            }
            let levers = Levers::new(rod, &placed.shape);
            let metric: &Vec<f64> = metric.get_or_insert_with(|| softness(rod, &levers));
            step(rod, placed, &levers, &near, metric, q);
            placed.put(rod, q, self);
        }
        let ways = start.iter().zip(&placed.x).map(|(a, b)| (a - b).norm());
        Some(ways.sum::<f64>() / start.len() as f64)
    }

    /// The places `x` that are nearer to a body than `kept`, m.
    fn near(&self, x: &[Vector3<f64>], kept: &[f64], memory: &mut Vec<Outside>) -> Vec<Near> {
        let mut near = Vec::new();
        self.around.bodies.each_nearer((self.t, &self.poses), x, kept, memory, |i, distance, normal| {
            near.push(Near { place: i % x.len(), missing: kept[i] - distance, normal });
        });
        near
    }
}

/// L of L Lᵀ = K + ∫ ρS ω² (∂x/∂q)ᵀ ∂x/∂q ds, ω² = g/L: of all ways out, the one is taken that moves a hair, elastic and hanging, least.
fn softness(rod: &Rod, levers: &Levers) -> Vec<f64> {
    let mut metric = levers.squares(|node| rod.mass_at(node) * G / rod.length());
    metric.iter_mut().zip(rod.elastic()).for_each(|(m, k)| *m += k);
    // It is positive definite as K is.
    cholesky::factor(&mut metric, rod.unknowns());
    metric
}

/// Moves the unknowns `q` least, in the metric whose factor is `metric`, so that no point of `near` is too near, to first order (projected Gauss-Seidel
/// on the dual problem).
fn step(rod: &Rod, placed: &Placed, levers: &Levers, near: &[Near], metric: &[f64], q: &mut [f64]) {
    let n = q.len();
    let row = |near: &Near| {
        let end = near.place.checked_sub(rod.points()).map_or(near.place, |segment| segment + 1);
        let x = placed.x[near.place] - placed.x[0];
        let mut row = levers.row(end, &x, &near.normal);
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::contact::Bodies;
    use crate::rod::{Cut, RodSource, Taper};
    use crate::scene::{Shape as Solid, Tree};

    /// A hair of 10 cm along x, of points 1 cm apart.
    fn hair() -> Rod {
        Rod::new(&RodSource {
            points: &[Vector3::zeros(), Vector3::x() * 0.1],
            root_frame: None,
            arc: &Tree::default_arc(6),
            stiffness: [7.8e-9, 7.8e-9, 3.6e-9],
            line_density: 6.6e-6,
            damping: 0.0,
            taper: Taper::NONE,
            natural: None,
            cut: Cut::FINE,
        })
        .unwrap()
    }

    /// What a hair that is led straight along x comes to beside balls: its unknowns, the way it went on average, and the distance of each place.
    fn beside(balls: &[(Vector3<f64>, f64)], kept: f64) -> (Vec<f64>, Option<f64>, Vec<f64>) {
        let solids: Vec<_> = balls.iter().map(|&(centre, radius)| Solid::Sphere { centre, radius }).collect();
        let bodies = Bodies::from_shapes(&solids);
        let around = Surroundings {
            head: &|_| Isometry3::identity(),
            gravity: &|_| Vector3::y() * -9.81,
            wind: &[],
            bodies: &bodies,
            body: &|_, _| Isometry3::identity(),
            carrier: &|_, _| Isometry3::identity(),
            brought_out: &|_| 1.0,
        };
        let (now, rod) = (Moment::new(&around, 0.0), hair());
        let places = 2 * rod.points() - 1;
        let mut q = vec![0.0; rod.unknowns()];
        let kept = vec![kept; balls.len() * places];
        let way = now.bring_out(&rod, &kept, &mut q, &mut Vec::new(), &mut Placed::default());
        let distances = now.distances(&rod, &q, &vec![1.0; kept.len()]);
        (q, way, distances)
    }

    #[test]
    fn points_and_what_is_between_them_are_brought_out() {
        // In the first ball there is a point, in the second, a little later, only the middle between two.
        let deep = (Vector3::new(0.04, -0.008, 0.001), 0.01);
        let between = (Vector3::new(0.085, 0.0045, 0.0), 0.005);
        for balls in [&[deep][..], &[between], &[deep, between]] {
            let (q, way, distances) = beside(balls, 5e-4);
            let nearest = distances.iter().copied().fold(1.0, f64::min);
            assert!((5e-4 - TOLERANCE..5e-3).contains(&nearest), "{balls:?}: {nearest}");
            assert!(way.unwrap() < 0.006 && q.iter().all(|q| q.abs() < 30.0), "{balls:?}: {way:?} {q:?}");
        }
    }

    #[test]
    fn what_is_far_enough_stays_as_it_is_led() {
        let (q, way, _) = beside(&[(Vector3::new(0.05, -0.011, 0.0), 0.01)], 5e-4);
        assert_eq!((way, q.iter().all(|q| *q == 0.0)), (None, true));
    }

    #[test]
    fn it_goes_on_without_a_jump_as_a_body_comes_nearer() {
        let at = |height: f64| beside(&[(Vector3::new(0.06, height, 0.0), 0.01)], 5e-4).0;
        let ways: Vec<Vec<f64>> = (0..=60).map(|k| at(-0.011 + 5e-5 * f64::from(k))).collect();
        let step = |w: &[Vec<f64>]| w[0].iter().zip(&w[1]).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        let largest = ways.windows(2).map(step).fold(0.0, f64::max);
        // As far in all as in sixty even steps, each but a few times of that: what stays undone within the tolerance is done at once.
        let whole = step(&[ways[0].clone(), ways[60].clone()]);
        assert!(whole > 1.0 && largest < 0.15 * whole, "{largest} of {whole}");
    }
}
