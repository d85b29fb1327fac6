//! Vectors, matrices, poses and twists in space, over any [`Real`].

use super::real::Real;
use nalgebra::{Matrix3, Vector3};
use std::ops::{Add, AddAssign, Mul, Neg, Sub};

/// A vector (x, y, z).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct V3<F>(pub [F; 3]);

/// A 3 × 3 matrix, by columns.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct M3<F>(pub [V3<F>; 3]);

/// A pose (R, p), the map x ↦ R x + p.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pose<F> {
    /// Rotation R.
    pub r: M3<F>,
    /// Translation p.
    pub p: V3<F>,
}

/// A twist (ω, v), the velocity field ω × x + v.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Twist<F> {
    /// Rotation part ω.
    pub w: V3<F>,
    /// Translation part v.
    pub v: V3<F>,
}

impl<F: Real> V3<F> {
    /// `x` in all three components.
    #[inline(always)]
    pub fn all(x: F) -> Self {
        V3([x; 3])
    }

    /// a · b.
    #[inline(always)]
    pub fn dot(self, b: Self) -> F {
        self.0[0] * b.0[0] + self.0[1] * b.0[1] + self.0[2] * b.0[2]
    }

    /// a × b.
    #[inline(always)]
    pub fn cross(self, b: Self) -> Self {
        let ([x, y, z], [u, v, w]) = (self.0, b.0);
        V3([y * w - z * v, z * u - x * w, x * v - y * u])
    }
}

impl<F: Real> Add for V3<F> {
    type Output = Self;
    #[inline(always)]
    fn add(self, b: Self) -> Self {
        V3([self.0[0] + b.0[0], self.0[1] + b.0[1], self.0[2] + b.0[2]])
    }
}

impl<F: Real> Sub for V3<F> {
    type Output = Self;
    #[inline(always)]
    fn sub(self, b: Self) -> Self {
        V3([self.0[0] - b.0[0], self.0[1] - b.0[1], self.0[2] - b.0[2]])
    }
}

impl<F: Real> Neg for V3<F> {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        V3([-self.0[0], -self.0[1], -self.0[2]])
    }
}

impl<F: Real> AddAssign for V3<F> {
    #[inline(always)]
    fn add_assign(&mut self, b: Self) {
        *self = *self + b;
    }
}

impl<F: Real> Mul<F> for V3<F> {
    type Output = Self;
    #[inline(always)]
    fn mul(self, a: F) -> Self {
        V3([self.0[0] * a, self.0[1] * a, self.0[2] * a])
    }
}

impl<F: Real> M3<F> {
    /// `x` times the identity.
    #[inline(always)]
    pub fn diagonal(x: F) -> Self {
        let o = x.same(0.0);
        M3([V3([x, o, o]), V3([o, x, o]), V3([o, o, x])])
    }

    /// a bᵀ.
    #[inline(always)]
    pub fn outer(a: V3<F>, b: V3<F>) -> Self {
        M3([a * b.0[0], a * b.0[1], a * b.0[2]])
    }

    /// \[a\]×, the matrix of a × ·.
    #[inline(always)]
    pub fn hat(a: V3<F>) -> Self {
        let ([x, y, z], o) = (a.0, a.0[0].same(0.0));
        M3([V3([o, z, -y]), V3([-z, o, x]), V3([y, -x, o])])
    }

    /// Mᵀ a.
    #[inline(always)]
    pub fn transposed(&self, a: V3<F>) -> V3<F> {
        V3([self.0[0].dot(a), self.0[1].dot(a), self.0[2].dot(a)])
    }

    /// Sum of the diagonal.
    #[inline(always)]
    pub fn trace(&self) -> F {
        self.0[0].0[0] + self.0[1].0[1] + self.0[2].0[2]
    }
}

impl<F: Real> Mul<V3<F>> for M3<F> {
    type Output = V3<F>;
    #[inline(always)]
    fn mul(self, a: V3<F>) -> V3<F> {
        self.0[0] * a.0[0] + self.0[1] * a.0[1] + self.0[2] * a.0[2]
    }
}

impl<F: Real> Mul for M3<F> {
    type Output = Self;
    #[inline(always)]
    fn mul(self, b: Self) -> Self {
        M3([self * b.0[0], self * b.0[1], self * b.0[2]])
    }
}

impl<F: Real> Mul<F> for M3<F> {
    type Output = Self;
    #[inline(always)]
    fn mul(self, a: F) -> Self {
        M3([self.0[0] * a, self.0[1] * a, self.0[2] * a])
    }
}

impl<F: Real> Add for M3<F> {
    type Output = Self;
    #[inline(always)]
    fn add(self, b: Self) -> Self {
        M3([self.0[0] + b.0[0], self.0[1] + b.0[1], self.0[2] + b.0[2]])
    }
}

impl<F: Real> Sub for M3<F> {
    type Output = Self;
    #[inline(always)]
    fn sub(self, b: Self) -> Self {
        M3([self.0[0] - b.0[0], self.0[1] - b.0[1], self.0[2] - b.0[2]])
    }
}

impl<F: Real> Pose<F> {
    /// `self` after `other`: x ↦ self(other(x)).
    #[inline(always)]
    pub fn compose(&self, other: &Self) -> Self {
        Pose { r: self.r * other.r, p: self.r * other.p + self.p }
    }
}

impl<F: Real> Twist<F> {
    /// The zero twist.
    #[inline(always)]
    pub fn none(zero: F) -> Self {
        Twist { w: V3::all(zero), v: V3::all(zero) }
    }

    /// ω·ω' + v·v'.
    #[inline(always)]
    pub fn dot(&self, b: &Self) -> F {
        self.w.dot(b.w) + self.v.dot(b.v)
    }
}

impl<F: Real> Add for Twist<F> {
    type Output = Self;
    #[inline(always)]
    fn add(self, b: Self) -> Self {
        Twist { w: self.w + b.w, v: self.v + b.v }
    }
}

impl<F: Real> Mul<F> for Twist<F> {
    type Output = Self;
    #[inline(always)]
    fn mul(self, a: F) -> Self {
        Twist { w: self.w * a, v: self.v * a }
    }
}

impl From<Vector3<f64>> for V3<f64> {
    fn from(a: Vector3<f64>) -> Self {
        V3(a.into())
    }
}

impl From<V3<f64>> for Vector3<f64> {
    fn from(a: V3<f64>) -> Self {
        Vector3::from(a.0)
    }
}

impl From<Matrix3<f64>> for M3<f64> {
    fn from(a: Matrix3<f64>) -> Self {
        M3([0, 1, 2].map(|c| V3([a[(0, c)], a[(1, c)], a[(2, c)]])))
    }
}

impl From<M3<f64>> for Matrix3<f64> {
    fn from(a: M3<f64>) -> Self {
        Matrix3::from_columns(&a.0.map(Vector3::from))
    }
}
