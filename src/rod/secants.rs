//! Updates of a kept Cholesky factor by the steps taken since (L-BFGS two-loop recursion; Nocedal & Wright
//! 2006, algorithm 7.4), in every lane on its own.

#![allow(clippy::needless_range_loop)] // Several arrays share one index.

use super::block_factor::BlockFactor;
use crate::math::cholesky;
use crate::math::lanes::{Mask, Real};

/// A factor of the Hessian.
#[derive(Clone, Copy)]
pub(super) enum Factor<'a, F> {
    /// [`cholesky::factor`].
    Dense(&'a [F]),
    /// In blocks.
    Blocks(&'a BlockFactor<F>),
}

/// A step and the change of the gradient over it.
#[derive(Debug, Clone)]
struct SecantPair<F> {
    step: Vec<F>,
    change: Vec<F>,
    /// 1/(step · change); 0 in lanes where the pair is not used.
    inverse: F,
    /// α of the first loop of the recursion.
    alpha: F,
}

/// Secant pairs since the last factorisation.
#[derive(Debug, Clone)]
pub(super) struct Secants<F> {
    /// Buffers, one for each iteration; the first `count` pairs are in use.
    pairs: Vec<SecantPair<F>>,
    count: usize,
    /// −gradient of Φ at the start of the last step.
    downhill: Vec<F>,
    /// The last step.
    step: Vec<F>,
    /// [`Secants::room`].
    room: usize,
}

impl<F> Default for Secants<F> {
    fn default() -> Self {
        Secants { pairs: Vec::new(), count: 0, downhill: Vec::new(), step: Vec::new(), room: 0 }
    }
}

impl<F: Real> Secants<F> {
    /// Records the last step as direction · t.
    #[inline(always)]
    pub fn set_step(&mut self, direction: &[F], t: F) {
        self.step.resize(direction.len(), t.same(0.0));
        for (step, d) in self.step.iter_mut().zip(direction) {
            *step = *d * t;
        }
    }

    /// Makes room for solves for `unknowns` unknowns with at most `iterations` iterations, always the same
    /// number: they then allocate nothing.
    #[inline(always)]
    pub fn reserve(&mut self, unknowns: usize, iterations: u32, zero: F) {
        if self.room < unknowns {
            let sized = || Vec::with_capacity(unknowns);
            let pair = || SecantPair { step: sized(), change: sized(), inverse: zero, alpha: zero };
            self.pairs = (0..iterations).map(|_| pair()).collect();
            (self.count, self.downhill, self.step, self.room) = (0, sized(), sized(), unknowns);
        }
    }

    /// Number of unknowns that there is room for.
    pub fn room(&self) -> usize {
        self.room
    }

    /// Adds the pair of the last step in the lanes `kept`, which keep their factor; the other lanes drop all
    /// pairs. `downhill` is the new −gradient of Φ.
    #[inline(always)]
    pub fn record(&mut self, kept: Mask, downhill: &Vec<F>) {
        let zero = downhill[0].same(0.0);
        if kept == 0 {
            self.count = 0;
            self.downhill.clone_from(downhill);
            return;
        }
        for pair in &mut self.pairs[..self.count] {
            pair.inverse = pair.inverse.or(kept, zero);
        }
        let pair = &mut self.pairs[self.count];
        self.count += 1;
        pair.step.clone_from(&self.step);
        pair.change.clone_from(&self.downhill);
        let mut curvature = zero;
        for i in 0..pair.step.len() {
            pair.change[i] -= downhill[i];
            curvature += pair.change[i] * pair.step[i];
        }
        let convex = kept & zero.below(curvature);
        pair.inverse = (zero.same(1.0) / curvature).or(convex, zero);
        self.downhill.clone_from(downhill);
    }

    /// Turns `direction` from −gradient into the quasi-Newton direction; returns the slope of Φ along it, J.
    #[inline(always)]
    pub fn solve(&mut self, factor: Factor<F>, direction: &mut [F]) -> F {
        let n = direction.len();
        let zero = direction[0].same(0.0);
        for pair in self.pairs[..self.count].iter_mut().rev() {
            let mut along = zero;
            for i in 0..n {
                along += pair.step[i] * direction[i];
            }
            pair.alpha = along * pair.inverse;
            for i in 0..n {
                direction[i] -= pair.change[i] * pair.alpha;
            }
        }
        match factor {
            Factor::Dense(factor) => cholesky::solve(factor, n, direction),
            Factor::Blocks(factor) => factor.solve(direction),
        }
        for pair in &self.pairs[..self.count] {
            let mut along = zero;
            for i in 0..n {
                along += pair.change[i] * direction[i];
            }
            let share = pair.alpha - along * pair.inverse;
            for i in 0..n {
                direction[i] += pair.step[i] * share;
            }
        }
        let mut slope = zero;
        for i in 0..n {
            slope -= self.downhill[i] * direction[i];
        }
        slope
    }
}
