//! The incremental potential Φ(q) of one implicit step, and its gradient (`docs/theory.md` §4).
//!
//! Inertia, weight and drag are quadratic in the position of a point, so together they act as one spring from
//! the point to a target: Φ = ½ Σ (x − x̂)ᵀB(x − x̂) + ½ (1 + τ/h) qᵀ𝐊q − force·q, up to a constant. Animated
//! goals add ½ Σ k (q − q̂)² over the unknowns.

use super::model::Rod;
use super::segment::RodCore;
use super::sensitivity::{Sensitivity, exponent_derivatives};
use super::shape::RodShape;
use crate::math::lanes::{Real, Twist, V3};
use nalgebra::Vector3;

/// Inertia and drag of one point over a step. Positions relative to the root at the end of the step, world
/// axes.
#[derive(Debug, Clone, Copy)]
pub struct PointLoad {
    /// Inertial position x* + h v*, m (`docs/theory.md` §4.1).
    pub inertial: Vector3<f64>,
    /// Position x* from which the velocity is measured, m.
    pub previous: Vector3<f64>,
    /// Velocity of the air, m/s.
    pub air: Vector3<f64>,
    /// Unit tangent of the strand.
    pub tangent: Vector3<f64>,
    /// Drag coefficient per length across the strand, N·s/m²; half of it applies along the strand
    /// (slender-body theory, Cox 1970).
    pub drag: f64,
}

/// All forces on one point as an anisotropic spring: f = −B (x − x̂) with B = α 1 − u uᵀ.
#[derive(Debug, Clone, Copy)]
pub(super) struct PointSpring<F> {
    pub alpha: F,
    pub u: V3<F>,
    pub target: V3<F>,
}

impl<F: Real> PointSpring<F> {
    /// Force f at `x`, N.
    #[inline(always)]
    pub fn force(&self, x: V3<F>) -> V3<F> {
        let y = x - self.target;
        self.u * self.u.dot(y) - y * self.alpha
    }
}

/// Loads on a rod over one step.
#[derive(Debug, Clone)]
pub struct Load<F = f64> {
    /// ∫ N_i N_j σ (1 + τ/h) ds, m: elasticity and internal damping; laid out as [`RodCore::hat`].
    pub(super) hat: Vec<[F; 2]>,
    /// Mass over h², N/m.
    pub(super) inertia: F,
    /// One spring for each point but the root.
    pub(super) springs: Vec<PointSpring<F>>,
    /// Force on the root point, which is not free: it enters reactions alone, N.
    pub(super) root_force: V3<F>,
    /// Constant generalised force, N·m².
    pub(super) force: Vec<F>,
    /// Springs on the unknowns, one for each; empty if there are none.
    pub(super) holds: Vec<StrainSpring<F>>,
}

/// A spring that pulls one unknown to a target.
#[derive(Debug, Clone, Copy)]
pub struct StrainSpring<F = f64> {
    /// Stiffness, N·m³.
    pub stiffness: F,
    /// Target, 1/m.
    pub target: F,
}

impl Default for Load {
    fn default() -> Self {
        Load::empty(0.0)
    }
}

impl<F: Real> Load<F> {
    /// No loads, on no rod yet.
    pub(super) fn empty(zero: F) -> Self {
        Load {
            hat: Vec::new(),
            inertia: zero,
            springs: Vec::new(),
            root_force: V3::all(zero),
            force: Vec::new(),
            holds: Vec::new(),
        }
    }
}

impl Load {
    /// Sets the loads of a step of `h`, s, at whose end the rate of the unknowns is (q − `past`)/h. `gravity`
    /// includes uniform force fields, m/s²; `points` yields one entry per point, root first.
    pub fn set(
        &mut self,
        rod: &Rod,
        h: f64,
        gravity: &Vector3<f64>,
        past: &[f64],
        points: impl Iterator<Item = PointLoad>,
    ) {
        let core = &rod.core;
        self.hat.clear();
        let damped = |(hat, damping): (&[f64; 2], &[f64; 2])| [0, 1].map(|i| hat[i] + damping[i] / h);
        self.hat.extend(core.hat.iter().zip(&rod.damping).map(damped));
        self.inertia = core.mass / (h * h);
        self.force.clone_from(&core.prebend);
        core.add_elastic(&rod.damping, 1.0 / h, past, &mut self.force);
        self.holds.clear();
        self.springs.clear();
        for (k, (point, (weight, mass))) in points.zip(rod.weight.iter().zip(&rod.mass)).enumerate() {
            let (inertia, drag) = (mass / (h * h), point.drag * weight / h);
            let along = 0.5 * drag;
            let advected = point.previous + point.air * h;
            let t = &point.tangent;
            let force =
                gravity * *mass + point.inertial * inertia + advected * drag - t * (along * t.dot(&advected));
            if k == 0 {
                self.root_force = force.into();
                continue;
            }
            let alpha = inertia + drag;
            let target = (force + t * (along / (alpha - along) * t.dot(&force))) / alpha;
            self.springs.push(PointSpring { alpha, u: (t * along.sqrt()).into(), target: target.into() });
        }
    }

    /// Adds a spring of `stiffness`, N/m, from point `k` to `goal` (relative to the root at the end of the
    /// step, world axes, m). At the root it acts on the clamp alone.
    pub fn add_spring(&mut self, k: usize, goal: &Vector3<f64>, stiffness: f64) {
        if k == 0 {
            self.root_force += V3::from(*goal) * stiffness;
        } else if let Some(spring) = self.springs.get_mut(k - 1) {
            // The new target is B⁻¹ times the force that both springs exert at the origin.
            let u = spring.u;
            let force = spring.target * spring.alpha - u * u.dot(spring.target) + V3::from(*goal) * stiffness;
            spring.alpha += stiffness;
            spring.target = (force + u * (u.dot(force) / (spring.alpha - u.dot(u)))) * (1.0 / spring.alpha);
        }
    }

    /// Pulls the unknowns by `springs`, one for each, until [`Load::set`] is called again.
    pub fn hold(&mut self, springs: impl Iterator<Item = StrainSpring>) {
        self.holds.clear();
        self.holds.extend(springs);
    }

    /// Adds the constant force `f`, N, world axes, at point `k`. At the root it acts on the clamp alone.
    pub fn add_force(&mut self, k: usize, f: &Vector3<f64>) {
        if k == 0 {
            self.root_force += (*f).into();
        } else if let Some(spring) = self.springs.get_mut(k - 1) {
            // The target moves by B⁻¹ f.
            let (u, f) = (spring.u, (*f).into());
            let along = u.dot(f) / (spring.alpha - u.dot(u));
            spring.target += (f + u * along) * (1.0 / spring.alpha);
        }
    }

    /// Sum of all forces on the points of a rod in `shape`, N, inertia included, and their moment about the
    /// root, N·m; world axes. Elasticity, internal damping and the springs on the unknowns act within the rod
    /// and add nothing.
    pub fn resultant(&self, shape: &RodShape) -> [Vector3<f64>; 2] {
        let (mut force, mut moment) = (self.root_force, V3::all(0.0));
        for (spring, g) in self.springs.iter().zip(&shape.pose[1..]) {
            let f = spring.force(g.p);
            force += f;
            moment += g.p.cross(f);
        }
        [force.into(), moment.into()]
    }
}

/// Φ at `q`, J, whose shape is `shape`.
#[inline(always)]
pub(super) fn energy<F: Real>(
    core: &RodCore<F>,
    load: &Load<F>,
    shape: &RodShape<F>,
    q: &[F],
    scratch: &mut Vec<F>,
) -> F {
    let zero = core.length.same(0.0);
    let mut e = zero;
    for (spring, g) in load.springs.iter().zip(&shape.pose[1..]) {
        let y = g.p - spring.target;
        let along = spring.u.dot(y);
        e += spring.alpha * y.dot(y) - along * along;
    }
    scratch.resize(q.len(), zero);
    scratch.fill(zero);
    core.add_elastic(&load.hat, zero.same(1.0), q, scratch);
    for ((q, k), force) in q.iter().zip(&*scratch).zip(&load.force) {
        e += *q * (*k - *force * 2.0);
    }
    for (q, hold) in q.iter().zip(&load.holds) {
        let off = *q - hold.target;
        e += hold.stiffness * off * off;
    }
    e * 0.5
}

/// Gradient of Φ at `q`, whose shape and segment Jacobians are given (`docs/theory.md` §4.3). Also sets
/// `wrench`: for every segment, the torque and force of everything downstream, as seen along the segment.
#[inline(always)]
pub(super) fn gradient<F: Real>(
    core: &RodCore<F>,
    load: &Load<F>,
    shape: &RodShape<F>,
    sensitivity: &Sensitivity<F>,
    q: &[F],
    gradient: &mut Vec<F>,
    wrench: &mut Vec<Twist<F>>,
) {
    let zero = core.length.same(0.0);
    wrench.resize(core.segments.len(), Twist::none(zero));
    gradient.resize(q.len(), zero);
    for (g, force) in gradient.iter_mut().zip(&load.force) {
        *g = -*force;
    }
    core.add_elastic(&load.hat, zero.same(1.0), q, gradient);
    for ((g, q), hold) in gradient.iter_mut().zip(q).zip(&load.holds) {
        *g += hold.stiffness * (*q - hold.target);
    }
    let (mut force, mut torque) = (V3::all(zero), V3::all(zero));
    for k in (0..core.segments.len()).rev() {
        let (x, jacobian) = (shape.pose[k + 1].p, &sensitivity.jacobian[k]);
        let f = load.springs[k].force(x);
        force += f;
        torque += x.cross(f);
        let rotational = jacobian.j.transposed(torque) + jacobian.q.transposed(force);
        let translational = jacobian.j.transposed(force);
        wrench[k] = Twist { w: rotational, v: translational };
        let node = core.segments[k].element;
        let derivatives = exponent_derivatives(&core.segments[k], q);
        for (slope, derivative) in gradient[3 * node..].chunks_exact_mut(3).zip(derivatives) {
            let across = V3([-translational.0[1], translational.0[0], zero]);
            let along = rotational * derivative.s + rotational.cross(derivative.u) + across * derivative.c;
            for (slope, a) in slope.iter_mut().zip(along.0) {
                *slope -= a;
            }
        }
    }
}
