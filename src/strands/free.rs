//! Strands as they would be without bodies, several at once: one to a lane of the processor's vector registers, each with the bits that it has alone
//! ([`crate::math::lanes`]).

use super::strand::{Strand, Track};
use super::{HeadMotion, Stand};
use crate::math::lanes::{Lane, M3, MAX_LANES, Real, V3};
use crate::math::se3::turned_by;
use nalgebra::{Matrix3, Vector3};
use pulp::{Arch, Simd, WithSimd};

/// Lays `strands` edge by edge from their roots, into `tracks`: points and velocities, which mean nothing where they are not asked for (`moving`).
pub(super) fn free<'a>(
    strands: impl ExactSizeIterator<Item = &'a Strand> + Clone,
    head: &HeadMotion,
    stands: &[Stand],
    moving: bool,
    tracks: &mut [Vec<Track>],
) {
    Arch::new().dispatch(Free { strands, head, stands, moving, tracks });
}

struct Free<'b, I> {
    strands: I,
    head: &'b HeadMotion,
    stands: &'b [Stand],
    moving: bool,
    tracks: &'b mut [Vec<Track>],
}

impl<'a, I: ExactSizeIterator<Item = &'a Strand> + Clone> WithSimd for Free<'_, I> {
    type Output = ();
    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Free { mut strands, head, stands, moving, mut tracks } = self;
        while let Some(first) = strands.clone().next() {
            let alike = strands.clone().take_while(|strand| strand.edges.len() == first.edges.len());
            let n = alike.take(S::F64_LANES).count();
            // The lanes that are left repeat the first strand.
            let mut pack = [first; MAX_LANES];
            pack.iter_mut().zip(strands.by_ref().take(n)).for_each(|(lane, strand)| *lane = strand);
            let (own, others) = std::mem::take(&mut tracks).split_at_mut(n);
            tracks = others;
            if n == 1 {
                lay(0.0, &pack, head, stands, moving, own);
            } else {
                lay(Lane::splat(simd, 0.0), &pack, head, stands, moving, own);
            }
        }
    }
}

#[inline(always)]
fn lay<F: Real>(
    zero: F,
    strands: &[&Strand; MAX_LANES],
    head: &HeadMotion,
    stands: &[Stand],
    moving: bool,
    tracks: &mut [Vec<Track>],
) {
    let roots: [Track; MAX_LANES] = std::array::from_fn(|i| head.carry(&strands[i].root));
    tracks.iter_mut().zip(&roots).for_each(|(track, root)| {
        track.clear();
        track.push(*root);
    });
    let (mut x, mut v) = (gathered(zero, |i| roots[i].0.into()), gathered(zero, |i| roots[i].1.into()));
    // From rest space to the edge at hand, and how that turns.
    let (mut turned, mut spin) = (everywhere(zero, &head.rotation), gathered(zero, |_| head.spin.into()));
    let [mut before, mut rate_before] = [V3::all(zero); 2];
    for j in 0..strands[0].edges.len() {
        let mut sums = [[0.0; 6]; MAX_LANES];
        sums.iter_mut().zip(strands).take(F::LANES).for_each(|(sum, strand)| *sum = strand.sum(j, stands));
        let now = gathered(zero, |i| [sums[i][0], sums[i][1], sums[i][2]]);
        let rate_now = gathered(zero, |i| [sums[i][3], sums[i][4], sums[i][5]]);
        let (turn, rate) = turned_by(now - before, rate_now - rate_before);
        if moving {
            spin += turned * rate;
        }
        turned = turned * turn;
        (before, rate_before) = (now, rate_now);
        let way = turned * gathered(zero, |i| strands[i].edges[j].way().into());
        x += way;
        v += spin.cross(way);
        for (i, track) in tracks.iter_mut().enumerate() {
            track.push((of_lane(x, i), of_lane(v, i)));
        }
    }
}

/// A vector of every lane.
#[inline(always)]
fn gathered<F: Real>(zero: F, of: impl Fn(usize) -> [f64; 3]) -> V3<F> {
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
fn everywhere<F: Real>(zero: F, m: &Matrix3<f64>) -> M3<F> {
    M3([0, 1, 2].map(|column| V3([0, 1, 2].map(|row| zero.same(m[(row, column)])))))
}

#[inline(always)]
fn of_lane<F: Real>(v: V3<F>, i: usize) -> Vector3<f64> {
    Vector3::new(v.0[0].lane(i), v.0[1].lane(i), v.0[2].lane(i))
}
