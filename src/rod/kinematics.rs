//! Shape of a rod from its unknowns, and how the shape moves with them.

use super::Rod;
use super::model::{Beam, Step};
use crate::math::lanes::{self, M3, Mask, Real, Twist, V3};
use crate::math::se3::{self, Pose};
use nalgebra::{Matrix3, Vector3};

/// √3/12, the weight of the commutator in the fourth-order Magnus step (Iserles & Nørsett 1999).
pub(super) const COMMUTATOR: f64 = 0.144_337_567_297_406_44;

/// Turn of a sub-step up to which its exponential is right, rad: a little less than half a turn. The Magnus series has long lost
/// its accuracy there.
const MAX_STEP_TURN: f64 = 3.0;

/// Poses along a rod, world axes, origin at the root. One per point.
#[derive(Debug, Clone)]
pub struct Shape<F = f64> {
    pub(super) pose: Vec<lanes::Pose<F>>,
}

impl<F> Default for Shape<F> {
    fn default() -> Self {
        Shape { pose: Vec::new() }
    }
}

impl Shape {
    /// The shape at unknowns `q` with the root frame turned by `root` (columns d1, d2, d3, world).
    pub fn update(&mut self, rod: &Rod, root: &Matrix3<f64>, q: &[f64]) {
        self.bend(&rod.beam, M3::from(*root), q);
    }

    /// Number of points.
    pub fn points(&self) -> usize {
        self.pose.len()
    }

    /// Position of point `k`, m, relative to the root.
    pub fn x(&self, k: usize) -> Vector3<f64> {
        self.pose[k].p.into()
    }

    /// Tangent at point `k`.
    pub fn tangent(&self, k: usize) -> Vector3<f64> {
        self.pose[k].r.0[2].into()
    }

    /// Frame and position of every point.
    pub fn poses(&self) -> impl Iterator<Item = Pose> + '_ {
        self.pose.iter().map(|g| Pose { r: g.r.into(), p: g.p.into() })
    }
}

impl<F: Real> Shape<F> {
    /// [`Shape::update`] in every lane; returns those where no sub-step turns by [`MAX_STEP_TURN`].
    #[inline(always)]
    pub(super) fn bend(&mut self, beam: &Beam<F>, root: M3<F>, q: &[F]) -> Mask {
        let mut most = beam.length.same(0.0);
        let mut g = lanes::Pose { r: root, p: V3::all(beam.length.same(0.0)) };
        self.pose.resize(beam.points(), g);
        self.pose[0] = g;
        for (step, pose) in beam.steps.iter().zip(&mut self.pose[1..]) {
            let psi = exponent(step, &local(step, q));
            most = most.max(psi.w.dot(psi.w));
            g = g.compose(&se3::exp(&psi));
            *pose = g;
        }
        most.below(most.same(MAX_STEP_TURN * MAX_STEP_TURN))
    }

    /// Largest distance between points of two shapes, m.
    #[inline(always)]
    pub(super) fn distance(&self, other: &Self) -> F {
        let mut most = self.pose[0].p.0[0].same(0.0);
        for (a, b) in self.pose.iter().zip(&other.pose) {
            let d = a.p - b.p;
            most = most.max(d.dot(d));
        }
        most.sqrt()
    }
}

/// Unknowns of a node; none at the tip.
#[inline(always)]
fn node<F: Real>(q: &[F], i: usize) -> V3<F> {
    match q.get(3 * i..3 * i + 3) {
        Some(c) => V3([c[0], c[1], c[2]]),
        None => V3::all(q[0].same(0.0)),
    }
}

/// Deviation at the Gauss points of a step.
#[inline(always)]
pub(super) fn local<F: Real>(step: &Step<F>, q: &[F]) -> [V3<F>; 2] {
    let (l, r) = (node(q, step.element), node(q, step.element + 1));
    [r + (l - r) * step.left[0], r + (l - r) * step.left[1]]
}

/// Magnus exponent ψ of a step: the natural one, corrected for the deviation δ at the Gauss points
/// (`docs/theory.md` eq. 3.2).
#[inline(always)]
pub(super) fn exponent<F: Real>(step: &Step<F>, d: &[V3<F>; 2]) -> Twist<F> {
    let k = step.h * step.h * COMMUTATOR;
    let [a1, a2] = step.strain;
    let w = (d[0] + d[1]) * (step.h * 0.5) + ((a1 + d[0]).cross(d[1]) + d[0].cross(a2)) * k;
    let e = (d[0] - d[1]) * k;
    let v = step.natural.v;
    Twist { w: step.natural.w + w, v: V3([v.0[0] + e.0[1], v.0[1] - e.0[0], v.0[2]]) }
}

/// How a rod's shape moves with its unknowns: the world twists T and S of `docs/theory.md` §3.4, about the root.
#[derive(Debug, Clone)]
pub struct Sensitivity<F = f64> {
    /// For every sub-step, the twist that each of its six unknowns (left node, right node) gives, by that
    /// sub-step alone, to all that is downstream of it.
    pub(super) step: Vec<[Twist<F>; 6]>,
    /// For every sub-step, the twist that its six unknowns give through the sub-steps before it.
    pub(super) before: Vec<[Twist<F>; 6]>,
    /// For every unknown, the twist that it gives to all downstream of its support. Those of the tip node, which has no
    /// unknowns, stand after the last.
    pub(super) total: Vec<Twist<F>>,
    /// Element of each sub-step.
    element: Vec<usize>,
}

impl<F> Default for Sensitivity<F> {
    fn default() -> Self {
        Sensitivity { step: Vec::new(), before: Vec::new(), total: Vec::new(), element: Vec::new() }
    }
}

impl<F: Real> Sensitivity<F> {
    /// The sensitivity at unknowns `q` whose shape is `shape`.
    #[inline(always)]
    pub(super) fn linearise(&mut self, beam: &Beam<F>, shape: &Shape<F>, q: &[F]) {
        let (none, n) = (Twist::none(beam.length.same(0.0)), beam.steps.len());
        self.step.resize(n, [none; 6]);
        self.before.resize(n, [none; 6]);
        self.element.resize(n, 0);
        self.total.resize(beam.unknowns() + 3, none);
        self.total.fill(none);
        for (k, step) in beam.steps.iter().enumerate() {
            columns(step, &shape.pose[k], q, &mut self.step[k]);
            let total = self.total[3 * step.element..3 * step.element + 6].iter_mut();
            for ((total, before), own) in total.zip(&mut self.before[k]).zip(&self.step[k]) {
                *before = *total;
                *total = *total + *own;
            }
            self.element[k] = step.element;
        }
    }
}

/// World twists of the six unknowns of a step that starts at pose `g`: Ad_g J_ℓ(ψ) ∂ψ/∂q.
#[inline(always)]
fn columns<F: Real>(step: &Step<F>, g: &lanes::Pose<F>, q: &[F], columns: &mut [Twist<F>; 6]) {
    let d = local(step, q);
    let omega = [step.strain[0] + d[0], step.strain[1] + d[1]];
    let lj = se3::left_jacobian(&exponent(step, &d));
    // Ad_g J_ℓ by columns, for a twist's rotation part; its translation part comes out as J alone.
    let j = g.r * lj.j;
    let q = g.r * lj.q;
    let q = q + M3([g.p.cross(j.0[0]), g.p.cross(j.0[1]), g.p.cross(j.0[2])]);
    let k = step.h * step.h * COMMUTATOR;
    for side in 0..2 {
        let [l1, l2] = step.left;
        let [n1, n2] = if side == 0 { step.left } else { [-l1 + 1.0, -l2 + 1.0] };
        // Derivatives of w: h/2 (n1 + n2) e + k (n1 e × Ω2 + n2 Ω1 × e) = (a + [u]×) e, u = k (n2 Ω1 − n1 Ω2);
        // of v: k (n1 − n2) e × e3.
        let u = (omega[0] * n2 - omega[1] * n1) * k;
        let w = M3::hat(u) + M3::diagonal(step.h * 0.5 * (n1 + n2));
        let c = k * (n1 - n2);
        let v = [-(j.0[1] * c), j.0[0] * c];
        for axis in 0..3 {
            let mut t = Twist { w: j * w.0[axis], v: q * w.0[axis] };
            if axis < 2 {
                t.v += v[axis];
            }
            columns[3 * side + axis] = t;
        }
    }
}

impl Sensitivity {
    /// The sensitivity at unknowns `q` whose shape is `shape`.
    pub fn update(&mut self, rod: &Rod, shape: &Shape, q: &[f64]) {
        self.linearise(&rod.beam, shape, q);
    }

    /// Twists of the unknowns that move point `k`, in order.
    fn twists(&self, k: usize) -> impl Iterator<Item = &Twist<f64>> {
        let (done, live) = match self.before.get(k) {
            Some(live) => (3 * self.element[k], &live[..]),
            None => (self.total.len(), &[][..]),
        };
        self.total[..done].iter().chain(live)
    }

    /// Row of the Jacobian of point `k` (at `x`, relative to the root) along the world direction `d`, scaled and added:
    /// `row += a · d · ∂x/∂q`.
    pub fn add_row(&self, k: usize, x: &Vector3<f64>, d: &Vector3<f64>, a: f64, row: &mut [f64]) {
        let wrench = Twist { w: (x.cross(d) * a).into(), v: (d * a).into() };
        for (r, t) in row.iter_mut().zip(self.twists(k)) {
            *r += wrench.dot(t);
        }
    }

    /// Velocity of point `k` (at `x`, relative to the root) under rates `qdot`, relative to a root at rest.
    pub fn velocity(&self, k: usize, x: &Vector3<f64>, qdot: &[f64]) -> Vector3<f64> {
        let mut t = Twist::none(0.0);
        for (c, r) in self.twists(k).zip(qdot) {
            t = Twist { w: t.w + c.w * *r, v: t.v + c.v * *r };
        }
        (t.v + t.w.cross((*x).into())).into()
    }
}
