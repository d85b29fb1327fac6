//! Free chains: strands as if there were no bodies. Several at once, one per SIMD lane, each with the same
//! bits as alone ([`crate::math::lanes`]).

use super::chain::{RestChain, Vertex};
use super::curl::IN_PHASE;
use super::moment::Carriers;
use super::moving_rotation::{MovingRotation, Quaternion};
use super::posed_guide::PosedGuides;
use crate::math::lanes::{Lane, MAX_LANES, Real, V3};
use nalgebra::Vector3;
use pulp::{Arch, Simd, WithSimd};

/// A chain to lay.
#[derive(Debug, Clone, Copy)]
pub(super) struct Lay<'a> {
    pub chain: &'a RestChain,
    /// Its edges, m, and their rates, m/s, rest space, in place of those at rest; empty if none is deflected.
    pub deflected: &'a [[Vector3<f64>; 2]],
}

impl<'a> Lay<'a> {
    /// The free chain.
    pub fn free(chain: &'a RestChain) -> Self {
        Lay { chain, deflected: &[] }
    }

    /// Edge `j`, m, and its rate, m/s.
    #[inline(always)]
    fn edge(&self, j: usize) -> [Vector3<f64>; 2] {
        self.deflected.get(j).copied().unwrap_or_else(|| [self.chain.edges[j].vector(), Vector3::zeros()])
    }
}

/// Lays `chains` edge by edge from their roots, into `out`. Velocities are invalid unless `with_velocities`.
pub(super) fn lay<'a>(
    chains: impl ExactSizeIterator<Item = Lay<'a>> + Clone,
    guides: &PosedGuides,
    with_velocities: bool,
    out: &mut [Vec<Vertex>],
) {
    Arch::new().dispatch(LayAll { chains, scene: Scene { guides, with_velocities }, out });
}

/// Rotations from rest space, turned back by the phase, to each edge of a free chain.
pub(super) fn rotations<'a>(
    chain: &'a RestChain,
    guides: &'a PosedGuides,
) -> impl Iterator<Item = MovingRotation<f64>> + 'a {
    let alone = [Lay::free(chain); MAX_LANES];
    let root = root_rotation(0.0, &alone, guides);
    (0..chain.edges.len()).map(move |j| edge_rotation(0.0, j, &alone, guides, root))
}

#[derive(Clone, Copy)]
struct Scene<'b> {
    guides: &'b PosedGuides,
    with_velocities: bool,
}

struct LayAll<'b, I> {
    chains: I,
    scene: Scene<'b>,
    out: &'b mut [Vec<Vertex>],
}

impl<'a, I: ExactSizeIterator<Item = Lay<'a>> + Clone> WithSimd for LayAll<'_, I> {
    type Output = ();
    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let LayAll { mut chains, scene, mut out } = self;
        while let Some(first) = chains.clone().next() {
            let alike = chains.clone().take_while(|lay| lay.chain.edges.len() == first.chain.edges.len());
            let n = alike.take(S::F64_LANES).count();
            // Unused lanes repeat the first chain.
            let mut pack = [first; MAX_LANES];
            pack.iter_mut().zip(chains.by_ref().take(n)).for_each(|(lane, chain)| *lane = chain);
            let Some(own) = out.split_off_mut(..n) else { return };
            if n == 1 {
                lay_pack(0.0, &pack, &scene, own);
            } else {
                lay_pack(Lane::splat(simd, 0.0), &pack, &scene, own);
            }
        }
    }
}

#[inline(always)]
fn lay_pack<F: Real>(zero: F, pack: &[Lay; MAX_LANES], scene: &Scene, out: &mut [Vec<Vertex>]) {
    let Scene { guides, with_velocities } = *scene;
    let carried = |chain: &RestChain| guides.carriers.strand(chain.strand).carry(&chain.root);
    let roots: [_; MAX_LANES] = std::array::from_fn(|i| carried(pack[i].chain));
    let turn = root_rotation(zero, pack, guides);
    out.iter_mut().zip(&roots).for_each(|(vertices, (x, v))| {
        vertices.clear();
        vertices.push(Vertex { x: *x, v: *v });
    });
    let (mut x, mut v) = (gather(zero, |i| roots[i].0.into()), gather(zero, |i| roots[i].1.into()));
    let deflects = pack.iter().any(|lay| !lay.deflected.is_empty());
    for j in 0..pack[0].chain.edges.len() {
        let rotation = edge_rotation(zero, j, pack, guides, turn);
        let edge = rotation.rotate(gather(zero, |i| pack[i].edge(j)[0].into()));
        x += edge;
        if with_velocities {
            v += rotation.spin().cross(edge);
            if deflects {
                v += rotation.rotate(gather(zero, |i| pack[i].edge(j)[1].into()));
            }
        }
        for (i, vertices) in out.iter_mut().enumerate() {
            vertices.push(Vertex { x: in_lane(x, i), v: in_lane(v, i) });
        }
    }
}

/// Rotations from rest space to world of what carries each chain, if guides are posed in their rest spaces.
#[inline(always)]
fn root_rotation<F: Real>(
    zero: F,
    pack: &[Lay; MAX_LANES],
    guides: &PosedGuides,
) -> Option<MovingRotation<F>> {
    let Carriers::Each { strands, .. } = &guides.carriers else { return None };
    let of = |lay: &Lay| {
        let carrier = &strands[lay.chain.strand];
        MovingRotation::new(&carrier.rotation, &carrier.spin)
    };
    let turns: [MovingRotation<f64>; MAX_LANES] = std::array::from_fn(|i| of(&pack[i]));
    let quaternion = |of: [Quaternion<f64>; MAX_LANES]| Quaternion {
        w: scalars(zero, |i| of[i].w),
        v: gather(zero, |i| of[i].v.0),
    };
    Some(MovingRotation { q: quaternion(turns.map(|t| t.q)), rate: quaternion(turns.map(|t| t.rate)) })
}

/// Rotations from rest space, turned back by the phase, to edge `j` of each chain (`docs/theory.md` eqs. 7.1
/// and 7.2). On skins they are followed by those of the chains' roots, `turn`.
#[inline(always)]
fn edge_rotation<F: Real>(
    zero: F,
    j: usize,
    pack: &[Lay; MAX_LANES],
    guides: &PosedGuides,
    turn: Option<MovingRotation<F>>,
) -> MovingRotation<F> {
    let carry = |rotation: MovingRotation<F>| turn.map_or(rotation, |turn| turn.after(rotation));
    let (mut q, mut rate) = ([[0.0; 4]; MAX_LANES], [[0.0; 4]; MAX_LANES]);
    let mut sums = [[0.0; 6]; MAX_LANES];
    for (i, lay) in pack.iter().enumerate().take(F::LANES) {
        let (main, sum) = lay.chain.rotation(j, guides);
        (q[i], rate[i], sums[i]) = (main.q.into(), main.rate.into(), sum);
    }
    let quaternion = |of: &[[f64; 4]; MAX_LANES]| Quaternion {
        w: scalars(zero, |i| of[i][0]),
        v: gather(zero, |i| [of[i][1], of[i][2], of[i][3]]),
    };
    let phi = gather(zero, |i| [sums[i][0], sums[i][1], sums[i][2]]);
    let phi_rate = gather(zero, |i| [sums[i][3], sums[i][4], sums[i][5]]);
    let main = MovingRotation { q: quaternion(&q), rate: quaternion(&rate) };
    let rotation = main.after(MovingRotation::by(phi, phi_rate));
    if pack.iter().all(|lay| lay.chain.half_phases.is_empty()) {
        return carry(rotation);
    }
    let (mut axes, mut halves) = ([[0.0; 6]; MAX_LANES], [IN_PHASE; MAX_LANES]);
    for (i, lay) in pack.iter().enumerate().take(F::LANES) {
        (axes[i], halves[i]) = lay.chain.phase(j, guides);
    }
    let axis = gather(zero, |i| [axes[i][0], axes[i][1], axes[i][2]]);
    let axis_rate = gather(zero, |i| [axes[i][3], axes[i][4], axes[i][5]]);
    let [cosine, sine] = [0, 1].map(|part| scalars(zero, |i| halves[i][part].into()));
    carry(MovingRotation::about(axis, axis_rate, cosine, sine).after(rotation))
}

/// The number `of(i)` in every lane i.
#[inline(always)]
fn scalars<F: Real>(zero: F, of: impl Fn(usize) -> f64) -> F {
    let mut gathered = zero;
    (0..F::LANES).for_each(|i| gathered.set(i, of(i)));
    gathered
}

/// The vector `of(i)` in every lane i.
#[inline(always)]
fn gather<F: Real>(zero: F, of: impl Fn(usize) -> [f64; 3]) -> V3<F> {
    let mut gathered = V3::all(zero);
    for i in 0..F::LANES {
        for (part, x) in gathered.0.iter_mut().zip(of(i)) {
            part.set(i, x);
        }
    }
    gathered
}

#[inline(always)]
fn in_lane<F: Real>(v: V3<F>, i: usize) -> Vector3<f64> {
    Vector3::new(v.0[0].lane(i), v.0[1].lane(i), v.0[2].lane(i))
}
