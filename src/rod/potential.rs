//! The incremental potential Φ(q) of one implicit step, and its gradient (`docs/theory.md` §4).
//!
//! Inertia, weight and drag are quadratic in the position of a point, so together they act as one spring from
//! the point to a target: Φ = ½ Σ (x − x̂)ᵀB(x − x̂) + ½ (1 + τ/h) qᵀ𝐊q − force·q, up to a constant. Animated
//! goals add ½ Σ k (q − q̂)² over the unknowns, and moments their work over the rotation in the step (eq. 4.9).

use super::joint::{Joint, RootJoint};
use super::model::Rod;
use super::segment::RodCore;
use super::sensitivity::{Sensitivity, exponent_derivatives};
use super::shape::RodShape;
use crate::math::lanes::{M3, Real, Twist, V3};
use nalgebra::{Matrix3, Vector3};

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
    /// Number of points that are held: the root, unless that is free, or none.
    pub(super) held: usize,
    /// One spring for each point that is not held.
    pub(super) springs: Vec<PointSpring<F>>,
    /// Force on a root point that is held: it enters reactions alone, N.
    pub(super) root_force: V3<F>,
    /// Constant generalised force, N·m².
    pub(super) force: Vec<F>,
    /// Springs on the unknowns, one for each; empty if there are none.
    pub(super) holds: Vec<StrainSpring<F>>,
    /// Moments, one for each point that is not held; empty if there are none.
    pub(super) moments: Vec<PointMoment<F>>,
    /// Moment on a root point that is held, which enters reactions alone, N·m.
    pub(super) root_moment: V3<F>,
}

/// A moment on a point that is exact while the point has the frame `frame`: the force that belongs to the
/// rotation vector from there (`docs/theory.md` eq. 4.9).
#[derive(Debug, Clone, Copy)]
pub(super) struct PointMoment<F> {
    pub frame: M3<F>,
    /// N·m.
    pub moment: V3<F>,
}

/// A [`PointMoment`] at another frame.
pub(super) struct Turned<F> {
    /// Unit vector of the rotation to there times its sine.
    axis: V3<F>,
    /// Angle over sine of the rotation, γ, and its derivatives by 1 minus the cosine.
    gamma: [F; 3],
    /// Moment along `axis`.
    along: F,
    /// Derivative of `along` by rotations, N·m.
    slope: V3<F>,
    /// Forces at the ends of the vectors of the frame that exert the moment, N·m.
    forces: [V3<F>; 3],
}

impl<F: Real> PointMoment<F> {
    pub fn none(zero: F) -> Self {
        PointMoment { frame: M3::diagonal(zero), moment: V3::all(zero) }
    }

    /// The moment at the frame `r`.
    #[inline(always)]
    pub fn at(&self, r: &M3<F>) -> Turned<F> {
        let [a, b, c] = self.frame.0;
        let [p, q, s] = r.0;
        let half = a.0[0].same(0.5);
        let axis = (a.cross(p) + b.cross(q) + c.cross(s)) * half;
        let u = (-(a.dot(p) + b.dot(q) + c.dot(s)) + 3.0) * 0.5;
        // The series of the angle over its sine, to the fourth order.
        let gamma = [
            (((u * (8.0 / 315.0) + 2.0 / 35.0) * u + 2.0 / 15.0) * u + 1.0 / 3.0) * u + 1.0,
            ((u * (32.0 / 315.0) + 6.0 / 35.0) * u + 4.0 / 15.0) * u + 1.0 / 3.0,
            (u * (96.0 / 315.0) + 12.0 / 35.0) * u + 4.0 / 15.0,
        ];
        let m = self.moment;
        let across = [m.cross(a) * half, m.cross(b) * half, m.cross(c) * half];
        let slope = p.cross(across[0]) + q.cross(across[1]) + s.cross(across[2]);
        let along = m.dot(axis);
        let pull = along * gamma[1] * -0.5;
        let forces = [
            across[0] * gamma[0] + a * pull,
            across[1] * gamma[0] + b * pull,
            across[2] * gamma[0] + c * pull,
        ];
        Turned { axis, gamma, along, slope, forces }
    }
}

impl<F: Real> Turned<F> {
    /// Rotation vector to there.
    #[inline(always)]
    pub fn rotation(&self) -> V3<F> {
        self.axis * self.gamma[0]
    }

    /// Work, J, up to a constant.
    #[inline(always)]
    pub fn work(&self) -> F {
        self.along * self.gamma[0]
    }

    /// Moment, N·m.
    #[inline(always)]
    pub fn moment(&self) -> V3<F> {
        self.slope * self.gamma[0] + self.axis * (self.along * self.gamma[1])
    }

    /// Σ a fᵀ over the vectors a of the frame `r` and the forces f at their ends.
    #[inline(always)]
    pub fn outer(&self, r: &M3<F>) -> M3<F> {
        let [a, b, c] = self.forces;
        M3::outer(r.0[0], a) + M3::outer(r.0[1], b) + M3::outer(r.0[2], c)
    }

    /// Stiffness against rotations because these forces change, N·m.
    #[inline(always)]
    pub fn stiffness(&self) -> M3<F> {
        let Turned { axis, gamma, along, slope, .. } = *self;
        let both = M3::outer(slope, axis) + M3::outer(axis, slope);
        (both * gamma[1] + M3::outer(axis, axis) * (along * gamma[2])) * -gamma[0].same(1.0)
    }
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
            held: 1,
            springs: Vec::new(),
            root_force: V3::all(zero),
            force: Vec::new(),
            holds: Vec::new(),
            moments: Vec::new(),
            root_moment: V3::all(zero),
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
        self.moments.clear();
        self.held = core.first_moving();
        (self.root_force, self.root_moment) = (V3::all(0.0), V3::all(0.0));
        self.springs.clear();
        for (k, (point, (weight, mass))) in points.zip(rod.weight.iter().zip(&rod.mass)).enumerate() {
            let (inertia, drag) = (mass / (h * h), point.drag * weight / h);
            let along = 0.5 * drag;
            let advected = point.previous + point.air * h;
            let t = &point.tangent;
            let force =
                gravity * *mass + point.inertial * inertia + advected * drag - t * (along * t.dot(&advected));
            if k < self.held {
                self.root_force = force.into();
                continue;
            }
            let alpha = inertia + drag;
            let target = (force + t * (along / (alpha - along) * t.dot(&force))) / alpha;
            self.springs.push(PointSpring { alpha, u: (t * along.sqrt()).into(), target: target.into() });
        }
    }

    /// Adds a spring of `stiffness`, N/m, from point `k` to `goal` (relative to the root at the end of the
    /// step, world axes, m). At a root that is held it acts on what holds it alone.
    pub fn add_spring(&mut self, k: usize, goal: &Vector3<f64>, stiffness: f64) {
        if k < self.held {
            self.root_force += V3::from(*goal) * stiffness;
        } else if let Some(spring) = self.springs.get_mut(k - self.held) {
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

    /// Adds the constant force `f`, N, world axes, at point `k`. At a root that is held it acts on what holds it alone.
    pub fn add_force(&mut self, k: usize, f: &Vector3<f64>) {
        if k < self.held {
            self.root_force += (*f).into();
        } else if let Some(spring) = self.springs.get_mut(k - self.held) {
            // The target moves by B⁻¹ f.
            let (u, f) = (spring.u, (*f).into());
            let along = u.dot(f) / (spring.alpha - u.dot(u));
            spring.target += (f + u * along) * (1.0 / spring.alpha);
        }
    }

    /// Adds the moment `moment`, N·m, world axes, at point `k`. It is exact where the frame of the point is
    /// `frame`, the same for all moments there, at the end of the step. At a root that is held it acts on what holds it
    /// alone.
    pub fn add_moment(&mut self, k: usize, frame: &Matrix3<f64>, moment: &Vector3<f64>) {
        let Some(i) = k.checked_sub(self.held) else {
            self.root_moment += (*moment).into();
            return;
        };
        self.moments.resize(self.springs.len(), PointMoment::none(0.0));
        let PointMoment { frame: at, moment: sum } = &mut self.moments[i];
        (*at, *sum) = (M3::from(*frame), *sum + (*moment).into());
    }

    /// Sum of all forces on the points of a rod in `shape`, N, inertia included, and their moment about the
    /// root, N·m; world axes. Elasticity, internal damping and the springs on the unknowns act within the rod
    /// and add nothing.
    pub fn resultant(&self, shape: &RodShape) -> [Vector3<f64>; 2] {
        let (mut force, mut moment) = (self.root_force, self.root_moment);
        for (spring, g) in self.springs.iter().zip(&shape.pose[self.held..]) {
            let f = spring.force(g.p);
            force += f;
            moment += g.p.cross(f);
        }
        for (of, g) in self.moments.iter().zip(&shape.pose[self.held..]) {
            moment += of.at(&g.r).moment();
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
    for (spring, g) in load.springs.iter().zip(&shape.pose[core.first_moving()..]) {
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
    for (moment, g) in load.moments.iter().zip(&shape.pose[core.first_moving()..]) {
        e += moment.at(&g.r).work() * -2.0;
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
    let first = core.first_moving();
    for k in (0..core.segments.len()).rev() {
        let (x, jacobian) = (shape.pose[k + 1].p, &sensitivity.jacobian[k]);
        let f = load.springs[k + 1 - first].force(x);
        force += f;
        torque += x.cross(f);
        if let Some(moment) = load.moments.get(k + 1 - first) {
            torque += moment.at(&shape.pose[k + 1].r).moment();
        }
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
    if core.joint != RootJoint::Clamped {
        let (root, joint) = (&shape.pose[0], Joint::new(q));
        if core.joint == RootJoint::Free {
            let f = load.springs[0].force(root.p);
            force += f;
            torque += root.p.cross(f);
            if let Some(moment) = load.moments.first() {
                torque += moment.at(&root.r).moment();
            }
            // About the root.
            torque = torque - root.p.cross(force);
            for (slope, axis) in gradient[3..].iter_mut().zip(joint.carried_axes(&root.r)) {
                *slope -= axis.dot(force);
            }
        }
        let turned = joint.jacobian().transposed(root.r.transposed(torque));
        for (slope, a) in gradient.iter_mut().zip(turned.0) {
            *slope -= a;
        }
    }
}
