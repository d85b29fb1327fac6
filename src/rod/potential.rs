//! The incremental potential Φ(q) of one implicit step, its gradient and its Hessian (`docs/theory.md` §4).
//!
//! Inertia, weight and drag are quadratic in a point's position, so together they tie the point to a target:
//! Φ = ½ Σ (x − x̂)ᵀB(x − x̂) + ½ (1 + τ/h) qᵀKq − pull·q, up to a constant. The Hessian is swept from the tip to the root over
//! composite bodies, geometric stiffness included: exact between sub-steps, to third order in the turn within one.

use super::kinematics::{COMMUTATOR, exponent, local};
use super::model::{Beam, Step};
use super::{Rod, Sensitivity, Shape};
use crate::math::lanes::{M3, Pose, Real, Twist, V3};
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

/// What drives a rod over one step.
#[derive(Debug, Clone)]
pub struct Load<F = f64> {
    /// 1 + τ/h: elasticity with its damping.
    pub(super) stiffening: F,
    /// Mass over h², N/m.
    pub(super) inertia: F,
    /// One for each point but the root.
    pub(super) tie: Vec<Tie<F>>,
    /// Generalised force that does not change with q.
    pub(super) pull: Vec<F>,
}

impl Default for Load {
    fn default() -> Self {
        Load { stiffening: 1.0, inertia: 0.0, tie: Vec::new(), pull: Vec::new() }
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
        self.stiffening = 1.0 + beam.damping / h;
        self.inertia = beam.mass / (h * h);
        self.pull.clone_from(&beam.prebend);
        beam.add_elastic(beam.damping / h, past, &mut self.pull);
        self.tie.clear();
        self.tie.extend(points.zip(&rod.weight).skip(1).map(|(point, weight)| {
            let mass = weight * rod.line_density;
            let (inertia, drag) = (mass / (h * h), point.drag * weight / h);
            let along = 0.5 * drag;
            let reached = point.previous + point.air * h;
            let t = &point.tangent;
            let force =
                gravity * mass + point.inertial * inertia + reached * drag - t * (along * t.dot(&reached));
            let alpha = inertia + drag;
            let target = (force + t * (along / (alpha - along) * t.dot(&force))) / alpha;
            Tie { alpha, u: (t * along.sqrt()).into(), target: target.into() }
        }));
    }
}

/// Φ at `q`, J.
#[inline(always)]
pub(super) fn energy<F: Real>(
    beam: &Beam<F>,
    load: &Load<F>,
    shape: &Shape<F>,
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
    beam.add_elastic(load.stiffening, q, scratch);
    for ((q, k), pull) in q.iter().zip(&*scratch).zip(&load.pull) {
        e += *q * (*k - *pull * 2.0);
    }
    e * 0.5
}

/// Sums over all that is downstream of a sub-step, about the root.
struct Composite<F> {
    /// Σ f.
    force: V3<F>,
    /// Σ x × f.
    torque: V3<F>,
    /// Σ x fᵀ.
    moment: M3<F>,
    /// Σ JᵀBJ with J = (−[x]×, 1), by blocks.
    tt: M3<F>,
    tp: M3<F>,
    pp: M3<F>,
}

impl<F: Real> Composite<F> {
    #[inline(always)]
    fn new(zero: F) -> Self {
        let (v, m) = (V3::all(zero), M3::diagonal(zero));
        Composite { force: v, torque: v, moment: m, tt: m, tp: m, pp: m }
    }

    #[inline(always)]
    fn add(&mut self, x: V3<F>, tie: &Tie<F>) {
        let y = x - tie.target;
        let f = tie.u * tie.u.dot(y) - y * tie.alpha;
        self.force += f;
        self.torque += x.cross(f);
        self.moment = self.moment + M3::outer(x, f);
        // [x]×B and −[x]×B[x]× for B = α 1 − u uᵀ, with c = x × u: α[x]× − c uᵀ and α(|x|² 1 − x xᵀ) − c cᵀ.
        let (c, ax) = (x.cross(tie.u), x * tie.alpha);
        self.pp = self.pp + (M3::diagonal(tie.alpha) - M3::outer(tie.u, tie.u));
        self.tp = self.tp + (M3::hat(ax) - M3::outer(c, tie.u));
        self.tt = self.tt + (M3::diagonal(x.dot(ax)) - M3::outer(ax, x) - M3::outer(c, c));
    }

    /// Derivative of the energy downstream along twist `t`.
    #[inline(always)]
    fn slope(&self, t: &Twist<F>) -> F {
        -(t.w.dot(self.torque) + t.v.dot(self.force))
    }

    /// Half of what the second derivative of a sub-step's exponent adds to the Hessian (`docs/theory.md` eq. 4.3), for its left and
    /// right node; the poses are those at its ends.
    #[inline(always)]
    fn bent(&self, step: &Step<F>, q: &[F], ends: [&Pose<F>; 2]) -> [[M3<F>; 2]; 2] {
        let half = step.h.same(0.5);
        // The wrench of all downstream, seen from the middle of the sub-step.
        let [(f0, n0), (f1, n1)] = [self.seen(ends[0]), self.seen(ends[1])];
        let (f, n) = ((f0 + f1) * half, (n0 + n1) * half);
        let psi = exponent(step, &local(step, q));
        let (phi, rho) = (psi.w, psi.v);
        let z = M3::outer(phi, n) + M3::outer(n, phi) + M3::outer(rho, f) + M3::outer(f, rho)
            - M3::diagonal((n.dot(phi) + f.dot(rho)) * 2.0);
        let z = z * half.same(1.0 / 24.0);
        let [n1, n2] = step.left;
        let (left, right) = ((n1 + n2) * step.h * half, (-(n1 + n2) + 2.0) * step.h * half);
        let crossed = M3::hat(n) * ((n1 - n2) * step.h * step.h * (0.5 * COMMUTATOR));
        let across = z * (left * right);
        [[z * (left * left), across + crossed], [across - crossed, z * (right * right)]]
    }

    /// The wrench of all downstream, force and torque, seen from the frame at `g`.
    #[inline(always)]
    fn seen(&self, g: &Pose<F>) -> (V3<F>, V3<F>) {
        (g.r.transposed(self.force), g.r.transposed(self.torque - g.p.cross(self.force)))
    }

    /// How all downstream responds to twists, `geometric` times the couple of the forces carried along included.
    #[inline(always)]
    fn response(&self, geometric: F) -> Response<F> {
        let carried = self.moment - M3::diagonal(self.moment.trace());
        Response {
            tt: self.tt - carried * geometric,
            tp: self.tp + M3::hat(self.force) * geometric,
            pt: self.tp,
            pp: self.pp,
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

/// Gradient of Φ into `gradient` and the lower triangle of its Hessian into `hessian` (row-major n × n).
///
/// The stiffness of the carried forces counts `geometric` times: 1 for the Hessian itself, 0 for what is positive definite.
#[allow(clippy::too_many_arguments)]
#[inline(always)]
pub(super) fn gradient_hessian<F: Real>(
    beam: &Beam<F>,
    load: &Load<F>,
    shape: &Shape<F>,
    sensitivity: &Sensitivity<F>,
    q: &[F],
    geometric: F,
    gradient: &mut Vec<F>,
    hessian: &mut Vec<F>,
) {
    let (n, zero) = (q.len(), geometric.same(0.0));
    gradient.resize(n, zero);
    for (g, pull) in gradient.iter_mut().zip(&load.pull) {
        *g = -*pull;
    }
    beam.add_elastic(load.stiffening, q, gradient);
    hessian.resize(n * n, zero);
    hessian.fill(zero);
    for i in 0..n / 3 {
        for c in 0..3 {
            let (a, stiffness) = (3 * i + c, load.stiffening * beam.stiffness[c]);
            hessian[a * n + a] = stiffness * beam.hat[i][0];
            if i > 0 {
                hessian[a * n + a - 3] = stiffness * beam.hat[i - 1][1];
            }
        }
    }

    let mut body = Composite::new(zero);
    // Over the sub-steps of an element: the response of its six unknowns, all that unknowns upstream need, and half of its block.
    let mut response = [Twist::none(zero); 6];
    let mut half = [[zero; 6]; 6];
    for k in (0..beam.steps.len()).rev() {
        body.add(shape.pose[k + 1].p, &load.tie[k]);
        let response_to = body.response(geometric);
        let first = 3 * beam.steps[k].element;
        let live = (n - first).min(6);
        let (step, before) = (&sensitivity.step[k], &sensitivity.before[k]);
        let mut up = *before;
        for (up, t) in up.iter_mut().zip(step) {
            *up = *up + *t * zero.same(0.5);
        }
        for b in 0..live {
            gradient[first + b] += body.slope(&step[b]);
            let p = response_to.to(&step[b]);
            response[b] = response[b] + p;
            // This sub-step against those before it in the element, and against half of itself: the other half, and those before
            // against this one, come by symmetry.
            for a in 0..live {
                half[a][b] += up[a].dot(&p);
            }
        }
        let bent = body.bent(&beam.steps[k], q, [&shape.pose[k], &shape.pose[k + 1]]);
        for a in 0..live {
            for b in 0..live {
                half[a][b] += bent[a / 3][b / 3].0[b % 3].0[a % 3] * geometric;
            }
        }
        if k == 0 || beam.steps[k - 1].element != beam.steps[k].element {
            for a in 0..live {
                let row = &mut hessian[(first + a) * n..];
                for b in 0..=a {
                    row[first + b] += half[a][b] + half[b][a];
                }
                for (h, s) in row.iter_mut().zip(&sensitivity.total[..first]) {
                    *h += s.dot(&response[a]);
                }
            }
            response = [Twist::none(zero); 6];
            half = [[zero; 6]; 6];
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::model::RodSource;
    use super::*;

    fn curl() -> Rod {
        curl_cut(0.01)
    }

    fn curl_cut(max_step: f64) -> Rod {
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
            natural: None,
            max_step,
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
        let (mut shape, mut sens) = (Shape::default(), Sensitivity::default());
        shape.update(rod, &rod.root.r, q);
        sens.update(rod, &shape, q);
        let (mut g, mut h) = (Vec::new(), Vec::new());
        gradient_hessian(&rod.beam, load, &shape, &sens, q, 1.0, &mut g, &mut h);
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
        for (tie, w) in load.tie.iter().zip(&rod.weight[1..]) {
            let y = V3::from(x) - tie.target;
            let force: Vector3<f64> = (tie.u * tie.u.dot(y) - y * tie.alpha).into();
            let mass = w * rod.line_density;
            let slip = (x - point.previous) / h - point.air;
            let along = point.tangent * point.tangent.dot(&slip);
            let sought =
                g * mass - (x - point.inertial) * (mass / (h * h)) - (slip - along * 0.5) * (point.drag * w);
            assert!((force - sought).norm() < 1e-12 * sought.norm(), "{force} {sought}");
        }
    }

    #[test]
    fn natural_shape_is_met_exactly() {
        let rod = curl();
        let mut shape = Shape::default();
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
        let (mut shape, mut scratch) = (Shape::default(), Vec::new());
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
        let (mut shape, mut sens, mut moved) = (Shape::default(), Sensitivity::default(), Shape::default());
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
            assert!((sens.velocity(k, &shape.x(k), &rate) - slope).norm() < 1e-8, "{k}");
        }
    }
}
