//! Guides at rest, and places on them.

use crate::math::se3::Pose;
use crate::rod::{Rod, RodShape};
use nalgebra::{Matrix3, Vector3};

/// A place on a guide: a segment of its polyline and the fraction (0..=1) along it.
#[derive(Debug, Clone, Copy)]
pub(super) struct GuidePlace {
    segment: u32,
    u: f32,
}

impl GuidePlace {
    /// Position of the place, given those of the points, m.
    pub fn position(self, x: impl Fn(usize) -> Vector3<f64>) -> Vector3<f64> {
        let k = self.segment as usize;
        x(k).lerp(&x(k + 1), f64::from(self.u))
    }

    /// The values at the ends of its segment, given those at the points, and the fraction along it.
    #[inline(always)]
    pub fn ends<T>(self, of: &[T]) -> (&T, &T, f64) {
        let k = self.segment as usize;
        (&of[k], &of[k + 1], f64::from(self.u))
    }

    /// Index of the nearest point.
    pub fn nearest_point(self) -> usize {
        self.segment as usize + usize::from(self.u >= 0.5)
    }
}

/// A guide at rest.
#[derive(Debug, Clone)]
pub(super) struct RestGuide {
    arc: Vec<f64>,
    pose: Vec<Pose>,
    tangent: Vec<Vector3<f64>>,
    root: Vector3<f64>,
}

impl RestGuide {
    pub fn new(rod: &Rod) -> Self {
        let mut shape = RodShape::default();
        shape.update(rod, &rod.root.r, &vec![0.0; rod.unknowns()]);
        let tangent = (0..shape.points()).map(|k| shape.tangent(k)).collect();
        RestGuide { arc: rod.arc.clone(), pose: shape.poses().collect(), tangent, root: rod.root.p }
    }

    /// Position of the root, m, rest space.
    pub fn root(&self) -> Vector3<f64> {
        self.root
    }

    /// Length, m.
    pub fn length(&self) -> f64 {
        self.arc[self.arc.len() - 1]
    }

    /// Position of a place, m, rest space.
    pub fn position(&self, place: GuidePlace) -> Vector3<f64> {
        self.root + place.position(|k| self.pose[k].p)
    }

    /// The place at arc length `s`, m, clamped to the tip.
    pub fn place(&self, s: f64) -> GuidePlace {
        let i = self.arc.partition_point(|&a| a <= s).clamp(1, self.arc.len() - 1);
        let (from, to) = (self.arc[i - 1], self.arc[i]);
        GuidePlace { segment: i as u32 - 1, u: ((s - from) / (to - from)).clamp(0.0, 1.0) as f32 }
    }

    /// The places on it at the arc lengths of the points of `other`, or at the same fractions of the lengths
    /// if `other` is longer.
    pub fn places_beside(&self, other: &RestGuide) -> Vec<GuidePlace> {
        let pace = (self.length() / other.length()).min(1.0);
        other.arc.iter().map(|s| self.place(s * pace)).collect()
    }

    /// Unit tangents at the points, rest space.
    pub fn tangents(&self) -> &[Vector3<f64>] {
        &self.tangent
    }

    /// Rotations of its frames from rest to `poses`, one per point.
    pub fn rotations(&self, poses: impl Iterator<Item = Pose>) -> impl Iterator<Item = Matrix3<f64>> {
        self.pose.iter().zip(poses).map(|(rest, now)| now.r * rest.r.transpose())
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use crate::rod::RodSource;

    /// A guide through `points`, m, with two nodes that have unknowns.
    pub fn guide_through(points: &[Vector3<f64>]) -> RestGuide {
        let rod = Rod::new(&RodSource {
            stiffness: [1e-9; 3],
            line_density: 1e-5,
            ..RodSource::hair(points, &[0.0, 0.5, 1.0])
        });
        RestGuide::new(&rod.unwrap())
    }

    #[test]
    fn place_moves_with_arc_length_also_between_points() {
        let points: Vec<_> =
            (0..50).map(|i| f64::from(i) * 0.05).map(|t| Vector3::new(t.cos(), t.sin(), t) * 0.05).collect();
        let guide = guide_through(&points);
        let at = |i: usize| guide.position(guide.place(guide.length() * i as f64 / 400.0));
        for i in 0..400 {
            let moved = (at(i + 1) - at(i)).norm() / (guide.length() / 400.0);
            assert!((0.97..1.0 + 1e-6).contains(&moved), "{i}: {moved}");
        }
        assert_eq!(guide.position(guide.place(2.0 * guide.length())), at(400));
    }
}
