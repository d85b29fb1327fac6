//! RodShape of a rod from its unknowns, and how the shape moves with them.

use super::Rod;
use super::model::{Beam, GAUSS, Step};
use crate::math::lanes::{self, M3, Mask, Real, Twist, V3};
use crate::math::se3::{self, Coefficients, LeftJacobian, Pose};
use nalgebra::{Matrix3, Vector3};

/// √3/12, the weight of the commutator in the fourth-order Magnus step (Iserles & Nørsett 1999).
pub(super) const COMMUTATOR: f64 = 0.144_337_567_297_406_44;

/// Turn of a sub-step up to which its exponential is right, rad: a little less than half a turn. The Magnus series has long lost
/// its accuracy there.
const MAX_STEP_TURN: f64 = 3.0;

/// Poses along a rod, world axes, origin at the root. One per point.
#[derive(Debug, Clone)]
pub struct RodShape<F = f64> {
    pub(super) pose: Vec<lanes::Pose<F>>,
    /// One per sub-step: what took each pose to the next.
    pub(super) turn: Vec<Turn<F>>,
}

impl<F> Default for RodShape<F> {
    fn default() -> Self {
        RodShape { pose: Vec::new(), turn: Vec::new() }
    }
}

/// Exponent of a sub-step.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Turn<F> {
    pub psi: Twist<F>,
    pub coefficients: Coefficients<F>,
}

impl<F: Real> Turn<F> {
    #[inline(always)]
    pub fn by(psi: Twist<F>) -> Self {
        Turn { psi, coefficients: Coefficients::of(&psi) }
    }
}

impl RodShape {
    /// The shape at unknowns `q` with the root frame turned by `root` (columns d1, d2, d3, world); `false` where a sub-step turns by more
    /// than the curve can follow.
    pub fn update(&mut self, rod: &Rod, root: &Matrix3<f64>, q: &[f64]) -> bool {
        self.bend(&rod.beam, M3::from(*root), q) == 1
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

    /// Position of the middle of the curve between point `k` and the next, m, relative to the root, at the unknowns `q` of this shape: half a
    /// Magnus step from either point, of a strain that is linear through its values at the Gauss points of the whole, and the mean of the two.
    pub fn midpoint(&self, rod: &Rod, k: usize, q: &[f64]) -> Vector3<f64> {
        let step = &rod.beam.steps[k];
        let d = local(step, q);
        let [first, second] = [step.strain[0] + d[0], step.strain[1] + d[1]];
        let slope = (second - first) * 3_f64.sqrt();
        let mean = (first + second) * 0.5;
        let reached = |from: &lanes::Pose<f64>, h: f64, at: [f64; 2]| -> Vector3<f64> {
            let [first, second] = at.map(|u| mean + slope * (u - 0.5));
            let commutator = first.cross(second) * (h * h * COMMUTATOR);
            let e = (first - second) * (h * h * COMMUTATOR);
            let psi = Twist { w: (first + second) * (0.5 * h) + commutator, v: V3([e.0[1], -e.0[0], h]) };
            from.compose(&se3::exp(&psi, &Coefficients::of(&psi))).p.into()
        };
        let h = 0.5 * step.h;
        let ahead = reached(&self.pose[k], h, GAUSS.map(|u| 0.5 * u));
        // Backwards along the curve, from its end.
        let back = reached(&self.pose[k + 1], -h, GAUSS.map(|u| 1.0 - 0.5 * u));
        (ahead + back) / 2.0
    }

    /// The points and the middle of the curve between any two, m, relative to the root, at the unknowns `q` of this shape: where a rod is bent
    /// far more than by nature, cubics through its points alone do not have its length.
    pub fn refined_curve<'a>(
        &'a self,
        rod: &'a Rod,
        q: &'a [f64],
    ) -> impl Iterator<Item = Vector3<f64>> + 'a {
        let between = move |k: usize| [self.midpoint(rod, k, q), self.x(k + 1)];
        std::iter::once(self.x(0)).chain((0..rod.points() - 1).flat_map(between))
    }

    /// A place on [`RodShape::curve`] as a polyline, at the fraction `s` (0..=1) of sub-step `k`: shares of two points, m, relative to the root, of
    /// which one goes with the frame at point `k` and one with that at the next (`docs/theory.md` eq. 5.3).
    pub fn blend_points(&self, rod: &Rod, k: usize, s: f64) -> [(f64, Vector3<f64>); 2] {
        let reach = 0.25 * rod.beam.steps[k].h;
        let ahead = self.x(k) + self.tangent(k) * (reach * (s / (1.0 - s)).min(1.0));
        let back = self.x(k + 1) - self.tangent(k + 1) * (reach * ((1.0 - s) / s).min(1.0));
        [(1.0 - s, ahead), (s, back)]
    }

    /// The place of [`RodShape::blend_points`], m, relative to the root.
    pub fn curve_point(&self, rod: &Rod, k: usize, s: f64) -> Vector3<f64> {
        self.blend_points(rod, k, s).iter().map(|(share, x)| x * *share).sum()
    }

    /// Sets `places` to the points, then the middles between any two of cubics with the tangents of both, m, with the root at `root`.
    pub fn points_and_midpoints(&self, rod: &Rod, root: &Vector3<f64>, places: &mut Vec<Vector3<f64>>) {
        places.clear();
        places.extend((0..self.points()).map(|k| self.x(k) + root));
        let middle = |(k, step): (usize, &Step<f64>)| Vector3::from(self.between(k, step.h)) + root;
        places.extend(rod.beam.steps.iter().enumerate().map(middle));
    }

    /// Frame and position of every point.
    pub fn poses(&self) -> impl Iterator<Item = Pose> + '_ {
        self.pose.iter().map(|g| Pose { r: g.r.into(), p: g.p.into() })
    }
}

impl<F: Real> RodShape<F> {
    /// [`RodShape::update`] in every lane; returns those where no sub-step turns by [`MAX_STEP_TURN`].
    #[inline(always)]
    pub(super) fn bend(&mut self, beam: &Beam<F>, root: M3<F>, q: &[F]) -> Mask {
        let zero = beam.length.same(0.0);
        let mut most = zero;
        let mut g = lanes::Pose { r: root, p: V3::all(zero) };
        if self.turn.len() != beam.steps.len() || self.pose.len() != beam.points() {
            self.pose.resize(beam.points(), g);
            self.turn.resize(beam.steps.len(), Turn::by(Twist::none(zero)));
        }
        self.pose[0] = g;
        for ((step, pose), turn) in beam.steps.iter().zip(&mut self.pose[1..]).zip(&mut self.turn) {
            *turn = Turn::by(exponent(step, &local(step, q)));
            most = most.max(turn.psi.w.dot(turn.psi.w));
            g = g.compose(&se3::exp(&turn.psi, &turn.coefficients));
            *pose = g;
        }
        most.below(most.same(MAX_STEP_TURN * MAX_STEP_TURN))
    }

    /// Middle between point `k` and the next of the cubic with the tangents of both, m, relative to the root: what a sub-step of `h`, m, bends to, about.
    #[inline(always)]
    pub(super) fn between(&self, k: usize, h: F) -> V3<F> {
        let [a, b] = [&self.pose[k], &self.pose[k + 1]];
        (a.p + b.p) * h.same(0.5) + (a.r.0[2] - b.r.0[2]) * (h * 0.125)
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
fn local<F: Real>(step: &Step<F>, q: &[F]) -> [V3<F>; 2] {
    let (l, r) = (node(q, step.element), node(q, step.element + 1));
    [r + (l - r) * step.left[0], r + (l - r) * step.left[1]]
}

/// Magnus exponent ψ of a step: the natural one, corrected for the deviation δ at the Gauss points
/// (`docs/theory.md` eq. 3.2).
#[inline(always)]
fn exponent<F: Real>(step: &Step<F>, d: &[V3<F>; 2]) -> Twist<F> {
    let k = step.h * step.h * COMMUTATOR;
    let [a1, a2] = step.strain;
    let w = (d[0] + d[1]) * (step.h * 0.5) + ((a1 + d[0]).cross(d[1]) + d[0].cross(a2)) * k;
    let e = (d[0] - d[1]) * k;
    let v = step.natural.v;
    Twist { w: step.natural.w + w, v: V3([v.0[0] + e.0[1], v.0[1] - e.0[0], v.0[2]]) }
}

/// How the exponent of a sub-step moves with the unknowns of one of its nodes: ω by s e + u × e and v by c e × e3 for unknown e.
#[derive(Debug, Clone, Copy)]
pub(super) struct Share<F> {
    pub s: F,
    pub u: V3<F>,
    pub c: F,
}

/// The shares of the left and the right node of a sub-step (the derivatives of `docs/theory.md` eq. 3.2).
#[inline(always)]
pub(super) fn shares<F: Real>(step: &Step<F>, q: &[F]) -> [Share<F>; 2] {
    let d = local(step, q);
    let omega = [step.strain[0] + d[0], step.strain[1] + d[1]];
    let k = step.h * step.h * COMMUTATOR;
    // No closure in a kernel: out of line, it would not have the processor's vectors.
    let (left, right) = (step.left, [-step.left[0] + 1.0, -step.left[1] + 1.0]);
    [share(step.h, k, &omega, left), share(step.h, k, &omega, right)]
}

#[inline(always)]
fn share<F: Real>(h: F, k: F, omega: &[V3<F>; 2], [n1, n2]: [F; 2]) -> Share<F> {
    Share { s: h * 0.5 * (n1 + n2), u: (omega[0] * n2 - omega[1] * n1) * k, c: k * (n1 - n2) }
}

/// How a rod's shape moves with its unknowns: the world twists T and S of `docs/theory.md` §3.4, about the root.
#[derive(Debug, Clone)]
pub struct Sensitivity<F = f64> {
    /// For every sub-step Ad_g J_ℓ(ψ): what a change of its exponent gives to all that is downstream of it.
    pub(super) lever: Vec<LeftJacobian<F>>,
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
        let (lever, element) = (Vec::new(), Vec::new());
        Sensitivity { lever, step: Vec::new(), before: Vec::new(), total: Vec::new(), element }
    }
}

impl<F: Real> Sensitivity<F> {
    /// The levers at `shape`: enough for a gradient.
    #[inline(always)]
    pub(super) fn levers(&mut self, shape: &RodShape<F>) {
        let zero = shape.pose[0].p.0[0].same(0.0);
        if self.lever.len() != shape.turn.len() {
            let none = M3::diagonal(zero);
            self.lever.resize(shape.turn.len(), LeftJacobian { j: none, q: none });
        }
        for ((lever, turn), g) in self.lever.iter_mut().zip(&shape.turn).zip(&shape.pose) {
            let lj = se3::left_jacobian(&turn.psi, &turn.coefficients);
            let (j, q) = (g.r * lj.j, g.r * lj.q);
            let carried = M3([g.p.cross(j.0[0]), g.p.cross(j.0[1]), g.p.cross(j.0[2])]);
            *lever = LeftJacobian { j, q: q + carried };
        }
    }

    /// The twists at unknowns `q`, whose levers are there.
    #[inline(always)]
    pub(super) fn twists(&mut self, beam: &Beam<F>, q: &[F]) {
        let (none, n) = (Twist::none(beam.length.same(0.0)), beam.steps.len());
        if self.step.len() != n || self.total.len() != beam.unknowns() + 3 {
            self.step.resize(n, [none; 6]);
            self.before.resize(n, [none; 6]);
            self.element.resize(n, 0);
            self.total.resize(beam.unknowns() + 3, none);
        }
        self.total.fill(none);
        for (k, step) in beam.steps.iter().enumerate() {
            let (lever, own) = (&self.lever[k], &mut self.step[k]);
            for (side, share) in shares(step, q).iter().enumerate() {
                let w = M3::hat(share.u) + M3::diagonal(share.s);
                for axis in 0..3 {
                    own[3 * side + axis] = Twist { w: lever.j * w.0[axis], v: lever.q * w.0[axis] };
                }
                // e × e3 is −e2 for e1, e1 for e2.
                own[3 * side].v += lever.j.0[1] * -share.c;
                own[3 * side + 1].v += lever.j.0[0] * share.c;
            }
            let (before, total) = (&mut self.before[k], &mut self.total[3 * step.element..][..6]);
            for a in 0..6 {
                before[a] = total[a];
                total[a] = before[a] + own[a];
            }
            self.element[k] = step.element;
        }
    }
}

impl Sensitivity {
    /// The sensitivity at unknowns `q` whose shape is `shape`.
    pub fn update(&mut self, rod: &Rod, shape: &RodShape, q: &[f64]) {
        self.levers(shape);
        self.twists(&rod.beam, q);
    }

    /// Twists of the unknowns that move point `k`, in order.
    fn moving(&self, k: usize) -> impl Iterator<Item = &Twist<f64>> {
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
        for (r, t) in row.iter_mut().zip(self.moving(k)) {
            *r += wrench.dot(t);
        }
    }

    /// Velocity and angular velocity of point `k` (at `x`, relative to the root) under rates `qdot`, relative to a root at rest.
    pub fn velocity(&self, k: usize, x: &Vector3<f64>, qdot: &[f64]) -> (Vector3<f64>, Vector3<f64>) {
        let mut t = Twist::none(0.0);
        for (c, r) in self.moving(k).zip(qdot) {
            t = Twist { w: t.w + c.w * *r, v: t.v + c.v * *r };
        }
        ((t.v + t.w.cross((*x).into())).into(), t.w.into())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rod::{RodSource, SegmentSize, Taper};

    #[test]
    fn places_on_the_curve_are_on_it_and_move_as_their_carriers_do() {
        let (rod, q) = Rod::bent_sample();
        let shape_at = |q: &[f64]| {
            let mut shape = RodShape::default();
            assert!(shape.update(&rod, &rod.root.r, q));
            shape
        };
        let place = |shape: &RodShape, k: usize, s: f64| {
            shape.blend_points(&rod, k, s).iter().map(|(share, x)| x * *share).sum::<Vector3<f64>>()
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
                assert!((place(&shape, k, s) - on_curve).norm() < 1e-6);
                let mut row = vec![0.0; q.len()];
                for (i, (share, x)) in shape.blend_points(&rod, k, s).iter().enumerate() {
                    sensitivity.add_row(k + i, x, &d, *share, &mut row);
                }
                for (a, row) in row.iter().enumerate() {
                    let moved = |by: f64| {
                        let mut q = q.clone();
                        q[a] += by;
                        d.dot(&place(&shape_at(&q), k, s))
                    };
                    let slope = (moved(1e-3) - moved(-1e-3)) / 2e-3;
                    assert!((slope - row).abs() < 1e-8, "{k} {s} {a}: {slope} {row}");
                }
            }
        }
    }

    #[test]
    fn the_middle_of_the_curve_is_where_a_finer_rod_has_it() {
        let points: Vec<_> = (0..200)
            .map(|i| f64::from(i) * 0.02)
            .map(|t| Vector3::new(t.cos(), t.sin(), 0.5 * t) * 0.03)
            .collect();
        let rod = |sub_steps: f64| {
            let length = 0.06 * 1.25_f64.sqrt() * 1.99;
            Rod::new(&RodSource {
                points: &points,
                root_frame: None,
                arc: &[0.0, 0.25, 0.5, 0.75, 1.0],
                stiffness: [1e-9; 3],
                line_density: 1e-5,
                damping: 0.0,
                taper: Taper::NONE,
                natural_strain: None,
                segment_size: SegmentSize { max_length: length / 4.0 / (sub_steps - 0.5), max_turn: 10.0 },
            })
            .unwrap()
        };
        let q: Vec<f64> = (0..12).map(|i| 20.0 * f64::from(i * i).sin()).collect();
        let miss = |sub_steps: f64| {
            let (coarse, fine) = (rod(sub_steps), rod(2.0 * sub_steps));
            assert_eq!(2 * (coarse.points() - 1), fine.points() - 1);
            let mut shapes = [RodShape::default(), RodShape::default()];
            assert!(shapes[0].update(&coarse, &coarse.root.r, &q));
            assert!(shapes[1].update(&fine, &fine.root.r, &q));
            // In the frame of the point before, where the two do not yet differ.
            let local = |shape: &RodShape, k: usize, x: Vector3<f64>| {
                let g = shape.poses().nth(k).unwrap();
                g.r.transpose() * (x - g.p)
            };
            let off = |k: usize| {
                let middle = local(&shapes[0], k, shapes[0].midpoint(&coarse, k, &q));
                (middle - local(&shapes[1], 2 * k, shapes[1].x(2 * k + 1))).norm()
            };
            (0..coarse.points() - 1).map(off).fold(0.0, f64::max)
        };
        let (coarse, fine) = (miss(4.0), miss(8.0));
        assert!(coarse < 5e-6 && fine < coarse / 6.0, "{coarse} {fine}");
    }
}
