//! Axis-aligned boxes.

use nalgebra::Vector3;
use parry3d_f64::partitioning::BvhNode;

/// An axis-aligned box.
#[derive(Debug, Clone, Copy)]
pub struct Bounds {
    /// Lower corner.
    pub min: Vector3<f64>,
    /// Upper corner.
    pub max: Vector3<f64>,
}

impl Bounds {
    /// The box of some points, grown by `margin` on all sides.
    pub fn around<'a>(points: impl IntoIterator<Item = &'a Vector3<f64>>, margin: f64) -> Self {
        let mut min = Vector3::repeat(f64::INFINITY);
        let mut max = -min;
        for p in points {
            min = min.inf(p);
            max = max.sup(p);
        }
        Bounds { min: min.add_scalar(-margin), max: max.add_scalar(margin) }
    }

    /// Whether two boxes have a point in common.
    pub fn overlaps(&self, other: &Bounds) -> bool {
        (0..3).all(|i| self.min[i] <= other.max[i] && other.min[i] <= self.max[i])
    }

    pub(super) fn meets(&self, node: &BvhNode) -> bool {
        let (lo, hi) = (node.mins(), node.maxs());
        lo.x <= self.max.x
            && lo.y <= self.max.y
            && lo.z <= self.max.z
            && hi.x >= self.min.x
            && hi.y >= self.min.y
            && hi.z >= self.min.z
    }
}
