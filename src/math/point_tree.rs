//! A k-d tree of points: the nearest ones are found in logarithmic time.

use nalgebra::Vector3;

/// Most points of a leaf.
const LEAF: usize = 8;

/// Points in space in a balanced tree; results do not depend on how it is built.
#[derive(Debug, Clone)]
pub struct PointTree {
    points: Vec<Vector3<f64>>,
    /// Indices of the points. The middle one of a range divides it along the axis of its greatest extent.
    order: Vec<u32>,
    /// That axis, for each middle.
    axis: Vec<u8>,
}

impl PointTree {
    /// The tree of `points`, m.
    pub fn new(points: Vec<Vector3<f64>>) -> Self {
        let mut order: Vec<u32> = (0..points.len() as u32).collect();
        let mut axis = vec![0; points.len()];
        divide(&points, &mut order, &mut axis);
        PointTree { points, order, axis }
    }

    /// The points.
    pub fn points(&self) -> &[Vector3<f64>] {
        &self.points
    }

    /// Calls `visit` with the index of each point that is at most as far from `x` as a bound, and with its
    /// squared distance, m². The bound on the squared distance is `within` at first, then what `visit`
    /// returned last. Near points tend to come first.
    pub fn visit(&self, x: &Vector3<f64>, within: f64, mut visit: impl FnMut(usize, f64) -> f64) {
        let mut bound = within;
        self.descend(x, 0, self.order.len(), &mut bound, &mut visit);
    }

    fn descend(
        &self,
        x: &Vector3<f64>,
        from: usize,
        to: usize,
        bound: &mut f64,
        visit: &mut impl FnMut(usize, f64) -> f64,
    ) {
        let mut look = |at: usize, bound: &mut f64| {
            let i = self.order[at] as usize;
            let squared = (self.points[i] - x).norm_squared();
            if squared <= *bound {
                *bound = visit(i, squared);
            }
        };
        if to - from <= LEAF {
            (from..to).for_each(|at| look(at, bound));
            return;
        }
        let middle = from.midpoint(to);
        look(middle, bound);
        let axis = usize::from(self.axis[middle]);
        let beyond = x[axis] - self.points[self.order[middle] as usize][axis];
        let (lower, upper) = ((from, middle), (middle + 1, to));
        let (near, far) = if beyond < 0.0 { (lower, upper) } else { (upper, lower) };
        self.descend(x, near.0, near.1, bound, visit);
        if beyond * beyond <= *bound {
            self.descend(x, far.0, far.1, bound, visit);
        }
    }

    /// Of the points for which `cost` is a number, those `count` of the least, ascending, with their costs; of
    /// equal ones the first. `cost` is at least the squared distance, m², which it is given.
    pub fn least(
        &self,
        x: &Vector3<f64>,
        count: usize,
        cost: impl Fn(usize, f64) -> Option<f64>,
    ) -> Vec<(f64, usize)> {
        let mut best: Vec<(f64, usize)> = Vec::with_capacity(count + 1);
        if count == 0 {
            return best;
        }
        self.visit(x, f64::INFINITY, |i, squared| {
            if let Some(cost) = cost(i, squared) {
                let at = best.partition_point(|found| *found < (cost, i));
                if at < count {
                    best.insert(at, (cost, i));
                    best.truncate(count);
                }
            }
            if best.len() < count { f64::INFINITY } else { best[count - 1].0 }
        });
        best
    }
}

/// Orders the points of a range around its middle, and those of both halves.
fn divide(points: &[Vector3<f64>], order: &mut [u32], axis: &mut [u8]) {
    if order.len() <= LEAF {
        return;
    }
    let all = || order.iter().map(|&i| points[i as usize]);
    let low = all().fold(Vector3::repeat(f64::INFINITY), |a, x| a.inf(&x));
    let high = all().fold(Vector3::repeat(f64::NEG_INFINITY), |a, x| a.sup(&x));
    let along = (high - low).imax();
    let middle = 0usize.midpoint(order.len());
    order.select_nth_unstable_by(middle, |a, b| {
        points[*a as usize][along].total_cmp(&points[*b as usize][along]).then(a.cmp(b))
    });
    axis[middle] = along as u8;
    let ((lower, upper), (lower_axis, upper_axis)) = (order.split_at_mut(middle), axis.split_at_mut(middle));
    divide(points, lower, lower_axis);
    divide(points, &mut upper[1..], &mut upper_axis[1..]);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::random::Random;

    #[test]
    fn the_nearest_points_are_those_of_a_full_search() {
        let mut random = Random::new(3);
        // Coordinates of few digits coincide.
        let mut vector = || random.vector().map(|x| (x * 8.0).round() / 8.0);
        let points: Vec<_> = (0..500).map(|_| vector()).collect();
        let tree = PointTree::new(points.clone());
        for _ in 0..200 {
            let x = vector();
            let squared = |i: usize| (points[i] - x).norm_squared();
            let odd = |i: &usize| i % 2 == 1;
            let mut expected: Vec<_> = (0..500).filter(odd).map(|i| (squared(i), i)).collect();
            expected.sort_by(|a, b| a.partial_cmp(b).unwrap());
            assert_eq!(tree.least(&x, 5, |i, squared| odd(&i).then_some(squared)), expected[..5]);
            let mut found = Vec::new();
            tree.visit(&x, 0.25, |i, _| {
                found.push(i);
                0.25
            });
            found.sort_unstable();
            assert_eq!(found, (0..500).filter(|i| squared(*i) <= 0.25).collect::<Vec<_>>());
        }
        assert_eq!(PointTree::new(Vec::new()).least(&Vector3::zeros(), 1, |_, d| Some(d)), []);
    }
}
