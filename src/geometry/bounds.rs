//! Axis-aligned bounding boxes.

use nalgebra::Vector3;
use parry3d_f64::bounding_volume::Aabb;
use parry3d_f64::partitioning::BvhNode;

/// An axis-aligned bounding box.
#[derive(Debug, Clone, Copy)]
pub struct Bounds {
    /// Lower corner, m.
    pub min: Vector3<f64>,
    /// Upper corner, m.
    pub max: Vector3<f64>,
}

impl Bounds {
    /// The bounding box of `points`, grown by `margin`, m, on all sides.
    pub fn around<'a>(points: impl IntoIterator<Item = &'a Vector3<f64>>, margin: f64) -> Self {
        let mut min = Vector3::repeat(f64::INFINITY);
        let mut max = -min;
        for p in points {
            min = min.inf(p);
            max = max.sup(p);
        }
        Bounds { min: min.add_scalar(-margin), max: max.add_scalar(margin) }
    }

    /// Whether the two closed boxes intersect.
    pub fn overlaps(&self, other: &Bounds) -> bool {
        (0..3).all(|i| self.min[i] <= other.max[i] && other.min[i] <= self.max[i])
    }

    /// Whether the box intersects that of a node of a bounding volume hierarchy.
    pub(super) fn overlaps_node(&self, node: &BvhNode) -> bool {
        let (lo, hi) = (node.mins(), node.maxs());
        lo.x <= self.max.x
            && lo.y <= self.max.y
            && lo.z <= self.max.z
            && hi.x >= self.min.x
            && hi.y >= self.min.y
            && hi.z >= self.min.z
    }
}

impl From<Bounds> for Aabb {
    fn from(b: Bounds) -> Self {
        Aabb::new(b.min.into(), b.max.into())
    }
}
