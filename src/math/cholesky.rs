//! Cholesky factorisation in place, in a fixed order of operations, of matrices whose unknowns stand on the stems of a tree.
//!
//! Unknowns on different branches of a rod are coupled only through what is upstream of both. Eliminated from the tips to the root,
//! H = LᵀL, they fill in nothing (Featherstone 2008, §6.5), and a right-hand side that only the unknowns upstream of some place enter
//! stays so. A rod without branches is one stem, and its matrix dense.
//!
//! For the few dozen unknowns of a rod. A library kernel would pick its instructions at run time, and the
//! bits of a bake would then depend on the machine that ran it.

use super::lanes::{Mask, Real};

/// Unknowns that follow each other without a branch in between.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Stem {
    /// The first of them.
    pub first: usize,
    /// How many they are.
    pub len: usize,
    /// Stem that it grows from; one before it.
    pub parent: Option<usize>,
    /// Number of unknowns upstream of the first.
    pub depth: usize,
}

/// How the unknowns of a system branch, and with them the layout of its matrix.
///
/// Row `a` begins at `a · width`; its entry `j` couples the unknown with the one upstream of it, or itself, that has depth `j`. For one
/// stem that is the lower triangle, row by row. The last place of a row is [`factor`]'s own.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Branches {
    stems: Vec<Stem>,
    width: usize,
}

impl Branches {
    /// Stems given by parent and number of unknowns; parents before children.
    pub fn new(stems: impl IntoIterator<Item = (Option<usize>, usize)>) -> Self {
        let mut out: Vec<Stem> = Vec::new();
        let mut first = 0;
        for (parent, len) in stems {
            let depth = parent.map_or(0, |p| out[p].depth + out[p].len);
            out.push(Stem { first, len, parent, depth });
            first += len;
        }
        let width = out.iter().map(|s| s.depth + s.len).max().unwrap_or(0) + 1;
        Branches { stems: out, width }
    }

    /// The stems, in the order of their unknowns.
    #[inline(always)]
    pub fn stems(&self) -> &[Stem] {
        &self.stems
    }

    /// Length of a row of the matrix.
    #[inline(always)]
    pub fn width(&self) -> usize {
        self.width
    }

    /// Number of unknowns.
    #[inline(always)]
    pub fn unknowns(&self) -> usize {
        self.stems.last().map_or(0, |s| s.first + s.len)
    }

    /// What is upstream of the unknown `a` of stem `stem`, by runs of unknowns: the first, its depth, and how many.
    #[inline(always)]
    pub fn upstream(&self, stem: usize, a: usize) -> impl Iterator<Item = (usize, usize, usize)> + '_ {
        let own = &self.stems[stem];
        let mut next = own.parent;
        let rest = std::iter::from_fn(move || {
            let s = &self.stems[next?];
            next = s.parent;
            Some((s.first, s.depth, s.len))
        });
        std::iter::once((own.first, own.depth, a - own.first)).chain(rest)
    }

    /// Every entry of the matrix: its two unknowns, the one upstream second, and its place.
    pub fn entries(&self) -> impl Iterator<Item = (usize, usize, usize)> + '_ {
        self.stems.iter().enumerate().flat_map(move |(s, stem)| {
            (stem.first..stem.first + stem.len).flat_map(move |a| {
                let runs = self
                    .upstream(s, a)
                    .flat_map(|(first, depth, len)| (0..len).map(move |i| (first + i, depth + i)));
                let own = std::iter::once((a, stem.depth + a - stem.first));
                runs.chain(own).map(move |(b, j)| (a, b, a * self.width + j))
            })
        })
    }
}

/// Factors the matrix `a` as LᵀL, in place (the diagonal of L is stored inverted). Returns the lanes where `a` is positive definite; it is
/// spoiled in the others.
#[inline(always)]
pub fn factor<F: Real>(a: &mut [F], branches: &Branches) -> Mask {
    let w = branches.width;
    debug_assert_eq!(a.len(), branches.unknowns() * w);
    for stem in &branches.stems {
        for i in 0..stem.len {
            let row = &mut a[(stem.first + i) * w..][..w];
            row[w - 1] = row[stem.depth + i];
        }
    }
    let mut positive = F::ALL;
    for (s, stem) in branches.stems.iter().enumerate().rev() {
        for i in (0..stem.len).rev() {
            let (above, row) = a.split_at_mut((stem.first + i) * w);
            let d = stem.depth + i;
            // None for NaN too.
            let least = row[w - 1].abs() * 1e-14;
            positive &= least.below(row[d]);
            let inverse = row[d].same(1.0) / row[d].sqrt();
            row[d] = inverse;
            for x in &mut row[..d] {
                *x = *x * inverse;
            }
            let row = &row[..d];
            for (first, depth, len) in branches.upstream(s, stem.first + i) {
                for (j, other) in above[first * w..].chunks_exact_mut(w).take(len).enumerate() {
                    let share = row[depth + j];
                    for (x, l) in other[..=depth + j].iter_mut().zip(row) {
                        *x -= share * *l;
                    }
                }
            }
        }
    }
    positive
}

/// Solves LᵀL x = b in place, with `a` from [`factor`].
#[inline(always)]
pub fn solve<F: Real>(a: &[F], branches: &Branches, b: &mut [F]) {
    solve_inward(a, branches, b);
    solve_outward(a, branches, b);
}

/// Solves Lᵀ y = b in place, from the tips to the root, with `a` from [`factor`]. Where b is nought for all but what is upstream of an
/// unknown, so is y.
#[inline(always)]
pub fn solve_inward<F: Real>(a: &[F], branches: &Branches, b: &mut [F]) {
    for (s, stem) in branches.stems.iter().enumerate().rev() {
        for k in (stem.first..stem.first + stem.len).rev() {
            let row = &a[k * branches.width..][..branches.width];
            let y = b[k] * row[stem.depth + k - stem.first];
            b[k] = y;
            for (first, depth, len) in branches.upstream(s, k) {
                for (b, l) in b[first..first + len].iter_mut().zip(&row[depth..]) {
                    *b -= *l * y;
                }
            }
        }
    }
}

/// Solves L x = y in place, from the root to the tips, with `a` from [`factor`].
#[inline(always)]
pub fn solve_outward<F: Real>(a: &[F], branches: &Branches, b: &mut [F]) {
    for (s, stem) in branches.stems.iter().enumerate() {
        for k in stem.first..stem.first + stem.len {
            let row = &a[k * branches.width..][..branches.width];
            let mut x = b[k];
            for (first, depth, len) in branches.upstream(s, k) {
                x = less_dot(x, &row[depth..depth + len], &b[first..first + len]);
            }
            b[k] = x * row[stem.depth + k - stem.first];
        }
    }
}

/// a · b.
pub fn dot(a: &[f64], b: &[f64]) -> f64 {
    -less_dot(0.0, a, b)
}

/// x − a · b, summed in four fixed chains.
#[inline(always)]
pub fn less_dot<F: Real>(x: F, a: &[F], b: &[F]) -> F {
    let mut chain = [x.same(0.0); 4];
    let (ca, cb) = (a.chunks_exact(4), b.chunks_exact(4));
    let mut rest = x;
    for (a, b) in ca.remainder().iter().zip(cb.remainder()) {
        rest -= *a * *b;
    }
    for (a, b) in ca.zip(cb) {
        for i in 0..4 {
            chain[i] += a[i] * b[i];
        }
    }
    rest - ((chain[0] + chain[1]) + (chain[2] + chain[3]))
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{DMatrix, DVector};

    /// A positive definite matrix that couples only what `branches` couples, as a whole and laid out.
    fn matrix(branches: &Branches) -> (DMatrix<f64>, Vec<f64>) {
        let n = branches.unknowns();
        let mut full = DMatrix::zeros(n, n);
        let mut laid = vec![0.0; n * branches.width()];
        for (a, b, place) in branches.entries() {
            let x = if a == b { n as f64 } else { ((a * 31 + b * 17) as f64).sin() };
            (full[(a, b)], full[(b, a)], laid[place]) = (x, x, x);
        }
        (full, laid)
    }

    #[test]
    fn solves_what_nalgebra_solves_on_one_stem_and_on_many() {
        let forks =
            [(None, 4), (Some(0), 3), (Some(1), 6), (Some(1), 2), (Some(0), 5), (Some(4), 0), (Some(5), 3)];
        let one = [1, 3, 4, 21, 60].map(|n| Branches::new([(None, n)]));
        for branches in one.into_iter().chain([Branches::new(forks)]) {
            let (full, mut a) = matrix(&branches);
            let b = DVector::from_fn(branches.unknowns(), |i, _| (i as f64).cos());
            let mut x = b.as_slice().to_vec();
            assert_eq!(factor(&mut a, &branches), 1);
            let mut half = x.clone();
            solve_inward(&a, &branches, &mut half);
            solve(&a, &branches, &mut x);
            let x = DVector::from_vec(x);
            assert!((&full * &x - &b).norm() < 1e-9);
            assert!((dot(&half, &half) - b.dot(&x)).abs() < 1e-9, "half of the way is half of the form");
        }
    }

    #[test]
    fn what_enters_upstream_of_a_place_stays_there() {
        let branches = Branches::new([(None, 3), (Some(0), 2), (Some(0), 4)]);
        let (_, mut a) = matrix(&branches);
        factor(&mut a, &branches);
        let mut b = [1.0, 1.0, 1.0, 0.0, 0.0, 1.0, 1.0, 0.0, 0.0];
        solve_inward(&a, &branches, &mut b);
        assert!(b.iter().enumerate().all(|(i, x)| (*x == 0.0) == [3, 4, 7, 8].contains(&i)), "{b:?}");
    }

    #[test]
    fn refuses_indefinite_and_nan() {
        assert_eq!(factor(&mut [1.0, 0.0, 0.0, 2.0, 1.0, 0.0], &Branches::new([(None, 2)])), 0);
        assert_eq!(factor(&mut [f64::NAN, 0.0], &Branches::new([(None, 1)])), 0);
    }
}
