//! Free chains: strands as if there were no bodies. Several at once, one per SIMD lane, each with the same
//! bits as alone ([`crate::math::lanes`]).

use super::chain::{RestChain, Vertex};
use super::moment::HeadMotion;
use super::posed_guide::PosedGuide;
use crate::math::lanes::{Lane, M3, MAX_LANES, Real, V3};
use crate::math::se3::turned_by;
use nalgebra::{Matrix3, Vector3};
use pulp::{Arch, Simd, WithSimd};

/// Lays the free chains of `strands` edge by edge from their roots, into `out`. Velocities are invalid unless
/// `with_velocities`.
pub(super) fn lay_free<'a>(
    strands: impl ExactSizeIterator<Item = &'a RestChain> + Clone,
    head: &HeadMotion,
    guides: &[PosedGuide],
    with_velocities: bool,
    out: &mut [Vec<Vertex>],
) {
    Arch::new().dispatch(LayFree { strands, scene: Scene { head, guides, with_velocities }, out });
}

#[derive(Clone, Copy)]
struct Scene<'b> {
    head: &'b HeadMotion,
    guides: &'b [PosedGuide],
    with_velocities: bool,
}

struct LayFree<'b, I> {
    strands: I,
    scene: Scene<'b>,
    out: &'b mut [Vec<Vertex>],
}

impl<'a, I: ExactSizeIterator<Item = &'a RestChain> + Clone> WithSimd for LayFree<'_, I> {
    type Output = ();
    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let LayFree { mut strands, scene, mut out } = self;
        while let Some(first) = strands.clone().next() {
            let alike = strands.clone().take_while(|strand| strand.edges.len() == first.edges.len());
            let n = alike.take(S::F64_LANES).count();
            // Unused lanes repeat the first strand.
            let mut pack = [first; MAX_LANES];
            pack.iter_mut().zip(strands.by_ref().take(n)).for_each(|(lane, strand)| *lane = strand);
            let Some(own) = out.split_off_mut(..n) else { return };
            if n == 1 {
                lay(0.0, &pack, &scene, own);
            } else {
                lay(Lane::splat(simd, 0.0), &pack, &scene, own);
            }
        }
    }
}

#[inline(always)]
fn lay<F: Real>(zero: F, strands: &[&RestChain; MAX_LANES], scene: &Scene, out: &mut [Vec<Vertex>]) {
    let Scene { head, guides, with_velocities } = *scene;
    let roots: [_; MAX_LANES] = std::array::from_fn(|i| head.carry(&strands[i].root));
    out.iter_mut().zip(&roots).for_each(|(vertices, (x, v))| {
        vertices.clear();
        vertices.push(Vertex { x: *x, v: *v });
    });
    let (mut x, mut v) = (gather(zero, |i| roots[i].0.into()), gather(zero, |i| roots[i].1.into()));
    // Rotation from rest space to the current edge, and its angular velocity.
    let (mut rotation, mut spin) = (splat(zero, &head.rotation), gather(zero, |_| head.spin.into()));
    let [mut before, mut rate_before] = [V3::all(zero); 2];
    for j in 0..strands[0].edges.len() {
        let mut sums = [[0.0; 6]; MAX_LANES];
        sums.iter_mut()
            .zip(strands)
            .take(F::LANES)
            .for_each(|(sum, strand)| *sum = strand.integral(j, guides));
        let now = gather(zero, |i| [sums[i][0], sums[i][1], sums[i][2]]);
        let rate_now = gather(zero, |i| [sums[i][3], sums[i][4], sums[i][5]]);
        let (turn, rate) = turned_by(now - before, rate_now - rate_before);
        if with_velocities {
            spin += rotation * rate;
        }
        rotation = rotation * turn;
        (before, rate_before) = (now, rate_now);
        let edge = rotation * gather(zero, |i| strands[i].edges[j].vector().into());
        x += edge;
        v += spin.cross(edge);
        for (i, vertices) in out.iter_mut().enumerate() {
            vertices.push(Vertex { x: in_lane(x, i), v: in_lane(v, i) });
        }
    }
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

/// The same matrix in every lane.
#[inline(always)]
fn splat<F: Real>(zero: F, m: &Matrix3<f64>) -> M3<F> {
    M3([0, 1, 2].map(|column| V3([0, 1, 2].map(|row| zero.same(m[(row, column)])))))
}

#[inline(always)]
fn in_lane<F: Real>(v: V3<F>, i: usize) -> Vector3<f64> {
    Vector3::new(v.0[0].lane(i), v.0[1].lane(i), v.0[2].lane(i))
}
