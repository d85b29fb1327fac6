//! Places roots on a surface, evenly by area or by density.

use super::surface::{Place, Surface};
use crate::math::point_tree::PointTree;
use crate::math::random;
use nalgebra::Vector3;

/// Candidates for each place that is chosen among them.
const CANDIDATES: usize = 5;

/// Steps of the sequence R2 (M. Roberts, "The unreasonable effectiveness of quasirandom sequences", 2018): the
/// inverse of the plastic number, and its square.
const R2: [f64; 2] = [0.754_877_666_246_692_7, 0.569_840_290_998_053_2];

/// `count` places, on each triangle as many as its share of the sum of the `weights`, up to rounding.
///
/// Neighbouring triangles follow each other along a Morton curve, so that small ones share their places
/// evenly. Within a triangle places follow the sequence R2.
pub(super) fn stratified(surface: &Surface, weights: &[f64], count: usize, seed: u64) -> Vec<Place> {
    let order = along_morton_curve(surface);
    let mut ends = Vec::with_capacity(order.len());
    let mut sum = 0.0;
    for &t in &order {
        sum += weights[t as usize];
        ends.push(sum);
    }
    let shift = [0, 1].map(|k| random::unit(seed, k));
    let place = |i: usize| {
        let at = sum * (i as f64 + 0.5) / count as f64;
        let k = ends.partition_point(|end| *end <= at).min(order.len() - 1);
        let [u, v] = [0, 1].map(|k| (shift[k] + i as f64 * R2[k]).fract());
        let (u, v) = if u + v > 1.0 { (1.0 - u, 1.0 - v) } else { (u, v) };
        Place { triangle: order[k], shares: [1.0 - u - v, u, v] }
    };
    (0..count).map(place).collect()
}

/// Triangles in the order of a Morton curve through their centres.
fn along_morton_curve(surface: &Surface) -> Vec<u32> {
    let points = surface.vertices();
    let low = points.iter().fold(Vector3::repeat(f64::INFINITY), |a, x| a.inf(x));
    let high = points.iter().fold(Vector3::repeat(f64::NEG_INFINITY), |a, x| a.sup(x));
    let scale = f64::from(1 << 20) / (high - low).amax();
    let code = |t: &u32| {
        let centre: Vector3<f64> = surface.corners(*t).iter().map(|v| surface.vertex(*v)).sum();
        let cell = (centre / 3.0 - low) * scale;
        cell.iter().zip(0..).map(|(x, axis)| spread(*x as u64) << axis).fold(0, |a, b| a | b)
    };
    let mut order: Vec<u32> = (0..surface.triangles as u32).collect();
    order.sort_by_cached_key(|t| (code(t), *t));
    order
}

/// The lowest 21 bits of `x`, each followed by two zeros.
fn spread(x: u64) -> u64 {
    let steps = [
        (32, 0x1f_0000_0000_ffff),
        (16, 0x1f_0000_ff00_00ff),
        (8, 0x100f_00f0_0f00_f00f),
        (4, 0x10c3_0c30_c30c_30c3),
        (2, 0x1249_2492_4924_9249),
    ];
    steps.iter().fold(x & 0x1f_ffff, |x, (shift, mask)| (x | x << shift) & mask)
}

/// `count` places that keep their distance from each other: of five times as many candidates those remain
/// that weighted sample elimination leaves (C. Yuksel, "Sample elimination for generating Poisson disk sample
/// sets", 2015). `weights` are proportional to the area of each triangle that counts.
pub(super) fn blue_noise(surface: &Surface, weights: &[f64], count: usize, seed: u64) -> Vec<Place> {
    let candidates = stratified(surface, weights, CANDIDATES * count, seed);
    let area: f64 = 0.5
        * (0..surface.triangles)
            .filter(|t| weights[*t] > 0.0)
            .map(|t| surface.doubled_area(t as u32).norm())
            .sum::<f64>();
    let radius = (area / (2.0 * 3f64.sqrt() * count as f64)).sqrt();
    let least = radius * 0.65 * (1.0 - (CANDIDATES as f64).powf(-1.5));
    let tree = PointTree::new(candidates.iter().map(|place| surface.point(place)).collect());
    let normals: Vec<_> = candidates.iter().map(|place| surface.doubled_area(place.triangle)).collect();
    let neighbours = |i: usize, mut each: &mut dyn FnMut(usize, f64)| {
        let within = 4.0 * radius * radius;
        let each = &mut each;
        tree.visit(&tree.points()[i], within, |j, squared| {
            // Places on both sides of an ear are far from each other.
            if j != i && normals[i].dot(&normals[j]) > 0.0 {
                let near = (squared.sqrt().max(2.0 * least) / (2.0 * radius)).min(1.0);
                each(j, (1.0 - near).powi(8));
            }
            within
        });
    };
    let crowding = |i: usize| {
        let mut sum = 0.0;
        neighbours(i, &mut |_, weight| sum += weight);
        sum
    };
    let mut heap = Heap::new((0..candidates.len()).map(crowding).collect());
    while heap.len() > count {
        let worst = heap.pop();
        neighbours(worst, &mut |j, weight| heap.reduce(j, weight));
    }
    let mut kept = heap.items();
    kept.sort_unstable();
    kept.into_iter().map(|i| candidates[i as usize]).collect()
}

/// A heap of numbered items that gives the one with the greatest value; of several the first.
struct Heap {
    values: Vec<f64>,
    /// The items, each not less than both of its children.
    order: Vec<u32>,
    /// Where each item is in `order`; `u32::MAX` for none.
    place: Vec<u32>,
}

impl Heap {
    fn new(values: Vec<f64>) -> Self {
        let order: Vec<u32> = (0..values.len() as u32).collect();
        let mut heap = Heap { place: order.clone(), order, values };
        (0..heap.len() / 2).rev().for_each(|at| heap.sink(at));
        heap
    }

    fn len(&self) -> usize {
        self.order.len()
    }

    fn items(self) -> Vec<u32> {
        self.order
    }

    /// Whether the item at `a` comes before that at `b`.
    fn before(&self, a: usize, b: usize) -> bool {
        let (i, j) = (self.order[a], self.order[b]);
        self.values[j as usize].total_cmp(&self.values[i as usize]).then(i.cmp(&j)).is_lt()
    }

    fn swap(&mut self, a: usize, b: usize) {
        self.order.swap(a, b);
        self.place[self.order[a] as usize] = a as u32;
        self.place[self.order[b] as usize] = b as u32;
    }

    fn sink(&mut self, mut at: usize) {
        loop {
            let children = [2 * at + 1, 2 * at + 2].into_iter().filter(|child| *child < self.len());
            let first = children.fold(at, |best, child| if self.before(child, best) { child } else { best });
            if first == at {
                return;
            }
            self.swap(at, first);
            at = first;
        }
    }

    fn pop(&mut self) -> usize {
        let last = self.len() - 1;
        self.swap(0, last);
        let item = self.order.pop().unwrap_or(0);
        self.place[item as usize] = u32::MAX;
        self.sink(0);
        item as usize
    }

    /// Takes `by`, which is not negative, from the value of an item; nothing if it is no longer there.
    fn reduce(&mut self, item: usize, by: f64) {
        let at = self.place[item];
        if at != u32::MAX {
            self.values[item] -= by;
            self.sink(at as usize);
        }
    }
}
