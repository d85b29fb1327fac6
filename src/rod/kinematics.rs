//! Shape of a rod from its unknowns, and how the shape moves with them.

use super::model::{Rod, Step};
use crate::math::se3::{self, Pose, Twist};
use nalgebra::Vector3;

/// √3/12, the weight of the commutator in the fourth-order Magnus step (Iserles & Nørsett 1999).
const COMMUTATOR: f64 = 0.144_337_567_297_406_44;

/// Poses along a rod, world axes, origin at the root. One per point.
#[derive(Debug, Clone, Default)]
pub struct Shape {
    /// Frame and position of each point.
    pub pose: Vec<Pose>,
}

impl Shape {
    /// The shape at unknowns `q` with the root frame turned by `root` (columns d1, d2, d3, world).
    pub fn update(&mut self, rod: &Rod, root: &nalgebra::Matrix3<f64>, q: &[f64]) {
        self.pose.clear();
        let mut g = Pose { r: *root, p: Vector3::zeros() };
        self.pose.push(g);
        for step in &rod.steps {
            g = g.compose(&se3::exp(&exponent(step, &local(step, q))));
            self.pose.push(g);
        }
    }

    /// Position of point `k`, m, relative to the root.
    pub fn x(&self, k: usize) -> Vector3<f64> {
        self.pose[k].p
    }
}

/// Deviation at the Gauss points of a step.
fn local(step: &Step, q: &[f64]) -> [Vector3<f64>; 2] {
    let at = |i: usize| q.get(3 * i..3 * i + 3).map_or(Vector3::zeros(), |c| Vector3::new(c[0], c[1], c[2]));
    let (l, r) = (at(step.element), at(step.element + 1));
    step.left.map(|n| l * n + r * (1.0 - n))
}

/// Magnus exponent ψ of a step: the natural one, corrected for the deviation δ at the Gauss points
/// (`docs/theory.md` eq. 3.2).
fn exponent(step: &Step, d: &[Vector3<f64>; 2]) -> Twist {
    let (h, k) = (step.h, COMMUTATOR * step.h * step.h);
    let [a1, a2] = &step.strain;
    let w = (d[0] + d[1]) * (h / 2.0) + (a1.cross(&d[1]) + d[0].cross(a2) + d[0].cross(&d[1])) * k;
    let e = d[0] - d[1];
    Twist::new(step.natural.w + w, step.natural.v + Vector3::new(e.y, -e.x, 0.0) * k)
}

/// How a rod's shape moves with its unknowns: the world twists T and S of `docs/theory.md` §3.4, about the root.
#[derive(Debug, Clone, Default)]
pub struct Sensitivity {
    /// For every sub-step, the twist that each of its six unknowns (left node, right node) gives, by that
    /// sub-step alone, to all that is downstream of it.
    pub(super) step: Vec<[Twist; 6]>,
    /// For every sub-step, the twist that its six unknowns give through the sub-steps before it.
    pub(super) before: Vec<[Twist; 6]>,
    /// For every unknown, the twist that it gives to all downstream of its support.
    pub(super) total: Vec<Twist>,
    /// Element of each sub-step.
    element: Vec<usize>,
}

impl Sensitivity {
    /// The sensitivity at unknowns `q` whose shape is `shape`.
    pub fn update(&mut self, rod: &Rod, shape: &Shape, q: &[f64]) {
        let n = rod.unknowns();
        self.step.clear();
        self.before.clear();
        self.element.clear();
        self.total.clear();
        // Room for the tip node too: it moves with nothing, but its slots keep the loops plain.
        self.total.resize(n + 3, Twist::default());
        for (step, g) in rod.steps.iter().zip(&shape.pose) {
            let d = local(step, q);
            let omega = [step.strain[0] + d[0], step.strain[1] + d[1]];
            let lj = se3::left_jacobian(&exponent(step, &d));
            let (h, k) = (step.h, COMMUTATOR * step.h * step.h);
            // Derivatives of w: h/2 (n1 + n2) e + k (n1 e × Ω2 + n2 Ω1 × e) = (a + k [n2 Ω1 − n1 Ω2]×) e;
            // of v: k (n1 − n2) e × e3.
            let mut columns = [Twist::default(); 6];
            for side in 0..2 {
                let [n1, n2] = if side == 0 { step.left } else { step.left.map(|n| 1.0 - n) };
                let w = se3::hat(&((omega[0] * n2 - omega[1] * n1) * k))
                    + nalgebra::Matrix3::from_diagonal_element(h / 2.0 * (n1 + n2));
                let c = k * (n1 - n2);
                for axis in 0..3 {
                    let dw: Vector3<f64> = w.column(axis).into();
                    let dv = match axis {
                        0 => Vector3::new(0.0, -c, 0.0),
                        1 => Vector3::new(c, 0.0, 0.0),
                        _ => Vector3::zeros(),
                    };
                    columns[3 * side + axis] = g.adjoint(&Twist::new(lj.j * dw, lj.q * dw + lj.j * dv));
                }
            }
            let first = 3 * step.element;
            let mut before = [Twist::default(); 6];
            for (a, c) in columns.iter().enumerate() {
                let total = &mut self.total[first + a];
                before[a] = *total;
                total.w += c.w;
                total.v += c.v;
            }
            self.step.push(columns);
            self.before.push(before);
            self.element.push(step.element);
        }
        self.total.truncate(n);
    }

    /// Row of the Jacobian of point `k` (at `x`, relative to the root) along the world direction `d`, scaled and added:
    /// `row += a · d · ∂x/∂q`.
    pub fn add_row(&self, k: usize, x: &Vector3<f64>, d: &Vector3<f64>, a: f64, row: &mut [f64]) {
        let torque = x.cross(d) * a;
        let force = d * a;
        let project = |t: &Twist| torque.dot(&t.w) + force.dot(&t.v);
        let (done, live) = match self.before.get(k) {
            Some(live) => (3 * self.element[k], &live[..]),
            None => (self.total.len(), &[][..]),
        };
        for (r, t) in row.iter_mut().zip(self.total[..done].iter().chain(live)) {
            *r += project(t);
        }
    }

    /// Velocity of point `k` (at `x`, relative to the root) under rates `qdot`, relative to a root at rest.
    pub fn velocity(&self, k: usize, x: &Vector3<f64>, qdot: &[f64]) -> Vector3<f64> {
        let (done, live) = match self.before.get(k) {
            Some(live) => (3 * self.element[k], &live[..]),
            None => (self.total.len(), &[][..]),
        };
        let mut t = Twist::default();
        for (c, r) in self.total[..done].iter().chain(live).zip(qdot) {
            t.w += c.w * *r;
            t.v += c.v * *r;
        }
        t.v + t.w.cross(x)
    }
}
