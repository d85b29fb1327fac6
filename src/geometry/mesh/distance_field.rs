//! Bounds of the distance to a mesh that keeps its shape, remembered in a grid: where much hair asks about much the same places.
//!
//! Where there is no surface between two points, both are on the same side of it, but for open meshes: there the side changes, without a surface,
//! where the border ceases to be what is closest. So near such places the grid says nothing of the side.

use super::solid_mesh::SolidMesh;
use crate::geometry::bounds::Bounds;
use crate::math::polyline::closest_on_segment;
use nalgebra::Vector3;
use parry3d_f64::bounding_volume::Aabb;
use parry3d_f64::partitioning::{Bvh, BvhBuildStrategy};
use std::sync::OnceLock;
use std::sync::atomic::{AtomicU32, Ordering};

/// How far beyond the mesh the grid reaches, m.
const MARGIN: f64 = 0.05;

/// Least size of a cell, m.
const FINEST: f64 = 3e-3;

/// Most cells.
const CELLS: f64 = 2e6;

/// Sizes of the cells of the grids, in those of the finest one: far away a few numbers tell enough.
const COARSENESS: [f64; 4] = [8.0, 4.0, 2.0, 1.0];

/// Grids over a mesh.
#[derive(Debug)]
pub struct DistanceField {
    /// The mesh's own box.
    bounds: Bounds,
    /// Ends of the edges of open borders, m, and a hierarchy over them; none of a closed mesh.
    border: Option<(Vec<[Vector3<f64>; 2]>, Bvh)>,
    /// Corner of the grids, m.
    corner: Vector3<f64>,
    /// The finest last.
    grids: [Grid; COARSENESS.len()],
}

/// A grid over a mesh. Each cell holds the signed distance of its middle, or minus that where it says nothing of the side, found when the cell is first
/// asked for: a number that follows from the cell alone, so that it does not matter who asks first.
#[derive(Debug)]
struct Grid {
    /// Size of its cells, m.
    cell: f64,
    /// Cells along each axis.
    count: [usize; 3],
    /// The bits of an f32, m; NaN where nobody asked yet.
    distance: OnceLock<Vec<AtomicU32>>,
}

impl Grid {
    /// What is surely farther than the surface is from the middle of a cell, m, by what is known of the cells beside it: it shortens the search.
    fn horizon(&self, cells: &[AtomicU32], cell: [usize; 3]) -> f64 {
        let beside =
            (0..3).flat_map(|axis| [1, usize::MAX].map(|step| (axis, cell[axis].wrapping_add(step))));
        let known = beside.filter(|(axis, at)| *at < self.count[*axis]).map(|(axis, at)| {
            let mut cell = cell;
            cell[axis] = at;
            f64::from(f32::from_bits(cells[self.slot(cell)].load(Ordering::Relaxed)).abs())
        });
        // An unknown distance is no number, and none the least.
        known.fold(f64::INFINITY, f64::min) * (1.0 + 1e-6) + 1.01 * self.cell
    }

    fn slot(&self, [x, y, z]: [usize; 3]) -> usize {
        (z * self.count[1] + y) * self.count[0] + x
    }
}

impl DistanceField {
    /// Grids that nobody has asked yet; they take memory from the first question on.
    pub fn new(mesh: &SolidMesh) -> Self {
        let bounds = Bounds::around(&mesh.vertices, 0.0);
        let size = (bounds.max - bounds.min).add_scalar(2.0 * MARGIN);
        let finest = (size.product() / CELLS).cbrt().max(FINEST);
        let grids = COARSENESS.map(|coarseness| {
            let cell = coarseness * finest;
            let count = std::array::from_fn(|i| (size[i] / cell).ceil() as usize);
            Grid { cell, count, distance: OnceLock::new() }
        });
        let corner = bounds.min.add_scalar(-MARGIN);
        let edges: Vec<_> = mesh.border().collect();
        let boxes: Vec<Aabb> =
            edges.iter().map(|[a, b]| Aabb::new(a.inf(b).into(), a.sup(b).into())).collect();
        let border = (!edges.is_empty()).then(|| (edges, Bvh::from_leaves(BvhBuildStrategy::Binned, &boxes)));
        DistanceField { bounds, border, corner, grids }
    }

    /// Whether there is an open border within `reach`, m, of `p`.
    fn near_border(&self, p: &Vector3<f64>, reach: f64) -> bool {
        let Some((edges, bvh)) = &self.border else { return false };
        let around = Bounds { min: p.add_scalar(-reach), max: p.add_scalar(reach) };
        bvh.leaves(|node| around.meets(node)).any(|i| {
            let [a, b] = &edges[i as usize];
            (p - a.lerp(b, closest_on_segment(p, a, b))).norm() < reach
        })
    }

    /// What a cell of `grid` holds, and how far `p`, body frame, may be from its middle, m, with a margin for rounding; `None` beyond the grid.
    fn cell(&self, grid: &Grid, mesh: &SolidMesh, p: &Vector3<f64>) -> Option<(f64, f64)> {
        let at = (p - self.corner) / grid.cell;
        if (0..3).any(|i| at[i] < 0.0 || at[i] >= grid.count[i] as f64) {
            return None;
        }
        let cell = at.map(|x| x as usize);
        let middle = self.corner + cell.map(|i| i as f64 + 0.5) * grid.cell;
        let cells = grid.distance.get_or_init(|| {
            let none = || AtomicU32::new(f32::NAN.to_bits());
            std::iter::repeat_with(none).take(grid.count.iter().product()).collect()
        });
        let slot = &cells[grid.slot([cell.x, cell.y, cell.z])];
        let mut distance = f32::from_bits(slot.load(Ordering::Relaxed));
        if distance.is_nan() {
            let horizon = grid.horizon(cells, [cell.x, cell.y, cell.z]);
            distance = mesh.closest(&middle, horizon).map_or(f32::MAX, |s| s.distance as f32);
            // So far away it is not closest anywhere in the cell.
            let diagonal = grid.cell * 3.0_f64.sqrt();
            if self.near_border(&middle, f64::from(distance.abs()) + diagonal) {
                distance = -distance.abs();
            }
            slot.store(distance.to_bits(), Ordering::Relaxed);
        }
        // For the rounding of an f32.
        let (distance, away) = (f64::from(distance), (p - middle).norm() + 1e-6 * grid.cell);
        Some((distance, away + 1e-7 * distance.abs()))
    }

    /// What the distance of a place that is beyond the grids is not below, m.
    fn beyond(&self, p: &Vector3<f64>) -> f64 {
        let gap = (self.bounds.min - p).sup(&(p - self.bounds.max)).sup(&Vector3::zeros());
        gap.norm() * (1.0 - 1e-9)
    }

    /// What the signed distance of `p`, body frame, from the mesh is not below, and its magnitude not above, m.
    pub fn bounds(&self, mesh: &SolidMesh, p: &Vector3<f64>) -> [f64; 2] {
        let [.., finest] = &self.grids;
        match self.cell(finest, mesh, p) {
            Some((distance, away)) => [distance - away, distance.abs() + away],
            None => [self.beyond(p), f64::INFINITY],
        }
    }

    /// What the signed distance of `p`, body frame, from the mesh is not below, m: outside, a third of that at least, but near the surface and a border.
    pub fn least(&self, mesh: &SolidMesh, p: &Vector3<f64>) -> f64 {
        let mut least = self.beyond(p);
        for grid in &self.grids {
            let Some((distance, away)) = self.cell(grid, mesh, p) else { continue };
            least = distance - away;
            // The distance is then three times that at most.
            if least > away {
                break;
            }
        }
        least
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Shape;
    use proptest::prelude::*;

    /// A capsule of triangles, whole or without some of them.
    fn capsule(open: bool) -> SolidMesh {
        let solid =
            Shape::Capsule { ends: [Vector3::zeros(), Vector3::y() * 0.05], radius: 0.03 }.tessellate();
        let kept = solid.triangles.iter().enumerate().filter(|(i, _)| !open || i % 50 != 7);
        SolidMesh::new(&solid.vertices, &kept.map(|(_, t)| *t).collect::<Vec<_>>())
    }

    proptest! {
        #[test]
        fn bounds_hold_in_the_grid_and_beyond_it(places in prop::collection::vec(prop::array::uniform3(-0.15..0.15_f64), 40)) {
            for open in [false, true] {
                let mesh = capsule(open);
                let field = DistanceField::new(&mesh);
                for p in places.iter().map(|p| Vector3::from(*p)) {
                    let d = mesh.closest(&p, f64::INFINITY).unwrap().distance;
                    // Asked twice: what is found, and what is remembered.
                    for ([least, most], far) in [(); 2].map(|()| (field.bounds(&mesh, &p), field.least(&mesh, &p))) {
                        prop_assert!(least <= d && d.abs() <= most, "{least} {d} {most}");
                        prop_assert!(open || least > d - 0.02 || d > 0.05, "{least} tells nothing of {d}");
                        prop_assert!(far <= d && (open || !(0.02..0.05).contains(&d) || 3.0 * far > d), "{far} of {d}");
                    }
                }
            }
        }
    }
}
