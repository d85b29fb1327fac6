//! Hessian of the incremental potential (`docs/theory.md` §4.4), swept from the tip to the root over
//! composite bodies (Featherstone 2008, ch. 6), geometric stiffness included. Exact between segments; within
//! one segment to third order in its rotation.

use super::joint::{Joint, RootJoint};
use super::potential::{Load, PointSpring};
use super::segment::{RodCore, Segment};
use super::sensitivity::Sensitivity;
use super::shape::{COMMUTATOR, RodShape};
use crate::math::lanes::{M3, Real, Twist, V3};

/// A symmetric matrix: xx, xy, xz, yy, yz, zz.
struct Symmetric<F>([F; 6]);

impl<F: Real> Symmetric<F> {
    /// Adds d 1 − a bᵀ − c cᵀ, with a parallel to b.
    #[inline(always)]
    fn add(&mut self, d: F, a: V3<F>, b: V3<F>, c: V3<F>) {
        // No closure in a kernel: compiled out of line, it would lose the target features of the dispatch.
        for (entry, [i, j]) in [[0, 0], [0, 1], [0, 2], [1, 1], [1, 2], [2, 2]].into_iter().enumerate() {
            let less = a.0[i] * b.0[j] + c.0[i] * c.0[j];
            self.0[entry] += if i == j { d - less } else { -less };
        }
    }

    #[inline(always)]
    fn full(&self) -> M3<F> {
        let [xx, xy, xz, yy, yz, zz] = self.0;
        M3([V3([xx, xy, xz]), V3([xy, yy, yz]), V3([xz, yz, zz])])
    }
}

/// Sums over all points downstream of a segment, about the root. Blocks are named t (rotation, torque) and p
/// (translation, force).
pub(super) struct Composite<F> {
    /// Σ f.
    force: V3<F>,
    /// Σ x fᵀ, the forces included that exert moments.
    moment: M3<F>,
    /// Stiffness of moments against rotations.
    turning: M3<F>,
    /// Σ JᵀBJ with J = (−[x]×, 1), by blocks.
    tt: Symmetric<F>,
    tp: M3<F>,
    pp: Symmetric<F>,
}

impl<F: Real> Composite<F> {
    #[inline(always)]
    fn new(zero: F) -> Self {
        let m = M3::diagonal(zero);
        Composite {
            force: V3::all(zero),
            moment: m,
            turning: m,
            tt: Symmetric([zero; 6]),
            tp: m,
            pp: Symmetric([zero; 6]),
        }
    }

    /// Adds a spring from a place at `x` to where it is.
    #[inline(always)]
    pub fn add(&mut self, x: V3<F>, spring: &PointSpring<F>) {
        let f = spring.force(x);
        self.force += f;
        self.moment = self.moment + M3::outer(x, f);
        // [x]×B and −[x]×B[x]× for B = α 1 − u uᵀ, with c = x × u: α[x]× − c uᵀ and α(|x|² 1 − x xᵀ) − c cᵀ.
        let (c, ax, none) = (x.cross(spring.u), x * spring.alpha, V3::all(spring.alpha.same(0.0)));
        self.pp.add(spring.alpha, none, none, spring.u);
        self.tp = self.tp + (M3::hat(ax) - M3::outer(c, spring.u));
        self.tt.add(x.dot(ax), ax, x, c);
    }

    /// Σ x × f, with the moments.
    #[inline(always)]
    fn torque(&self) -> V3<F> {
        let [x, y, z] = self.moment.0;
        V3([z.0[1] - y.0[2], x.0[2] - z.0[0], y.0[0] - x.0[1]])
    }

    /// The response of everything downstream to twists, with its geometric stiffness scaled by `geometric`.
    #[inline(always)]
    pub fn response(&self, geometric: F) -> Response<F> {
        let carried = self.moment - M3::diagonal(self.moment.trace());
        Response {
            tt: self.tt.full() - (carried - self.turning) * geometric,
            tp: self.tp + M3::hat(self.force) * geometric,
            pt: self.tp,
            pp: self.pp.full(),
        }
    }
}

/// What a Hessian is made of besides a rod's shape.
pub(super) trait Acting<F> {
    /// Adds what acts on point `k`, which is not held, to `downstream`.
    fn add_point(&self, k: usize, core: &RodCore<F>, shape: &RodShape<F>, downstream: &mut Composite<F>);

    /// What acts on unknown `a` alone, on the diagonal.
    fn on_unknown(&self, core: &RodCore<F>, a: usize) -> F;

    /// What couples unknown `c` of node `i` to that of the next one.
    fn on_neighbours(&self, core: &RodCore<F>, i: usize, c: usize) -> F;
}

impl<F: Real> Acting<F> for Load<F> {
    #[inline(always)]
    fn add_point(&self, k: usize, core: &RodCore<F>, shape: &RodShape<F>, downstream: &mut Composite<F>) {
        let (g, k) = (&shape.pose[k], k - core.first_moving());
        downstream.add(g.p, &self.springs[k]);
        if let Some(moment) = self.moments.get(k) {
            let turned = moment.at(&g.r);
            downstream.moment = downstream.moment + turned.outer(&g.r);
            downstream.turning = downstream.turning + turned.stiffness();
        }
    }

    #[inline(always)]
    fn on_unknown(&self, core: &RodCore<F>, a: usize) -> F {
        let elastic = core.stiffness[a % 3] * self.hat[a / 3][0];
        // No closure in a kernel: compiled out of line, it would lose the target features of the dispatch.
        match self.holds.get(a) {
            Some(hold) => elastic + hold.stiffness,
            None => elastic,
        }
    }

    #[inline(always)]
    fn on_neighbours(&self, core: &RodCore<F>, i: usize, c: usize) -> F {
        core.stiffness[c] * self.hat[i][1]
    }
}

/// Maps a twist to the wrench response P of everything downstream (`docs/theory.md` eq. 4.2): torque tt ω +
/// tp v, force ptᵀ ω + pp v. Without geometric stiffness tp = pt.
pub(super) struct Response<F> {
    tt: M3<F>,
    tp: M3<F>,
    pt: M3<F>,
    pp: M3<F>,
}

impl<F: Real> Response<F> {
    #[inline(always)]
    pub fn to(&self, t: &Twist<F>) -> Twist<F> {
        Twist { w: self.tt * t.w + self.tp * t.v, v: self.pt.transposed(t.w) + self.pp * t.v }
    }
}

/// Contribution of the segments of one element to the Hessian.
pub(super) struct ElementBlock<F> {
    /// Response to the element's six unknowns, summed over its segments: all that upstream unknowns need.
    pub response: [Twist<F>; 6],
    /// Response of the current segment.
    own: [Twist<F>; 6],
    /// Entry (b, a) of the element's own block is `half[a][b] + half[b][a]`.
    half: [[F; 6]; 6],
}

impl<F: Real> ElementBlock<F> {
    #[inline(always)]
    fn new(zero: F) -> Self {
        let none = [Twist::none(zero); 6];
        ElementBlock { response: none, own: none, half: [[zero; 6]; 6] }
    }

    #[inline(always)]
    fn clear(&mut self, zero: F) {
        self.response.fill(Twist::none(zero));
        self.half.fill([zero; 6]);
    }

    /// Entry (a, b) of the element's own block.
    #[inline(always)]
    pub fn entry(&self, a: usize, b: usize) -> F {
        self.half[a][b] + self.half[b][a]
    }

    /// Adds a segment as if it were rigid. Its first `N` unknowns give the twists `own` through it and
    /// `before` through the segments before it.
    #[inline(always)]
    fn add_rigid<const N: usize>(&mut self, to: &Response<F>, own: &[Twist<F>; 6], before: &[Twist<F>; 6]) {
        // This segment against those before it in the element, and half of its product with itself. Symmetry
        // adds the transposed product and the other half.
        for ((sum, p), t) in self.response.iter_mut().zip(&mut self.own).zip(own).take(N) {
            *p = to.to(t);
            *sum = *sum + *p;
        }
        for a in 0..N {
            let up = before[a] + own[a] * own[a].w.0[0].same(0.5);
            for b in 0..N {
                self.half[b][a] += up.dot(&self.own[b]);
            }
        }
    }

    /// Adds `geometric` times the second derivative of the segment's exponent ψ contracted with `wrench`, the
    /// wrench of everything downstream as seen along the segment, for its first `N` unknowns
    /// (`docs/theory.md` eq. 4.3).
    #[inline(always)]
    fn add_exponent<const N: usize>(
        &mut self,
        segment: &Segment<F>,
        psi: &Twist<F>,
        wrench: &Twist<F>,
        geometric: F,
    ) {
        let (phi, rho, n, f) = (psi.w, psi.v, wrench.w, wrench.v);
        let z = M3::outer(phi, n) + M3::outer(n, phi) + M3::outer(rho, f) + M3::outer(f, rho)
            - M3::diagonal((n.dot(phi) + f.dot(rho)) * 2.0);
        let z = z * (geometric * (1.0 / 12.0));
        let [n1, n2] = segment.hat;
        let (left, right) = ((n1 + n2) * segment.h * 0.5, (-(n1 + n2) + 2.0) * segment.h * 0.5);
        let (ll, rr) = (z * (left * left), z * (right * right));
        let commutator = (n1 - n2) * segment.h * segment.h * geometric * COMMUTATOR;
        let rl = z * (left * right) - M3::hat(n) * commutator;
        // An entry on the diagonal counts twice.
        for b in 0..3 {
            self.half[b][b] += ll.0[b].0[b] * 0.5;
            for a in b + 1..3 {
                self.half[b][a] += ll.0[b].0[a];
            }
            if N > 3 {
                for a in 0..3 {
                    self.half[b][3 + a] += rl.0[b].0[a];
                }
                self.half[3 + b][3 + b] += rr.0[b].0[b] * 0.5;
                for a in b + 1..3 {
                    self.half[3 + b][3 + a] += rr.0[b].0[a];
                }
            }
        }
    }
}

/// What takes the Hessian as the sweep from tip to root finds it.
pub(super) trait Assembly<F> {
    /// Takes the block of an element whose first unknown is `first`, with `live` unknowns of its own.
    fn add_element(&mut self, first: usize, live: usize, block: &ElementBlock<F>);
}

/// The whole lower triangle, row-major n × n, N·m³.
struct Dense<'a, F> {
    n: usize,
    total: &'a [Twist<F>],
    hessian: &'a mut [F],
}

impl<F: Real> Assembly<F> for Dense<'_, F> {
    #[inline(always)]
    fn add_element(&mut self, first: usize, live: usize, block: &ElementBlock<F>) {
        for a in 0..live {
            let row = &mut self.hessian[(first + a) * self.n..];
            for b in 0..=a {
                row[first + b] += block.entry(a, b);
            }
            for (h, s) in row.iter_mut().zip(&self.total[..first]) {
                *h += s.dot(&block.response[a]);
            }
        }
    }
}

/// Sets the lower triangle of `hessian` (row-major n × n, N·m³) to that of Φ. `wrench` is from
/// [`gradient`](super::potential::gradient), `q` are the unknowns. `geometric` scales the geometric stiffness: 1
/// gives the Hessian, 0 a positive definite approximation.
#[allow(clippy::too_many_arguments)] // A kernel: all that it reads, and its output.
#[inline(always)]
pub(super) fn hessian<F: Real>(
    core: &RodCore<F>,
    load: &Load<F>,
    shape: &RodShape<F>,
    sensitivity: &Sensitivity<F>,
    wrench: &[Twist<F>],
    q: &[F],
    geometric: F,
    hessian: &mut Vec<F>,
) {
    let (n, zero) = (core.unknowns(), geometric.same(0.0));
    set_elastic(core, load, zero, hessian);
    let mut dense = Dense { n, total: &sensitivity.total, hessian };
    let mut downstream = sweep(core, load, shape, sensitivity, wrench, geometric, &mut dense);
    if core.joint != RootJoint::Clamped {
        let root = &shape.pose[0];
        let mut torque = downstream.torque();
        if core.joint == RootJoint::Free {
            load.add_point(0, core, shape, &mut downstream);
            torque = downstream.torque() - root.p.cross(downstream.force);
        }
        let (response, joint) = (downstream.response(geometric), Joint::new(q));
        let turning = joint.stiffness(root.r.transposed(torque)) * geometric;
        let twists = &sensitivity.total[..3];
        let responses = [response.to(&twists[0]), response.to(&twists[1]), response.to(&twists[2])];
        for a in 0..3 {
            for b in 0..=a {
                let rigid = twists[a].dot(&responses[b]) + twists[b].dot(&responses[a]);
                hessian[a * n + b] += rigid * zero.same(0.5) - turning.0[b].0[a];
            }
        }
        if core.joint == RootJoint::Free {
            // A displacement is upstream of a rotation.
            for (a, moves) in sensitivity.total[3..6].iter().enumerate() {
                let row = &mut hessian[(3 + a) * n..];
                for (h, turned) in row.iter_mut().zip(&responses) {
                    *h += moves.dot(turned);
                }
                let moved = response.to(moves);
                for (h, other) in row[3..4 + a].iter_mut().zip(&sensitivity.total[3..6]) {
                    *h += other.dot(&moved);
                }
            }
        }
    }
}

/// Finds the Hessian of Φ by elements, without the elastic and viscous part, the springs on the unknowns, and the
/// joint of a root that turns. Returns the sums over all points but the root.
#[allow(clippy::too_many_arguments)] // As `hessian`.
#[inline(always)]
pub(super) fn sweep<F: Real>(
    core: &RodCore<F>,
    load: &impl Acting<F>,
    shape: &RodShape<F>,
    sensitivity: &Sensitivity<F>,
    wrench: &[Twist<F>],
    geometric: F,
    assembly: &mut impl Assembly<F>,
) -> Composite<F> {
    let (n, zero) = (core.unknowns(), geometric.same(0.0));
    let mut downstream = Composite::new(zero);
    let mut block = ElementBlock::new(zero);
    for k in (0..core.segments.len()).rev() {
        load.add_point(k + 1, core, shape, &mut downstream);
        let response = downstream.response(geometric);
        let (segment, psi) = (&core.segments[k], &shape.exponent[k].psi);
        let first = 3 * segment.element;
        let (own, before) = (&sensitivity.own[k], &sensitivity.before[k]);
        let live = if n - first > 3 {
            block.add_rigid::<6>(&response, own, before);
            block.add_exponent::<6>(segment, psi, &wrench[k], geometric);
            6
        } else {
            block.add_rigid::<3>(&response, own, before);
            block.add_exponent::<3>(segment, psi, &wrench[k], geometric);
            3
        };
        if k == 0 || core.segments[k - 1].element != segment.element {
            assembly.add_element(first, live, &block);
            block.clear(zero);
        }
    }
    downstream
}

/// Sets the lower triangle to the elastic and viscous part, with the springs on the unknowns.
#[inline(always)]
fn set_elastic<F: Real>(core: &RodCore<F>, load: &Load<F>, zero: F, hessian: &mut Vec<F>) {
    let n = core.unknowns();
    hessian.resize(n * n, zero);
    for (i, row) in hessian.chunks_exact_mut(n).enumerate() {
        row[..i].fill(zero);
    }
    for i in 0..n / 3 {
        for c in 0..3 {
            let (a, stiffness) = (3 * i + c, core.stiffness[c]);
            hessian[a * n + a] = stiffness * load.hat[i][0];
            if i > 0 {
                hessian[a * n + a - 3] = stiffness * load.hat[i - 1][1];
            }
        }
    }
    for (a, hold) in load.holds.iter().enumerate() {
        hessian[a * n + a] += hold.stiffness;
    }
}
