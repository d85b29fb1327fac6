//! Rotations that change in time, as quaternions. All operations are smooth functions: strands move as
//! smoothly as the guides that they follow.

use crate::math::lanes::{Real, V3};
use nalgebra::{Matrix3, Rotation3, UnitQuaternion, Vector3};

/// A quaternion, or one in every lane.
#[derive(Debug, Clone, Copy)]
pub(super) struct Quaternion<F> {
    pub w: F,
    pub v: V3<F>,
}

/// A rotation by a quaternion of any non-zero norm, and the rate of the quaternion, 1/s.
#[derive(Debug, Clone, Copy)]
pub(super) struct MovingRotation<F> {
    pub q: Quaternion<F>,
    pub rate: Quaternion<F>,
}

impl<F: Real> Quaternion<F> {
    #[inline(always)]
    fn product(self, b: Self) -> Self {
        let Quaternion { w, v } = self;
        Quaternion { w: w * b.w - v.dot(b.v), v: b.v * w + v * b.w + v.cross(b.v) }
    }

    #[inline(always)]
    fn conjugate(self) -> Self {
        Quaternion { w: self.w, v: -self.v }
    }

    #[inline(always)]
    fn dot(self, b: Self) -> F {
        self.w * b.w + self.v.dot(b.v)
    }

    #[inline(always)]
    fn plus(self, b: Self) -> Self {
        Quaternion { w: self.w + b.w, v: self.v + b.v }
    }

    #[inline(always)]
    fn scaled(self, a: F) -> Self {
        Quaternion { w: self.w * a, v: self.v * a }
    }
}

impl From<Quaternion<f64>> for [f64; 4] {
    fn from(Quaternion { w, v: V3([x, y, z]) }: Quaternion<f64>) -> Self {
        [w, x, y, z]
    }
}

impl<F: Real> MovingRotation<F> {
    /// The rotation by 2 atan(|φ| / 2) about φ, rad, which changes at `rate`, rad/s.
    #[inline(always)]
    pub fn by(phi: V3<F>, rate: V3<F>) -> Self {
        let zero = phi.0[0].same(0.0);
        MovingRotation {
            q: Quaternion { w: zero + 1.0, v: phi * (zero + 0.5) },
            rate: Quaternion { w: zero, v: rate * (zero + 0.5) },
        }
    }

    /// The rotation about `axis`, which changes at `rate`, 1/s, by a constant angle; given its half's cosine
    /// and sine.
    #[inline(always)]
    pub fn about(axis: V3<F>, rate: V3<F>, cosine: F, sine: F) -> Self {
        MovingRotation {
            q: Quaternion { w: cosine, v: axis * sine },
            rate: Quaternion { w: cosine.same(0.0), v: rate * sine },
        }
    }

    /// This rotation after `first`.
    #[inline(always)]
    pub fn after(self, first: Self) -> Self {
        MovingRotation {
            q: self.q.product(first.q),
            rate: self.rate.product(first.q).plus(self.q.product(first.rate)),
        }
    }

    /// The vector `x` rotated.
    #[inline(always)]
    pub fn rotate(self, x: V3<F>) -> V3<F> {
        let Quaternion { w, v } = self.q;
        let across = v.cross(x);
        x + (across * w + v.cross(across)) * (w.same(2.0) / self.q.dot(self.q))
    }

    /// The vector `x` rotated back.
    pub fn rotate_back(self, x: V3<F>) -> V3<F> {
        MovingRotation { q: self.q.conjugate(), rate: self.rate }.rotate(x)
    }

    /// Angular velocity, rad/s, in the frame that the rotation leads to.
    #[inline(always)]
    pub fn spin(self) -> V3<F> {
        self.rate.product(self.q.conjugate()).v * (self.q.w.same(2.0) / self.q.dot(self.q))
    }
}

impl MovingRotation<f64> {
    /// The rotation `r` with angular velocity `spin`, rad/s, in the frame that it leads to.
    pub fn new(r: &Matrix3<f64>, spin: &Vector3<f64>) -> Self {
        let q = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(*r)).into_inner();
        let q = Quaternion { w: q.w, v: q.imag().into() };
        MovingRotation { q, rate: Quaternion { w: 0.0, v: V3::from(spin * 0.5) }.product(q) }
    }

    /// The same rotation with the quaternion of the same sign as that of `other`, to be blended with it.
    pub fn with_sign_of(self, other: &Self) -> Self {
        let sign = if self.q.dot(other.q) < 0.0 { -1.0 } else { 1.0 };
        MovingRotation { q: self.q.scaled(sign), rate: self.rate.scaled(sign) }
    }

    /// The rotation at the fraction `u` of the way to `to`, whose quaternion has the same sign.
    #[inline(always)]
    pub fn lerp(&self, to: &Self, u: f64) -> Self {
        let blend = |a: Quaternion<f64>, b: Quaternion<f64>| a.scaled(1.0 - u).plus(b.scaled(u));
        MovingRotation { q: blend(self.q, to.q), rate: blend(self.rate, to.rate) }
    }

    /// How `to` turns the unit vector `other` otherwise than `self` turns the unit vector `along`, and the
    /// rate of that, 1/s, in the frame that `self` leads from: the axis of the rotation between the turned
    /// vectors times sin θ cos²(θ/2), θ being its angle. It is a smooth function also where they oppose each
    /// other, and almost free of the rotations about `along`, which grow without bound where a curve bends
    /// back along its root.
    pub fn difference(&self, to: &Self, along: &Vector3<f64>, other: &Vector3<f64>) -> [Vector3<f64>; 2] {
        let turned = to.rotate((*other).into());
        let [a, rate] =
            [turned, (to.spin() - self.spin()).cross(turned)].map(|x| Vector3::from(self.rotate_back(x)));
        let near = 0.5 + 0.5 * along.dot(&a);
        let sine = along.cross(&a);
        [sine * near, along.cross(&rate) * near + sine * (0.5 * along.dot(&rate))]
    }
}
