//! Broad phase: pairs of segments whose swept bounding boxes intersect.

use super::strands::{MovingStrands, SegmentPair};
use crate::geometry::Bounds;
use nalgebra::Vector3;
use rayon::prelude::*;

/// Edge of a cell over the mean extent of the boxes.
const CELL: f64 = 1.5;

/// Maximum number of cells along an axis that a box may span; beyond it the cells are enlarged.
const SPAN: f64 = 8.0;

/// Largest cell coordinate: it has 21 bits.
const LAST_CELL: u64 = (1 << 21) - 1;

/// A uniform grid of cubic cells.
#[derive(Clone, Copy)]
struct Grid {
    /// Lower corner, m.
    corner: Vector3<f64>,
    /// Edge of a cell, m.
    cell: f64,
}

impl Grid {
    /// A grid over `boxes`, its cells somewhat larger than they are.
    fn new(boxes: &[Bounds]) -> Self {
        let all = Bounds::around(boxes.iter().flat_map(|b| [&b.min, &b.max]), 0.0);
        let extents = || boxes.iter().map(|b| (b.max - b.min).max());
        let mean = extents().sum::<f64>() / boxes.len() as f64;
        Grid { corner: all.min, cell: (CELL * mean).max(extents().fold(0.0, f64::max) / SPAN) }
    }

    fn coordinates(&self, x: &Vector3<f64>) -> Vector3<u64> {
        ((x - self.corner) / self.cell).map(|c| (c as u64).min(LAST_CELL))
    }

    fn key(c: [u64; 3]) -> u64 {
        (c[0] << 42) | (c[1] << 21) | c[2]
    }

    /// Key of the cell that contains `x`.
    fn cell_of(&self, x: &Vector3<f64>) -> u64 {
        let c = self.coordinates(x);
        Self::key([c.x, c.y, c.z])
    }

    /// Keys of the cells that a box intersects.
    fn cells_of(&self, b: &Bounds) -> impl Iterator<Item = u64> + use<> {
        let (lo, hi) = (self.coordinates(&b.min), self.coordinates(&b.max));
        let columns = (lo.x..=hi.x).flat_map(move |x| (lo.y..=hi.y).map(move |y| [x, y]));
        columns.flat_map(move |[x, y]| (lo.z..=hi.z).map(move |z| Self::key([x, y, z])))
    }
}

impl MovingStrands<'_> {
    /// Pairs of segments that may meet and come within the sum of the `reach`, m, of their strands of each other
    /// during the sub-step, in ascending order: those whose swept bounding boxes, grown by it, intersect. Only
    /// pairs with a strand that is `wanted`.
    ///
    /// Uses a uniform grid. A pair is reported once, by the cell of the lower corner of the boxes'
    /// intersection.
    pub fn broad_phase(
        &self,
        reach: impl Fn(u32) -> f64 + Sync,
        wanted: impl Fn(u32) -> bool + Sync,
    ) -> Vec<SegmentPair> {
        let segments: Vec<u32> =
            (0..self.strand.len()).filter(|&k| self.is_segment(k)).map(|k| k as u32).collect();
        if segments.is_empty() {
            return Vec::new();
        }
        let box_of = |&k: &u32| self.bounds(k as usize, reach(self.strand[k as usize]));
        let boxes: Vec<Bounds> = segments.par_iter().map(box_of).collect();
        let is_wanted = |i: u32| wanted(self.strand[segments[i as usize] as usize]);
        let grid = Grid::new(&boxes);
        let cells_of = |(i, b): (usize, &Bounds)| grid.cells_of(b).map(move |cell| (cell, i as u32));
        let mut entries: Vec<(u64, u32)> = boxes.par_iter().enumerate().flat_map_iter(cells_of).collect();
        entries.par_sort_unstable();
        let mut found: Vec<SegmentPair> = entries
            .par_chunk_by(|a, b| a.0 == b.0)
            .filter(|cell| cell.iter().any(|&(_, i)| is_wanted(i)))
            .flat_map_iter(|cell| {
                let (boxes, segments, is_wanted) = (&boxes, &segments, &is_wanted);
                cell.iter().enumerate().flat_map(move |(i, &(here, a))| {
                    cell[i + 1..].iter().filter_map(move |&(_, b)| {
                        let (k, l) = (segments[a as usize], segments[b as usize]);
                        let (p, q) = (&boxes[a as usize], &boxes[b as usize]);
                        let reported_here = || grid.cell_of(&p.min.sup(&q.min)) == here;
                        let may_meet = || (is_wanted(a) || is_wanted(b)) && self.may_meet(k, l);
                        (p.overlaps(q) && may_meet() && reported_here()).then_some((k, l))
                    })
                })
            })
            .collect();
        found.par_sort_unstable();
        found
    }
}
