//! Exact derivatives of a rod's shape by its unknowns.

use super::joint::{Joint, RootJoint};
use super::model::Rod;
use super::segment::{RodCore, Segment};
use super::shape::{COMMUTATOR, RodShape, deviation};
use crate::math::lanes::{M3, Pose, Real, Twist, V3};
use crate::math::se3::{self, LeftJacobian};
use nalgebra::Vector3;

/// Derivative of a segment's exponent by the unknowns of one of its nodes: for unknown e (a unit vector) ω
/// changes by s e + u × e and v by c e × e3.
#[derive(Debug, Clone, Copy)]
pub(super) struct ExponentDerivative<F> {
    pub s: F,
    pub u: V3<F>,
    pub c: F,
}

/// Derivatives by the unknowns of the first and of the second node of a segment (of `docs/theory.md` eq.
/// 3.2).
#[inline(always)]
pub(super) fn exponent_derivatives<F: Real>(segment: &Segment<F>, q: &[F]) -> [ExponentDerivative<F>; 2] {
    let d = deviation(segment, q);
    let omega = [segment.strain[0] + d[0], segment.strain[1] + d[1]];
    let k = segment.h * segment.h * COMMUTATOR;
    // No closure in a kernel: compiled out of line, it would lose the target features of the dispatch.
    let (first, second) = (segment.hat, [-segment.hat[0] + 1.0, -segment.hat[1] + 1.0]);
    [exponent_derivative(segment.h, k, &omega, first), exponent_derivative(segment.h, k, &omega, second)]
}

#[inline(always)]
fn exponent_derivative<F: Real>(h: F, k: F, omega: &[V3<F>; 2], [n1, n2]: [F; 2]) -> ExponentDerivative<F> {
    ExponentDerivative { s: h * 0.5 * (n1 + n2), u: (omega[0] * n2 - omega[1] * n1) * k, c: k * (n1 - n2) }
}

/// Derivatives of a rod's shape by its unknowns: the world twists T and S of `docs/theory.md` §3.4, about the
/// root.
#[derive(Debug, Clone)]
pub struct Sensitivity<F = f64> {
    /// For every segment Ad_g J_ℓ(ψ): maps a change of its exponent to the twist of everything downstream.
    pub(super) jacobian: Vec<LeftJacobian<F>>,
    /// For every segment, the twist of everything downstream per unknown of its first and second node,
    /// through this segment alone (T).
    pub(super) own: Vec<[Twist<F>; 6]>,
    /// For every segment, the same six twists through all preceding segments.
    pub(super) before: Vec<[Twist<F>; 6]>,
    /// For every unknown, the twist of everything downstream of its support (S). Three entries of the tip
    /// node, which has no unknowns, follow the last.
    pub(super) total: Vec<Twist<F>>,
    /// Element of each segment.
    element: Vec<usize>,
}

impl<F> Default for Sensitivity<F> {
    fn default() -> Self {
        let (jacobian, element) = (Vec::new(), Vec::new());
        Sensitivity { jacobian, own: Vec::new(), before: Vec::new(), total: Vec::new(), element }
    }
}

impl<F: Real> Sensitivity<F> {
    /// Sets the Jacobians of the segments to those at `shape`: all that a gradient needs.
    #[inline(always)]
    pub(super) fn update_jacobians(&mut self, shape: &RodShape<F>) {
        let zero = shape.pose[0].p.0[0].same(0.0);
        if self.jacobian.len() != shape.exponent.len() {
            let none = M3::diagonal(zero);
            self.jacobian.resize(shape.exponent.len(), LeftJacobian { j: none, q: none });
        }
        for ((jacobian, exponent), g) in self.jacobian.iter_mut().zip(&shape.exponent).zip(&shape.pose) {
            let lj = se3::left_jacobian(&exponent.psi, &exponent.coefficients);
            let (j, q) = (g.r * lj.j, g.r * lj.q);
            let carried = M3([g.p.cross(j.0[0]), g.p.cross(j.0[1]), g.p.cross(j.0[2])]);
            *jacobian = LeftJacobian { j, q: q + carried };
        }
    }

    /// Sets the twists to those at unknowns `q`, whose shape is `shape` and for which the Jacobians are current.
    #[inline(always)]
    pub(super) fn update_twists(&mut self, core: &RodCore<F>, shape: &RodShape<F>, q: &[F]) {
        let (none, n) = (Twist::none(core.length.same(0.0)), core.segments.len());
        if self.own.len() != n || self.total.len() != core.unknowns() + 3 {
            self.own.resize(n, [none; 6]);
            self.before.resize(n, [none; 6]);
            self.element.resize(n, 0);
            self.total.resize(core.unknowns() + 3, none);
        }
        self.total.fill(none);
        if core.joint != RootJoint::Clamped {
            let (root, joint) = (&shape.pose[0], Joint::new(q));
            let turns = root.r * joint.jacobian();
            for (total, w) in self.total.iter_mut().zip(turns.0) {
                total.w = w;
            }
            if core.joint == RootJoint::Free {
                for (total, w) in self.total.iter_mut().zip(turns.0) {
                    total.v = root.p.cross(w);
                }
                for (total, v) in self.total[3..].iter_mut().zip(joint.carried_axes(&root.r)) {
                    total.v = v;
                }
            }
        }
        for (k, segment) in core.segments.iter().enumerate() {
            let (jacobian, own) = (&self.jacobian[k], &mut self.own[k]);
            for (side, derivative) in exponent_derivatives(segment, q).iter().enumerate() {
                let w = M3::hat(derivative.u) + M3::diagonal(derivative.s);
                for axis in 0..3 {
                    own[3 * side + axis] = Twist { w: jacobian.j * w.0[axis], v: jacobian.q * w.0[axis] };
                }
                // e × e3 is −e2 for e1, e1 for e2.
                own[3 * side].v += jacobian.j.0[1] * -derivative.c;
                own[3 * side + 1].v += jacobian.j.0[0] * derivative.c;
            }
            let (before, total) = (&mut self.before[k], &mut self.total[3 * segment.element..][..6]);
            for a in 0..6 {
                before[a] = total[a];
                total[a] = before[a] + own[a];
            }
            self.element[k] = segment.element;
        }
    }
}

impl RodShape {
    /// Velocity, m/s, relative to what carries the root, and angular velocity, rad/s, of the frame at every point,
    /// world axes, at rates `rate`, 1/(m·s), of the unknowns `q` of this shape; without rates, at rest.
    pub fn velocities<'a>(
        &'a self,
        rod: &'a Rod,
        q: &'a [f64],
        rate: &'a [f64],
    ) -> impl Iterator<Item = (Vector3<f64>, Vector3<f64>)> + 'a {
        let core = &rod.core;
        let rate_of = |i: usize| rate.get(3 * i..3 * i + 3).map_or(V3([0.0; 3]), |r| V3([r[0], r[1], r[2]]));
        let mut t = Twist::none(0.0);
        if core.joint != RootJoint::Clamped {
            let (root, joint) = (&self.pose[0], Joint::new(q));
            t.w = root.r * (joint.jacobian() * rate_of(0));
            if core.joint == RootJoint::Free {
                let axes = M3(joint.carried_axes(&root.r));
                t.v = root.p.cross(t.w) + axes * rate_of(1);
            }
        }
        let at = |t: &Twist<f64>, pose: &Pose<f64>| ((t.v + t.w.cross(pose.p)).into(), t.w.into());
        let root = at(&t, &self.pose[0]);
        let next = move |k: usize| {
            let (segment, g) = (&core.segments[k], &self.pose[k]);
            let mut change = Twist::none(0.0);
            for (side, derivative) in exponent_derivatives(segment, q).iter().enumerate() {
                let r = rate_of(segment.element + side);
                change.w += r * derivative.s + derivative.u.cross(r);
                change.v += V3([r.0[1], -r.0[0], 0.0]) * derivative.c;
            }
            let lj = se3::left_jacobian(&self.exponent[k].psi, &self.exponent[k].coefficients);
            let w = g.r * (lj.j * change.w);
            t.v += g.r * (lj.q * change.w + lj.j * change.v) + g.p.cross(w);
            t.w += w;
            at(&t, &self.pose[k + 1])
        };
        std::iter::once(root).chain((0..core.segments.len()).map(next))
    }
}

impl Sensitivity {
    /// Sets the derivatives to those at unknowns `q` (1/m), whose shape is `shape`.
    pub fn update(&mut self, rod: &Rod, shape: &RodShape, q: &[f64]) {
        self.update_jacobians(shape);
        self.update_twists(&rod.core, shape, q);
    }

    /// Twists of the unknowns that move point `k`, in their order.
    fn twists_at(&self, k: usize) -> impl Iterator<Item = &Twist<f64>> {
        let (done, live) = match self.before.get(k) {
            Some(live) => (3 * self.element[k], &live[..]),
            None => (self.total.len(), &[][..]),
        };
        self.total[..done].iter().chain(live)
    }

    /// Adds `a` · `d`ᵀ ∂x/∂q to `row`: the scaled Jacobian row, along the world direction `d`, of a place
    /// fixed to the frame at point `k`. `x` is the place relative to the root, m.
    pub fn add_row(&self, k: usize, x: &Vector3<f64>, d: &Vector3<f64>, a: f64, row: &mut [f64]) {
        let wrench = Twist { w: (x.cross(d) * a).into(), v: (d * a).into() };
        for (r, t) in row.iter_mut().zip(self.twists_at(k)) {
            *r += wrench.dot(t);
        }
    }

    /// Adds `a` · `d`ᵀ ∂θ/∂q to `row`, with θ the rotation of the frame at point `k`, world axes.
    pub(super) fn add_turn_row(&self, k: usize, d: &Vector3<f64>, a: f64, row: &mut [f64]) {
        let wrench = Twist { w: (d * a).into(), v: Vector3::zeros().into() };
        for (r, t) in row.iter_mut().zip(self.twists_at(k)) {
            *r += wrench.dot(t);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn blended_points_lie_on_the_refined_curve_and_match_their_jacobian_rows() {
        let (rod, q) = Rod::bent_sample();
        let shape_at = |q: &[f64]| {
            let mut shape = RodShape::default();
            assert!(shape.update(&rod, &rod.root.r, q));
            shape
        };
        let shape = shape_at(&q);
        let curve: Vec<_> = shape.refined_curve(&rod, &q).collect();
        let mut sensitivity = Sensitivity::default();
        sensitivity.update(&rod, &shape, &q);
        let d = Vector3::new(0.3, -0.8, 0.5);
        for k in 0..rod.points() - 1 {
            for s in [0.0, 0.2, 0.5, 0.9, 1.0] {
                let (half, u) = if s < 0.5 { (0, 2.0 * s) } else { (1, 2.0 * s - 1.0) };
                let on_curve = curve[2 * k + half].lerp(&curve[2 * k + half + 1], u);
                assert!((shape.curve_point(&rod, k, s) - on_curve).norm() < 1e-6);
                let mut row = vec![0.0; q.len()];
                for (i, (weight, x)) in shape.blend_points(&rod, k, s).iter().enumerate() {
                    sensitivity.add_row(k + i, x, &d, *weight, &mut row);
                }
                for (a, row) in row.iter().enumerate() {
                    let moved = |by: f64| {
                        let mut q = q.clone();
                        q[a] += by;
                        d.dot(&shape_at(&q).curve_point(&rod, k, s))
                    };
                    let slope = (moved(1e-3) - moved(-1e-3)) / 2e-3;
                    assert!((slope - row).abs() < 1e-8, "{k} {s} {a}: {slope} {row}");
                }
            }
        }
    }
}
