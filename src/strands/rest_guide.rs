//! Guides at rest.

use super::curl::{HalfPhase, IN_PHASE, Winding, about, half_phase, wound};
use super::guide_place::GuidePlace;
use crate::math::se3::Pose;
use crate::rod::{Rod, RodShape};
use nalgebra::{Matrix3, Vector3};

/// A guide at rest.
#[derive(Debug, Clone)]
pub(super) struct RestGuide {
    arc: Vec<f64>,
    pose: Vec<Pose>,
    tangent: Vec<Vector3<f64>>,
    root: Vector3<f64>,
    /// If it winds, at its points.
    winding: Option<Winding>,
    /// Axes that it winds about at its points ([`axis`]), rest space; empty if it does not wind.
    axes: Vec<Vector3<f64>>,
}

/// What corresponds on a guide to a point of another.
#[derive(Debug, Clone)]
pub(super) struct Counterpart {
    /// The place at the same arc length.
    pub place: GuidePlace,
    /// Half phase of the other's curl relative to the guide's.
    pub half_phase: HalfPhase,
    /// Unit tangent of the other, turned back by the phase, rest space.
    pub tangent: Vector3<f64>,
}

impl RestGuide {
    pub fn new(rod: &Rod) -> Self {
        let mut shape = RodShape::default();
        shape.update(rod, &rod.root.r, &vec![0.0; rod.unknowns()]);
        let tangent: Vec<_> = (0..shape.points()).map(|k| shape.tangent(k)).collect();
        let x: Vec<_> = (0..shape.points()).map(|k| shape.x(k)).collect();
        let arc = rod.arc.clone();
        let wound = wound(&arc, &x, &tangent);
        let (winding, axes) = wound.map_or((None, Vec::new()), |(winding, axes)| (Some(winding), axes));
        RestGuide { pose: shape.poses().collect(), tangent, root: rod.root.p, winding, axes, arc }
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
        GuidePlace::at(&self.arc, s)
    }

    /// How its curl is averaged, if it winds.
    pub fn winding(&self) -> Option<&Winding> {
        self.winding.as_ref()
    }

    /// The axis at a place of a guide that winds, rest space.
    pub fn axis(&self, place: GuidePlace) -> Vector3<f64> {
        place.position(|k| self.axes[k])
    }

    /// Half phase, relative to its curl at a place of a guide that winds, of a curl with the unit tangent
    /// `tangent` about `axis`.
    pub fn half_phase(&self, place: GuidePlace, tangent: &Vector3<f64>, axis: &Vector3<f64>) -> HalfPhase {
        let own = place.position(|k| self.tangent[k]);
        half_phase([tangent, axis], [&own, &self.axis(place)])
    }

    /// What corresponds on it to the points of `other`: places at their arc lengths, or at the same fractions
    /// of the lengths if `other` is longer.
    pub fn counterparts(&self, other: &RestGuide) -> Vec<Counterpart> {
        let pace = (self.length() / other.length()).min(1.0);
        let counterpart = |(k, s): (usize, &f64)| {
            let (place, tangent) = (self.place(s * pace), other.tangent[k]);
            match other.axes.get(k).filter(|_| self.winding.is_some()) {
                None => Counterpart { place, half_phase: IN_PHASE, tangent },
                Some(axis) => {
                    let half_phase = self.half_phase(place, &tangent, axis);
                    let turned = about(&self.axis(place), half_phase).rotate_back(tangent.into());
                    Counterpart { place, half_phase, tangent: turned.into() }
                }
            }
        };
        other.arc.iter().enumerate().map(counterpart).collect()
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
