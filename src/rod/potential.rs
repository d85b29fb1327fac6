//! The incremental potential Φ(q) of one implicit step, its gradient and its Hessian (`docs/theory.md` §4).
//!
//! Φ = ½ Σ (m/h²) |x − x̃|² − Σ m g·x + drag + ½ (q − q̂)ᵀK(q − q̂) + (τ/2h) (q − qⁿ)ᵀK(q − qⁿ).
//! The Hessian is swept from the tip to the root over composite bodies, geometric stiffness included: exact
//! between sub-steps, symmetrised within one.

use super::{Rod, Sensitivity, Shape};
use crate::math::se3::{Twist, hat};
use nalgebra::{Matrix3, Vector3};

/// What drives a rod over one step. Positions relative to the root at the end of the step, world axes; one entry
/// per point of the rod.
#[derive(Debug, Clone, Default)]
pub struct Load {
    /// Step h, s.
    pub h: f64,
    /// Acceleration of gravity and uniform force fields, m/s².
    pub gravity: Vector3<f64>,
    /// Position that inertia would reach, xⁿ + h vⁿ.
    pub inertial: Vec<Vector3<f64>>,
    /// Position at the start of the step.
    pub previous: Vec<Vector3<f64>>,
    /// Velocity of the air at the start of the step, m/s.
    pub air: Vec<Vector3<f64>>,
    /// Tangent at the start of the step.
    pub tangent: Vec<Vector3<f64>>,
    /// Drag per length and speed, N·s/m², across the strand; half of it along (slender-body theory,
    /// Cox 1970).
    pub drag: Vec<f64>,
    /// Unknowns at the start of the step.
    pub q: Vec<f64>,
}

/// Force on a point and the matrix by which it stiffens: f = −∂φ/∂x, B = ∂²φ/∂x².
struct PointForce {
    f: Vector3<f64>,
    b: Matrix3<f64>,
}

impl Load {
    fn drag_matrix(&self, k: usize) -> Matrix3<f64> {
        let t = &self.tangent[k];
        (Matrix3::identity() - t * t.transpose() * 0.5) * self.drag[k]
    }

    fn point(&self, rod: &Rod, k: usize, x: &Vector3<f64>) -> PointForce {
        let mass = rod.weight[k] * rod.line_density;
        let inertia = mass / (self.h * self.h);
        let drag = self.drag_matrix(k) * (rod.weight[k] / self.h);
        let slip = x - self.previous[k] - self.air[k] * self.h;
        PointForce {
            f: self.gravity * mass - (x - self.inertial[k]) * inertia - drag * slip,
            b: Matrix3::from_diagonal_element(inertia) + drag,
        }
    }

    fn point_energy(&self, rod: &Rod, k: usize, x: &Vector3<f64>) -> f64 {
        let mass = rod.weight[k] * rod.line_density;
        let slip = x - self.previous[k] - self.air[k] * self.h;
        mass * ((x - self.inertial[k]).norm_squared() / (2.0 * self.h * self.h) - self.gravity.dot(x))
            + slip.dot(&(self.drag_matrix(k) * slip)) * rod.weight[k] / (2.0 * self.h)
    }
}

/// Φ at `q`, J. `scratch` holds one entry per unknown.
pub fn energy(rod: &Rod, load: &Load, shape: &Shape, q: &[f64], scratch: &mut [f64]) -> f64 {
    let mut e: f64 = (1..rod.points()).map(|k| load.point_energy(rod, k, &shape.x(k))).sum();
    scratch.fill(0.0);
    rod.add_elastic(0.5, q, scratch);
    e += q.iter().zip(&*scratch).map(|(q, f)| q * f).sum::<f64>();
    e -= q.iter().zip(&rod.prebend).map(|(q, b)| q * b).sum::<f64>();
    if rod.damping > 0.0 {
        // With K linear, (q − qⁿ)ᵀK(q − qⁿ) needs K applied to the difference alone.
        scratch.fill(0.0);
        let n = q.len() / 3;
        let d = |i: usize, c: usize| q[3 * i + c] - load.q[3 * i + c];
        let mut loss = 0.0;
        for i in 0..n {
            for c in 0..3 {
                let mut s = rod.hat[i][0] * d(i, c);
                if i + 1 < n {
                    s += 2.0 * rod.hat[i][1] * d(i + 1, c);
                }
                loss += rod.stiffness[c] * d(i, c) * s;
            }
        }
        e += loss * rod.damping / (2.0 * load.h);
    }
    e
}

/// Sums over all that is downstream of a sub-step, about the root.
struct Composite {
    /// Σ f.
    force: Vector3<f64>,
    /// Σ x × f.
    torque: Vector3<f64>,
    /// Σ x fᵀ.
    moment: Matrix3<f64>,
    /// Σ JᵀBJ with J = (−[x]×, 1), by blocks.
    tt: Matrix3<f64>,
    tp: Matrix3<f64>,
    pp: Matrix3<f64>,
}

impl Composite {
    fn new() -> Self {
        let z = Matrix3::zeros();
        Composite { force: Vector3::zeros(), torque: Vector3::zeros(), moment: z, tt: z, tp: z, pp: z }
    }

    fn add(&mut self, x: &Vector3<f64>, p: &PointForce) {
        self.force += p.f;
        self.torque += x.cross(&p.f);
        self.moment += x * p.f.transpose();
        let xb = hat(x) * p.b;
        self.pp += p.b;
        self.tp += xb;
        self.tt -= xb * hat(x);
    }

    /// Derivative of the energy downstream along twist `t`.
    fn slope(&self, t: &Twist) -> f64 {
        -(t.w.dot(&self.torque) + t.v.dot(&self.force))
    }

    /// Momentum-like response to twist `t`, and the geometric couple C of the forces carried along
    /// (`docs/theory.md` eq. 4.2).
    fn respond(&self, t: &Twist) -> (Twist, Vector3<f64>) {
        let m = Twist::new(self.tt * t.w + self.tp * t.v, self.tp.tr_mul(&t.w) + self.pp * t.v);
        let c = t.v.cross(&self.force) + self.moment * t.w - t.w * self.moment.trace();
        (m, c)
    }
}

fn pair(a: &Twist, b: &Twist) -> f64 {
    a.w.dot(&b.w) + a.v.dot(&b.v)
}

/// Gradient of Φ into `gradient` and the lower triangle of its Hessian into `hessian` (row-major n × n).
///
/// Without `geometric` the stiffness of the carried forces is left out; what remains is positive definite.
#[allow(clippy::too_many_arguments)]
pub fn gradient_hessian(
    rod: &Rod,
    load: &Load,
    shape: &Shape,
    sensitivity: &Sensitivity,
    q: &[f64],
    geometric: bool,
    gradient: &mut [f64],
    hessian: &mut [f64],
) {
    let n = q.len();
    let factor = 1.0 + rod.damping / load.h;
    gradient.fill(0.0);
    rod.add_elastic(factor, q, gradient);
    rod.add_elastic(-rod.damping / load.h, &load.q, gradient);
    for (g, b) in gradient.iter_mut().zip(&rod.prebend) {
        *g -= b;
    }
    hessian.fill(0.0);
    for i in 0..n / 3 {
        for c in 0..3 {
            let a = 3 * i + c;
            hessian[a * n + a] = factor * rod.stiffness[c] * rod.hat[i][0];
            if i > 0 {
                hessian[a * n + a - 3] = factor * rod.stiffness[c] * rod.hat[i - 1][1];
            }
        }
    }

    let mut body = Composite::new();
    // Response of the element's six unknowns, summed over its sub-steps: all that unknowns upstream need.
    let mut response = [Twist::default(); 6];
    for k in (0..rod.steps.len()).rev() {
        let x = shape.x(k + 1);
        body.add(&x, &load.point(rod, k + 1, &x));
        let first = 3 * rod.steps[k].element;
        let live = (n - first).min(6);
        let (step, before) = (&sensitivity.step[k], &sensitivity.before[k]);
        let mut own = [Twist::default(); 6];
        let mut couple = [Vector3::zeros(); 6];
        for a in 0..live {
            gradient[first + a] += body.slope(&step[a]);
            let (m, c) = body.respond(&step[a]);
            (own[a], couple[a]) = (m, if geometric { c } else { Vector3::zeros() });
            response[a].w += m.w - couple[a];
            response[a].v += m.v;
        }
        for a in 0..live {
            for b in 0..=a {
                // Sub-steps before this one against this one, both ways round; then this one with itself.
                let ba = pair(&before[a], &own[b]) - before[a].w.dot(&couple[b]);
                let ab = pair(&before[b], &own[a]) - before[b].w.dot(&couple[a]);
                let same =
                    pair(&step[a], &own[b]) - 0.5 * (step[a].w.dot(&couple[b]) + step[b].w.dot(&couple[a]));
                hessian[(first + a) * n + first + b] += ba + ab + same;
            }
        }
        if k == 0 || rod.steps[k - 1].element != rod.steps[k].element {
            for (a, r) in response[..live].iter().enumerate() {
                let row = &mut hessian[(first + a) * n..];
                for (i, s) in sensitivity.total[..first].iter().enumerate() {
                    row[i] += pair(s, r);
                }
            }
            response = [Twist::default(); 6];
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
        let n = rod.points();
        Load {
            h,
            gravity: Vector3::new(0.3, -9.81, 0.1),
            inertial: (0..n).map(|k| wave(k, 1.0)).collect(),
            previous: (0..n).map(|k| wave(k, 1.1)).collect(),
            air: (0..n).map(|k| wave(k, 2.0) * 100.0).collect(),
            tangent: (0..n).map(|k| wave(k, 0.3).normalize()).collect(),
            drag: (0..n).map(|k| 2e-4 / (1.0 + k as f64)).collect(),
            q: (0..rod.unknowns()).map(|i| (i as f64).sin() * 2.0).collect(),
        }
    }

    fn derivatives(rod: &Rod, load: &Load, q: &[f64]) -> (Vec<f64>, Vec<f64>) {
        let (mut shape, mut sens) = (Shape::default(), Sensitivity::default());
        shape.update(rod, &rod.root.r, q);
        sens.update(rod, &shape, q);
        let (mut g, mut h) = (vec![0.0; q.len()], vec![0.0; q.len() * q.len()]);
        gradient_hessian(rod, load, &shape, &sens, q, true, &mut g, &mut h);
        (g, h)
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
        let (mut shape, mut scratch) = (Shape::default(), vec![0.0; q.len()]);
        let mut at = |q: &[f64]| {
            shape.update(&rod, &rod.root.r, q);
            energy(&rod, &load, &shape, q, &mut scratch)
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
        // Within a sub-step the second derivative is symmetrised as if rigid: an error of second order in the turn.
        let (finer, apart) = hessian_error(&curl_cut(0.001));
        assert!(apart < 1e-7, "{apart}");
        assert!(finer < 0.3 * shared && finer < 2e-3, "{shared} {finer}");
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
