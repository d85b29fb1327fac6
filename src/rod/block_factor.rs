//! Elimination of the Hessian's unknowns from tip to root in O(n) (`docs/theory.md` §4.5).
//!
//! What is upstream of an element acts on it by a twist t alone, which has six numbers. With all nodes after node i
//! eliminated, the quadratic form of the rest is ½ tᵀ A t + tᵀ C qᵢ + ½ qᵢᵀ D qᵢ, where t is the twist upstream of the
//! second element of node i.

#![allow(clippy::needless_range_loop)] // Several arrays share one index.

use super::hessian::{Acting, Assembly, ElementBlock, Response, sweep};
use super::joint::RootJoint;
use super::segment::RodCore;
use super::sensitivity::Sensitivity;
use super::shape::RodShape;
use crate::math::lanes::{M3, Mask, Real, Twist};

/// A factor of the Hessian in blocks of three unknowns, one block for each node.
#[derive(Debug, Clone)]
pub(super) struct BlockFactor<F> {
    /// From the root on.
    nodes: Vec<NodeFactor<F>>,
}

/// What is left of an eliminated node.
#[derive(Debug, Clone, Copy)]
struct NodeFactor<F> {
    /// Lower triangle of the factor L of its pivot, the diagonal inverted.
    pivot: [[F; 3]; 3],
    /// L⁻¹ times its coupling to the twist upstream of the element before it.
    twist: [Twist<F>; 3],
    /// L⁻¹ times its coupling to the node before it.
    node: [[F; 3]; 3],
    /// Twists of everything downstream of its support, per unknown.
    total: [Twist<F>; 3],
}

/// A symmetric form of twists.
#[derive(Clone, Copy)]
struct TwistForm<F> {
    ww: M3<F>,
    wv: M3<F>,
    vv: M3<F>,
}

impl<F: Real> TwistForm<F> {
    #[inline(always)]
    fn times(&self, t: &Twist<F>) -> Twist<F> {
        Twist { w: self.ww * t.w + self.wv * t.v, v: self.wv.transposed(t.w) + self.vv * t.v }
    }

    /// Subtracts t tᵀ.
    #[inline(always)]
    fn subtract(&mut self, t: &Twist<F>) {
        self.ww = self.ww - M3::outer(t.w, t.w);
        self.wv = self.wv - M3::outer(t.w, t.v);
        self.vv = self.vv - M3::outer(t.v, t.v);
    }
}

/// Eliminates the unknowns as the sweep finds the Hessian.
struct Elimination<'a, F, L> {
    core: &'a RodCore<F>,
    load: &'a L,
    total: &'a [Twist<F>],
    factor: &'a mut BlockFactor<F>,
    /// Lanes in which all pivots so far are positive definite.
    positive: Mask,
    a: TwistForm<F>,
    c: [Twist<F>; 3],
    d: [[F; 3]; 3],
}

impl<F: Real, L: Acting<F>> Elimination<'_, F, L> {
    /// Replaces `d` by its factor.
    #[inline(always)]
    fn factor_pivot(&mut self) {
        let d = &mut self.d;
        for j in 0..3 {
            let mut left = d[j][j];
            for k in 0..j {
                left -= d[j][k] * d[j][k];
            }
            // False for NaN, too.
            self.positive &= (d[j][j].abs() * 1e-14).below(left);
            d[j][j] = left.same(1.0) / left.sqrt();
            for i in j + 1..3 {
                for k in 0..j {
                    let product = d[i][k] * d[j][k];
                    d[i][j] -= product;
                }
                d[i][j] = d[i][j] * d[j][j];
            }
        }
    }

    /// L⁻¹ times couplings to a twist.
    #[inline(always)]
    fn lower_twists(&self, x: [Twist<F>; 3]) -> [Twist<F>; 3] {
        let l = &self.d;
        let first = x[0] * l[0][0];
        let second = (x[1] + first * -l[1][0]) * l[1][1];
        let third = (x[2] + first * -l[2][0] + second * -l[2][1]) * l[2][2];
        [first, second, third]
    }

    /// Eliminates block `i`, whose pivot is `d`, coupled to the twist by `x` and to the node before it by `y`, by rows
    /// of the block.
    #[inline(always)]
    fn eliminate(&mut self, i: usize, x: [Twist<F>; 3], y: [[F; 3]; 3]) -> ([Twist<F>; 3], [[F; 3]; 3]) {
        self.factor_pivot();
        let (twist, l) = (self.lower_twists(x), &self.d);
        let mut node = y;
        for c in 0..3 {
            node[0][c] = node[0][c] * l[0][0];
            node[1][c] = (node[1][c] - l[1][0] * node[0][c]) * l[1][1];
            node[2][c] = (node[2][c] - l[2][0] * node[0][c] - l[2][1] * node[1][c]) * l[2][2];
        }
        let total = [self.total[3 * i], self.total[3 * i + 1], self.total[3 * i + 2]];
        self.factor.nodes[i] = NodeFactor { pivot: self.d, twist, node, total };
        (twist, node)
    }

    /// Eliminates the joint of a root, where everything downstream has the response `response`; the nodes have been.
    #[inline(always)]
    fn eliminate_joint(&mut self, response: &Response<F>) {
        let (blocks, zero) = (self.core.joint.blocks(), self.d[0][0].same(0.0));
        let none = [Twist::none(zero); 3];
        let mut joint = [[zero; 6]; 6];
        for k in 0..3 * blocks {
            let to = response.to(&self.total[k]) + self.a.times(&self.total[k]);
            for j in k..3 * blocks {
                joint[j][k] = self.total[j].dot(&to);
            }
            joint[k][k] += self.load.on_unknown(self.core, k);
        }
        // The first node feels the joint before it as it feels a twist.
        if let Some(before) = blocks.checked_sub(1) {
            let node = &mut self.factor.nodes[blocks];
            for j in 0..3 {
                for k in 0..3 {
                    node.node[j][k] = node.twist[j].dot(&self.total[3 * before + k]);
                }
            }
        }
        let mut node = [[zero; 3]; 3];
        for block in (0..blocks).rev() {
            let mut before = [[zero; 3]; 3];
            for j in 0..3 {
                for k in 0..3 {
                    self.d[j][k] = joint[3 * block + j][3 * block + k];
                    for of_next in &node {
                        self.d[j][k] -= of_next[j] * of_next[k];
                    }
                    if block > 0 {
                        before[j][k] = joint[3 * block + j][k];
                    }
                }
            }
            (_, node) = self.eliminate(block, none, before);
        }
    }
}

impl<F: Real, L: Acting<F>> Assembly<F> for Elimination<'_, F, L> {
    #[inline(always)]
    fn add_element(&mut self, first: usize, live: usize, block: &ElementBlock<F>) {
        let i = first / 3;
        let zero = self.d[0][0].same(0.0);
        let (mut twist, mut node) = ([Twist::none(zero); 3], [[zero; 3]; 3]);
        let (a, c) = (self.a, self.c);
        let s = [self.total[first], self.total[first + 1], self.total[first + 2]];
        if live == 6 {
            let (mut x, mut y) = (twist, node);
            for j in 0..3 {
                for k in 0..=j {
                    self.d[j][k] += block.entry(3 + j, 3 + k);
                }
                self.d[j][j] += self.load.on_unknown(self.core, first + 3 + j);
                x[j] = c[j] + block.response[3 + j];
                for k in 0..3 {
                    y[j][k] = s[k].dot(&c[j]) + block.entry(3 + j, k);
                }
                y[j][j] += self.load.on_neighbours(self.core, i, j);
            }
            (twist, node) = self.eliminate(i + 1, x, y);
        }
        for k in 0..3 {
            let carried = a.times(&s[k]);
            let mut coupled = carried + block.response[k];
            for j in 0..3 {
                coupled = coupled + twist[j] * -node[j][k];
            }
            self.c[k] = coupled;
            for l in 0..=k {
                let mut d = s[l].dot(&carried) + block.entry(k, l);
                for j in 0..3 {
                    d -= node[j][k] * node[j][l];
                }
                self.d[k][l] = d;
            }
        }
        for t in &twist {
            self.a.subtract(t);
        }
        if i == self.core.joint.blocks() {
            for c in 0..3 {
                self.d[c][c] += self.load.on_unknown(self.core, first + c);
            }
            let (twist, _) = self.eliminate(i, self.c, [[zero; 3]; 3]);
            for t in &twist {
                self.a.subtract(t);
            }
        }
    }
}

impl<F> Default for BlockFactor<F> {
    fn default() -> Self {
        BlockFactor { nodes: Vec::new() }
    }
}

impl<F: Real> BlockFactor<F> {
    /// Makes room for the factor of a rod.
    #[inline(always)]
    pub fn resize(&mut self, core: &RodCore<F>) {
        let zero = core.length.same(0.0);
        let none = Twist::none(zero);
        let numbers = [[zero; 3]; 3];
        let node = NodeFactor { pivot: numbers, twist: [none; 3], node: numbers, total: [none; 3] };
        self.nodes.resize(core.hat.len(), node);
    }

    /// Sets it to the factor of the Hessian, as [`hessian`](super::hessian::hessian) finds that of Φ; of a root that
    /// turns where `geometric` is 0. Returns the lanes in which that is positive definite; the factor is invalid in the
    /// others.
    #[inline(always)]
    pub fn set(
        &mut self,
        core: &RodCore<F>,
        load: &impl Acting<F>,
        shape: &RodShape<F>,
        sensitivity: &Sensitivity<F>,
        wrench: &[Twist<F>],
        geometric: F,
    ) -> Mask {
        self.resize(core);
        let zero = geometric.same(0.0);
        let m = M3::diagonal(zero);
        let mut elimination = Elimination {
            core,
            load,
            total: &sensitivity.total,
            factor: self,
            positive: F::ALL,
            a: TwistForm { ww: m, wv: m, vv: m },
            c: [Twist::none(zero); 3],
            d: [[zero; 3]; 3],
        };
        let mut downstream = sweep(core, load, shape, sensitivity, wrench, geometric, &mut elimination);
        if core.joint != RootJoint::Clamped {
            if core.joint == RootJoint::Free {
                load.add_point(0, core, shape, &mut downstream);
            }
            elimination.eliminate_joint(&downstream.response(geometric));
        }
        elimination.positive
    }

    /// Takes over `other` in the lanes of `mask`.
    #[inline(always)]
    pub fn replace(&mut self, mask: Mask, other: &Self) {
        for (old, new) in self.nodes.iter_mut().zip(&other.nodes) {
            for j in 0..3 {
                for k in 0..3 {
                    old.pivot[j][k] = new.pivot[j][k].or(mask, old.pivot[j][k]);
                    old.node[j][k] = new.node[j][k].or(mask, old.node[j][k]);
                }
                old.twist[j] = either(mask, &new.twist[j], &old.twist[j]);
                old.total[j] = either(mask, &new.total[j], &old.total[j]);
            }
        }
    }

    /// Solves H x = b in place.
    #[inline(always)]
    pub fn solve(&self, b: &mut [F]) {
        let zero = b[0].same(0.0);
        // What is eliminated acts on the twist upstream and on the node before it.
        let (mut on_twist, mut on_node) = (Twist::none(zero), [zero; 3]);
        for (i, (node, b)) in self.nodes.iter().zip(b.chunks_exact_mut(3)).enumerate().rev() {
            let l = &node.pivot;
            let y0 = (b[0] + on_node[0]) * l[0][0];
            let y1 = (b[1] + on_node[1] - l[1][0] * y0) * l[1][1];
            let y2 = (b[2] + on_node[2] - l[2][0] * y0 - l[2][1] * y1) * l[2][2];
            (b[0], b[1], b[2]) = (y0, y1, y2);
            if i > 0 {
                let before = &self.nodes[i - 1].total;
                for k in 0..3 {
                    on_node[k] = before[k].dot(&on_twist)
                        - node.node[0][k] * y0
                        - node.node[1][k] * y1
                        - node.node[2][k] * y2;
                }
            }
            on_twist = on_twist + node.twist[0] * -y0 + node.twist[1] * -y1 + node.twist[2] * -y2;
        }
        let mut t = Twist::none(zero);
        let mut before: Option<([F; 3], &[Twist<F>; 3])> = None;
        for (node, b) in self.nodes.iter().zip(b.chunks_exact_mut(3)) {
            // The twist is that upstream of the element before the node.
            let mut y = [b[0], b[1], b[2]];
            for j in 0..3 {
                y[j] -= node.twist[j].dot(&t);
                if let Some((x, _)) = &before {
                    y[j] -= node.node[j][0] * x[0] + node.node[j][1] * x[1] + node.node[j][2] * x[2];
                }
            }
            if let Some((x, total)) = before {
                t = t + total[0] * x[0] + total[1] * x[1] + total[2] * x[2];
            }
            let l = &node.pivot;
            let x2 = y[2] * l[2][2];
            let x1 = (y[1] - l[2][1] * x2) * l[1][1];
            let x0 = (y[0] - l[1][0] * x1 - l[2][0] * x2) * l[0][0];
            (b[0], b[1], b[2]) = (x0, x1, x2);
            before = Some(([x0, x1, x2], &node.total));
        }
    }
}

/// `new` in the lanes of `mask`, `old` elsewhere.
#[inline(always)]
fn either<F: Real>(mask: Mask, new: &Twist<F>, old: &Twist<F>) -> Twist<F> {
    let mut twist = *old;
    for k in 0..3 {
        twist.w.0[k] = new.w.0[k].or(mask, old.w.0[k]);
        twist.v.0[k] = new.v.0[k].or(mask, old.v.0[k]);
    }
    twist
}
