//! Several rods stepped at once, one to a lane of the processor's vector registers.
//!
//! The kernels are those of one rod ([`crate::math::lanes`]), so a rod's step has the same bits alone and in any company. Rods of
//! one pack have the same number of nodes; where one has fewer sub-steps in an element than another, it gets sub-steps of no length,
//! which add nothing.

use super::kinematics::Turn;
use super::model::{Beam, Step};
use super::newton::{NewtonOutcome, Solver};
use super::potential::{Load, Tie};
use super::{Rod, RodShape};
use crate::math::lanes::{self, Lane, M3, MAX_LANES, Real, Twist, V3};
use crate::math::se3::{Coefficients, Pose};
use nalgebra::{Matrix3, Vector3};
use pulp::{Arch, Simd, WithSimd};
use std::any::Any;

/// Rods that are stepped at once.
pub struct Pack(Box<dyn Any + Send + Sync>);

/// Workspace of the steps of packs, one at a time; reuse keeps the steps free of allocation.
#[derive(Default)]
pub struct PackBuffers(Option<Box<dyn Any + Send>>);

/// The step of one rod of a pack.
pub struct StepTask<'a> {
    /// Root frame at the end of the step, world axes.
    pub root: &'a Matrix3<f64>,
    /// What drives the rod.
    pub load: &'a Load,
    /// Unknowns, 1/m: one start, and the result.
    pub q: &'a mut [f64],
    /// Another start, 1/m.
    pub other: &'a [f64],
    /// RodShape at the result.
    pub shape: &'a mut RodShape,
    /// How it went.
    pub outcome: &'a mut NewtonOutcome,
}

/// A rod of a pack at given unknowns.
pub struct PointsTask<'a> {
    /// Root, world.
    pub root: Pose,
    /// Unknowns, 1/m.
    pub q: &'a [f64],
    /// Set to what [`RodShape::points_and_midpoints`] says.
    pub places: &'a mut Vec<Vector3<f64>>,
}

impl Pack {
    /// Rods that one pack takes, on this processor.
    pub fn width() -> usize {
        Arch::new().dispatch(Width)
    }

    /// Packs at most [`Pack::width`] rods, one at least, of the same number of nodes.
    pub fn new(rods: &[&Rod]) -> Pack {
        Arch::new().dispatch(Gather(rods))
    }

    /// Does for every rod, in the order of [`Pack::new`], what [`Solver::minimise`] does.
    /// There is no task where there is no rod.
    pub fn minimise(&self, tasks: &mut [Option<StepTask>; MAX_LANES], work: &mut PackBuffers) {
        Arch::new().dispatch(Minimise { pack: self, tasks, work });
    }

    /// Does for every rod, in the order of [`Pack::new`], what [`RodShape::update`] and [`RodShape::points_and_midpoints`] do. There is no `bent` where there is no rod, or it
    /// does not matter.
    pub fn place(&self, bent: &mut [Option<PointsTask>; MAX_LANES], work: &mut PackBuffers) {
        Arch::new().dispatch(Place { pack: self, bent, work });
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
        Pack(Box::new(Beams::new(Lane::splat(simd, 0.0), self.0)))
    }
}

struct Minimise<'a, 'b> {
    pack: &'a Pack,
    tasks: &'a mut [Option<StepTask<'b>>; MAX_LANES],
    work: &'a mut PackBuffers,
}

impl WithSimd for Minimise<'_, '_> {
    type Output = ();
    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let (beams, buffers) = made_for(simd, self.pack, self.work);
        beams.minimise(self.tasks, buffers);
    }
}

struct Place<'a, 'b> {
    pack: &'a Pack,
    bent: &'a mut [Option<PointsTask<'b>>; MAX_LANES],
    work: &'a mut PackBuffers,
}

impl WithSimd for Place<'_, '_> {
    type Output = ();
    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let (beams, buffers) = made_for(simd, self.pack, self.work);
        beams.place(self.bent, buffers);
    }
}

/// A pack and a workspace as what they are on this processor.
#[inline(always)]
fn made_for<'a, S: Simd>(
    simd: S,
    pack: &'a Pack,
    work: &'a mut PackBuffers,
) -> (&'a Beams<Lane<S>>, &'a mut Buffers<Lane<S>>) {
    let work = work.0.get_or_insert_with(|| Box::new(Buffers::new(Lane::splat(simd, 0.0))));
    // A process sees one processor, so both were made for this one.
    match (pack.0.downcast_ref(), work.downcast_mut()) {
        (Some(beams), Some(buffers)) => (beams, buffers),
        _ => unreachable!("packs and their workspaces are made by the same dispatch"),
    }
}

/// Rods in lanes.
struct Beams<F> {
    beam: Beam<F>,
    /// For every lane, the sub-steps in the pack that are its own.
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
        let load = Load { hat: Vec::new(), inertia: zero, tie: Vec::new(), pull: Vec::new() };
        Buffers { load, q: Vec::new(), other: Vec::new(), solver: Solver::default() }
    }
}

/// `of` every lane.
#[inline(always)]
fn lanes<F: Real>(zero: F, of: impl Fn(usize) -> f64) -> F {
    let mut x = zero;
    for i in 0..F::LANES {
        x.set(i, of(i));
    }
    x
}

#[inline(always)]
fn vectors<F: Real>(zero: F, of: impl Fn(usize) -> V3<f64>) -> V3<F> {
    let mut x = V3::all(zero);
    for i in 0..F::LANES {
        let v = of(i);
        for c in 0..3 {
            x.0[c].set(i, v.0[c]);
        }
    }
    x
}

impl<F: Real> Beams<F> {
    fn new(zero: F, rods: &[&Rod]) -> Self {
        // Lanes to spare repeat the first rod.
        let beams: Vec<&Beam<f64>> =
            (0..F::LANES).map(|i| &rods.get(i).copied().unwrap_or(rods[0]).beam).collect();
        let elements = beams[0].hat.len();
        let of = |beam: &Beam<f64>, element: usize| -> Vec<usize> {
            (0..beam.steps.len()).filter(|&k| beam.steps[k].element == element).collect()
        };
        let mut own = vec![Vec::new(); F::LANES];
        let mut steps = Vec::new();
        for element in 0..elements {
            let theirs: Vec<Vec<usize>> = beams.iter().map(|b| of(b, element)).collect();
            let most = theirs.iter().map(Vec::len).max().unwrap_or(0);
            for k in 0..most {
                for (own, theirs) in own.iter_mut().zip(&theirs) {
                    own.extend((k < theirs.len()).then_some(steps.len()));
                }
                let step = |i: usize| match theirs[i].get(k) {
                    Some(&k) => beams[i].steps[k],
                    None => empty(element),
                };
                steps.push(Step {
                    element,
                    h: lanes(zero, |i| step(i).h),
                    natural: Twist {
                        w: vectors(zero, |i| step(i).natural.w),
                        v: vectors(zero, |i| step(i).natural.v),
                    },
                    strain: [0, 1].map(|g| vectors(zero, |i| step(i).strain[g])),
                    left: [0, 1].map(|g| lanes(zero, |i| step(i).left[g])),
                });
            }
        }
        let beam = Beam {
            steps,
            hat: (0..elements).map(|e| [0, 1].map(|j| lanes(zero, |i| beams[i].hat[e][j]))).collect(),
            stiffness: [0, 1, 2].map(|c| lanes(zero, |i| beams[i].stiffness[c])),
            prebend: (0..3 * elements).map(|a| lanes(zero, |i| beams[i].prebend[a])).collect(),
            length: lanes(zero, |i| beams[i].length),
            longest: lanes(zero, |i| beams[i].longest),
            mass: lanes(zero, |i| beams[i].mass),
        };
        Beams { beam, own }
    }

    #[inline(always)]
    fn minimise(&self, tasks: &mut [Option<StepTask>; MAX_LANES], work: &mut Buffers<F>) {
        let zero = self.beam.length.same(0.0);
        let Buffers { load, q, other, solver } = work;
        let Some(first) = &tasks[0] else { return };
        let task = |i: usize| tasks[i].as_ref().unwrap_or(first);
        load.hat.clear();
        let hat = (0..self.beam.hat.len()).map(|e| [0, 1].map(|j| lanes(zero, |i| task(i).load.hat[e][j])));
        load.hat.extend(hat);
        load.inertia = lanes(zero, |i| task(i).load.inertia);
        let none = Tie { alpha: zero, u: V3::all(zero), target: V3::all(zero) };
        load.tie.clear();
        load.tie.resize(self.beam.steps.len(), none);
        for (i, own) in self.own.iter().enumerate() {
            for (&k, tie) in own.iter().zip(&task(i).load.tie) {
                let into = &mut load.tie[k];
                into.alpha.set(i, tie.alpha);
                for c in 0..3 {
                    into.u.0[c].set(i, tie.u.0[c]);
                    into.target.0[c].set(i, tie.target.0[c]);
                }
            }
        }
        for (into, from) in [(&mut load.pull, 0), (&mut *q, 1), (&mut *other, 2)] {
            into.clear();
            into.resize(self.beam.unknowns(), zero);
            for i in 0..F::LANES {
                let task = task(i);
                let values = [&task.load.pull[..], &*task.q, task.other][from];
                for (into, x) in into.iter_mut().zip(values) {
                    into.set(i, *x);
                }
            }
        }
        let root = M3([
            vectors(zero, |i| M3::from(*task(i).root).0[0]),
            vectors(zero, |i| M3::from(*task(i).root).0[1]),
            vectors(zero, |i| M3::from(*task(i).root).0[2]),
        ]);
        let outcomes = solver.solve(&self.beam, root, load, q, other);
        for (i, task) in tasks.iter_mut().flatten().enumerate() {
            *task.outcome = outcomes[i];
            for (x, q) in task.q.iter_mut().zip(&*q) {
                *x = q.lane(i);
            }
            let RodShape { pose, turn } = &mut *task.shape;
            pose.clear();
            turn.clear();
            pose.push(pose_in_lane(&solver.shape.pose[0], i));
            for &k in &self.own[i] {
                pose.push(pose_in_lane(&solver.shape.pose[k + 1], i));
                turn.push(turn_in_lane(&solver.shape.turn[k], i));
            }
        }
    }
}

impl<F: Real> Beams<F> {
    #[inline(always)]
    fn place(&self, bent: &mut [Option<PointsTask>; MAX_LANES], work: &mut Buffers<F>) {
        let zero = self.beam.length.same(0.0);
        let Buffers { q, solver, .. } = work;
        let shape = &mut solver.shape;
        let Some(any) = bent.iter().position(Option::is_some) else { return };
        let of = |i: usize| bent[i].as_ref().or(bent[any].as_ref());
        q.clear();
        q.resize(self.beam.unknowns(), zero);
        let mut root = M3::diagonal(zero);
        for i in 0..F::LANES {
            let Some(bent) = of(i) else { return };
            q.iter_mut().zip(bent.q).for_each(|(into, x)| into.set(i, *x));
            let r = M3::<f64>::from(bent.root.r);
            for (into, from) in root.0.iter_mut().zip(r.0) {
                (0..3).for_each(|c| into.0[c].set(i, from.0[c]));
            }
        }
        shape.bend(&self.beam, root, q);
        for (i, bent) in bent.iter_mut().enumerate() {
            let Some(PointsTask { root, places, .. }) = bent else { continue };
            let place = |x: &V3<F>| Vector3::from(vector_in_lane(x, i)) + root.p;
            places.clear();
            places.push(place(&shape.pose[0].p));
            places.extend(self.own[i].iter().map(|&k| place(&shape.pose[k + 1].p)));
        }
        // In the place of the ends of sub-steps, their middles.
        for (k, step) in self.beam.steps.iter().enumerate() {
            shape.pose[k].p = shape.between(k, step.h);
        }
        for (i, bent) in bent.iter_mut().enumerate() {
            let Some(PointsTask { root, places, .. }) = bent else { continue };
            places.extend(
                self.own[i].iter().map(|&k| Vector3::from(vector_in_lane(&shape.pose[k].p, i)) + root.p),
            );
        }
    }
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
fn turn_in_lane<F: Real>(turn: &Turn<F>, i: usize) -> Turn<f64> {
    let Coefficients { a, b, c, d, e } = &turn.coefficients;
    Turn {
        psi: Twist { w: vector_in_lane(&turn.psi.w, i), v: vector_in_lane(&turn.psi.v, i) },
        coefficients: Coefficients { a: a.lane(i), b: b.lane(i), c: c.lane(i), d: d.lane(i), e: e.lane(i) },
    }
}

/// A sub-step of no length.
fn empty(element: usize) -> Step<f64> {
    let none = V3::all(0.0);
    Step { element, h: 0.0, natural: Twist { w: none, v: none }, strain: [none; 2], left: [0.0; 2] }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rod::potential::PointLoad;
    use crate::rod::{RodSource, SegmentSize, Taper};
    use nalgebra::Vector3;

    /// Hairs of one number of nodes and of many lengths, curls and numbers of sub-steps.
    fn hairs(n: usize) -> Vec<Rod> {
        let hair = |i: usize| {
            let (long, curl) = (0.1 + 0.07 * (i % 4) as f64, 0.002 * (1 + i % 3) as f64);
            let points: Vec<_> = (0..60)
                .map(|k| {
                    let s = k as f64 / 59.0;
                    Vector3::new(curl * (20.0 * s).cos(), -long * s, curl * (20.0 * s).sin())
                })
                .collect();
            let arc: Vec<f64> = (0..7).map(|i| (i as f64 / 6.0).powf(1.5)).collect();
            Rod::new(&RodSource {
                points: &points,
                root_frame: None,
                arc: &arc,
                stiffness: [8e-9, 6e-9, 4e-9],
                line_density: 6.6e-6,
                damping: 0.004,
                taper: Taper::NONE,
                natural_strain: None,
                segment_size: SegmentSize { max_length: 0.05, ..SegmentSize::FINE },
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
    fn a_rod_has_the_same_bits_alone_and_in_any_company() {
        let rods = hairs(12);
        // Some jump far enough for an indefinite Hessian and for short steps, some hardly move.
        let loads: Vec<Load> =
            rods.iter().enumerate().map(|(i, r)| load(r, [1e-4, 0.05, 0.4, 2.0, 1e-3][i % 5])).collect();
        let n = rods[0].unknowns();
        let (mut solver, mut alone) = (Solver::default(), Vec::new());
        for (rod, load) in rods.iter().zip(&loads) {
            let mut q = vec![0.1; n];
            let outcome = solver.minimise(rod, &rod.root.r, load, &mut q, &vec![0.0; n]);
            alone.push((q, solver.shape.pose.clone(), outcome));
        }
        assert!(alone.iter().map(|a| a.2.iterations).max() > alone.iter().map(|a| a.2.iterations).min());
        assert!(rods.iter().any(|r| r.points() != rods[0].points()));
        let mut work = PackBuffers::default();
        for (size, first) in (1..=Pack::width()).flat_map(|size| [(size, 0), (size, 1), (size, 5)]) {
            // Neighbours at a distance, so that companies differ.
            let members: Vec<usize> = (0..size).map(|i| (first + 3 * i) % rods.len()).collect();
            let pack = Pack::new(&members.iter().map(|&i| &rods[i]).collect::<Vec<_>>());
            let mut places = vec![Vec::new(); size];
            let roots = members.iter().map(|&i| Pose { p: Vector3::new(0.1, 0.2, i as f64), ..rods[i].root });
            let roots: Vec<Pose> = roots.collect();
            let mut bent = places.iter_mut().zip(&members).zip(&roots).map(|((places, &i), root)| {
                (i % 5 != 2).then_some(PointsTask { root: *root, q: &alone[i].0, places })
            });
            let mut bent = std::array::from_fn(|_| bent.next().flatten());
            pack.place(&mut bent, &mut work);
            for ((places, &i), root) in places.iter().zip(&members).zip(&roots) {
                let (mut shape, mut expected) = (RodShape::default(), Vec::new());
                if i % 5 != 2 {
                    shape.update(&rods[i], &root.r, &alone[i].0);
                    shape.points_and_midpoints(&rods[i], &root.p, &mut expected);
                    assert_eq!(expected.len(), 2 * rods[i].points() - 1);
                }
                assert_eq!(*places, expected, "{i}");
            }
            let mut results = vec![(vec![0.1; n], RodShape::default(), NewtonOutcome::default()); size];
            let other = vec![0.0; n];
            let mut tasks = results.iter_mut().zip(&members).map(|((q, shape, outcome), &i)| {
                let (root, load) = (&rods[i].root.r, &loads[i]);
                StepTask { root, load, q, other: &other, shape, outcome }
            });
            let mut tasks = std::array::from_fn(|_| tasks.next());
            pack.minimise(&mut tasks, &mut work);
            for ((q, shape, outcome), &i) in results.iter().zip(&members) {
                assert!(*q == alone[i].0 && shape.pose == alone[i].1 && *outcome == alone[i].2, "{i}");
            }
        }
    }
}
