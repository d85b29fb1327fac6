//! Several rods stepped at once, one per SIMD lane.
//!
//! The kernels are those of one rod ([`crate::math::lanes`]), so the result of a rod has the same bits in any
//! pack. The rods of a pack have the same number of nodes. A rod with fewer segments in an element than
//! another gets segments of zero length, which contribute nothing.

use super::model::Rod;
use super::newton::{NewtonOutcome, Solver};
use super::potential::{Load, PointMoment, PointSpring, StrainSpring};
use super::segment::{RodCore, Segment};
use super::shape::{MagnusExponent, RodShape};
use crate::math::lanes::{self, Lane, M3, MAX_LANES, Real, Twist, V3};
use crate::math::se3::{Coefficients, Pose};
use nalgebra::{Matrix3, Vector3};
use pulp::{Arch, Simd, WithSimd};
use std::any::Any;

/// Rods that are stepped at once. Type-erased: the lanes depend on the processor.
pub struct Pack(Box<dyn Any + Send + Sync>);

/// Buffers for the steps of packs, one pack at a time. Reuse avoids allocation.
#[derive(Default)]
pub struct PackBuffers(Option<Box<dyn Any + Send>>);

/// The step of one rod of a pack.
pub struct StepTask<'a> {
    /// Root frame at the end of the step, world axes.
    pub root: &'a Matrix3<f64>,
    /// Loads on the rod.
    pub load: &'a Load,
    /// Unknowns, 1/m: in, one start of the solve; out, its result.
    pub q: &'a mut [f64],
    /// Other unknowns, 1/m: the solve starts from these if their Φ is lower than that of `q`.
    pub other_start: &'a [f64],
    /// Output: shape at the result.
    pub shape: &'a mut RodShape,
    /// Output: outcome of the solve.
    pub outcome: &'a mut NewtonOutcome,
}

/// A request for the points of one rod of a pack.
pub struct PointsTask<'a> {
    /// Root pose, world.
    pub root: Pose,
    /// Unknowns, 1/m.
    pub q: &'a [f64],
    /// Output: see [`RodShape::points_and_midpoints`].
    pub points: &'a mut Vec<Vector3<f64>>,
}

impl Pack {
    /// Number of rods that a pack takes on this processor.
    pub fn width() -> usize {
        Arch::new().dispatch(Width)
    }

    /// Packs one to [`Pack::width`] rods that are [alike](Rod::is_like).
    pub fn new(rods: &[&Rod]) -> Pack {
        Arch::new().dispatch(Gather(rods))
    }

    /// [`Solver::minimise`] for every rod, in the order of [`Pack::new`]. Entries beyond the rods are `None`.
    pub fn minimise(&self, tasks: &mut [Option<StepTask>; MAX_LANES], buffers: &mut PackBuffers) {
        Arch::new().dispatch(Minimise { pack: self, tasks, buffers });
    }

    /// [`RodShape::update`] and [`RodShape::points_and_midpoints`] for every rod with a task, in the order of
    /// [`Pack::new`]. Entries beyond the rods are `None`.
    pub fn evaluate_points(&self, tasks: &mut [Option<PointsTask>; MAX_LANES], buffers: &mut PackBuffers) {
        Arch::new().dispatch(EvaluatePoints { pack: self, tasks, buffers });
    }
}

struct Width;

impl WithSimd for Width {
    type Output = usize;
    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) -> usize {
        S::F64_LANES
    }
}

struct Gather<'a>(&'a [&'a Rod]);

impl WithSimd for Gather<'_> {
    type Output = Pack;
    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> Pack {
        Pack(Box::new(LaneRods::new(Lane::splat(simd, 0.0), self.0)))
    }
}

struct Minimise<'a, 'b> {
    pack: &'a Pack,
    tasks: &'a mut [Option<StepTask<'b>>; MAX_LANES],
    buffers: &'a mut PackBuffers,
}

impl WithSimd for Minimise<'_, '_> {
    type Output = ();
    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let (rods, buffers) = downcast(simd, self.pack, self.buffers);
        rods.minimise(self.tasks, buffers);
    }
}

struct EvaluatePoints<'a, 'b> {
    pack: &'a Pack,
    tasks: &'a mut [Option<PointsTask<'b>>; MAX_LANES],
    buffers: &'a mut PackBuffers,
}

impl WithSimd for EvaluatePoints<'_, '_> {
    type Output = ();
    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let (rods, buffers) = downcast(simd, self.pack, self.buffers);
        rods.evaluate_points(self.tasks, buffers);
    }
}

/// A pack and its buffers with their types on this processor.
#[inline(always)]
fn downcast<'a, S: Simd>(
    simd: S,
    pack: &'a Pack,
    buffers: &'a mut PackBuffers,
) -> (&'a LaneRods<Lane<S>>, &'a mut Buffers<Lane<S>>) {
    let buffers = buffers.0.get_or_insert_with(|| Box::new(Buffers::new(Lane::splat(simd, 0.0))));
    // A process runs on one kind of processor, so both were created by the same dispatch.
    match (pack.0.downcast_ref(), buffers.downcast_mut()) {
        (Some(rods), Some(buffers)) => (rods, buffers),
        _ => unreachable!("packs and their buffers are created by the same dispatch"),
    }
}

/// One rod per lane.
struct LaneRods<F> {
    core: RodCore<F>,
    /// For every lane, the indices of its rod's segments among those of the pack.
    own: Vec<Vec<usize>>,
}

struct Buffers<F> {
    load: Load<F>,
    q: Vec<F>,
    other: Vec<F>,
    solver: Solver<F>,
}

impl<F: Real> Buffers<F> {
    fn new(zero: F) -> Self {
        Buffers { load: Load::empty(zero), q: Vec::new(), other: Vec::new(), solver: Solver::default() }
    }
}

impl<F: Real> LaneRods<F> {
    fn new(zero: F, rods: &[&Rod]) -> Self {
        // Unused lanes repeat the first rod.
        let cores: Vec<&RodCore<f64>> =
            (0..F::LANES).map(|i| &rods.get(i).copied().unwrap_or(rods[0]).core).collect();
        let elements = cores[0].hat.len();
        let (segments, own) = pack_segments(zero, &cores);
        let core = RodCore {
            segments,
            hat: (0..elements).map(|e| [0, 1].map(|j| gather(zero, |i| cores[i].hat[e][j]))).collect(),
            stiffness: [0, 1, 2].map(|c| gather(zero, |i| cores[i].stiffness[c])),
            prebend: (0..3 * elements).map(|a| gather(zero, |i| cores[i].prebend[a])).collect(),
            length: gather(zero, |i| cores[i].length),
            longest: gather(zero, |i| cores[i].longest),
            mass: gather(zero, |i| cores[i].mass),
            joint: cores[0].joint,
        };
        LaneRods { core, own }
    }

    #[inline(always)]
    fn minimise(&self, tasks: &mut [Option<StepTask>; MAX_LANES], buffers: &mut Buffers<F>) {
        let zero = self.core.length.same(0.0);
        let Buffers { load, q, other, solver } = buffers;
        let Some(first) = &tasks[0] else { return };
        let task = |i: usize| tasks[i].as_ref().unwrap_or(first);
        load.hat.clear();
        let hat = (0..self.core.hat.len()).map(|e| [0, 1].map(|j| gather(zero, |i| task(i).load.hat[e][j])));
        load.hat.extend(hat);
        load.inertia = gather(zero, |i| task(i).load.inertia);
        let none = PointSpring { alpha: zero, u: V3::all(zero), target: V3::all(zero) };
        let held = self.core.first_moving();
        let count = self.core.points() - held;
        load.held = held;
        load.springs.clear();
        load.springs.resize(count, none);
        for (i, own) in self.own.iter().enumerate() {
            for (k, spring) in moving(held, own).zip(&task(i).load.springs) {
                let into = &mut load.springs[k];
                into.alpha.set(i, spring.alpha);
                for c in 0..3 {
                    into.u.0[c].set(i, spring.u.0[c]);
                    into.target.0[c].set(i, spring.target.0[c]);
                }
            }
        }
        load.holds.clear();
        if (0..F::LANES).any(|i| !task(i).load.holds.is_empty()) {
            load.holds.resize(self.core.unknowns(), StrainSpring { stiffness: zero, target: zero });
        }
        for i in 0..F::LANES {
            for (into, hold) in load.holds.iter_mut().zip(&task(i).load.holds) {
                into.stiffness.set(i, hold.stiffness);
                into.target.set(i, hold.target);
            }
        }
        load.moments.clear();
        if (0..F::LANES).any(|i| !task(i).load.moments.is_empty()) {
            load.moments.resize(count, PointMoment::none(zero));
        }
        for (i, own) in self.own.iter().enumerate() {
            for (k, PointMoment { frame: M3([a, b, c]), moment }) in
                moving(held, own).zip(&task(i).load.moments)
            {
                let PointMoment { frame: M3([x, y, z]), moment: sum } = &mut load.moments[k];
                for (into, from) in [(x, a), (y, b), (z, c), (sum, moment)] {
                    (0..3).for_each(|c| into.0[c].set(i, from.0[c]));
                }
            }
        }
        for (into, from) in [(&mut load.force, 0), (&mut *q, 1), (&mut *other, 2)] {
            into.clear();
            into.resize(self.core.unknowns(), zero);
            for i in 0..F::LANES {
                let task = task(i);
                let values = [&task.load.force[..], &*task.q, task.other_start][from];
                for (into, x) in into.iter_mut().zip(values) {
                    into.set(i, *x);
                }
            }
        }
        let root = M3([
            gather_vectors(zero, |i| M3::from(*task(i).root).0[0]),
            gather_vectors(zero, |i| M3::from(*task(i).root).0[1]),
            gather_vectors(zero, |i| M3::from(*task(i).root).0[2]),
        ]);
        let outcomes = solver.solve(&self.core, root, load, q, other);
        for (i, task) in tasks.iter_mut().flatten().enumerate() {
            *task.outcome = outcomes[i];
            for (x, q) in task.q.iter_mut().zip(&*q) {
                *x = q.lane(i);
            }
            let RodShape { pose, exponent } = &mut *task.shape;
            pose.clear();
            exponent.clear();
            pose.push(pose_in_lane(&solver.shape.pose[0], i));
            for &k in &self.own[i] {
                pose.push(pose_in_lane(&solver.shape.pose[k + 1], i));
                exponent.push(exponent_in_lane(&solver.shape.exponent[k], i));
            }
        }
    }

    #[inline(always)]
    fn evaluate_points(&self, tasks: &mut [Option<PointsTask>; MAX_LANES], buffers: &mut Buffers<F>) {
        let zero = self.core.length.same(0.0);
        let Buffers { q, solver, .. } = buffers;
        let shape = &mut solver.shape;
        let Some(any) = tasks.iter().position(Option::is_some) else { return };
        let of = |i: usize| tasks[i].as_ref().or(tasks[any].as_ref());
        q.clear();
        q.resize(self.core.unknowns(), zero);
        let mut root = M3::diagonal(zero);
        for i in 0..F::LANES {
            let Some(task) = of(i) else { return };
            q.iter_mut().zip(task.q).for_each(|(into, x)| into.set(i, *x));
            let r = M3::<f64>::from(task.root.r);
            for (into, from) in root.0.iter_mut().zip(r.0) {
                (0..3).for_each(|c| into.0[c].set(i, from.0[c]));
            }
        }
        shape.integrate(&self.core, root, q);
        let world = |x: &V3<F>, i: usize, root: &Pose| Vector3::from(vector_in_lane(x, i)) + root.p;
        for (i, task) in tasks.iter_mut().enumerate() {
            let Some(PointsTask { root, points, .. }) = task else { continue };
            points.clear();
            points.push(world(&shape.pose[0].p, i, root));
            points.extend(self.own[i].iter().map(|&k| world(&shape.pose[k + 1].p, i, root)));
        }
        // Midpoints replace the start of each segment.
        for (k, segment) in self.core.segments.iter().enumerate() {
            shape.pose[k].p = shape.cubic_midpoint(k, segment.h);
        }
        for (i, task) in tasks.iter_mut().enumerate() {
            let Some(PointsTask { root, points, .. }) = task else { continue };
            points.extend(self.own[i].iter().map(|&k| world(&shape.pose[k].p, i, root)));
        }
    }
}

/// The points of a rod with these segments of a pack, but the first `held` (0 or 1), among those of the pack.
#[inline(always)]
fn moving(held: usize, own: &[usize]) -> impl Iterator<Item = usize> {
    (0..1 - held).chain(own.iter().map(move |k| k + 1 - held))
}

/// The segments of one rod per lane, padded so that every element has as many segments in all lanes; and for
/// every lane the indices of its own segments.
fn pack_segments<F: Real>(zero: F, cores: &[&RodCore<f64>]) -> (Vec<Segment<F>>, Vec<Vec<usize>>) {
    let elements = cores[0].hat.len();
    let of = |core: &RodCore<f64>, element: usize| -> Vec<usize> {
        (0..core.segments.len()).filter(|&k| core.segments[k].element == element).collect()
    };
    let mut own = vec![Vec::new(); F::LANES];
    let mut segments = Vec::new();
    for element in 0..elements {
        let theirs: Vec<Vec<usize>> = cores.iter().map(|core| of(core, element)).collect();
        let most = theirs.iter().map(Vec::len).max().unwrap_or(0);
        for k in 0..most {
            for (own, theirs) in own.iter_mut().zip(&theirs) {
                own.extend((k < theirs.len()).then_some(segments.len()));
            }
            let segment = |i: usize| match theirs[i].get(k) {
                Some(&k) => cores[i].segments[k],
                None => padding(element),
            };
            segments.push(Segment {
                element,
                h: gather(zero, |i| segment(i).h),
                natural: Twist {
                    w: gather_vectors(zero, |i| segment(i).natural.w),
                    v: gather_vectors(zero, |i| segment(i).natural.v),
                },
                strain: [0, 1].map(|g| gather_vectors(zero, |i| segment(i).strain[g])),
                hat: [0, 1].map(|g| gather(zero, |i| segment(i).hat[g])),
            });
        }
    }
    (segments, own)
}

/// A segment of zero length.
fn padding(element: usize) -> Segment<f64> {
    let none = V3::all(0.0);
    Segment { element, h: 0.0, natural: Twist { w: none, v: none }, strain: [none; 2], hat: [0.0; 2] }
}

/// The number `of(i)` in every lane i.
#[inline(always)]
fn gather<F: Real>(zero: F, of: impl Fn(usize) -> f64) -> F {
    let mut x = zero;
    for i in 0..F::LANES {
        x.set(i, of(i));
    }
    x
}

/// The vector `of(i)` in every lane i.
#[inline(always)]
fn gather_vectors<F: Real>(zero: F, of: impl Fn(usize) -> V3<f64>) -> V3<F> {
    let mut x = V3::all(zero);
    for i in 0..F::LANES {
        let v = of(i);
        for c in 0..3 {
            x.0[c].set(i, v.0[c]);
        }
    }
    x
}

#[inline(always)]
fn vector_in_lane<F: Real>(v: &V3<F>, i: usize) -> V3<f64> {
    V3([v.0[0].lane(i), v.0[1].lane(i), v.0[2].lane(i)])
}

#[inline(always)]
fn pose_in_lane<F: Real>(pose: &lanes::Pose<F>, i: usize) -> lanes::Pose<f64> {
    let [a, b, c] = &pose.r.0;
    let r = M3([vector_in_lane(a, i), vector_in_lane(b, i), vector_in_lane(c, i)]);
    lanes::Pose { r, p: vector_in_lane(&pose.p, i) }
}

#[inline(always)]
fn exponent_in_lane<F: Real>(exponent: &MagnusExponent<F>, i: usize) -> MagnusExponent<f64> {
    let Coefficients { a, b, c, d, e } = &exponent.coefficients;
    MagnusExponent {
        psi: Twist { w: vector_in_lane(&exponent.psi.w, i), v: vector_in_lane(&exponent.psi.v, i) },
        coefficients: Coefficients { a: a.lane(i), b: b.lane(i), c: c.lane(i), d: d.lane(i), e: e.lane(i) },
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rod::joint::RootJoint;
    use crate::rod::model::RodSource;
    use crate::rod::potential::PointLoad;
    use crate::rod::segment::SegmentSize;
    use nalgebra::Vector3;

    /// Hairs of `nodes` nodes and various lengths, curls and numbers of segments.
    fn hairs(n: usize, nodes: usize) -> Vec<Rod> {
        let hair = |i: usize| {
            let (long, curl) = (0.1 + 0.07 * (i % 4) as f64, 0.002 * (1 + i % 3) as f64);
            let points: Vec<_> = (0..60)
                .map(|k| {
                    let s = k as f64 / 59.0;
                    Vector3::new(curl * (20.0 * s).cos(), -long * s, curl * (20.0 * s).sin())
                })
                .collect();
            let last = (nodes - 1) as f64;
            let arc: Vec<f64> = (0..nodes).map(|i| (i as f64 / last).powf(1.5)).collect();
            Rod::new(&RodSource {
                stiffness: [8e-9, 6e-9, 4e-9],
                damping: 0.004,
                segment_size: SegmentSize { max_length: 0.05, ..SegmentSize::FINE },
                ..RodSource::hair(&points, &arc)
            })
            .unwrap()
        };
        (0..n).map(hair).collect()
    }

    fn load(rod: &Rod, jerk: f64) -> Load {
        let mut shape = RodShape::default();
        let past = vec![0.0; rod.unknowns()];
        shape.update(rod, &rod.root.r, &past);
        let points = (0..rod.points()).map(|k| PointLoad {
            inertial: shape.x(k) + Vector3::new(jerk, 0.0, -0.3 * jerk),
            previous: shape.x(k),
            air: Vector3::z(),
            tangent: shape.tangent(k),
            drag: 2e-5,
        });
        let mut load = Load::default();
        load.set(rod, 0.02, &(Vector3::y() * -9.81), &past, points);
        load
    }

    #[test]
    fn rod_has_the_same_bits_alone_and_in_any_pack() {
        // Clamped ones of 13 nodes are factored in blocks.
        let joints = [RootJoint::Clamped, RootJoint::Pinned, RootJoint::Free];
        for (joint, nodes) in joints.into_iter().flat_map(|joint| [(joint, 7), (joint, 13)]) {
            let mut rods = hairs(12, nodes);
            rods.iter_mut().for_each(|rod| rod.join_root(joint));
            same_bits(&rods);
        }
    }

    fn same_bits(rods: &[Rod]) {
        // Some roots jump far enough for an indefinite Hessian and short steps, some hardly move.
        let mut loads: Vec<Load> =
            rods.iter().enumerate().map(|(i, r)| load(r, [1e-4, 0.05, 0.4, 2.0, 1e-3][i % 5])).collect();
        let n = rods[0].unknowns();
        for load in loads.iter_mut().skip(1).step_by(4) {
            load.hold((0..n).map(|a| StrainSpring { stiffness: 1e-8 * (a % 3) as f64, target: a as f64 }));
        }
        for (rod, load) in rods.iter().zip(&mut loads).step_by(3) {
            load.add_moment(rod.points() - 1, &rod.root.r, &Vector3::new(1e-8, -2e-8, 3e-8));
        }
        let (mut solver, mut alone) = (Solver::default(), Vec::new());
        for (rod, load) in rods.iter().zip(&loads) {
            let mut q = vec![0.1; n];
            let outcome = solver.minimise(rod, &rod.root.r, load, &mut q, &vec![0.0; n]);
            alone.push((q, solver.shape.pose.clone(), outcome));
        }
        assert!(alone.iter().map(|a| a.2.iterations).max() > alone.iter().map(|a| a.2.iterations).min());
        assert!(rods.iter().any(|r| r.points() != rods[0].points()));
        let mut buffers = PackBuffers::default();
        for (size, first) in (1..=Pack::width()).flat_map(|size| [(size, 0), (size, 1), (size, 5)]) {
            // Spread members, so that packs differ.
            let members: Vec<usize> = (0..size).map(|i| (first + 3 * i) % rods.len()).collect();
            let pack = Pack::new(&members.iter().map(|&i| &rods[i]).collect::<Vec<_>>());
            let mut points = vec![Vec::new(); size];
            let roots = members.iter().map(|&i| Pose { p: Vector3::new(0.1, 0.2, i as f64), ..rods[i].root });
            let roots: Vec<Pose> = roots.collect();
            let mut tasks = points.iter_mut().zip(&members).zip(&roots).map(|((points, &i), root)| {
                (i % 5 != 2).then_some(PointsTask { root: *root, q: &alone[i].0, points })
            });
            let mut tasks = std::array::from_fn(|_| tasks.next().flatten());
            pack.evaluate_points(&mut tasks, &mut buffers);
            for ((points, &i), root) in points.iter().zip(&members).zip(&roots) {
                let (mut shape, mut expected) = (RodShape::default(), Vec::new());
                if i % 5 != 2 {
                    shape.update(&rods[i], &root.r, &alone[i].0);
                    shape.points_and_midpoints(&rods[i], &root.p, &mut expected);
                    assert_eq!(expected.len(), 2 * rods[i].points() - 1);
                }
                assert_eq!(*points, expected, "{i}");
            }
            let mut results = vec![(vec![0.1; n], RodShape::default(), NewtonOutcome::default()); size];
            let other = vec![0.0; n];
            let mut tasks = results.iter_mut().zip(&members).map(|((q, shape, outcome), &i)| {
                let (root, load) = (&rods[i].root.r, &loads[i]);
                StepTask { root, load, q, other_start: &other, shape, outcome }
            });
            let mut tasks = std::array::from_fn(|_| tasks.next());
            pack.minimise(&mut tasks, &mut buffers);
            for ((q, shape, outcome), &i) in results.iter().zip(&members) {
                assert!(*q == alone[i].0 && shape.pose == alone[i].1 && *outcome == alone[i].2, "{i}");
            }
        }
    }
}
