//! The incremental potential Φ(q) of one implicit step, its gradient and its Hessian (`docs/theory.md` §4).
//!
//! Inertia, weight and drag are quadratic in a point's position, so together they tie the point to a target:
//! Φ = ½ Σ (x − x̂)ᵀB(x − x̂) + ½ (1 + τ/h) qᵀKq − pull·q, up to a constant. The Hessian is swept from the tip to the root over
//! composite bodies, geometric stiffness included: exact between sub-steps, to third order in the turn within one.

use super::kinematics::{COMMUTATOR, shares};
use super::model::{Beam, Step};
use super::{Rod, RodShape, Sensitivity};
use crate::math::lanes::{M3, Real, Twist, V3};
use nalgebra::Vector3;

/// What drives one point of a rod over a step. Positions relative to the root at the end of the step, world axes.
#[derive(Debug, Clone, Copy)]
pub struct PointLoad {
    /// Position that inertia would reach, x* + h v*, m (`docs/theory.md` §4.1).
    pub inertial: Vector3<f64>,
    /// Position x* from which the velocity is measured, m.
    pub previous: Vector3<f64>,
    /// Velocity of the air, m/s.
    pub air: Vector3<f64>,
    /// Unit tangent of the strand, for the drag.
    pub tangent: Vector3<f64>,
    /// Drag per length and speed, N·s/m², across the strand; half of it along (slender-body theory,
    /// Cox 1970).
    pub drag: f64,
}

/// The forces on one point: f = −B (x − x̂), B = α 1 − u uᵀ.
#[derive(Debug, Clone, Copy)]
pub(super) struct Tie<F> {
    pub alpha: F,
    pub u: V3<F>,
    pub target: V3<F>,
}

impl<F: Real> Tie<F> {
    /// The force f at `x`.
    #[inline(always)]
    fn force(&self, x: V3<F>) -> V3<F> {
        let y = x - self.target;
        self.u * self.u.dot(y) - y * self.alpha
    }
}

/// What drives a rod over one step.
#[derive(Debug, Clone)]
pub struct Load<F = f64> {
    /// ∫ N_i N_j σ (1 + τ/h) ds, m: elasticity with its damping; see [`Beam::hat`].
    pub(super) hat: Vec<[F; 2]>,
    /// Mass over h², N/m.
    pub(super) inertia: F,
    /// One for each point but the root.
    pub(super) tie: Vec<Tie<F>>,
    /// Generalised force that does not change with q.
    pub(super) pull: Vec<F>,
}

impl Default for Load {
    fn default() -> Self {
        Load { hat: Vec::new(), inertia: 0.0, tie: Vec::new(), pull: Vec::new() }
    }
}

impl Load {
    /// Sets the load of a step of `h`, s, of a rod under `gravity` (with uniform force fields), m/s², whose rate of the unknowns is
    /// (q − `past`)/h; `points` holds every point, root first.
    pub fn set(
        &mut self,
        rod: &Rod,
        h: f64,
        gravity: &Vector3<f64>,
        past: &[f64],
        points: impl Iterator<Item = PointLoad>,
    ) {
        let beam = &rod.beam;
        self.hat.clear();
        let damped = |(hat, damping): (&[f64; 2], &[f64; 2])| [0, 1].map(|i| hat[i] + damping[i] / h);
        self.hat.extend(beam.hat.iter().zip(&rod.damping).map(damped));
        self.inertia = beam.mass / (h * h);
        self.pull.clone_from(&beam.prebend);
        beam.add_elastic(&rod.damping, 1.0 / h, past, &mut self.pull);
        self.tie.clear();
        for (point, (weight, mass)) in points.zip(rod.weight.iter().zip(&rod.mass)).skip(1) {
            let (inertia, drag) = (mass / (h * h), point.drag * weight / h);
            let along = 0.5 * drag;
            let reached = point.previous + point.air * h;
            let t = &point.tangent;
            let force =
                gravity * *mass + point.inertial * inertia + reached * drag - t * (along * t.dot(&reached));
            let alpha = inertia + drag;
            let target = (force + t * (along / (alpha - along) * t.dot(&force))) / alpha;
            self.tie.push(Tie { alpha, u: (t * along.sqrt()).into(), target: target.into() });
        }
    }

    /// Adds a spring of `stiffness`, N/m, that pulls point `k` to `goal`, relative to the root at the end of the step, world axes, m; on the
    /// root it has no effect.
    pub fn add_spring(&mut self, k: usize, goal: &Vector3<f64>, stiffness: f64) {
        if let Some(tie) = k.checked_sub(1).and_then(|i| self.tie.get_mut(i)) {
            // The new B takes the new target to what both pull with at the root.
            let u = tie.u;
            let pull = tie.target * tie.alpha - u * u.dot(tie.target) + V3::from(*goal) * stiffness;
            tie.alpha += stiffness;
            tie.target = (pull + u * (u.dot(pull) / (tie.alpha - u.dot(u)))) * (1.0 / tie.alpha);
        }
    }

    /// Adds the constant force `f`, N, world axes, on point `k`; on the root it has no effect.
    pub fn add_force(&mut self, k: usize, f: &Vector3<f64>) {
        if let Some(tie) = k.checked_sub(1).and_then(|i| self.tie.get_mut(i)) {
            // B⁻¹ f.
            let (u, f) = (tie.u, (*f).into());
            let along = u.dot(f) / (tie.alpha - u.dot(u));
            tie.target += (f + u * along) * (1.0 / tie.alpha);
        }
    }
}

/// Φ at `q`, J.
#[inline(always)]
pub(super) fn energy<F: Real>(
    beam: &Beam<F>,
    load: &Load<F>,
    shape: &RodShape<F>,
    q: &[F],
    scratch: &mut Vec<F>,
) -> F {
    let zero = beam.length.same(0.0);
    let mut e = zero;
    for (tie, g) in load.tie.iter().zip(&shape.pose[1..]) {
        let y = g.p - tie.target;
        let along = tie.u.dot(y);
        e += tie.alpha * y.dot(y) - along * along;
    }
    scratch.resize(q.len(), zero);
    scratch.fill(zero);
    beam.add_elastic(&load.hat, zero.same(1.0), q, scratch);
    for ((q, k), pull) in q.iter().zip(&*scratch).zip(&load.pull) {
        e += *q * (*k - *pull * 2.0);
    }
    e * 0.5
}

/// A symmetric matrix: xx, xy, xz, yy, yz, zz.
struct Symmetric<F>([F; 6]);

impl<F: Real> Symmetric<F> {
    /// Adds d 1 − a bᵀ − c cᵀ, a being along b.
    #[inline(always)]
    fn add(&mut self, d: F, a: V3<F>, b: V3<F>, c: V3<F>) {
        // No closures in a kernel: out of line, they would not have the processor's vectors.
        for (entry, [i, j]) in [[0, 0], [0, 1], [0, 2], [1, 1], [1, 2], [2, 2]].into_iter().enumerate() {
            let less = a.0[i] * b.0[j] + c.0[i] * c.0[j];
            self.0[entry] += if i == j { d - less } else { -less };
        }
    }

    #[inline(always)]
    fn full(&self) -> M3<F> {
        let [xx, xy, xz, yy, yz, zz] = self.0;
        M3([V3([xx, xy, xz]), V3([xy, yy, yz]), V3([xz, yz, zz])])
    }
}

/// Sums over all that is downstream of a sub-step, about the root.
struct Composite<F> {
    /// Σ f.
    force: V3<F>,
    /// Σ x fᵀ.
    moment: M3<F>,
    /// Σ JᵀBJ with J = (−[x]×, 1), by blocks.
    tt: Symmetric<F>,
    tp: M3<F>,
    pp: Symmetric<F>,
}

impl<F: Real> Composite<F> {
    #[inline(always)]
    fn new(zero: F) -> Self {
        let m = M3::diagonal(zero);
        Composite {
            force: V3::all(zero),
            moment: m,
            tt: Symmetric([zero; 6]),
            tp: m,
            pp: Symmetric([zero; 6]),
        }
    }

    #[inline(always)]
    fn add(&mut self, x: V3<F>, tie: &Tie<F>) {
        let f = tie.force(x);
        self.force += f;
        self.moment = self.moment + M3::outer(x, f);
        // [x]×B and −[x]×B[x]× for B = α 1 − u uᵀ, with c = x × u: α[x]× − c uᵀ and α(|x|² 1 − x xᵀ) − c cᵀ.
        let (c, ax, none) = (x.cross(tie.u), x * tie.alpha, V3::all(tie.alpha.same(0.0)));
        self.pp.add(tie.alpha, none, none, tie.u);
        self.tp = self.tp + (M3::hat(ax) - M3::outer(c, tie.u));
        self.tt.add(x.dot(ax), ax, x, c);
    }

    /// How all downstream responds to twists, `geometric` times the couple of the forces carried along included.
    #[inline(always)]
    fn response(&self, geometric: F) -> Response<F> {
        let carried = self.moment - M3::diagonal(self.moment.trace());
        Response {
            tt: self.tt.full() - carried * geometric,
            tp: self.tp + M3::hat(self.force) * geometric,
            pt: self.tp,
            pp: self.pp.full(),
        }
    }
}

/// The matrix that takes a twist to the response P of all downstream (`docs/theory.md` eq. 4.2), by blocks; that from v to the
/// rotation part and that from ω to the translation part are each other's transposes but for the forces carried along.
struct Response<F> {
    tt: M3<F>,
    tp: M3<F>,
    pt: M3<F>,
    pp: M3<F>,
}

impl<F: Real> Response<F> {
    #[inline(always)]
    fn to(&self, t: &Twist<F>) -> Twist<F> {
        Twist { w: self.tt * t.w + self.tp * t.v, v: self.pt.transposed(t.w) + self.pp * t.v }
    }
}

/// What the sub-steps of one element add to the Hessian.
struct Block<F> {
    /// Response of the element's six unknowns: all that unknowns upstream need.
    response: [Twist<F>; 6],
    /// That of the sub-step at hand.
    own: [Twist<F>; 6],
    /// Entry (b, a) of the element's own block is `half[a][b] + half[b][a]`.
    half: [[F; 6]; 6],
}

impl<F: Real> Block<F> {
    #[inline(always)]
    fn new(zero: F) -> Self {
        let none = [Twist::none(zero); 6];
        Block { response: none, own: none, half: [[zero; 6]; 6] }
    }

    #[inline(always)]
    fn clear(&mut self, zero: F) {
        self.response.fill(Twist::none(zero));
        self.half.fill([zero; 6]);
    }

    /// Adds a sub-step, rigid, whose first `N` unknowns give the twists `own` and gave `before` through those before it.
    #[inline(always)]
    fn add<const N: usize>(&mut self, to: &Response<F>, own: &[Twist<F>; 6], before: &[Twist<F>; 6]) {
        // This sub-step against those before it in the element, and against half of itself: the other half, and those before
        // against this one, come by symmetry.
        for ((sum, p), t) in self.response.iter_mut().zip(&mut self.own).zip(own).take(N) {
            *p = to.to(t);
            *sum = *sum + *p;
        }
        for a in 0..N {
            let up = before[a] + own[a] * own[a].w.0[0].same(0.5);
            for b in 0..N {
                self.half[b][a] += up.dot(&self.own[b]);
            }
        }
    }

    /// Adds `geometric` times what the second derivative of the sub-step's exponent ψ does (`docs/theory.md` eq. 4.3); `wrench` is
    /// that of all downstream as seen from the sub-step, for its first `N` unknowns.
    #[inline(always)]
    fn bend<const N: usize>(&mut self, step: &Step<F>, psi: &Twist<F>, wrench: &Twist<F>, geometric: F) {
        let (phi, rho, n, f) = (psi.w, psi.v, wrench.w, wrench.v);
        let z = M3::outer(phi, n) + M3::outer(n, phi) + M3::outer(rho, f) + M3::outer(f, rho)
            - M3::diagonal((n.dot(phi) + f.dot(rho)) * 2.0);
        let z = z * (geometric * (1.0 / 12.0));
        let [n1, n2] = step.left;
        let (left, right) = ((n1 + n2) * step.h * 0.5, (-(n1 + n2) + 2.0) * step.h * 0.5);
        let (ll, rr) = (z * (left * left), z * (right * right));
        let rl = z * (left * right) - M3::hat(n) * ((n1 - n2) * step.h * step.h * geometric * COMMUTATOR);
        // An entry on the diagonal counts twice.
        for b in 0..3 {
            self.half[b][b] += ll.0[b].0[b] * 0.5;
            for a in b + 1..3 {
                self.half[b][a] += ll.0[b].0[a];
            }
            if N > 3 {
                for a in 0..3 {
                    self.half[b][3 + a] += rl.0[b].0[a];
                }
                self.half[3 + b][3 + b] += rr.0[b].0[b] * 0.5;
                for a in b + 1..3 {
                    self.half[3 + b][3 + a] += rr.0[b].0[a];
                }
            }
        }
    }
}

/// Gradient of Φ at `q`, whose shape and levers are given (`docs/theory.md` §4.3), and for every sub-step the wrench, torque and
/// force, of all that is downstream of it.
#[inline(always)]
pub(super) fn gradient<F: Real>(
    beam: &Beam<F>,
    load: &Load<F>,
    shape: &RodShape<F>,
    sensitivity: &Sensitivity<F>,
    q: &[F],
    gradient: &mut Vec<F>,
    wrench: &mut Vec<Twist<F>>,
) {
    let zero = beam.length.same(0.0);
    wrench.resize(beam.steps.len(), Twist::none(zero));
    gradient.resize(q.len(), zero);
    for (g, pull) in gradient.iter_mut().zip(&load.pull) {
        *g = -*pull;
    }
    beam.add_elastic(&load.hat, zero.same(1.0), q, gradient);
    let (mut force, mut torque) = (V3::all(zero), V3::all(zero));
    for k in (0..beam.steps.len()).rev() {
        let (x, lever) = (shape.pose[k + 1].p, &sensitivity.lever[k]);
        let f = load.tie[k].force(x);
        force += f;
        torque += x.cross(f);
        // The wrench of all downstream as it turns and moves the exponent: seen from along the sub-step.
        let turning = lever.j.transposed(torque) + lever.q.transposed(force);
        let moving = lever.j.transposed(force);
        wrench[k] = Twist { w: turning, v: moving };
        let node = beam.steps[k].element;
        for (slope, share) in gradient[3 * node..].chunks_exact_mut(3).zip(shares(&beam.steps[k], q)) {
            let across = V3([-moving.0[1], moving.0[0], zero]);
            let along = turning * share.s + turning.cross(share.u) + across * share.c;
            for (slope, a) in slope.iter_mut().zip(along.0) {
                *slope -= a;
            }
        }
    }
}

/// The lower triangle of the Hessian of Φ, where [`gradient`] gave `wrench`, into `hessian` (row-major n × n).
///
/// The stiffness of the carried forces counts `geometric` times: 1 for the Hessian itself, 0 for what is positive definite.
#[inline(always)]
pub(super) fn hessian<F: Real>(
    beam: &Beam<F>,
    load: &Load<F>,
    shape: &RodShape<F>,
    sensitivity: &Sensitivity<F>,
    wrench: &[Twist<F>],
    geometric: F,
    hessian: &mut Vec<F>,
) {
    let (n, zero) = (beam.unknowns(), geometric.same(0.0));
    hessian.resize(n * n, zero);
    for (i, row) in hessian.chunks_exact_mut(n).enumerate() {
        row[..i].fill(zero);
    }
    for i in 0..n / 3 {
        for c in 0..3 {
            let (a, stiffness) = (3 * i + c, beam.stiffness[c]);
            hessian[a * n + a] = stiffness * load.hat[i][0];
            if i > 0 {
                hessian[a * n + a - 3] = stiffness * load.hat[i - 1][1];
            }
        }
    }

    let mut body = Composite::new(zero);
    let mut block = Block::new(zero);
    for k in (0..beam.steps.len()).rev() {
        body.add(shape.pose[k + 1].p, &load.tie[k]);
        let response = body.response(geometric);
        let (step, psi, first) = (&beam.steps[k], &shape.turn[k].psi, 3 * beam.steps[k].element);
        let (own, before) = (&sensitivity.step[k], &sensitivity.before[k]);
        let live = if n - first > 3 {
            block.add::<6>(&response, own, before);
            block.bend::<6>(step, psi, &wrench[k], geometric);
            6
        } else {
            block.add::<3>(&response, own, before);
            block.bend::<3>(step, psi, &wrench[k], geometric);
            3
        };
        if k == 0 || beam.steps[k - 1].element != step.element {
            for a in 0..live {
                let row = &mut hessian[(first + a) * n..];
                for b in 0..=a {
                    row[first + b] += block.half[a][b] + block.half[b][a];
                }
                for (h, s) in row.iter_mut().zip(&sensitivity.total[..first]) {
                    *h += s.dot(&block.response[a]);
                }
            }
            block.clear(zero);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::model::{RodSource, SegmentSize, Taper};
    use super::*;

    fn curl() -> Rod {
        curl_cut(0.01)
    }

    fn curl_cut(length: f64) -> Rod {
        let points: Vec<_> = (0..40)
            .map(|i| {
                let a = i as f64 * 0.2;
                Vector3::new(0.01 * a.cos(), -0.006 * a, 0.01 * a.sin())
            })
            .collect();
        let arc: Vec<f64> = (0..6).map(|i| (i as f64 / 5.0).powf(1.3)).collect();
        Rod::new(&RodSource {
            points: &points,
            root_frame: None,
            arc: &arc,
            stiffness: [8e-9, 6e-9, 4e-9],
            line_density: 6.6e-6,
            damping: 0.004,
            taper: Taper::NONE,
            natural_strain: None,
            segment_size: SegmentSize { max_length: length, ..SegmentSize::FINE },
        })
        .unwrap()
    }

    /// A load with every term switched on.
    fn load(rod: &Rod, h: f64) -> Load {
        let wave =
            |k: usize, a: f64| Vector3::new((a + k as f64).sin(), (2.0 * a + k as f64).cos(), a.sin()) * 0.01;
        let points = (0..rod.points()).map(|k| PointLoad {
            inertial: wave(k, 1.0),
            previous: wave(k, 1.1),
            air: wave(k, 2.0) * 100.0,
            tangent: wave(k, 0.3).normalize(),
            drag: 2e-4 / (1.0 + k as f64),
        });
        let past: Vec<f64> = (0..rod.unknowns()).map(|i| (i as f64).sin() * 2.0).collect();
        let mut load = Load::default();
        load.set(rod, h, &Vector3::new(0.3, -9.81, 0.1), &past, points);
        load
    }

    fn derivatives(rod: &Rod, load: &Load, q: &[f64]) -> (Vec<f64>, Vec<f64>) {
        let (mut shape, mut sens) = (RodShape::default(), Sensitivity::default());
        shape.update(rod, &rod.root.r, q);
        sens.update(rod, &shape, q);
        let (mut g, mut wrench, mut h) = (Vec::new(), Vec::new(), Vec::new());
        gradient(&rod.beam, load, &shape, &sens, q, &mut g, &mut wrench);
        hessian(&rod.beam, load, &shape, &sens, &wrench, 1.0, &mut h);
        (g, h)
    }

    #[test]
    fn a_tie_is_inertia_weight_and_drag() {
        let (rod, h, g) = (curl(), 0.01, Vector3::new(0.3, -9.81, 0.1));
        let point = PointLoad {
            inertial: Vector3::new(0.01, 0.02, -0.03),
            previous: Vector3::new(0.02, -0.01, 0.01),
            air: Vector3::new(1.0, 2.0, -1.0),
            tangent: Vector3::new(0.6, 0.0, 0.8),
            drag: 3e-4,
        };
        let mut load = Load::default();
        let past = vec![0.0; rod.unknowns()];
        load.set(&rod, h, &g, &past, std::iter::repeat_n(point, rod.points()));
        let x = Vector3::new(0.03, 0.01, 0.02);
        for (tie, (w, mass)) in load.tie.iter().zip(rod.weight.iter().zip(&rod.mass).skip(1)) {
            let y = V3::from(x) - tie.target;
            let force: Vector3<f64> = (tie.u * tie.u.dot(y) - y * tie.alpha).into();
            let slip = (x - point.previous) / h - point.air;
            let along = point.tangent * point.tangent.dot(&slip);
            let sought =
                g * *mass - (x - point.inertial) * (mass / (h * h)) - (slip - along * 0.5) * (point.drag * w);
            assert!((force - sought).norm() < 1e-12 * sought.norm(), "{force} {sought}");
        }
    }

    #[test]
    fn a_goal_pulls_like_a_spring_beside_all_else() {
        let rod = curl();
        let (plain, goal, x) =
            (load(&rod, 0.01), Vector3::new(0.02, -0.03, 0.01), Vector3::new(0.01, 0.04, 0.0));
        let mut pulled = plain.clone();
        (0..rod.points()).for_each(|k| pulled.add_spring(k, &goal, 1e-3 * k as f64));
        for (k, (before, now)) in plain.tie.iter().zip(&pulled.tie).enumerate() {
            let more: Vector3<f64> = (now.force(x.into()) - before.force(x.into())).into();
            let sought = (goal - x) * (1e-3 * (k + 1) as f64);
            assert!((more - sought).norm() < 1e-12, "{more} {sought}");
        }
    }

    #[test]
    fn natural_shape_is_met_exactly() {
        let rod = curl();
        let mut shape = RodShape::default();
        shape.update(&rod, &rod.root.r, &vec![0.0; rod.unknowns()]);
        // The groom's first and last points.
        let tip = Vector3::new(0.01 * 7.8_f64.cos(), -0.006 * 7.8, 0.01 * 7.8_f64.sin());
        assert!((shape.x(rod.points() - 1) + rod.root.p - tip).norm() < 1e-13);
        assert!((rod.weight.iter().sum::<f64>() - rod.length()).abs() < 1e-14);
    }

    #[test]
    fn gradient_is_the_slope_of_the_energy() {
        let rod = curl();
        let load = load(&rod, 1.0 / 192.0);
        let q: Vec<f64> = (0..rod.unknowns()).map(|i| (i as f64 * 1.7).cos() * 6.0).collect();
        let (g, _) = derivatives(&rod, &load, &q);
        let (mut shape, mut scratch) = (RodShape::default(), Vec::new());
        let mut at = |q: &[f64]| {
            shape.update(&rod, &rod.root.r, q);
            energy(&rod.beam, &load, &shape, q, &mut scratch)
        };
        let scale = g.iter().fold(0.0_f64, |m, x| m.max(x.abs()));
        assert!(scale > 0.0);
        for i in 0..q.len() {
            let mut p = q.clone();
            p[i] += 1e-4;
            let hi = at(&p);
            p[i] -= 2e-4;
            let slope = (hi - at(&p)) / 2e-4;
            assert!((slope - g[i]).abs() < 1e-7 * scale, "{i}: {slope} {}", g[i]);
        }
    }

    /// Largest error of the Hessian between unknowns that share an element and between those that do not, relative
    /// to its largest entry.
    fn hessian_error(rod: &Rod) -> (f64, f64) {
        let load = load(rod, 1.0 / 192.0);
        let q: Vec<f64> = (0..rod.unknowns()).map(|i| (i as f64 * 1.7).cos() * 6.0).collect();
        let n = q.len();
        let (_, h) = derivatives(rod, &load, &q);
        let (mut shared, mut apart, mut scale) = (0.0_f64, 0.0_f64, 0.0_f64);
        for j in 0..n {
            let mut p = q.clone();
            p[j] += 1e-4;
            let (hi, _) = derivatives(rod, &load, &p);
            p[j] -= 2e-4;
            let (lo, _) = derivatives(rod, &load, &p);
            for i in j..n {
                let e = ((hi[i] - lo[i]) / 2e-4 - h[i * n + j]).abs();
                scale = scale.max(h[i * n + j].abs());
                let worst = if i / 3 > j / 3 + 1 { &mut apart } else { &mut shared };
                *worst = worst.max(e);
            }
        }
        (shared / scale, apart / scale)
    }

    #[test]
    fn hessian_is_the_slope_of_the_gradient() {
        let (shared, apart) = hessian_error(&curl_cut(0.002));
        assert!(apart < 1e-7, "{apart}");
        // Within a sub-step what is left out is of fourth order in the turn.
        let (finer, apart) = hessian_error(&curl_cut(0.001));
        assert!(apart < 1e-7, "{apart}");
        assert!(finer < 0.1 * shared && shared < 2e-4, "{shared} {finer}");
    }

    #[test]
    fn rows_of_the_jacobian_are_slopes_of_positions() {
        let rod = curl();
        let q: Vec<f64> = (0..rod.unknowns()).map(|i| (i as f64).cos() * 5.0).collect();
        let (mut shape, mut sens, mut moved) =
            (RodShape::default(), Sensitivity::default(), RodShape::default());
        shape.update(&rod, &rod.root.r, &q);
        sens.update(&rod, &shape, &q);
        let d = Vector3::new(0.3, -0.5, 0.8);
        let rate: Vec<f64> = (0..q.len()).map(|i| (i as f64 * 0.9).sin()).collect();
        let ahead: Vec<f64> = q.iter().zip(&rate).map(|(q, r)| q + 1e-5 * r).collect();
        moved.update(&rod, &rod.root.r, &ahead);
        for k in 1..rod.points() {
            let mut row = vec![0.0; q.len()];
            sens.add_row(k, &shape.x(k), &d, 2.0, &mut row);
            let slope = (moved.x(k) - shape.x(k)) / 1e-5;
            let by_row: f64 = row.iter().zip(&rate).map(|(a, b)| a * b).sum();
            assert!((by_row - 2.0 * d.dot(&slope)).abs() < 1e-8, "{k}");
            assert!((sens.velocity(k, &shape.x(k), &rate).0 - slope).norm() < 1e-8, "{k}");
        }
    }
}
