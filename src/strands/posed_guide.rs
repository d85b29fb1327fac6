//! Guides at one moment.

use super::moment::{GuideMotion, HeadMotion};
use super::moving_rotation::MovingRotation;
use super::rest_guide::{GuidePlace, RestGuide};
use crate::rod::{RodShape, Sensitivity};
use nalgebra::Vector3;

/// A guide at one moment.
#[derive(Debug)]
pub(super) struct PosedGuide {
    /// Positions of its points, m, world.
    x: Vec<Vector3<f64>>,
    /// For each point, a lower bound on the distance from all bodies, m; empty if they are not looked for.
    pub clear: Vec<f64>,
    /// Rotations of its frames from rest space to world, one per point. Quaternions of neighbours have the
    /// same sign.
    pub rotations: Vec<MovingRotation<f64>>,
}

/// Guides at one moment.
#[derive(Debug)]
pub struct PosedGuides {
    pub(super) guides: Vec<PosedGuide>,
    /// For each pair of guides and each point of the first, how the second is rotated relative to it
    /// ([`MovingRotation::difference`]), as one array.
    pub(super) differences: Vec<Vec<[f64; 6]>>,
}

impl PosedGuide {
    /// Poses a guide. `clear`, if given, is the lower bound on the distance from all bodies for the position
    /// of a point.
    pub fn new(
        (shape, sensitivity): &mut (RodShape, Sensitivity),
        rest: &RestGuide,
        head: &HeadMotion,
        motion: &GuideMotion,
        clear: Option<impl Fn(&Vector3<f64>) -> f64>,
    ) -> Self {
        let GuideMotion { rod, q, rate } = motion;
        shape.update(rod, &(head.rotation * rod.root.r), q);
        sensitivity.update(rod, shape, q);
        let (root, _) = head.carry(&rod.root.p);
        let x: Vec<_> = (0..shape.points()).map(|k| root + shape.x(k)).collect();
        let mut rotations: Vec<MovingRotation<f64>> = Vec::with_capacity(x.len());
        for (k, rotation) in rest.rotations(shape.poses()).enumerate() {
            let spin = head.spin + sensitivity.velocity(k, &shape.x(k), rate).1;
            let rotation = MovingRotation::new(&rotation, &spin);
            rotations.push(rotations.last().map_or(rotation, |last| rotation.with_sign_of(last)));
        }
        PosedGuide { clear: clear.map_or_else(Vec::new, |clear| x.iter().map(clear).collect()), x, rotations }
    }

    /// Rotation from rest to the frame at a place.
    #[inline(always)]
    pub fn rotation(&self, place: GuidePlace) -> MovingRotation<f64> {
        let (from, to, u) = place.ends(&self.rotations);
        from.lerp(to, u)
    }

    /// How `other` at its `places` turns the tangents of this guide, which is `rest` at rest, otherwise than
    /// this guide does.
    pub fn differences(&self, rest: &RestGuide, other: &PosedGuide, places: &[GuidePlace]) -> Vec<[f64; 6]> {
        let difference = |((own, place), tangent): ((&MovingRotation<f64>, &GuidePlace), &Vector3<f64>)| {
            let [turn, rate] = own.difference(&other.rotation(*place), tangent);
            [turn.x, turn.y, turn.z, rate.x, rate.y, rate.z]
        };
        self.rotations.iter().zip(places).zip(rest.tangents()).map(difference).collect()
    }

    /// Position of a place, m, world.
    pub fn position(&self, place: GuidePlace) -> Vector3<f64> {
        place.position(|k| self.x[k])
    }

    /// Lower bound on the distance of `x` (near `place`; m, world) from all bodies, m. It costs no search.
    pub fn distance_bound(&self, place: GuidePlace, x: &Vector3<f64>) -> f64 {
        let k = place.nearest_point();
        self.clear[k] - (x - self.x[k]).norm()
    }

    /// Whether that bound is known and exceeds `distance`, m.
    pub fn is_clear(&self, place: GuidePlace, x: &Vector3<f64>, distance: f64) -> bool {
        !self.clear.is_empty() && self.distance_bound(place, x) > distance
    }
}
