//! Guides at one moment.

use super::moment::{GuideMotion, HeadMotion};
use super::rest_guide::{DeviationIntegral, GuidePlace, RestGuide};
use crate::rod::RodShape;
use nalgebra::Vector3;

/// A guide at one moment.
#[derive(Debug)]
pub(super) struct PosedGuide {
    /// Positions of its points, m, world.
    x: Vec<Vector3<f64>>,
    /// For each point, a lower bound on the distance from all bodies, m.
    pub clear: Vec<f64>,
    /// Integrals of its deviation and of the rate of that, one per segment.
    pub integrals: Vec<DeviationIntegral>,
}

impl PosedGuide {
    /// Poses a guide. `clear` gives the lower bound on the distance from all bodies for the index of a point
    /// and its position.
    pub fn new(
        shape: &mut RodShape,
        rest: &RestGuide,
        head: &HeadMotion,
        motion: &GuideMotion,
        clear: impl Fn(usize, &Vector3<f64>) -> f64,
    ) -> Self {
        let GuideMotion { rod, q, rate } = motion;
        shape.update(rod, &(head.rotation * rod.root.r), q);
        let (root, _) = head.carry(&rod.root.p);
        let x: Vec<_> = (0..shape.points()).map(|k| root + shape.x(k)).collect();
        PosedGuide {
            clear: x.iter().enumerate().map(|(k, x)| clear(k, x)).collect(),
            x,
            integrals: rest.deviation_integrals(q, rate),
        }
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

    /// Whether that bound exceeds `distance`, m.
    pub fn is_clear(&self, place: GuidePlace, x: &Vector3<f64>, distance: f64) -> bool {
        self.distance_bound(place, x) > distance
    }
}
