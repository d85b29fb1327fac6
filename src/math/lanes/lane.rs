//! A vector register of `f64`, of the width that the processor has.

use super::real::{Mask, Real};
use pulp::Simd;
use std::ops::{Add, AddAssign, Div, Mul, Neg, Sub, SubAssign};

/// The numbers that a register of the instruction set `S` holds.
#[derive(Debug, Clone, Copy)]
pub struct Lane<S: Simd> {
    simd: S,
    value: S::f64s,
}

impl<S: Simd> Lane<S> {
    /// `x` in every lane.
    #[inline(always)]
    pub fn splat(simd: S, x: f64) -> Self {
        Lane { simd, value: simd.splat_f64s(x) }
    }

    #[inline(always)]
    fn with(self, value: S::f64s) -> Self {
        Lane { simd: self.simd, value }
    }

    #[inline(always)]
    fn numbers(&self) -> &[f64] {
        bytemuck::cast_slice(std::slice::from_ref(&self.value))
    }
}

macro_rules! operator {
    ($name:ident $f:ident $simd:ident) => {
        impl<S: Simd> $name for Lane<S> {
            type Output = Self;
            #[inline(always)]
            fn $f(self, other: Self) -> Self {
                self.with(self.simd.$simd(self.value, other.value))
            }
        }
    };
}
operator!(Add add add_f64s);
operator!(Sub sub sub_f64s);
operator!(Mul mul mul_f64s);
operator!(Div div div_f64s);

macro_rules! operator_with_one_number {
    ($name:ident $f:ident) => {
        impl<S: Simd> $name<f64> for Lane<S> {
            type Output = Self;
            #[inline(always)]
            fn $f(self, other: f64) -> Self {
                self.$f(self.same(other))
            }
        }
    };
}
operator_with_one_number!(Add add);
operator_with_one_number!(Sub sub);
operator_with_one_number!(Mul mul);

impl<S: Simd> Neg for Lane<S> {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        self.with(self.simd.neg_f64s(self.value))
    }
}

impl<S: Simd> AddAssign for Lane<S> {
    #[inline(always)]
    fn add_assign(&mut self, other: Self) {
        *self = *self + other;
    }
}

impl<S: Simd> SubAssign for Lane<S> {
    #[inline(always)]
    fn sub_assign(&mut self, other: Self) {
        *self = *self - other;
    }
}

impl<S: Simd> Real for Lane<S> {
    const LANES: usize = S::F64_LANES;

    #[inline(always)]
    fn same(self, x: f64) -> Self {
        Lane::splat(self.simd, x)
    }

    #[inline(always)]
    fn sqrt(self) -> Self {
        self.with(self.simd.sqrt_f64s(self.value))
    }

    #[inline(always)]
    fn abs(self) -> Self {
        self.with(self.simd.abs_f64s(self.value))
    }

    #[inline(always)]
    fn max(self, other: Self) -> Self {
        self.with(self.simd.max_f64s(self.value, other.value))
    }

    #[inline(always)]
    fn below(self, other: Self) -> Mask {
        let pairs = self.numbers().iter().zip(other.numbers());
        pairs.enumerate().fold(0, |mask, (i, (a, b))| mask | Mask::from(a < b) << i)
    }

    #[inline(always)]
    fn or(self, mask: Mask, other: Self) -> Self {
        let (zero, mut chosen) = (self.same(0.0), self.same(0.0));
        for i in 0..Self::LANES {
            chosen.set(i, f64::from(mask >> i & 1));
        }
        let chosen = self.simd.less_than_f64s(zero.value, chosen.value);
        self.with(self.simd.select_f64s(chosen, self.value, other.value))
    }

    #[inline(always)]
    fn lane(self, i: usize) -> f64 {
        self.numbers()[i]
    }

    #[inline(always)]
    fn set(&mut self, i: usize, x: f64) {
        bytemuck::cast_slice_mut::<S::f64s, f64>(std::slice::from_mut(&mut self.value))[i] = x;
    }
}
