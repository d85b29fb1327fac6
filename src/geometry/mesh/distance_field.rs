//! Cached bounds of the distance to a rigid mesh, for many strands that query nearby places.
//!
//! Two points without surface between them are on the same side of it. The exception is an open mesh: where
//! its boundary ceases to be the closest feature, the side changes without a surface. Near such places a cell
//! does not record the side.

use super::solid_mesh::SolidMesh;
use crate::geometry::bounds::Bounds;
use crate::math::polyline::closest_on_segment;
use nalgebra::Vector3;
use parry3d_f64::bounding_volume::Aabb;
use parry3d_f64::partitioning::{Bvh, BvhBuildStrategy};
use std::sync::OnceLock;
use std::sync::atomic::{AtomicU32, Ordering};

/// Margin of the grids around the mesh, m.
const MARGIN: f64 = 0.05;

/// Minimum cell size, m.
const FINEST: f64 = 3e-3;

/// Maximum number of cells of the finest grid.
const CELLS: f64 = 2e6;

/// Cell sizes of the grids relative to the finest. Far away few cells suffice.
const COARSENESS: [f64; 4] = [8.0, 4.0, 2.0, 1.0];

/// Nested grids of distances around a mesh, filled on demand.
#[derive(Debug)]
pub struct DistanceField {
    /// Bounding box of the mesh.
    bounds: Bounds,
    /// Ends of the boundary edges, m, and a hierarchy over them; `None` for a closed mesh.
    boundary: Option<(Vec<[Vector3<f64>; 2]>, Bvh)>,
    /// Lower corner of the grids, m.
    corner: Vector3<f64>,
    /// From coarse to fine.
    grids: [Grid; COARSENESS.len()],
}

/// A grid of signed distances at the centres of its cells; negated magnitudes where the side is not recorded.
/// A cell is computed when it is first queried. Its value depends on the cell alone, so the order of queries
/// does not matter.
#[derive(Debug)]
struct Grid {
    /// Cell size, m.
    cell: f64,
    /// Number of cells along each axis.
    count: [usize; 3],
    /// Bits of an f32, m; NaN until computed.
    distance: OnceLock<Vec<AtomicU32>>,
}

impl Grid {
    /// Upper bound, m, on the distance at the centre of a cell, from the cells next to it. It shortens the
    /// search.
    fn horizon(&self, cells: &[AtomicU32], cell: [usize; 3]) -> f64 {
        let beside =
            (0..3).flat_map(|axis| [1, usize::MAX].map(|step| (axis, cell[axis].wrapping_add(step))));
        let known = beside.filter(|(axis, at)| *at < self.count[*axis]).map(|(axis, at)| {
            let mut cell = cell;
            cell[axis] = at;
            f64::from(f32::from_bits(cells[self.slot(cell)].load(Ordering::Relaxed)).abs())
        });
        // `min` ignores NaN, the value of a cell not yet computed.
        known.fold(f64::INFINITY, f64::min) * (1.0 + 1e-6) + 1.01 * self.cell
    }

    fn slot(&self, [x, y, z]: [usize; 3]) -> usize {
        (z * self.count[1] + y) * self.count[0] + x
    }
}

impl DistanceField {
    /// Empty grids around `mesh`; they allocate on the first query.
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
        let edges: Vec<_> = mesh.boundary().collect();
        let boxes: Vec<Aabb> =
            edges.iter().map(|[a, b]| Aabb::new(a.inf(b).into(), a.sup(b).into())).collect();
        let boundary =
            (!edges.is_empty()).then(|| (edges, Bvh::from_leaves(BvhBuildStrategy::Binned, &boxes)));
        DistanceField { bounds, boundary, corner, grids }
    }

    /// Lower bound on the signed distance of `p`, body frame, from `mesh`, and upper bound on its magnitude,
    /// m.
    pub fn bounds(&self, mesh: &SolidMesh, p: &Vector3<f64>) -> [f64; 2] {
        let [.., finest] = &self.grids;
        match self.cell(finest, mesh, p) {
            Some((distance, away)) => [distance - away, distance.abs() + away],
            None => [self.distance_to_box(p), f64::INFINITY],
        }
    }

    /// Lower bound, m, on the signed distance of `p`, body frame, from `mesh`. Outside it is at least a third
    /// of the distance, except near the surface and near a boundary.
    pub fn lower_bound(&self, mesh: &SolidMesh, p: &Vector3<f64>) -> f64 {
        let mut bound = self.distance_to_box(p);
        for grid in &self.grids {
            let Some((distance, away)) = self.cell(grid, mesh, p) else { continue };
            bound = distance - away;
            // The distance is then at most three times the bound.
            if bound > away {
                break;
            }
        }
        bound
    }

    /// Value of the cell of `grid` that contains `p`, body frame, and an upper bound on the distance of `p`
    /// from its centre, m, including rounding; `None` outside the grid.
    fn cell(&self, grid: &Grid, mesh: &SolidMesh, p: &Vector3<f64>) -> Option<(f64, f64)> {
        let at = (p - self.corner) / grid.cell;
        if (0..3).any(|i| at[i] < 0.0 || at[i] >= grid.count[i] as f64) {
            return None;
        }
        let cell = at.map(|x| x as usize);
        let centre = self.corner + cell.map(|i| i as f64 + 0.5) * grid.cell;
        let cells = grid.distance.get_or_init(|| {
            let none = || AtomicU32::new(f32::NAN.to_bits());
            std::iter::repeat_with(none).take(grid.count.iter().product()).collect()
        });
        let slot = &cells[grid.slot([cell.x, cell.y, cell.z])];
        let mut distance = f32::from_bits(slot.load(Ordering::Relaxed));
        if distance.is_nan() {
            let horizon = grid.horizon(cells, [cell.x, cell.y, cell.z]);
            distance = mesh.closest(&centre, horizon).map_or(f32::MAX, |s| s.distance as f32);
            // Beyond this distance the boundary is not the closest feature anywhere in the cell.
            let diagonal = grid.cell * 3.0_f64.sqrt();
            if self.near_boundary(&centre, f64::from(distance.abs()) + diagonal) {
                distance = -distance.abs();
            }
            slot.store(distance.to_bits(), Ordering::Relaxed);
        }
        // The margins cover the rounding of an f32.
        let (distance, away) = (f64::from(distance), (p - centre).norm() + 1e-6 * grid.cell);
        Some((distance, away + 1e-7 * distance.abs()))
    }

    /// Whether a boundary edge lies within `reach`, m, of `p`.
    fn near_boundary(&self, p: &Vector3<f64>, reach: f64) -> bool {
        let Some((edges, bvh)) = &self.boundary else { return false };
        let around = Bounds { min: p.add_scalar(-reach), max: p.add_scalar(reach) };
        bvh.leaves(|node| around.overlaps_node(node)).any(|i| {
            let [a, b] = &edges[i as usize];
            (p - a.lerp(b, closest_on_segment(p, a, b))).norm() < reach
        })
    }

    /// Distance of `p` from the bounding box of the mesh, m, rounded down.
    fn distance_to_box(&self, p: &Vector3<f64>) -> f64 {
        let gap = (self.bounds.min - p).sup(&(p - self.bounds.max)).sup(&Vector3::zeros());
        gap.norm() * (1.0 - 1e-9)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::shape::Shape;
    use proptest::prelude::*;

    /// A tessellated capsule, closed or cut in half.
    fn capsule(open: bool) -> SolidMesh {
        let solid =
            Shape::Capsule { ends: [Vector3::zeros(), Vector3::y() * 0.05], radius: 0.03 }.tessellate();
        let is_right = |t: &[u32; 3]| t.iter().any(|&v| solid.vertices[v as usize].x > 0.0);
        let kept = solid.triangles.iter().filter(|t| !open || is_right(t));
        SolidMesh::new(&solid.vertices, &kept.copied().collect::<Vec<_>>())
    }

    proptest! {
        #[test]
        fn bounds_hold_inside_and_outside_the_grid(
            places in prop::collection::vec(prop::array::uniform3(-0.15..0.15_f64), 40)
        ) {
            for open in [false, true] {
                let mesh = capsule(open);
                let field = DistanceField::new(&mesh);
                for p in places.iter().map(|p| Vector3::from(*p)) {
                    let d = mesh.closest(&p, f64::INFINITY).unwrap().distance;
                    // Twice: computed, then cached.
                    for _ in 0..2 {
                        let ([least, most], far) = (field.bounds(&mesh, &p), field.lower_bound(&mesh, &p));
                        prop_assert!(least <= d && d.abs() <= most, "{least} {d} {most}");
                        prop_assert!(open || least > d - 0.02 || d > 0.05, "{least} is too loose for {d}");
                        let tight = open || !(0.02..0.05).contains(&d) || 3.0 * far > d;
                        prop_assert!(far <= d && tight, "{far} of {d}");
                    }
                }
            }
        }
    }
}
