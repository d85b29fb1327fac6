//! The arithmetic that SIMD kernels are generic over.

use std::fmt::Debug;
use std::ops::{Add, AddAssign, Div, Mul, Neg, Sub, SubAssign};

/// Maximum number of lanes on any processor.
pub const MAX_LANES: usize = 8;

/// A set of lanes: bit i is lane i.
pub type Mask = u8;

/// A number, or one in every lane. An `f64` on the right of an operator is broadcast to all lanes.
pub trait Real:
    Copy
    + Debug
    + 'static
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Div<Output = Self>
    + Neg<Output = Self>
    + AddAssign
    + SubAssign
    + Add<f64, Output = Self>
    + Sub<f64, Output = Self>
    + Mul<f64, Output = Self>
{
    /// Number of lanes, at most [`MAX_LANES`].
    const LANES: usize;

    /// The set of all lanes.
    const ALL: Mask = (((1_u32 << Self::LANES) - 1) & 0xff) as Mask;

    /// `x` in every lane.
    fn same(self, x: f64) -> Self;

    /// Square root.
    fn sqrt(self) -> Self;

    /// Absolute value.
    fn abs(self) -> Self;

    /// The larger of two; unspecified for NaN.
    fn max(self, other: Self) -> Self;

    /// Lanes in which `self < other`; false for NaN.
    fn below(self, other: Self) -> Mask;

    /// `self` in the lanes of `mask`, `other` elsewhere.
    fn or(self, mask: Mask, other: Self) -> Self;

    /// Lane `i`.
    fn lane(self, i: usize) -> f64;

    /// Sets lane `i`.
    fn set(&mut self, i: usize, x: f64);
}

impl Real for f64 {
    const LANES: usize = 1;

    #[inline(always)]
    fn same(self, x: f64) -> f64 {
        x
    }

    #[inline(always)]
    fn sqrt(self) -> f64 {
        self.sqrt()
    }

    #[inline(always)]
    fn abs(self) -> f64 {
        self.abs()
    }

    #[inline(always)]
    fn max(self, other: f64) -> f64 {
        if self > other { self } else { other }
    }

    #[inline(always)]
    fn below(self, other: f64) -> Mask {
        Mask::from(self < other)
    }

    #[inline(always)]
    fn or(self, mask: Mask, other: f64) -> f64 {
        if mask & 1 == 1 { self } else { other }
    }

    #[inline(always)]
    fn lane(self, _: usize) -> f64 {
        self
    }

    #[inline(always)]
    fn set(&mut self, _: usize, x: f64) {
        *self = x;
    }
}
