//! How densely strands lie, compared with the pose of the groom.

use crate::cache::CurveSet;
use nalgebra::Vector3;
use std::collections::BTreeMap;

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
        let mut cells: BTreeMap<[i32; 3], f32> = BTreeMap::new();
        for (_, middle, volume) in self.segments(points) {
            for (cell, share) in self.corners(&middle) {
                *cells.entry(cell).or_default() += share * volume;
            }
        }
        let at = |p: &Vector3<f32>| -> f32 {
            self.corners(p).iter().map(|(cell, share)| share * cells.get(cell).unwrap_or(&0.0)).sum()
        };
        points.iter().map(|p| at(p) / self.dense).collect()
    }

    /// First point of each segment of the curves, its middle, and its volume to a constant factor.
    fn segments(&self, points: &[Vector3<f32>]) -> impl Iterator<Item = (usize, Vector3<f32>, f32)> {
        let starts = self.set.counts.iter().scan(0, |end, n| {
            let start = *end;
            *end += *n as usize;
            Some(start..(*end).max(start + 1) - 1)
        });
        starts.flatten().map(|i| {
            let (a, b) = (points[i], points[i + 1]);
            let width = 0.5 * (self.set.widths[i] + self.set.widths[i + 1]);
            (i, (a + b) * 0.5, (b - a).norm() * width * width)
        })
    }

    /// The eight cells around a point, with their trilinear weights.
    fn corners(&self, p: &Vector3<f32>) -> [([i32; 3], f32); 8] {
        let u = p / self.cell;
        let base = u.map(f32::floor);
        let f = u - base;
        std::array::from_fn(|i| {
            let bit = |c: usize| (i >> c & 1) as i32;
            let part = |c: usize| if bit(c) == 1 { f[c] } else { 1.0 - f[c] };
            (std::array::from_fn(|c| base[c] as i32 + bit(c)), part(0) * part(1) * part(2))
        })
    }
}
