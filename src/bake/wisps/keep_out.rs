//! Keeping guides that follow out of bodies, at each moment by itself: as little as it takes is added to their strains, so that what they do is as
//! continuous as what they follow.

use super::{G, Rest, Surroundings};
use crate::contact::Memory;
use crate::math::cholesky;
use crate::math::se3::Pose;
use crate::rod::{Levers, Rod, Shape};
use nalgebra::{Isometry3, Vector3};

/// Rounds of looking and moving, at most: surfaces are curved, and so are the ways of the points.
const ROUNDS: usize = 8;

/// Farthest that a point is moved out in a round, m: what is deeper is near to another place of the surface afterwards.
const STRIDE: f64 = 0.01;

/// How near a place must be to be looked after while others are moved, m.
const BESIDE: f64 = 0.002;

/// How much too near to a body a guide may stay, m.
const TOLERANCE: f64 = 2e-5;

/// How exactly a place is moved out to first order, m.
const EXACT: f64 = 1e-6;

/// Give of what holds a place out, as a share of the guide's own there: what is held from two sides goes a moderate way.
const GIVE: f64 = 0.01;

/// The bodies and the head at one moment.
pub(super) struct Moment<'a> {
    around: &'a Surroundings<'a>,
    t: f64,
    head: Isometry3<f64>,
    poses: Vec<Isometry3<f64>>,
}

/// A guide at a moment.
#[derive(Default)]
struct Placed {
    shape: Shape,
    /// Its places, m, world: the points, then the middles of the curve between any two.
    x: Vec<Vector3<f64>>,
}

/// A place near a body: which and of which body, as in [`Moment::distances`], by how much it is too near, m, and the body's outward normal.
#[derive(Clone, Copy)]
struct Near {
    at: usize,
    missing: f64,
    normal: Vector3<f64>,
}

/// Workspace of a thread.
#[derive(Default)]
pub(super) struct Work {
    placed: Placed,
    /// Where the places were before they were moved, m, world.
    before: Vec<Vector3<f64>>,
    /// How near to the bodies places are looked after, m, as in [`Moment::distances`].
    beside: Vec<f64>,
    near: Vec<Near>,
    found: Vec<Near>,
    step: Step,
    /// The best unknowns so far, 1/m.
    best: Vec<f64>,
}

impl Placed {
    /// Puts a rod where unknowns `q`, 1/m, bend it at a moment.
    fn put(&mut self, rod: &Rod, q: &[f64], now: &Moment) {
        let root = now.root(rod);
        self.shape.update(rod, &root.r, q);
        self.shape.places(rod, &root.p, &mut self.x);
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
        self.around.bodies.each_nearer(at, &placed.x, most, &mut Memory::default(), |i, distance, _| {
            distances[i] = distance
        });
        distances
    }

    /// Root of a rod, world.
    pub fn root(&self, rod: &Rod) -> Pose {
        Surroundings::rooted(&self.head, &rod.root)
    }

    /// Moves a rod that is `rest` at rest, at unknowns `q`, 1/m, with its places at `led`, m, world, out of the bodies until its places keep their distances,
    /// as far as it can; returns the mean way of its places, m, if there is any, infinite where it is left inside a body deeper than it rested. `memory` spares
    /// searches, as in [`Bodies::each_nearer`](crate::contact::Bodies::each_nearer); what is in `work` changes no result.
    pub fn bring_out(
        &self,
        rod: &Rod,
        rest: &Rest,
        (q, led): (&mut [f64], &[Vector3<f64>]),
        memory: &mut Memory,
        work: &mut Work,
    ) -> Option<f64> {
        let Work { placed, before, beside, near, found, step, best } = work;
        let kept = &rest.settled.kept;
        self.look(led, kept, memory, found);
        let mut least = most_missing(found)?;
        beside.clear();
        beside.extend(kept.iter().map(|kept| kept + BESIDE));
        self.look(led, beside, memory, near);
        near.iter_mut().for_each(|near| near.missing -= BESIDE);
        let metric = rest.metric(rod);
        best.clear();
        best.extend_from_slice(q);
        let is_inside = |found: &[Near]| found.iter().any(|n| n.missing > kept[n.at].max(TOLERANCE));
        let mut inside = is_inside(found);
        placed.put(rod, q, self);
        for _ in 0..ROUNDS {
            if least < TOLERANCE {
                break;
            }
            step.find(rod, placed, near, metric);
            q.iter_mut().zip(&step.way).for_each(|(q, way)| *q += way);
            before.clone_from(&placed.x);
            placed.put(rod, q, self);
            // What is not seen too near is where it was seen last, to first order.
            for near in near.iter_mut() {
                let place = near.at % led.len();
                near.missing -= near.normal.dot(&(placed.x[place] - before[place]));
            }
            self.look(&placed.x, kept, memory, found);
            for found in found.iter() {
                match near.binary_search_by_key(&found.at, |near| near.at) {
                    Ok(known) => near[known] = *found,
                    Err(new) => near.insert(new, *found),
                }
            }
            let missing = most_missing(found).unwrap_or(0.0);
            if missing < least {
                least = missing;
                inside = is_inside(found);
                best.copy_from_slice(q);
            }
        }
        if best != q {
            q.copy_from_slice(best);
            placed.put(rod, q, self);
        }
        if inside {
            return Some(f64::INFINITY);
        }
        let ways = led.iter().zip(&placed.x).map(|(a, b)| (a - b).norm());
        Some(ways.sum::<f64>() / led.len() as f64)
    }

    /// Notes those of the places `x` that are nearer to a body than `within`, m, in order.
    fn look(&self, x: &[Vector3<f64>], within: &[f64], memory: &mut Memory, near: &mut Vec<Near>) {
        near.clear();
        self.around.bodies.each_nearer((self.t, &self.poses), x, within, memory, |at, distance, normal| {
            near.push(Near { at, missing: within[at] - distance, normal });
        });
    }
}

fn most_missing(near: &[Near]) -> Option<f64> {
    near.iter().map(|near| near.missing).reduce(f64::max)
}

/// L of L Lᵀ = K + ∫ ρS ω² (∂x/∂q)ᵀ ∂x/∂q ds, ω² = g/L, of `rod` in `shape`: of all ways out, the one is taken that moves a hair, elastic and hanging, least.
pub(super) fn softness(rod: &Rod, shape: &Shape) -> Vec<f64> {
    let mut metric = Levers::new(rod, shape).squares(|node| rod.mass_at(node) * G / rod.length());
    metric.iter_mut().zip(rod.elastic()).for_each(|(m, k)| *m += k);
    // It is positive definite as K is.
    cholesky::factor(&mut metric, rod.unknowns());
    metric
}

/// The least way of unknowns in a metric with which no place is too near, to first order (eq. 8.3a of `docs/theory.md`): by non-negative least squares of
/// the dual problem, what pushes being found one by one (Lawson & Hanson 1974, chapter 23).
#[derive(Default)]
struct Step {
    /// The way, 1/m.
    way: Vec<f64>,
    /// How far each place goes out with each unknown, m².
    rows: Vec<f64>,
    /// What pushes: which, its row times L⁻ᵀ, and by how much.
    held: Vec<usize>,
    reduced: Vec<f64>,
    push: Vec<f64>,
    normal: Vec<f64>,
    next: Vec<f64>,
}

impl Step {
    /// Of a rod that is `placed` so, with L from [`softness`].
    fn find(&mut self, rod: &Rod, placed: &Placed, near: &[Near], metric: &[f64]) {
        let n = rod.unknowns();
        let levers = Levers::new(rod, &placed.shape);
        self.rows.resize(n * near.len(), 0.0);
        for (row, near) in self.rows.chunks_exact_mut(n).zip(near) {
            let place = near.at % placed.x.len();
            let end = place.checked_sub(rod.points()).map_or(place, |segment| segment + 1);
            levers.set_row(end, &(placed.x[place] - placed.x[0]), &near.normal, row);
        }
        self.solve(n, near, metric);
    }

    /// Of `n` unknowns, whose rows are there.
    fn solve(&mut self, n: usize, near: &[Near], metric: &[f64]) {
        let Step { way, rows, held, reduced, push, normal, next } = self;
        let wanted = |k: usize| near[k].missing.min(STRIDE);
        let row = |k: usize| &rows[k * n..][..n];
        way.clear();
        way.resize(n, 0.0);
        held.clear();
        reduced.clear();
        push.clear();
        // It hardly takes more than all unknowns.
        for _ in 0..2 * n {
            let missing = |k: usize| wanted(k) - cholesky::dot(row(k), way);
            let free = (0..near.len()).filter(|k| !held.contains(k)).map(|k| (missing(k), k));
            let Some((missing, k)) = free.reduce(|a, b| if b.0 > a.0 { b } else { a }) else { break };
            if missing < EXACT {
                break;
            }
            held.push(k);
            push.push(0.0);
            reduced.extend_from_slice(row(k));
            cholesky::solve_lower(metric, n, &mut reduced[(held.len() - 1) * n..]);
            loop {
                let m = held.len();
                normal.clear();
                for (i, a) in reduced.chunks_exact(n).enumerate() {
                    normal.extend(reduced.chunks_exact(n).take(i + 1).map(|b| cholesky::dot(a, b)));
                    normal.resize((i + 1) * m, 0.0);
                    normal[i * m + i] += GIVE * normal[i * m + i] + f64::MIN_POSITIVE;
                }
                next.clear();
                next.extend(held.iter().map(|k| wanted(*k)));
                cholesky::factor(normal, m);
                cholesky::solve(normal, m, next);
                // As far as none pulls.
                let pulls = push.iter().zip(next.iter()).enumerate().filter(|(_, (_, next))| **next <= 0.0);
                let shares = pulls.map(|(i, (push, next))| (push / (push - next), i));
                let Some((share, first)) = shares.reduce(|a, b| if b.0 < a.0 { b } else { a }) else { break };
                push.iter_mut().zip(next.iter()).for_each(|(push, next)| *push += share * (next - *push));
                held.remove(first);
                push.remove(first);
                reduced.drain(first * n..(first + 1) * n);
            }
            push.clone_from(next);
            way.fill(0.0);
            for (row, push) in reduced.chunks_exact(n).zip(push.iter()) {
                way.iter_mut().zip(row).for_each(|(w, r)| *w += push * r);
            }
            cholesky::solve_upper(metric, n, way);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::Settled;
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
    fn beside(balls: &[(Vector3<f64>, f64)]) -> (Vec<f64>, Option<f64>, Vec<f64>) {
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
        let kept = vec![5e-4; balls.len() * places];
        let far = vec![1.0; kept.len()];
        let rest = Rest::new(&rod, Settled { q: q.clone(), kept });
        let mut placed = Placed::default();
        placed.put(&rod, &q, &now);
        let way =
            now.bring_out(&rod, &rest, (&mut q, &placed.x), &mut Memory::default(), &mut Work::default());
        let distances = now.distances(&rod, &q, &far);
        (q, way, distances)
    }

    #[test]
    fn points_and_what_is_between_them_are_brought_out() {
        // In the first ball there is a point, in the second, a little later, only the middle between two.
        let deep = (Vector3::new(0.04, -0.008, 0.001), 0.01);
        let between = (Vector3::new(0.085, 0.0045, 0.0), 0.005);
        for balls in [&[deep][..], &[between], &[deep, between]] {
            let (q, way, distances) = beside(balls);
            let nearest = distances.iter().copied().fold(1.0, f64::min);
            assert!((5e-4 - TOLERANCE..5e-3).contains(&nearest), "{balls:?}: {nearest}");
            assert!(way.unwrap() < 0.006 && q.iter().all(|q| q.abs() < 30.0), "{balls:?}: {way:?} {q:?}");
        }
    }

    #[test]
    fn what_does_not_come_out_is_told() {
        // Between balls that leave it less room than it keeps, and between balls that leave it none.
        let between =
            |height: f64| beside(&[height, -height].map(|y| (Vector3::new(0.06, y, 0.0), 0.01))).1.unwrap();
        let [pressed, swallowed] = [0.0103, 0.0098].map(between);
        assert!(pressed < 1e-3 && swallowed == f64::INFINITY, "{pressed} {swallowed}");
    }

    #[test]
    fn what_is_far_enough_stays_as_it_is_led() {
        let (q, way, _) = beside(&[(Vector3::new(0.05, -0.011, 0.0), 0.01)]);
        assert_eq!((way, q.iter().all(|q| *q == 0.0)), (None, true));
    }

    #[test]
    fn it_goes_on_without_a_jump_as_a_body_comes_nearer() {
        let at = |height: f64| beside(&[(Vector3::new(0.06, height, 0.0), 0.01)]).0;
        let ways: Vec<Vec<f64>> = (0..=60).map(|k| at(-0.011 + 5e-5 * f64::from(k))).collect();
        let step = |w: &[Vec<f64>]| w[0].iter().zip(&w[1]).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        let largest = ways.windows(2).map(step).fold(0.0, f64::max);
        // As far in all as in sixty even steps, each but a few times of that: what stays undone within the tolerance is done at once.
        let whole = step(&[ways[0].clone(), ways[60].clone()]);
        assert!(whole > 1.0 && largest < 0.15 * whole, "{largest} of {whole}");
    }

    #[test]
    fn the_least_way_is_where_what_pushes_is_just_met_and_nothing_else_is_missed() {
        let (mut step, mut random) = (Step::default(), 1_u64);
        let mut number = || {
            random = random.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
            (random >> 33) as f64 / f64::from(u32::MAX >> 1) - 0.5
        };
        let unit: Vec<f64> = (0..36).map(|i| f64::from(i % 7 == 0)).collect();
        let mut most = 0;
        for _ in 0..200 {
            step.rows = (0..48).map(|_| number()).collect();
            let near: Vec<Near> =
                (0..8).map(|at| Near { at, missing: 0.01 * number(), normal: Vector3::zeros() }).collect();
            step.solve(6, &near, &unit);
            let Step { way, rows, held, push, .. } = &step;
            // The conditions of Karush, Kuhn and Tucker: of a convex problem they are enough.
            for (k, row) in rows.chunks_exact(6).enumerate() {
                let missing = near[k].missing - cholesky::dot(row, way);
                match held.iter().position(|held| *held == k) {
                    None => assert!(missing < EXACT, "{k}: {missing}"),
                    Some(i) => {
                        let given = GIVE * cholesky::dot(row, row) * push[i];
                        assert!(push[i] > 0.0 && (missing - given).abs() < 1e-9, "{k}: {missing} {given}");
                    }
                }
            }
            let pushed =
                |n: usize| held.iter().zip(push).map(|(k, push)| push * rows[6 * k + n]).sum::<f64>();
            assert!((0..6).all(|n| (way[n] - pushed(n)).abs() < 1e-12));
            most = most.max(held.len());
        }
        assert!(most > 3, "{most}");
    }
}
