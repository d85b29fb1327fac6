//! How densely strands lie, compared with the pose of the groom.

use crate::cache::CurveSet;
use nalgebra::Vector3;
use std::cell::Cell;
use std::collections::HashMap;

/// Side of a cell, m.
const CELL: f64 = 0.01;

/// The density of a set of curves in the pose of the groom.
pub struct Crowding<'a> {
    set: &'a CurveSet,
    /// Side of a cell, scene units.
    cell: f32,
    /// 95th percentile of the density, by volume.
    dense: f32,
}

impl<'a> Crowding<'a> {
    /// Of a set of curves in a scene of this unit.
    pub fn new(set: &'a CurveSet, metres_per_unit: f64) -> Self {
        let mut crowding = Crowding { set, cell: (CELL / metres_per_unit) as f32, dense: 1.0 };
        let rest: Vec<_> = set.rest.iter().map(|p| Vector3::from(*p)).collect();
        let mut volumes = vec![0.0; rest.len()];
        for (i, _, volume) in crowding.segments(&rest) {
            volumes[i] += volume;
        }
        let mut densities: Vec<_> = crowding.relative(&rest).into_iter().zip(volumes).collect();
        densities.sort_by(|a, b| b.0.total_cmp(&a.0));
        let mut above = 0.05 * densities.iter().map(|(_, volume)| volume).sum::<f32>();
        let reached = |(_, volume): &&(f32, f32)| {
            above -= volume;
            above < 0.0
        };
        crowding.dense = densities.iter().find(reached).map_or(1.0, |(density, _)| *density);
        crowding
    }

    /// The density at `points` of the curves, in the rest space of the head, over the 95th percentile in the
    /// pose of the groom.
    pub fn relative(&self, points: &[Vector3<f32>]) -> Vec<f32> {
        self.relative_at(points, 0..points.len())
    }

    /// The same at `places` of the points.
    pub fn relative_at(&self, points: &[Vector3<f32>], places: impl IntoIterator<Item = usize>) -> Vec<f32> {
        let mut grid = Grid::default();
        let finite = |(_, _, volume): &(usize, Vector3<f32>, f32)| volume.is_finite();
        for (_, middle, volume) in self.segments(points).filter(finite) {
            for (cell, share) in corners(&middle, self.cell) {
                grid.add(cell, share * volume);
            }
        }
        let at = |p: &Vector3<f32>| -> f32 {
            corners(p, self.cell).iter().map(|(cell, share)| share * grid.get(*cell)).sum()
        };
        places.into_iter().map(|i| at(&points[i]) / self.dense).collect()
    }

    /// First point of each segment of the curves, its middle, and its volume to a constant factor.
    fn segments(&self, points: &[Vector3<f32>]) -> impl Iterator<Item = (usize, Vector3<f32>, f32)> {
        let starts = self.set.ranges().flat_map(|curve| curve.start..curve.end.saturating_sub(1));
        starts.map(|i| {
            let (a, b) = (points[i], points[i + 1]);
            let width = 0.5 * (self.set.widths[i] + self.set.widths[i + 1]);
            (i, (a + b) * 0.5, (b - a).norm() * width * width)
        })
    }
}

/// Cells of space, of which those are stored that hold something, and those next to them.
#[derive(Default)]
struct Grid {
    /// Blocks of cells, by their place.
    blocks: HashMap<[i32; 3], usize>,
    values: Vec<[f32; BLOCK * BLOCK * BLOCK]>,
    /// The block that was asked for last: neighbours on a curve are mostly in the same.
    last: Cell<Option<([i32; 3], usize)>>,
}

/// Cells along the side of a block.
const BLOCK: usize = 4;

impl Grid {
    /// Adds to a cell.
    fn add(&mut self, cell: [i32; 3], value: f32) {
        let (block, within) = Self::place(cell);
        let at = self.block(block).unwrap_or_else(|| {
            self.values.push([0.0; BLOCK * BLOCK * BLOCK]);
            self.blocks.insert(block, self.values.len() - 1);
            self.values.len() - 1
        });
        self.values[at][within] += value;
    }

    fn get(&self, cell: [i32; 3]) -> f32 {
        let (block, within) = Self::place(cell);
        self.block(block).map_or(0.0, |at| self.values[at][within])
    }

    fn block(&self, block: [i32; 3]) -> Option<usize> {
        if let Some((_, at)) = self.last.get().filter(|(last, _)| *last == block) {
            return Some(at);
        }
        let at = *self.blocks.get(&block)?;
        self.last.set(Some((block, at)));
        Some(at)
    }

    /// The block of a cell, and its place in there.
    fn place(cell: [i32; 3]) -> ([i32; 3], usize) {
        let side = BLOCK as i32;
        let [x, y, z] = cell.map(|c| c.rem_euclid(side) as usize);
        (cell.map(|c| c.div_euclid(side)), (z * BLOCK + y) * BLOCK + x)
    }
}

/// The eight cells of side `side` around a point, with their trilinear weights; zero for what is no point.
fn corners(p: &Vector3<f32>, side: f32) -> [([i32; 3], f32); 8] {
    let u = p / side;
    let base = u.map(f32::floor);
    let f = u - base;
    std::array::from_fn(|i| {
        let bit = |k: usize| (i >> k & 1) as i32;
        let part = |k: usize| if bit(k) == 1 { f[k] } else { 1.0 - f[k] };
        let cell = std::array::from_fn(|k| (base[k] as i32).saturating_add(bit(k)));
        let share = part(0) * part(1) * part(2);
        (cell, if share.is_finite() { share } else { 0.0 })
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// `n` hairs of `POINTS` points, a tuft of two centimetres, whose roots are about `at`.
    fn tuft(n: usize, at: [f32; 3]) -> Vec<[f32; 3]> {
        let place = |i: usize, k: usize| {
            let (turn, out) = (2.4 * i as f32, 0.01 * (i as f32 / n as f32).sqrt());
            [at[0] + out * turn.cos(), at[1] - 0.01 * k as f32, at[2] + out * turn.sin()]
        };
        (0..n * POINTS).map(|i| place(i / POINTS, i % POINTS)).collect()
    }

    const POINTS: usize = 8;

    fn set(rest: Vec<[f32; 3]>) -> CurveSet {
        let (counts, widths) = (vec![POINTS as i32; rest.len() / POINTS], vec![1e-4; rest.len()]);
        CurveSet { counts, widths, rest, ..CurveSet::default() }
    }

    fn relative(set: &CurveSet, points: &[[f32; 3]]) -> Vec<f32> {
        let points: Vec<Vector3<f32>> = points.iter().map(|p| Vector3::from(*p)).collect();
        Crowding::new(set, 1.0).relative(&points)
    }

    #[test]
    fn tufts_are_equally_dense_however_far_apart() {
        // At whole cells, so that both are cut into cells alike.
        for apart in [0.5, 2.5, 40.0] {
            let (here, there) = (tuft(60, [0.0; 3]), tuft(60, [apart, 0.0, 0.0]));
            let both = set([here.clone(), there].concat());
            let found = relative(&both, &both.rest);
            let (first, second) = found.split_at(here.len());
            let off = first.iter().zip(second).map(|(a, b)| (a - b).abs() / a.max(0.1)).fold(0.0, f32::max);
            // Single precision at 40 m is a two-thousandth of a cell.
            assert!(off < 1e-2, "{apart}: {off}");
            assert!(first.iter().all(|d| *d > 0.0) && first.iter().any(|d| *d > 0.9));
        }
    }

    #[test]
    fn a_stray_point_changes_nothing_elsewhere() {
        let set = set(tuft(60, [0.0; 3]));
        let clean = relative(&set, &set.rest);
        for stray in [[900.0, 0.0, 0.0], [0.0, -1e9, 0.0], [1e38, 1e38, -1e38], [f32::NAN, 0.0, 0.0]] {
            let mut points = set.rest.clone();
            // The tip of the last hair, which alone is thinner by its last segment.
            let tip = points.len() - 1;
            points[tip] = stray;
            let found = relative(&set, &points);
            let last: f32 = found[..tip - POINTS].iter().zip(&clean).map(|(a, b)| (a - b).abs()).sum();
            let all: f32 = clean.iter().sum();
            assert!(last < 0.02 * all, "{stray:?}: {last} of {all}");
        }
    }
}
