//! Divisive clustering: the cluster with the largest scatter is bisected until there are enough.
//!
//! A bisection splits at the mean along the principal direction (Boley 1998, "Principal direction divisive
//! partitioning") and is refined by Lloyd's iteration with two centres. There is no random start, and sums
//! run over fixed blocks in a fixed order, so that the clusters do not depend on the number of threads or the
//! processor. O(n log(clusters)) for balanced clusters.

use super::features::{Features, distance_squared, project};
use rayon::prelude::*;
use std::cmp::Ordering;
use std::collections::BinaryHeap;

/// Strands per task; fixed, so that rounding does not depend on the number of threads.
const BLOCK: usize = 512;
/// Power iterations for the principal direction; Lloyd's iteration corrects an approximate one.
const POWER_ITERATIONS: usize = 12;
/// Most iterations of Lloyd's algorithm.
const LLOYD_ITERATIONS: usize = 24;

/// A set of strands.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Cluster {
    /// Indices of the strands, ascending.
    pub(super) members: Vec<u32>,
    /// Weighted mean of their features.
    pub(super) mean: Vec<f64>,
    /// Weighted sum of squared distances from the mean.
    scatter: f64,
}

/// The features and weights of all strands.
#[derive(Clone, Copy)]
pub(super) struct Space<'a> {
    pub(super) features: &'a Features,
    /// Positive weight of each strand.
    pub(super) weight: &'a [f64],
}

/// Divides `sets` into at least `target` clusters of at most `most` strands each. Returns the clusters of
/// each set, ordered by their first member.
pub(super) fn divide(space: Space, sets: &[Vec<u32>], target: usize, most: usize) -> Vec<Vec<Cluster>> {
    let mut queue: BinaryHeap<Ranked> = sets
        .iter()
        .enumerate()
        .filter(|(_, set)| !set.is_empty())
        .map(|(origin, set)| Ranked { cluster: space.cluster(set.clone()), origin, most })
        .collect();
    let mut done: Vec<Ranked> = Vec::new();
    while let Some(top) = queue.pop() {
        let enough = queue.len() + done.len() + 1 >= target;
        if top.cluster.members.len() == 1 || (enough && top.cluster.members.len() <= most) {
            done.push(top);
            continue;
        }
        for members in space.bisect(&top.cluster) {
            queue.push(Ranked { cluster: space.cluster(members), origin: top.origin, most });
        }
    }
    let mut out = vec![Vec::new(); sets.len()];
    done.sort_by_key(|r| r.cluster.members[0]);
    done.into_iter().for_each(|r| out[r.origin].push(r.cluster));
    out
}

/// The member of a cluster nearest to its mean: approximately its medoid, in O(n).
pub(super) fn medoid(space: Space, cluster: &Cluster) -> u32 {
    let distance = |i: u32| distance_squared(space.features.row(i as usize), &cluster.mean);
    cluster
        .members
        .iter()
        .copied()
        .min_by(|&a, &b| distance(a).total_cmp(&distance(b)))
        .expect("a cluster has members")
}

/// A queued cluster. Clusters over the size limit come first, then those with the largest scatter.
struct Ranked {
    cluster: Cluster,
    /// Index of the set that it is part of.
    origin: usize,
    most: usize,
}

impl Ord for Ranked {
    fn cmp(&self, other: &Self) -> Ordering {
        let over = |r: &Self| r.cluster.members.len() > r.most;
        over(self)
            .cmp(&over(other))
            .then(self.cluster.scatter.total_cmp(&other.cluster.scatter))
            .then(other.cluster.members[0].cmp(&self.cluster.members[0]))
    }
}
impl PartialOrd for Ranked {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}
impl PartialEq for Ranked {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other) == Ordering::Equal
    }
}
impl Eq for Ranked {}

impl Space<'_> {
    fn row(&self, i: u32) -> &[f64] {
        self.features.row(i as usize)
    }

    /// Sums over `members`, block by block; `add` adds the term of a member.
    fn sum(&self, members: &[u32], size: usize, add: impl Fn(u32, &mut [f64]) + Sync) -> Vec<f64> {
        let block = |chunk: &[u32]| {
            let mut sum = vec![0.0; size];
            chunk.iter().for_each(|&i| add(i, &mut sum));
            sum
        };
        let partial: Vec<Vec<f64>> = members.par_chunks(BLOCK).map(block).collect();
        partial
            .into_iter()
            .reduce(|mut a, b| {
                a.iter_mut().zip(b).for_each(|(x, y)| *x += y);
                a
            })
            .unwrap_or_else(|| vec![0.0; size])
    }

    fn mean(&self, members: &[u32]) -> Vec<f64> {
        let dim = self.features.dim;
        let mut sum = self.sum(members, dim + 1, |i, sum| {
            let w = self.weight[i as usize];
            self.row(i).iter().zip(sum.iter_mut()).for_each(|(x, s)| *s += w * x);
            sum[dim] += w;
        });
        let total = sum.pop().unwrap_or(1.0);
        sum.iter_mut().for_each(|x| *x /= total);
        sum
    }

    fn cluster(&self, members: Vec<u32>) -> Cluster {
        let mean = self.mean(&members);
        let scatter = self
            .sum(&members, 1, |i, s| s[0] += self.weight[i as usize] * distance_squared(self.row(i), &mean))
            [0];
        Cluster { members, mean, scatter }
    }

    /// Splits a cluster into two sets, neither empty.
    fn bisect(&self, cluster: &Cluster) -> [Vec<u32>; 2] {
        let members = &cluster.members;
        let axis = self.principal_direction(cluster);
        let split_at =
            |origin: &[f64], axis: &[f64]| partition(members, |i| project(self.row(i), origin, axis) > 0.0);
        let mut halves = split_at(&cluster.mean, &axis);
        for _ in 0..LLOYD_ITERATIONS {
            if halves.iter().any(Vec::is_empty) {
                // Equal strands: any split will do.
                let middle = members.len() / 2;
                return [members[..middle].to_vec(), members[middle..].to_vec()];
            }
            // The points nearer to the second mean lie beyond the midpoint of the two.
            let [a, b] = halves.each_ref().map(|half| self.mean(half));
            let (midpoint, axis): (Vec<_>, Vec<_>) =
                a.iter().zip(&b).map(|(a, b)| (0.5 * (a + b), b - a)).unzip();
            let refined = split_at(&midpoint, &axis);
            if refined == halves || refined.iter().any(Vec::is_empty) {
                break;
            }
            halves = refined;
        }
        halves
    }

    /// Direction of the largest scatter, not normalised: power iteration, started at the member farthest from
    /// the mean.
    fn principal_direction(&self, cluster: &Cluster) -> Vec<f64> {
        let from_mean = |i: u32| self.row(i).iter().zip(&cluster.mean).map(|(x, m)| x - m);
        let distance = |i: u32| distance_squared(self.row(i), &cluster.mean);
        let farthest = cluster.members.iter().copied().max_by(|&a, &b| distance(a).total_cmp(&distance(b)));
        let mut axis: Vec<f64> = farthest.map(|i| from_mean(i).collect()).unwrap_or_default();
        for _ in 0..POWER_ITERATIONS {
            let norm = axis.iter().map(|x| x * x).sum::<f64>().sqrt();
            if norm == 0.0 {
                break;
            }
            axis.iter_mut().for_each(|x| *x /= norm);
            axis = self.sum(&cluster.members, self.features.dim, |i, sum| {
                let component = project(self.row(i), &cluster.mean, &axis) * self.weight[i as usize];
                from_mean(i).zip(sum.iter_mut()).for_each(|(x, s)| *s += component * x);
            });
        }
        axis
    }
}

/// Members for which `second` is false, then those for which it is true; in order.
fn partition(members: &[u32], second: impl Fn(u32) -> bool + Sync) -> [Vec<u32>; 2] {
    let sides: Vec<bool> = members.par_iter().with_min_len(BLOCK).map(|&i| second(i)).collect();
    let pick =
        |side: bool| members.iter().zip(&sides).filter(|(_, s)| **s == side).map(|(i, _)| *i).collect();
    [pick(false), pick(true)]
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Four groups of ten points around the corners of a quadrilateral.
    fn four_groups() -> Features {
        let corners = [(0.0, 0.0), (1.0, 0.0), (0.0, 5.0), (6.0, 5.0)];
        let rows = (0..40).flat_map(|i| {
            let (x, y) = corners[i % 4];
            [x + 0.01 * (i / 4) as f64, y]
        });
        Features { dim: 2, rows: rows.collect() }
    }

    #[test]
    fn separate_groups_become_clusters() {
        let features = four_groups();
        let space = Space { features: &features, weight: &[1.0; 40] };
        let all = vec![(0..40).collect()];
        let found = &divide(space, &all, 4, usize::MAX)[0];
        assert_eq!(found.len(), 4);
        for (k, cluster) in found.iter().enumerate() {
            assert!(cluster.members.iter().all(|i| *i as usize % 4 == k), "{cluster:?}");
            assert!((medoid(space, cluster) as usize / 4).abs_diff(5) <= 1);
        }
    }

    #[test]
    fn identical_strands_are_divided_down_to_the_size_limit() {
        let features = Features { dim: 2, rows: vec![0.5; 20] };
        let space = Space { features: &features, weight: &[1.0; 10] };
        let found = &divide(space, &[(0..10).collect()], 1, 3)[0];
        assert!(found.iter().all(|c| (1..=3).contains(&c.members.len())));
        assert_eq!(found.iter().map(|c| c.members.len()).sum::<usize>(), 10);
    }

    #[test]
    fn clusters_do_not_depend_on_the_number_of_threads() {
        let rows =
            (0..6000).map(|i| (f64::from(i) * 0.618_034).fract() + (f64::from(i) * 0.01).sin()).collect();
        let features = Features { dim: 3, rows };
        let weight = vec![1.0; 2000];
        let run = |threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            let space = Space { features: &features, weight: &weight };
            pool.install(|| divide(space, &[(0..2000).collect()], 40, usize::MAX))
        };
        assert_eq!(run(1), run(3));
    }

    proptest! {
        #[test]
        fn every_strand_is_in_exactly_one_cluster(
            rows in prop::collection::vec(-1.0f64..1.0, 60), target in 1usize..40, most in 1usize..9,
        ) {
            let features = Features { dim: 2, rows };
            let weight = vec![1.0; 30];
            let sets = [(0..12).collect(), (12..30).collect()];
            let found = divide(Space { features: &features, weight: &weight }, &sets, target, most);
            for (set, clusters) in sets.iter().zip(&found) {
                let mut members: Vec<u32> = clusters.iter().flat_map(|c| c.members.clone()).collect();
                members.sort_unstable();
                prop_assert_eq!(&members, set);
                prop_assert!(clusters.iter().all(|c| !c.members.is_empty() && c.members.len() <= most));
            }
            let count: usize = found.iter().map(Vec::len).sum();
            prop_assert!(count >= target.min(30));
        }
    }
}
