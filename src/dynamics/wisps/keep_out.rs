//! Keeping guides that follow out of bodies: as little as it takes is added to their strains, on from what was added the frame before.

use super::{Environment, G, Rest};
use crate::contact::ProximityCache;
use crate::math::cholesky;
use crate::math::se3::Pose;
use crate::rod::{LumpedSensitivity, Rod, RodShape};
use nalgebra::{Isometry3, Vector3};

/// Rounds of looking and moving at most: a way of 12 cm in a frame, beyond which it lags.
const ROUNDS: usize = 40;

/// Rounds of these at the end of the way at most: surfaces are curved, and so are the ways of the points.
const CORRECTIONS: usize = 8;

/// How near a place must be to be looked after while others are moved, m. What is not too near goes no farther than that in a round: it goes through nothing
/// that is not seen.
const BESIDE: f64 = 0.003;

/// How deep inside a body, m, a guide is still brought out the nearest way: as deep as a strand among others may be drawn into the round of a head. Beyond it the nearest way
/// may be that to the other side.
const DEEP: f64 = 0.02;

/// How much too near to a body a guide may stay, m.
const TOLERANCE: f64 = 2e-5;

/// How much is as good as that where rounds end otherwise, m: a fifth of the usual distance.
const PASSABLE: f64 = 1e-4;

/// How exactly a place is moved out to first order, m, and what is no motion.
const EXACT: f64 = 1e-6;

/// Give of what holds a place out, as a share of the guide's own there: what is held from two sides goes a moderate way.
const GIVE: f64 = 1e-4;

/// The bodies and the head at one moment.
pub(super) struct Moment<'a> {
    env: &'a Environment<'a>,
    t: f64,
    head: Isometry3<f64>,
    poses: Vec<Isometry3<f64>>,
}

/// A guide at a moment.
#[derive(Default)]
struct Placed {
    q: Vec<f64>,
    shape: RodShape,
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
    step: Step,
    /// The best so far, 1/m, and what was best on from the frame before.
    best: Vec<f64>,
    direct: Vec<f64>,
}

/// A guide that follows, for its being kept out.
pub(super) struct Led<'a> {
    pub rod: &'a Rod,
    pub rest: &'a Rest,
    /// Unknowns that it is led to, 1/m, and its places there, m, world.
    pub q: &'a [f64],
    pub places: &'a [Vector3<f64>],
    /// Unknowns at the end of the last frame, 1/m.
    pub before: &'a [f64],
}

/// How well something was kept out; less is better.
#[derive(Clone, Copy, PartialEq, PartialOrd)]
struct Left {
    /// Whether a place is left inside a body, deeper than it rested.
    inside: bool,
    /// How much one is too near at most, m, no less than what is passable.
    missing: f64,
}

/// The best that something came out.
struct Best {
    left: Left,
    /// How far its places went for that, m, in the mean.
    way: f64,
}

impl Placed {
    /// Puts a rod where unknowns `q`, 1/m, bend it at a moment.
    fn put(&mut self, rod: &Rod, q: &[f64], now: &Moment) {
        let root = now.root(rod);
        self.shape.update(rod, &root.r, q);
        self.shape.points_and_midpoints(rod, &root.p, &mut self.x);
    }

    /// Puts a guide where `out`, 1/m, keeps it.
    fn put_out(&mut self, led: &Led, out: &[f64], now: &Moment) {
        let mut q = std::mem::take(&mut self.q);
        q.clear();
        q.extend(led.q.iter().zip(out).map(|(q, out)| q + out));
        self.put(led.rod, &q, now);
        self.q = q;
    }
}

impl<'a> Moment<'a> {
    /// At time `t`, s.
    pub fn new(env: &'a Environment<'a>, t: f64) -> Self {
        let poses = env.body_poses(t);
        Moment { env, t, head: (env.head)(t), poses }
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
        self.env.bodies.each_point_within(
            at,
            &placed.x,
            most,
            &mut ProximityCache::default(),
            |i, distance, _| distances[i] = distance,
        );
        distances
    }

    /// Root of a rod, world.
    pub fn root(&self, rod: &Rod) -> Pose {
        Environment::root_on(&self.head, &rod.root)
    }

    /// Finds how a guide that is led is kept out of the bodies: by what `out`, 1/m, must be added to its unknowns that its places keep their distances, as far as
    /// they can. `out` is that of the frame before, empty where nothing kept it out; from there it goes on. Returns the mean way of its places, m, if there
    /// is any, infinite where it is left inside a body deeper than it rested. `memory` spares searches, as in
    /// [`Bodies::each_point_within`](crate::contact::Bodies::each_point_within); what is in `work` changes no result.
    pub fn bring_out(
        &self,
        led: &Led,
        out: &mut Vec<f64>,
        memory: &mut ProximityCache,
        work: &mut Work,
    ) -> Option<f64> {
        let kept = &led.rest.settled.kept;
        if out.is_empty() {
            self.look(led.places, kept, memory, &mut work.near);
            most_missing(&work.near)?;
            out.resize(led.q.len(), 0.0);
        }
        work.beside.clear();
        work.beside.extend(kept.iter().map(|kept| kept + BESIDE));
        let mut best = self.come_out(led, out, DEEP, memory, work);
        if best.left.inside {
            // It is led through something, or deep into it: it comes as it was bent before, on that side of what the head carries.
            work.direct.clone_from(&work.best);
            out.clear();
            out.extend(led.before.iter().zip(led.q).map(|(before, led)| before - led));
            let back = self.come_out(led, out, f64::INFINITY, memory, work);
            if back.left < best.left {
                best = back;
            } else {
                work.best.clone_from(&work.direct);
            }
        }
        out.clone_from(&work.best);
        if best.left.inside {
            return Some(f64::INFINITY);
        }
        if best.left.missing <= PASSABLE && out.iter().all(|out| *out == 0.0) {
            out.clear();
            return None;
        }
        Some(best.way)
    }

    /// Brings it out from where `out` puts it, which is changed, and gives up where it is deeper inside than `deep`, m. What came best is `best` of `work`.
    fn come_out(
        &self,
        led: &Led,
        out: &mut Vec<f64>,
        deep: f64,
        memory: &mut ProximityCache,
        work: &mut Work,
    ) -> Best {
        let kept = &led.rest.settled.kept;
        let metric = led.rest.metric(led.rod);
        work.placed.put_out(led, out, self);
        let mut found = Best { left: Left { inside: true, missing: f64::INFINITY }, way: 0.0 };
        let (mut arrived, mut still, mut corrections) = (false, false, 0);
        for round in 0..=ROUNDS {
            let Work { placed, before, beside, near, step, best, .. } = work;
            self.look(&placed.x, beside, memory, near);
            near.iter_mut().for_each(|near| near.missing -= BESIDE);
            let missing = most_missing(near).unwrap_or(0.0);
            let depths = near.iter().map(|near| near.missing - kept[near.at].max(0.0));
            let depth = depths.fold(0.0, f64::max);
            let now = Left {
                inside: near.iter().any(|n| n.missing > kept[n.at].max(TOLERANCE)),
                missing: missing.max(PASSABLE),
            };
            if now <= found.left {
                let ways = led.places.iter().zip(&placed.x).map(|(a, b)| (a - b).norm());
                found = Best { left: now, way: ways.sum::<f64>() / led.places.len() as f64 };
                best.clone_from(out);
            }
            let right = arrived && (missing <= TOLERANCE || corrections == CORRECTIONS);
            if depth > deep || still || right || round == ROUNDS {
                break;
            }
            corrections += usize::from(arrived);
            step.find(led.rod, placed, near, metric, out);
            before.clone_from(&placed.x);
            placed.put_out(led, &step.out, self);
            let ways = before.iter().zip(&placed.x).map(|(a, b)| (a - b).norm());
            let way = ways.fold(0.0, f64::max);
            // What is too near goes as far as that takes.
            let most = BESIDE.max(2.0 * missing);
            (arrived, still) = (way <= most, way < EXACT);
            if arrived {
                out.clone_from(&step.out);
            } else {
                let share = most / way;
                out.iter_mut().zip(&step.out).for_each(|(out, to)| *out += share * (to - *out));
                placed.put_out(led, out, self);
            }
        }
        found
    }

    /// Notes those of the places `x` that are nearer to a body than `within`, m, in order.
    fn look(&self, x: &[Vector3<f64>], within: &[f64], memory: &mut ProximityCache, near: &mut Vec<Near>) {
        near.clear();
        self.env.bodies.each_point_within(
            (self.t, &self.poses),
            x,
            within,
            memory,
            |at, distance, normal| {
                near.push(Near { at, missing: within[at] - distance, normal });
            },
        );
    }
}

fn most_missing(near: &[Near]) -> Option<f64> {
    near.iter().map(|near| near.missing).reduce(f64::max)
}

/// L of L Lᵀ = K + ∫ ρS ω² (∂x/∂q)ᵀ ∂x/∂q ds, ω² = g/L, of `rod` in `shape`: of all ways out, the one is taken that moves a hair, elastic and hanging, least.
pub(super) fn softness(rod: &Rod, shape: &RodShape) -> Vec<f64> {
    let mut metric =
        LumpedSensitivity::new(rod, shape).mass_matrix(|node| rod.lumped_mass(node) * G / rod.length());
    metric.iter_mut().zip(rod.elastic_matrix()).for_each(|(m, k)| *m += k);
    // It is positive definite as K is.
    cholesky::factor(&mut metric, rod.unknowns());
    metric
}

/// The least change of unknowns in a metric with which no place is too near, to first order (eq. 8.6 of `docs/theory.md`): by non-negative least squares of
/// the dual problem, what pushes being found one by one (Lawson & Hanson 1974, chapter 23).
#[derive(Default)]
struct Step {
    /// The change, 1/m.
    out: Vec<f64>,
    /// How far each place must go out from where nothing is changed, m.
    wanted: Vec<f64>,
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
    /// Of a rod that is `placed` so by a change `out`, with L from [`softness`].
    fn find(&mut self, rod: &Rod, placed: &Placed, near: &[Near], metric: &[f64], out: &[f64]) {
        let n = rod.unknowns();
        let levers = LumpedSensitivity::new(rod, &placed.shape);
        self.rows.resize(n * near.len(), 0.0);
        for (row, near) in self.rows.chunks_exact_mut(n).zip(near) {
            let place = near.at % placed.x.len();
            let end = place.checked_sub(rod.points()).map_or(place, |segment| segment + 1);
            levers.set_row(end, &(placed.x[place] - placed.x[0]), &near.normal, row);
        }
        self.wanted.clear();
        let wanted = |(near, row): (&Near, &[f64])| near.missing + cholesky::dot(row, out);
        self.wanted.extend(near.iter().zip(self.rows.chunks_exact(n)).map(wanted));
        self.solve(n, metric);
    }

    /// Of `n` unknowns, whose rows are there, and what is wanted.
    fn solve(&mut self, n: usize, metric: &[f64]) {
        let Step { out: way, wanted, rows, held, reduced, push, normal, next } = self;
        let row = |k: usize| &rows[k * n..][..n];
        way.clear();
        way.resize(n, 0.0);
        held.clear();
        reduced.clear();
        push.clear();
        // It hardly takes more than all unknowns.
        for _ in 0..2 * n {
            let missing = |k: usize| wanted[k] - cholesky::dot(row(k), way);
            let free = (0..wanted.len()).filter(|k| !held.contains(k)).map(|k| (missing(k), k));
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
                next.extend(held.iter().map(|k| wanted[*k]));
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
    use crate::geometry::Shape as Solid;
    use crate::rod::{RodSource, SegmentSize, Taper};
    use crate::scene::Tree;
    use nalgebra::UnitQuaternion;

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
            natural_strain: None,
            segment_size: SegmentSize::FINE,
        })
        .unwrap()
    }

    /// A hair that was brought out: its mean way, its places, and the distance of each from each body.
    struct BroughtOut {
        way: Option<f64>,
        x: Vec<Vector3<f64>>,
        distances: Vec<f64>,
    }

    /// Calls `done` with what brings out a hair that is led to unknowns among `solids`, from those of the frame before and from what kept it out then.
    fn among(
        solids: &[Solid],
        done: impl FnOnce(&mut dyn FnMut(&[f64], &[f64], &mut Vec<f64>) -> BroughtOut),
    ) {
        let env = Environment::at_rest(Bodies::from_shapes(solids));
        let (now, rod) = (Moment::new(&env, 0.0), hair());
        let places = 2 * rod.points() - 1;
        let kept = vec![5e-4; solids.len() * places];
        let far = vec![1.0; kept.len()];
        let rest = Rest::new(&rod, Settled { q: vec![0.0; rod.unknowns()], kept });
        let (mut memory, mut work) = (ProximityCache::default(), Work::default());
        done(&mut |q, before, out| {
            let mut placed = Placed::default();
            placed.put(&rod, q, &now);
            let led = Led { rod: &rod, rest: &rest, q, places: &placed.x, before };
            let way = now.bring_out(&led, out, &mut memory, &mut work);
            let at: Vec<f64> = q.iter().enumerate().map(|(n, q)| q + out.get(n).unwrap_or(&0.0)).collect();
            placed.put(&rod, &at, &now);
            BroughtOut { way, distances: now.distances(&rod, &at, &far), x: placed.x }
        });
    }

    /// What a hair that is led straight along x comes to beside balls, first so: the change of its unknowns, the way it went on average, and the distance of
    /// each place.
    fn beside(balls: &[(Vector3<f64>, f64)]) -> (Vec<f64>, Option<f64>, Vec<f64>) {
        let solids: Vec<_> = balls.iter().map(|&(centre, radius)| Solid::Sphere { centre, radius }).collect();
        let (straight, mut out) = (vec![0.0; hair().unknowns()], Vec::new());
        let mut found = (None, Vec::new());
        among(&solids, |bring_out| {
            let BroughtOut { way, distances, .. } = bring_out(&straight, &straight, &mut out);
            found = (way, distances);
        });
        out.resize(straight.len(), 0.0);
        (out, found.0, found.1)
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
    fn what_is_led_through_something_thin_stays_on_its_side() {
        let (rotation, radii) = (UnitQuaternion::identity(), Vector3::new(0.001, 0.08, 0.08));
        let plate = Solid::Ellipsoid { centre: Vector3::new(0.06, 0.0, 0.0), radii, rotation };
        let straight = vec![0.0; hair().unknowns()];
        among(&[plate], |bring_out| {
            // It always was in it: there is no near way out.
            assert_eq!(bring_out(&straight, &straight, &mut Vec::new()).way, Some(f64::INFINITY));
            // Before it was rolled up, and did not reach that far.
            let rolled: Vec<f64> = (0..straight.len()).map(|n| if n % 3 == 1 { 30.0 } else { 0.0 }).collect();
            let mut out = Vec::new();
            let first = bring_out(&straight, &rolled, &mut out);
            let nearest = first.distances.iter().copied().fold(1.0, f64::min);
            assert!((5e-4 - TOLERANCE..6e-4).contains(&nearest), "{nearest}");
            assert!(first.x.iter().all(|x| x.x < 0.06), "{:?}", first.x);
            // Led there again it stays, and led before it, it is let go.
            let (kept, before) = (out.clone(), out.clone());
            let again = bring_out(&straight, &before, &mut out);
            let moved = first.x.iter().zip(&again.x).map(|(a, b)| (a - b).norm()).fold(0.0, f64::max);
            assert!(moved < 2e-4 && kept != straight, "{moved}");
            let free = bring_out(&rolled, &kept, &mut out);
            assert_eq!((free.way, out.is_empty()), (None, true));
        });
    }

    #[test]
    fn it_goes_on_without_a_jump_from_frame_to_frame() {
        // It is led into a ball from above, and out of it again.
        let solid = Solid::Sphere { centre: Vector3::new(0.06, -0.03, 0.0), radius: 0.03 };
        let n = hair().unknowns();
        let led = |k: usize| -> Vec<f64> {
            let bend = 6.0 - 0.2 * (60.0 - (k as f64 - 60.0).abs());
            (0..n).map(|n| if n % 3 == 1 { bend } else { 0.0 }).collect()
        };
        among(&[solid], |bring_out| {
            let (mut out, mut before) = (Vec::new(), led(0));
            let mut x: Option<Vec<Vector3<f64>>> = None;
            let (mut largest, mut held) = (0.0_f64, 0);
            for k in 0..=120 {
                let now = bring_out(&led(k), &before, &mut out);
                before = led(k).iter().enumerate().map(|(n, q)| q + out.get(n).unwrap_or(&0.0)).collect();
                held += u32::from(now.way.is_some());
                if let Some(x) = x {
                    let ways = x.iter().zip(&now.x).map(|(a, b)| (a - b).norm());
                    largest = ways.fold(largest, f64::max);
                }
                x = Some(now.x);
            }
            // Where nothing holds it, its tip goes ½ 0.2/m (10 cm)² from one to the next.
            assert!(largest < 1.1e-3, "{largest}");
            assert!(held > 40 && held < 100 && out.is_empty(), "{held} {out:?}");
        });
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
            step.wanted = (0..8).map(|_| 0.01 * number()).collect();
            step.solve(6, &unit);
            let Step { out: way, wanted, rows, held, push, .. } = &step;
            // The conditions of Karush, Kuhn and Tucker: of a convex problem they are enough.
            for (k, row) in rows.chunks_exact(6).enumerate() {
                let missing = wanted[k] - cholesky::dot(row, way);
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
