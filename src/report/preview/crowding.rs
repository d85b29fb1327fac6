//! How densely strands lie, compared with the pose of the groom.

use crate::cache::CurveSet;
use nalgebra::Vector3;

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
        let mut grid = Grid::around(points, self.cell);
        let finite = |(_, _, volume): &(usize, Vector3<f32>, f32)| volume.is_finite();
        for (_, middle, volume) in self.segments(points).filter(finite) {
            for (corner, share) in grid.corners(&middle) {
                if let Some(cell) = corner {
                    grid.values[cell] += share * volume;
                }
            }
        }
        let at = |p: &Vector3<f32>| -> f32 {
            grid.corners(p).iter().filter_map(|(cell, share)| Some(share * grid.values[(*cell)?])).sum()
        };
        places.into_iter().map(|i| at(&points[i]) / self.dense).collect()
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
}

/// Cells over the box of some points.
struct Grid {
    /// Side of a cell, scene units.
    cell: f32,
    /// Lowest cell along each axis.
    low: [i64; 3],
    /// Number of cells along each axis.
    count: [usize; 3],
    values: Vec<f32>,
}

impl Grid {
    /// Most cells along an axis: two metres. What lies beyond has no density.
    const MOST: i64 = 200;

    /// Zero in all cells around the finite ones of `points`.
    fn around(points: &[Vector3<f32>], cell: f32) -> Self {
        let start = (Vector3::repeat(f32::INFINITY), Vector3::repeat(f32::NEG_INFINITY));
        let finite = points.iter().filter(|p| p.iter().all(|x| x.is_finite()));
        let (low, high) = finite.fold(start, |(a, b), p| (a.inf(p), b.sup(p)));
        let [low, high]: [[i64; 3]; 2] = [low, high].map(|p| p.map(|x| (x / cell).floor() as i64).into());
        let count =
            std::array::from_fn(|k| (high[k].saturating_sub(low[k])).clamp(0, Self::MOST) as usize + 2);
        Grid { cell, low, count, values: vec![0.0; count.iter().product()] }
    }

    /// The eight cells around a point, with their trilinear weights; `None` for those outside.
    fn corners(&self, p: &Vector3<f32>) -> [(Option<usize>, f32); 8] {
        let u = p / self.cell;
        let base = u.map(f32::floor);
        let f = u - base;
        std::array::from_fn(|i| {
            let bit = |c: usize| i >> c & 1;
            let part = |c: usize| if bit(c) == 1 { f[c] } else { 1.0 - f[c] };
            let along = |c: usize| {
                let cell = usize::try_from((base[c] as i64).saturating_sub(self.low[c])).ok()? + bit(c);
                (cell < self.count[c]).then_some(cell)
            };
            let cell = || Some((along(2)? * self.count[1] + along(1)?) * self.count[0] + along(0)?);
            (cell(), part(0) * part(1) * part(2))
        })
    }
}
